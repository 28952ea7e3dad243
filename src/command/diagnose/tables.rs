//! A diagnosis as tables for a terminal, 80 columns wide.

use athermal::diagnosis::lag::{Correlogram, FeatureLags, Lags};
use athermal::diagnosis::regressor::Design;
use athermal::diagnosis::residual::{Residuals, UNLIKELY};
use athermal::diagnosis::{Diagnosis, Main, is_asked, is_called};

use super::instances::{axis_of, grouped, is_of};
use super::{days, responses};
use athermal_analysis::figures::{count, counted, matrix, number, or_dash, rounded, table};

/// Features that are named of each truth.
const FEATURES: usize = 3;
/// A variance inflation beyond which a coefficient means little by itself (Marquardt 1970).
const INFLATED: f64 = 10.0;

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
            self.silent_nodes(),
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
    pub(super) fn main(&self) -> impl Iterator<Item = &'a Main> {
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

    /// A text for the predictions of each unit, which stands in the heading.
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

    /// The correlations of a truth with features; none where it has no features.
    pub(super) fn lags_of(&self, main: &Main) -> Option<&'a Lags> {
        let mut all = self.diagnosis.lags.iter();
        all.find(|of| of.truth == main.truth)
    }

    /// The estimators of a truth among whose regressors a feature is.
    pub(super) fn users_of(&self, main: &'a Main, feature: &str) -> impl Iterator<Item = &'a str> {
        let designs = self.diagnosis.designs.iter();
        let uses = move |of: &&Design| of.regressors.iter().any(|of| of.name == feature);
        let users = designs.filter(uses).map(|of| of.node.as_str());
        users.filter(|node| !node.contains('.') || is_called(node, &main.name))
    }

    /// Whether a prediction is that of an estimator, and not a vote of several.
    pub(super) fn is_estimator(&self, main: &Main) -> bool {
        let mut designs = self.diagnosis.designs.iter();
        designs.any(|of| is_of(&main.prediction, &of.node))
    }

    /// Whether all that is left of any truth is white.
    pub(super) fn all_white(&self) -> bool {
        let all = self.diagnosis.residuals.iter();
        let mut shown = all.filter(|of| self.shows(&of.prediction)).peekable();
        shown.peek().is_some() && shown.all(|of| of.white == Some(true))
    }

    /// Whether fits on fewer days than there are were too far from those on all others.
    pub(super) fn more_days_may_help(&self) -> bool {
        let all = self.diagnosis.residuals.iter();
        let shown = all.filter(|of| self.shows(&of.prediction));
        let shown: Vec<&str> = shown.map(|of| of.prediction.as_str()).collect();
        let days = self.diagnosis.days.as_ref();
        days.is_some_and(|days| days.count > 2 && days::enough(days, &shown).is_none())
    }

    fn lags(&self) -> String {
        let mut rows = Vec::new();
        let mut still = "";
        for main in self.main() {
            let Some(of) = self.lags_of(main) else {
                continue;
            };
            let mut list = |title: String, side: fn(&FeatureLags) -> &Correlogram, all: bool| {
                let features = of.features.iter();
                let known = |of: &&FeatureLags| !side(of).best.is_nan();
                let unknown = of.features.len() - features.clone().filter(known).count();
                let mut found: Vec<_> = features
                    .filter(known)
                    .filter(|of| all || side(of).is_significant())
                    .collect();
                found.sort_by(|a, b| side(b).best.abs().total_cmp(&side(a).best.abs()));
                let more = found.len().saturating_sub(FEATURES);
                let too_short = |of: &FeatureLags| side(of).bound >= 1.0;
                let more = match (found.is_empty(), !all && more > 0) {
                    (true, _) if !all && of.features.iter().any(too_short) => {
                        format!("  {title}: the recording is too short")
                    }
                    (true, _) => format!("  {title}: nothing"),
                    (_, true) => format!("  {title}, and {} more", counted(more as u64, "feature")),
                    _ => format!("  {title}"),
                };
                rows.push(vec![more]);
                rows.extend(found.iter().take(FEATURES).map(|feature| {
                    let correlogram = side(feature);
                    vec![
                        format!("    {}", feature.feature),
                        format!("{:.2}", correlogram.best),
                        rounded(correlogram.best_lag_s),
                        if correlogram.bound < 1.0 {
                            format!("±{:.2}", correlogram.bound)
                        } else {
                            "too short".to_owned()
                        },
                    ]
                }));
                if all && unknown > 0 {
                    rows.push(vec![format!("    without a correlation: {unknown}")]);
                    still = "; there is none where\nthe one or the other never changes, or both are never there at once";
                }
            };
            list(of.truth.clone(), |of| &of.truth, true);
            let left = format!("left of it by {}", of.prediction);
            list(left, |of| &of.residual, false);
        }
        if rows.is_empty() {
            return String::new();
        }
        format!(
            "largest correlation of features with the truth, with the lag by which it\n\
             follows them, and within what the largest of all would lie by chance alone in\n\
             99 % of recordings; and beyond that with what is left of it, at lags at which\n\
             they were known when it was predicted{still}\n{}",
            table(&["", "r", "lag", "99 %"], &rows)
        )
    }

    fn responses(&self) -> String {
        let all = self.diagnosis.responses.iter();
        let shown: Vec<_> = all.filter(|of| self.shows_estimator(&of.node)).collect();
        responses::text(&shown)
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
             named: others are nearly the same, its coefficient means little by itself;\n\
             - of models that filter their inputs or past, which other columns determine\n",
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
                    or_dash(defined(of.condition)),
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
            or_dash(residuals.and_then(|of| defined(of.rms)))
        });
        errors.insert(0, ("as it is".to_owned(), as_it_is.collect()));
        format!(
            "what each sensor moves the predictions by, in {unit} (standard deviation)\n{}\
             RMSE in {unit} with a sensor at rest at its mean, nothing fitted anew\n{}",
            matrix("sensor", &columns, &moves),
            matrix("at rest", &columns, &errors)
        )
    }

    /// Which sensors could not be tried.
    fn silent_nodes(&self) -> String {
        let all = self.diagnosis.silent_nodes.iter();
        let shown = all.filter(|of| {
            let node = of.estimator.as_ref();
            node.is_none_or(|node| self.shows_estimator(node))
        });
        let rows = shown.map(|of| {
            let silent = &of.silent;
            match (&of.estimator, &of.sensor) {
                (Some(node), Some(sensor)) => {
                    format!("{node}: no answer to {sensor}, since {silent} gives nothing when that steps\n")
                }
                (Some(node), None) => {
                    format!("{node}: no answers, since {silent} gives nothing while all sensors rest\n")
                }
                (None, sensor) => {
                    let sensor = sensor.as_deref().unwrap_or("a sensor");
                    format!("{sensor}: no contribution, since {silent} gives nothing when it rests\n")
                }
            }
        });
        rows.collect()
    }

    fn days(&self) -> String {
        let Some(days) = &self.diagnosis.days else {
            return String::new();
        };
        self.of_each_unit(|unit, shown| days::text(days, unit, shown))
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
        // Two truths of one axis differ in their nodes.
        let namesakes = |of: &str| {
            let all = shown
                .iter()
                .filter(|other| axis_of(&other.truth) == axis_of(of));
            all.count()
        };
        let column = |truth: &str| match namesakes(truth) {
            1 => axis_of(truth),
            _ => truth.to_owned(),
        };
        let columns: Vec<String> = shown.iter().map(|of| column(&of.truth)).collect();
        let rows = widths.iter().map(|&width| {
            let cell = |of: &&athermal::diagnosis::window::Windows| {
                let here = of.widths.iter().find(|of| of.window_s == width);
                let own = if of.window_s == width { "*" } else { "" };
                here.map_or("-".to_owned(), |of| format!("{own}{}", number(of.ratio)))
            };
            (rounded(width), shown.iter().map(cell).collect())
        });
        let rows: Vec<_> = rows.collect();
        format!(
            "signal to noise of the drift against its window, * as the graph has it; noise\n\
             is the standard error of its slopes, in which scatter and curvature both count\n{}",
            matrix("window", &columns, &rows)
        )
    }
}

