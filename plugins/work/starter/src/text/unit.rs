//! Decides in which unit a drift is given.

use athermal_core::unit::Unit;

use super::Writer;
use crate::column::Kind;

impl Writer<'_> {
    /// The unit of the drift: of the signal by a prefix and a time in which it is neither tiny nor huge.
    pub(super) fn drift_unit(&self) -> String {
        let Some(unit) = self
            .drifting
            .first()
            .and_then(|group| Unit::parse(&group.unit).ok())
        else {
            return "1/min".to_owned();
        };
        let spread = self.largest(&self.choice.spread);
        let difference = unit.difference();
        let smaller = match difference.text() {
            "m" | "mm" | "um" | "[in_i]" | "[mil_i]" | "10*-6.[in_i]" => {
                &["nm", "um", "mm", "m"][..]
            }
            "K" => &["mK", "K"],
            "V" => &["mV", "V"],
            _ => &[],
        };
        let own = [difference.text()];
        let candidates = if smaller.is_empty() {
            &own[..]
        } else {
            smaller
        };
        let period = if self.choice.drift_s >= 3600.0 && !self.clock.counts_samples() {
            "h"
        } else {
            "min"
        };
        let per_s = Unit::second();
        let fits = |name: &&&str| {
            let to = Unit::parse(&format!("{name}/{period}")).ok()?;
            let factor = difference.per(&per_s).factor_to(&to)?;
            Some((1.0..1000.0).contains(&(spread * factor)))
        };
        let chosen = candidates.iter().find(|name| fits(name) == Some(true));
        format!("{}/{period}", chosen.copied().unwrap_or(difference.text()))
    }

    /// The largest of what was measured of each drifting column, in the unit of the first drifting signal.
    fn largest(&self, measured: &[f64]) -> f64 {
        let unit = |name: &str| Unit::parse(name).ok().map(|unit| unit.difference());
        let first = self.drifting.first().and_then(|group| unit(&group.unit));
        let columns = self.columns.iter();
        let drifting = columns.filter(|column| column.kind == Kind::Drifting);
        let in_first = drifting.zip(measured).filter_map(|(column, value)| {
            let factor = match (unit(&column.unit), &first) {
                (Some(own), Some(first)) => own.factor_to(first)?,
                _ => 1.0,
            };
            Some(factor * value)
        });
        in_first.fold(0.0, f64::max)
    }
}
