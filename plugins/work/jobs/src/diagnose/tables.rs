//! A diagnosis as tables for a terminal, 80 columns wide.

use athermal_analysis::diagnosis::lag::{Correlogram, FeatureLags, Lags};
use athermal_analysis::diagnosis::regressor::Design;
use athermal_analysis::diagnosis::residual::{Residuals, UNLIKELY};
use athermal_analysis::diagnosis::sensor::Contribution;
use athermal_analysis::diagnosis::text::{self, axis_of, grouped, is_of};
use athermal_analysis::diagnosis::window::Windows;
use athermal_analysis::diagnosis::{Diagnosis, Main, is_called};

use athermal_analysis::figures::{count, counted, matrix, number, or_dash, rounded, table};

/// Features that are named of each truth.
const FEATURES: usize = 3;
/// A variance inflation beyond which a coefficient means little by itself (Marquardt 1970).
const INFLATED: f64 = 10.0;

/// The tables of a diagnosis, of the predictions asked for.
pub struct Tables<'a> {
    /// With what was not asked for.
    all: &'a Diagnosis,
    shown: Diagnosis,
    /// Whether all predictions are shown that are left, and not only the first of each truth.
    is_asked: bool,
}

impl<'a> Tables<'a> {
    /// Those of what was asked for by name; without a name of the first prediction of each truth.
    #[must_use]
    pub fn new(all: &'a Diagnosis, asked: &[String]) -> Self {
        let mut shown = all.clone();
        shown.keep_only(asked);
        Self {
            all,
            shown,
            is_asked: !asked.is_empty(),
        }
    }

    /// What was asked for, for programs.
    pub fn shown(&self) -> &Diagnosis {
        &self.shown
    }

    /// Everything, section by section.
    pub fn text(&self) -> String {
        let answers: Vec<_> = self.shown.responses.iter().collect();
        let days = |days| self.of_each_unit(|unit, shown| text::days(days, unit, shown));
        let sections = [
            self.residuals(),
            self.lags(),
            text::responses(&answers),
            self.designs(),
            self.of_each_unit(|unit, shown| self.contributions(unit, shown)),
            self.silent_nodes(),
            self.shown.days.as_ref().map_or_else(String::new, days),
            self.windows(),
        ];
        let sections: Vec<String> = sections.into_iter().filter(|of| !of.is_empty()).collect();
        sections.join("\n")
    }

    /// What predictions left.
    fn left(&self) -> impl Iterator<Item = &Residuals> {
        let is_main = |of: &Residuals| {
            self.shown
                .main
                .iter()
                .any(|main| main.prediction == of.prediction)
        };
        let all = self.shown.residuals.iter();
        all.filter(move |of| self.is_asked || is_main(of))
    }

    /// The truths of which something is shown.
    pub fn main(&self) -> impl Iterator<Item = &Main> {
        self.shown.main.iter()
    }

    /// A text for the predictions of each unit, which stands in the heading.
    fn of_each_unit(&self, text: impl Fn(&str, &[&str]) -> String) -> String {
        let of_group = |group: &Vec<&Residuals>| {
            let names: Vec<&str> = group.iter().map(|of| of.prediction.as_str()).collect();
            text(&group[0].unit, &names)
        };
        let groups = grouped(self.left(), |of| of.unit.clone());
        let mut texts: Vec<String> = groups.iter().map(of_group).collect();
        texts.retain(|text| !text.is_empty());
        texts.join("\n")
    }

    fn residuals(&self) -> String {
        let groups = grouped(self.left(), |of| (of.unit.clone(), of.spacing_s));
        let tables: Vec<String> = groups.iter().map(|of| residuals(of)).collect();
        tables.join("\n")
    }

    /// The correlations of a truth with features; none where it has no features.
    pub fn lags_of(&self, main: &Main) -> Option<&Lags> {
        let mut all = self.shown.lags.iter();
        all.find(|of| of.truth == main.truth)
    }

    /// The estimators of a truth among whose regressors a feature is.
    pub fn users_of(&self, main: &Main, feature: &str) -> impl Iterator<Item = &'a str> {
        let uses = move |of: &&Design| of.regressors.iter().any(|of| of.name == feature);
        let users = self.all.designs.iter().filter(uses);
        let users = users.map(|of| of.node.as_str());
        users.filter(|node| !node.contains('.') || is_called(node, &main.name))
    }

    /// Whether a prediction is that of an estimator, and not a vote of several.
    pub fn is_estimator(&self, main: &Main) -> bool {
        let mut designs = self.all.designs.iter();
        designs.any(|of| is_of(&main.prediction, &of.node))
    }

    /// Whether all that is left of any truth is white.
    pub fn all_white(&self) -> bool {
        let mut left = self.left().peekable();
        left.peek().is_some() && left.all(|of| of.white == Some(true))
    }

    /// Whether fits on fewer days than there are were too far from those on all others.
    pub fn more_days_may_help(&self) -> bool {
        let shown: Vec<&str> = self.left().map(|of| of.prediction.as_str()).collect();
        let days = self.shown.days.as_ref();
        days.is_some_and(|days| days.count > 2 && text::enough(days, &shown).is_none())
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

    fn designs(&self) -> String {
        let shown = &self.shown.designs;
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
        if self.is_asked {
            shown.iter().for_each(|of| text.push_str(&regressors(of)));
        }
        text
    }

    fn contributions(&self, unit: &str, shown: &[&str]) -> String {
        let all = || self.shown.contributions.iter();
        let of = |sensor: &str, prediction: &str| {
            all().find(|of| of.sensor == sensor && of.prediction == prediction)
        };
        let of_shown = all().filter(|of| shown.contains(&of.prediction.as_str()));
        let sensors = grouped(of_shown, |of| of.sensor.as_str());
        let sensors: Vec<&str> = sensors.iter().map(|of| of[0].sensor.as_str()).collect();
        if sensors.is_empty() {
            return String::new();
        }
        let columns: Vec<String> = shown.iter().map(|name| (*name).to_owned()).collect();
        let rows = |value: fn(&Contribution) -> f64| -> Vec<(String, Vec<String>)> {
            let cell = |sensor: &str, name: &str| or_dash(of(sensor, name).map(value));
            let row = |sensor: &&str| {
                let cells = shown.iter().map(|name| cell(sensor, name));
                ((*sensor).to_owned(), cells.collect())
            };
            sensors.iter().map(row).collect()
        };
        let (moves, mut errors) = (rows(|of| of.moves), rows(|of| of.rmse_at_rest));
        let as_it_is = shown.iter().map(|name| {
            let mut residuals = self.shown.residuals.iter();
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
        let rows = self.shown.silent_nodes.iter().map(|of| {
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

    fn windows(&self) -> String {
        let windows = |main: &Main| {
            let mut windows = self.shown.windows.iter();
            windows.find(|of| of.truth == main.truth)
        };
        let shown: Vec<&Windows> = self.main().filter_map(windows).collect();
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
            let cell = |of: &&Windows| {
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
