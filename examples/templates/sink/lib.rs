//! A sink of athermal: a line for each tick, as a controller reads it.
//!
//! A line is the instant in seconds and every output by its name: `12.500 gradient.plate=60.1 gradient.room=-`. `-` is no
//! value: whoever reads must be able to tell it from zero, and from a line that was lost.

use std::fmt::Write as _;
use std::io::Write;

use athermal_core::compile::Plan;
use athermal_run::live::{Frame, Sink, SinkError};

/// Lines to whatever takes bytes: standard output, a serial port, a socket.
pub struct MyNode<W> {
    output: W,
    /// The names of the outputs, in the order of the graph.
    names: Vec<String>,
    line: String,
}

impl<W: Write> MyNode<W> {
    /// Writes to `output` what the graph of `plan` puts out.
    pub fn new(output: W, plan: &Plan) -> Self {
        let names = plan.outputs.iter().map(|output| output.name.clone());
        Self {
            output,
            names: names.collect(),
            line: String::new(),
        }
    }
}

impl<W: Write> Sink for MyNode<W> {
    fn put(&mut self, frame: &Frame<'_>) -> Result<(), SinkError> {
        self.line.clear();
        write!(self.line, "{:.3}", frame.time.as_ns() as f64 / 1e9)?;
        for (name, value) in self.names.iter().zip(frame.outputs) {
            if value.is_finite() {
                write!(self.line, " {name}={value}")?;
            } else {
                write!(self.line, " {name}=-")?;
            }
        }
        self.line.push('\n');
        // In one piece and at once: somebody waits for it.
        self.output.write_all(self.line.as_bytes())?;
        Ok(self.output.flush()?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use athermal_core::time::Instant;

    fn put<W: Write>(output: W, outputs: &[f64]) -> Result<(), SinkError> {
        let mut sink = MyNode {
            output,
            names: vec!["Z1".to_owned(), "Z2".to_owned()],
            line: String::new(),
        };
        sink.put(&Frame {
            time: Instant::from_ns(12_500_000_000),
            time_text: "",
            revision: "",
            outputs,
        })?;
        sink.finish()
    }

    #[test]
    fn a_line_has_the_instant_and_every_output_and_tells_none_from_zero() {
        let mut line = Vec::new();
        put(&mut line, &[0.0, f64::NAN]).unwrap();
        assert_eq!(line, b"12.500 Z1=0 Z2=-\n");
    }

    #[test]
    fn that_nobody_listens_any_more_is_told() {
        let told = put(&mut [0_u8; 4][..], &[1.0, 2.0]).unwrap_err();
        assert_eq!(told.to_string(), "failed to write whole buffer");
    }
}
