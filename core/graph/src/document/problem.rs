//! Every mistake that reading a graph file can find, with the data of its text; where it stands is told by who reports it.

mod codes;
mod told;

use std::sync::Arc;

use super::foreign_syntax::ForeignSyntax;
use super::hint::Hint;
use crate::diagnostic::{Names, Place};
use crate::quantity::{Quantity, QuantityError};
use crate::time::DurationError;
use crate::unit::{Unit, UnitError};

/// A mistake in a graph file that shows before the graph is looked at as a whole.
#[derive(Debug, Clone, PartialEq)]
pub enum DocumentProblem {
    /// Not TOML.
    Syntax {
        /// What the TOML parser says.
        reason: String,
        /// The value without quotes that it stumbled over, where it is one.
        bare: Option<String>,
        /// What is usual elsewhere and stands there instead of TOML.
        foreign: Option<ForeignSyntax>,
    },
    /// A file cannot be read.
    Unreadable {
        /// The path as it was tried.
        path: String,
        /// What the operating system says.
        reason: String,
        /// The graph files in its folder, where it is not there.
        beside: Vec<String>,
        /// Whether another file names it.
        named: bool,
    },
    /// A file is too large.
    TooLarge {
        /// The largest size in bytes.
        limit: usize,
    },
    /// Tables or lists are nested too deeply.
    TooDeep {
        /// The greatest depth.
        limit: usize,
    },
    /// A list has too many values.
    LongList {
        /// The greatest number of values.
        limit: usize,
    },
    /// Too many files extend one another.
    LongChain {
        /// The greatest number of files.
        limit: usize,
    },
    /// A chain of `extends` comes back to itself.
    ExtendsLoop {
        /// The paths from the first file back to it.
        chain: Vec<String>,
    },
    /// `schema` is missing.
    SchemaMissing,
    /// `schema` is not one that this version reads.
    SchemaUnknown {
        /// What was found.
        found: String,
    },
    /// A key that its table does not have.
    UnknownKey {
        /// The key.
        key: String,
        /// What the table belongs to.
        what: String,
        /// The keys that are known there.
        known: Vec<String>,
    },
    /// An input that stands among the parameters of its node.
    InputAsKey {
        /// The key.
        key: String,
        /// The node.
        what: String,
        /// The input.
        input: String,
    },
    /// A key that has no default is not there.
    MissingKey {
        /// The key.
        key: String,
        /// What the table belongs to.
        what: String,
        /// What to write, where that can be said.
        advice: Option<String>,
    },
    /// A value of another type than its key needs.
    WrongType {
        /// The key or, in a list, the list's key.
        key: Option<String>,
        /// What is needed.
        expected: String,
        /// What was found.
        found: String,
        /// What is near what was found, and right.
        hint: Option<Hint>,
    },
    /// A text that is none of the choices.
    UnknownChoice {
        /// The key.
        key: Option<String>,
        /// What was found.
        found: String,
        /// What there is.
        choices: Vec<String>,
    },
    /// The value has the right type, and its reader refuses it.
    Refused {
        /// The key.
        key: Option<String>,
        /// The reader's reason.
        reason: String,
    },
    /// A number that no double or 64-bit integer holds.
    NumberTooLarge {
        /// The number as written.
        number: String,
    },
    /// A name that breaks the rules.
    BadName {
        /// What it names.
        role: &'static str,
        /// The name.
        name: String,
        /// Whether it may begin with a digit.
        digit_first: bool,
    },
    /// A name that is taken.
    DuplicateName {
        /// What it names.
        role: &'static str,
        /// The name.
        name: String,
        /// What has the name already.
        first_role: &'static str,
        /// Where that is.
        first: Option<Place>,
    },
    /// A set that is not declared.
    UnknownSet {
        /// The name.
        name: String,
        /// The sets that there are.
        known: Arc<Names>,
        /// What else to write, where something else than a set may be meant.
        or: Option<String>,
    },
    /// `{x}` that stands for nothing.
    UnknownPlaceholder {
        /// What stands between the braces.
        name: String,
        /// What it may be here.
        known: Vec<String>,
        /// What it stands in.
        what: String,
        /// What to write for all members, where no single one can be meant.
        instead: Option<String>,
    },
    /// A list that needs an entry has none.
    EmptyList {
        /// What the list is of.
        what: String,
    },
    /// `each` would make too many instances.
    TooManyInstances {
        /// The node.
        node: String,
        /// Instances of the whole graph with this node, as far as they can be counted.
        instances: usize,
        /// The greatest number.
        limit: usize,
    },
    /// `each` would make too large a graph.
    TooLargeExpanded {
        /// The node.
        node: String,
        /// The greatest number of values in all instances together.
        limit: usize,
    },
    /// A text that is no unit.
    Unit(UnitError),
    /// A text that is no duration.
    Duration(DurationError),
    /// A text that is no quantity.
    Quantity(QuantityError),
    /// A parameter that is given in a unit, within a text of its module that adds one.
    UnitTwice {
        /// The parameter.
        parameter: String,
        /// The module.
        module: String,
        /// What was given.
        given: Quantity,
        /// The text of the module.
        text: String,
        /// The unit in it.
        unit: Unit,
    },
    /// `nodes.NAME = false` or `outputs.NAME = false` without one of that name that is inherited.
    NothingToRemove {
        /// `node` or `output`.
        role: &'static str,
        /// Its name.
        name: String,
        /// The names of those that are inherited.
        inherited: Arc<Names>,
    },
    /// A number of samples where time is not counted in samples.
    SamplesWithoutClock {
        /// The text.
        text: String,
    },
    /// Several channels would be read from one column.
    OneColumn {
        /// The pattern.
        pattern: String,
        /// The number of channels.
        channels: usize,
    },
    /// A range whose ends do not measure what the signal measures.
    RangeUnit {
        /// The unit of the end.
        found: String,
        /// The unit of the signal.
        unit: Box<Unit>,
    },
    /// A range whose low end is not below its high end.
    RangeOrder {
        /// The low end.
        low: f64,
        /// The high end.
        high: f64,
        /// The unit of both.
        unit: String,
    },
    /// `optional` names what is not a channel.
    UnknownChannel {
        /// The name.
        name: String,
        /// The signal.
        signal: String,
        /// Its channels.
        known: Arc<Names>,
    },
    /// Two keys of `[time]` exclude each other.
    TimeContradiction {
        /// The key that is too much.
        key: &'static str,
        /// The key and value that it contradicts.
        with: String,
    },
    /// A duration of no length where one is needed.
    NoLength {
        /// The key.
        key: &'static str,
    },
    /// A step of no length.
    StepNotPositive,
    /// `module = …` names a module that is not declared.
    UnknownModule {
        /// The name.
        name: String,
        /// The modules in sight.
        known: Arc<Names>,
    },
    /// A module that is part of itself, or modules nested too deeply.
    ModuleLoop {
        /// The modules, from the outermost to the one that is too much.
        path: Vec<String>,
        /// The greatest depth.
        limit: usize,
    },
    /// A module refers to what is not part of it.
    OutOfReach {
        /// The name.
        name: String,
        /// The module.
        module: String,
        /// The nodes and inputs that the module has.
        known: Arc<Names>,
    },
    /// An output that a module does not have.
    UnknownOutput {
        /// The instance.
        node: String,
        /// The name; none where the default is meant.
        output: Option<String>,
        /// The module.
        module: String,
        /// Its outputs.
        known: Arc<Names>,
    },
}
