//! Parameters that go wrong only at a default, a word or a switch that no case states.

use super::*;

/// Passes its input on by a factor.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Gain {
    /// The factor, 0 to 1.
    #[serde(default = "two")]
    #[schemars(range(min = 0.0, max = 1.0))]
    factor: f64,
    /// How results are rounded.
    #[serde(default)]
    rounding: Rounding,
    /// Whether to be strict about it.
    #[serde(default)]
    strict: bool,
    /// What is done at the ends.
    #[serde(default)]
    ends: Option<Ends>,
    /// Which of the above cannot be done; none by default.
    #[serde(default)]
    #[schemars(with = "String")]
    fault: String,
}

fn two() -> f64 {
    2.0
}

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Rounding {
    /// They are not.
    #[default]
    None,
    /// To whole numbers.
    Whole,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
enum Ends {
    /// Nothing.
    Free {},
    /// They are cut off.
    Cut {},
}

impl Feature for Gain {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "what is passed on")] }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let channels = inputs.port("signal").to_vec();
        let name = "signal";
        Ok(vec![OutputPort { name, channels }])
    }

    fn build(&self, _inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        let cannot = match self.fault.as_str() {
            "rounding" => self.rounding == Rounding::Whole,
            "strict" => self.strict,
            "ends" => self.ends == Some(Ends::Cut {}),
            _ => false,
        };
        assert!(!cannot, "not written yet");
        Box::new(Passing {
            factor: self.factor,
        })
    }
}

struct Passing {
    factor: f64,
}

impl Operator for Passing {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        for (i, &value) in tick.port(0).iter().enumerate() {
            if !value.is_nan() {
                outputs.set(i, self.factor * value);
            }
        }
    }

    fn segment(&mut self) {}
}

athermal_core::register!(Gain, Feature, "sabotaged_choices");

#[test]
fn a_default_out_of_its_own_range_is_found_though_no_case_leaves_it_out() {
    breaks_only::<Gain>(Case::new("factor = 0.5"), &[Rule::Explained]);
    let broken = broken::<Gain>(&[Case::new("factor = 0.5")]);
    let words = "by default `factor` is 2 and must be from 0 to 1";
    assert_eq!(broken[0].found, words, "{broken:#?}");
}

#[test]
fn a_word_a_switch_and_a_tagged_table_that_no_case_tries_are_tried() {
    for (fault, value) in [
        ("rounding", "`rounding = \"whole\"`"),
        ("strict", "`strict = true`"),
        ("ends", "`ends = { type = \"cut\" }`"),
    ] {
        let broken = broken::<Gain>(&[Case::new(format!("factor = 0.5\nfault = \"{fault}\""))]);
        let told = format!("with {value} it panics: not written yet");
        assert!(
            broken.iter().any(|broken| broken.found.contains(&told)),
            "{broken:#?}"
        );
    }
}
