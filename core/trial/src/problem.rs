//! Decides what can be wrong with a test before it is run, and how it is said.

use crate::compile::CompileProblem;
use crate::diagnostic::{Place, Problem, names, nearest};
use crate::fault::FaultError;
use crate::machine::schedule::Reason;
use crate::unit::Unit;

/// A mistake in `[[tests]]`.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs)] // each variant's fields are the data of the sentence that `message` makes of them
pub enum TrialProblem {
    /// Nothing to run over.
    NoData,
    /// Both `on` and `inputs`.
    TwoData { inputs: Place },
    /// A test or an expectation that checks nothing.
    NothingExpected { what: &'static str },
    /// Two tests of the same name.
    DuplicateName { name: String, first: Place },
    /// A machine that cannot be simulated.
    UnknownMachine {
        machine: String,
        known: Vec<&'static str>,
    },
    /// A machine that several crates bring.
    MachineTwice {
        machine: String,
        packages: Vec<&'static str>,
    },
    /// A schedule that cannot be read.
    ScheduleUnreadable { path: String, reason: String },
    /// A mistake in a schedule.
    Schedule(Reason),
    /// A machine that lacks what the graph measures.
    MachineLacks {
        machine: &'static str,
        channels: Vec<String>,
        has: Vec<String>,
        /// The file that inherits the test, where it stands in another.
        inherited_by: Option<String>,
    },
    /// A quantity of another kind than the channel.
    Units {
        key: &'static str,
        found: Unit,
        channel: String,
        expected: Unit,
    },
    /// A figure of predictions asked of something that is none.
    NotAPrediction { key: &'static str, channel: String },
    /// A rival that predicts something else.
    NoRival {
        rival: String,
        channel: String,
        truth: String,
    },
    /// Keys that exclude or need each other.
    Keys {
        key: &'static str,
        with: &'static str,
        excluded: bool,
    },
    /// A made-up input without any shape.
    NoShape,
    /// A number or duration out of its range.
    Range {
        key: &'static str,
        found: String,
        allowed: &'static str,
    },
    /// A fault that does not fit its channel.
    Fault(FaultError),
    /// Something measured is needed, and the reference names something computed.
    NotMeasured { channel: String, known: Vec<String> },
    /// A channel that is given twice.
    ChannelTwice { channel: String },
    /// A bare number where a unit is needed.
    BareSample { number: f64, unit: Unit },
}

/// How a file does without the tests that it inherits.
fn without_inherited(file: &str) -> String {
    format!(
        "`tests = []` in {file}, or tests of its own there, take the place of those that it inherits"
    )
}

impl Problem for TrialProblem {
    fn code(&self) -> &'static str {
        match self {
            Self::NoData | Self::TwoData { .. } => "A070",
            Self::NothingExpected { .. } => "A071",
            Self::DuplicateName { .. } => "A072",
            Self::UnknownMachine { .. } | Self::MachineTwice { .. } => "A073",
            Self::MachineLacks { .. } => "A074",
            Self::Units { .. } => "A075",
            Self::NotAPrediction { .. } | Self::NoRival { .. } => "A076",
            Self::Keys { .. } | Self::NoShape => "A077",
            Self::Range { .. } => "A078",
            Self::Fault(_) => "A079",
            Self::NotMeasured { .. } => "A080",
            Self::ChannelTwice { .. } => "A081",
            Self::BareSample { .. } => "A082",
            Self::ScheduleUnreadable { .. } | Self::Schedule(_) => "A170",
        }
    }

    fn may_follow_from_a_gap(&self) -> bool {
        match self {
            Self::NoData
            | Self::NothingExpected { .. }
            | Self::MachineLacks { .. }
            | Self::Units { .. }
            | Self::NotAPrediction { .. }
            | Self::NoRival { .. }
            | Self::NoShape
            | Self::Fault(_)
            | Self::NotMeasured { .. }
            | Self::ChannelTwice { .. }
            | Self::BareSample { .. } => true,
            Self::Keys { excluded, .. } => !excluded,
            Self::TwoData { .. }
            | Self::DuplicateName { .. }
            | Self::UnknownMachine { .. }
            | Self::MachineTwice { .. }
            | Self::ScheduleUnreadable { .. }
            | Self::Schedule(_)
            | Self::Range { .. } => false,
        }
    }

    // A list replaces the one that it is laid over, whole.
    fn inherits_nothing(&self) -> bool {
        matches!(
            self,
            Self::NoData | Self::NothingExpected { .. } | Self::Keys { .. } | Self::NoShape
        )
    }

    fn message(&self) -> String {
        match self {
            Self::NoData => "the test has nothing to run over".to_owned(),
            Self::TwoData { .. } => "the test has both `on` and `inputs`".to_owned(),
            Self::NothingExpected { what } => format!("{what} checks nothing"),
            Self::DuplicateName { name, .. } => format!("there are two tests named \"{name}\""),
            Self::UnknownMachine { machine, .. } => {
                format!("there is no simulated machine `{machine}`")
            }
            Self::MachineTwice { machine, packages } => {
                format!(
                    "the machine `{machine}` is in {}",
                    packages.join(" and in ")
                )
            }
            Self::ScheduleUnreadable { path, reason } => {
                format!("the schedule {path} cannot be read: {reason}")
            }
            Self::Schedule(reason) => reason.to_string(),
            Self::MachineLacks {
                machine, channels, ..
            } => format!(
                "the machine `{machine}` does not measure {}",
                names(channels)
            ),
            Self::Units {
                key,
                found,
                channel,
                expected,
            } => format!(
                "`{key}` is in {found} and `{channel}` needs {expected}, which do not convert"
            ),
            Self::NotAPrediction { key, channel } => {
                format!("`{key}` is about predictions, and `{channel}` is none")
            }
            Self::NoRival {
                rival,
                channel,
                truth,
            } => format!("`{rival}` does not predict `{truth}` as `{channel}` does"),
            Self::Keys {
                key,
                with,
                excluded: true,
            } => format!("`{key}` has no meaning together with `{with}`"),
            Self::Keys {
                key,
                with,
                excluded: false,
            } => format!("`{key}` has no meaning without `{with}`"),
            Self::NoShape => "the input says no value".to_owned(),
            Self::Range {
                key,
                found,
                allowed,
            } => format!("`{key}` is {found} and must be {allowed}"),
            Self::Fault(error) => error.to_string(),
            Self::NotMeasured { channel, .. } => {
                format!("`{channel}` is computed, and only measured channels can be set or broken")
            }
            Self::ChannelTwice { channel } => {
                format!("the measurements of `{channel}` are given twice")
            }
            Self::BareSample { number, unit } => {
                format!("the number {number} needs a unit, such as \"{number} {unit}\"")
            }
        }
    }

    fn label(&self) -> String {
        match self {
            Self::NoData => "neither `on` nor `inputs`",
            Self::TwoData { .. } => "one of them is too much",
            Self::NothingExpected { .. } => "nothing is expected",
            Self::DuplicateName { .. } => "the name is taken",
            Self::UnknownMachine { .. } => "no such machine",
            Self::MachineTwice { .. } => "which of them?",
            Self::ScheduleUnreadable { .. } => "named here",
            Self::Schedule(_) => "in this line",
            Self::MachineLacks { .. } => "lacks a channel",
            Self::Units { .. } => "another unit",
            Self::NotAPrediction { .. } => "not a prediction",
            Self::NoRival { .. } => "predicts something else",
            Self::Keys { excluded: true, .. } => "too much",
            Self::Keys { .. } => "stands alone",
            Self::NoShape => "no shape",
            Self::Range { .. } => "out of range",
            Self::Fault(_) => "does not fit",
            Self::NotMeasured { .. } => "not measured",
            Self::ChannelTwice { .. } => "given before",
            Self::BareSample { .. } => "without a unit",
        }
        .to_owned()
    }

    fn help(&self) -> Option<String> {
        Some(match self {
            Self::NoData => {
                "name data with `on = \"FILE\"` or `on = { simulate = \"MACHINE\" }`, or make some up with `inputs`"
                    .to_owned()
            }
            Self::TwoData { .. } => {
                "run over data (`on`) in one test and over `inputs` in another".to_owned()
            }
            Self::NothingExpected { .. } => {
                "say what must hold, such as `rmse_below`, `beats`, `valid_above`, `equals`, `between` or `absent`"
                    .to_owned()
            }
            Self::DuplicateName { .. } => "give each test a name of its own".to_owned(),
            Self::UnknownMachine { machine, known } => {
                match nearest(machine, known.iter().copied()) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => format!("there are {}", names(known)),
                }
            }
            Self::MachineTwice { .. } => {
                "leave one of these crates out of the program, or rename its machine".to_owned()
            }
            Self::ScheduleUnreadable { .. } => {
                "give the path of a schedule, which starts at the file in which it stands".to_owned()
            }
            Self::MachineLacks {
                has, inherited_by, ..
            } => {
                let way_out = "a signal may call channels `optional`";
                match inherited_by {
                    Some(file) => format!("{way_out}; {}", without_inherited(file)),
                    None => format!("it measures {}; {way_out}", names(has)),
                }
            }
            Self::Units { expected, .. } => format!("write it in {expected}"),
            Self::NotAPrediction { .. } => {
                "`equals`, `between`, `absent`, `max_step_below`, `valid_above` and `given_above` work for every channel"
                    .to_owned()
            }
            Self::NoRival { .. } => {
                "compare with `zero`, `persistence`, or a prediction of the same truth with the same `ahead`"
                    .to_owned()
            }
            Self::Keys {
                key,
                with,
                excluded: true,
            } => format!("leave out `{key}` or `{with}`"),
            Self::Keys { key, with, .. } => format!("add `{with}` or leave out `{key}`"),
            Self::NoShape => {
                "give `constant`, `ramp`, `step`, `sine`, `noise` or `samples`".to_owned()
            }
            Self::Range { .. } | Self::Fault(_) | Self::Schedule(_) => return None,
            Self::NotMeasured { known, .. } => format!("measured are {}", names(known)),
            Self::ChannelTwice { .. } => "let each channel stand once".to_owned(),
            Self::BareSample { .. } => "only `nan`, for no value, stands without a unit".to_owned(),
        })
    }

    fn related(&self) -> Vec<(Place, String)> {
        match self {
            Self::TwoData { inputs } => vec![(*inputs, "and here".to_owned())],
            Self::DuplicateName { first, .. } => vec![(*first, "the other is here".to_owned())],
            _ => Vec::new(),
        }
    }
}

/// A reference of a test that names nothing in the graph.
pub(super) struct NotFound {
    pub(super) problem: CompileProblem,
    /// What the node is called that has what is missing, where the reference means an output of the node's name.
    pub(super) of_the_node: Option<String>,
    /// The file that inherits the test, and maybe lacks on purpose what it names.
    pub(super) inherited_by: Option<String>,
}

impl Problem for NotFound {
    fn code(&self) -> &'static str {
        self.problem.code()
    }

    fn may_follow_from_a_gap(&self) -> bool {
        self.problem.may_follow_from_a_gap()
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
        let Some(file) = &self.inherited_by else {
            return help;
        };
        let way_out = without_inherited(file);
        Some(match help {
            Some(help) => format!("{help}; {way_out}"),
            None => way_out,
        })
    }
}
