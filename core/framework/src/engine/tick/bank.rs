//! Linear estimators that are predicted at once, to the bits of [each alone](super::estimate).
//!
//! A second way to predict has to earn its place: it saves a seventh to a quarter of a tick of the die tester (`benches/budgets`).

use super::context::TickContext;
use super::edge::Edge;
use super::estimate::given;
use super::gather::Gathered;
use super::part::Part;
use super::products::Products;
use super::runner::NodeRunner;
use crate::compile::{Plan, Step};
use crate::node::LinearForm;
use crate::time::Instant;

/// What is done at a tick, in order.
pub(crate) enum Work {
    /// As it was planned.
    Step(Step),
    /// Several steps of the plan that follow each other.
    Bank(Box<Bank>),
    /// What was given up after a panic.
    Nothing,
}

/// The steps of a plan, in which linear estimators that follow each other and share their first regressors, or each have a few of
/// their own, are one.
pub(crate) fn work(plan: &Plan, nodes: &[NodeRunner]) -> Box<[Work]> {
    let mut work = Vec::new();
    let mut bank: Vec<Linear<'_>> = Vec::new();
    for step in &plan.steps {
        let linear = match *step {
            Step::Run(node) => Linear::of(node, &nodes[node]),
            // What reads nothing of what they write may as well come before.
            Step::Gather(gather) => {
                let entries = &plan.gathers[gather].entries;
                let reads = |of: &Linear<'_>| {
                    let written = &plan.nodes[of.node].slots;
                    entries.iter().any(|entry| written.contains(&entry.slot))
                };
                if bank.iter().any(reads) {
                    close(&mut bank, &mut work);
                }
                work.push(Work::Step(*step));
                continue;
            }
            Step::Capture(_) => None,
        };
        let shared = linear.as_ref().map(|linear| &linear.shared);
        if bank.first().is_some_and(|of| shared != Some(&of.shared)) {
            close(&mut bank, &mut work);
        }
        match linear {
            Some(linear) => bank.push(linear),
            None => work.push(Work::Step(*step)),
        }
    }
    close(&mut bank, &mut work);
    work.into()
}

fn close(bank: &mut Vec<Linear<'_>>, work: &mut Vec<Work>) {
    work.extend(match &std::mem::take(bank)[..] {
        [] => None,
        [one] => Some(Work::Step(Step::Run(one.node))),
        members => Some(Work::Bank(Box::new(Bank::new(members)))),
    });
}

/// An estimator that is a linear form, of which others may share the first regressors.
struct Linear<'a> {
    node: usize,
    slot: usize,
    trigger: Option<usize>,
    learns: bool,
    edge: Option<Edge>,
    novelty: Option<usize>,
    form: LinearForm<'a>,
    shared: Option<&'a Part>,
    own: &'a [Part],
}

impl<'a> Linear<'a> {
    /// The fewest regressors of which the products of several estimators are worth being summed at once.
    const MANY: usize = 8;

    fn of(node: usize, running: &'a NodeRunner) -> Option<Self> {
        let NodeRunner::Estimate(running) = running else {
            return None;
        };
        let estimate = running.estimate.as_ref()?;
        // Without regressors there is no oldest stamp.
        let form = estimate
            .form()
            .filter(|form| !form.coefficients.is_empty())?;
        let (shared, own) = match estimate.parts() {
            [first, own @ ..] if first.is_side_by_side() && first.len() >= Self::MANY => {
                (Some(first), own)
            }
            own => (None, own),
        };
        Some(Self {
            node,
            slot: running.slot,
            trigger: running.trigger,
            learns: estimate.learning.is_some(),
            edge: estimate.edge,
            novelty: running.novelty,
            form,
            shared,
            own,
        })
    }
}

/// Linear estimators that follow each other, and whose first regressors are the same values.
pub(crate) struct Bank {
    shared: Option<Part>,
    /// Of as many of the shared regressors as are a multiple of four.
    products: Products,
    at_once: usize,
    members: Box<[Member]>,
    /// Room for the other regressors of a member.
    row: Box<[f64]>,
    /// Room for all of them.
    all: Box<[f64]>,
}

/// One of the estimators of a bank.
struct Member {
    node: usize,
    slot: usize,
    /// The gather that lets it run, unless it does at every tick.
    trigger: Option<usize>,
    learns: bool,
    /// The edge of the rows of its fit, where that is heeded.
    edge: Option<Edge>,
    /// The slot of how far it is outside of them, where somebody reads it.
    novelty: Option<usize>,
    constant: f64,
    /// Of the regressors whose products are not summed at once.
    coefficients: Box<[f64]>,
    /// The regressors that it does not share: in the first part, and in others.
    own: Option<Part>,
    more: Box<[Part]>,
    /// Whether all were there when it ran last.
    whole: bool,
}

impl Bank {
    /// Lets a node go, where it is one of it.
    pub(crate) fn remove(&mut self, node: usize) {
        let members = std::mem::take(&mut self.members).into_iter();
        self.members = members.filter(|member| member.node != node).collect();
    }

