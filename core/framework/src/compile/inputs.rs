//! Which slots the inputs of a node name, how old a held value may be, and what is converted on the way.

use std::collections::HashSet;

use super::conversion;
use super::instance::{Declared, Instance};
use super::misplaced::{INPUTS, misplaced};
use super::plan::{Conversion, Entry, Gather};
use super::problem;
use super::reference::Reference;
use super::resolver::Resolver;
use super::scope::Found;
use crate::channel::Channel;
use crate::diagnostic::{Place, nearest};
use crate::node::{InputPort, Inputs, Read};
use crate::time::Duration;
use crate::unit::Unit;

/// The inputs of which every channel counts once; a product may well have one twice.
pub(super) const COUNTS_ONCE: [&str; 2] = ["features", "voters"];

/// Which input of its kind one is meant to be that the kind does not have: the nearest, or where none is near, the only one that
/// is missing.
pub(super) fn meant_input(instance: &Declared<'_>, given: &str) -> Option<&'static str> {
    let ports = (instance.kind.inputs)();
    let names = ports.iter().map(|port| port.name);
    if names.clone().any(|name| name == given) {
        return None;
    }
    let is_missing = |port: &&InputPort| !port.optional && instance.input(port.name).is_none();
    let mut missing = ports.iter().filter(is_missing);
    let only = missing.next().filter(|_| missing.next().is_none());
    nearest(given, names).or(only.map(|port| port.name))
}

impl Resolver<'_> {
    /// Looks up what an input refers to: slots in order, none for an optional input left out.
    pub(crate) fn slots(
        &mut self,
        instance: &Declared<'_>,
        port: &InputPort,
    ) -> Option<Vec<usize>> {
        let Some(input) = instance.input(port.name) else {
            if port.optional {
                return Some(Vec::new());
            }
            self.missing_input(instance, port);
            return None;
        };
        let mut slots = Vec::new();
        let mut whole = true;
        for (text, place) in &input.references {
            match self.look_up(text, *place) {
                Some(found) => {
                    whole &= self.count_once(port.name, &slots, &found, *place);
                    slots.extend(found);
                }
                None => whole = false,
            }
        }
        whole.then_some(slots)
    }

    /// Reports a regressor or a vote that stands among those before it already; whether there is none.
    fn count_once(
        &mut self,
        input: &'static str,
        before: &[usize],
        found: &[usize],
        place: Place,
    ) -> bool {
        let counts = COUNTS_ONCE.contains(&input);
        let twice = found.iter().find(|slot| counts && before.contains(slot));
        if let Some(&slot) = twice {
            let channel = self.channels[slot].name.clone();
            self.diagnostics
                .report(place, problem::Repeated { channel, input });
        }
        twice.is_none()
    }

    /// Reports that an input is missing, unless it stands under a name that is reported as unknown.
    pub(super) fn missing_input(&mut self, instance: &Declared<'_>, port: &InputPort) {
        let is_meant = |given: &str| meant_input(instance, given) == Some(port.name);
        let parameters = instance.decl.parameters.as_table();
        let beside = parameters.map_or_else(Vec::new, |own| misplaced(instance.kind, own));
        if instance.decl.inputs.iter().any(|of| is_meant(&of.port))
            || (beside.iter()).any(|(_, meant)| [port.name, INPUTS].contains(meant))
        {
            return;
        }
        let problem = problem::MissingInput {
            kind: instance.kind.name,
            input: port.name,
            summary: port.summary,
        };
        self.diagnostics.report(instance.node.place, problem);
    }

    pub(super) fn look_up(&mut self, text: &str, place: Place) -> Option<Vec<usize>> {
        match self.scopes.look_up(text) {
            Ok(Found::Slots(slots)) => {
                self.read.extend(slots.iter().copied());
                Some(slots)
            }
            Ok(Found::Broken) => None,
            Err(problem) => {
                self.diagnostics.report_unless_known(place, problem);
                None
            }
        }
    }

    /// The one slot of an input that takes a single channel.
    pub(crate) fn single(&mut self, instance: &Instance<'_>, port: &InputPort) -> Option<usize> {
        let slots = self.slots(instance, port)?;
        self.one_of(instance, port, &slots)
    }

    /// The one of these slots; several or none are reported.
    pub(super) fn one_of(
        &mut self,
        instance: &Declared<'_>,
        port: &InputPort,
        slots: &[usize],
    ) -> Option<usize> {
        if let [slot] = slots[..] {
            return Some(slot);
        }
        self.wrong_count(instance, port.name, slots, "one channel");
        None
    }

    /// Tells that an input takes another number of channels than it is given.
    pub(super) fn wrong_count(
        &mut self,
        instance: &Declared<'_>,
        input: &'static str,
        slots: &[usize],
        expected: &'static str,
    ) {
        let name = |&slot: &usize| self.channels[slot].name.clone();
        let problem = problem::ChannelCount {
            input,
            found: slots.iter().map(name).collect(),
            expected,
        };
        let place = instance.input_place(input);
        self.diagnostics.report(place, problem);
    }

    /// Tells of ages at ports that hold nothing.
    pub(super) fn idle_ages(&mut self, instance: &Instance<'_>) {
        let ports = (instance.kind.inputs)().iter();
        for port in ports.filter(|port| port.read == Read::Fresh) {
            let given = instance.input(port.name).and_then(|input| input.max_age);
            if let Some((_, place)) = given {
                let problem = problem::Doubt {
                    message: format!(
                        "`max_age` does nothing here: `inputs.{}` takes new values only, and holds none",
                        port.name
                    ),
                    help: Some("leave `max_age` out".to_owned()),
                };
                self.diagnostics.report(place, problem);
            }
        }
    }

    /// How long a held value of each slot counts at an input; `None` where that is not known of one, which is reported once for each signal
    /// and node.
    pub(super) fn max_ages(
        &mut self,
        instance: &Declared<'_>,
        port: &str,
        slots: &[usize],
    ) -> Option<Vec<Duration>> {
        let stated = instance
            .input(port)
            .and_then(|input| input.max_age)
            .map(|(age, _)| age);
        let age = |slot: &usize| stated.or_else(|| self.channels[*slot].channel.default_max_age());
        let ages: Vec<Option<Duration>> = slots.iter().map(age).collect();
        let mut reported = HashSet::new();
        for (&slot, _) in slots.iter().zip(&ages).filter(|(_, age)| age.is_none()) {
            let channel = self.channels[slot].name.clone();
            let of = Reference::parse(&channel).whole_node().into_owned();
            if !reported.insert(of) {
                continue;
            }
            let mut behind = self.provenance[slot].sources();
            let unbounded = behind.find(|(of, _)| self.channels[*of].channel.max_age.is_none());
            let signal =
                unbounded.map(|(of, _)| Reference::parse(&self.channels[of].name).node.to_owned());
            let problem = problem::NoMaxAge {
                channel,
                input: port.to_owned(),
                signal,
            };
            self.diagnostics.report(instance.input_place(port), problem);
        }
        ages.into_iter().collect()
    }

    /// The gather that reads these slots at one lag.
    pub(crate) fn gather(
        &mut self,
        instance: &Instance<'_>,
        port: &InputPort,
        slots: &[usize],
        lags: &[Duration],
        unit: Option<&Unit>,
    ) -> Option<usize> {
        let conversions = self.conversions(instance, port, slots, lags.len(), unit);
        let ages = match port.read {
            Read::Fresh if lags.iter().all(|lag| !lag.is_negative()) => {
                Some(vec![Duration::ZERO; slots.len()])
            }
            Read::Fresh => self.max_ages(instance, port.name, slots),
            Read::Held | Read::Truth => self.max_ages(instance, port.name, slots),
        };
        let (conversions, ages) = (conversions?, ages?);
        let mut entries = Vec::with_capacity(slots.len() * lags.len());
        for &lag in lags {
            for (&slot, &max_age) in slots.iter().zip(&ages) {
                entries.push(Entry { slot, lag, max_age });
                if lag > Duration::ZERO {
                    let history = &mut self.channels[slot].history;
                    *history = Some(history.map_or(lag, |deepest| deepest.max(lag)));
                }
            }
        }
        let read = if port.read == Read::Fresh {
            Read::Fresh
        } else {
            Read::Held
        };
        let gather = Gather {
            read,
            entries,
            conversions,
            rare: Vec::new(),
        };
        Some(self.gathers.insert_full(gather).0)
    }

    /// What it takes to give slots, at so many lags, in a unit; `None` when one does not convert, which has been reported.
    pub(super) fn conversions(
        &mut self,
        instance: &Declared<'_>,
        port: &InputPort,
        slots: &[usize],
        lags: usize,
        unit: Option<&Unit>,
    ) -> Option<Vec<Conversion>> {
        let Some(unit) = unit else {
            return Some(Vec::new());
        };
        let channels = slots.iter().map(|&slot| &self.channels[slot]);
        let channels = channels.map(|from| (from.name.as_str(), &from.channel.unit));
        let wanted_by = format!("inputs.{}", port.name);
        match conversion::conversions(channels, unit, &wanted_by) {
            Ok(conversions) => {
                let at_lag = |lag: usize| {
                    conversions.iter().map(move |conversion| {
                        Conversion::new(lag * slots.len() + conversion.entry, conversion.factor())
                    })
                };
                Some((0..lags).flat_map(at_lag).collect())
            }
            Err(problems) => {
                for problem in problems {
                    let place = instance.input_place(port.name);
                    self.diagnostics.report(place, problem);
                }
                None
            }
        }
    }

    /// The unit that an input port declares.
    pub(crate) fn port_unit(port: &InputPort) -> Option<Unit> {
        let unit = port.unit.and_then(|unit| unit.parse().ok());
        debug_assert_eq!(unit.is_some(), port.unit.is_some(), "a kind declares units");
        unit
    }

    /// The channels of slots, as kinds see them.
    pub(crate) fn inputs(
        &self,
        instance: &Declared<'_>,
        ports: Vec<(InputPort, Vec<usize>)>,
    ) -> Inputs {
        let name = |&slot: &usize| self.channels[slot].name.clone();
        let names = ports
            .iter()
            .map(|(_, slots)| slots.iter().map(name).collect());
        let names = names.collect();
        let channels = |port: InputPort, slots: Vec<usize>| {
            let unit = Self::port_unit(&port);
            let channels = slots.into_iter().map(|slot| {
                let channel = self.channels[slot].channel.clone();
                let unit = unit.clone().unwrap_or_else(|| channel.unit.clone());
                Channel { unit, ..channel }
            });
            (port, channels.collect())
        };
        Inputs {
            ports: ports
                .into_iter()
                .map(|(port, slots)| channels(port, slots))
                .collect(),
            member: instance.decl.member.clone(),
            hindsight: None,
            fit: None,
            names,
        }
    }
}
