//! Decides how the facts of a diagnosis look as text, in 80 columns.

use std::fmt::Write as _;

use athermal::Duration;
use athermal::diagnosis::day::{CurvePoint, DayScore, Days, ENOUGH};
use athermal::diagnosis::lag::{Correlogram, FeatureLags};
use athermal::diagnosis::regressor::Design;
use athermal::diagnosis::residual::Residuals;
use athermal::diagnosis::response::Response;
use athermal::diagnosis::{Diagnosis, Main, is_asked};

use crate::figures::{count, length, matrix, number, or_dash, table};

/// Features that are named of each truth.
const FEATURES: usize = 3;
/// A correlation that lies so many standard errors from none says something.
const SAYS_SOMETHING: f64 = 3.0;
/// A variance inflation beyond which a coefficient means little by itself (Marquardt 1970).
const INFLATED: f64 = 10.0;
/// By how much answers to a step up and down differ at least where it is worth a word.
const BENT: f64 = 0.005;

/// The tables of a diagnosis, of the predictions asked for.
pub struct Tables<'a> {
    diagnosis: &'a Diagnosis,
    asked: &'a [String],
}

impl<'a> Tables<'a> {
    pub fn new(diagnosis: &'a Diagnosis, asked: &'a [String]) -> Self {
        Self { diagnosis, asked }
    }

    /// Everything, section by section.
    pub fn text(&self) -> String {
        let sections = [
            self.residuals(),
            self.lags(),
            self.responses(),
            self.designs(),
            self.contributions(),
            self.days(),
            self.windows(),
        ];
        let sections: Vec<String> = sections.into_iter().filter(|of| !of.is_empty()).collect();
        sections.join("\n")
    }

    fn shows(&self, prediction: &str) -> bool {
        if self.asked.is_empty() {
            return self.main().any(|main| main.prediction == prediction);
        }
        is_asked(prediction, self.asked)
    }

