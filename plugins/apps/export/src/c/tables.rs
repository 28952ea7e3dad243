//! The tables of a plan as constants of C: structures of the runtime by kind, and the lists that they point to.

use std::fmt::Write as _;

use athermal_core::engine::fnv_1a;

use crate::form::{Bundle, Entry, Field, Form, HEDGE, Record, Step};

/// The kinds of the runtime, in the order of its table of plans, and as its steps name them.
const KINDS: [(&str, &str); 16] = [
    ("slope", "AT_SLOPE"),
    ("lag", "AT_LAG"),
    ("first_order", "AT_FIRST_ORDER"),
    ("linear", "AT_LINEAR"),
    ("vote", "AT_VOTE"),
    ("compensate", "AT_COMPENSATE"),
    ("stability", "AT_STABILITY"),
    ("safe_state", "AT_SAFE_STATE"),
    ("uncorrected", "AT_UNCORRECTED"),
    ("loss", "AT_LOSS"),
    ("settled", "AT_SETTLED"),
    ("pick", "AT_PICK"),
    ("cross_check", "AT_CROSS_CHECK"),
    ("sample_at", "AT_SAMPLE_AT"),
    ("health", "AT_HEALTH"),
    ("windowed", "AT_WINDOWED"),
];

/// The rule of votes, and their form of weights, that take a power.
const AUTO_WEIGHTED: i64 = 0;
const INVERSE_POWER: i64 = 0;

/// What a graph uses of the runtime: the kinds of its nodes, and of votes and estimators what not all of them need.
pub(super) fn used(form: &Form) -> Vec<&'static str> {
    let any = |is: &dyn Fn(&Record) -> bool| form.nodes.iter().any(is);
    let kinds = KINDS.iter().filter(|(kind, _)| any(&|of| of.kind == *kind));
    let parts = [
        ("AT_HEDGES", any(&|of| of.int_of("rule") == HEDGE)),
        (
            "AT_ANY_POWER",
            any(&|of| {
                (of.int_of("rule"), of.int_of("form")) == (AUTO_WEIGHTED, INVERSE_POWER)
                    && of.real_of("power") != 1.0
            }),
        ),
        ("AT_FADES", any(&|of| of.real_of("half_life") > 0.0)),
        (
            "AT_FAST",
            any(&|of| of.int_of("kept") >= 0 && of.kind == "slope"),
        ),
        ("AT_LEARNS", any(&|of| of.struct_of("learner").is_some())),
        ("AT_STD_DEVS", any(&|of| of.int_of("std_dev_slot") >= 0)),
        ("AT_HINDSIGHT", any(&|of| of.int_of("before") >= 0)),
    ];
    let parts = parts.into_iter().filter(|(_, is)| *is);
    kinds
        .map(|(_, part)| *part)
        .chain(parts.map(|(part, _)| part))
        .collect()
}

/// A number with all of its bits.
pub(super) fn hex(value: f64) -> String {
    if value.is_nan() {
        return "(double)NAN".to_owned();
    }
    let sign = if value.is_sign_negative() { "-" } else { "" };
    if value.is_infinite() {
        return format!("{sign}(double)INFINITY");
    }
    let (bits, subnormal) = (value.to_bits(), value.abs() < f64::MIN_POSITIVE);
    let (mantissa, exponent) = (bits & ((1 << 52) - 1), (bits >> 52) & 0x7ff);
    if value == 0.0 {
        return format!("{sign}0.0");
    }
    let mut digits = format!("{mantissa:013x}");
    while digits.ends_with('0') {
        digits.pop();
    }
    let (lead, exponent) = match subnormal {
        true => (0, -1022),
        false => (1, exponent as i64 - 1023),
    };
    match digits.is_empty() {
        true => format!("{sign}0x{lead}p{exponent:+}"),
        false => format!("{sign}0x{lead}.{digits}p{exponent:+}"),
    }
}

fn real(value: f64) -> String {
    format!("AT_R({})", hex(value))
}

fn long(value: i64) -> String {
    match value {
        i64::MIN => "INT64_MIN".to_owned(),
        _ => format!("INT64_C({value})"),
    }
}

fn entry(entry: &Entry) -> String {
    format!(
        "{{ {}, {}, {}, {}, {}, {} }}",
        entry.slot,
        entry.history.map_or(-1, |history| history as i64),
        long(entry.lag_ns),
        long(entry.max_age_ns),
        real(entry.factor),
        long(entry.spared_ns)
    )
}

