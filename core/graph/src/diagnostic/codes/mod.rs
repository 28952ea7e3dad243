//! The table of all codes, so that none is given twice; when each is reported is decided by its layer.
//!
//! Beside each code stand two whole graphs: one that has the mistake, and no other, and one that is right.

/// A kind of mistake, as `athermal explain CODE` tells it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Code {
    /// The code: `A` and three digits. It never changes its meaning.
    pub code: &'static str,
    /// What it is about, in a few words.
    pub title: &'static str,
    /// Why it is a mistake and what to do.
    pub explanation: &'static str,
    /// A graph file with the mistake, called `graph.toml`; `base.toml` beside it is any graph, `chuck.csv` a schedule.
    pub wrong: &'static str,
    /// A graph file without.
    pub right: &'static str,
}

macro_rules! code {
    ($code:literal, $title:literal, $explanation:literal) => {
        Code {
            code: $code,
            title: $title,
            explanation: $explanation,
            wrong: include_str!(concat!("pages/", $code, "-wrong.toml")),
            right: include_str!(concat!("pages/", $code, "-right.toml")),
        }
    };
}

/// Every code, in ascending order: A001 to A039 for reading files, A040 and above for compiling them, A070 to A089 and from A170 for their tests,
/// A110 for learning while they run, A180 for mistakes in the code of a node's kind, from A190 for the models that they name.
pub const CODES: &[Code] = &[
    code!(
        "A001",
        "syntax",
        "The file is not TOML. Every syntax error is shown; nothing else is checked until there is none."
    ),
    code!(
        "A002",
        "unreadable file",
        "A file named on the command line or by `extends` cannot be read, or is not UTF-8."
    ),
    code!(
        "A003",
        "too large",
        "Files have at most 16 MB, lists 200,000 values, tables nest at most 64 deep, and `extends` chains have at most 16 files."
    ),
    code!(
        "A004",
        "schema",
        "Every graph file says `schema = 1`, so that a later version of the language is never misread."
    ),
    code!(
        "A005",
        "extends",
        "`extends` names one file. A chain of files that comes back to itself has no beginning."
    ),
    code!(
        "A006",
        "unknown key",
        "Unknown keys are errors everywhere, since a misspelt one would silently have no effect."
    ),
    code!(
        "A007",
        "missing key",
        "A table lacks a key that has no default."
    ),
    code!(
        "A008",
        "wrong type of value",
        "A key has a value of another type than it needs. Durations and quantities are texts with a unit."
    ),
    code!(
        "A009",
        "unknown choice",
        "A text names none of the choices that the key has."
    ),
    code!(
        "A010",
        "value out of range",
        "A value has the right type and is refused by what reads it."
    ),
    code!(
        "A011",
        "bad name",
        "Names begin with a letter, then letters, digits, `_` and `-`; members and channels may begin with a digit."
    ),
    code!(
        "A012",
        "duplicate name",
        "Nodes, sets and signals share one name space; members of a set and channels of a signal are distinct."
    ),
    code!(
        "A013",
        "unknown set",
        "`each` or `channels` names a set that `[sets]` does not have."
    ),
    code!(
        "A014",
        "unknown placeholder",
        "`{x}` stands for a member of a set that the node has in its `each`; `{channel}` for a signal's channel."
    ),
    code!(
        "A015",
        "empty list",
        "A set, a list of channels or a list of references has no entries."
    ),
    code!(
        "A016",
        "too many instances",
        "`each` would expand the graph beyond what fits into memory."
    ),
    code!(
        "A017",
        "unknown unit",
        "A unit is a UCUM code or a common spelling of one. Differences of temperatures are in K."
    ),
    code!(
        "A018",
        "duration or quantity",
        "A duration is a number and a unit of time, a quantity a number and a UCUM unit, in one text."
    ),
    code!(
        "A019",
        "nothing to remove",
        "`nodes.NAME = false` removes an inherited node and `outputs.NAME = false` an inherited output, and there is none of that name."
    ),
    code!(
        "A020",
        "samples without sample time",
        "`2 samples` has a meaning only where `[time]` counts samples."
    ),
    code!(
        "A021",
        "column pattern",
        "The columns of a signal with several channels must differ: the pattern contains `{channel}`."
    ),
    code!(
        "A022",
        "bad range",
        "A range is `[low, high]`, both in units that convert to the signal's, the low one below the high one."
    ),
    code!(
        "A023",
        "unknown channel",
        "`optional` names a channel that the signal does not have."
    ),
    code!(
        "A024",
        "contradicting time",
        "`[time]` says two things that exclude each other, e.g. both `step` and a unit, or a `format` beside one."
    ),
    code!(
        "A025",
        "unknown module",
        "`module = \"…\"` names a module that `[modules]` does not have, neither here nor in the file that the module comes from."
    ),
    code!(
        "A026",
        "endless modules",
        "A module cannot be part of itself, and modules nest at most 16 deep."
    ),
    code!(
        "A027",
        "out of a module's reach",
        "Inside a module a reference names one of its nodes or begins with one of its inputs, so that it means the same wherever it is used."
    ),
    code!(
        "A028",
        "unknown output of a module",
        "A reference to an instance of a module names one of the outputs that the module declares; without one it means the first."
    ),
    code!(
        "A040",
        "unknown node type",
        "No crate in this program brings a node of this type. `athermal nodes` lists those that there are."
    ),
    code!(
        "A041",
        "ambiguous name",
        "Two crates in this program bring a node of the same type, or write what a node knows under the same name, so that a graph \
         or a file could mean either."
    ),
    code!(
        "A042",
        "unknown node or signal",
        "A reference begins with the name of a node or signal of the graph."
    ),
    code!(
        "A043",
        "unknown port",
        "What follows the `:` of a reference is one of the node's output ports. `athermal nodes TYPE` lists them."
    ),
    code!(
        "A044",
        "unknown channel",
        "A reference that matches nothing is a mistake, since an empty input would silently have no effect."
    ),
    code!(
        "A045",
        "unknown input",
        "A node has the inputs that its type declares, and no others."
    ),
    code!(
        "A046",
        "missing input",
        "A node needs every input of its type that is not optional."
    ),
    code!(
        "A047",
        "wrong number of channels",
        "An input takes a single channel, or as many as another, and the reference stands for more or fewer."
    ),
    code!(
        "A048",
        "units that do not fit",
        "Two things are compared or combined that do not measure the same. Where a factor is all that it takes (um/min to nm/min), it is inserted; between what does not convert, there is none."
    ),
    code!(
        "A049",
        "spans that do not fit",
        "Votes, and the truth that they are scored by, summarise the same length of time: a slope over 5 minutes is not one over 10."
    ),
    code!(
        "A050",
        "horizons that do not fit",
        "All voters of a combiner speak of the same instant, so they have the same `ahead`."
    ),
    code!(
        "A051",
        "nodes that wait for each other",
        "A node runs after those that it reads, so they cannot form a loop. Feedback goes through a `delay`, which gives what was known at an earlier tick."
    ),
    code!(
        "A052",
        "part of the answer",
        "A regressor, or a vote that is no prediction, overlaps the value that is predicted. Windows of neighbouring truths overlap, so a recent truth, a feature made of the truth's signal, or what learns from the truth while it runs, contains part of the answer, and scores would flatter. A lag of at least the truth's span less `ahead` is free of it."
    ),
    code!(
        "A053",
        "no maximum age",
        "A held value counts until it is too old, and nothing says when that is: neither the signal, nor the input, nor a window."
    ),
    code!(
        "A054",
        "parameters that do not fit",
        "The node's type refuses a parameter, or how its inputs fit together. `athermal nodes TYPE` says what it takes."
    ),
    code!(
        "A055",
        "an estimator without a horizon",
        "An estimator predicts the value that its truth will have at `t + ahead`, so it needs an `ahead`; `\"0s\"` is a virtual sensor."
    ),
    code!(
        "A056",
        "a truth that is a prediction",
        "An estimator learns from what was measured. A prediction, or a combination of predictions, is no truth, nor is what tells of one, such as its `std_dev` or `weights`."
    ),
    code!(
        "A057",
        "a limit in another unit",
        "Limits of the absolute truth are in a unit that converts to the truth's, and `blend` is a rate above zero in one that converts to the output's per second."
    ),
    code!(
        "A058",
        "duplicate channel",
        "Two channels of a port, or two columns of what comes out, would have the same name."
    ),
    code!(
        "A059",
        "unused node",
        "Nothing that comes out depends on the node. It costs time and probably shows a reference that was forgotten."
    ),
    code!(
        "A060",
        "unused signal",
        "Nothing that comes out depends on the signal."
    ),
    code!(
        "A061",
        "output without a signal",
        "No measured channel reaches the output, so it would never have a value."
    ),
    code!(
        "A062",
        "no outputs",
        "A graph says under `[outputs]` what it is for; without that nothing of it needs to be computed."
    ),
    code!(
        "A063",
        "point and difference",
        "Cel and [degF] are points on a scale, K is a difference. Turning one into the other takes an offset, which is never inserted: 1 K of expansion is not 1 Cel."
    ),
    code!(
        "A064",
        "limits that admit nothing",
        "`train.abs_truth` leaves no row to fit on: `below` is larger than `above`, and neither is negative."
    ),
    code!(
        "A065",
        "doubtful use",
        "The node works as it is written, but not as it is meant to be used: its documentation says what it wants."
    ),
    code!(
        "A066",
        "predictions of different truths",
        "All voters of a combiner predict the same thing, and are judged by it. A prediction of one axis is none of another, however alike the two are."
    ),
    code!(
        "A067",
        "a vote that is no prediction",
        "What an estimator or combiner gives first is its prediction. Its other ports, such as `std_dev`, `lower` or `weights`, tell of that prediction; put together with predictions they would make a number of no meaning."
    ),
    code!(
        "A068",
        "a channel that counts twice",
        "Each regressor and each vote counts once: the coefficients of two that are the same cannot be told apart, and a voter that stands twice would have twice the say."
    ),
    code!(
        "A069",
        "columns in another unit",
        "A table's columns are named for another unit than their signal's, which measures the same: what is read is taken as the signal says."
    ),
    code!(
        "A070",
        "nothing to run over",
        "A test runs over recorded or simulated data (`on`) or over made-up measurements (`inputs`): one of them."
    ),
    code!(
        "A071",
        "nothing expected",
        "A test without expectations, and an expectation without checks, could not fail."
    ),
    code!(
        "A072",
        "two tests of one name",
        "Tests are told apart by their names."
    ),
    code!(
        "A073",
        "unknown machine",
        "`simulate` names a machine that no linked crate brings."
    ),
    code!(
        "A074",
        "machine without the channel",
        "The simulated machine does not measure what the graph measures."
    ),
    code!(
        "A075",
        "unit in a test",
        "A quantity in a test does not convert to the unit of the channel that it is about."
    ),
    code!(
        "A076",
        "not a prediction",
        "Errors, R² and comparisons are about predictions of a measured truth; those compared predict the same one, as far ahead."
    ),
    code!(
        "A077",
        "keys of a test",
        "Keys of a test exclude one another, or one needs another."
    ),
    code!(
        "A078",
        "out of range in a test",
        "A number or duration in a test is out of its range."
    ),
    code!(
        "A079",
        "fault that does not fit",
        "The size of a fault does not fit its channel, or it needs one and there is no usual one."
    ),
    code!(
        "A080",
        "not measured",
        "Only measured channels can be given measurements or faults."
    ),
    code!(
        "A081",
        "channel given twice",
        "Two inputs of a test give measurements of the same channel."
    ),
    code!(
        "A082",
        "sample without a unit",
        "Samples are quantities; only `nan`, for no value, stands without a unit."
    ),
    code!(
        "A110",
        "estimator that does not learn",
        "`learn` lets an estimator go on learning while it runs. Not every kind can, and some only with certain parameters."
    ),
    code!(
        "A160",
        "a truth without a span",
        "What may be known of a truth, and when, follows from its span: the length of past time that one value summarises. A first-order lag depends on all of the past, so it has none unless `span` says how much of it counts."
    ),
    code!(
        "A170",
        "schedule of a machine",
        "`schedule` names a file of set points over time, the same as `athermal simulate --schedule` takes; every mistake in it is told where it stands."
    ),
    code!(
        "A180",
        "mistake of a plugin",
        "The code of the node's type does what no node may: it panics, or asks for values from the future. The graph is not at \
         fault, and can only do without the type until its author has mended it; `athermal nodes TYPE` names the crate."
    ),
    code!(
        "A190",
        "unusable model",
        "`model` names what `athermal fit` has written. `fit`, `compare`, `diff` and `test` do without it."
    ),
    code!(
        "A191",
        "model of another graph",
        "A machine file runs with the fits of its `model` only where the parameters and inputs of each estimator are those of the fit."
    ),
    code!(
        "A192",
        "fit on other values",
        "An estimator is as in the `model`, and what it reads is now made in another way: its coefficients may no longer be right."
    ),
];

/// The entry of a code, e.g. `"A006"`.
pub fn explain(code: &str) -> Option<&'static Code> {
    CODES
        .iter()
        .find(|entry| entry.code.eq_ignore_ascii_case(code))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_ascend_and_so_none_stands_twice() {
        assert!(CODES.windows(2).all(|pair| pair[0].code < pair[1].code));
        assert!(
            CODES
                .iter()
                .all(|entry| entry.code.len() == 4 && entry.explanation.ends_with('.'))
        );
    }

    #[test]
    fn a_code_is_explained_in_either_case() {
        assert_eq!(
            explain("a006").map(|entry| entry.title),
            Some("unknown key")
        );
        assert_eq!(explain("A999"), None);
    }
}
