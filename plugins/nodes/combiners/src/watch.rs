//! Combiners that pass a prediction on and watch whether its errors have changed.

#[cfg(test)]
mod tests;
mod usual;

use athermal_core::node::{Combine, Combiner, Evidence, InputPort, Restored, State, Votes};
use athermal_core::time::{Duration, Instant};
use athermal_numerics::{self as numerics, AdwinOptions, MeanChange, PageHinkleyOptions};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::mean::{equal, mean};
use usual::{Taken, Usual};

/// What both kinds document of their answers.
macro_rules! reasons {
    () => {
        "The port `reason` says: 0 no change, 1 the mean has gone up, 2 it has gone down, 3 not yet known. Of a node `watch` it is\n\
         written `watch:reason`; in a node with `each`, `watch:reason.{axis}` is that of its member. An alarm stands for `hold`. Of several predictions the mean is watched.\n\
         The port `std_dev` passes the standard deviation of the prediction on, where it has one. The port `weights` shows an\n\
         equal one for each of several."
    };
}

/// Passes a prediction on, and watches with the test of Page and Hinkley whether the model behind it has drifted.
///
/// The series `x_t` is the error, truth minus prediction, of each truth that the embargo lets through, in multiples
/// of the usual error. It makes `g_t = max(0, φ g_{t−1} ± (x_t − x̄_t) − δ)`, and an alarm where `g_t` is above `λ`
/// (Page 1954; Hinkley 1971). `x̄_t` is the mean since the test began. After an alarm it begins anew. The usual error
/// is the root mean square of all that have been taken, the present one among them. One that is larger than five
/// times that counts as five (Huber 1981). So neither a glitch nor the minutes after a change of set point are an
/// alarm by themselves. Among the `first` errors, at most 100, 1.4826 times the median of their sizes stands for the
/// usual error in this. All exactly 0, as of a machine that stands still, they say nothing of those to come and are
/// passed over. Of the newest errors, as many as `first` and at most 100, more than half may be larger than five
/// times the usual error. Then what was usual is no more: they say anew what is, and the test begins anew. Of sizes
/// that is an alarm. Of errors with a sign it takes a quarter of those on either side, since more on one are a bias,
/// which the test reports.
///
/// Independent errors would give a false alarm in about `(exp(2δλ) − 2δλ − 1) / 2δ²` truths (Siegmund 1985), and in
/// no fewer with a `φ` below 1. Those of truths that overlap follow each other, so it takes one in a while, see
/// `every`, and the defaults leave much room. A bias as large as the usual error is found in some hours, one of half
/// that size hardly ever.
///
/// What is usual goes on being learned, the course of a day too. So a change that comes soon after the start, or
/// after an alarm, is taken for usual. The mean takes a bias `b` in as it grows. Of `n` truths before it `g` comes to
/// no more than `n (b ln(b/δ) − b + δ)`, and less as the usual error grows with it. With the defaults a bias as large
/// as the usual error is found from a day of truths on, one of 2.5 times that from half a day on. Where it matters
/// sooner, `adwin` compares the truths with each other and tells more of them.
///
#[doc = reasons!()]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PageHinkley {
    /// What is watched.
    #[serde(default)]
    pub watch: Watched,
    /// How many truths there must be before it is known what errors are usual, and how many more before an alarm; 2 or more.
    #[serde(default = "thirty")]
    #[schemars(range(min = 2))]
    pub first: u64,
    /// `δ`, half of the smallest change that is worth an alarm, in multiples of the usual error; 0 or more.
    #[serde(default = "tolerance")]
    #[schemars(range(min = 0.0))]
    pub tolerance: f64,
    /// `λ`, how large the sum must grow, in multiples of the usual error; above 0.
    #[serde(default = "threshold")]
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub threshold: f64,
    /// `φ`, what remains of `g` at each truth, so that a small bias that lasts adds up to less; above 0, at most 1.
    #[serde(default = "factor")]
    #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0.0))]
    pub factor: f64,
    /// The time from one truth that is taken to the next; with none, all are. It should be no shorter than the span of a truth and
    /// the horizon, so that errors do not overlap much.
    #[serde(default = "five_minutes")]
    pub every: Duration,
    /// How long an alarm stands.
    #[serde(default = "hour")]
    pub hold: Duration,
}