/// A root mean square that is larger than the mean by this share is so by rounding.
const SAME: f64 = 1e-12;

/// Residuals of one unit and spacing.
fn residuals(shown: &[&Residuals]) -> String {
    let Some(first) = shown.first() else {
        return String::new();
    };
    let rows: Vec<Vec<String>> = shown
        .iter()
        .map(|of| {
            let lags = of.autocorrelation.len();
            let known = (0..lags).filter(|&lag| !of.autocorrelation[lag].is_nan());
            let largest = known.max_by(|&a, &b| {
                let size = |lag: usize| of.autocorrelation[lag].abs();
                size(a).total_cmp(&size(b))
            });
            let bound = largest.map_or("-".to_owned(), |lag| format!("±{:.2}", of.bound[lag]));
            let largest = largest.map_or("-".to_owned(), |lag| {
                let after = rounded((lag + 1) as f64 * of.spacing_s);
                format!("{:.2} at {after}", of.autocorrelation[lag])
            });
            let verdict = match of.white {
                Some(true) => "white",
                Some(false) => "not white",
                None if of.rms <= of.mean.abs() * (1.0 + SAME) => "constant",
                None => "too few",
            };
            vec![
                format!("  {}", of.prediction),
                or_dash(defined(of.rms)),
                or_dash(defined(of.mean)),
                count(of.spaced as u64),
                largest,
                bound,
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
         neither windows nor horizons overlap; their largest autocorrelation, and within\n\
         what 95 % lie at its lag where there is none from that lag on (Bartlett);\n\
         Q of Ljung and Box over {}: white where p is not below {UNLIKELY}\n{}",
        first.unit,
        rounded(first.spacing_s),
        counted(first.autocorrelation.len() as u64, "lag"),
        table(&header, &rows)
    )
}

fn regressors(of: &Design) -> String {
    let rows: Vec<Vec<String>> = of
        .regressors
        .iter()
        .map(|of| {
            vec![
                format!("    {}", of.name),
                or_dash(defined(of.effect)),
                or_dash(defined(of.inflation)),
            ]
        })
        .collect();
    let effect = format!("{} per σ", of.unit);
    let first = format!("  {}", of.node);
    table(&[first.as_str(), effect.as_str(), "VIF"], &rows)
}

/// None where there is no number.
fn defined(value: f64) -> Option<f64> {
    Some(value).filter(|value| !value.is_nan())
}