    /// The truths of which something is shown.
    fn main(&self) -> impl Iterator<Item = &'a Main> {
        let shown = |main: &&Main| {
            let residuals = self.diagnosis.residuals.iter();
            let mut of_truth = residuals.filter(|of| of.truth == main.truth);
            of_truth.any(|of| is_asked(&of.prediction, self.asked))
        };
        self.diagnosis.main.iter().filter(shown)
    }

    /// Estimators are shown with the truths that they predict, or where they are asked for.
    fn shows_estimator(&self, node: &str) -> bool {
        is_asked(node, self.asked)
    }

    /// A text for the predictions of each unit, since headings tell it.
    fn of_each_unit(&self, text: impl Fn(&str, &[&str]) -> String) -> String {
        let all = self.diagnosis.residuals.iter();
        let shown = all.filter(|of| self.shows(&of.prediction));
        let mut texts = Vec::new();
        for group in grouped(shown, |of| of.unit.clone()) {
            let names: Vec<&str> = group.iter().map(|of| of.prediction.as_str()).collect();
            texts.push(text(&group[0].unit, &names));
        }
        texts.retain(|text| !text.is_empty());
        texts.join("\n")
    }

    fn residuals(&self) -> String {
        let all = self.diagnosis.residuals.iter();
        let shown = all.filter(|of| self.shows(&of.prediction));
        let groups = grouped(shown, |of| (of.unit.clone(), of.spacing_s));
        let tables: Vec<String> = groups.iter().map(|of| residuals(of)).collect();
        tables.join("\n")
    }

    fn lags(&self) -> String {
        let mut rows = Vec::new();
        for main in self.main() {
            let Some(of) = self.diagnosis.lags.iter().find(|of| of.truth == main.truth) else {
                continue;
            };
            let mut list = |title: String, side: fn(&FeatureLags) -> &Correlogram, least: f64| {
                let features = of.features.iter();
                let mut found: Vec<_> = features
                    .filter(|of| side(of).significance() >= least)
                    .collect();
                found.sort_by(|a, b| side(b).best.abs().total_cmp(&side(a).best.abs()));
                let more = found.len().saturating_sub(FEATURES);
                let told = match (found.is_empty(), least > 0.0 && more > 0) {
                    (true, _) => format!("  {title}: nothing"),
                    (_, true) => format!("  {title}, and {more} more"),
                    _ => format!("  {title}"),
                };
                rows.push(vec![told]);
                rows.extend(found.iter().take(FEATURES).map(|feature| {
                    let correlogram = side(feature);
                    vec![
                        format!("    {}", feature.feature),
                        format!("{:.2}", correlogram.best),
                        seconds(correlogram.best_lag_s),
                        format!("{:.2}", correlogram.error),
                    ]
                }));
            };
            list(of.truth.clone(), |of| &of.truth, 0.0);
            let left = format!("left of it by {}", of.prediction);
            list(left, |of| &of.residual, SAYS_SOMETHING);
        }
        if rows.is_empty() {
            return String::new();
        }
        format!(
            "largest correlation of features with the truth, with the lag by which it\n\
             follows them, and σ, which chance alone would give; and beyond 3 σ with what is\n\
             left of it, at lags at which they were known when it was predicted\n{}",
            table(&["", "r", "lag", "σ"], &rows)
        )
    }

    fn responses(&self) -> String {
        let all = self.diagnosis.responses.iter();
        let shown: Vec<_> = all.filter(|of| self.shows_estimator(&of.node)).collect();
        let mut text = String::new();
        let mut nodes: Vec<&str> = shown.iter().map(|of| name_of(&of.node)).collect();
        nodes.dedup();
        for node in nodes {
            let of_node: Vec<_> = shown
                .iter()
                .filter(|of| name_of(&of.node) == node)
                .collect();
            let columns: Vec<String> = of_node.iter().map(|of| axis_of(&of.truth)).collect();
            let mut sensors: Vec<&Response> = Vec::new();
            for sensor in of_node.iter().flat_map(|of| &of.sensors) {
                if !sensors.iter().any(|known| known.sensor == sensor.sensor) {
                    sensors.push(sensor);
                }
            }
            if sensors.is_empty() {
                continue;
            }
            let cells = |sensors: &[&Response],
                         cell: fn(&Response) -> String|
             -> Vec<(String, Vec<String>)> {
                let row = |sensor: &&Response| {
                    let find = |of: &&&athermal::diagnosis::response::Responses| {
                        let mut of = of.sensors.iter();
                        let found = of.find(|of| of.sensor == sensor.sensor);
                        found.map_or("-".to_owned(), cell)
                    };
                    (sensor.sensor.clone(), of_node.iter().map(find).collect())
                };
                sensors.iter().map(row).collect()
            };
            let unit = &of_node[0].unit;
            let in_the_end = in_the_end(unit);
            let has = |of: &Response, kind: fn(&Response) -> Option<f64>| {
                let mut all = of_node.iter().flat_map(|node| &node.sensors);
                all.any(|other| other.sensor == of.sensor && kind(other).is_some())
            };
            for alike in grouped(sensors.iter().copied(), |of| of.sensor_unit.clone()) {
                let step = format!("{node}: how far a step of 1 {} moves", alike[0].sensor_unit);
                let (come_back, last): (Vec<_>, Vec<_>) = alike
                    .into_iter()
                    .partition(|of| has(of, |of| of.total) || !has(of, |of| of.gain));
                if !come_back.is_empty() {
                    let _ = writeln!(text, "{step} what it predicts in the end, in {in_the_end}");
                    let total = |of: &Response| of.total.map_or("no end".to_owned(), number);
                    let mut rows = cells(&come_back, total);
                    if come_back.len() > 1 {
                        // What sensors that tell the same share among them means more than what each has of it.
                        let together = of_node.iter().map(|of| {
                            let names = |one: &&Response| {
                                let mut all = come_back.iter();
                                all.any(|other| other.sensor == one.sensor)
                            };
                            let totals = of.sensors.iter().filter(names).map(|of| of.total);
                            let sum: Option<f64> = totals.sum();
                            sum.map_or("no end".to_owned(), number)
                        });
                        rows.push(("all together".to_owned(), together.collect()));
                    }
                    text.push_str(&matrix("sensor", &columns, &rows));
                }
                if !last.is_empty() {
                    let _ = writeln!(text, "{step} what it predicts for good, in {unit}");
                    let gain = |of: &Response| of.gain.map_or("no end".to_owned(), number);
                    text.push_str(&matrix("sensor", &columns, &cells(&last, gain)));
                }
            }
            let all = of_node.iter().flat_map(|of| &of.sensors);
            let longest = all.filter_map(|of| of.settled_s).fold(0.0, f64::max);
            let in_minutes = longest >= 120.0;
            let _ = writeln!(
                text,
                "{node}: time until nine tenths of that have come, in {}",
                if in_minutes { "min" } else { "s" }
            );
            let in_unit: fn(&Response) -> String = if in_minutes {
                |of| times(of.settled_s, 60.0)
            } else {
                |of| times(of.settled_s, 1.0)
            };
            text.push_str(&matrix("sensor", &columns, &cells(&sensors, in_unit)));
            let bent = of_node.iter().flat_map(|of| &of.sensors);
            if bent.clone().any(|of| of.asymmetry >= BENT) {
                let largest = bent.map(|of| of.asymmetry).fold(0.0, f64::max);
                let _ = writeln!(
                    text,
                    "  it is not linear: steps up and down differ by up to {:.0} %",
                    100.0 * largest
                );
            }
        }
        text
    }

    fn designs(&self) -> String {
        let all = self.diagnosis.designs.iter();
        let shown: Vec<_> = all.filter(|of| self.shows_estimator(&of.node)).collect();
        if shown.is_empty() {
            return String::new();
        }
        let mut text = String::from(
            "how well the data determine each estimator: condition number of its regressors,\n\
             and the largest variance inflation factor (VIF); beyond 10 the regressor is\n\
             named: others tell nearly the same, its coefficient means little by itself\n",
        );
        let rows: Vec<Vec<String>> = shown
            .iter()
            .map(|of| {
                let known = of.regressors.iter().filter(|of| !of.inflation.is_nan());
                let worst = known.max_by(|a, b| a.inflation.total_cmp(&b.inflation));
                vec![
                    format!("  {}", of.node),
                    count(of.rows),
                    of.regressors.len().to_string(),
                    number(of.condition),
                    worst.map_or("-".to_owned(), |of| number(of.inflation)),
                    worst.map_or_else(String::new, |of| {
                        let much = of.inflation > INFLATED;
                        if much { of.name.clone() } else { String::new() }
                    }),
                ]
            })
            .collect();
        let header = ["  estimator", "rows", "regressors", "condition", "VIF", ""];
        text.push_str(&table(&header, &rows));
        if !self.asked.is_empty() {
            shown.iter().for_each(|of| text.push_str(&regressors(of)));
        }
        text
    }

    fn contributions(&self) -> String {
        self.of_each_unit(|unit, shown| self.contributions_in(unit, shown))
    }

    fn contributions_in(&self, unit: &str, shown: &[&str]) -> String {
        let all = &self.diagnosis.contributions;
        let of = |sensor: &str, prediction: &str| {
            let mut all = all.iter();
            all.find(|of| of.sensor == sensor && of.prediction == prediction)
        };
        let mut sensors: Vec<&str> = Vec::new();
        for of in all
            .iter()
            .filter(|of| shown.contains(&of.prediction.as_str()))
        {
            if !sensors.contains(&of.sensor.as_str()) {
                sensors.push(&of.sensor);
            }
        }
        if sensors.is_empty() {
            return String::new();
        }
        let columns: Vec<String> = shown.iter().map(|name| (*name).to_owned()).collect();
        let row =
            |sensor: &&str, cell: &dyn Fn(&athermal::diagnosis::sensor::Contribution) -> String| {
                let cells = shown
                    .iter()
                    .map(|name| of(sensor, name).map_or("-".to_owned(), cell));
                ((*sensor).to_owned(), cells.collect::<Vec<String>>())
            };
        let moves: Vec<_> = sensors
            .iter()
            .map(|sensor| row(sensor, &|of| number(of.moves)))
            .collect();
        let mut errors: Vec<_> = sensors
            .iter()
            .map(|sensor| row(sensor, &|of| number(of.rmse_at_rest)))
            .collect();
        let as_it_is = shown.iter().map(|name| {
            let mut residuals = self.diagnosis.residuals.iter();
            let residuals = residuals.find(|of| of.prediction == *name);
            residuals.map_or("-".to_owned(), |of| number(of.rms))
        });
        errors.insert(0, ("as it is".to_owned(), as_it_is.collect()));
        format!(
            "what each sensor moves the predictions by, in {unit} RMS\n{}\
             RMSE in {unit} with a sensor at rest at its mean, nothing fitted anew\n{}",
            matrix("sensor", &columns, &moves),
            matrix("at rest", &columns, &errors)
        )
    }

    fn days(&self) -> String {
        let Some(days) = &self.diagnosis.days else {
            return String::new();
        };
        self.of_each_unit(|unit, shown| days_in(days, unit, shown))
    }

    fn windows(&self) -> String {
        let shown: Vec<_> = self
            .main()
            .filter_map(|main| {
                let mut windows = self.diagnosis.windows.iter();
                windows.find(|of| of.truth == main.truth)
            })
            .collect();
        let mut widths: Vec<f64> = shown
            .iter()
            .flat_map(|of| of.widths.iter().map(|width| width.window_s))
            .collect();
        widths.sort_by(f64::total_cmp);
        widths.dedup();
        if widths.is_empty() {
            return String::new();
        }
        let columns: Vec<String> = shown.iter().map(|of| axis_of(&of.truth)).collect();
        let rows = widths.iter().map(|&width| {
            let cell = |of: &&athermal::diagnosis::window::Windows| {
                let here = of.widths.iter().find(|of| of.window_s == width);
                let own = if of.window_s == width { "*" } else { "" };
                here.map_or("-".to_owned(), |of| format!("{own}{}", number(of.ratio)))
            };
            (seconds(width), shown.iter().map(cell).collect())
        });
        let rows: Vec<_> = rows.collect();
        format!(
            "signal to noise of the drift against its window, * as the graph has it\n{}",
            matrix("window", &columns, &rows)
        )
    }
}

