//! Decides what of a report is told on a terminal, 80 columns wide.

use std::fmt::Write as _;

use super::{Facts, Hours, Published, Worth, figure, spelled};

/// The verdicts, the article's figures beside ours, what the correction is worth, and the sensors that somebody should look at.
#[must_use]
pub fn text(facts: &Facts) -> String {
    let mut text = String::new();
    for verdict in &facts.verdicts {
        let sentence = format!("{}: {}", verdict.axis, verdict.sentence());
        text.push_str(&filled(&sentence, "   "));
    }
    let ahead = facts.course.axes.first().map_or(0.0, |axis| axis.ahead_s);
    for table in &facts.published {
        let _ = writeln!(text, "\n{}; here {} min ahead", table.source, ahead / 60.0);
        published(&mut text, table);
    }
    if let Some(worth) = &facts.worth {
        loss(&mut text, worth, &Hours::of(&facts.course));
    }
    let sensors = facts.course.sensors.iter();
    let odd: Vec<_> = sensors
        .map(|sensor| (sensor, sensor.remarks()))
        .filter(|(_, remarks)| !remarks.is_empty())
        .collect();
    if !odd.is_empty() {
        text.push_str("\nSensors to look at:\n");
        for (sensor, remarks) in odd {
            text.push_str(&filled(
                &format!("  {}: {}", sensor.name, remarks.join("; ")),
                "    ",
            ));
        }
    }
    text
}

/// The article's errors, and ours under them.
fn published(text: &mut String, table: &Published) {
    let _ = write!(text, "{:<32}", "errors in nm/min");
    for axis in &table.axes {
        let _ = write!(text, "{axis:>8}");
    }
    text.push('\n');
    let mut line = |name: &str, whose: &str, figures: &mut dyn Iterator<Item = Option<f64>>| {
        let _ = write!(text, "{name:<22}{whose:<10}");
        for value in figures {
            let _ = write!(text, "{:>8}", figure(value));
        }
        text.push('\n');
    };
    for row in &table.rows {
        line(
            row.name,
            "published",
            &mut row.published.iter().map(|value| Some(*value)),
        );
        line("", "here", &mut row.ours.iter().copied());
    }
}

fn loss(text: &mut String, worth: &Worth, hours: &Hours) {
    let Some(headline) = worth.headline() else {
        return;
    };
    text.push('\n');
    text.push_str(&filled(&headline, ""));
    if worth.settling.is_empty() {
        return;
    }
    if hours.from_s != 0.0 {
        let _ = writeln!(text, "\nChanges of the set point, in {}:", hours.label);
    }
    let unit = spelled(worth.set_point_unit.as_deref().unwrap_or_default());
    let _ = writeln!(
        text,
        "\n{:>27}{:>21}{:>27}\n{:>6}{:>9}{:>9}{:>15}{:>9}{:>17}{:>9}",
        format!("set point in {unit}"),
        "settled after, min",
        "largest loss, dB",
        "hour",
        "from",
        "to",
        "without",
        "with",
        "without",
        "with"
    );
    let minutes = |m: Option<f64>| m.map_or("never".to_owned(), |m| format!("{m:.1}"));
    for s in &worth.settling {
        let _ = writeln!(
            text,
            "{:>6.1}{:>9.1}{:>9.1}{:>15}{:>9}{:>17}{:>9}",
            hours.at(s.at_s),
            s.from,
            s.to,
            minutes(s.without_min),
            minutes(s.with_min),
            figure(Some(s.largest_without)),
            figure(Some(s.largest_with)),
        );
    }
    let _ = writeln!(
        text,
        "\n{:<32}{:>28}",
        "largest loss per step, dB", "without     with"
    );
    for step in &worth.steps {
        let name = match step.changes {
            0 => format!("{:.0} {unit}, before any step", step.to),
            1 => format!("{:.0} to {:.0} {unit}", step.from, step.to),
            n => format!("{:.0} to {:.0} {unit}, {n} times", step.from, step.to),
        };
        let _ = writeln!(
            text,
            "{name:<32}{:>19}{:>9}",
            figure(Some(step.largest_without)),
            figure(Some(step.largest_with))
        );
    }
}

/// Words on lines of at most 80 letters; lines after the first begin with `indent`.
fn filled(words: &str, indent: &str) -> String {
    let lead = words.len() - words.trim_start().len();
    let mut text = " ".repeat(lead);
    let mut column = lead;
    for (nth, word) in words.split_whitespace().enumerate() {
        let length = word.chars().count();
        if nth > 0 && column + 1 + length > 80 {
            text.push('\n');
            text.push_str(indent);
            column = indent.len();
        } else if nth > 0 {
            text.push(' ');
            column += 1;
        }
        text.push_str(word);
        column += length;
    }
    text + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_broken_before_the_edge_and_keep_their_indent() {
        let words = "  a ".to_owned() + &"word ".repeat(30);
        let text = filled(&words, "    ");
        assert!(text.starts_with("  a word") && text.contains("\n    word"));
        assert!(text.lines().all(|line| line.chars().count() <= 80));
        assert_eq!(text.split_whitespace().count(), 31);
    }
}
