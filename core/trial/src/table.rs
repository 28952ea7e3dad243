//! Decides which keys `[[tests]]` has and what they say of themselves; what they mean for a graph is decided by the declaration.

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer};

use crate::fault::FaultSpec;
use crate::machine::Change;
use crate::node::Forms;
use crate::quantity::Quantity;
use crate::time::Duration;

/// A test: data, what is broken in them, and what must come out.
#[derive(Debug, JsonSchema)]
#[schemars(rename = "Test", deny_unknown_fields)]
#[allow(dead_code)] // the shape of the whole, for the schema; its parts are decoded one by one
pub struct TestTable {
    /// What the test shows, as a sentence.
    name: String,
    /// The data that estimators are fitted on. Without it, what needs a fit gives nothing.
    fit: Option<DataTable>,
    /// The data that the graph is run over.
    on: Option<DataTable>,
    /// Made-up measurements to run over, in place of `on`, by signal or channel: `"temperature.room"`. All other channels are absent.
    inputs: Option<IndexMap<String, InputTable>>,
    /// What is wrong with the sensors during the run. The fit sees the data as they are.
    #[serde(default)]
    faults: Vec<FaultSpec>,
    /// What must come out; each is checked.
    #[schemars(length(min = 1))]
    expect: Vec<ExpectTable>,
}

/// Recorded or simulated data.
#[derive(Debug, JsonSchema)]
#[schemars(rename = "TestData", untagged)]
#[allow(dead_code)] // see TestTable
pub(crate) enum DataTable {
    /// A file, relative to the file in which it stands.
    File(String),
    /// Several files, in the order of time; those whose times start again are segments.
    Files(Vec<String>),
    /// A simulated machine.
    Simulated(SimulationTable),
}

/// A simulated machine.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "TestSimulation")]
pub(super) struct SimulationTable {
    /// The machine, such as `die-tester`.
    pub(super) simulate: String,
    /// How many days of it.
    #[serde(default = "one_day")]
    #[schemars(range(max = 3653))]
    pub(super) days: f64,
    /// The seed: the same one gives the same data.
    #[serde(default = "first_seed")]
    pub(super) seed: u64,
    /// A file of set points over time, as `athermal simulate --schedule` takes it, relative to the file in which it stands; without it the machine's own schedule.
    pub(super) schedule: Option<String>,
    /// What of it becomes another, as `athermal simulate --change` takes it: `["expansion=30%@2d"]`.
    #[serde(default)]
    pub(super) change: Vec<Change>,
}

fn one_day() -> f64 {
    1.0
}

fn first_seed() -> u64 {
    1
}

/// Made-up measurements of a channel: a constant, plus a ramp, a step, a sine and noise, or samples one by one.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "TestInput")]
pub(super) struct InputTable {
    /// The time between two samples.
    pub(super) every: Duration,
    /// From the first sample, at time 0, to the last one. With `samples` their number says it.
    #[serde(rename = "for")]
    pub(super) length: Option<Duration>,
    /// The value throughout.
    pub(super) constant: Option<Quantity>,
    /// The value before a ramp, step or sine begins; 0 without it.
    pub(super) start: Option<Quantity>,
    /// A rate of change: `"1 mK/s"`.
    pub(super) ramp: Option<Quantity>,
    /// A change at once: `"1 K"`. A temperature's is in K.
    pub(super) step: Option<Quantity>,
    /// The amplitude of a sine: `"0.5 K"`.
    pub(super) sine: Option<Quantity>,
    /// The period of the sine.
    pub(super) period: Option<Duration>,
    /// When ramp, step and sine begin; at once without it.
    pub(super) delay: Option<Duration>,
    /// The standard deviation of normal noise: `"12 nm"`.
    pub(super) noise: Option<Quantity>,
    /// The seed of the noise.
    #[serde(default = "first_seed")]
    pub(super) seed: u64,
    /// The samples one by one: quantities, `nan` where there is none.
    pub(super) samples: Option<Vec<Sample>>,
}

/// One sample.
#[derive(Debug, Clone, JsonSchema)]
#[schemars(untagged, rename = "TestSample")]
pub(super) enum Sample {
    /// A value with its unit.
    Value(Quantity),
    /// `nan`: no value.
    Absent(f64),
}

impl<'de> Deserialize<'de> for Sample {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Forms::new("a quantity like \"20 nm\", or nan for no value")
            .text(Self::Value)
            .number(Self::Absent)
            .read(deserializer)
    }
}

/// What must come out. Times count from the first row of each segment.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "TestExpectation")]
pub(super) struct ExpectTable {
    /// A channel, or several, each of which is checked: `"vote.Z1"`, `"vote"`, `"gradients.room@*"`. An output comes before a node of its name.
    pub(super) of: String,
    /// Only truths whose absolute value is below count for `rmse_below`, `r2_above`, `beats` and the `valid_above` of a prediction.
    pub(super) abs_truth_below: Option<Quantity>,
    /// The root mean square error of the prediction, on all instants at which it has a value, is below.
    pub(super) rmse_below: Option<Quantity>,
    /// R² of the prediction, 1 − Σ(ŷ − y)² / Σ(y − ȳ)², on all instants at which it has a value, is above.
    #[schemars(extend("exclusiveMaximum" = 1))]
    pub(super) r2_above: Option<f64>,
    /// The root mean square error is below that of each of these, on the instants at which all have a value: `zero`, `persistence`, or other predictions of the same truth.
    #[schemars(length(min = 1))]
    pub(super) beats: Option<Vec<String>>,
    /// The share that has a value is above: of a prediction, of the measured truths; of any other channel, of the ticks at which it was computed.
    #[schemars(range(min = 0), extend("exclusiveMaximum" = 1))]
    pub(super) valid_above: Option<f64>,
    /// The share of all ticks at which the channel was given a value is above, whether a truth was measured or not.
    #[schemars(range(min = 0), extend("exclusiveMaximum" = 1))]
    pub(super) given_above: Option<f64>,
    /// Every value, or the one `at` a time, equals this.
    pub(super) equals: Option<Quantity>,
    /// How far a value may be from `equals`, in its unit or with a unit; 0 without it.
    pub(super) within: Option<Within>,
    /// Every value, or the one `at` a time, lies between these, both included.
    pub(super) between: Option<(Quantity, Quantity)>,
    /// `true`: there is no value, at any tick or, `at` a time, at the last tick at or before it.
    pub(super) absent: Option<bool>,
    /// From one value to the next the change is always below.
    pub(super) max_step_below: Option<Quantity>,
    /// The time of the one value that `equals` and `between` look at, the last one computed at or before it, and of the tick that `absent` looks at.
    pub(super) at: Option<Duration>,
    /// Only what comes at this time or later counts.
    pub(super) from: Option<Duration>,
    /// Only what comes at this time or earlier counts.
    pub(super) to: Option<Duration>,
}

/// How far a value may be off.
#[derive(Debug, Clone, JsonSchema)]
#[schemars(untagged, rename = "TestTolerance")]
pub(super) enum Within {
    /// In the unit of `equals`.
    Number(f64),
    /// With a unit of its own.
    Quantity(Quantity),
}

impl<'de> Deserialize<'de> for Within {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Forms::new("a number, or a quantity like \"5 nm\"")
            .number(Self::Number)
            .text(Self::Quantity)
            .read(deserializer)
    }
}
