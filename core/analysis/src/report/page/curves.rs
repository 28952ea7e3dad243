//! The correlations and responses of an axis that a page shows; [`crate::diagnosis`] makes the pictures.

use super::super::{Axis, Facts};
use crate::chart::Chart;
use crate::diagnosis::{Picture, autocorrelation_picture, response_pictures, truth_picture};

/// A picture of an axis.
pub(super) struct Curves {
    /// What it shows, as part of a file's name.
    pub(super) kind: String,
    picture: Picture,
}

impl Curves {
    pub(super) fn chart(&self) -> Chart<'_> {
        Chart {
            width: 460.0,
            height: 250.0,
            limits: vec![0.0],
            ..self.picture.chart()
        }
    }
}

/// The pictures of an axis: correlation against the lag, step and impulse responses of what is put out, or, where that is a vote,
/// of the first voter that answers any sensor, and the autocorrelation of what is left.
pub(super) fn of(axis: &Axis, facts: &Facts) -> Vec<Curves> {
    let left = facts.errors.iter().find(|of| of.axis == axis.name);
    let left = left.and_then(|of| of.residuals.as_ref());
    let left = left.filter(|of| !of.bound.is_empty());
    let left = left.map(|of| ("autocorrelation".to_owned(), autocorrelation_picture(of)));
    let lags = facts.lags.iter();
    let lags = lags.filter(|of| of.truth == axis.truth_name).take(1);
    let lags = lags.map(|of| ("lags".to_owned(), truth_picture(of)));
    let of_axis = || {
        let all = facts.responses.iter();
        all.filter(|of| of.truth == axis.truth_name)
    };
    let answers = of_axis().find(|of| of.node == axis.put_out().instance);
    let answers = answers.or_else(|| of_axis().next()).into_iter();
    let responses = answers.flat_map(|of| {
        [("steps", false), ("impulses", true)].map(|(kind, impulse)| {
            let pictures = response_pictures(of, impulse).into_iter();
            pictures.map(move |(ending, picture)| (format!("{kind}{ending}"), picture))
        })
    });
    lags.chain(responses.flatten())
        .chain(left)
        .map(|(kind, picture)| Curves { kind, picture })
        .collect()
}
