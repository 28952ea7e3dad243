//! The tables of a plan as constants of Structured Text: structures by kind, and the lists of which they hold the first element.

use std::fmt::Write as _;

use crate::form::{Entry, Field, Form, Record, Step};
use crate::lower::{KNOWN, WINDOWS};

/// Kinds with their types and tables, in the order of the numbers by which steps name them.
const KINDS: [(&str, &str, &str); 16] = [
    ("slope", "AT_Slope", "AT_SLOPES"),
    ("lag", "AT_Lag", "AT_LAGS"),
    ("first_order", "AT_FirstOrder", "AT_FIRST_ORDERS"),
    ("linear", "AT_Linear", "AT_LINEARS"),
    ("vote", "AT_Vote", "AT_VOTES"),
    ("compensate", "AT_Compensate", "AT_COMPENSATES"),
    ("stability", "AT_Stability", "AT_STABILITIES"),
    ("safe_state", "AT_SafeState", "AT_SAFE_STATES"),
    ("uncorrected", "AT_Uncorrected", "AT_UNCORRECTEDS"),
    ("loss", "AT_Loss", "AT_LOSSES"),
    ("settled", "AT_Settled", "AT_SETTLES"),
    ("pick", "AT_Pick", "AT_PICKS"),
    ("cross_check", "AT_CrossCheck", "AT_CROSS_CHECKS"),
    ("sample_at", "AT_SampleAt", "AT_SAMPLE_ATS"),
    ("health", "AT_Health", "AT_HEALTHS"),
    ("windowed", "AT_Windowed", "AT_WINDOWEDS"),
];

/// Structures within nodes, likewise.
const PARTS: [(&str, &str, &str); 6] = [
    ("course", "AT_Course", "AT_COURSES"),
    ("novelty", "AT_Novelty", "AT_NOVELTIES"),
    ("variance", "AT_Variance", "AT_VARIANCES"),
    ("spread", "AT_Spread", "AT_SPREADS"),
    ("learner", "AT_Learner", "AT_LEARNERS"),
    (
        "compensate_limits",
        "AT_CompensateLimits",
        "AT_COMPENSATE_LIMITS",
    ),
];

/// The step that looks whether anything of a gather is new.
const GATHER: usize = KINDS.len();

/// Fields whose names are keywords or functions in Structured Text, or those of places.
const RENAMED: [(&str, &str); 4] = [
    ("constant", "intercept"),
    ("limit", "tolerance"),
    ("floor", "least_weight"),
    ("rings", "ring_count"),
];

/// Sums of rows, of which a slope needs three in each of four places, beside what the runtime in C has in its state.
pub(super) const TOTALS: usize = 12;

/// A number with 17 digits; the largest for what is infinite, and 0 for what is absent.
pub(super) fn real(value: f64) -> String {
    if value.is_nan() || value == 0.0 {
        return "0.0".to_owned();
    }
    let written = format!("{:.16E}", value.clamp(f64::MIN, f64::MAX));
    let (digits, exponent) = written.split_once('E').unwrap_or((&written, "0"));
    let digits = digits.trim_end_matches('0');
    let zero = if digits.ends_with('.') { "0" } else { "" };
    match exponent {
        "0" => format!("{digits}{zero}"),
        _ => format!("{digits}{zero}E{exponent}"),
    }
}

/// A whole number of 64 bits; the least one cannot be written.
pub(super) fn long(value: i64) -> String {
    value.max(-i64::MAX).to_string()
}

/// Text within a comment.
pub(super) fn plain(text: &str) -> String {
    let word = |c: char| match c {
        c if c.is_ascii_graphic() || c == ' ' => c,
        _ => '?',
    };
    let text: String = text.chars().map(word).collect();
    text.replace("*)", "* )").replace("(*", "( *")
}

/// A list as a constant; one element that nobody reads where it is empty.
pub(super) fn list<T>(
    text: &mut String,
    name: &str,
    kind: &str,
    values: &[T],
    written: impl Fn(&T) -> String,
) {
    let last = values.len().saturating_sub(1);
    let _ = write!(text, "    {name} : ARRAY[0..{last}] OF {kind}");
    let mut line = String::new();
    for (nth, value) in values.iter().enumerate() {
        let value = written(value);
        text.push_str(if nth == 0 { " := [\n" } else { "," });
        if !line.is_empty() && line.len() + value.len() > 110 {
            let _ = writeln!(text);
            line.clear();
        }
        let space = if line.is_empty() { "        " } else { " " };
        let _ = write!(text, "{space}{value}");
        let _ = write!(line, "{space}{value},");
    }
    text.push_str(if values.is_empty() { ";\n" } else { "];\n" });
}

