//! What drift costs in light: the loss of a coupling that was best at the start of a window.

use athermal_core::channel::{ABSENT, Channel};
use athermal_core::node::{
    Duty, Feature, InputPort, Inputs, KindFacts, Mistake, Operator, OutputPort, Outputs,
    PortSummary, Reach, Tick,
};
use athermal_core::quantity::Quantity;
use athermal_core::time::Duration;
use athermal_core::unit::Unit;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::limit;

/// The optical loss that a drift brings about within a window, in dB.
///
/// Gaussian beams of 1/e² radius `σ` that are `d` apart couple `exp(−2 d²/σ²)` of the light, so that over a window
/// `Δt` drifts `v_n` cost `(20/ln 10) Σ_n (v_n Δt)²/σ_n²` decibels; `20/ln 10 = 8.68589`. (Mandelli, Dankwart and
/// Napoli, section 5.3, print `log10(e) Σ −2/σ²`, ten times less and of the other sign. Their coefficients 2.09059,
/// 59.4658 and 133.798 min²/µm² mean radii of 10.19, 1.911 and 1.274 µm.) Without the drift of every axis there is no
/// loss. The port `share` says what each axis adds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OpticalLoss {
    /// The length of the window, such as `"5min"`.
    #[serde(default = "five_minutes")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub over: Duration,
    /// The 1/e² radius of the beam along each axis in the order of the drifts, such as `["10.19 um", "1.911 um", "1.274 um"]`;
    /// one radius stands for all.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub radii: Option<Vec<Quantity>>,
    /// Published radii by the first letter of the axis.
    #[serde(default)]
    pub preset: Option<Preset>,
}

/// Radii from a publication.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// Fibre to edge coupler of Mandelli, Dankwart and Napoli: the printed coefficients for X, Y and Z.
    Mandelli,
}

/// `20/ln 10`: the decibels of `exp(−2)`, negated.
pub const DECIBELS: f64 = 20.0 / std::f64::consts::LN_10;

/// The printed loss coefficients in dB min²/µm² for a window of five minutes, by axis.
const MANDELLI: [(char, f64); 3] = [('X', 2.09059), ('Y', 59.4658), ('Z', 133.798)];

fn five_minutes() -> Duration {
    Duration::from_ns(300_000_000_000)
}

/// The loss in dB per square of a drift in µm/min, over a window in minutes, for a radius in µm.
#[must_use]
pub fn coefficient(window_min: f64, radius_um: f64) -> f64 {
    DECIBELS * (window_min / radius_um).powi(2)
}

impl Preset {
    /// The radius in µm along an axis, by the first letter of its name.
    #[must_use]
    pub fn radius_um(self, axis: &str) -> Option<f64> {
        let letter = axis.chars().next()?.to_ascii_uppercase();
        let (_, printed) = MANDELLI.iter().find(|(name, _)| *name == letter)?;
        // The radius whose coefficient over five minutes is the printed one.
        Some(5.0 * (DECIBELS / printed).sqrt())
    }
}

impl OpticalLoss {
    /// The loss per square of each drift in its own unit.
    fn coefficients(&self, drift: &[Channel]) -> Result<Vec<f64>, Vec<Mistake>> {
        let (Ok(um), Ok(um_per_min)) = (Unit::parse("um"), Unit::parse("um/min")) else {
            return Ok(Vec::new());
        };
        let mut mistakes = Vec::new();
        let count = self.radii.as_ref().map_or(0, Vec::len);
        match (&self.radii, self.preset) {
            (Some(_), Some(_)) => {
                let message = "`radii` and `preset` both say how wide the beam is";
                let mistake = Mistake::at("preset", message).help("leave one of them out");
                mistakes.push(mistake);
            }
            (None, None) => {
                let message = "nothing says how wide the beam is";
                let help = "give `radii = [\"2 um\"]`, or `preset = \"mandelli\"`";
                mistakes.push(Mistake::at("radii", message).help(help));
            }
            (Some(_), None) if count != 1 && count != drift.len() => {
                let message = format!("there are {count} `radii` for {} axes", drift.len());
                mistakes
                    .push(Mistake::at("radii", message).help("give one per axis, or one for all"));
            }
            _ => {}
        }
        let mut coefficients = Vec::with_capacity(drift.len());
        for (nth, channel) in drift.iter().enumerate() {
            let factor = channel.unit.factor_to(&um_per_min);
            if factor.is_none() {
                let message = format!(
                    "`{}` is in {}, which is no drift",
                    channel.name, channel.unit
                );
                mistakes.push(
                    Mistake::at("inputs.drift", message).help("a length per time, such as nm/min"),
                );
            }
            if channel.span != drift[0].span || channel.ahead != drift[0].ahead {
                let message = format!(
                    "`{}` and `{}` are drifts over different times",
                    drift[0].name, channel.name
                );
                mistakes.push(Mistake::at("inputs.drift", message));
            }
            let radius = match (&self.radii, self.preset) {
                (Some(radii), _) => {
                    let radius = radii.get(nth).or(radii.first());
                    radius.map(|radius| limit::size(radius, &um, "radii"))
                }
                (None, Some(preset)) if factor.is_some() => {
                    Some(preset.radius_um(&channel.name).ok_or_else(|| {
                        let message = format!(
                            "the preset has no radius for an axis named `{}`",
                            channel.name
                        );
                        Mistake::at("preset", message)
                            .help("it knows names that begin with X, Y or Z; give `radii`")
                    }))
                }
                (None, _) => None,
            };
            match radius {
                Some(Ok(radius)) => {
                    coefficients.extend(factor.map(|factor| {
                        coefficient(self.over.secs() / 60.0, radius) * factor * factor
                    }))
                }
                Some(Err(mistake)) => mistakes.push(mistake),
                None => {}
            }
        }
        if mistakes.is_empty() {
            Ok(coefficients)
        } else {
            Err(mistakes)
        }
    }
}