/// Residuals of one unit and spacing.
fn residuals(shown: &[&Residuals]) -> String {
    let Some(first) = shown.first() else {
        return String::new();
    };
    let rows: Vec<Vec<String>> = shown
        .iter()
        .map(|of| {
            let lags = of.autocorrelation.len();
            let largest = (0..lags).max_by(|&a, &b| {
                let size = |lag: usize| of.autocorrelation[lag].abs();
                size(a).total_cmp(&size(b))
            });
            let largest = largest.map_or("-".to_owned(), |lag| {
                let after = seconds((lag + 1) as f64 * of.spacing_s);
                format!("{:.2} at {after}", of.autocorrelation[lag])
            });
            let verdict = match of.white() {
                Some(true) => "white",
                Some(false) => "not white",
                None => "too few",
            };
            vec![
                format!("  {}", of.prediction),
                number(of.rms),
                number(of.mean),
                count(of.spaced as u64),
                largest,
                of.bound.first().map_or("-".into(), |b| format!("±{b:.2}")),
                or_dash(of.ljung_box),
                of.p_value.map_or("-".to_owned(), |p| match p {
                    p if p < 0.0005 => "<0.001".to_owned(),
                    p => format!("{p:.3}"),
                }),
                verdict.to_owned(),
            ]
        })
        .collect();
    let header = [
        "  prediction",
        "RMS",
        "mean",
        "n",
        "autocorrelation",
        "95 %",
        "Q",
        "p",
        "",
    ];
    format!(
        "residuals: measured less predicted in {}, of which n are {} apart, so that\n\
         neither windows nor horizons overlap; their largest autocorrelation beside the\n\
         95 % of white ones; Q of Ljung and Box over {} lags\n{}",
        first.unit,
        seconds(first.spacing_s),
        first.autocorrelation.len(),
        table(&header, &rows)
    )
}

