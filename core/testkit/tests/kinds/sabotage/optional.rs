//! A feature with a port that a graph may leave out and is sound, and the same with one fault at a time.

use super::*;

faulty! {
    /// Each channel less its own offset, where there are offsets.
    struct Offset;
    /// Cannot do with offsets.
    Panics,
}

impl Feature for Offset {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::fresh("signal", "what is passed on"),
                InputPort::held("offset", "what is taken off each channel").or_none(),
            ]
        }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let (channels, offsets) = (inputs.port("signal"), inputs.port("offset"));
        if !offsets.is_empty() && offsets.len() != channels.len() {
            let message = "there must be as many offsets as channels";
            return Err(vec![Mistake::at("inputs.offset", message)]);
        }
        let mut pairs = channels.iter().zip(offsets);
        if !pairs.all(|(channel, offset)| channel.unit == offset.unit) {
            let message = "the offsets must be in the unit of the channels";
            return Err(vec![Mistake::at("inputs.offset", message)]);
        }
        Ok(vec![OutputPort {
            name: "rest",
            channels: channels.to_vec(),
        }])
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::Own
    }

    fn build(&self, _inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        Box::new(Taking { fault: self.fault })
    }
}

struct Taking {
    fault: Fault,
}

impl Operator for Taking {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let offsets = tick.port(1);
        let broken = self.fault == Fault::Panics && !offsets.is_empty();
        assert!(!broken, "there are offsets");
        for (i, &value) in tick.port(0).iter().enumerate() {
            if !value.is_nan() {
                outputs.set(i, value - offsets.get(i).copied().unwrap_or(0.0));
            }
        }
    }

    fn segment(&mut self) {}
}

athermal_core::register!(Offset, Feature, "sabotaged_optional");

#[test]
fn a_sound_node_with_a_port_that_may_be_left_out_breaks_no_rule() {
    breaks_only::<Offset>(with("none"), &[]);
    // As many offsets as channels, and in their unit.
    breaks_only::<Offset>(with("none").input("signal", 4, "K"), &[]);
}

#[test]
fn a_port_that_no_case_connects_is_connected() {
    finds::<Offset>(
        with("panics").input("signal", 4, "mK"),
        Rule::Answers,
        "it panics: there are offsets",
    );
    let broken = broken::<Offset>(&[with("panics")]);
    let told = "# with what a graph may leave out: `offset` in nm\nfault = \"panics\"";
    assert_eq!(broken[0].case.as_deref(), Some(told));
}

#[test]
fn a_case_that_connects_a_port_is_enough() {
    let broken = broken::<Offset>(&[with("none"), with("none").input("offset", 2, "nm")]);
    assert_eq!(broken, []);
}
