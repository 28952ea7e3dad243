//! How much flash an exported graph takes: its constants as a processor of 32 bits lays them out, and what the runtime was measured to take.

use super::tables;
use crate::form::{Field, Form, Port, Record};
use crate::ticks::TICKS;

/// Bytes of flash, about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Flash {
    /// Of the runtime what the graph uses, on a Cortex-M4 with `-Os`.
    pub runtime: usize,
    /// The tables of the graph.
    pub tables: usize,
    /// Its self test, which a program that does not call it does without.
    pub self_test: usize,
}

/// What each part of the runtime takes beside what all share, as `size` has it for a Cortex-M4.
const PARTS: [(&str, usize); 23] = [
    ("AT_SLOPE", 4_900),
    ("AT_LAG", 200),
    ("AT_FIRST_ORDER", 1_300),
    ("AT_LINEAR", 1_250),
    ("AT_VOTE", 5_400),
    ("AT_COMPENSATE", 1_300),
    ("AT_STABILITY", 450),
    ("AT_SAFE_STATE", 950),
    ("AT_UNCORRECTED", 250),
    ("AT_LOSS", 450),
    ("AT_SETTLED", 700),
    ("AT_PICK", 100),
    ("AT_CROSS_CHECK", 2_100),
    ("AT_SAMPLE_AT", 250),
    ("AT_HEALTH", 1_400),
    ("AT_WINDOWED", 2_700),
    ("AT_HEDGES", 2_800),
    ("AT_ANY_POWER", 3_400),
    ("AT_FADES", 3_300),
    ("AT_FAST", 1_900),
    ("AT_LEARNS", 4_150),
    ("AT_STD_DEVS", 900),
    ("AT_HINDSIGHT", 600),
];
const SHARED: usize = 6_400;
/// The functions of a graph, without and with those of the self test.
const FUNCTIONS: [usize; 2] = [150, 450];

/// What an exported graph takes.
#[must_use]
pub fn flash(form: &Form) -> Flash {
    let used = tables::used(form);
    let parts = PARTS.iter().filter(|(part, _)| used.contains(part));
    let name = |port: &Port| port.name.len() + port.unit.len() + 10;
    let (sources, outputs) = (&form.sources, &form.outputs);
    let names: usize = sources.iter().chain(outputs).map(name).sum();
    let nodes: usize = form.nodes.iter().map(bytes_of).sum();
    let entries: usize = form
        .gathers
        .iter()
        .map(|of| 12 + 40 * of.entries.len())
        .sum();
    let rest = 32 * form.histories.len() + 8 * form.steps.len() + 16 * sources.len();
    let a_tick = 8 * (1 + sources.len() + outputs.len());
    Flash {
        runtime: SHARED + parts.map(|(_, bytes)| bytes).sum::<usize>(),
        tables: FUNCTIONS[0] + names + nodes + entries + rest + 4 * outputs.len(),
        self_test: FUNCTIONS[1] + TICKS * a_tick + 8 * outputs.len(),
    }
}

/// A structure with its lists. Few whole numbers have 64 bits.
fn bytes_of(record: &Record) -> usize {
    let field = |(_, field): &(&str, Field)| match field {
        Field::Int(_) | Field::Struct(None) => 4,
        Field::Real(_) => 8,
        Field::Inline(values) => 4 * values.len(),
        Field::Ints(values) => 4 + 4 * values.len(),
        Field::Longs(values) => 4 + 8 * values.len(),
        Field::Reals(values, _) => 4 + 8 * values.len(),
        Field::Entries(entries) => 4 + 40 * entries.len(),
        Field::Struct(Some(of)) => 4 + bytes_of(of),
        Field::Structs(all) => 4 + all.iter().map(bytes_of).sum::<usize>(),
    };
    record.fields.iter().map(field).sum()
}