    fn new(members: &[Linear<'_>]) -> Self {
        let shared = members[0].shared.cloned();
        let at_once = shared.as_ref().map_or(0, |part| part.len() / 4 * 4);
        let forms = members.iter().map(|of| &of.form.coefficients[..at_once]);
        let products = Products::new(&forms.collect::<Vec<_>>());
        let of_member = |of: &Linear<'_>| Member {
            node: of.node,
            slot: of.slot,
            trigger: of.trigger,
            learns: of.learns,
            edge: of.edge,
            novelty: of.novelty,
            constant: of.form.constant,
            coefficients: of.form.coefficients[at_once..].into(),
            own: of.own.first().cloned(),
            more: of.own.iter().skip(1).cloned().collect(),
            whole: true,
        };
        let members: Box<[_]> = members.iter().map(of_member).collect();
        let others = members.iter().map(|member| member.coefficients.len());
        let most = others.max().unwrap_or(0);
        Self {
            row: vec![0.0; most].into(),
            all: vec![0.0; at_once + most].into(),
            shared,
            products,
            at_once,
            members,
        }
    }

    /// Lets those of its estimators that learn do so, and predicts those that run at a tick.
    pub(crate) fn run(&mut self, context: &mut TickContext<'_>, nodes: &mut [NodeRunner]) {
        self.learn(context, nodes);
        if !self.predict(context, nodes) {
            for member in self.members.iter().filter(|of| !of.whole) {
                context.at_work.is(member.node);
                context.run(&mut nodes[member.node]);
            }
        }
    }

    #[inline]
    fn learn(&mut self, context: &mut TickContext<'_>, nodes: &mut [NodeRunner]) {
        let learning = self.members.iter_mut().enumerate();
        for (nth, member) in learning.filter(|(_, of)| of.learns) {
            if let Some(estimate) = nodes[member.node].estimate_mut()
                && let Some(learning) = estimate.learning()
            {
                context.at_work.is(member.node);
                context.learn(learning, member.slot);
                if learning.has_changed()
                    && let Some(form) = estimate.form()
                {
                    let (at_once, others) = form.coefficients.split_at(self.at_once);
                    self.products.set(nth, at_once);
                    member.coefficients.copy_from_slice(others);
                    member.constant = form.constant;
                }
            }
        }
    }

    /// Predicts those all of whose regressors are known to be there; false where there are others.
    #[inline]
    fn predict(&mut self, context: &mut TickContext<'_>, nodes: &mut [NodeRunner]) -> bool {
        let (gathered, now) = (&*context.gathered, context.now);
        let shared = match &self.shared {
            None => Some((&[][..], Instant::MAX)),
            Some(part) => part.in_place(gathered),
        };
        let Some((shared, stamp)) = shared else {
            self.members.iter_mut().for_each(|of| of.whole = false);
            return false;
        };
        let (at_once, left) = shared.split_at(self.at_once);
        let sums = self.products.sum(at_once);
        let mut all = true;
        for (member, sums) in self.members.iter_mut().zip(sums) {
            if member.trigger.is_some_and(|gather| !gathered[gather].fresh) {
                continue;
            }
            let others = member.others(left, gathered, &mut self.row);
            member.whole = others.is_some();
            let Some((others, oldest)) = others else {
                all = false;
                continue;
            };
            if member.learns
                && let Some(learning) = nodes[member.node].learning()
            {
                context.at_work.is(member.node);
                learning.ran([at_once, others], now, gathered, !context.frozen);
            }
            let mut prediction = member.constant + sums.sum(&member.coefficients, others);
            let mut novelty = f64::NAN;
            if let Some(edge) = member.edge
                && let Some(estimate) = nodes[member.node].estimate()
            {
                let row = &mut self.all[..at_once.len() + others.len()];
                let (first, rest) = row.split_at_mut(at_once.len());
                first.copy_from_slice(at_once);
                rest.copy_from_slice(others);
                novelty = estimate.novelty_of(row);
                prediction = edge.bounded(prediction, novelty, || estimate.centre(now));
            }
            let (value, stamp) = given(prediction, stamp.min(oldest), now);
            context.slots.set(member.slot, value, stamp);
            if let Some(slot) = member.novelty {
                context.slots.set(slot, novelty, stamp);
            }
        }
        all
    }
}

impl Member {
    /// The regressors whose products are not summed at once, what is left of those that it shares and its own, and the oldest stamp
    /// of its own; nothing where one of them is not there.
    #[inline]
    fn others<'a>(
        &self,
        left: &'a [f64],
        gathered: &'a [Gathered],
        row: &'a mut [f64],
    ) -> Option<(&'a [f64], Instant)> {
        let Some(own) = &self.own else {
            return Some((left, Instant::MAX));
        };
        if left.is_empty()
            && self.more.is_empty()
            && let Some(there) = own.in_place(gathered)
        {
            return Some(there);
        }
        let row = &mut row[..self.coefficients.len()];
        let (first, mut rest) = row.split_at_mut(left.len());
        first.copy_from_slice(left);
        let mut oldest = Instant::MAX;
        for part in std::iter::once(own).chain(&self.more) {
            let (piece, others) = rest.split_at_mut(part.len());
            rest = others;
            let (whole, stamp) = part.read(gathered, piece);
            if !whole {
                return None;
            }
            oldest = oldest.min(stamp);
        }
        Some((row, oldest))
    }
}
