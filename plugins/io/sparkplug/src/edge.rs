//! What an edge node publishes: births, data and deaths.

use athermal_core::time::Instant;
use athermal_serve::connector::{OutRow, WiredOutput};
use srad_types::payload::{
    DataType, Message as _, Metric, Payload, PropertySet, PropertyValue, metric, property_value,
};

/// By what a host asks for a birth.
const REBIRTH: &str = "Node Control/Rebirth";

/// A tick, as it is published.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    at: Instant,
    values: Vec<Option<metric::Value>>,
}

impl Row {
    /// The outputs of a tick, and behind them of what they are.
    pub fn of(row: &OutRow<'_>) -> Self {
        let outputs = row.outputs.iter();
        let outputs =
            outputs.map(|&value| (!value.is_nan()).then_some(metric::Value::DoubleValue(value)));
        let revision = metric::Value::StringValue(format!("{:016x}", row.revision));
        let is_degraded = metric::Value::BooleanValue(row.is_degraded);
        Self {
            at: row.at,
            values: outputs.chain([Some(revision), Some(is_degraded)]).collect(),
        }
    }
}

/// What is known of a metric before it has a value.
#[derive(Debug)]
struct Declared {
    name: String,
    unit: Option<String>,
    datatype: DataType,
}

/// An edge node.
#[derive(Debug)]
pub struct Edge {
    metrics: Vec<Declared>,
    /// As they are by what was published last.
    values: Vec<Option<metric::Value>>,
    sequence: u8,
    /// The number of its birth, which is that of its death too.
    birth: u8,
    /// What is older than that was stored.
    born: Instant,
}

fn milliseconds(at: Instant) -> u64 {
    (at.as_ns() / 1_000_000).unsigned_abs()
}

impl Edge {
    /// One that has this number before its first birth.
    pub fn new(outputs: &[WiredOutput], birth: u8) -> Self {
        let declared = |name: &str, unit: &Option<String>, datatype| Declared {
            name: name.to_owned(),
            unit: unit.clone(),
            datatype,
        };
        let outputs = outputs.iter();
        // Levels of names are those of folders to whoever shows them.
        let mut metrics: Vec<Declared> = outputs
            .map(|of| declared(&of.name.replace('.', "/"), &of.unit, DataType::Double))
            .collect();
        metrics.push(declared("revision", &None, DataType::String));
        metrics.push(declared("degraded", &None, DataType::Boolean));
        Self {
            values: vec![None; metrics.len()],
            metrics,
            sequence: 0,
            birth,
            born: Instant::MIN,
        }
    }

    /// What the broker is to say once the connection that is made now has ended: each has a number of its own. What was before it is no
    /// value of now.
    pub fn connects(&mut self, at: Instant) -> Vec<u8> {
        self.birth = self.birth.wrapping_add(1);
        self.values.fill(None);
        self.death(at)
    }

    /// Its death.
    pub fn death(&self, at: Instant) -> Vec<u8> {
        payload(at, None, vec![self.number(at)])
    }

    fn number(&self, at: Instant) -> Metric {
        let mut metric = Metric::new();
        metric.set_name("bdSeq".to_owned());
        metric.set_datatype(DataType::UInt64);
        metric.set_timestamp(milliseconds(at));
        metric.set_value(metric::Value::LongValue(self.birth.into()));
        metric
    }

    /// Its birth: all metrics with their aliases and units, and what they are.
    pub fn birth(&mut self, at: Instant) -> Vec<u8> {
        (self.sequence, self.born) = (0, at);
        let mut metrics = vec![self.number(at), rebirth(at, false)];
        for (nth, of) in self.metrics.iter().enumerate() {
            let mut metric = metric(nth, self.values[nth].clone(), at);
            metric.set_name(of.name.clone());
            metric.set_datatype(of.datatype);
            metric.properties = of.unit.as_ref().map(|unit| PropertySet {
                keys: vec!["engUnit".to_owned()],
                values: vec![PropertyValue {
                    r#type: Some(DataType::String as u32),
                    is_null: None,
                    value: Some(property_value::Value::StringValue(unit.clone())),
                }],
            });
            metrics.push(metric);
        }
        payload(at, Some(0), metrics)
    }