/// Passes a prediction on, and watches with adaptive windowing whether the model behind it has drifted.
///
/// A window holds the errors, truth minus prediction, since the last change of their mean, in multiples of the usual
/// error. That is the root mean square of all that have been taken, where one larger than five times that counts as
/// five. Among the `first`, at most 100, it counts as five times 1.4826 times the median of their sizes. The usual
/// error begins anew where errors are none at first or unusual for long, as in `page_hinkley`. There is an alarm, and
/// the window begins anew, where its two sides have means that are farther apart than chance allows:
/// `ε = √(2/m · σ² · ln(2 ln n / δ)) + 2/(3m) · ln(2 ln n / δ)`. Here `1/m = 1/(n₁ − s + 1) + 1/(n₂ − s + 1)` of the
/// sides' lengths, with `s` for `shortest`. That is ADWIN2 of Bifet and Gavaldà (2007), where `s` is 1; with the
/// others as river has it. It takes the errors for independent; those of truths that overlap are not, so let it take
/// one in a while with `every`.
///
#[doc = reasons!()]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Adwin {
    /// What is watched.
    #[serde(default)]
    pub watch: Watched,
    /// How many truths there must be before it is known what errors are usual, and how many more before an alarm; 2 or more.
    #[serde(default = "thirty")]
    #[schemars(range(min = 2))]
    pub first: u64,
    /// `δ`, the probability of a false alarm at a look, above 0, below 1.
    #[serde(default = "confidence")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "exclusiveMaximum" = 1.0))]
    pub confidence: f64,
    /// At every how many truths the window is looked at; 1 or more.
    #[serde(default = "eight")]
    #[schemars(range(min = 1))]
    pub clock: u64,
    /// The fewest truths on either side of a cut; 1 or more. A side counts as if it had `shortest` − 1 fewer, so that a larger number
    /// needs longer sides or larger changes.
    #[serde(default = "five")]
    #[schemars(range(min = 1))]
    pub shortest: u64,
    /// The time from one truth that is taken to the next; with none, all are. It should be no shorter than the span of a truth and
    /// the horizon, so that errors do not overlap much.
    #[serde(default = "five_minutes")]
    pub every: Duration,
    /// How long an alarm stands.
    #[serde(default = "hour")]
    pub hold: Duration,
}

/// What of the errors is watched.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Watched {
    /// The error with its sign: whether predictions have become too high or too low.
    #[default]
    Error,
    /// The error without its sign: whether predictions have become worse or better.
    Size,
}

fn thirty() -> u64 {
    30
}

fn eight() -> u64 {
    8
}

fn five() -> u64 {
    5
}

fn tolerance() -> f64 {
    0.5
}

fn threshold() -> f64 {
    30.0
}

fn factor() -> f64 {
    PageHinkleyOptions::default().factor
}

fn confidence() -> f64 {
    1e-5
}

fn five_minutes() -> Duration {
    Duration::from_ns(300_000_000_000)
}

fn hour() -> Duration {
    Duration::from_ns(3_600_000_000_000)
}

/// The largest error that is taken: the squares of so many as there may be have a sum.
const LARGEST_EVER: f64 = 1e140;

/// The numbers of the port `reason`.
mod reason {
    pub(super) const NONE: f64 = 0.0;
    pub(super) const UP: f64 = 1.0;
    pub(super) const DOWN: f64 = 2.0;
    pub(super) const UNKNOWN: f64 = 3.0;
}

const INPUTS: &[InputPort] = &[
    InputPort::held("voters", "the prediction that is watched"),
    InputPort::truth("what it predicts, for its errors"),
];

impl PageHinkley {
    fn options(&self) -> PageHinkleyOptions {
        PageHinkleyOptions {
            first: self.first,
            tolerance: self.tolerance,
            threshold: self.threshold,
            factor: self.factor,
        }
    }
}

impl Adwin {
    fn options(&self) -> AdwinOptions {
        AdwinOptions {
            confidence: self.confidence,
            clock: self.clock,
            first: self.first,
            shortest: self.shortest,
        }
    }
}

/// Both watch errors alike; they differ in what finds a change.
macro_rules! watches {
    ($node:ident, $kind:literal) => {
        impl Combiner for $node {
            fn inputs() -> &'static [InputPort] {
                INPUTS
            }

            fn has_weights(&self) -> bool {
                true
            }

            fn has_reason(&self) -> bool {
                true
            }

            fn is_endless(&self) -> bool {
                // What was seen last counts until a change is found.
                true
            }

            fn build(&self, _voters: usize) -> Box<dyn Combine> {
                let detector = numerics::$node::new(self.options())
                    .expect("a graph with parameters out of range is not compiled");
                Box::new(Watching::new(
                    self.watch, self.first, self.every, self.hold, detector,
                ))
            }
        }

        athermal_core::register!($node, Combiner, $kind);
    };
}

watches!(PageHinkley, "page_hinkley");
watches!(Adwin, "adwin");

/// What tells whether the mean of a series has changed.
trait Detector: Clone + Send + Sync + std::fmt::Debug + Serialize + DeserializeOwned + 'static {
    fn push(&mut self, value: f64) -> Option<MeanChange>;

    fn clear(&mut self);

    /// Goes on with the parameters of another.
    fn set_as(self, other: &Self) -> Self;
}

impl Detector for numerics::PageHinkley {
    fn push(&mut self, value: f64) -> Option<MeanChange> {
        self.push(value)
    }

