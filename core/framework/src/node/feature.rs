//! Decides what the author of a feature implements: from inputs at a tick to outputs.

use std::fmt::Debug;
use std::ops::Range;

use super::{
    Encoder, InputPort, Inputs, Kept, KindFacts, Mistake, OutputPort, PortSummary, Reach, Restored,
    State,
};
use crate::channel::unless_infinite;
use crate::time::{Duration, Instant};

/// A node that computes channels from channels: slopes, filters, delays.
///
/// The framework looks after absence, rates, ages and the order of nodes: [`Operator::step`] runs at a tick when at least
/// one input is fresh, and sees NaN where an input has no value.
///
/// A whole node, which gives the difference of each channel to its previous value:
///
/// ```
/// use athermal_core::node::prelude::*;
///
/// /// The difference of each channel to its value before.
/// #[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
/// #[serde(deny_unknown_fields)]
/// pub struct Difference {}
///
/// impl Feature for Difference {
///     fn inputs() -> &'static [InputPort] {
///         const { &[InputPort::fresh("signal", "what is differenced")] }
///     }
///
///     fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
///         let mut channels = inputs.port("signal").to_vec();
///         for channel in &mut channels {
///             channel.unit = channel.unit.difference();
///         }
///         Ok(vec![OutputPort { name: "difference", channels }])
///     }
///
///     fn reach(&self, _port: &str) -> Reach {
///         Reach::Own
///     }
///
///     fn is_endless(&self) -> bool {
///         true // the value before may be of any time
///     }
///
///     fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
///         Box::new(Differencing { last: vec![f64::NAN; inputs.port("signal").len()] })
///     }
/// }
///
/// struct Differencing {
///     last: Vec<f64>,
/// }
///
/// impl Operator for Differencing {
///     fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
///         for (i, &value) in tick.port(0).iter().enumerate() {
///             if !value.is_nan() {
///                 outputs.set(i, value - self.last[i]);
///                 self.last[i] = value;
///             }
///         }
///     }
///
///     fn segment(&mut self) {
///         self.last.fill(f64::NAN);
///     }
/// }
///
/// athermal_core::register!(Difference, Feature, "difference");
/// # fn main() {}
/// ```
#[diagnostic::on_unimplemented(
    message = "`{Self}` is no feature",
    label = "implement `athermal_core::node::Feature` for it, or register it in the role that it has"
)]
pub trait Feature: Debug + Send + Sync {
    /// The input ports.
    fn inputs() -> &'static [InputPort]
    where
        Self: Sized;

    /// All output ports that [`outputs`](Self::outputs) may give, in that order. Without them a node
    /// of several ports has to name them in its documentation.
    fn ports() -> &'static [PortSummary]
    where
        Self: Sized,
    {
        &[]
    }

    /// What reports ask of the kind.
    fn facts() -> KindFacts
    where
        Self: Sized,
    {
        KindFacts::default()
    }

    /// Mistakes between parameters, whatever the inputs are. The compiler has checked the ranges of the schema.
    fn mistakes(&self) -> Vec<Mistake> {
        Vec::new()
    }

    /// The output ports for these inputs; the first is the default. Asked for though there are [`mistakes`](Self::mistakes) too.
    ///
    /// # Errors
    /// Every mistake in how the inputs fit the parameters; those of `mistakes` need not be there, and do no harm.
    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>>;

    /// What can be used and is probably not meant, reported as warnings; asked for only where there is no mistake.
    fn warnings(&self, _inputs: &Inputs) -> Vec<Mistake> {
        Vec::new()
    }

    /// What runs. `wanted[i]` says whether anybody reads output port `i`, so that what nobody reads need not be computed. All ports
    /// keep their places among the outputs, wanted or not.
    fn build(&self, inputs: &Inputs, wanted: &[bool]) -> Box<dyn Operator>;

    /// How it is fitted, for a kind that learns from a truth before it runs: see [`Encoder`].
    fn encoder(&self) -> Option<&dyn Encoder> {
        None
    }

    /// Whether the answer changes with time alone, so that the node runs at every tick.
    fn every_tick(&self) -> bool {
        false
    }

    /// What the channels of an output port are made of. A kind that computes each from its own input, or moves values in
    /// time, says so here; otherwise an estimator may be denied a harmless channel because of another beside it.
    fn reach(&self, _port: &str) -> Reach {
        Reach::All
    }

    /// Whether a value depends on all of the past, however little, so that it has no span: nothing made of it can be a truth.
    fn is_endless(&self) -> bool {
        false
    }

    /// How far back the inputs reach that the outputs depend on; the engine keeps so much of the past for warming up.
    fn memory(&self) -> Duration {
        Duration::ZERO
    }

    /// What it keeps of the past in memory, by window, where its channels have a sample each `every`: for whoever asks how much memory a graph
    /// takes before it runs. By default that is a number and an instant of each channel, for as long as [`memory`](Self::memory).
    fn keeps(&self, inputs: &Inputs, _wanted: &[bool], every: Duration) -> Vec<Kept> {
        let channels = inputs.ports.iter().map(|(_, channels)| channels.len());
        Kept::past(self.memory(), every, 16 * channels.sum::<usize>())
    }