    /// The data of a tick: what has changed, and all of one from before the birth. None where nothing has.
    pub fn data(&mut self, row: &Row) -> Option<Vec<u8>> {
        let is_stored = row.at < self.born;
        let is_said = |nth: &usize| is_stored || row.values[*nth] != self.values[*nth];
        let metric = |nth| {
            let mut metric = metric(nth, row.values[nth].clone(), row.at);
            metric.is_historical = is_stored.then_some(true);
            metric
        };
        let said = (0..row.values.len()).filter(is_said).map(metric);
        let metrics: Vec<Metric> = said.collect();
        // What is historical is no value of now.
        if !is_stored {
            self.values.clone_from(&row.values);
        }
        (!metrics.is_empty()).then(|| {
            self.sequence = self.sequence.wrapping_add(1);
            payload(row.at, Some(self.sequence), metrics)
        })
    }
}

/// A metric by its alias; null where it has no value.
fn metric(alias: usize, value: Option<metric::Value>, at: Instant) -> Metric {
    let mut metric = Metric::new();
    metric.set_alias(alias as u64);
    metric.set_timestamp(milliseconds(at));
    match value {
        Some(value) => metric.set_value(value),
        None => metric.set_null(),
    };
    metric
}

fn payload(at: Instant, sequence: Option<u8>, metrics: Vec<Metric>) -> Vec<u8> {
    let payload = Payload {
        timestamp: Some(milliseconds(at)),
        metrics,
        seq: sequence.map(u64::from),
        uuid: None,
        body: None,
    };
    payload.encode_to_vec()
}

fn rebirth(at: Instant, is_asked: bool) -> Metric {
    let mut metric = Metric::new();
    metric.set_name(REBIRTH.to_owned());
    metric.set_datatype(DataType::Boolean);
    metric.set_timestamp(milliseconds(at));
    metric.set_value(metric::Value::BooleanValue(is_asked));
    metric
}

/// An order to an edge node for a birth.
pub fn birth_order(at: Instant) -> Vec<u8> {
    payload(at, None, vec![rebirth(at, true)])
}

