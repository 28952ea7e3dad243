//! Decides what a feature of a graph is given and what it gives.

use super::instance::Instance;
use super::plan::PlannedRole;
use super::provenance::Provenance;
use super::resolver::Resolver;
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
        let data = ports.iter().filter(|(port, _)| port.read != Read::Truth);
        let slots: Vec<Vec<usize>> = data.map(|(_, slots)| slots.clone()).collect();
        let inputs = self.inputs(instance, ports);
        let outputs = match feature.outputs(&inputs) {
            Ok(outputs) => outputs,
            Err(mistakes) => {
                self.mistakes(instance, mistakes);
                return None;
            }
        };
        self.doubts(instance, feature.warnings(&inputs));
        let widths = outputs.iter().map(|port| (port.name, port.channels.len()));
        let behind = self.behind(feature, &slots, widths);
        let role = PlannedRole::Feature {
            inputs,
            gathers,
            wanted: vec![true; outputs.len()],
            every_tick: feature.every_tick(),
            closes_loops: feature.closes_loops(),
        };
        self.add(instance, outputs, role, behind, None)
    }

    /// What is behind each channel of a feature's output ports, given the slots of each input port.
    pub(super) fn behind(
        &self,
        feature: &dyn Feature,
        inputs: &[Vec<usize>],
        ports: impl Iterator<Item = (&'static str, usize)>,
    ) -> Vec<Provenance> {
        let mut behind: Vec<Provenance> = Vec::new();
        for (port, width) in ports {
            let reach = feature.reach(port);
            let mut before: Option<(Vec<_>, Provenance)> = None;
            for nth in 0..width {
                let parts = reach.parts(inputs, nth, width);
                // Neighbours are often made of the same, and then share it.
                let own = match before {
                    Some((same, own)) if same == parts => own,
                    _ => {
                        let of = |&(slot, delay): &(usize, _)| (&self.provenance[slot], delay);
                        Provenance::of(parts.iter().map(of))
                    }
                };
                behind.push(own.clone());
                before = Some((parts, own));
            }
        }
        behind
    }
}