    /// How far ahead of a tick it also reads the channels of its first port, each time above 0. Only planned channels may be read so,
    /// as far as they are known ahead. Behind the present values [`Tick::port`] then has those of all channels for the first of
    /// these times, then for the next.
    fn reads_ahead(&self) -> Vec<Duration> {
        Vec::new()
    }

    /// Whether outputs depend only on inputs of earlier ticks, so that the node may close a loop.
    ///
    /// Such a node gets its inputs through [`Operator::capture`] once all outputs of the tick are there.
    fn closes_loops(&self) -> bool {
        false
    }
}

/// A running feature.
pub trait Operator: Send {
    /// Computes the outputs of this tick. An output that is not set keeps its last value, which others may hold on to.
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>);

    /// Takes the inputs of this tick after all outputs are there; only for kinds that say [`Feature::closes_loops`].
    fn capture(&mut self, _tick: &Tick<'_>) {}

    /// Starts afresh: the next tick belongs to another segment of the data.
    fn segment(&mut self);

    /// All that the next outputs depend on, beside the inputs; none for a node that keeps nothing.
    fn snapshot(&self) -> Option<Box<dyn State>> {
        None
    }

    /// Goes on from a state that this kind of node gave, maybe with other parameters or in an older form.
    fn restore(&mut self, _state: Box<dyn State>) -> Restored {
        Restored::cold("the node keeps no state")
    }

    /// Whether what it knows stays true when what it reads has changed, such as where an axis stands. Where a graph is replaced
    /// the state is then offered also under other inputs or a new fit further up, and in a unit that may have changed.
    fn outlives_changes(&self) -> bool {
        false
    }
}

/// The values that ports read at a tick, by the number of the bundle; those side by side are in the order of the port.
pub(crate) trait PortValues: Debug {
    /// The values; NaN where there is none.
    fn values(&self, bundle: usize) -> &[f64];

    /// Their stamps; of no meaning where there is no value.
    fn stamps(&self, bundle: usize) -> &[Instant];
}

/// When a slot was given its value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlotTime {
    /// The stamp of the value.
    pub(crate) stamp: Instant,
    /// The number of the tick at which the slot was last given something, be it nothing.
    pub(crate) tick: u64,
}

impl SlotTime {
    /// That of a slot that was never given anything.
    pub(crate) const NEVER: Self = Self {
        stamp: Instant::MIN,
        tick: 0,
    };
}

/// What an operator sees of the present tick.
#[derive(Debug)]
pub struct Tick<'a> {
    /// The instant of the tick.
    pub now: Instant,
    pub(crate) gathered: &'a dyn PortValues,
    pub(crate) ports: &'a [usize],
}

impl<'a> Tick<'a> {
    /// The values of an input port in channel order; NaN where there is none. Ports count from 0 as the kind declares them, those
    /// left out included, the truth not.
    ///
    /// # Panics
    /// Where the kind declares no such port.
    #[must_use]
    pub fn port(&self, index: usize) -> &'a [f64] {
        self.gathered.values(self.ports[index])
    }

    /// The stamps of the values of an input port; of no meaning where there is no value.
    ///
    /// # Panics
    /// Where the kind declares no such port.
    #[must_use]
    pub fn stamps(&self, index: usize) -> &'a [Instant] {
        self.gathered.stamps(self.ports[index])
    }
}

/// Where an operator puts its results: all channels of its ports, one port after the other.
#[derive(Debug)]
pub struct Outputs<'a> {
    pub(crate) values: &'a mut [f64],
    pub(crate) given: &'a mut [SlotTime],
    pub(crate) tick: u64,
    pub(crate) default_stamp: Instant,
}

impl Outputs<'_> {
    /// Gives a value, or NaN for "ran, and has nothing". The stamp is the oldest among the inputs' present values.
    ///
    /// # Panics
    /// Where the node has no such output channel: [`len`](Self::len) says how many it has.
    pub fn set(&mut self, index: usize, value: f64) {
        self.set_stamped(index, value, self.default_stamp);
    }

    /// Gives a value with a stamp of its own, such as a window's newest sample. What is infinite is no value.
    ///
    /// # Panics
    /// Where the node has no such output channel.
    pub fn set_stamped(&mut self, index: usize, value: f64, stamp: Instant) {
        self.values[index] = unless_infinite(value);
        self.given[index] = self.given_now(stamp);
    }

    /// Gives values with one stamp to channels side by side: the answer is to be filled with them, none of them infinite.
    ///
    /// # Panics
    /// Where the range ends beyond the node's output channels.
    pub fn fill_stamped(&mut self, range: Range<usize>, stamp: Instant) -> &mut [f64] {
        let given = self.given_now(stamp);
        self.given[range.clone()].fill(given);
        &mut self.values[range]
    }

    fn given_now(&self, stamp: Instant) -> SlotTime {
        let tick = self.tick;
        SlotTime { stamp, tick }
    }

    /// The number of output channels, over all ports.
    #[must_use]
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether the node has no outputs.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }
}
