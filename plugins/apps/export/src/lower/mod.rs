//! Lowers a plan and its fit to what a controller can step: which kinds there are, and how much room their past takes.

mod cross_check;
mod estimators;
mod features;
mod votes;
mod ways;
mod windowed;

use std::ops::Range;

use athermal_core::compile::{Periods, Plan, PlannedNode, PlannedRole, Rates, Step as PlannedStep};
use athermal_core::engine::Engine;
use athermal_core::node::Read;
use athermal_core::time::Duration;

pub(crate) use estimators::{KNOWN, WINDOWS};

use crate::error::{ExportError, Refusal};
use crate::form::{Bundle, Entry, Form, History, Layout, Port, Record, Step};

/// Room beyond what regular ticks take.
const SPARE: usize = 8;

/// What is exported, and how.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// The time between two samples, of which the room for the past follows.
    pub rates: Rates,
    /// Whether what goes on learning is exported as it was fitted.
    pub frozen: bool,
    /// Whether sums of slopes are kept from tick to tick.
    pub fast: bool,
    /// The name of the files and functions; by default that of the graph.
    pub name: Option<String>,
}

/// Why a node is not exported, and what to do.
type Refused = (String, String);

/// The plan of an engine with its fit, as a controller steps it.
///
/// # Errors
/// Where a node has no counterpart on a controller: all such nodes are named. Where samples come so often that the past has no room.
pub fn lower(engine: &Engine, options: &Options) -> Result<Form, ExportError> {
    let plan = engine.plan();
    let periods = Periods::new(plan, &options.rates)?;
    let mut lowering = Lowering::new(plan, periods);
    let mut refusals = Vec::new();
    let mut places = Vec::with_capacity(plan.nodes.len());
    let mut nodes = Vec::new();
    for node in &plan.nodes {
        places.push(nodes.len());
        let found = lowering.node(engine, node, options);
        let mut all = std::mem::take(&mut lowering.also);
        found.map_or_else(|why| all.push(why), |record| nodes.push(record));
        for (why, way) in all {
            Refusal::count(&mut refusals, &node.name, node.instance(), why, way);
        }
    }
    for source in plan.sources.iter().filter(|of| of.planned.is_some()) {
        let signal = source.name.split('.').next().unwrap_or(&source.name);
        let why = "a signal that is known ahead cannot be exported".to_owned();
        let way = "leave out `known_ahead`, and read it as it is measured".to_owned();
        Refusal::count(&mut refusals, signal, source.name.clone(), why, way);
    }
    let title = plan.name.clone().unwrap_or_else(|| "graph".to_owned());
    let name = identifier(options.name.as_deref().unwrap_or(&title));
    if let Some(why) = taken(&name) {
        let why = format!("its files and functions cannot be called `{name}`: {why}");
        let way = "`--name` calls them otherwise".to_owned();
        Refusal::count(&mut refusals, &title, title.clone(), why, way);
    }
    if !refusals.is_empty() {
        return Err(ExportError::Nodes(refusals));
    }
    let windowed = lowering.windowed(&nodes);
    // What is needed within a step lies behind all else.
    let scratch = lowering.layout.scratch;
    lowering.layout.scratch = lowering.reals(scratch);
    // And what is made of the rest behind that.
    let saved = lowering.layout.reals;
    for node in nodes
        .iter_mut()
        .filter(|of| options.fast && of.kind == "slope")
    {
        let slots = node.place_of("room") / features::EACH + 2;
        let width = 3 + features::SUMS * node.place_of("channels");
        let kept = lowering.reals((1 + 3 * slots).saturating_mul(width));
        node.set("kept", kept);
    }
    lowering.layout.kept = lowering.layout.reals - saved;
    let layout = lowering.layout;
    if layout.ints.max(layout.reals) > i32::MAX as usize {
        let bytes = layout.bytes(8);
        return Err(ExportError::TooLarge { bytes });
    }
    let mut steps = Vec::new();
    for step in &plan.steps {
        match *step {
            PlannedStep::Gather(gather) => steps.push(Step::Gather(gather)),
            PlannedStep::Run(node) => {
                steps.push(Step::Run(places[node]));
                // Before anybody reads a truth it is known whether it is one.
                let own = |of: &Record| plan.nodes[node].slots.contains(&of.place_of("slot"));
                for truth in windowed.iter().filter(|of| own(of)) {
                    steps.push(Step::Run(nodes.len()));
                    nodes.push(truth.clone());
                }
            }
            PlannedStep::Capture(_) => {}
        }
    }
    let port = |slot: usize, name: &str| Port {
        name: name.to_owned(),
        unit: plan.channels[slot].channel.unit.to_string(),
    };
    Ok(Form {
        name,
        title,
        revision: engine.revision().to_owned(),
        sources: (plan.sources.iter().enumerate())
            .map(|(slot, source)| port(slot, &source.name))
            .collect(),
        ranges: plan.sources.iter().map(|source| source.range).collect(),
        slots: (plan.channels.iter())
            .map(|channel| channel.name.clone())
            .collect(),
        outputs: (plan.outputs.iter())
            .map(|output| port(output.slot, &output.name))
            .collect(),
        output_slots: plan.outputs.iter().map(|output| output.slot).collect(),
        steps,
        nodes,
        recorded: lowering.recorded,
        period_ns: lowering.periods.tick,
        periods_ns: lowering.periods.slots[..plan.sources.len()].to_vec(),
        warm_up_ns: plan.warm_up.as_ns(),
        gathers: lowering.gathers,
        histories: lowering.histories,
        layout,
    })
}

