//! How much a value has changed.

use athermal_core::channel::{Channel, is_unchanged};
use athermal_core::node::{
    Feature, InputPort, Inputs, KindFacts, Mistake, Operator, OutputPort, Outputs, PortSummary,
    Reach, Restored, State, Tick,
};
use athermal_core::time::Duration;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::past::{LookingBack, max_age, max_age_mistake};

/// The change of each channel over a time, or from one value to the next: `y(t) = x(t) − x(t − over)`.
///
/// With every new value at `t` it takes the last value at or before `t − over` away; without `over`, the value
/// before. That one must not have been older than `max_age` at that instant: by default as old as a held value of the
/// channel may be. Without `over`, what has a span may be older by the signal's `max_age`, since the value before of
/// a slow clock is a whole period old; a sample may not. A difference of two samples has the noise of both; a `slope`
/// over the same time has less. Over one sample it is the differencing of Box and Jenkins (1976). Differences of
/// temperatures in Cel or K are in K, of those in `[degF]` in `[degR]`.
///
/// Two differences share a sample where one ends as the other begins, so that a value summarises `over` and `max_age`: where it
/// is a truth, the embargo goes by that.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Difference {
    /// Over which time; without it, from one value to the next.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub over: Option<Duration>,
    /// How old the earlier value may have been.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_age: Option<Duration>,
}

/// Just before: at the present instant there is the new value.
const BEFORE: Duration = Duration::from_ns(1);

impl Difference {
    fn back(&self) -> Duration {
        self.over.unwrap_or(BEFORE)
    }

    /// The channels that are looked back at, each with how long its values count there.
    fn earlier(&self, channels: &[Channel]) -> Vec<Channel> {
        let mut channels = channels.to_vec();
        if self.over.is_none() {
            let spanning = |channel: &&mut Channel| channel.span > Duration::ZERO;
            for channel in channels.iter_mut().filter(spanning) {
                channel.span += channel.max_age.unwrap_or_default();
            }
        }
        channels
    }
}

impl Feature for Difference {
    fn facts() -> KindFacts {
        KindFacts::default().change()
    }

    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "what changes")] }
    }

    fn ports() -> &'static [PortSummary] {
        const {
            &[PortSummary::new(
                "difference",
                "how much each channel has changed",
            )]
        }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let from = inputs.port("signal");
        if let Some(mistake) = max_age_mistake(self.max_age, from) {
            return Err(vec![mistake]);
        }
        let earlier = self.earlier(from);
        let change = |(channel, earlier): (&Channel, &Channel)| Channel {
            unit: channel.unit.difference(),
            span: channel.span
                + self.over.unwrap_or_default()
                + max_age(self.max_age, earlier).unwrap_or_default(),
            ..channel.clone()
        };
        Ok(vec![OutputPort {
            name: "difference",
            channels: from.iter().zip(&earlier).map(change).collect(),
        }])
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::Own
    }

    fn memory(&self) -> Duration {
        self.back() + self.max_age.unwrap_or_default()
    }

    fn every_tick(&self) -> bool {
        // A run of the producer that gave nothing is no new value, and still ends the hold of the one before.
        true
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        let channels = self.earlier(inputs.port("signal"));
        Box::new(Differencing {
            past: LookingBack::new(vec![self.back()], self.max_age, &channels),
        })
    }
}

struct Differencing {
    past: LookingBack,
}

impl Operator for Differencing {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let inputs = tick.port(0).iter().zip(tick.stamps(0));
        for (i, (&value, &stamp)) in inputs.enumerate() {
            if is_unchanged(value) || !self.past.take(i, tick.now, value, stamp) {
                continue;
            }
            for (_, past, _) in self.past.before(i, tick.now) {
                // A NaN says why there is no earlier value, and must stay as it is.
                let change = if past.is_nan() { past } else { value - past };
                outputs.set_stamped(i, change, stamp);
            }
        }
    }

    fn segment(&mut self) {
        self.past.clear();
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(self.past.snapshot())
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        self.past.restore(state)
    }
}

athermal_core::register!(Difference, Feature, "difference");
