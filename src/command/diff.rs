//! `athermal diff`: what differs in meaning between two graphs or models.

use std::path::{Path, PathBuf};

use athermal::core::compile::{Change, ParameterChange, PlanDiff, diff};
use athermal::core::diagnostic::Sources;
use clap::Args;
use serde_json::{Value, json};

use crate::terminal::{Answer, Failure, Format, Terminal};
use athermal_jobs::model;

/// Show what differs in meaning between two graphs or models
///
/// Comments, order, spelling, and how a duration or unit is written are no difference. Where both are fitted, fitted
/// parameters are compared too. The exit status is 0 where both mean the same, and 1 where they do not.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal diff graphs/die-tester.toml graphs/die-tester-sensor.toml\n  athermal diff --format json old.json new.json"
)]
pub struct Diff {
    /// The graph or model before
    #[arg(value_name = "A")]
    before: PathBuf,
    /// The graph or model after
    #[arg(value_name = "B")]
    after: PathBuf,
}

impl Diff {
    /// Compares the two.
    ///
    /// # Errors
    /// When one of them cannot be read or has mistakes.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let load = |path: &Path| model::load_to_fit(path, &mut Sources::new(), terminal);
        let (before, after) = (load(&self.before)?, load(&self.after)?);
        let plans = diff(&before.plan, &after.plan);
        let fitted = before.refitted(&after);
        let same = plans.is_same() && fitted.is_empty();
        if terminal.format == Format::Json {
            let mut all = json!({ "same": same, "fitted": fitted });
            if let (Value::Object(all), Ok(Value::Object(plans))) =
                (&mut all, serde_json::to_value(&plans))
            {
                all.extend(plans);
            }
            println!("{all:#}");
        } else {
            show(&plans, &fitted);
            terminal.note(summary(&plans));
        }
        Ok(if same { Answer::Fine } else { Answer::No })
    }
}

fn show(plans: &PlanDiff, fitted: &[String]) {
    let time = (!plans.time.is_empty()).then(|| ("time", Change::Changed(plans.time.clone())));
    let time: Vec<_> = time.iter().map(|(name, change)| (*name, change)).collect();
    section("time", &time);
    let signals = plans
        .signals
        .iter()
        .map(|s| (s.channel.as_str(), &s.change));
    section("signals", &signals.collect::<Vec<_>>());
    let nodes = plans.nodes.iter().map(|n| (n.instance.as_str(), &n.change));
    section("nodes", &nodes.collect::<Vec<_>>());
    let outputs = plans.outputs.iter().map(|o| (o.output.as_str(), &o.change));
    section("outputs", &outputs.collect::<Vec<_>>());
    if !fitted.is_empty() {
        println!("fitted parameters\n  ~ {}", fitted.join(", "));
    }
}

/// What changed among things of one sort, those that changed alike together.
fn section(title: &str, things: &[(&str, &Change)]) {
    let mut groups: Vec<(String, &str, Vec<String>, Vec<&str>)> = Vec::new();
    for (name, change) in things {
        let (sign, parameters) = match change {
            Change::Unchanged => continue,
            Change::Added => ("+", &[][..]),
            Change::Removed => ("-", &[][..]),
            Change::Changed(parameters) => ("~", &parameters[..]),
        };
        let (owner, member) = name.split_once('.').unwrap_or((name, ""));
        let lines: Vec<_> = parameters.iter().flat_map(|p| lines(p, member)).collect();
        let alike = groups
            .iter_mut()
            .find(|group| group.0 == owner && group.1 == sign && group.2 == lines);
        match alike {
            Some(group) => group.3.push(member),
            None => groups.push((owner.to_owned(), sign, lines, vec![member])),
        }
    }
    if groups.is_empty() {
        return;
    }
    println!("{title}");
    for (owner, sign, lines, members) in groups {
        match &members[..] {
            [""] => println!("  {sign} {owner}"),
            [member] => println!("  {sign} {owner}.{member}"),
            several => println!("  {sign} {owner}.{{{}}}", several.join(",")),
        }
        let member = match &members[..] {
            [member] => (*member).to_owned(),
            _ => "{member}".to_owned(),
        };
        for line in lines {
            println!("      {}", line.replace("{member}", &member));
        }
    }
}

/// A property that differs, with the member's name left open.
fn lines(change: &ParameterChange, member: &str) -> Vec<String> {
    let lines = match (&change.from, &change.to) {
        (Some(Value::Array(from)), Some(Value::Array(to))) if from.len() + to.len() > 6 => {
            let mut lines = vec![format!("{}:", change.path)];
            let gone = from.iter().filter(|value| !to.contains(value));
            let come = to.iter().filter(|value| !from.contains(value));
            lines.extend(gone.map(|value| format!("  - {}", plain(value))));
            lines.extend(come.map(|value| format!("  + {}", plain(value))));
            if lines.len() == 1 {
                lines[0] += " the same in another order";
            }
            lines
        }
        (from, to) => {
            let shown = |value: &Option<Value>| value.as_ref().map_or("none".to_owned(), plain);
            vec![format!("{}: {} -> {}", change.path, shown(from), shown(to))]
        }
    };
    if member.is_empty() {
        return lines;
    }
    let open = |line: String| {
        let mut words = line.split(' ').map(|word| {
            let (bare, comma) = word.strip_suffix(',').map_or((word, ""), |w| (w, ","));
            match bare.strip_suffix(member).and_then(|w| w.strip_suffix('.')) {
                Some(owner) => format!("{owner}.{{member}}{comma}"),
                None => word.to_owned(),
            }
        });
        let first = words.next().unwrap_or_default();
        words.fold(first, |line, word| line + " " + &word)
    };
    lines.into_iter().map(open).collect()
}

fn plain(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Array(values) => values.iter().map(plain).collect::<Vec<_>>().join(", "),
        other => other.to_string(),
    }
}

fn summary(plans: &PlanDiff) -> String {
    let count = |wanted: fn(&Change) -> bool| {
        let nodes = plans.nodes.iter();
        nodes.filter(|node| wanted(&node.change)).count()
    };
    format!(
        "nodes: {} carried over, {} changed, {} added, {} removed",
        count(|change| *change == Change::Unchanged),
        count(|change| matches!(change, Change::Changed(_))),
        count(|change| *change == Change::Added),
        count(|change| *change == Change::Removed),
    )
}