    fn clear(&mut self) {
        self.clear();
    }

    fn set_as(self, other: &Self) -> Self {
        self.with(other.options())
    }
}

impl Detector for numerics::Adwin {
    fn push(&mut self, value: f64) -> Option<MeanChange> {
        self.push(value)
    }

    fn clear(&mut self) {
        self.clear();
    }

    fn set_as(self, other: &Self) -> Self {
        self.with(other.options())
    }
}

/// A prediction under watch.
struct Watching<D> {
    first: u64,
    every: Duration,
    hold: Duration,
    seen: Seen<D>,
}

/// What has been seen of the errors.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Seen<D> {
    watch: Watched,
    detector: D,
    usual: Usual,
    /// When the last truth was taken.
    taken: Option<Instant>,
    /// The last alarm: when it became known, and whether the mean had gone up.
    alarm: Option<(Instant, bool)>,
    /// The alarm of a truth that has just been handed over.
    found: Option<bool>,
    /// Up to when truths have been handed over.
    newest: Option<Instant>,
}

athermal_core::state!(Seen<numerics::PageHinkley>, "page_hinkley/4");
athermal_core::state!(Seen<numerics::Adwin>, "adwin/3");

impl<D: Detector> Watching<D> {
    fn new(watch: Watched, first: u64, every: Duration, hold: Duration, detector: D) -> Self {
        Self {
            first,
            every,
            hold,
            seen: Seen {
                watch,
                detector,
                usual: Usual::new(),
                taken: None,
                alarm: None,
                found: None,
                newest: None,
            },
        }
    }

    fn judge(&self) -> f64 {
        let Seen {
            usual,
            alarm,
            newest,
            ..
        } = &self.seen;
        match (alarm, newest) {
            (Some((at, up)), Some(newest)) if newest == at || *newest < *at + self.hold => {
                if *up {
                    reason::UP
                } else {
                    reason::DOWN
                }
            }
            _ if usual.count() < self.first => reason::UNKNOWN,
            _ => reason::NONE,
        }
    }
}

impl<D: Detector> Combine for Watching<D>
where
    Seen<D>: State,
{
    fn combine(&self, votes: Votes<'_>) -> f64 {
        mean(votes)
    }

    fn weights(&self, votes: Votes<'_>, weights: &mut [f64]) {
        equal(votes, weights);
    }

    fn reason(&self, votes: Votes<'_>) -> f64 {
        let any = votes.present().next();
        any.map_or(f64::NAN, |_| self.judge())
    }

    fn observe(&mut self, votes: Votes<'_>, truth: f64, arrived: Instant) {
        let error = truth - mean(votes);
        let seen = &mut self.seen;
        let too_early = seen.taken.is_some_and(|taken| arrived < taken + self.every);
        if too_early || !error.is_finite() {
            return;
        }
        seen.taken = Some(arrived);
        let error = error.clamp(-LARGEST_EVER, LARGEST_EVER);
        match (seen.usual.take(error, self.first, seen.watch), seen.watch) {
            (Taken::Early, _) => {}
            (Taken::Counts(relative), watch) => {
                let value = match watch {
                    Watched::Error => relative,
                    Watched::Size => relative.abs(),
                };
                if let Some(change) = seen.detector.push(value) {
                    seen.found = Some(change == MeanChange::Up);
                }
            }
            (Taken::Unusual, watch) => {
                seen.detector.clear();
                if watch == Watched::Size {
                    seen.found = Some(true);
                }
            }
        }
    }

    fn advance(&mut self, newest: Instant) {
        let seen = &mut self.seen;
        seen.newest = Some(newest);
        // A truth is handed over at the tick after it arrived, or later.
        if let Some(up) = seen.found.take() {
            seen.alarm = Some((newest, up));
        }
    }

    fn segment(&mut self, shift: Duration) {
        let seen = &mut self.seen;
        let instants = seen.taken.iter_mut().chain(&mut seen.newest);
        let alarm = seen.alarm.iter_mut().map(|(at, _)| at);
        instants.chain(alarm).for_each(|at| *at = *at + shift);
    }

    fn evidence(&self) -> Option<Evidence> {
        Some(Evidence {
            truths: self.seen.usual.count() as f64,
            // As many again must come before an alarm as tell which errors are usual.
            needed: 2.0 * self.first as f64,
            remedy: "a shorter `every`, or more data,",
        })
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(self.seen.clone()))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        match state.known::<Seen<D>>() {
            // Errors with a sign and sizes are two series; going from one to the other would look like a change.
            Ok(known) if known.watch != self.seen.watch => {
                Restored::cold("what is watched of the errors differs")
            }
            Ok(mut known) => {
                known.detector = known.detector.set_as(&self.seen.detector);
                known.usual.reserve();
                self.seen = known;
                Restored::Accepted
            }
            Err(cold) => cold,
        }
    }
}
