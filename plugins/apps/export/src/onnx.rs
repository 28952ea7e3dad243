//! The linear parts of a graph as an ONNX model in double precision: one product of matrices for each estimator.
//!
//! Windows, lags, ages, votes and what is heeded of novelty have no place in ONNX: a caller makes the rows, whose columns the metadata
//! name. Runtimes sum in an order of their own, so that a prediction is off by up to 1e-12 of the sum of the magnitudes of its terms.

use crate::form::{Field, Form, Record};

/// The version of the form of files, and of the set of operators.
const IR_VERSION: u64 = 8;
const OPERATORS: u64 = 17;
/// Numbers of double precision, as tensors have it.
const DOUBLE: u64 = 11;

/// A message of protocol buffers.
#[derive(Default)]
struct Message(Vec<u8>);

impl Message {
    fn varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.0.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.0.push(value as u8);
    }

    fn number(mut self, field: u64, value: u64) -> Self {
        self.varint(field << 3);
        self.varint(value);
        self
    }

    fn bytes(mut self, field: u64, bytes: &[u8]) -> Self {
        self.varint(field << 3 | 2);
        self.varint(bytes.len() as u64);
        self.0.extend_from_slice(bytes);
        self
    }

    fn text(self, field: u64, text: &str) -> Self {
        self.bytes(field, text.as_bytes())
    }

    fn message(self, field: u64, message: &Self) -> Self {
        self.bytes(field, &message.0)
    }
}

/// A tensor of numbers that are known.
fn tensor(name: &str, dims: &[usize], values: &[f64]) -> Message {
    let mut tensor = Message::default();
    for &dim in dims {
        tensor = tensor.number(1, dim as u64);
    }
    let raw: Vec<u8> = values
        .iter()
        .flat_map(|value| value.to_le_bytes())
        .collect();
    tensor.number(2, DOUBLE).text(8, name).bytes(9, &raw)
}

/// A value of so many rows and columns that goes in or comes out.
fn value(name: &str, columns: usize) -> Message {
    let rows = Message::default().text(2, "rows");
    let columns = Message::default().number(1, columns as u64);
    let shape = Message::default().message(1, &rows).message(1, &columns);
    let kind = Message::default().number(1, DOUBLE).message(2, &shape);
    let kind = Message::default().message(1, &kind);
    Message::default().text(1, name).message(2, &kind)
}

/// The regressors of an estimator, in the order of its coefficients.
fn columns(node: &Record) -> &[String] {
    let mut fields = node.fields.iter();
    let found = fields.find_map(|(name, field)| match field {
        Field::Reals(_, names) if *name == "coefficients" => Some(&names[..]),
        _ => None,
    });
    found.unwrap_or(&[])
}

fn constant(node: &Record) -> f64 {
    let mut fields = node.fields.iter();
    let found = fields.find_map(|(name, field)| match field {
        Field::Real(value) if *name == "constant" => Some(*value),
        _ => None,
    });
    found.unwrap_or(0.0)
}

/// The estimators of a graph that are linear forms of at least one regressor.
pub fn estimators(form: &Form) -> impl Iterator<Item = &Record> {
    let linear = form.nodes.iter().filter(|node| node.kind == "linear");
    linear.filter(|node| !columns(node).is_empty())
}

/// The model: of each estimator `NODE` an input `NODE:row`, rows of its regressors in their units, and an output `NODE`. The metadata
/// `NODE` have the names of the columns, one a line.
#[must_use]
pub fn model(form: &Form) -> Vec<u8> {
    let mut graph = Message::default().text(2, &form.name);
    let mut metadata = Vec::new();
    for node in estimators(form) {
        let (name, columns) = (&node.node, columns(node));
        let part = |what: &str| format!("{name}:{what}");
        let gemm = Message::default()
            .text(1, &part("row"))
            .text(1, &part("coefficients"))
            .text(1, &part("constant"))
            .text(2, name)
            .text(3, name)
            .text(4, "Gemm");
        let coefficients = node.reals_of("coefficients");
        graph = graph
            .message(1, &gemm)
            .message(
                5,
                &tensor(&part("coefficients"), &[columns.len(), 1], coefficients),
            )
            .message(5, &tensor(&part("constant"), &[1], &[constant(node)]))
            .message(11, &value(&part("row"), columns.len()))
            .message(12, &value(name, 1));
        let entry = Message::default()
            .text(1, name)
            .text(2, &columns.join("\n"));
        metadata.push(entry);
    }
    let operators = Message::default().text(1, "").number(2, OPERATORS);
    let mut model = Message::default()
        .number(1, IR_VERSION)
        .text(2, "athermal")
        .text(6, "Rows are what windows, lags and ages make of samples: the caller makes them. A prediction is off by up to 1e-12 of the sum of the magnitudes of its terms.")
        .message(7, &graph)
        .message(8, &operators)
        .message(14, &Message::default().text(1, "revision").text(2, &form.revision));
    for entry in metadata {
        model = model.message(14, &entry);
    }
    model.0
}
