//! A deployment in words, and as data: sources with their channels, sinks with their outputs and rates.

use std::fmt::{self, Write as _};

use serde_json::{Value, json};

use super::{DeclaredChannel, DeclaredSink, DeclaredSource, Deployment};
use crate::compile::Plan;
use crate::time::Duration;
use crate::unit::Unit;

impl Deployment {
    /// In words, a line for each channel and output. `plan` is what it was read with.
    ///
    /// # Errors
    /// When the text cannot be written.
    pub fn describe(&self, plan: &Plan, into: &mut impl fmt::Write) -> fmt::Result {
        for source in &self.sources {
            describe_source(source, plan, into)?;
        }
        for sink in &self.sinks {
            describe_sink(sink, plan, into)?;
        }
        let runtime = &self.runtime;
        write!(into, "ticks: {} after the first sample", runtime.wait)?;
        if runtime.join > Duration::ZERO {
            write!(into, ", instants within {} are one", runtime.join)?;
        }
        match runtime.heartbeat {
            Some(beat) => writeln!(into, ", at least every {beat}")?,
            None => writeln!(into, ", none without samples")?,
        }
        match &runtime.state {
            Some(state) => writeln!(into, "state: {}", state.display()),
            None => writeln!(into, "state: a folder beside the file"),
        }
    }

    /// The same for programs.
    #[must_use]
    pub fn to_json(&self, plan: &Plan) -> Value {
        let sources = self.sources.iter().map(|source| {
            let channels = source.channels.iter().map(|of| {
                json!({
                    "channel": of.channel.name,
                    "from": of.address,
                    "unit": unit_of(plan, &of.channel.name).map(Unit::text),
                    "factor": of.conversion.map_or(1.0, |(factor, _)| factor),
                    "offset": of.conversion.map_or(0.0, |(_, offset)| offset),
                    "late": of.late,
                })
            });
            json!({
                "name": source.name,
                "type": source.kind.name,
                "silent": source.silent,
                "thinned": source.thinning.map(|of| json!({ "left": of.left.name(), "every": of.every })),
                "channels": channels.collect::<Vec<_>>(),
            })
        });
        let sinks = self.sinks.iter().map(|sink| {
            let outputs = sink.outputs.iter().zip(&sink.rate).map(|(output, rate)| {
                json!({
                    "output": output,
                    "unit": unit_of_output(plan, output).map(Unit::text),
                    "rate_per_s": rate,
                })
            });
            json!({
                "name": sink.name,
                "type": sink.kind.name,
                "behind": sink.behind,
                "outputs": outputs.collect::<Vec<_>>(),
            })
        });
        let runtime = &self.runtime;
        json!({
            "sources": sources.collect::<Vec<_>>(),
            "sinks": sinks.collect::<Vec<_>>(),
            "runtime": {
                "state": runtime.state,
                "heartbeat": runtime.heartbeat,
                "wait": runtime.wait,
                "settle": runtime.settle,
                "join": runtime.join,
                "future": runtime.future,
                "sync": runtime.sync,
                "checkpoint": runtime.checkpoint,
                "retain": runtime.retain,
                "keep": {
                    "journal": runtime.keep.journal,
                    "at_most_bytes": runtime.keep.at_most.0,
                    "checkpoints": runtime.keep.checkpoints,
                },
            },
        })
    }
}

fn unit_of<'a>(plan: &'a Plan, channel: &str) -> Option<&'a Unit> {
    let mut channels = plan.channels.iter();
    let found = channels.find(|of| of.name == channel)?;
    Some(&found.channel.unit)
}

fn unit_of_output<'a>(plan: &'a Plan, output: &str) -> Option<&'a Unit> {
    let mut outputs = plan.outputs.iter();
    let found = outputs.find(|of| of.name == output)?;
    Some(&plan.channels[found.slot].channel.unit)
}

fn widest<'a>(names: impl Iterator<Item = &'a String>) -> usize {
    names.map(|name| name.chars().count()).max().unwrap_or(0)
}

fn describe_source(
    source: &DeclaredSource,
    plan: &Plan,
    into: &mut impl fmt::Write,
) -> fmt::Result {
    let (name, kind) = (&source.name, source.kind.name);
    write!(into, "source `{name}`, of kind {kind}")?;
    if let Some(clock) = source.clock {
        write!(into, ", its clock within {}", clock.within)?;
    }
    if let Some(of) = source.thinning {
        write!(
            into,
            ", thinned to the {} of each {}",
            of.left.name(),
            of.every
        )?;
    }
    writeln!(
        into,
        ", waited for no longer than {} while away",
        source.silent
    )?;
    let width = widest(source.channels.iter().map(|of| &of.channel.name));
    for of in &source.channels {
        let (name, address) = (&of.channel.name, &of.address);
        writeln!(
            into,
            "  {name:width$}  from {address}{}",
            remarks(of, unit_of(plan, name))
        )?;
    }
    Ok(())
}

/// What there is to say of a channel beside its address.
fn remarks(of: &DeclaredChannel, unit: Option<&Unit>) -> String {
    let unit = unit.map_or("1", Unit::text);
    let mut words = match of.conversion {
        Some((factor, 0.0)) => format!(", times {factor} in {unit}"),
        Some((factor, offset)) => format!(", times {factor} plus {offset} in {unit}"),
        None => format!(", in {unit}"),
    };
    if of.late > Duration::ZERO {
        let _ = write!(words, ", up to {} late", of.late);
    }
    if of.channel.optional {
        words += ", optional";
    }
    words
}

fn describe_sink(sink: &DeclaredSink, plan: &Plan, into: &mut impl fmt::Write) -> fmt::Result {
    let (name, kind) = (&sink.name, sink.kind.name);
    write!(into, "sink `{name}`, of kind {kind}")?;
    match sink.behind {
        Some(behind) => writeln!(into, ", commands no further behind than {behind}")?,
        None => writeln!(into, ", every tick")?,
    }
    let width = widest(sink.outputs.iter());
    for (output, rate) in sink.outputs.iter().zip(&sink.rate) {
        let unit = unit_of_output(plan, output).map_or("1", Unit::text);
        write!(into, "  {output:width$}  in {unit}")?;
        match (rate, sink.behind) {
            (Some(rate), _) => writeln!(into, ", at most {rate} {unit}/s")?,
            (None, Some(_)) => writeln!(into, ", at any rate")?,
            (None, None) => writeln!(into)?,
        }
    }
    Ok(())
}
