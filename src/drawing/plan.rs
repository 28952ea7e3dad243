//! The compiled plan as text: what stands in which slots, and what is done at a tick.

use std::fmt::Write as _;
use std::ops::Range;

use athermal::core::compile::{Plan, PlannedNode, PlannedRole, Step};
use athermal::core::node::Read;
use athermal::core::time::Duration;

use athermal_analysis::figures::{count, length, table};

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
        let spans = (
            channels().map(|planned| planned.channel.span).min(),
            channels().map(|planned| planned.channel.span).max(),
        );
        rows.push(vec![
            name,
            numbers(&range),
            first.channel.unit.to_string(),
            lengths(spans.0, spans.1),
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
    let mut steps: Vec<(usize, usize, String)> = Vec::new();
    for (number, step) in plan.steps.iter().enumerate() {
        let line = match step {
            Step::Gather(gather) => {
                let gather = &plan.gathers[*gather];
                let how = match gather.read {
                    Read::Fresh => "new values",
                    Read::Held => "held values",
                    Read::Truth => "truth",
                };
                let lagged = gather
                    .entries
                    .iter()
                    .any(|entry| entry.lag > Duration::ZERO);
                let lagged = if lagged { ", some of the past" } else { "" };
                let mut from: Vec<&str> = Vec::new();
                for entry in &gather.entries {
                    let producer = producer(&plan.channels[entry.slot].name);
                    if !from.contains(&producer) {
                        from.push(producer);
                    }
                }
                let (number, from) = (gather.entries.len(), from.join(", "));
                format!("read {number} {how} of {from}{lagged}")
            }
            Step::Run(node) => run(plan, &plan.nodes[*node], expand),
            Step::Capture(node) => format!(
                "keep the inputs of {} for later ticks",
                name(&plan.nodes[*node], expand)
            ),
        };
        steps.push((number + 1, number + 1, line));
    }
    // Instances of a node, and what they read, follow each other in the same pattern.
    let mut at = 0;
    while at < steps.len() {
        let period = if expand {
            None
        } else {
            (1..=2).find(|&period| repeats(&steps, at, period) > 1)
        };
        let (period, times) = period.map_or((1, 1), |period| (period, repeats(&steps, at, period)));
        let last = at + period * times;
        let lines: Vec<&str> = steps[at..at + period]
            .iter()
            .map(|(_, _, line)| line.as_str())
            .collect();
        let times_text = if times > 1 {
            format!("  × {times}")
        } else {
            String::new()
        };
        let range = if last - at == 1 {
            format!("{}", at + 1)
        } else {
            format!("{}-{last}", at + 1)
        };
        let _ = writeln!(text, "  {range:>9}  {}{times_text}", lines[0]);
        for line in &lines[1..] {
            let _ = writeln!(text, "  {:>9}    then {line}", "");
        }
        at = last;
    }
    text
}

fn repeats(steps: &[(usize, usize, String)], at: usize, period: usize) -> usize {
    let same = |a: usize, b: usize| (0..period).all(|i| steps[a + i].2 == steps[b + i].2);
    let mut times = 1;
    while at + period * (times + 1) <= steps.len() && same(at, at + period * times) {
        times += 1;
    }
    times
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
    let ahead = match node.role.learns_from() {
        Some((truth, _)) => {
            format!(
                ", {} {} ahead",
                plan.channels[truth.slot]
                    .name
                    .split('.')
                    .next()
                    .unwrap_or_default(),
                truth.ahead
            )
        }
        None => String::new(),
    };
    format!(
        "run {} ({}){ahead}{every}{slots}",
        name(node, expand),
        node.kind.name
    )
}
