//! How each mistake in what a graph means is told; which there are stands above.

use std::cmp::Ordering;

use super::CompileProblem;
use crate::compile::provenance::smallest_lag;
use crate::diagnostic::{Names, Problem, Severity, names, nearest};

/// A way through the graph; the middle of a long one is left out.
fn names_in_order(path: &[String]) -> String {
    const ENDS: usize = 4;
    let quoted = |names: &[String]| {
        let names: Vec<_> = names.iter().map(|name| format!("`{name}`")).collect();
        names.join(" from ")
    };
    if path.len() <= 2 * ENDS {
        return quoted(path);
    }
    let (first, last) = (&path[..ENDS], &path[path.len() - ENDS..]);
    format!("{} from … from {}", quoted(first), quoted(last))
}

fn or_known<T: AsRef<str>>(name: &str, known: &[T], what: &str) -> String {
    match nearest(name, known.iter().map(AsRef::as_ref)) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("{what} {}", names(known)),
    }
}

/// As [`or_known`], of many.
fn or_one_of(name: &str, known: &Names, what: &str) -> String {
    match known.nearest(name) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("{what} {}", names(known.iter())),
    }
}

impl Problem for CompileProblem {
    fn code(&self) -> &'static str {
        match self {
            Self::UnknownKind { .. } => "A040",
            Self::KindTwice { .. } | Self::WrittenTwice { .. } => "A041",
            Self::UnknownNode { .. } | Self::RemovedNode { .. } => "A042",
            Self::UnknownPort { .. } | Self::EmptyPort { .. } => "A043",
            Self::UnknownChannel { .. } => "A044",
            Self::UnknownInput { .. } => "A045",
            Self::MissingInput { .. } => "A046",
            Self::ChannelCount { .. } => "A047",
            Self::Units { .. } => "A048",
            Self::Spans { .. } => "A049",
            Self::Horizons { .. } => "A050",
            Self::Cycle { .. } => "A051",
            Self::Leak { .. } => "A052",
            Self::NoMaxAge { .. } => "A053",
            Self::Parameter { .. } => "A054",
            Self::NoHorizon { .. } => "A055",
            Self::PredictedTruth { .. } | Self::TruthOfPrediction { .. } => "A056",
            Self::LimitUnit { .. } | Self::Blend { .. } => "A057",
            Self::DuplicateName { .. } | Self::DuplicateColumns { .. } => "A058",
            Self::UnusedNode { .. } => "A059",
            Self::UnusedSignal { .. } => "A060",
            Self::ColumnUnit { .. } => "A069",
            Self::Unreachable { .. } => "A061",
            Self::NoOutputs => "A062",
            Self::PointOrDifference { .. } => "A063",
            Self::NoRows { .. } => "A064",
            Self::Doubt { .. } => "A065",
            Self::Truths { .. } => "A066",
            Self::NoPrediction { .. } => "A067",
            Self::Repeated { .. } => "A068",
            Self::NeverLearns { .. } => "A110",
            Self::EndlessTruth { .. } => "A160",
            Self::Kind { .. } => "A180",
        }
    }

    fn severity(&self) -> Severity {
        match self {
            Self::UnusedNode { .. }
            | Self::UnusedSignal { .. }
            | Self::ColumnUnit { .. }
            | Self::Doubt { .. } => Severity::Warning,
            _ => Severity::Error,
        }
    }

    fn may_follow_from_a_gap(&self) -> bool {
        match self {
            Self::UnknownNode { .. }
            | Self::RemovedNode { .. }
            | Self::UnknownPort { .. }
            | Self::UnknownChannel { .. }
            | Self::MissingInput { .. }
            | Self::ChannelCount { .. }
            | Self::Units { .. }
            | Self::PointOrDifference { .. }
            | Self::NoRows { .. }
            | Self::Spans { .. }
            | Self::Horizons { .. }
            | Self::Truths { .. }
            | Self::NoPrediction { .. }
            | Self::Repeated { .. }
            | Self::Cycle { .. }
            | Self::Leak { .. }
            | Self::NoMaxAge { .. }
            | Self::Doubt { .. }
            | Self::NeverLearns { .. }
            | Self::NoHorizon { .. }
            | Self::PredictedTruth { .. }
            | Self::TruthOfPrediction { .. }
            | Self::EndlessTruth { .. }
            | Self::LimitUnit { .. }
            | Self::Blend { .. }
            | Self::DuplicateName { .. }
            | Self::DuplicateColumns { .. }
            | Self::UnusedNode { .. }
            | Self::UnusedSignal { .. }
            | Self::ColumnUnit { .. }
            | Self::Unreachable { .. }
            | Self::NoOutputs => true,
            Self::UnknownKind { .. }
            | Self::KindTwice { .. }
            | Self::WrittenTwice { .. }
            | Self::EmptyPort { .. }
            | Self::UnknownInput { .. }
            | Self::Kind { .. }
            | Self::Parameter { .. } => false,
        }
    }

    fn message(&self) -> String {
        match self {
            Self::UnknownKind { kind, .. } => format!("there is no node type `{kind}`"),
            Self::KindTwice { kind, packages } => {
                format!(
                    "the node type `{kind}` is brought by several crates: {}",
                    names(packages)
                )
            }
            Self::WrittenTwice {
                kind,
                of,
                name,
                packages,
            } => format!(
                "`{kind}` cannot be used, since the name of the {of} `{name}` is taken twice, by {}",
                names(packages)
            ),
            Self::UnknownNode { node, .. } => format!("there is no node or signal `{node}`"),
            Self::RemovedNode { node } => {
                format!("`{node}` is referred to, and `nodes.{node} = false` removes it")
            }
            Self::UnknownPort { node, port, .. } => format!("`{node}` has no output port `{port}`"),
            Self::EmptyPort { node, .. } => {
                format!("no output port of `{node}` stands behind the colon")
            }
            Self::UnknownChannel { node, channel, .. } => {
                format!("`{node}` has no channel that matches `{channel}`")
            }
            Self::UnknownInput { kind, input, .. } => format!("`{kind}` has no input `{input}`"),
            Self::MissingInput { kind, input, .. } => format!("`{kind}` needs the input `{input}`"),
            Self::ChannelCount {
                input,
                found,
                expected,
            } => {
                format!(
                    "the input `{input}` takes {expected} and is given {}",
                    found.len()
                )
            }
            Self::Units {
                first,
                first_unit,
                second,
                second_unit,
            } => {
                format!("`{first}` is in {first_unit} and `{second}` in {second_unit}")
            }
            Self::Spans {
                first,
                first_span,
                second,
                second_span,
            } => {
                format!("`{first}` summarises {first_span} and `{second}` {second_span}")
            }
            Self::Horizons {
                first,
                first_ahead,
                second,
                second_ahead,
            } => {
                format!("`{first}` looks {first_ahead} ahead and `{second}` {second_ahead}")
            }
            Self::Truths {
                first,
                first_truth,
                second,
                second_truth,
            } => {
                if second == second_truth {
                    format!("`{first}` predicts `{first_truth}` and is to be judged by `{second}`")
                } else {
                    format!("`{first}` predicts `{first_truth}` and `{second}` `{second_truth}`")
                }
            }
            Self::NoPrediction {
                channel,
                prediction,
            } => {
                format!("`{channel}` tells of the prediction `{prediction}` and is none")
            }
            Self::Repeated { channel, input } => format!("`{channel}` stands twice in `{input}`"),
            Self::Cycle { path } => {
                format!("these nodes wait for each other: {}", path.join(" → "))
            }
            Self::Leak {
                regressor, truth, ..
            } => {
                format!(
                    "`{regressor}` contains part of the answer: it overlaps the value of `{truth}` that is predicted"
                )
            }
            Self::NoMaxAge { channel, .. } => {
                format!("nothing says how long a value of `{channel}` counts")
            }
            Self::Parameter { message, .. } | Self::Doubt { message, .. } => message.clone(),
            Self::NeverLearns { kind, .. } => {
                format!("`{kind}`, as it is here, does not learn while it runs")
            }
            Self::Kind { kind, fault, .. } => format!("`{kind}` {}", fault.found()),
            Self::NoHorizon { kind } => {
                format!("`{kind}` needs to know how far `ahead` it predicts")
            }
            Self::PredictedTruth { channel } => {
                format!("`{channel}` is a prediction and cannot be the truth")
            }
            Self::TruthOfPrediction {
                channel,
                prediction,
            } => {
                format!(
                    "`{channel}` tells of the prediction `{prediction}` and cannot be the truth"
                )
            }
            Self::EndlessTruth { channel, node } => {
                format!("`{channel}` cannot be the truth, since `{node}` remembers all of the past")
            }
            Self::LimitUnit { found, expected } => {
                format!("the limit is in {found} and the truth in {expected}, which do not convert")
            }
            Self::Blend {
                output,
                found,
                expected,
            } => {
                format!(
                    "`blend` is {found}, and `{output}` can only pass over at a rate above zero in {expected}"
                )
            }
            Self::DuplicateName { name, what } => format!("there are two {what} named `{name}`"),
            Self::DuplicateColumns { first, more, .. } => {
                let more = match more {
                    0 => String::new(),
                    1 => ", and one more name comes twice".to_owned(),
                    more => format!(", and {more} more names come twice"),
                };
                format!("there are two output columns named `{first}`{more}")
            }
            Self::UnusedNode { node, .. } => {
                format!("nothing that comes out depends on the node `{node}`")
            }
            Self::ColumnUnit {
                signal,
                column,
                named,
                unit,
            } => format!("`{signal}` is in {unit}, and its column `{column}` is named for {named}"),
            Self::UnusedSignal { signal } => {
                format!("nothing that comes out depends on the signal `{signal}`")
            }
            Self::Unreachable { output } => format!("no signal reaches the output `{output}`"),
            Self::NoOutputs => "the graph has no outputs".to_owned(),
            Self::PointOrDifference {
                channel,
                unit,
                wanted_by,
                wanted,
            } => {
                let (is, takes) = if unit.is_temperature_point() {
                    ("a temperature", "a difference of temperatures")
                } else {
                    ("a difference of temperatures", "a temperature")
                };
                format!("`{channel}` is {is} ({unit}), and `{wanted_by}` {takes} ({wanted})")
            }
            Self::NoRows { below, above } => {
                format!("no truth lies below {below} and at or above {above}")
            }
        }
    }

    fn label(&self) -> String {
        match self {
            Self::UnknownKind { .. } => "no such type",
            Self::KindTwice { .. } | Self::WrittenTwice { .. } => "which of them?",
            Self::UnknownNode { .. } => "not found",
            Self::RemovedNode { .. } => "removed",
            Self::UnknownPort { .. } => "no such port",
            Self::EmptyPort { .. } => "no port",
            Self::UnknownChannel { .. } => "matches nothing",
            Self::UnknownInput { .. } => "no such input",
            Self::MissingInput { .. } => "an input is missing",
            Self::ChannelCount { .. } => "the wrong number of channels",
            Self::Units { .. } => "units differ",
            Self::Spans { .. } => "spans differ",
            Self::Horizons { .. } => "horizons differ",
            Self::Truths { .. } => "truths differ",
            Self::NoPrediction { .. } => "not a prediction",
            Self::Repeated { .. } => "for the second time",
            Self::Cycle { .. } => "part of a loop",
            Self::Leak { .. } => "sees the future",
            Self::NoMaxAge { .. } => "held without a maximum age",
            Self::Parameter { .. } | Self::Doubt { .. } => "here",
            Self::NoHorizon { .. } => "`ahead` is missing",
            Self::NeverLearns { .. } => "stays as it was fitted",
            Self::Kind { .. } => "a mistake of its kind, not of the graph",
            Self::PredictedTruth { .. } | Self::TruthOfPrediction { .. } => "not measured",
            Self::EndlessTruth { .. } => "of no span",
            Self::LimitUnit { .. } => "another unit",
            Self::Blend { .. } => "no such rate",
            Self::DuplicateName { .. } | Self::DuplicateColumns { .. } => "the name is taken",
            Self::UnusedNode { .. } | Self::UnusedSignal { .. } => "not used",
            Self::ColumnUnit { .. } => "another unit",
            Self::Unreachable { .. } => "nothing flows in",
            Self::NoOutputs => "no `[outputs]`",
            Self::PointOrDifference { .. } => "a point is no difference",
            Self::NoRows { .. } => "admits no row",
        }
        .to_owned()
    }

    fn help(&self) -> Option<String> {
        Some(match self {
            Self::UnknownKind { kind, known } => {
                let what = "`athermal build --with CRATE` brings those of a plugin crate; types in this program:";
                or_known(kind, known, what)
            }
            Self::WrittenTwice { of, .. } => format!(
                "give one of them another name in its `{of}!`, or leave one of the crates out when the program is built"
            ),
            Self::KindTwice { .. } => {
                "leave one of the crates out when the program is built".to_owned()
            }
            Self::UnknownNode { node, known } => match node.split_once('[') {
                Some((owner, member)) if known.contains(owner) => {
                    let member = member.trim_end_matches(']');
                    format!("a channel is written `{owner}.{member}`, a port `{owner}:{member}`")
                }
                _ => or_one_of(node, known, "the graph has"),
            },
            Self::RemovedNode { .. } => "remove or change what refers to it as well, as by `outputs.NAME = false` or `nodes.NAME = false`".to_owned(),
            Self::UnknownPort { node, known, .. } if known.is_empty() => {
                format!("`{node}` has channels and no ports: `{node}.CHANNEL`")
            }
            Self::UnknownPort { port, known, .. } => or_known(port, known, "its ports are"),
            Self::EmptyPort {
                node,
                channel,
                known,
            } => {
                let channel = channel.as_ref().filter(|channel| !channel.is_empty());
                let written = match channel {
                    Some(channel) => format!("write `{node}.{channel}`"),
                    None => format!("write `{node}`"),
                };
                match known.is_empty() {
                    true => written,
                    false => format!("{written}, or name a port; its ports are {}", names(known)),
                }
            }
            Self::UnknownChannel {
                node,
                channel,
                known,
            } => match channel.split_once(':') {
                Some((channel, port)) => {
                    format!("a port stands behind the node: `{node}:{port}.{channel}`")
                }
                None => or_one_of(channel, known, "its channels are"),
            },
            Self::UnknownInput { meant, known, .. } => match meant {
                Some(meant) => format!("did you mean `{meant}`?"),
                None => format!("its inputs are {}", names(known)),
            },
            Self::MissingInput { input, summary, .. } => {
                format!("add `inputs.{input} = \"…\"`: {summary}")
            }
            Self::ChannelCount { found, .. } => {
                format!("the reference stands for {}", names(found))
            }
            Self::Units { .. } => {
                "they are different quantities, which no unit makes one: refer to one of the same kind".to_owned()
            }
            Self::Spans { .. } => "compute both over windows of the same length".to_owned(),
            Self::Horizons { .. } => {
                "give both the same `ahead`; what is no prediction has none, and a `persistence` node makes one of it"
                    .to_owned()
            }
            Self::Truths { .. } => {
                "combine predictions of one axis; `each` makes a node for each of several".to_owned()
            }
            Self::Repeated { .. } => "refer to each channel once".to_owned(),
            Self::NoPrediction { prediction, .. } => {
                format!("let the prediction vote: `{prediction}`")
            }
            Self::Cycle { .. } => "let the feedback go through a `delay` node".to_owned(),
            Self::Leak {
                lag,
                span,
                late,
                ahead,
                path,
                ..
            } => {
                let smallest = smallest_lag(*late + *span, *ahead);
                let smallest = match (span.is_zero(), late.cmp(ahead)) {
                    (true, Ordering::Equal) => "one sample".to_owned(),
                    (true, Ordering::Greater) => format!("one sample more than {smallest}"),
                    _ => smallest.to_string(),
                };
                let is_late = if late.is_zero() {
                    String::new()
                } else {
                    format!(", is {late} late")
                };
                let way = if path.is_empty() {
                    String::new()
                } else {
                    format!("it is made of what the truth is made of: {}; ", names_in_order(path))
                };
                format!(
                    "{way}the truth summarises {span}{is_late} and is predicted {ahead} ahead, so the smallest lag allowed is \
                     {smallest} (here it is {lag})"
                )
            }
            Self::NoMaxAge { input, signal, .. } => {
                let here = format!("`inputs.{input} = {{ from = \"…\", max_age = \"1min\" }}`");
                match signal {
                    Some(signal) => format!("say `max_age` on the signal `{signal}`, or {here}"),
                    // What closes a loop has no signal behind it when it is read.
                    None => format!("say it where it is read: {here}"),
                }
            }
            Self::Parameter { help, .. } | Self::Doubt { help, .. } => return help.clone(),
            Self::NeverLearns { help, .. } => help
                .unwrap_or("leave `learn` out, or choose a kind that learns")
                .to_owned(),
            Self::Kind { author, fault, .. } => format!("for {author}: {}", fault.remedy()),
            Self::NoHorizon { .. } => {
                "`ahead = \"5min\"` is a forecast, `ahead = \"0s\"` a virtual sensor".to_owned()
            }
            Self::PredictedTruth { .. } | Self::TruthOfPrediction { .. } => {
                "refer to something measured, such as the slope of a position".to_owned()
            }
            Self::EndlessTruth { node, .. } => format!(
                "say how much of the past counts, such as `span = \"10min\"` on `{node}`, or use a window, such as `slope`"
            ),
            Self::LimitUnit { expected, .. } => format!("write the limit in {expected}"),
            Self::Blend { expected, .. } => {
                format!("write by how much it may change per time, such as `5 {expected}`; without `blend` it steps over at once")
            }
            Self::DuplicateColumns {
                alone: Some(alone), ..
            } => {
                format!("give it a line of its own, such as `{alone}`, or refer to fewer channels")
            }
            Self::DuplicateName { .. } | Self::DuplicateColumns { .. } => {
                "give one of them another name, or refer to fewer channels".to_owned()
            }
            Self::UnusedNode { node, .. } if node.contains('/') => {
                "refer to it, name it under the module's `outputs`, or leave it out of the module"
                    .to_owned()
            }
            Self::UnusedNode {
                node,
                inherited: true,
            } => format!(
                "refer to it, name it under `[outputs]`, or write `nodes.{node} = false` in the file that inherits it"
            ),
            Self::UnusedNode { .. } => {
                "refer to it, name it under `[outputs]`, or delete it".to_owned()
            }
            Self::UnusedSignal { .. } => "refer to it or remove it".to_owned(),
            Self::ColumnUnit { named, .. } => format!(
                "write `unit = \"{named}\"`, which converts wherever another one is needed, unless the log is at fault"
            ),
            Self::Unreachable { .. } => "check the inputs on the way to it".to_owned(),
            Self::PointOrDifference { .. } => {
                "Cel and [degF] are points on a scale, and K is a difference; take a slope or difference of a \
                 temperature, or read the temperature itself"
                    .to_owned()
            }
            Self::NoRows { .. } => "`above` is 0 or more, and `below` is larger".to_owned(),
            Self::NoOutputs => {
                "name what the graph is for: `[outputs]` and `predicted = \"NODE\"`".to_owned()
            }
        })
    }
}