pub(super) fn write(form: &Form, text: &mut String) {
    let ranges = [
        ("lowest", form.ranges.iter().map(|range| range.0).collect()),
        ("highest", form.ranges.iter().map(|range| range.1).collect()),
    ];
    for (name, values) in ranges {
        let values: Vec<f64> = values;
        list(text, "at_real", name, &values, |&value| real(value), &[]);
    }
    reading(form, text);
    for (kind, _) in KINDS {
        let nodes: Vec<&Record> = form.nodes.iter().filter(|of| of.kind == kind).collect();
        if !nodes.is_empty() {
            structures(text, kind, kind, &nodes);
        }
    }
    steps(form, text);
    plan(form, text);
}

/// What is read, and what is kept of the past.
fn reading(form: &Form, text: &mut String) {
    let entries: Vec<Entry> = (form.gathers.iter())
        .flat_map(|gather| gather.entries.iter().copied())
        .collect();
    let names: Vec<String> = entries
        .iter()
        .map(|entry| form.slots[entry.slot].clone())
        .collect();
    list(text, "at_entry", "entries", &entries, entry, &names);
    let mut first = 0;
    let bundle = |gather: &Bundle| {
        let own = first;
        first += gather.entries.len();
        format!(
            "{{ {own}, {}, {} }}",
            gather.entries.len(),
            i32::from(gather.held)
        )
    };
    let gathers: Vec<String> = form.gathers.iter().map(bundle).collect();
    list(text, "at_gather", "gathers", &gathers, String::clone, &[]);
    let history = |history: &crate::form::History| {
        format!(
            "{{ {}, {}, {}, {}, {}, {} }}",
            history.slot.map_or(-1, |slot| slot as i64),
            history.room,
            history.ints,
            history.reals,
            i32::from(history.stamped),
            long(history.depth_ns)
        )
    };
    list(
        text,
        "at_history",
        "histories",
        &form.histories,
        history,
        &[],
    );
    let slots: Vec<i64> = form.output_slots.iter().map(|&slot| slot as i64).collect();
    list(text, "int32_t", "outputs", &slots, i64::to_string, &[]);
}

/// A list as a constant, with what each value is called where that is known; nothing where it is empty.
fn list<T>(
    text: &mut String,
    kind: &str,
    name: &str,
    values: &[T],
    mut written: impl FnMut(&T) -> String,
    names: &[String],
) {
    if values.is_empty() {
        return;
    }
    let _ = writeln!(text, "static const {kind} {name}[{}] = {{", values.len());
    let mut line = String::new();
    for (nth, value) in values.iter().enumerate() {
        let value = written(value);
        match names.get(nth) {
            Some(own) => {
                let _ = writeln!(text, "    {value}, /* {} */", super::plain(own));
            }
            None => {
                if line.len() + value.len() > 110 {
                    let _ = writeln!(text, "   {line}");
                    line.clear();
                }
                let _ = write!(line, " {value},");
            }
        }
    }
    if !line.is_empty() {
        let _ = writeln!(text, "   {line}");
    }
    text.push_str("};\n\n");
}

/// The name of a list, or NULL where it is empty.
fn pointer(name: &str, is_empty: bool) -> String {
    if is_empty {
        "NULL".to_owned()
    } else {
        name.to_owned()
    }
}

