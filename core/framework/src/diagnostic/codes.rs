//! The table of all codes, so that none is given twice; when each is reported is decided by its layer.

/// A kind of mistake, as `athermal explain CODE` tells it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Code {
    /// The code: `A` and three digits. It never changes its meaning.
    pub code: &'static str,
    /// What it is about, in a few words.
    pub title: &'static str,
    /// Why it is a mistake and what to do.
    pub explanation: &'static str,
}

const fn code(code: &'static str, title: &'static str, explanation: &'static str) -> Code {
    Code {
        code,
        title,
        explanation,
    }
}

/// Every code, in ascending order: A001 to A039 for reading files, A040 and above for compiling them, A070 to A089 for their tests.
pub const CODES: &[Code] = &[
    code(
        "A001",
        "syntax",
        "The file is not TOML. Every syntax error is shown; nothing else is checked until there is none.",
    ),
    code(
        "A002",
        "unreadable file",
        "A file named on the command line or by `extends` cannot be read, or is not UTF-8.",
    ),
    code(
        "A003",
        "too large",
        "Files have at most 16 MB, tables nest at most 64 deep, and `extends` chains have at most 16 files.",
    ),
    code(
        "A004",
        "schema",
        "Every graph file says `schema = 1`, so that a later version of the language is never misread.",
    ),
    code(
        "A005",
        "extends",
        "`extends` names one file. A chain of files that comes back to itself has no beginning.",
    ),
    code(
        "A006",
        "unknown key",
        "Unknown keys are errors everywhere, since a misspelt one would silently have no effect.",
    ),
    code(
        "A007",
        "missing key",
        "A table lacks a key that has no default.",
    ),
    code(
        "A008",
        "wrong type of value",
        "A key has a value of another type than it needs. Durations and quantities are texts with a unit.",
    ),
    code(
        "A009",
        "unknown choice",
        "A text names none of the choices that the key has.",
    ),
    code(
        "A010",
        "value out of range",
        "A value has the right type and is refused by what reads it.",
    ),
    code(
        "A011",
        "bad name",
        "Names begin with a letter, then letters, digits, `_` and `-`; members and channels may begin with a digit.",
    ),
    code(
        "A012",
        "duplicate name",
        "Nodes, sets and signals share one name space; members of a set and channels of a signal are distinct.",
    ),
    code(
        "A013",
        "unknown set",
        "`each` or `channels` names a set that `[sets]` does not have.",
    ),
    code(
        "A014",
        "unknown placeholder",
        "`{x}` stands for a member of a set that the node has in its `each`; `{channel}` for a signal's channel.",
    ),
    code(
        "A015",
        "empty list",
        "A set, a list of channels or a list of references has no entries.",
    ),
    code(
        "A016",
        "too many instances",
        "`each` would expand the graph beyond what fits into memory.",
    ),
    code(
        "A017",
        "unknown unit",
        "A unit is a UCUM code or a common spelling of one. Differences of temperatures are in K.",
    ),
    code(
        "A018",
        "duration or quantity",
        "A duration is a number and a unit of time, a quantity a number and a UCUM unit, in one text.",
    ),
    code(
        "A019",
        "nothing to remove",
        "`nodes.NAME = false` removes an inherited node, and there is none of that name.",
    ),
    code(
        "A020",
        "samples without sample time",
        "`2 samples` has a meaning only where `[time]` counts samples.",
    ),
    code(
        "A021",
        "column pattern",
        "The columns of a signal with several channels must differ: the pattern contains `{channel}`.",
    ),
    code(
        "A022",
        "bad range",
        "A range is `[low, high]`, both in units that convert to the signal's, the low one below the high one.",
    ),
    code(
        "A023",
        "unknown channel",
        "`optional` names a channel that the signal does not have.",
    ),
    code(
        "A024",
        "contradicting time",
        "`[time]` says two things that exclude each other, e.g. both `step` and a unit.",
    ),
    code(
        "A025",
        "modules",
        "`[modules]` and `module = ...` are reserved for a later version.",
    ),
    code(
        "A070",
        "nothing to run over",
        "A test runs over recorded or simulated data (`on`) or over made-up measurements (`inputs`): one of them.",
    ),
    code(
        "A071",
        "nothing expected",
        "A test without expectations, and an expectation without checks, could not fail.",
    ),
    code(
        "A072",
        "two tests of one name",
        "Tests are told apart by their names.",
    ),
    code(
        "A073",
        "unknown machine",
        "`simulate` names a machine that no linked crate brings.",
    ),
    code(
        "A074",
        "machine without the channel",
        "The simulated machine does not measure what the graph measures.",
    ),
    code(
        "A075",
        "unit in a test",
        "A quantity in a test does not convert to the unit of the channel that it is about.",
    ),
    code(
        "A076",
        "not a prediction",
        "Errors, R² and comparisons are about predictions of a measured truth; those compared predict the same one, as far ahead.",
    ),
    code(
        "A077",
        "keys of a test",
        "Keys of a test exclude one another, or one needs another.",
    ),
    code(
        "A078",
        "out of range in a test",
        "A number or duration in a test is out of its range.",
    ),
    code(
        "A079",
        "fault that does not fit",
        "The size of a fault does not fit its channel, or it needs one and there is no usual one.",
    ),
    code(
        "A080",
        "not measured",
        "Only measured channels can be given measurements or faults.",
    ),
    code(
        "A081",
        "channel given twice",
        "Two inputs of a test give measurements of the same channel.",
    ),
    code(
        "A082",
        "sample without a unit",
        "Samples are quantities; only `nan`, for no value, stands without a unit.",
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
