//! How stable a machine is, from the size of its drift.

use athermal_core::channel::{ABSENT, Channel, is_unchanged};
use athermal_core::node::{
    Duty, Feature, InputPort, Inputs, KindFacts, Mistake, Operator, OutputPort, Outputs,
    PortSummary, Reach, Restored, State, Tick,
};
use athermal_core::quantity::Quantity;
use athermal_core::time::{Duration, Instant};
use athermal_core::unit::Unit;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::limit;

/// The stability of each axis: 0 stable, 1 quasi-stable, 2 transient.
///
/// Of a drift `v` it is 0 where `|v| < stable_below`, 2 where `|v| ≥ transient_above`, else 1 (30 and 80 nm/min in
/// Mandelli, Dankwart and Napoli, section 3.4). To come back to a calmer state the drift must fall `hysteresis` below
/// the limit, and any change of state must have lasted for `dwell`. The port `worst` gives the least stable of all
/// axes. Without a drift there is no state. Runs at every tick.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stability {
    /// Below this absolute drift an axis is stable: `"30 nm/min"`.
    #[schemars(extend("minimum" = 0))]
    pub stable_below: Quantity,
    /// From this absolute drift on an axis is transient: `"80 nm/min"`.
    #[schemars(extend("minimum" = 0))]
    pub transient_above: Quantity,
    /// How far below a limit the drift must fall for the calmer state, such as `"5 nm/min"`; none by default.
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub hysteresis: Option<Quantity>,
    /// How long another state must have lasted before it is given; no time by default.
    #[serde(default)]
    pub dwell: Duration,
}

/// A state of stability and its number.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum StabilityState {
    /// 0.
    Stable,
    /// 1.
    QuasiStable,
    /// 2.
    Transient,
}

impl StabilityState {
    /// The number of the state in a channel.
    #[must_use]
    pub fn number(self) -> f64 {
        match self {
            Self::Stable => 0.0,
            Self::QuasiStable => 1.0,
            Self::Transient => 2.0,
        }
    }
}

impl Stability {
    fn limits(&self, unit: &Unit) -> Result<Limits, Vec<Mistake>> {
        let mut mistakes = Vec::new();
        let mut read = |limit, at| limit::size_or_none(limit, unit, at, &mut mistakes);
        let stable = read(Some(&self.stable_below), "stable_below");
        let transient = read(Some(&self.transient_above), "transient_above");
        let hysteresis = read(self.hysteresis.as_ref(), "hysteresis");
        if let (Some(stable), Some(transient)) = (stable, transient)
            && stable > transient
        {
            let message = format!(
                "`transient_above` ({}) lies below `stable_below` ({})",
                self.transient_above, self.stable_below
            );
            mistakes.push(Mistake::at("transient_above", message));
        }
        let hysteresis = hysteresis.unwrap_or(0.0);
        if let Some(stable) = stable
            && hysteresis >= stable
            && hysteresis > 0.0
        {
            let message = "with such a `hysteresis` an axis can never become stable again";
            mistakes
                .push(Mistake::at("hysteresis", message).help("it must be below `stable_below`"));
        }
        match (stable, transient) {
            (Some(stable), Some(transient)) if mistakes.is_empty() => Ok(Limits {
                stable,
                transient,
                hysteresis,
            }),
            _ => Err(mistakes),
        }
    }
}

