//! What can be wrong with a test before it is run.

use crate::diagnostic::{Code, Place, Problem, names, problem};
use crate::fault::FaultError;
use crate::machine::schedule::Reason;
use crate::unit::Unit;

problem! {
    /// Nothing to run over.
    A070 NoData {}
    error: "nothing to run over",
    explanation: "A test runs over recorded or simulated data (`on`) or over made-up measurements (`inputs`): one of them.",
    message: "the test has nothing to run over",
    label: "neither `on` nor `inputs`",
    help: "name data with `on = \"FILE\"` or `on = { simulate = \"MACHINE\" }`, or make some up with `inputs`",
}

problem! {
    /// Both `on` and `inputs`.
    A070 TwoData { inputs: Place }
    message: "the test has both `on` and `inputs`",
    label: "one of them is too much",
    help: "run over data (`on`) in one test and over `inputs` in another",
    related: vec![(*inputs, "and here".to_owned())],
}

problem! {
    /// A test or an expectation that checks nothing.
    A071 NothingExpected { what: &'static str }
    error: "nothing expected",
    explanation: "A test without expectations, and an expectation without checks, could not fail.",
    message: format!("{what} checks nothing"),
    label: "nothing is expected",
    help: "add what must hold, such as `rmse_below`, `beats`, `valid_above`, `equals`, `between` or `absent`",
}

problem! {
    /// Two tests of the same name.
    A072 DuplicateName { name: String, first: Place }
    error: "two tests of one name",
    explanation: "Each test has a name of its own, by which it is reported.",
    message: format!("there are two tests named \"{name}\""),
    label: "the name is taken",
    help: "give each test a name of its own",
    related: vec![(*first, "the other is here".to_owned())],
}

problem! {
    /// A machine that cannot be simulated.
    A073 UnknownMachine { why: crate::registry::NotFound }
    error: "unknown machine",
    explanation: "`simulate` names a machine that no linked crate brings.",
    message: why.message(),
    label: if why.is_twice() { "which of them?" } else { "no such machine" },
    help: why.help(),
}

problem! {
    /// A machine that lacks what the graph measures.
    A074 MachineLacks {
        machine: &'static str,
        channels: Vec<String>,
        has: Vec<String>,
        /// The file that inherits the test, where it stands in another.
        inherited_by: Option<String>,
    }
    error: "machine without the channel",
    explanation: "The simulated machine does not measure what the graph measures.",
    message: format!("the machine `{machine}` does not measure {}", names(channels)),
    label: "lacks a channel",
    help: {
        let way_out = "a signal may call channels `optional`";
        match inherited_by {
            Some(file) => format!("{way_out}; {}", without_inherited(file)),
            None => format!("it measures {}; {way_out}", names(has)),
        }
    },
}

/// How a file does without the tests that it inherits.
fn without_inherited(file: &str) -> String {
    format!(
        "`tests = []` in {file}, or tests of its own there, take the place of those that it inherits"
    )
}

problem! {
    /// A quantity of another kind than the channel.
    A075 Units { key: &'static str, found: Unit, channel: String, expected: Unit }
    error: "unit in a test",
    explanation: "A quantity in a test does not convert to the unit of the channel that it is about.",
    message: format!("`{key}` is in {found} and `{channel}` needs {expected}, which do not convert"),
    label: "another unit",
    help: format!("write it in {expected}"),
}

problem! {
    /// A figure of predictions asked of something that is none.
    A076 NotAPrediction { key: &'static str, channel: String }
    error: "not a prediction",
    explanation: "Errors, R² and comparisons are about predictions of a measured truth; those compared predict the same one, as far \
        ahead.",
    message: format!("`{key}` is about predictions, and `{channel}` is none"),
    label: "not a prediction",
    help: "`equals`, `between`, `absent`, `max_step_below`, `valid_above` and `given_above` work for every channel",
}

problem! {
    /// A rival that predicts something else.
    A076 NoRival { rival: String, channel: String, truth: String }
    message: format!("`{rival}` does not predict `{truth}` as `{channel}` does"),
    label: "predicts something else",
    help: "compare with `zero`, `persistence`, or a prediction of the same truth with the same `ahead`",
}

problem! {
    /// Keys that exclude each other.
    A077 ExcludedKeys { key: &'static str, with: &'static str }
    error: "keys of a test",
    explanation: "Keys of a test exclude one another, or one needs another.",
    message: format!("`{key}` has no meaning together with `{with}`"),
    label: "too much",
    help: format!("leave out `{key}` or `{with}`"),
}

problem! {
    /// A key that needs another.
    A077 KeyAlone { key: &'static str, with: &'static str }
    message: format!("`{key}` has no meaning without `{with}`"),
    label: "stands alone",
    help: format!("add `{with}` or leave out `{key}`"),
}

/// A key that excludes another, or needs it.
pub(super) fn keys(key: &'static str, with: &'static str, excluded: bool) -> Box<dyn Problem> {
    match excluded {
        true => Box::new(ExcludedKeys { key, with }),
        false => Box::new(KeyAlone { key, with }),
    }
}

problem! {
    /// A made-up input without any shape.
    A077 NoShape {}
    message: "the input has no value",
    label: "no shape",
    help: "give `constant`, `ramp`, `step`, `sine`, `noise` or `samples`",
}

problem! {
    /// A number or duration out of its range.
    A078 Range { key: &'static str, found: String, allowed: &'static str }
    error: "out of range in a test",
    explanation: "A number or duration in a test is out of its range.",
    message: format!("`{key}` is {found} and must be {allowed}"),
    label: "out of range",
    help: None,
}

problem! {
    /// A fault that does not fit its channel.
    A079 Fault { error: FaultError }
    error: "fault that does not fit",
    explanation: "The size of a fault does not fit its channel, or it needs one and there is no usual one.",
    message: error.to_string(),
    label: "does not fit",
    help: None,
}

problem! {
    /// Something measured is needed, and the reference names something computed.
    A080 NotMeasured { channel: String, known: Vec<String> }
    error: "not measured",
    explanation: "Only measured channels can be given measurements or faults.",
    message: format!("`{channel}` is computed, and only measured channels can be set or broken"),
    label: "not measured",
    help: format!("measured are {}", names(known)),
}

problem! {
    /// A channel that is given twice.
    A081 ChannelTwice { channel: String }
    error: "channel given twice",
    explanation: "Two inputs of a test give measurements of the same channel.",
    message: format!("the measurements of `{channel}` are given twice"),
    label: "given before",
    help: "let each channel stand once",
}

problem! {
    /// A bare number where a unit is needed.
    A082 BareSample { number: f64, unit: Unit }
    error: "sample without a unit",
    explanation: "Samples are quantities; only `nan`, for no value, stands without a unit.",
    message: format!("the number {number} needs a unit, such as \"{number} {unit}\""),
    label: "without a unit",
    help: "only `nan`, for no value, stands without a unit",
}

problem! {
    /// A schedule that cannot be read.
    A170 ScheduleUnreadable { path: String, reason: String }
    error: "schedule of a machine",
    explanation: "`schedule` names a file of set points over time, the same as `athermal simulate --schedule` takes. Every mistake in it \
        is shown where it stands.",
    message: format!("the schedule {path} cannot be read: {reason}"),
    label: "named here",
    help: "give the path of a schedule, which starts at the file in which it stands",
}

problem! {
    /// A mistake in a schedule.
    A170 InSchedule { reason: Reason }
    message: reason.to_string(),
    label: "in this line",
    help: None,
}

/// A reference of a test that names nothing in the graph.
#[derive(Debug)]
pub(super) struct NotFound {
    pub(super) problem: Box<dyn Problem>,
    /// What the node is called that has what is missing, where the reference means an output of the node's name.
    pub(super) of_the_node: Option<String>,
    /// The file that inherits the test, and maybe lacks on purpose what it names.
    pub(super) inherited_by: Option<String>,
}

impl Problem for NotFound {
    fn code(&self) -> &'static Code {
        self.problem.code()
    }

    fn message(&self) -> String {
        self.problem.message()
    }

    fn label(&self) -> String {
        self.problem.label()
    }

    fn help(&self) -> Option<String> {
        let help = match &self.of_the_node {
            Some(node) => Some(format!(
                "the output of that name lacks it; write `{node}` for what the node gives"
            )),
            None => self.problem.help(),
        };
        let way_out = self.inherited_by.as_deref().map(without_inherited);
        let all: Vec<_> = help.into_iter().chain(way_out).collect();
        (!all.is_empty()).then(|| all.join("; "))
    }
}