fn days_in(days: &Days, unit: &str, shown: &[&str]) -> String {
    let shown: Vec<String> = shown.iter().map(|&name| name.to_owned()).collect();
    let cells = |scores: &[DayScore], cell: fn(&DayScore) -> Option<f64>| -> Vec<String> {
        let of = |name: &String| scores.iter().find(|score| score.prediction == *name);
        let texts = shown.iter().map(|name| or_dash(of(name).and_then(cell)));
        texts.collect()
    };
    let left_out = days.left_out.iter();
    let left_out = left_out.map(|of| {
        let label = format!("day {}", of.day);
        (label, cells(&of.scores, |score| score.rmse))
    });
    let curve = days.curve.iter().map(|point| {
        let plural = if point.days == 1 { "" } else { "s" };
        let label = format!("{} day{plural} ({} fits)", point.days, point.fits);
        (label, cells(&point.scores, DayScore::ratio))
    });
    let (left_out, curve): (Vec<_>, Vec<_>) = (left_out.collect(), curve.collect());
    let near = |point: &CurvePoint| {
        let scores = point.scores.iter();
        let mut of_shown = scores.filter(|score| shown.contains(&score.prediction));
        of_shown.all(|score| score.ratio().is_none_or(|ratio| ratio <= ENOUGH))
    };
    let last_far = days.curve.iter().rposition(|point| !near(point));
    let enough = days.curve.get(last_far.map_or(0, |last| last + 1));
    let most = days.count - 1;
    let verdict = match enough.map_or(days.count, |point| point.days) {
        _ if most == 1 => "two are too few to tell",
        enough if enough < most => {
            let plural = if enough == 1 { " is" } else { "s are" };
            &format!("{enough} day{plural} enough to come within 5 % of {most}")
        }
        _ => "more days may still make it better",
    };
    let of_day = if days.day_s == 86_400.0 {
        String::new()
    } else {
        format!(" of {}", seconds(days.day_s))
    };
    let curve = match most {
        1 => String::new(),
        _ => format!(
            "RMSE of fits on so many days in a row, 1 being that of fits on {most} days, on the\n\
             same days, which no fit has seen\n{}",
            matrix("fitted on", &shown, &curve)
        ),
    };
    format!(
        "RMSE in {unit} of each day{of_day}, predicted by a fit on all others\n{}\
         how many days are needed: {verdict}\n{curve}",
        matrix("left out", &shown, &left_out)
    )
}

