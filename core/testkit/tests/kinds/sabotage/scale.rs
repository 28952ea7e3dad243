//! A sound feature that takes temperatures on one scale, which no factor turns into another.

use super::*;

/// The saturation vapour pressure over water by the formula of Magnus.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Magnus {}

impl Feature for Magnus {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("air", "the temperature of the air").in_unit("Cel")] }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let mut channels = inputs.port("air").to_vec();
        for channel in &mut channels {
            channel.unit = Unit::parse("hPa").unwrap();
        }
        let name = "pressure";
        Ok(vec![OutputPort { name, channels }])
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::Own
    }

    fn build(&self, _inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        Box::new(Saturation)
    }
}

struct Saturation;

impl Operator for Saturation {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        for (i, &air) in tick.port(0).iter().enumerate() {
            if !air.is_nan() {
                outputs.set(i, 6.1094 * (17.625 * air / (243.04 + air)).exp());
            }
        }
    }

    fn segment(&mut self) {}
}

athermal_core::register!(Magnus, Feature, "sound_scale");

#[test]
fn a_port_whose_unit_stands_alone_is_fed_in_no_other() {
    breaks_only::<Magnus>(Case::new(""), &[]);
}
