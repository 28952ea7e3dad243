//! What can be wrong with what a machine file says of a service.

use std::sync::Arc;

use crate::diagnostic::{Names, Place, names, problem};
use crate::quantity::Quantity;
use crate::registry::NotFound;
use crate::unit::Unit;

problem! {
    /// A `type` that no linked crate brings.
    A200 UnknownKind { why: NotFound }
    error: "unknown kind of source or sink",
    explanation: "No crate in this program has a source or sink of this kind. `athermal nodes` lists the kinds that there are.",
    message: why.message(),
    label: "no such kind",
    help: why.help(),
}

problem! {
    /// A mapping that names no channel.
    A201 NoChannel {
        pattern: String,
        /// All channels of the graph, and its signals.
        known: Arc<Names>,
    }
    error: "no such channel",
    explanation: "`channels` of a source names channels of the graph's signals, as `temperature.room` or `temperature.*`; this names none.",
    message: format!("no signal has a channel `{pattern}`"),
    label: "not a channel",
    help: nearest_of(pattern, known, "the channels are"),
}

problem! {
    /// A channel that two mappings name.
    A202 ChannelTwice {
        channel: String,
        /// How many more are in both.
        more: usize,
        /// The source that has it already.
        first: String,
        place: Place,
    }
    error: "channel from two sources",
    explanation: "Each channel comes from one source. A source without `channels` gives all that no other source names.",
    message: format!(
        "`{channel}`{} already from the source `{first}`",
        match more {
            0 => " comes".to_owned(),
            more => format!(" and {more} more come"),
        }
    ),
    label: "a second time",
    help: "leave the channel to one of them; a source without `channels` gives all that no other source names",
    related: vec![(*place, "first here".to_owned())],
}

problem! {
    /// A channel that no source gives.
    A203 NoSource {
        channel: String,
        /// How many more have none.
        more: usize,
    }
    error: "channel from no source",
    explanation: "The graph reads a channel that no source gives. Only channels that their signal calls `optional` may be without.",
    message: format!(
        "no source gives `{channel}`{}",
        match more {
            0 => String::new(),
            more => format!(" and {more} more"),
        }
    ),
    label: "no source for it",
    help: format!(
        "name it under `channels` of a source, or call it `optional`: `signals.{}`",
        match channel.split_once('.') {
            Some((signal, channel)) => format!("{signal}.optional = [\"{channel}\"]"),
            None => channel.clone(),
        }
    ),
}

problem! {
    /// A channel of which a source does not know where it is.
    A204 NoAddress {
        kind: &'static str,
        channel: String,
        /// How many more have none.
        more: usize,
    }
    error: "channel without an address",
    explanation: "A source of this kind is no table with columns: `channels` names for each channel where it is to be found.",
    message: format!(
        "where `{kind}` finds `{channel}`{} is not known",
        match more {
            0 => String::new(),
            more => format!(" and {more} more"),
        }
    ),
    label: "no address",
    help: format!("write `channels = {{ \"{channel}\" = \"…\" }}`"),
}

problem! {
    /// A unit of a source that does not convert to the signal's.
    A205 OtherUnit {
        channel: String,
        found: Unit,
        expected: Unit,
        place: Place,
    }
    error: "source in another unit",
    explanation: "`unit` of a channel is the one in which the source gives it. It is converted to the signal's, where both measure the same.",
    message: format!("`{channel}` is in {expected}, and {found} measures something else"),
    label: format!("does not convert to {expected}"),
    help: match found.scale_meant() {
        Some(meant) => meant.to_owned(),
        None => format!("write a unit that converts to {expected}, or correct the signal's"),
    },
    related: vec![(*place, "the unit of the signal".to_owned())],
}

problem! {
    /// An output that the graph does not have.
    A206 NoOutput {
        output: String,
        /// Whether those that there are are those of a sink, and not of the graph.
        is_of_sink: bool,
        /// The outputs and their columns.
        known: Arc<Names>,
    }
    error: "no such output",
    explanation: "`outputs` of a sink names outputs of the graph, as `correction` or one of its columns, `correction.X`; so does `rate`.",
    message: format!(
        "{} no output `{output}`",
        if *is_of_sink { "the sink is given" } else { "the graph has" }
    ),
    label: "not an output",
    help: nearest_of(output, known, "the outputs are"),
}

