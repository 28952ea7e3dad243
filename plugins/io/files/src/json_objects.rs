//! Objects written as JSON lines: keys, escapes, what JSON has no number for. Not when they leave the program.

use std::io::{self, BufWriter, Write};

use crate::cell::text_of;
use crate::lines::BUFFER;

/// A stream of JSON objects with the same keys, one per line.
pub(crate) struct JsonObjects {
    output: BufWriter<Box<dyn Write + Send>>,
    /// `{"time":`, `,"a":`, …
    keys: Vec<String>,
    line: Vec<u8>,
}

impl JsonObjects {
    pub fn new(output: Box<dyn Write + Send>, time_column: &str, columns: &[String]) -> Self {
        Self {
            output: BufWriter::with_capacity(BUFFER, output),
            keys: json_keys(time_column, columns),
            line: Vec::new(),
        }
    }

    /// Writes one object: the time as a number if it is one, else as text; `null` where there is no value.
    pub fn write(
        &mut self,
        number: &mut zmij::Buffer,
        time_text: &str,
        values: &[f64],
        label: Option<&str>,
    ) -> io::Result<()> {
        self.line.clear();
        let (time_key, keys) = self
            .keys
            .split_first()
            .expect("the key of the time always stands first");
        self.line.extend_from_slice(time_key.as_bytes());
        if is_json_number(time_text) {
            self.line.extend_from_slice(time_text.as_bytes());
        } else {
            serde_json::to_writer(&mut self.line, time_text)?;
        }
        for (key, &value) in keys.iter().zip(values) {
            self.line.extend_from_slice(key.as_bytes());
            match text_of(value, number) {
                "" => self.line.extend_from_slice(b"null"),
                text if value.is_finite() => self.line.extend_from_slice(text.as_bytes()),
                text => serde_json::to_writer(&mut self.line, text)?,
            }
        }
        if let (Some(key), Some(label)) = (keys.last(), label) {
            self.line.extend_from_slice(key.as_bytes());
            serde_json::to_writer(&mut self.line, label)?;
        }
        self.line.extend_from_slice(b"}\n");
        self.output.write_all(&self.line)
    }

    pub fn flush(&mut self) -> io::Result<()> {
        self.output.flush()
    }
}

fn json_keys(time_column: &str, columns: &[String]) -> Vec<String> {
    let quoted = |name: &str| serde_json::Value::from(name).to_string();
    let time = format!("{{{}:", quoted(time_column));
    let others = columns.iter().map(|name| format!(",{}:", quoted(name)));
    std::iter::once(time).chain(others).collect()
}

/// Whether a text, which has no blanks around it, is a number of JSON.
fn is_json_number(text: &str) -> bool {
    serde_json::from_str::<serde_json::Number>(text).is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_numbers_of_json_stand_without_quotes() {
        for text in ["0", "-1", "0.5", "10e3", "1.5E-3", "1e+9"] {
            assert!(is_json_number(text), "{text}");
            assert!(serde_json::from_str::<f64>(text).is_ok(), "{text}");
        }
        for text in [
            "",
            "-",
            "00",
            "01",
            "1.",
            ".5",
            "+1",
            "1e",
            "1e+",
            "1x",
            "2013-07-04",
            "nan",
        ] {
            assert!(!is_json_number(text), "{text}");
        }
    }
}