/// Lists of all nodes, one behind the other.
#[derive(Default)]
struct Lists {
    indices: Vec<i64>,
    longs: Vec<i64>,
    numbers: Vec<f64>,
    entries: Vec<Entry>,
    parts: [Vec<String>; PARTS.len()],
}

/// Puts elements at the end of a list; where the first one is.
fn put<T: Clone>(list: &mut Vec<T>, elements: &[T]) -> i64 {
    list.extend_from_slice(elements);
    (list.len() - elements.len()) as i64
}

impl Lists {
    /// A structure with its fields, whose lists are put behind the others.
    fn structure(&mut self, form: &Form, record: &Record) -> String {
        let mut fields = Vec::new();
        for (name, field) in &record.fields {
            let renamed = RENAMED.iter().find(|(own, _)| own == name);
            let name = renamed.map_or(*name, |(_, name)| name);
            let first = match field {
                Field::Int(value) => *value,
                Field::Real(value) => {
                    fields.push((name, real(*value)));
                    continue;
                }
                Field::Inline(values) | Field::Ints(values) => put(&mut self.indices, values),
                Field::Longs(values) => put(&mut self.longs, values),
                Field::Reals(values, _) => put(&mut self.numbers, values),
                Field::Entries(values) => put(&mut self.entries, values),
                Field::Struct(None) => -1,
                Field::Struct(Some(inner)) => self.inner(form, std::slice::from_ref(inner)),
                Field::Structs(inner) => self.inner(form, inner),
            };
            fields.push((name, long(first)));
        }
        let places = places(form, record).into_iter();
        fields.extend(places.map(|(name, place)| (name, place.to_string())));
        let written = fields
            .iter()
            .map(|(name, value)| format!("{name} := {value}"));
        format!("({})", written.collect::<Vec<_>>().join(", "))
    }

    /// Structures of one kind within one; where the first one is.
    fn inner(&mut self, form: &Form, records: &[impl std::borrow::Borrow<Record>]) -> i64 {
        let texts = records.iter().map(|of| self.structure(form, of.borrow()));
        let texts: Vec<String> = texts.collect();
        let kind = records.first().map_or("", |of| of.borrow().kind);
        let part = PARTS.iter().position(|(own, ..)| *own == kind);
        put(&mut self.parts[part.unwrap_or(0)], &texts)
    }
}

/// Where the parts of a node's state lie, which the runtime in C works out by itself.
fn places(form: &Form, node: &Record) -> Vec<(&'static str, usize)> {
    let mut place = node.place_of("ints");
    let mut number = node.place_of("reals");
    let of = |name: &str| node.place_of(name);
    let next = |place: &mut usize, count: usize| {
        *place += count;
        *place
    };
    match node.kind {
        "slope" => vec![
            ("heads", next(&mut place, 5 + of("blocks"))),
            ("seen", next(&mut place, of("windows"))),
            ("times", next(&mut place, 3 * of("channels"))),
            ("samples", next(&mut number, of("channels"))),
        ],
        "vote" => {
            let (count, judged) = form.voters(node);
            vec![
                ("count", count),
                ("judged", judged),
                ("run_times", next(&mut place, 7)),
                ("arrived", next(&mut place, of("runs"))),
                ("run_of", next(&mut place, of("waiting"))),
                ("rings", next(&mut place, of("waiting"))),
                ("error_times", next(&mut place, 2 * of("rings"))),
                ("truths", next(&mut number, of("runs") * count)),
                ("squares", next(&mut number, of("waiting"))),
                ("sums", next(&mut number, judged * of("errors"))),
                ("means", next(&mut number, judged)),
                ("counts", next(&mut number, judged)),
                ("trust", next(&mut number, judged)),
            ]
        }
        "learner" => {
            let order = node.reals_of("start").len();
            let cells = order * (order + 1) / 2;
            let (mut times, waiting) = (of("run_ints"), of("waiting"));
            vec![
                ("arrived", next(&mut place, KNOWN)),
                ("run_of", next(&mut place, waiting)),
                ("notes", next(&mut place, waiting)),
                ("times", next(&mut times, 3)),
                ("run_notes", next(&mut times, of("runs"))),
                ("cells", next(&mut number, 1)),
                ("back_to", next(&mut number, cells)),
                ("pull", next(&mut number, order)),
                ("counts", next(&mut number, order)),
                ("root", next(&mut number, 2)),
                ("theta", next(&mut number, cells)),
                ("in_use", next(&mut number, order)),
                ("windows", next(&mut number, order)),
                ("truths", next(&mut number, 2 * WINDOWS)),
            ]
        }
        "cross_check" => {
            let mut within = 2 * of("channels");
            let columns = of("columns");
            vec![
                ("form", within),
                ("z", next(&mut within, columns * columns)),
                ("pull", next(&mut within, columns)),
            ]
        }
        "safe_state" => {
            let holds = node
                .reals_of("when_lost")
                .iter()
                .any(|value| value.is_nan());
            vec![("holds", usize::from(holds))]
        }
        _ => Vec::new(),
    }
}

