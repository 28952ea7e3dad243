//! Decides which figures of the article stand beside ours, and for which machines.

use serde::Serialize;

use super::course::{Axis, Course, Voter};
use super::rms;

/// A table of the article beside the same figures here.
#[derive(Debug, Clone, Serialize)]
pub struct Published {
    /// Where it stands.
    pub source: &'static str,
    /// Only instants with an absolute drift below count here, in nm/min.
    pub limit_nm_per_min: f64,
    /// The axes, in the order of the figures.
    pub axes: Vec<&'static str>,
    /// Its rows.
    pub rows: Vec<PublishedRow>,
}

/// One row: root mean square errors in nm/min.
#[derive(Debug, Clone, Serialize)]
pub struct PublishedRow {
    /// What predicts, as the article names it.
    pub name: &'static str,
    /// The node that is the same here.
    pub node: Option<String>,
    /// The figures of the article, by axis.
    pub published: Vec<f64>,
    /// Ours, by axis.
    pub ours: Vec<Option<f64>>,
}

/// Whose figures they are, as one cites it.
pub(super) const ARTICLE: &str = "Mandelli, Dankwart and Napoli, \"Ensemble modeling of nanoscale thermal drift in high-precision linear axes for photonic \
     integrated circuit testing\"";

struct Table {
    source: &'static str,
    limit: f64,
    axes: &'static [&'static str],
    rows: &'static [(&'static str, &'static str, &'static [f64])],
}

/// Mandelli, Dankwart and Napoli; the kind of node beside the article's name of it.
const TABLES: [Table; 3] = [
    Table {
        source: "Table 2, single axis system, drift below 100 nm/min",
        limit: 100.0,
        axes: &["X", "Y", "Z"],
        rows: &[
            ("no model", "", &[11.18, 22.99, 20.87]),
            ("thermal regression", "linear", &[8.13, 11.64, 17.89]),
            ("AR", "ar", &[6.81, 9.41, 13.72]),
            ("ARX", "arx", &[6.55, 8.81, 13.67]),
            (
                "auto-weighted voting",
                "auto_weighted",
                &[6.31, 8.69, 13.17],
            ),
        ],
    },
    Table {
        source: "Table 3, die tester, drift below 250 nm/min",
        limit: 250.0,
        axes: &["X1", "Y1", "Z1", "X2", "Y2", "Z2"],
        rows: &[
            ("no model", "", &[11.54, 12.29, 53.34, 14.38, 13.53, 47.55]),
            (
                "thermal regression",
                "linear",
                &[10.75, 12.26, 20.07, 14.54, 13.30, 22.22],
            ),
            ("AR", "ar", &[9.83, 14.08, 15.12, 14.48, 15.21, 15.59]),
            ("ARX", "arx", &[9.03, 12.87, 13.33, 13.94, 15.16, 13.72]),
            (
                "auto-weighted voting",
                "auto_weighted",
                &[8.45, 12.39, 10.25, 12.74, 13.15, 12.96],
            ),
        ],
    },
    Table {
        source: "Table 4, die tester, drift below 850 nm/min",
        limit: 850.0,
        axes: &["X1", "Y1", "Z1", "X2", "Y2", "Z2"],
        rows: &[
            (
                "no model",
                "",
                &[58.99, 50.19, 153.42, 20.91, 56.30, 140.96],
            ),
            (
                "auto-weighted voting",
                "auto_weighted",
                &[48.65, 46.75, 20.67, 22.84, 52.49, 27.52],
            ),
        ],
    },
];

/// The tables about machines with the axes of this one, drifts in the same unit, and two or more of the kinds of nodes that they
/// compare, or the one.
pub(super) fn published(course: &Course) -> Vec<Published> {
    let of_same_kind = |table: &&Table| {
        let found = course.axes.iter().map(|axis| axis.name.as_str());
        let has = |kind: &str| course.axes.iter().any(|axis| voter(axis, kind).is_some());
        let kinds = || table.rows.iter().filter(|(_, kind, _)| !kind.is_empty());
        let compared = kinds().filter(|(_, kind, _)| has(kind));
        found.eq(table.axes.iter().copied())
            && course.axes.iter().all(|axis| axis.unit == "nm/min")
            && compared.count() >= kinds().count().min(2)
    };
    TABLES
        .iter()
        .filter(of_same_kind)
        .map(|table| beside(table, course))
        .collect()
}

/// The first prediction of an axis by a node of a kind: axes need not have the same predictions.
fn voter<'a>(axis: &'a Axis, kind: &str) -> Option<&'a Voter> {
    axis.voters.iter().find(|voter| voter.kind == kind)
}

fn beside(table: &Table, course: &Course) -> Published {
    let row = |&(name, kind, figures): &(&'static str, &str, &[f64])| PublishedRow {
        name,
        node: nodes(course, kind),
        published: figures.to_vec(),
        ours: course
            .axes
            .iter()
            .map(|axis| error(axis, kind, table))
            .collect(),
    };
    Published {
        source: table.source,
        limit_nm_per_min: table.limit,
        axes: table.axes.to_vec(),
        rows: table.rows.iter().map(row).collect(),
    }
}

