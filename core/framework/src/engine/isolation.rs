//! A node whose code panics is given up, and the graph goes on: for what runs beside a machine.

use std::any::Any;
use std::panic::resume_unwind;

use super::at_work::named;
use super::{Engine, When, Work};
use crate::compile::{PlannedNode, Step};
use crate::diagnostic::NodePanic;

impl Engine {
    /// From here on a node that panics gives nothing any more, and the others go on. Without this the panic goes on to the caller.
    pub fn isolate_panics(&mut self) {
        self.panics.get_or_insert_default();
    }

    /// The nodes that were given up, in the order of their panics.
    #[must_use]
    pub fn panics(&self) -> &[NodePanic] {
        self.panics.as_deref().unwrap_or_default()
    }

    /// Gives a node up, at the present tick.
    #[cold]
    pub(super) fn give_up(&mut self, node: usize, panic: Box<dyn Any + Send>) {
        let panic = named(self.plan.nodes.get(node), When::Tick(self.last), panic);
        match (panic.downcast::<NodePanic>(), &mut self.panics) {
            (Ok(panic), Some(panics)) => panics.push(*panic),
            (Ok(panic), None) => resume_unwind(panic),
            (Err(panic), _) => resume_unwind(panic),
        }
        self.leave_out(node);
    }

    /// Isolates nodes as another engine of the same graph does, and gives up those that it has given up.
    pub(super) fn isolate_as(&mut self, other: &Self) {
        self.panics.clone_from(&other.panics);
        let given_up =
            |node: &PlannedNode| other.panics().iter().any(|of| of.node == node.instance());
        let nodes = self.plan.nodes.iter().enumerate();
        let nodes: Vec<_> = nodes
            .filter(|(_, of)| given_up(of))
            .map(|(nth, _)| nth)
            .collect();
        nodes.into_iter().for_each(|node| self.leave_out(node));
    }

    fn leave_out(&mut self, node: usize) {
        for work in &mut self.work {
            match work {
                Work::Step(Step::Run(of) | Step::Capture(of)) if *of == node => {
                    *work = Work::Nothing;
                }
                // The others of it miss this tick.
                Work::Bank(bank) => bank.remove(node),
                Work::Step(_) | Work::Nothing => {}
            }
        }
        for slot in self.plan.nodes[node].slots.clone() {
            self.slots.set(slot, f64::NAN, self.last);
        }
        self.truths.retain(|(of, _)| *of != node);
        self.fed_back.retain(|(of, _)| *of != node);
    }
}
