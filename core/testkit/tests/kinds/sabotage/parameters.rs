//! Kinds that say too little of their parameters, or other than they do.

use athermal_core::quantity::Quantity;

use super::*;

/// Makes a kind of a struct whose `mistakes` say what it refuses; it passes its input on.
macro_rules! passes {
    ($spec:ty, $name:literal, $summary:literal) => {
        impl Feature for $spec {
            fn inputs() -> &'static [InputPort] {
                const { &[InputPort::fresh("signal", $summary)] }
            }

            fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
                let mistakes = self.mistakes(inputs);
                let channels = inputs.port("signal").to_vec();
                let port = OutputPort {
                    name: "signal",
                    channels,
                };
                if mistakes.is_empty() {
                    Ok(vec![port])
                } else {
                    Err(mistakes)
                }
            }

            fn build(&self, _inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
                Box::new(Passing)
            }
        }

        athermal_core::register!($spec, Feature, $name);
    };
}

struct Passing;

impl Operator for Passing {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        for (i, &value) in tick.port(0).iter().enumerate() {
            if !value.is_nan() {
                outputs.set(i, value);
            }
        }
    }

    fn segment(&mut self) {}
}

#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
struct Unexplained {
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    window_s: f64,
}

impl Unexplained {
    fn mistakes(&self, _inputs: &Inputs) -> Vec<Mistake> {
        Vec::new()
    }
}

passes!(Unexplained, "sabotaged_words", "");

#[test]
fn a_kind_that_explains_nothing_is_told_what_is_missing() {
    breaks_only::<Unexplained>(Case::new(""), &[Rule::Explained]);
    let broken = broken::<Unexplained>(&[Case::new("")]);
    let told: String = broken.iter().map(|broken| format!("{broken}\n")).collect();
    for part in [
        "struct of `sabotaged_words` has no documentation",
        "deny_unknown_fields",
        "the input port `signal` has no summary",
        "the parameter `window_s` has no documentation",
        "a bare number with a unit in its name",
    ] {
        assert!(told.contains(part), "`{part}` is not in:\n{told}");
    }
}

/// Passes its input on, whatever its share is.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Careless {
    /// A share, 0 to 1.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    share: f64,
    /// How careful it is with them.
    #[serde(default)]
    fault: Care,
    /// A limit that is never looked at.
    #[serde(default)]
    limit: Option<Quantity>,
    /// Parts of a whole.
    #[serde(default)]
    parts: Vec<Part>,
}

/// A part of a whole.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Part {
    /// How much of it, above 0.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    much: f64,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Care {
    /// Nothing is looked at.
    #[default]
    Anything,
    /// Less is taken than the schema says.
    Stricter,
    /// What is taken is not always survived.
    Fragile,
    /// All that can be checked is.
    Careful,
}

impl Careless {
    fn mistakes(&self, inputs: &Inputs) -> Vec<Mistake> {
        let (share, fault) = (self.share, self.fault);
        let mut mistakes = Vec::new();
        if fault == Care::Stricter && share >= 0.5 {
            mistakes.push(Mistake::at("share", "it must be a share"));
        }
        assert!(
            fault != Care::Fragile || share < 1.0,
            "nothing is left of the rest"
        );
        let unit = inputs.port("signal").first().map(|channel| &channel.unit);
        if fault != Care::Anything
            && let (Some(limit), Some(unit)) = (&self.limit, unit)
            && limit.in_unit(unit).is_none()
        {
            mistakes.push(Mistake::at("limit", "it must be in the unit of the input"));
        }
        mistakes
    }
}

passes!(Careless, "sabotaged_ranges", "what is passed on");

fn careless(fault: &str) -> Case {
    Case::new(format!(
        "fault = \"{fault}\"\nshare = 0.2\nlimit = \"1 nm\"\nparts = [{{ much = 1.0 }}]"
    ))
}

#[test]
fn what_the_schema_says_of_a_range_is_what_is_taken() {
    breaks_only::<Careless>(careless("careful"), &[]);
    let cases = [
        ("anything", "`limit = \"1 cd\"` is accepted"),
        (
            "stricter",
            "`share = 1.0` is allowed by the schema, and refused",
        ),
    ];
    for (fault, words) in cases {
        breaks::<Careless>(careless(fault), Rule::Ranges, words);
    }
}

#[test]
fn what_the_schema_allows_runs() {
    breaks_one::<Careless>(
        careless("fragile"),
        Rule::Ranges,
        "with `share = 1.0` it panics: nothing is left of the rest",
    );
}

/// Passes its input on, and writes its parameter under a name that it does not read.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Renamed {
    /// A word without a meaning.
    #[serde(default, rename(serialize = "said"))]
    word: String,
}

impl Renamed {
    fn mistakes(&self, _inputs: &Inputs) -> Vec<Mistake> {
        Vec::new()
    }
}

passes!(Renamed, "sabotaged_names", "what is passed on");

/// Passes its input on, and does not write its parameter.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Lossy {
    /// How often, counted from the other end.
    #[serde(default, serialize_with = "less")]
    times: u32,
}

fn less<S: serde::Serializer>(times: &u32, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_u32(times.saturating_sub(1))
}

impl Lossy {
    fn mistakes(&self, _inputs: &Inputs) -> Vec<Mistake> {
        Vec::new()
    }
}

passes!(Lossy, "sabotaged_numbers", "what is passed on");

/// Passes its input on, and keeps its parameter to itself.
#[allow(dead_code)]
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Secret {
    /// How often.
    #[serde(default, skip_serializing)]
    times: u32,
}

impl Secret {
    fn mistakes(&self, _inputs: &Inputs) -> Vec<Mistake> {
        Vec::new()
    }
}

passes!(Secret, "sabotaged_secret", "what is passed on");

#[test]
fn parameters_read_back_as_they_were_written() {
    breaks::<Renamed>(
        Case::new("word = \"so\""),
        Rule::ReadsBack,
        "written out in full, the parameters are refused",
    );
    breaks::<Lossy>(Case::new("times = 7"), Rule::ReadsBack, "are read back as");
    finds::<Secret>(
        Case::new("times = 7"),
        Rule::ReadsBack,
        "Secret { times: 7 } is read back as Secret { times: 0 }",
    );
}

/// Passes its input on, through a port and under names that no reference can write.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Misnamed {}

impl Feature for Misnamed {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "what is passed on")] }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let mut channels = inputs.port("signal").to_vec();
        for channel in &mut channels {
            channel.name = format!("{} (mean)", channel.name);
        }
        let name = "of.it";
        Ok(vec![OutputPort { name, channels }])
    }

    fn build(&self, _inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        Box::new(Passing)
    }
}

athermal_core::register!(Misnamed, Feature, "sabotaged_references");

#[test]
fn a_port_or_channel_that_no_reference_can_name_is_told() {
    breaks_one::<Misnamed>(
        Case::new("").input("signal", 1, "K"),
        Rule::Names,
        "the output port `of.it` is not a letter followed by letters, digits, `_` and `-`\nthe channel `a (mean)` is not made of \
         letters, digits and `_`, `-`, `@`, `.`, `/`",
    );
}