problem! {
    /// A rate that does not fit an output.
    A207 OtherRate { output: String, found: Quantity, expected: Unit }
    error: "rate that does not fit",
    explanation: "`rate` bounds by how much a command may change in a time: a quantity above 0 in the unit of the output per time.",
    message: format!("`{output}` changes by {expected}, and \"{} {}\" is no rate of that", found.value, found.unit),
    label: format!("not a rate in {expected}"),
    help: "write one above 0 that converts, or one for each output: `rate = { OUTPUT = \"…\" }`",
}

problem! {
    /// A key that only commands have.
    A208 NotACommand { key: &'static str, kind: &'static str }
    error: "key of commands",
    explanation: "`rate` and `behind` keep commands safe: they have a meaning only for a sink that moves something. A log takes every row.",
    message: format!("`{key}` has no meaning for `{kind}`, which keeps every row"),
    label: "only for commands",
    help: format!("leave `{key}` out"),
}

problem! {
    /// A machine file without sources.
    A209 NoSources {}
    error: "no sources",
    explanation: "A service takes its samples from what `[sources.NAME]` declares; without one there is nothing to run on.",
    message: "the file declares no source",
    label: "",
    help: "declare one: `[sources.NAME]` with a `type`; `athermal nodes` lists the kinds of sources",
}

problem! {
    /// A command that may step.
    A210 Unbounded {
        output: String,
        /// How many more may.
        more: usize,
    }
    warning: "command that may step",
    explanation: "A command passes to what is asked no faster than the `rate` of its sink, or the `blend` of its output without. With neither it \
        is there at once, also after a start, when the machine may stand elsewhere.",
    message: format!(
        "`{output}`{} without a rate: a command may step",
        match more {
            0 => " is".to_owned(),
            more => format!(" and {more} more are"),
        }
    ),
    label: "it moves something",
    help: "write `rate = \"…\"` here, or `blend` at the output",
}

problem! {
    /// Two crates bring the same kind, or the same section.
    A211 KindTwice { why: NotFound }
    error: "ambiguous kind of source or sink",
    explanation: "Two crates in this program bring a source, or a sink, of the same kind, or read the same section, so that a file could \
        mean either.",
    message: why.message(),
    label: "which of them?",
    help: why.help(),
}

problem! {
    /// Parameters of a source or sink that cannot be used so.
    A212 UnfitParameter { words: String, advice: String }
    error: "parameters that do not fit",
    explanation: "A source or sink cannot do what its parameters ask for: one lacks what another needs, or names nothing that there is.",
    message: words.clone(),
    label: "",
    help: advice.clone(),
}

problem! {
    /// Parameters of a source or sink that may have consequences nobody wants.
    A213 DoubtfulParameter { words: String, advice: String }
    warning: "parameters to think about",
    explanation: "The parameters of a source or sink can be used, but something is lost by them that one would like to keep.",
    message: words.clone(),
    label: "",
    help: advice.clone(),
}

problem! {
    /// A section that names neither an output nor a channel.
    A214 NotShown {
        section: String,
        name: String,
        /// The outputs and channels.
        known: Arc<Names>,
    }
    error: "no such output or channel",
    explanation: "`[page]` and `[alarms.NAME]` name an output of the graph, or a channel as `tap --channel` shows it. It is named whole, as `now.Z`, or \
        up to what says which of several it is, as `now`.",
    message: format!("the graph has neither an output nor a channel `{name}` for `{section}`"),
    label: "neither an output nor a channel",
    help: nearest_of(name, known, "there are"),
}

problem! {
    /// A command that goes by past drifts of what it moves.
    A215 CommandFedBack { output: String, channel: String }
    error: "command that goes by what it moves",
    explanation: "What a command sink sends corrects the machine, and moves the positions that its prediction is learned from, weighed by or \
        made of. Their drift then lacks what was taken away.",
    message: format!("`{output}` is sent as a command and goes by past drifts of `{channel}`, which it moves"),
    label: "sends it to the machine",
    help: athermal_core::compile::fed_back::WAY_OUT,
}

fn nearest_of(name: &str, known: &Names, there_are: &str) -> String {
    match known.nearest(name) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("{there_are} {}", names(known.iter())),
    }
}
