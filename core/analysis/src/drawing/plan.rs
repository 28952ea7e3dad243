//! The compiled plan as text: what stands in which slots, and what is done at a tick.

use std::fmt::Write as _;
use std::ops::Range;

use crate::diagnosis::text::grouped;
use athermal_core::compile::{Plan, PlannedNode, PlannedRole, Step};
use athermal_core::node::Read;
use athermal_core::time::Duration;

use crate::figures::{count, length, table};

/// The plan for people; instances of one node share lines unless `expand`.
#[must_use]
pub fn text(plan: &Plan, expand: bool) -> String {
    let mut text = format!(
        "{}: {} slots, {} steps in a tick\n\n",
        plan.name.as_deref().unwrap_or("graph"),
        count(plan.channels.len() as u64),
        count(plan.steps.len() as u64),
    );
    text.push_str(&slots(plan, expand));
    text.push('\n');
    text.push_str(&steps(plan, expand));
    text
}

fn slots(plan: &Plan, expand: bool) -> String {
    let mut rows = Vec::new();
    for range in runs(plan, expand) {
        let channels = || plan.channels[range.clone()].iter();
        let first = &plan.channels[range.start];
        let name = if range.len() == 1 {
            first.name.clone()
        } else {
            format!("{} ({} channels)", producer(&first.name), range.len())
        };
        let spans = || channels().map(|planned| planned.channel.span);
        rows.push(vec![
            name,
            numbers(&range),
            first.channel.unit.to_string(),
            lengths(spans().min(), spans().max()),
            lengths(Some(first.channel.ahead), None),
            lengths(channels().filter_map(|planned| planned.history).max(), None),
        ]);
    }
    table(&["channel", "slot", "unit", "span", "ahead", "kept"], &rows)
}

/// Slots that share a line: those of one signal or one node, of one unit and horizon.
fn runs(plan: &Plan, expand: bool) -> Vec<Range<usize>> {
    let owner = |slot: usize| {
        let channel = &plan.channels[slot];
        let (unit, ahead) = (&channel.channel.unit, channel.channel.ahead);
        (producer(&channel.name), unit, ahead)
    };
    let mut runs: Vec<Range<usize>> = Vec::new();
    for slot in 0..plan.channels.len() {
        match runs.last_mut() {
            Some(run) if !expand && owner(run.start) == owner(slot) => run.end = slot + 1,
            _ => runs.push(slot..slot + 1),
        }
    }
    runs
}

/// The signal or node of a channel, with the port where it is not the first.
fn producer(channel: &str) -> &str {
    channel.split('.').next().unwrap_or(channel)
}

fn numbers(range: &Range<usize>) -> String {
    if range.len() == 1 {
        range.start.to_string()
    } else {
        format!("{}-{}", range.start, range.end - 1)
    }
}

fn lengths(least: Option<Duration>, most: Option<Duration>) -> String {
    match (least, most) {
        (Some(least), Some(most)) if least != most => {
            format!("{} … {}", length(least), length(most))
        }
        (Some(only), _) if only > Duration::ZERO => length(only),
        _ => "-".to_owned(),
    }
}

fn steps(plan: &Plan, expand: bool) -> String {
    let mut text = String::from("at each tick\n");
    let line = |step: &Step| match step {
        Step::Gather(gather) => {
            let gather = &plan.gathers[*gather];
            let how = match gather.read {
                Read::Fresh => "new values",
                Read::Held => "held values",
                Read::Truth => "truth",
            };
            let mut lags = gather.entries.iter().map(|entry| entry.lag);
            let lagged = lags.any(|lag| lag > Duration::ZERO);
            let lagged = if lagged { ", some of the past" } else { "" };
            let from = gather.entries.iter();
            let from = from.map(|entry| producer(&plan.channels[entry.slot].name));
            let from: Vec<&str> = grouped(from, |of| *of).iter().map(|of| of[0]).collect();
            let (number, from) = (gather.entries.len(), from.join(", "));
            format!("read {number} {how} of {from}{lagged}")
        }
        Step::Run(node) => run(plan, &plan.nodes[*node], expand),
        Step::Capture(node) => format!(
            "keep the inputs of {} for later ticks",
            name(&plan.nodes[*node], expand)
        ),
    };
    let steps: Vec<String> = plan.steps.iter().map(line).collect();
    // Instances of a node, and what they read, follow each other in the same pattern.
    let mut at = 0;
    while at < steps.len() {
        let patterns = (1..=2).map(|period| (period, repeats(&steps, at, period)));
        let pattern = patterns.filter(|_| !expand).find(|(_, times)| *times > 1);
        let (period, times) = pattern.unwrap_or((1, 1));
        let last = at + period * times;
        let times = match times {
            1 => String::new(),
            _ => format!("  × {times}"),
        };
        let range = numbers(&(at + 1..last + 1));
        let _ = writeln!(text, "  {range:>9}  {}{times}", steps[at]);
        for line in &steps[at + 1..at + period] {
            let _ = writeln!(text, "  {:>9}    then {line}", "");
        }
        at = last;
    }
    text
}

/// How often the steps from one on come in a row; none where fewer are left.
fn repeats(steps: &[String], at: usize, period: usize) -> usize {
    let mut groups = steps[at..].chunks_exact(period);
    let first = groups.next();
    groups.take_while(|group| Some(*group) == first).count() + 1
}

fn name(node: &PlannedNode, expand: bool) -> String {
    if expand {
        node.instance()
    } else {
        node.name.clone()
    }
}

fn run(plan: &Plan, node: &PlannedNode, expand: bool) -> String {
    let slots = if expand {
        format!(" into {}", numbers(&node.slots))
    } else {
        String::new()
    };
    let every = match &node.role {
        PlannedRole::Feature {
            every_tick: true, ..
        }
        | PlannedRole::Estimator {
            every_tick: true, ..
        } => ", at every tick",
        _ => "",
    };
    let ahead = match node.role.fit() {
        Some(fit) => {
            let truth = &fit.truth;
            let truth_of = producer(&plan.channels[truth.slot].name);
            format!(", {truth_of} {} ahead", truth.ahead)
        }
        None => String::new(),
    };
    format!(
        "run {} ({}){ahead}{every}{slots}",
        name(node, expand),
        node.kind.name
    )
}
