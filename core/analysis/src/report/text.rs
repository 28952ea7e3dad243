//! A report on a terminal, 80 columns wide.

use std::fmt::Write as _;

use super::{Departure, Facts, Hours, Light, figure, spelled};
use crate::figures::{paragraph, table};

/// The verdicts, what the correction is worth, and the sensors that somebody should look at.
#[must_use]
pub fn text(facts: &Facts) -> String {
    let mut text = String::new();
    for verdict in &facts.verdicts {
        let sentence = format!("{}: {}", verdict.axis, verdict.sentence());
        text.push_str(&paragraph("", 3, &sentence));
    }
    if let Some(worth) = &facts.worth {
        departures(&mut text, &worth.departures);
        if let Some(realignment) = &worth.realignment {
            text.push('\n');
            text.push_str(&paragraph("", 0, &realignment.sentence()));
        }
        for light in worth.lights() {
            loss(
                &mut text,
                light,
                !worth.others.is_empty(),
                &Hours::of(&facts.course),
            );
        }
    }
    let hours = Hours::of(&facts.course);
    let outside = facts.novelty.sentences(&hours);
    if !outside.is_empty() {
        let _ = writeln!(text, "\nOutside of what was learned, in {}:", hours.label);
        for sentence in outside {
            text.push_str(&paragraph("  ", 4, &sentence));
        }
    }
    let sensors = facts.course.sensors.iter();
    let odd: Vec<_> = sensors
        .map(|sensor| (sensor, sensor.remarks()))
        .filter(|(_, remarks)| !remarks.is_empty())
        .collect();
    if !odd.is_empty() {
        text.push_str("\nSensors to look at:\n");
        for (sensor, remarks) in odd {
            let sentence = format!("{}: {}", sensor.name, remarks.join("; "));
            text.push_str(&paragraph("  ", 4, &sentence));
        }
    }
    text
}

/// How far axes depart, and what limits their corrections.
fn departures(text: &mut String, departures: &[Departure]) {
    let header = [
        "position, from its start",
        "unit",
        "RMS without",
        "with",
        "largest without",
        "with",
    ];
    let line = |of: &Departure| {
        let figures = [
            of.rms_without,
            of.rms_with,
            of.largest_without,
            of.largest_with,
        ];
        let cells = [of.axis.clone(), spelled(&of.unit).to_owned()];
        cells.into_iter().chain(figures.map(figure)).collect()
    };
    let measured = departures.iter().filter(|of| of.rms_without.is_some());
    let rows: Vec<Vec<String>> = measured.map(line).collect();
    if !rows.is_empty() {
        text.push('\n');
        text.push_str(&table(&header, &rows));
    }
    for of in departures {
        if of.is_worse() {
            let sentence = format!(
                "Corrected, {} is farther from its start than without, though its drift may be less.",
                of.axis
            );
            text.push_str(&paragraph("", 2, &sentence));
        }
        if let Some(limited) = of.limited() {
            let sentence = format!("The correction of {} is {limited}.", of.axis);
            text.push_str(&paragraph("", 2, &sentence));
        }
    }
}

fn loss(text: &mut String, light: &Light, of_several: bool, hours: &Hours) {
    let Some(headline) = light.headline(of_several) else {
        return;
    };
    text.push('\n');
    text.push_str(&paragraph("", 0, &headline));
    if light.settling.is_empty() {
        return;
    }
    if hours.from_s != 0.0 {
        let _ = writeln!(text, "\nChanges of the set point, in {}:", hours.label);
    }
    let unit = spelled(light.set_point_unit.as_deref().unwrap_or_default());
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
    for s in &light.settling {
        let _ = writeln!(
            text,
            "{:>6.1}{:>9.1}{:>9.1}{:>15}{:>9}{:>17}{:>9}",
            hours.at(s.at_s),
            s.from,
            s.to,
            minutes(s.without_min),
            minutes(s.with_min),
            figure(s.largest_without),
            figure(s.largest_with),
        );
    }
    let _ = writeln!(
        text,
        "\n{:<32}{:>28}",
        "largest loss per step, dB", "without     with"
    );
    for step in &light.steps {
        let name = match step.changes {
            0 => format!("{:.0} {unit}, before any step", step.to),
            1 => format!("{:.0} to {:.0} {unit}", step.from, step.to),
            n => format!("{:.0} to {:.0} {unit}, {n} times", step.from, step.to),
        };
        let _ = writeln!(
            text,
            "{name:<32}{:>19}{:>9}",
            figure(step.largest_without),
            figure(step.largest_with)
        );
    }
}
