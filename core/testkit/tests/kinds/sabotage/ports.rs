//! A feature of several ports that is sound, and the same with one fault at a time.

use super::*;

faulty! {
    /// Each channel once, twice and thrice.
    struct Multiples;
    /// Moves ports up where others before them are not read.
    Packs,
    /// Reads the second channel.
    NeedsTwo,
    /// Never gives the second channel of its last port.
    Skips,
}

const PORTS: [&str; 3] = ["once", "twice", "thrice"];

impl Feature for Multiples {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "what is multiplied")] }
    }

    fn ports() -> &'static [PortSummary] {
        const {
            &[
                PortSummary::new("once", "each channel"),
                PortSummary::new("twice", "each channel times two"),
                PortSummary::new("thrice", "each channel times three"),
            ]
        }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let channels = || inputs.port("signal").to_vec();
        Ok(PORTS
            .map(|name| OutputPort {
                name,
                channels: channels(),
            })
            .into())
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::Own
    }

    fn build(&self, inputs: &Inputs, wanted: &[bool]) -> Box<dyn Operator> {
        let mut place = 0;
        let places = wanted.iter().map(|&wanted| {
            let own = place;
            if wanted || self.fault != Fault::Packs {
                place += inputs.port("signal").len();
            }
            wanted.then_some(own)
        });
        Box::new(Multiplying {
            places: places.collect(),
            fault: self.fault,
        })
    }
}

struct Multiplying {
    /// Where each port begins that is read.
    places: Vec<Option<usize>>,
    fault: Fault,
}

impl Operator for Multiplying {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        if self.fault == Fault::NeedsTwo {
            let _ = tick.port(0)[1];
        }
        for (nth, place) in self.places.iter().enumerate() {
            let Some(place) = place else { continue };
            for (i, &value) in tick.port(0).iter().enumerate() {
                let skipped = self.fault == Fault::Skips && (nth, i) == (2, 1);
                if !value.is_nan() && !skipped {
                    outputs.set(place + i, value * (nth + 1) as f64);
                }
            }
        }
    }

    fn segment(&mut self) {}
}

athermal_core::register!(Multiples, Feature, "sabotaged_ports");

/// The same, without a word of its ports.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Wordless {}

impl Feature for Wordless {
    fn inputs() -> &'static [InputPort] {
        Multiples::inputs()
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        Multiples { fault: Fault::None }.outputs(inputs)
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::Own
    }

    fn build(&self, inputs: &Inputs, wanted: &[bool]) -> Box<dyn Operator> {
        Multiples { fault: Fault::None }.build(inputs, wanted)
    }
}

athermal_core::register!(Wordless, Feature, "sabotaged_wordless_ports");

#[test]
fn ports_of_several_that_a_user_is_not_told_are_found() {
    breaks::<Wordless>(Case::new(""), Rule::Names, "`twice` is not among");
}

#[test]
fn a_sound_node_of_several_ports_breaks_no_rule() {
    breaks_only::<Multiples>(with("none"), &[]);
}

#[test]
fn a_port_that_moves_where_another_is_not_read_is_found() {
    breaks::<Multiples>(
        with("packs"),
        Rule::Wanted,
        "beside its first port only `thrice` is read",
    );
}

#[test]
fn a_channel_that_no_case_gives_a_value_is_found() {
    breaks_one::<Multiples>(
        with("skips"),
        Rule::Answers,
        "`node:thrice.b` has no value at any tick of any case",
    );
    breaks_only::<Multiples>(with("skips").input("signal", 1, "K"), &[]);
    let cases = [with("skips").input("signal", 3, "K"), with("none")];
    let broken = broken::<Multiples>(&cases);
    assert_eq!(broken, [], "it has one in the other case");
}

#[test]
fn a_node_that_takes_for_granted_how_many_channels_come_is_found() {
    breaks::<Multiples>(with("needs_two"), Rule::Widths, "panics");
}
