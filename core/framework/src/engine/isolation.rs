//! A node whose code panics is given up, and the graph goes on: for what runs beside a machine.

use std::any::Any;
use std::panic::resume_unwind;

use super::at_work::named;
use super::{Engine, When, Work};
use crate::compile::Step;
use crate::diagnostic::NodePanic;

/// Whether nodes that panic are given up, and which were.
#[derive(Debug, Default)]
pub(super) struct Isolation {
    is_on: bool,
    panics: Vec<NodePanic>,
}

impl Engine {
    /// From here on a node that panics gives nothing any more, and the others go on. Without this the panic goes on to the caller.
    pub fn isolate_panics(&mut self) {
        self.isolation.is_on = true;
    }

    /// The nodes that were given up, in the order of their panics.
    #[must_use]
    pub fn panics(&self) -> &[NodePanic] {
        &self.isolation.panics
    }

    /// Gives a node up, at the present tick.
    #[cold]
    pub(super) fn give_up(&mut self, node: usize, panic: Box<dyn Any + Send>) {
        match named(self.plan.nodes.get(node), When::Tick(self.last), panic) {
            Ok(panic) if self.isolation.is_on => self.isolation.panics.push(panic),
            Ok(panic) => resume_unwind(Box::new(panic)),
            Err(panic) => resume_unwind(panic),
        }
        for work in &mut self.work {
            let is_its = match work {
                Work::Step(Step::Run(of) | Step::Capture(of)) => *of == node,
                Work::Bank(bank) => bank.has(node),
                Work::Step(Step::Gather(_)) | Work::Nothing => false,
            };
            if is_its {
                *work = Work::Nothing;
            }
        }
        for slot in self.plan.nodes[node].slots.clone() {
            self.slots.set(slot, f64::NAN, self.last);
        }
        self.truths.retain(|(of, _)| *of != node);
        self.fed_back.retain(|(of, _)| *of != node);
    }
}
