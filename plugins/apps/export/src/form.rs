//! What is exported: a plan as constant tables and the room that its state takes; not how any language writes them.

use std::collections::BTreeMap;

/// A plan, lowered to what the runtime on a controller steps.
#[derive(Debug, Clone)]
pub struct Form {
    /// The graph's name, as an identifier of C.
    pub name: String,
    /// What the graph says it is.
    pub title: String,
    /// The revision of the graph and its fit.
    pub revision: String,
    /// The measured channels.
    pub sources: Vec<Port>,
    /// The least and the largest value that counts, of each.
    pub ranges: Vec<(f64, f64)>,
    /// Names of all slots.
    pub slots: Vec<String>,
    /// What comes out.
    pub outputs: Vec<Port>,
    /// The slots that come out.
    pub output_slots: Vec<usize>,
    /// What is read together.
    pub gathers: Vec<Bundle>,
    /// What is kept of the past; those of slots come first, so many.
    pub histories: Vec<History>,
    /// How many of the histories are of slots.
    pub recorded: usize,
    /// What runs, in order.
    pub nodes: Vec<Record>,
    /// What is done at a tick, in order.
    pub steps: Vec<Step>,
    /// Where the parts of the state lie.
    pub layout: Layout,
    /// Nanoseconds between two ticks, at least.
    pub period_ns: i64,
    /// Nanoseconds between two samples, of each source.
    pub periods_ns: Vec<i64>,
    /// The time after which a cold start knows all, in nanoseconds.
    pub warm_up_ns: i64,
}

/// A channel that goes in or comes out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Port {
    /// Its name: `temperature.plate1`.
    pub name: String,
    /// Its unit.
    pub unit: String,
}

/// Names made of others, each once: those that are the same end in `_2`, `_3`.
pub(crate) fn each_once(names: impl Iterator<Item = String>) -> Vec<String> {
    let mut all: Vec<String> = Vec::new();
    for plain in names {
        let mut name = plain.clone();
        let mut nth = 2;
        while all.contains(&name) {
            name = format!("{plain}_{nth}");
            nth += 1;
        }
        all.push(name);
    }
    all
}

/// Where the parts of a state lie, and how large it is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Layout {
    /// The stamps of slots, then the ticks at which they were given something.
    pub slot_ints: usize,
    /// What was found in each gather.
    pub gather_ints: usize,
    /// How often a sample of each source was rejected.
    pub rejected_ints: usize,
    /// The values of slots.
    pub slot_reals: usize,
    /// Room for what is needed within a step.
    pub scratch: usize,
    /// All integers.
    pub ints: usize,
    /// All numbers.
    pub reals: usize,
    /// The last of them, which are made of the others and not saved.
    pub kept: usize,
}

impl Layout {
    /// How many numbers are saved.
    #[must_use]
    pub fn saved(&self) -> usize {
        self.reals - self.kept
    }

    /// Bytes of the state, each number having so many.
    #[must_use]
    pub fn bytes(&self, of_number: usize) -> usize {
        let reals = self.reals.saturating_mul(of_number);
        self.ints.saturating_mul(8).saturating_add(reals)
    }
}

/// The rules of votes that differ in what they keep, by their numbers in the runtime: `AT_GUARD` and `AT_STATE_GATE`.
pub const GUARD: i64 = 5;
/// See [`GUARD`].
pub const STATE_GATE: i64 = 6;
/// See [`GUARD`].
pub const HEDGE: i64 = 7;

/// How long errors count, by its number in the runtime: for a time.
pub const BY_TIME: i64 = 0;
/// So many of them.
pub const BY_COUNT: i64 = 1;
/// Ever less.
pub const FADING: i64 = 2;

impl Form {
    /// The time between two samples of each signal, of its channels the least, in nanoseconds.
    #[must_use]
    pub fn rates(&self) -> BTreeMap<&str, i64> {
        let mut rates = BTreeMap::new();
        for (source, &period) in self.sources.iter().zip(&self.periods_ns) {
            let signal = source.name.split('.').next().unwrap_or(&source.name);
            let known = rates.entry(signal).or_insert(period);
            *known = period.min(*known);
        }
        rates
    }

    /// The series in which leaps are looked for, of each truth its own.
    pub(crate) fn courses(&self) -> impl Iterator<Item = &Record> {
        let truths = self.nodes.iter().filter(|of| of.kind == "windowed");
        truths.flat_map(|of| of.structs_of("courses"))
    }

    /// How many votes a vote has, and of how many it keeps errors: a guard compares each with predicting zero.
    #[must_use]
    pub fn voters(&self, vote: &Record) -> (usize, usize) {
        let voters = self.gathers[vote.place_of("voters")].entries.len();
        let each = if vote.int_of("rule") == GUARD { 2 } else { 1 };
        (voters, each * voters)
    }
}

/// Values that are read together.
#[derive(Debug, Clone, PartialEq)]
pub struct Bundle {
    /// What is read.
    pub entries: Vec<Entry>,
    /// Whether the last value counts until it is too old.
    pub held: bool,
}

/// A value that is read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Entry {
    /// Its slot.
    pub slot: usize,
    /// The history that it is read from; none where it is read as it is now.
    pub history: Option<usize>,
    /// How far back, in nanoseconds.
    pub lag_ns: i64,
    /// How old it may be, in nanoseconds.
    pub max_age_ns: i64,
    /// What it is multiplied by.
    pub factor: f64,
    /// Until which age it does not age what is made of it, in nanoseconds; -1 of what always does.
    pub spared_ns: i64,
}