impl Feature for OpticalLoss {
    fn facts() -> KindFacts {
        KindFacts::of(Duty::Loss { over: "over" }).change()
    }

    fn inputs() -> &'static [InputPort] {
        const {
            &[InputPort::held(
                "drift",
                "the drifts of all axes of the coupling",
            )]
        }
    }

    fn ports() -> &'static [PortSummary] {
        const {
            &[
                PortSummary::new("loss", "the loss of all axes together, in dB"),
                PortSummary::new("share", "what each axis adds, in dB"),
            ]
        }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let drift = inputs.port("drift");
        self.coefficients(drift)?;
        let decibel = Unit::parse("dB").unwrap_or_else(|_| Unit::one());
        let share: Vec<Channel> = drift
            .iter()
            .map(|channel| Channel {
                unit: decibel.clone(),
                ..channel.clone()
            })
            .collect();
        let total = share.first().map(|first| Channel {
            name: inputs.member.clone().unwrap_or_else(|| "loss".to_owned()),
            ..first.clone()
        });
        Ok(vec![
            OutputPort {
                name: "loss",
                channels: total.into_iter().collect(),
            },
            OutputPort {
                name: "share",
                channels: share,
            },
        ])
    }

    fn reach(&self, port: &str) -> Reach {
        match port {
            "share" => Reach::Own,
            _ => Reach::All,
        }
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        Box::new(Losing {
            coefficients: self.coefficients(inputs.port("drift")).unwrap_or_default(),
        })
    }
}

struct Losing {
    coefficients: Vec<f64>,
}

impl Operator for Losing {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let mut total = 0.0;
        for (i, (&drift, coefficient)) in tick.port(0).iter().zip(&self.coefficients).enumerate() {
            let share = coefficient * drift * drift;
            total += share;
            outputs.set(1 + i, if share.is_nan() { ABSENT } else { share });
        }
        outputs.set(0, if total.is_nan() { ABSENT } else { total });
    }

    fn segment(&mut self) {}
}

athermal_core::register!(OpticalLoss, Feature, "optical_loss");

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_coefficients_follow_from_the_radii_of_the_oracle() {
        // oracles/paper_constants: sigma_um_from_printed_a; the article prints 2.09059, 59.4658, 133.798.
        for (radius, printed) in [
            (10.191608291895998, 2.09059),
            (1.9109244838146635, 59.4658),
            (1.273949893912425, 133.798),
        ] {
            assert!((coefficient(5.0, radius) / printed - 1.0).abs() < 1e-9);
        }
        for (axis, radius) in [
            ("X1", 10.191608291895998),
            ("y", 1.9109244838146635),
            ("Z2", 1.273949893912425),
        ] {
            let preset = Preset::Mandelli.radius_um(axis).unwrap();
            assert!((preset / radius - 1.0).abs() < 1e-12, "{axis}: {preset}");
        }
        assert!((DECIBELS - 8.685889638065037).abs() < 1e-12);
    }

    #[test]
    fn equal_drift_on_six_axes_of_22_6_nm_per_min_costs_a_fifth_of_a_decibel() {
        // oracles/paper_constants: equal_drift_limit_um_per_min_for_0p2dB_6axes.
        let drift_um = 0.022624990860230246_f64;
        let loss: f64 = ["X1", "Y1", "Z1", "X2", "Y2", "Z2"]
            .iter()
            .map(|axis| {
                coefficient(5.0, Preset::Mandelli.radius_um(axis).unwrap()) * drift_um.powi(2)
            })
            .sum();
        assert!((loss - 0.2).abs() < 1e-9, "{loss}");
    }
}