/// Whether an order to an edge node asks for a birth.
pub fn asks_for_birth(order: &[u8]) -> bool {
    let metrics = Payload::decode(order).map_or(Vec::new(), |of| of.metrics);
    let mut metrics = metrics.into_iter();
    metrics.any(|of| {
        of.name.as_deref() == Some(REBIRTH) && of.value == Some(metric::Value::BooleanValue(true))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(second: i64) -> Instant {
        Instant::from_ns(second * 1_000_000_000)
    }

    fn row(second: i64, values: [f64; 3]) -> Row {
        Row::of(&OutRow {
            at: at(second),
            is_beat: false,
            behind: athermal_core::time::Duration::ZERO,
            revision: 0xab,
            is_degraded: false,
            outputs: &values,
        })
    }

    fn edge() -> Edge {
        let output = |name: &str, unit: Option<&str>| WiredOutput {
            name: name.to_owned(),
            unit: unit.map(str::to_owned),
        };
        let outputs = [
            output("correction.X", Some("nm")),
            output("correction.Y", Some("nm")),
            output("ok", None),
        ];
        Edge::new(&outputs, 254)
    }

    fn read(bytes: &[u8]) -> Payload {
        Payload::decode(bytes).unwrap()
    }

    fn number(payload: &Payload) -> &metric::Value {
        payload.metrics[0].value.as_ref().unwrap()
    }

    #[test]
    fn a_birth_names_all_metrics_and_data_only_those_that_have_changed() {
        let mut edge = edge();
        edge.connects(at(1));
        let birth = read(&edge.birth(at(1)));
        let names: Vec<_> = birth
            .metrics
            .iter()
            .map(|of| of.name.clone().unwrap())
            .collect();
        let expected = [
            "bdSeq",
            REBIRTH,
            "correction/X",
            "correction/Y",
            "ok",
            "revision",
            "degraded",
        ];
        assert_eq!(names, expected);
        assert!(birth.metrics[2..].iter().all(|of| of.is_null == Some(true)));
        assert_eq!(birth.seq, Some(0));
        let unit = &birth.metrics[2].properties.as_ref().unwrap().values[0];
        let nm = property_value::Value::StringValue("nm".to_owned());
        assert_eq!(unit.value, Some(nm));
        let aliases = |bytes: Option<Vec<u8>>| {
            let data = read(&bytes.unwrap());
            let aliases = data.metrics.iter().map(|of| of.alias.unwrap());
            (data.seq.unwrap(), aliases.collect::<Vec<_>>())
        };
        let first = edge.data(&row(2, [1.0, f64::NAN, 0.0]));
        assert_eq!(aliases(first), (1, vec![0, 2, 3, 4]));
        assert_eq!(edge.data(&row(3, [1.0, f64::NAN, 0.0])), None);
        let next = edge.data(&row(4, [f64::NAN, 2.0, 0.0]));
        assert_eq!(aliases(next), (2, vec![0, 1]));
        // A host that comes later is given what is known, from 0 on.
        let again = read(&edge.birth(at(5)));
        assert_eq!(again.seq, Some(0));
        let y = metric::Value::DoubleValue(2.0);
        assert_eq!(again.metrics[3].value, Some(y));
        let revision = metric::Value::StringValue("00000000000000ab".to_owned());
        assert_eq!(again.metrics[5].value, Some(revision));
        assert_eq!(again.metrics[2].is_null, Some(true));
    }

    #[test]
    fn numbers_of_messages_and_births_begin_again_after_255_and_a_death_has_that_of_its_birth() {
        let mut edge = edge();
        for expected in [255, 0, 1] {
            let death = read(&edge.connects(at(1)));
            let birth = read(&edge.birth(at(2)));
            assert_eq!(number(&death), &metric::Value::LongValue(expected));
            assert_eq!((number(&birth), death.seq), (number(&death), None));
        }
        for nth in 1..=600_i64 {
            let data = edge.data(&row(2 + nth, [nth as f64, 0.0, 0.0])).unwrap();
            assert_eq!(read(&data).seq, Some(nth as u64 % 256));
        }
    }

    #[test]
    fn ticks_from_before_a_birth_are_whole_and_historical() {
        let mut edge = edge();
        edge.data(&row(9, [3.0, 3.0, 0.0]));
        edge.birth(at(10));
        for second in [8, 9] {
            let data = read(&edge.data(&row(second, [1.0, 2.0, 0.0])).unwrap());
            assert_eq!(data.metrics.len(), 5);
            assert!(data.metrics.iter().all(|of| of.is_historical == Some(true)));
            assert_eq!(data.metrics[0].timestamp, Some(1000 * second as u64));
        }
        // What is live is set against what was live.
        assert_eq!(edge.data(&row(10, [3.0, 3.0, 0.0])), None);
        let data = read(&edge.data(&row(11, [3.0, 2.0, 0.0])).unwrap());
        assert_eq!(data.metrics.len(), 1);
    }

    #[test]
    fn only_an_order_for_a_birth_is_one() {
        let order = |name: &str, value| {
            let mut metric = Metric::new();
            metric.set_name(name.to_owned());
            metric.set_value(metric::Value::BooleanValue(value));
            payload(at(0), None, vec![metric])
        };
        assert!(asks_for_birth(&order(REBIRTH, true)));
        assert!(!asks_for_birth(&order(REBIRTH, false)));
        assert!(!asks_for_birth(&order("Node Control/Reboot", true)));
        assert!(!asks_for_birth(b"\xff\xff"));
    }
}
