//! Decides which trailing windows a node looks back over, and what a window must hold before it has a value.

use athermal_core::channel::Channel;
use athermal_core::node::{Forms, Mistake};
use athermal_core::time::Duration;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

/// Trailing windows.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Windows {
    /// These lengths.
    Lengths(#[schemars(length(min = 1))] Vec<Duration>),
    /// A dynamic range of lengths around a drift window.
    Range(DynamicRange),
}

/// What a window does that reaches back before the first value of its channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Cold {
    /// It has no value.
    #[default]
    Absent,
    /// It makes do with what there is.
    Partial,
}

/// The default of `min_samples`.
pub(crate) fn three() -> usize {
    3
}

/// The default of `min_coverage`.
pub(crate) fn half() -> f64 {
    0.5
}

/// What windows of these lengths make of channels: one for each channel and window, named by both where there are several windows.
pub(crate) fn over(from: &[Channel], windows: &[Duration]) -> Vec<Channel> {
    let of = |channel: &Channel, window: Duration| Channel {
        name: if windows.len() == 1 {
            channel.name.clone()
        } else {
            format!("{}@{}", channel.name, seconds(window))
        },
        // What a value of the channel summarises reaches back before the window that holds it.
        span: channel.span + window,
        ..channel.clone()
    };
    from.iter()
        .flat_map(|channel| windows.iter().map(move |&window| of(channel, window)))
        .collect()
}

/// A window's length in seconds, rounded to the millisecond, in its shortest form.
fn seconds(window: Duration) -> String {
    let milliseconds = (window.as_ns() + 500_000) / 1_000_000;
    format!("{}s", milliseconds as f64 / 1000.0)
}

/// Windows that fit a drift window `t_s`, from the shortest to the harmonics of its spectrum.
///
/// The Fourier transform of a windowed line has its zeros at the roots of `tan x = x`, and that of a difference over `t_s`
/// its first at `2π/t_s`. They fall together for windows of `t_s · x_j / π`. `steps` windows run on a logarithmic scale
/// from `shortest` to the first of these, and the others follow.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DynamicRange {
    /// The drift window `t_s`.
    pub dynamic_range: Duration,
    /// The shortest window.
    pub shortest: Duration,
    /// How many windows run from the shortest to the first harmonic, both counted; 2 to 100.
    #[schemars(range(min = 2, max = 100))]
    pub steps: u32,
    /// How many harmonics there are; 1 to 100.
    #[schemars(range(min = 1, max = 100))]
    pub harmonics: u32,
}

impl<'de> Deserialize<'de> for Windows {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Forms::new("a list of durations or a dynamic range")
            .list(Self::Lengths)
            .table(Self::Range)
            .read(deserializer)
    }
}

impl Windows {
    /// A window that stands twice, or a dynamic range that is none.
    pub(crate) fn mistakes(&self) -> Vec<Mistake> {
        let windows = match self.lengths() {
            Ok(windows) => windows,
            Err(mistake) => return vec![mistake],
        };
        let twice = |&(i, window): &(usize, &Duration)| windows[..i].contains(window);
        let twice = windows.iter().enumerate().filter(twice);
        let mistake = |(i, window)| {
            let message = format!("the window {window} stands twice");
            Mistake::at(format!("windows.{i}"), message)
        };
        twice.map(mistake).collect()
    }

    /// The lengths, in order.
    ///
    /// # Errors
    /// When a dynamic range is none.
    pub fn lengths(&self) -> Result<Vec<Duration>, Mistake> {
        match self {
            Self::Lengths(lengths) => Ok(lengths.clone()),
            Self::Range(range) => range.lengths(),
        }
    }
}

impl DynamicRange {
    fn lengths(&self) -> Result<Vec<Duration>, Mistake> {
        let drift = self.dynamic_range.secs();
        let first = drift * root(1) / std::f64::consts::PI;
        let shortest = self.shortest.secs();
        if !(shortest > 0.0 && shortest < first) {
            let message = format!(
                "the shortest window is {} and the first harmonic {first:.3} s",
                self.shortest
            );
            let help = "the shortest window lies above zero and below 1.43 times the drift window";
            return Err(Mistake::at("windows", message).help(help));
        }
        let last = f64::from(self.steps - 1);
        let ratio = first / shortest;
        let spaced = (0..self.steps).map(|step| match f64::from(step) {
            step if step == last => first,
            step => shortest * ratio.powf(step / last),
        });
        let harmonics = (2..=self.harmonics).map(|nth| drift * root(nth) / std::f64::consts::PI);
        let lengths = spaced.chain(harmonics).map(Duration::from_secs_f64);
        lengths
            .collect::<Option<_>>()
            .ok_or_else(|| Mistake::at("windows", "the windows are too long"))
    }
}

/// The `nth` positive root of `tan x = x`, by Newton's method on `x cos x − sin x` from just below `(nth + ½)π`.
fn root(nth: u32) -> f64 {
    let pole = (f64::from(nth) + 0.5) * std::f64::consts::PI;
    let mut x = pole - 1.0 / pole;
    for _ in 0..8 {
        x -= (x * x.cos() - x.sin()) / (-x * x.sin());
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    fn s(seconds: f64) -> Duration {
        Duration::from_secs_f64(seconds).unwrap()
    }

    #[test]
    fn the_roots_of_tan_x_equals_x_are_those_of_the_tables() {
        // Abramowitz and Stegun 1964, table 4.19.
        for (nth, expected) in [
            (1, 4.493_409_458),
            (2, 7.725_251_837),
            (3, 10.904_121_659),
            (4, 14.066_193_913),
        ] {
            assert!((root(nth) - expected).abs() < 1e-9, "{nth}: {}", root(nth));
        }
    }

    #[test]
    fn four_steps_and_four_harmonics_around_five_minutes_are_seven_windows() {
        let range = DynamicRange {
            dynamic_range: s(300.0),
            shortest: s(150.0),
            steps: 4,
            harmonics: 4,
        };
        let lengths = range.lengths().unwrap();
        let expected = [
            150.0, 212.933, 302.270, 429.089, 737.707, 1041.267, 1343.223,
        ];
        assert_eq!(lengths.len(), expected.len());
        for (length, expected) in lengths.iter().zip(expected) {
            assert!(
                (length.secs() - expected).abs() < 5e-4,
                "{length} is not {expected} s"
            );
        }
    }

    #[test]
    fn a_shortest_window_above_the_first_harmonic_is_a_mistake() {
        let range = DynamicRange {
            dynamic_range: s(300.0),
            shortest: s(500.0),
            steps: 4,
            harmonics: 4,
        };
        assert!(range.lengths().is_err());
    }
}
