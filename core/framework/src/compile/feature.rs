//! Decides what a feature of a graph is given and what it gives.

use super::plan::PlannedRole;
use super::provenance::Provenance;
use super::resolver::{Instance, Resolver};
use crate::node::{Feature, Read};
use crate::time::Duration;

impl Resolver<'_> {
    /// Resolves a feature. One that closes a loop is given its inputs later, and knows none of them here.
    pub(super) fn feature(
        &mut self,
        instance: &Instance<'_>,
        feature: &dyn Feature,
        closes: bool,
    ) -> Option<()> {
        let mut ports = Vec::new();
        let mut gathers = Vec::new();
        let mut whole = true;
        for port in (instance.kind.inputs)() {
            if closes {
                ports.push((*port, Vec::new()));
                continue;
            }
            let Some(slots) = self.slots(instance, port) else {
                whole = false;
                continue;
            };
            if port.read != Read::Truth {
                let unit = Self::port_unit(port);
                match self.gather(instance, port, &slots, &[Duration::ZERO], unit.as_ref()) {
                    Some(gather) => gathers.push(gather),
                    None => whole = false,
                }
            }
            ports.push((*port, slots));
        }
        if !whole {
            return None;
        }
        let slots: Vec<usize> = ports
            .iter()
            .flat_map(|(_, slots)| slots.iter().copied())
            .collect();
        let inputs = self.inputs(instance, ports);
        let outputs = match feature.outputs(&inputs) {
            Ok(outputs) => outputs,
            Err(mistakes) => {
                self.mistakes(instance, mistakes);
                return None;
            }
        };
        self.doubts(instance, feature.warnings(&inputs));
        let channels = outputs.iter().map(|port| port.channels.len());
        let behind = self.behind(&slots, channels, feature.delay());
        let role = PlannedRole::Feature {
            inputs,
            gathers,
            wanted: vec![true; outputs.len()],
            every_tick: feature.every_tick(),
            closes_loops: feature.closes_loops(),
        };
        self.add(instance, outputs, role, behind, None)
    }

    /// What is behind each output. A port with as many channels as there are inputs, or a multiple, is taken to compute
    /// each from its own input, in order; any other mixes all inputs.
    pub(super) fn behind(
        &self,
        slots: &[usize],
        ports: impl Iterator<Item = usize>,
        delay: Duration,
    ) -> Vec<Provenance> {
        let mut behind = Vec::new();
        for channels in ports {
            if !slots.is_empty() && channels % slots.len() == 0 {
                let each = channels / slots.len();
                for &slot in slots {
                    let own = Provenance::of([(&self.provenance[slot], delay)]);
                    behind.extend(std::iter::repeat_n(own, each));
                }
            } else {
                let all = Provenance::of(slots.iter().map(|&slot| (&self.provenance[slot], delay)));
                behind.extend(std::iter::repeat_n(all, channels));
            }
        }
        behind
    }
}
