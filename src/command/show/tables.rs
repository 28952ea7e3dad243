//! The coefficients of a model as tables for a terminal.

use std::fmt::Write as _;

use athermal::core::node::Mode;

use athermal::run::model::{EstimatorParts, FittedEstimator};
use athermal_analysis::figures::{digits, paragraph, stated, table, time};

/// The longest name that numbers stand beside; longer ones stand above them.
const LONGEST_NAME: usize = 36;

/// The text about a model.
pub(super) fn text(estimators: &[FittedEstimator], unfitted: &[String]) -> String {
    let mut text = String::new();
    for of in estimators {
        let found = of.parts.as_ref();
        text.push_str(
            &found.map_or_else(|| without_coefficients(of), |found| estimator(of, found)),
        );
        text.push('\n');
    }
    for node in unfitted {
        let _ = writeln!(text, "{node} could not be fitted\n");
    }
    let all = estimators.iter().filter_map(|of| of.parts.as_ref());
    let mut all = all.flat_map(|found| &found.coefficients);
    if all.any(|of| of.standard_error.is_some()) {
        text.push_str(
            "std. error: as if the errors of rows were independent, so too small where\n\
             windows overlap; with a penalty, the spread of the posterior\n",
        );
        let mut found = estimators.iter().filter_map(|of| of.parts.as_ref());
        if found.any(is_bounded) {
            text.push_str(
                "polynomials without one are held by the bound of stability, or the rows hardly\n\
                 determine them: none is known\n",
            );
        }
    } else if estimators.is_empty() && unfitted.is_empty() {
        text.push_str("nothing in the graph is fitted\n");
    }
    text
}

/// Whether some polynomials have standard errors, and others have not.
fn is_bounded(found: &EstimatorParts) -> bool {
    let of_polynomials = found
        .coefficients
        .iter()
        .filter(|of| of.polynomial.is_some());
    let (with, without): (Vec<_>, Vec<_>) =
        of_polynomials.partition(|of| of.standard_error.is_some());
    !with.is_empty() && !without.is_empty()
}

fn without_coefficients(of: &FittedEstimator) -> String {
    let FittedEstimator {
        node, kind, truth, ..
    } = of;
    format!("{node} ({kind} of {truth}): nodes of this type have no coefficients to show\n")
}

fn estimator(of: &FittedEstimator, found: &EstimatorParts) -> String {
    let FittedEstimator {
        node,
        kind,
        truth,
        unit,
        ..
    } = of;
    let mut text = format!("{node} ({kind} of {truth})\n");
    if found.step_s.is_some() {
        text.push_str(&paragraph("  ", 2, &equation(found)));
    }
    let rows = found.coefficients.iter().map(|of| {
        let error = of.standard_error.map_or("-".to_owned(), |it| digits(it, 3));
        let cells = [
            digits(of.value, places(of.value, of.standard_error)),
            error,
            of.per.clone().unwrap_or_default(),
        ];
        (of.name.as_str(), cells.to_vec())
    });
    let header = ["  coefficient", unit, "std. error", "per"];
    text.push_str(&named(&header, rows));
    text.push_str(&held(found));
    if !found.noises.is_empty() {
        let rows = found.noises.iter().map(|noise| {
            let within = noise.per_s.map(|per| format!("in {}", stated(per)));
            vec![
                format!("  {}", noise.name),
                digits(noise.deviation, 4),
                within.unwrap_or_default(),
            ]
        });
        let header = ["  standard deviation of", unit, ""];
        text.push_str(&table(&header, &rows.collect::<Vec<_>>()));
    }
    if !found.modes.is_empty() {
        let rows = found.modes.iter().map(|mode| {
            let period = mode.period_s.map_or("-".to_owned(), time);
            (mode.of.as_str(), vec![fading(mode), period])
        });
        let header = ["  comes to rest", "time constant", "period"];
        text.push_str(&named(&header, rows));
    }
    text
}

/// The equation that the polynomials are of.
fn equation(found: &EstimatorParts) -> String {
    let all = || found.coefficients.iter();
    let has = |polynomial: char| all().any(|of| of.polynomial == Some(polynomial));
    let has_constant = all().any(|of| of.polynomial.is_none());
    let truth = match (has('A'), has_constant) {
        (true, true) => "A(q) (y − constant)",
        (true, false) => "A(q) y",
        (false, true) => "y − constant",
        (false, false) => "y",
    };
    let inputs = match (has('B'), has('F')) {
        (true, true) => "Σ B(q)/F(q) u + ",
        (true, false) => "Σ B(q) u + ",
        (false, _) => "",
    };
    let c = if has('C') { "C(q)" } else { "1" };
    let integrated = ["", "(1 − q⁻¹)", "(1 − q⁻¹)²"][found.differences.min(2)];
    let d = if has('D') { "D(q)" } else { "" };
    let noise = match (c, d, integrated) {
        ("1", "", "") => "e".to_owned(),
        (c, "", "") => format!("{c} e"),
        (c, "", below) | (c, below, "") => format!("{c}/{below} e"),
        (c, d, integrated) => format!("{c}/({d} {integrated}) e"),
    };
    let order = all().filter(|of| of.polynomial == Some('A')).count();
    let order = match order {
        0 => String::new(),
        order => format!("; A is of order {order}"),
    };
    let step = stated(found.step_s.unwrap_or(0.0));
    format!("{truth} = {inputs}{noise}, q⁻¹ being a step of {step} back{order}")
}