/// Structures of one kind, after what they point to.
fn structures(text: &mut String, kind: &str, name: &str, records: &[&Record]) {
    let mut written = Vec::new();
    for (nth, record) in records.iter().enumerate() {
        let mut fields = Vec::new();
        for (field, value) in &record.fields {
            let own = format!("{name}_{nth}_{field}");
            let value = match value {
                Field::Int(value) if i32::try_from(*value).is_err() => long(*value),
                Field::Int(value) => value.to_string(),
                Field::Real(value) => real(*value),
                Field::Inline(values) => {
                    let values: Vec<String> = values.iter().map(i64::to_string).collect();
                    format!("{{ {} }}", values.join(", "))
                }
                Field::Ints(values) => {
                    list(text, "int32_t", &own, values, i64::to_string, &[]);
                    pointer(&own, values.is_empty())
                }
                Field::Longs(values) => {
                    list(text, "int64_t", &own, values, |&value| long(value), &[]);
                    pointer(&own, values.is_empty())
                }
                Field::Reals(values, names) => {
                    list(text, "at_real", &own, values, |&value| real(value), names);
                    pointer(&own, values.is_empty())
                }
                Field::Entries(values) => {
                    list(text, "at_entry", &own, values, entry, &[]);
                    pointer(&own, values.is_empty())
                }
                Field::Struct(None) => "NULL".to_owned(),
                Field::Struct(Some(record)) => {
                    structures(text, record.kind, &own, &[record]);
                    own
                }
                Field::Structs(records) => {
                    let records: Vec<&Record> = records.iter().collect();
                    let kind = records.first().map_or("", |record| record.kind);
                    structures(text, kind, &own, &records);
                    pointer(&own, records.is_empty())
                }
            };
            fields.push(format!("        .{field} = {value},"));
        }
        written.push(format!(
            "    {{ /* {} */\n{}\n    }},",
            super::plain(&record.node),
            fields.join("\n")
        ));
    }
    if !written.is_empty() {
        let _ = writeln!(
            text,
            "static const at_{kind} {name}[{}] = {{\n{}\n}};\n",
            written.len(),
            written.join("\n")
        );
    }
}

fn steps(form: &Form, text: &mut String) {
    let nth_of_kind = |node: usize| {
        let kind = form.nodes[node].kind;
        form.nodes[..node]
            .iter()
            .filter(|of| of.kind == kind)
            .count()
    };
    let names: Vec<String> = (form.steps.iter())
        .map(|step| match step {
            Step::Gather(_) => String::new(),
            Step::Run(node) => form.nodes[*node].node.clone(),
        })
        .collect();
    let step = |step: &Step| match *step {
        Step::Gather(gather) => format!("{{ AT_GATHER, {gather} }}"),
        Step::Run(node) => {
            let kind = form.nodes[node].kind;
            let known = KINDS.iter().find(|(own, _)| *own == kind);
            let known = known.map_or("AT_GATHER", |(_, known)| known);
            format!("{{ {known}, {} }}", nth_of_kind(node))
        }
    };
    let _ = writeln!(
        text,
        "static const at_step steps[{}] = {{",
        form.steps.len()
    );
    for (of, name) in form.steps.iter().zip(names) {
        let remark = match name.is_empty() {
            true => String::new(),
            false => format!(" /* {} */", super::plain(&name)),
        };
        let _ = writeln!(text, "    {},{remark}", step(of));
    }
    text.push_str("};\n\n");
}

fn plan(form: &Form, text: &mut String) {
    let layout = form.layout;
    let counts = [
        ("sources", form.sources.len()),
        ("slots", form.slots.len()),
        ("steps", form.steps.len()),
        ("gathers", form.gathers.len()),
        ("histories", form.histories.len()),
        ("outputs", form.outputs.len()),
        ("slot_ints", layout.slot_ints),
        ("gather_ints", layout.gather_ints),
        ("rejected_ints", layout.rejected_ints),
        ("slot_reals", layout.slot_reals),
        ("scratch", layout.scratch),
        ("ints", layout.ints),
        ("reals", layout.reals),
        ("saved", layout.saved()),
        ("recorded", form.recorded),
    ];
    text.push_str("static const at_plan plan = {\n");
    for (name, count) in counts {
        let _ = writeln!(text, "    .{name} = {count},");
    }
    let _ = writeln!(
        text,
        "    .revision = UINT64_C({:#x}),",
        fnv_1a(form.revision.as_bytes())
    );
    let entries = form.gathers.iter().all(|gather| gather.entries.is_empty());
    let pointers = [
        ("lowest", "lowest", form.sources.is_empty()),
        ("highest", "highest", form.sources.is_empty()),
        ("step", "steps", form.steps.is_empty()),
        ("entry", "entries", entries),
        ("gather", "gathers", form.gathers.is_empty()),
        ("history", "histories", form.histories.is_empty()),
        ("output", "outputs", form.outputs.is_empty()),
    ];
    for (field, name, is_empty) in pointers {
        let _ = writeln!(text, "    .{field} = {},", pointer(name, is_empty));
    }
    for (kind, _) in KINDS {
        let none = !form.nodes.iter().any(|of| of.kind == kind);
        let _ = writeln!(text, "    .{kind} = {},", pointer(kind, none));
    }
    text.push_str("};\n");
}