/// What is kept of the past of a channel.
#[derive(Debug, Clone, PartialEq)]
pub struct History {
    /// The slot; none where a node keeps it.
    pub slot: Option<usize>,
    /// How many values.
    pub room: usize,
    /// Where its integers and numbers lie.
    pub ints: usize,
    /// Where its numbers lie.
    pub reals: usize,
    /// Whether stamps differ from the instants at which values were given.
    pub stamped: bool,
    /// How far back it is read, in nanoseconds.
    pub depth_ns: i64,
}

/// Something done at a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// Looks whether anything of a gather is new.
    Gather(usize),
    /// Runs a node, by its number among [`Form::nodes`].
    Run(usize),
}

/// A node: a structure of the runtime with its fields in order.
#[derive(Debug, Clone)]
pub struct Record {
    /// The kind of the runtime: `slope` of `at_slope`.
    pub kind: &'static str,
    /// The instance of the graph: `thermal.Z1`.
    pub node: String,
    /// The parameters.
    pub fields: Vec<(&'static str, Field)>,
}

/// A parameter of a node.
#[derive(Debug, Clone)]
pub enum Field {
    /// A whole number.
    Int(i64),
    /// A number.
    Real(f64),
    /// Whole numbers within the structure.
    Inline(Vec<i64>),
    /// Whole numbers of 32 bits.
    Ints(Vec<i64>),
    /// Whole numbers of 64 bits.
    Longs(Vec<i64>),
    /// Numbers, and what each is called.
    Reals(Vec<f64>, Vec<String>),
    /// Values that are read.
    Entries(Vec<Entry>),
    /// Another structure, where there is one.
    Struct(Option<Box<Record>>),
    /// Several structures.
    Structs(Vec<Record>),
}

impl Record {
    /// Without any parameter yet.
    #[must_use]
    pub fn new(kind: &'static str, node: impl Into<String>) -> Self {
        Self {
            kind,
            node: node.into(),
            fields: Vec::new(),
        }
    }

    /// And this parameter.
    #[must_use]
    pub fn with(mut self, name: &'static str, field: Field) -> Self {
        self.fields.push((name, field));
        self
    }

    /// And this whole number.
    #[must_use]
    pub fn int(self, name: &'static str, value: usize) -> Self {
        self.with(name, Field::Int(value as i64))
    }

    /// The same with another whole number.
    pub fn set(&mut self, name: &'static str, value: usize) {
        self.fields.retain(|(own, _)| *own != name);
        self.fields.push((name, Field::Int(value as i64)));
    }

    /// And this number of a slot or gather, -1 where there is none.
    #[must_use]
    pub fn maybe(self, name: &'static str, value: Option<usize>) -> Self {
        self.with(name, Field::Int(value.map_or(-1, |value| value as i64)))
    }

    /// And this number.
    #[must_use]
    pub fn real(self, name: &'static str, value: f64) -> Self {
        self.with(name, Field::Real(value))
    }

    /// And these numbers.
    #[must_use]
    pub fn reals(self, name: &'static str, values: Vec<f64>) -> Self {
        self.with(name, Field::Reals(values, Vec::new()))
    }

    /// A parameter, which the kind has.
    fn field(&self, name: &str) -> Option<&Field> {
        let mut fields = self.fields.iter();
        fields.find(|(own, _)| *own == name).map(|(_, field)| field)
    }

    /// Another structure of it, where there is one.
    #[must_use]
    pub fn struct_of(&self, name: &str) -> Option<&Record> {
        match self.field(name) {
            Some(Field::Struct(inner)) => inner.as_deref(),
            _ => None,
        }
    }

    /// Other structures of it; none where the kind has none of the name.
    pub(crate) fn structs_of(&self, name: &str) -> &[Record] {
        match self.field(name) {
            Some(Field::Structs(all)) => all,
            _ => &[],
        }
    }

    /// A whole number; -1 where the kind has none of the name.
    #[must_use]
    pub fn int_of(&self, name: &str) -> i64 {
        match self.field(name) {
            Some(Field::Int(value)) => *value,
            _ => -1,
        }
    }

    /// A whole number from 0 on.
    #[must_use]
    pub fn place_of(&self, name: &str) -> usize {
        usize::try_from(self.int_of(name)).unwrap_or(0)
    }

    /// A number; 0 where the kind has none of the name.
    #[must_use]
    pub fn real_of(&self, name: &str) -> f64 {
        match self.field(name) {
            Some(Field::Real(value)) => *value,
            _ => 0.0,
        }
    }

    /// Whole numbers; none where the kind has none of the name.
    #[must_use]
    pub fn longs_of(&self, name: &str) -> &[i64] {
        match self.field(name) {
            Some(Field::Longs(values) | Field::Ints(values) | Field::Inline(values)) => values,
            _ => &[],
        }
    }

    /// Numbers; none where the kind has none of the name.
    #[must_use]
    pub fn reals_of(&self, name: &str) -> &[f64] {
        match self.field(name) {
            Some(Field::Reals(values, _)) => values,
            _ => &[],
        }
    }
}