/// A table whose names may be long: those that are stand above their numbers, so that the others are not held apart from theirs.
fn named<'a>(header: &[&str], rows: impl Iterator<Item = (&'a str, Vec<String>)>) -> String {
    let (mut above, mut lines) = (vec![String::new()], Vec::new());
    for (name, cells) in rows {
        let mut names = name_lines(name);
        let beside = names.pop().unwrap_or_default();
        above.push(names.iter().map(|line| format!("{line}\n")).collect());
        lines.push(std::iter::once(beside).chain(cells).collect());
    }
    let table = table(header, &lines);
    let lines = above.iter().zip(table.lines());
    lines
        .map(|(above, line)| format!("{above}{line}\n"))
        .collect()
}

/// The name in lines of which numbers stand beside the last.
fn name_lines(name: &str) -> Vec<String> {
    let short = |text: &str| text.chars().count() <= LONGEST_NAME;
    if short(name) {
        return vec![format!("  {name}")];
    }
    let mut lines: Vec<String> = Vec::new();
    for factor in name.split(" × ") {
        let sign = if lines.is_empty() { "  " } else { "    × " };
        lines.push(format!("{sign}{factor}"));
    }
    if lines.last().is_some_and(|last| !short(last)) {
        lines.push(String::new());
    }
    lines
}

/// From where regressors in products count, and how far.
fn held(found: &EstimatorParts) -> String {
    let factors = || found.coefficients.iter().flat_map(|of| &of.factors);
    let mut regressors: Vec<&str> = Vec::new();
    for factor in factors().filter(|of| of.about.is_some() || of.held.is_some()) {
        if !regressors.contains(&&*factor.regressor) {
            regressors.push(&factor.regressor);
        }
    }
    if regressors.is_empty() {
        return String::new();
    }
    let number = |value: Option<f64>| value.map_or("-".to_owned(), |it| digits(it, 5));
    let ranges = factors().any(|of| of.held.is_some());
    let rows = regressors.iter().map(|&name| {
        let of = || factors().filter(|of| of.regressor == name);
        let about = of().find_map(|of| of.about);
        let unit = of().next().map_or("", |of| &*of.unit);
        let mut row = vec![number(about), unit.to_owned()];
        if ranges {
            let held = of().find_map(|of| of.held);
            row.push(number(held.map(|(least, _)| least)));
            row.push(number(held.map(|(_, largest)| largest)));
        }
        (name, row)
    });
    let header = ["  counted from its mean", "", "", "held from", "to"];
    let columns = if ranges { 5 } else { 3 };
    named(&header[..columns], rows)
}

fn fading(mode: &Mode) -> String {
    match mode.time_constant_s {
        stays if stays.is_infinite() => "stays".to_owned(),
        grows if grows < 0.0 => format!("grows, {}", time(-grows)),
        fades => time(fades),
    }
}

/// How many digits of a coefficient are shown: five, and where it is known better, up to the second of its standard error.
fn places(value: f64, error: Option<f64>) -> usize {
    let known = error.map_or(0.0, |error| (value / error).abs().log10().ceil() + 2.0);
    // As a number of digits NaN is none.
    (known as usize).clamp(5, 12)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_coefficient_is_shown_to_the_second_digit_of_its_standard_error() {
        let shown = |value: f64, error| digits(value, places(value, error));
        assert_eq!(shown(1_000_010.0, Some(0.0182)), "1.000010000e6");
        assert_eq!(shown(-0.523_456, Some(0.1)), "-0.52346");
        assert_eq!(shown(98.765_432_1, Some(0.000_12)), "98.765432");
        assert_eq!(shown(2.0, Some(0.0)), "2.00000000000");
        assert_eq!(shown(0.0, Some(0.0)), "0");
        assert_eq!(shown(1.5, None), "1.5000");
    }

    #[test]
    fn a_type_without_coefficients_is_reported() {
        let of = FittedEstimator {
            node: "model.Z".to_owned(),
            kind: "my_node",
            truth: "drift.Z".to_owned(),
            unit: "nm/min".to_owned(),
            parts: None,
        };
        assert_eq!(
            without_coefficients(&of),
            "model.Z (my_node of drift.Z): nodes of this type have no coefficients to show\n"
        );
    }

    #[test]
    fn what_does_not_come_to_rest_stays_or_grows() {
        let mode = |time_constant_s: f64| Mode {
            of: "A".to_owned(),
            time_constant_s,
            period_s: None,
        };
        assert_eq!(fading(&mode(f64::INFINITY)), "stays");
        assert_eq!(fading(&mode(-60.0)), "grows, 60 s");
    }
}
