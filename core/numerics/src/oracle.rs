//! Reads the reference tables that tests compare with. Does not decide tolerances.

use std::path::PathBuf;

/// A CSV file without quotes: its header and its records as text.
pub(crate) struct Table {
    pub(crate) header: Vec<String>,
    pub(crate) records: Vec<Vec<String>>,
}

impl Table {
    fn parse(text: &str) -> Self {
        let mut lines = text
            .lines()
            .map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
        Self {
            header: lines.next().unwrap(),
            records: lines.collect(),
        }
    }

    /// All records as numbers, NaN where a field is empty or text.
    pub(crate) fn numbers(&self) -> Vec<Vec<f64>> {
        self.records
            .iter()
            .map(|r| r.iter().map(|f| number(f)).collect())
            .collect()
    }

    /// The record whose first field is `name`, without that field.
    pub(crate) fn named(&self, name: &str) -> Vec<f64> {
        let record = self.records.iter().find(|r| r[0] == name).unwrap();
        record[1..].iter().map(|f| number(f)).collect()
    }
}

fn number(field: &str) -> f64 {
    field.parse().unwrap_or(f64::NAN)
}

/// The text of a file under `oracles/`, or nothing, with a remark, where the shared folder is not there.
pub(crate) fn text(file: &str) -> Option<String> {
    let root = std::env::var_os("ATHERMAL_SHARED").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared"),
        PathBuf::from,
    );
    let path = root.join("oracles").join(file);
    let found = std::fs::read_to_string(&path).ok();
    if found.is_none() {
        eprintln!("skipped: no {}", path.display());
    }
    found
}

/// A CSV file under `oracles/`; see [`text`].
pub(crate) fn table(file: &str) -> Option<Table> {
    text(file).map(|text| Table::parse(&text))
}

/// The text of a file under this project's own `tests/oracles/`.
pub(crate) fn own_text(file: &str) -> String {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/oracles");
    std::fs::read_to_string(root.join(file)).unwrap()
}

/// A CSV file under this project's own `tests/oracles/`.
pub(crate) fn own_table(file: &str) -> Table {
    Table::parse(&own_text(file))
}