impl Feature for Stability {
    fn facts() -> KindFacts {
        KindFacts::of(Duty::Grade {
            stable: "stable_below",
            transient: "transient_above",
        })
        .change()
    }

    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("drift", "the drift of the axes")] }
    }

    fn ports() -> &'static [PortSummary] {
        const {
            &[
                PortSummary::new(
                    "state",
                    "0 stable, 1 quasi-stable, 2 transient, of each axis",
                ),
                PortSummary::new("worst", "that of the least stable axis"),
            ]
        }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let drift = inputs.port("drift");
        for channel in drift {
            self.limits(&channel.unit)?;
        }
        let channels: Vec<Channel> = drift.iter().map(limit::numbered).collect();
        let worst = channels.first().map(|first| Channel {
            name: "worst".to_owned(),
            ..first.clone()
        });
        Ok(vec![
            OutputPort {
                name: "state",
                channels,
            },
            OutputPort {
                name: "worst",
                channels: worst.into_iter().collect(),
            },
        ])
    }

    fn reach(&self, port: &str) -> Reach {
        match port {
            "state" => Reach::Own,
            _ => Reach::All,
        }
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        let never = Limits {
            stable: ABSENT,
            transient: ABSENT,
            hysteresis: ABSENT,
        };
        let drift = inputs.port("drift");
        Box::new(Judging {
            dwell: self.dwell,
            limits: drift
                .iter()
                .map(|channel| self.limits(&channel.unit).unwrap_or(never))
                .collect(),
            axes: vec![Axis::default(); drift.len()],
        })
    }

    fn every_tick(&self) -> bool {
        true
    }

    fn memory(&self) -> Duration {
        self.dwell
    }
}

#[derive(Debug, Clone, Copy)]
struct Limits {
    stable: f64,
    transient: f64,
    hysteresis: f64,
}

impl Limits {
    /// The state of a drift after a state: up at the limit, down only below it by the hysteresis.
    fn state(&self, drift: f64, before: Option<u8>) -> u8 {
        let margin = |calmer: u8| match before {
            Some(before) if before > calmer => self.hysteresis,
            _ => 0.0,
        };
        if drift < self.stable - margin(0) {
            0
        } else if drift < self.transient - margin(1) {
            1
        } else {
            2
        }
    }
}

struct Judging {
    limits: Vec<Limits>,
    dwell: Duration,
    axes: Vec<Axis>,
}

/// What is known of one axis.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
struct Axis {
    state: Option<u8>,
    /// Another state, and since when it lasts.
    other: Option<(u8, Instant)>,
}

impl Axis {
    fn judge(&mut self, limits: &Limits, drift: f64, now: Instant, dwell: Duration) {
        let found = limits.state(drift.abs(), self.state);
        let Some(state) = self.state else {
            self.state = Some(found);
            return;
        };
        if found == state {
            self.other = None;
            return;
        }
        let since = match self.other {
            Some((other, since)) if other == found => since,
            _ => now,
        };
        if now - since >= dwell {
            (self.state, self.other) = (Some(found), None);
        } else {
            self.other = Some((found, since));
        }
    }
}

impl Operator for Judging {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let mut ran = false;
        for (i, &drift) in tick.port(0).iter().enumerate() {
            if is_unchanged(drift) {
                continue;
            }
            ran = true;
            if drift.is_nan() {
                self.axes[i] = Axis::default();
            } else {
                self.axes[i].judge(&self.limits[i], drift, tick.now, self.dwell);
            }
            let state = self.axes[i].state.map_or(ABSENT, f64::from);
            outputs.set_stamped(i, state, tick.now);
        }
        if ran {
            let states = self.axes.iter().map(|axis| axis.state);
            let worst = states.reduce(|worst, state| Some(worst?.max(state?)));
            let worst = worst.flatten().map_or(ABSENT, f64::from);
            outputs.set_stamped(self.axes.len(), worst, tick.now);
        }
    }

    fn segment(&mut self) {
        self.axes.fill(Axis::default());
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(Judged {
            axes: self.axes.clone(),
        }))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        state.accept(|state: Judged| {
            let fits = state.axes.len() == self.axes.len();
            fits.then(|| self.axes = state.axes)
                .ok_or("the number of axes differs")
        })
    }
}

/// The state of all axes.
#[derive(Debug, Serialize, Deserialize)]
struct Judged {
    axes: Vec<Axis>,
}

athermal_core::state!(Judged, "stability/1");

athermal_core::register!(Stability, Feature, "stability");