/// The nodes of a kind that predict the axes, each once: mostly one for all.
fn nodes(course: &Course, kind: &str) -> Option<String> {
    let mut nodes: Vec<&str> = Vec::new();
    for voter in course.axes.iter().filter_map(|axis| voter(axis, kind)) {
        if !nodes.contains(&voter.node.as_str()) {
            nodes.push(&voter.node);
        }
    }
    (!nodes.is_empty()).then(|| nodes.join(", "))
}

/// The error of an axis' prediction by a kind, or of predicting nothing, where the truth is below the limit and all of the axis that
/// are compared are there.
fn error(axis: &Axis, kind: &str, table: &Table) -> Option<f64> {
    let of_kinds = table
        .rows
        .iter()
        .filter_map(|(_, kind, _)| voter(axis, kind));
    let compared: Vec<&Voter> = of_kinds.collect();
    let of_kind = match kind {
        "" => None,
        kind => Some(voter(axis, kind)?),
    };
    let there = |i: &usize| {
        let all = compared.iter().all(|voter| !voter.value[*i].is_nan());
        all && axis.truth.value[*i].abs() < table.limit
    };
    let counted = (0..axis.truth.value.len()).filter(there);
    rms(counted.map(|i| of_kind.map_or(0.0, |voter| voter.value[i]) - axis.truth.value[i]))
}

#[cfg(test)]
mod tests {
    use super::super::Series;
    use super::*;

    fn axis(name: &str, truth: &[f64], voters: &[(&'static str, &[f64])]) -> Axis {
        let voter = |(kind, value): &(&'static str, &[f64])| Voter {
            node: (*kind).to_owned(),
            instance: format!("{kind}.{name}"),
            prediction: format!("{kind}.{name}"),
            slot: 0,
            called: (*kind).to_owned(),
            kind,
            value: value.to_vec(),
        };
        Axis {
            name: name.to_owned(),
            truth_name: format!("drift.{name}"),
            slot: 0,
            error_unit: "nm/min".into(),
            unit: "nm/min".to_owned(),
            truth: Series {
                time_s: (0..truth.len()).map(|i| i as f64).collect(),
                value: truth.to_vec(),
            },
            voters: voters.iter().map(voter).collect(),
            main: 0,
            ahead_s: 300.0,
            weights: Vec::new(),
            states: None,
        }
    }

    #[test]
    fn a_machine_with_other_axes_or_models_has_no_published_figures() {
        let course = |names: &[&str], kinds: &[&'static str]| {
            let voters: Vec<_> = kinds.iter().map(|kind| (*kind, &[][..])).collect();
            Course {
                axes: names.iter().map(|name| axis(name, &[], &voters)).collect(),
                ..Course::default()
            }
        };
        let both = ["linear", "arx"];
        assert!(published(&course(&["Z"], &both)).is_empty());
        assert!(published(&course(&["X", "Z", "Y"], &both)).is_empty());
        assert!(published(&course(&["X", "Y", "Z"], &["arx", "median"])).is_empty());
        assert_eq!(published(&course(&["X", "Y", "Z"], &both)).len(), 1);
        let tester = ["X1", "Y1", "Z1", "X2", "Y2", "Z2"];
        assert_eq!(published(&course(&tester, &["auto_weighted"])).len(), 1);
    }

    #[test]
    fn our_figures_are_those_below_the_limit_at_which_all_are_there() {
        let nan = f64::NAN;
        let truth = [3.0, 4.0, 100.0, 50.0];
        let of = |name| {
            axis(
                name,
                &truth,
                &[
                    ("linear", &[2.0, 2.0, 0.0, 0.0]),
                    ("arx", &[3.0, 5.0, 0.0, nan]),
                ],
            )
        };
        let course = Course {
            axes: ["X", "Y", "Z"].map(of).into(),
            ..Course::default()
        };
        let table = &published(&course)[0];
        let ours: Vec<_> = table
            .rows
            .iter()
            .map(|row| (row.name, row.ours[0]))
            .collect();
        // The third truth is not below 100, the fourth has no ARX.
        let expected = [
            ("no model", Some((25.0_f64 / 2.0).sqrt())),
            ("thermal regression", Some((5.0_f64 / 2.0).sqrt())),
            ("AR", None),
            ("ARX", Some((1.0_f64 / 2.0).sqrt())),
            ("auto-weighted voting", None),
        ];
        assert_eq!(ours, expected);
        assert_eq!(table.rows[3].published, [6.55, 8.81, 13.67]);
    }

    #[test]
    fn each_axis_is_read_by_its_own_predictions() {
        let course = Course {
            axes: vec![
                axis(
                    "X",
                    &[4.0],
                    &[("zero", &[0.0]), ("linear", &[3.0]), ("arx", &[2.0])],
                ),
                axis("Y", &[4.0], &[("arx", &[1.0])]),
                axis("Z", &[4.0], &[("linear", &[4.5]), ("zero", &[0.0])]),
            ],
            ..Course::default()
        };
        let table = &published(&course)[0];
        let of = |name: &str| {
            let row = table.rows.iter().find(|row| row.name == name).unwrap();
            (row.node.as_deref(), row.ours.clone())
        };
        let regression = vec![Some(1.0), None, Some(0.5)];
        assert_eq!(of("thermal regression"), (Some("linear"), regression));
        assert_eq!(of("ARX"), (Some("arx"), vec![Some(2.0), Some(3.0), None]));
        assert_eq!(of("no model"), (None, vec![Some(4.0); 3]));
    }
}