/// A name as an identifier of C, lower case.
#[must_use]
pub fn identifier(name: &str) -> String {
    let word = |c: char| match c.is_ascii_alphanumeric() {
        true => c.to_ascii_lowercase(),
        false => '_',
    };
    let name: String = name.chars().map(word).collect();
    match name.chars().next() {
        Some(first) if first.is_ascii_lowercase() => name,
        _ => format!("g_{name}"),
    }
}

/// Headers that a compiler may read in place of its own where a graph has their name, and targets that a build has for itself.
const TAKEN: &str = "alloca assert complex ctype endian errno fcntl features fenv float inttypes iso646 limits locale malloc math \
    memory poll pthread sched semaphore setjmp signal stdalign stdarg stdatomic stdbit stdbool stdckdint stddef \
    stdint stdio stdlib stdnoreturn string strings syslog termios tgmath threads time uchar unistd values wchar \
    wctype all clean edit_cache help install m package rebuild_cache test";

/// Why files and functions cannot have a name.
fn taken(name: &str) -> Option<&'static str> {
    match name {
        "athermal_rt" => Some("the file of the runtime has it"),
        _ if name == "at" || name.starts_with("at_") => Some("what the runtime has begins so"),
        _ if TAKEN.split(' ').any(|of| of == name) => {
            Some("a header of C or a target of the build has it")
        }
        _ => None,
    }
}

/// A plan while it is lowered.
struct Lowering<'a> {
    plan: &'a Plan,
    periods: Periods,
    gathers: Vec<Bundle>,
    histories: Vec<History>,
    recorded: usize,
    layout: Layout,
    /// Where past rows of learners lie, of all that read the same alike.
    rows: Vec<(estimators::Rows, [usize; 2])>,
    /// Why the node at hand is not exported, beside what ends its lowering: all of it is said at once.
    also: Vec<Refused>,
}