fn entry(of: &Entry) -> String {
    format!(
        "(slot := {}, history := {}, lag := {}, max_age := {}, factor := {}, spared := {})",
        of.slot,
        of.history.map_or(-1, |history| history as i64),
        long(of.lag_ns),
        long(of.max_age_ns),
        real(of.factor),
        long(of.spared_ns)
    )
}

fn flag(is: bool) -> &'static str {
    if is { "TRUE" } else { "FALSE" }
}

pub(super) fn write(form: &Form, text: &mut String) {
    sizes(form, text);
    let mut lists = Lists::default();
    let gathers: Vec<String> = (form.gathers.iter())
        .map(|gather| {
            let first = put(&mut lists.entries, &gather.entries);
            let (count, held) = (gather.entries.len(), flag(gather.held));
            format!("(first := {first}, count := {count}, held := {held})")
        })
        .collect();
    list(text, "AT_GATHERS", "AT_Gather", &gathers, String::clone);
    list(text, "AT_HISTORIES", "AT_History", &form.histories, |of| {
        format!(
            "(slot := {}, room := {}, ints := {}, reals := {}, stamped := {}, depth := {})",
            of.slot.map_or(-1, |slot| slot as i64),
            of.room,
            of.ints,
            of.reals,
            flag(of.stamped),
            long(of.depth_ns)
        )
    });
    for (kind, name, table) in KINDS {
        let nodes = form.nodes.iter().filter(|node| node.kind == kind);
        let (names, nodes): (Vec<String>, Vec<String>) = nodes
            .map(|node| (plain(&node.node), lists.structure(form, node)))
            .unzip();
        if !names.is_empty() {
            let _ = writeln!(text, "    (* {} *)", names.join(", "));
        }
        list(text, table, name, &nodes, String::clone);
    }
    for ((_, name, table), part) in PARTS.iter().zip(&lists.parts) {
        list(text, table, name, part, String::clone);
    }
    list(text, "AT_ENTRIES", "AT_Entry", &lists.entries, entry);
    list(text, "AT_INDICES", "DINT", &lists.indices, i64::to_string);
    list(text, "AT_LONGS", "LINT", &lists.longs, |&value| long(value));
    list(text, "AT_NUMBERS", "LREAL", &lists.numbers, |&value| {
        real(value)
    });
    let steps: Vec<String> = form.steps.iter().map(|of| step(form, of)).collect();
    list(text, "AT_STEPS", "AT_Step", &steps, String::clone);
    list(
        text,
        "AT_OUTPUT_SLOTS",
        "DINT",
        &form.output_slots,
        usize::to_string,
    );
    list(text, "AT_LOWEST", "LREAL", &form.ranges, |range| {
        real(range.0)
    });
    list(text, "AT_HIGHEST", "LREAL", &form.ranges, |range| {
        real(range.1)
    });
}

fn sizes(form: &Form, text: &mut String) {
    let layout = form.layout;
    let last = |count: usize| count.saturating_sub(1);
    text.push_str("\n    (* How much there is of what, and where it lies in the state. *)\n");
    for (name, size) in [
        ("SOURCES", form.sources.len()),
        ("LAST_SOURCE", last(form.sources.len())),
        ("OUTPUTS", form.outputs.len()),
        ("LAST_OUTPUT", last(form.outputs.len())),
        ("SLOTS", form.slots.len()),
        ("STEP_COUNT", form.steps.len()),
        ("HISTORY_COUNT", form.histories.len()),
        ("RECORDED_COUNT", form.recorded),
        ("SLOT_INTS", layout.slot_ints),
        ("GATHER_INTS", layout.gather_ints),
        ("REJECTED_INTS", layout.rejected_ints),
        ("SLOT_REALS", layout.slot_reals),
        ("SCRATCH", layout.scratch),
        ("TOTALS", layout.reals),
        ("LAST_INT", last(layout.ints)),
        ("LAST_REAL", layout.reals + TOTALS - 1),
    ] {
        let _ = writeln!(text, "    AT_{name} : DINT := {size};");
    }
    text.push_str("\n    (* The tables. *)\n");
}

/// A step: a kind, and which of that kind.
fn step(form: &Form, of: &Step) -> String {
    let (kind, nth) = match *of {
        Step::Gather(gather) => (GATHER, gather),
        Step::Run(node) => {
            let kind = form.nodes[node].kind;
            let before = form.nodes[..node].iter().filter(|of| of.kind == kind);
            let number = KINDS.iter().position(|(own, ..)| *own == kind);
            (number.unwrap_or(GATHER), before.count())
        }
    };
    format!("(kind := {kind}, nth := {nth})")
}
