//! A feature that bridges gaps and is sound, and the same with one fault at a time.

use super::*;

faulty! {
    /// Each channel, and where that has no value its last one, as old as it is.
    struct Bridge;
    /// Gives the last value as if it were of now.
    Now,
    /// As old as what other channels have.
    Others,
    /// Gives zero.
    Zero,
}

impl Feature for Bridge {
    passes_on!("what is passed on" => "bridged");

    fn is_endless(&self) -> bool {
        true
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        Box::new(Bridging {
            fault: self.fault,
            last: vec![None; inputs.port("signal").len()],
        })
    }
}

struct Bridging {
    fault: Fault,
    last: Vec<Option<(f64, Instant)>>,
}

impl Operator for Bridging {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let samples = tick.port(0).iter().zip(tick.stamps(0)).enumerate();
        for (i, (&value, &stamp)) in samples {
            if value.is_finite() {
                self.last[i] = Some((value, stamp));
                outputs.set_stamped(i, value, stamp);
            } else if let Some((last, stamp)) = self.last[i] {
                match self.fault {
                    Fault::None => outputs.set_stamped(i, last, stamp),
                    Fault::Now => outputs.set_stamped(i, last, tick.now),
                    Fault::Others => outputs.set(i, last),
                    Fault::Zero => outputs.set_stamped(i, 0.0, tick.now),
                }
            }
        }
    }

    fn segment(&mut self) {
        self.last.fill(None);
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        let last = self.last.clone();
        Some(Box::new(Known { last }))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        state.accept(|known: Known| {
            let fits = known.last.len() == self.last.len();
            fits.then(|| self.last = known.last)
                .ok_or("the number of channels differs")
        })
    }
}

#[derive(Debug, Serialize, Deserialize)]
struct Known {
    last: Vec<Option<(f64, Instant)>>,
}

athermal_core::state!(Known, "sabotaged_gaps/1");
athermal_core::register!(Bridge, Feature, "sabotaged_gaps");

#[test]
fn a_gap_may_be_bridged_by_a_value_that_is_as_old_as_it_is() {
    breaks_only::<Bridge>(with("none"), &[]);
}

#[test]
fn what_bridges_a_gap_as_if_it_were_new_is_found() {
    for fault in ["now", "others", "zero"] {
        breaks_one::<Bridge>(
            with(fault),
            Rule::Stamps,
            "is made of has been measured after",
        );
    }
}