impl<'a> Lowering<'a> {
    fn new(plan: &'a Plan, periods: Periods) -> Self {
        let mut lowering = Self {
            plan,
            periods,
            gathers: Vec::new(),
            histories: Vec::new(),
            recorded: 0,
            rows: Vec::new(),
            also: Vec::new(),
            layout: Layout {
                // The first eight are those of the tick.
                ints: 8,
                ..Layout::default()
            },
        };
        let slots = plan.channels.len();
        lowering.layout.slot_ints = lowering.ints(2 * slots);
        lowering.layout.gather_ints = lowering.ints(plan.gathers.len());
        lowering.layout.rejected_ints = lowering.ints(plan.sources.len());
        lowering.layout.slot_reals = lowering.reals(slots);
        let mut of_slot = vec![None; slots];
        for (slot, channel) in plan.channels.iter().enumerate() {
            if let Some(depth) = channel.history {
                of_slot[slot] = Some(lowering.histories.len());
                let stamped = !lowering.is_stamped_now(slot);
                let period = lowering.periods.slots[slot];
                lowering.history(Some(slot), depth, period, stamped);
            }
        }
        lowering.recorded = lowering.histories.len();
        for gather in &plan.gathers {
            let mut entries: Vec<Entry> = gather
                .entries
                .iter()
                .map(|entry| Entry {
                    slot: entry.slot,
                    history: of_slot[entry.slot].filter(|_| !entry.lag.is_zero()),
                    lag_ns: entry.lag.as_ns(),
                    max_age_ns: entry.max_age.as_ns(),
                    factor: 1.0,
                    spared_ns: -1,
                })
                .collect();
            for &(entry, age) in &gather.rare {
                entries[entry].spared_ns = age.as_ns();
            }
            for conversion in &gather.conversions {
                entries[conversion.entry].factor = conversion.factor();
            }
            lowering.gathers.push(Bundle {
                entries,
                held: gather.read != Read::Fresh,
            });
        }
        lowering
    }

    /// Where so many integers lie.
    fn ints(&mut self, count: usize) -> usize {
        let first = self.layout.ints;
        self.layout.ints = first.saturating_add(count);
        first
    }

    /// Where so many numbers lie.
    fn reals(&mut self, count: usize) -> usize {
        let first = self.layout.reals;
        self.layout.reals = first.saturating_add(count);
        first
    }

    /// Refuses an output port that somebody reads.
    fn unread(&mut self, node: &PlannedNode, port: &str) {
        let why = format!("the port `{port}` of `{}` is read", node.kind.name);
        self.also.push((why, "leave out what reads it".to_owned()));
    }

    /// Makes room for what is needed within a step.
    fn scratch(&mut self, count: usize) {
        self.layout.scratch = self.layout.scratch.max(count);
    }

    fn history(&mut self, slot: Option<usize>, depth: Duration, period: i64, stamped: bool) {
        let room = samples(depth, period, SPARE);
        let times = room.saturating_mul(1 + usize::from(stamped));
        let ints = self.ints(times.saturating_add(2));
        let reals = self.reals(room);
        self.histories.push(History {
            slot,
            room,
            ints,
            reals,
            stamped,
            depth_ns: depth.as_ns(),
        });
    }

    /// Whether a slot's values always have the stamp of their tick.
    fn is_stamped_now(&self, slot: usize) -> bool {
        let Some(node) = self.plan.channels[slot].node else {
            return true;
        };
        let kinds = [
            "slope",
            "first_order",
            "compensate",
            "stability",
            "safe_state",
        ];
        kinds.contains(&self.plan.nodes[node].kind.name)
    }

    fn node(
        &mut self,
        engine: &Engine,
        node: &PlannedNode,
        options: &Options,
    ) -> Result<Record, Refused> {
        match &node.role {
            PlannedRole::Feature { .. } => self.feature(engine, node),
            PlannedRole::Estimator { .. } => self.estimator(engine, node, options),
            PlannedRole::Combiner { .. } => self.combiner(node),
        }
    }
}

/// How many samples there are within a time, and some to spare.
fn samples(time: Duration, period: i64, spare: usize) -> usize {
    let (time, period) = (time.as_ns().max(0), period.max(1));
    let count = time.unsigned_abs().div_ceil(period.unsigned_abs());
    usize::try_from(count).map_or(usize::MAX, |count| count.saturating_add(spare))
}

/// A refusal of one kind.
fn refuse<T>(why: impl Into<String>, way: impl Into<String>) -> Result<T, Refused> {
    Err((why.into(), way.into()))
}

/// Refuses a node that has no fit.
fn unfitted<T>() -> Result<T, Refused> {
    refuse(
        "it has not been fitted",
        "fit the graph first: `athermal fit`",
    )
}

/// Refuses a fit of another graph.
fn unknown<T>(name: &str) -> Result<T, Refused> {
    refuse(
        format!("its fit uses `{name}`, which the graph does not have"),
        "fit it again",
    )
}

fn first(slots: &Range<usize>) -> usize {
    slots.start
}
