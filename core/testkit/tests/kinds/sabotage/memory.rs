//! Kinds that say how far they look back, or too little of it.

use std::collections::VecDeque;

use super::*;

/// The mean of each channel over a window.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Window {
    /// How long the window is.
    #[schemars(extend("exclusiveMinimum" = 0))]
    window: Duration,
    /// How much of the window it tells that it looks back.
    #[schemars(extend("exclusiveMinimum" = 0))]
    told: Duration,
}

impl Feature for Window {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "what is averaged")] }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let mut channels = inputs.port("signal").to_vec();
        for channel in &mut channels {
            channel.span += self.window;
        }
        let name = "mean";
        Ok(vec![OutputPort { name, channels }])
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::Own
    }

    fn memory(&self) -> Duration {
        self.told
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        let room = || VecDeque::with_capacity(ROOM);
        Box::new(Sliding {
            window: self.window,
            kept: inputs.port("signal").iter().map(|_| room()).collect(),
        })
    }
}

/// How many samples are kept at most.
const ROOM: usize = 1000;

struct Sliding {
    window: Duration,
    kept: Vec<VecDeque<(Instant, f64)>>,
}

impl Operator for Sliding {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        for (i, &value) in tick.port(0).iter().enumerate() {
            // A sum of larger ones may not be finite.
            if value.is_nan() || value.abs() > 1e100 {
                continue;
            }
            let kept = &mut self.kept[i];
            let begin = tick.now - self.window;
            while kept.len() == ROOM || kept.front().is_some_and(|(at, _)| *at <= begin) {
                kept.pop_front();
            }
            kept.push_back((tick.now, value));
            let sum: f64 = kept.iter().map(|(_, value)| value).sum();
            outputs.set(i, sum / kept.len() as f64);
        }
    }

    fn segment(&mut self) {
        self.kept.iter_mut().for_each(VecDeque::clear);
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        let kept = self.kept.iter().map(|kept| kept.iter().copied().collect());
        Some(Box::new(Kept {
            kept: kept.collect(),
        }))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        match state.known::<Kept>() {
            Ok(known) if known.kept.len() == self.kept.len() => {
                for (own, known) in self.kept.iter_mut().zip(known.kept) {
                    own.clear();
                    own.extend(known.into_iter().take(ROOM));
                }
                Restored::Accepted
            }
            Ok(_) => Restored::cold("the number of channels differs"),
            Err(cold) => cold,
        }
    }
}

#[derive(Debug, Serialize, Deserialize)]
struct Kept {
    kept: Vec<Vec<(Instant, f64)>>,
}

athermal_core::state!(Kept, "sabotaged_window/1");
athermal_core::register!(Window, Feature, "sabotaged_window");

fn window(told: &str) -> Case {
    Case::new(format!("window = \"10min\"\ntold = \"{told}\""))
}

#[test]
fn a_window_that_is_told_in_full_is_sound() {
    breaks_only::<Window>(window("10min"), &[]);
    breaks_only::<Window>(window("20min"), &[]);
}

#[test]
fn a_memory_that_is_told_too_short_is_found() {
    for told in ["1s", "1min", "5min"] {
        breaks_only::<Window>(window(told), &[Rule::Memory]);
    }
    breaks::<Window>(window("5min"), Rule::Memory, "where it has always run");
}

/// The mean of the votes, less the mean of all its errors.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Unbiased {
    /// Whether it says that nothing of them is ever forgotten.
    #[schemars(with = "String")]
    says: Says,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Says {
    Endless,
    Nothing,
}

impl Combiner for Unbiased {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held("voters", "predictions of the same truth"),
                InputPort::truth("what they predict"),
            ]
        }
    }

    fn is_endless(&self) -> bool {
        self.says == Says::Endless
    }

    fn build(&self, _voters: usize) -> Box<dyn Combine> {
        Box::new(Errors::default())
    }
}

/// The errors so far.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
struct Errors {
    sum: f64,
    count: f64,
}

fn mean(votes: Votes<'_>) -> f64 {
    let sum: f64 = votes.present().map(|(_, vote)| vote).sum();
    sum / votes.present().count() as f64
}

impl Combine for Errors {
    fn combine(&self, votes: Votes<'_>) -> f64 {
        mean(votes) - self.sum / self.count.max(1.0)
    }

    fn observe(&mut self, votes: Votes<'_>, truth: f64, _arrived: Instant) {
        let error = mean(votes) - truth;
        if error.is_finite() && error.abs() < 1e100 {
            self.sum += error;
            self.count += 1.0;
        }
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(self.clone()))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        state.replace(self)
    }
}

athermal_core::state!(Errors, "sabotaged_errors/1");
athermal_core::register!(Unbiased, Combiner, "sabotaged_errors");

#[test]
fn a_combiner_that_never_forgets_says_so() {
    let says = |word: &str| Case::new(format!("says = \"{word}\""));
    let broken = |word| broken::<Unbiased>(&[says(word)]);
    let rules = |word| -> Vec<Rule> { broken(word).iter().map(|broken| broken.rule).collect() };
    assert!(!rules("endless").contains(&Rule::Memory));
    assert!(rules("nothing").contains(&Rule::Memory));
}
