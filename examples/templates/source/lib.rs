//! A source of athermal: the lines that a controller prints.
//!
//! A line is an instant in seconds and what was measured then: `12.5 plate=21.503 room=-`. A name is the column that the
//! graph gives a channel; what the graph does not read is passed over. `-` is no value, and so is a name that is missing.

use std::io::BufRead;

use athermal_core::compile::Plan;
use athermal_core::time::Instant;
use athermal_run::recording::{Event, Samples, Source, SourceError};

/// Lines from whatever has lines: standard input, a serial port, a socket.
pub struct MyNode<R> {
    input: R,
    /// The columns that the graph reads, in its order.
    columns: Vec<String>,
    line: Vec<u8>,
    skipped: u64,
}

impl<R: BufRead> MyNode<R> {
    /// Reads from `input` what the graph of `plan` wants.
    pub fn new(input: R, plan: &Plan) -> Self {
        let columns = plan.sources.iter().map(|channel| channel.column.clone());
        Self {
            input,
            columns: columns.collect(),
            line: Vec::new(),
            skipped: 0,
        }
    }

    /// How many lines could not be read. Cables are noisy: one broken line must not end a run, nor go unnoticed.
    pub fn skipped(&self) -> u64 {
        self.skipped
    }
}

impl<R: BufRead> Source for MyNode<R> {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
        loop {
            self.line.clear();
            if self.input.read_until(b'\n', &mut self.line)? == 0 {
                return Ok(None);
            }
            if let Some(time) = read(&self.line, &self.columns, samples) {
                return Ok(Some(Event::Row(time)));
            }
            self.skipped += 1;
        }
    }
}

/// The instant of a line, whose values go into `samples`; none if it cannot be read.
fn read(line: &[u8], columns: &[String], samples: &mut Samples) -> Option<Instant> {
    // A line without its end was cut off, and its last number may be another one.
    let line = std::str::from_utf8(line.strip_suffix(b"\n")?).ok()?;
    let mut words = line.split_ascii_whitespace();
    let seconds = words.next()?;
    let time = instant(seconds)?;
    samples.time_text.clear();
    samples.time_text.push_str(seconds);
    samples.values.clear();
    samples.values.resize(columns.len(), f64::NAN);
    for word in words {
        let (name, number) = word.split_once('=')?;
        let value = match number {
            "-" => f64::NAN,
            number => number.parse().ok()?,
        };
        if let Some(channel) = columns.iter().position(|column| column == name) {
            samples.values[channel] = value;
        }
    }
    Some(time)
}

fn instant(seconds: &str) -> Option<Instant> {
    let ns = (seconds.parse::<f64>().ok()? * 1e9).round();
    // Written so that NaN fails too.
    (ns.abs() < i64::MAX as f64).then(|| Instant::from_ns(ns as i64))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a graph with the channels `plate` and `room` is given.
    fn given(text: &[u8]) -> (Vec<(i64, Vec<f64>)>, u64) {
        let mut source = MyNode {
            input: text,
            columns: ["plate", "room"].map(str::to_owned).to_vec(),
            line: Vec::new(),
            skipped: 0,
        };
        let (mut samples, mut rows) = (Samples::default(), Vec::new());
        while let Some(Event::Row(time)) = source.next(&mut samples).unwrap() {
            rows.push((time.as_ns() / 1_000_000, samples.values.clone()));
        }
        (rows, source.skipped())
    }

    #[test]
    fn values_go_to_their_channels_in_any_order() {
        let text = b"0.0 plate=21.5 room=20\n0.25 room=20.5 door=1 plate=21.6\r\n";
        let expected = vec![(0, vec![21.5, 20.0]), (250, vec![21.6, 20.5])];
        assert_eq!(given(text), (expected, 0));
    }

    #[test]
    fn what_was_not_measured_is_absent_and_not_what_it_was_before() {
        let (rows, skipped) = given(b"0 plate=21.5 room=20\n1 plate=-\n2\n");
        assert_eq!((rows.len(), skipped), (3, 0));
        assert!(rows[1..].iter().flat_map(|row| &row.1).all(|x| x.is_nan()));
    }

    #[test]
    fn lines_that_cannot_be_read_are_left_out_and_counted() {
        let text = b"ready\n\nNaN plate=1\n1e300 plate=1\n3 plate=2x\n4 plate\n\xff\xfe\n5 plate=21.\n6 plate=2";
        let (rows, skipped) = given(text);
        assert_eq!((rows.len(), skipped), (1, 8));
        assert_eq!((rows[0].0, rows[0].1[0]), (5000, 21.0));
    }
}