/// What is alike in `by` together, in the order in which the first of each comes.
fn grouped<T, K: PartialEq>(all: impl Iterator<Item = T>, by: impl Fn(&T) -> K) -> Vec<Vec<T>> {
    let mut groups: Vec<(K, Vec<T>)> = Vec::new();
    for one in all {
        let key = by(&one);
        match groups.iter_mut().find(|(known, _)| *known == key) {
            Some((_, group)) => group.push(one),
            None => groups.push((key, vec![one])),
        }
    }
    groups.into_iter().map(|(_, group)| group).collect()
}

fn regressors(of: &Design) -> String {
    let rows: Vec<Vec<String>> = of
        .regressors
        .iter()
        .map(|of| {
            vec![
                format!("    {}", of.name),
                number(of.effect),
                number(of.inflation),
            ]
        })
        .collect();
    let effect = format!("{} per σ", of.unit);
    let first = format!("  {}", of.node);
    table(&[first.as_str(), effect.as_str(), "VIF"], &rows)
}

/// The node of an instance: `thermal` of `thermal.Z1`.
fn name_of(instance: &str) -> &str {
    instance.split_once('.').map_or(instance, |(node, _)| node)
}

fn axis_of(channel: &str) -> String {
    let axis = channel.split_once('.').map_or(channel, |(_, axis)| axis);
    axis.to_owned()
}

/// The unit of a sum over minutes: that of a position, where the truth is its drift per minute.
fn in_the_end(unit: &str) -> String {
    unit.strip_suffix("/min")
        .map_or_else(|| format!("{unit}·min"), str::to_owned)
}

/// A length of time as a number of units of so many seconds.
fn times(length_s: Option<f64>, unit_s: f64) -> String {
    length_s.map_or("no end".to_owned(), |length| number(length / unit_s))
}

/// A length of time, to the second where it is longer than a minute.
fn seconds(seconds: f64) -> String {
    let sign = if seconds < 0.0 { "-" } else { "" };
    let size = match seconds.abs() {
        long if long > 60.0 => long.round(),
        short => short,
    };
    let duration = Duration::from_secs_f64(size);
    duration.map_or_else(|| "-".to_owned(), |of| format!("{sign}{}", length(of)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drift_per_minute_ends_as_a_length() {
        assert_eq!(in_the_end("nm/min"), "nm");
        assert_eq!(in_the_end("W/m2"), "W/m2·min");
        assert_eq!(seconds(-150.05), "-150s");
        assert_eq!(seconds(0.08), "80ms");
    }
}
