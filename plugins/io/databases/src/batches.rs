//! Rows in batches. A database that is away is tried again after ever longer pauses, and holds the rows back meanwhile; a row that it refuses
//! is set aside in a file, and the next ones go on.

use std::fs::{self, OpenOptions};
use std::io::Write as _;
use std::path::PathBuf;
use std::time::Instant as Clock;

use athermal_core::time::Instant;
use athermal_serve::connector::{BackOff, ConnectorError, Kept, OutRow, Outlet, Place, SinkWiring};
use serde_json::json;

/// How many rows go at once.
const AT_ONCE: usize = 1000;
/// How large the file may be with what is refused.
const REFUSED: u64 = 64 << 20;

/// A row on its way: the outputs by their numbers; those that are absent are not in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    pub at: Instant,
    pub revision: u64,
    pub values: Vec<(usize, f64)>,
}

/// Why rows were not taken.
#[derive(Debug)]
pub enum Trouble {
    /// One of them is none that the database takes: it does not get better by itself.
    Refused(String),
    /// It cannot be reached, or does not let us in, or has no room.
    Away(String),
}

/// A database.
pub trait Store: Send {
    /// Writes rows, all or none; those that it has it leaves as they are.
    ///
    /// # Errors
    /// Why not.
    fn write(&mut self, rows: &[Row]) -> Result<(), Trouble>;
}

/// A sink at work.
pub struct Batches<S> {
    store: S,
    outputs: Vec<String>,
    rows: Vec<Row>,
    back_off: BackOff,
    retry: std::time::Duration,
    /// Why nothing can leave, and when that is tried again.
    why: Option<(String, Clock)>,
    /// Where refused rows are set aside, and how many were.
    aside: PathBuf,
    refused: u64,
    /// That a row was set aside, until it was said.
    news: Option<String>,
}

impl<S: Store> Batches<S> {
    pub fn new(store: S, wiring: &SinkWiring) -> Self {
        Self {
            store,
            outputs: wiring.outputs.iter().map(|of| of.name.clone()).collect(),
            rows: Vec::new(),
            back_off: BackOff::up_to(wiring.retry),
            retry: wiring.retry,
            why: None,
            aside: wiring.state.join("refused.jsonl"),
            refused: 0,
            news: None,
        }
    }

    /// Writes what is held.
    fn write(&mut self) -> Result<(), ConnectorError> {
        if let Some((why, until)) = &self.why
            && Clock::now() < *until
        {
            return Err(ConnectorError::new(why));
        }
        let rows = std::mem::take(&mut self.rows);
        let mut written = 0;
        let done = self.pieces(&rows, &mut written);
        self.rows = rows;
        self.rows.drain(..written);
        match done {
            Ok(()) => {
                (self.why, self.back_off) = (None, BackOff::up_to(self.retry));
                Ok(())
            }
            Err(why) => {
                let pause = self.back_off.after(std::time::Duration::ZERO);
                let error = ConnectorError::new(&why);
                self.why = Some((why, Clock::now() + pause));
                Err(error)
            }
        }
    }

    /// Writes rows; where one of them is refused, in ever smaller pieces, until that one is alone.
    fn pieces(&mut self, rows: &[Row], written: &mut usize) -> Result<(), String> {
        if rows.is_empty() {
            return Ok(());
        }
        match self.store.write(rows) {
            Ok(()) => *written += rows.len(),
            Err(Trouble::Away(why)) => return Err(why),
            Err(Trouble::Refused(why)) if rows.len() == 1 => {
                self.set_aside(&rows[0], &why)?;
                *written += 1;
            }
            Err(Trouble::Refused(_)) => {
                let (first, second) = rows.split_at(rows.len() / 2);
                self.pieces(first, written)?;
                self.pieces(second, written)?;
            }
        }
        Ok(())
    }

    fn set_aside(&mut self, row: &Row, why: &str) -> Result<(), String> {
        let path = &self.aside;
        let failed = |error: std::io::Error| {
            format!(
                "a row is refused, and cannot be set aside in {}: {error}",
                path.display()
            )
        };
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(failed)?;
        }
        let mut file = OpenOptions::new().append(true).create(true).open(path);
        let file = file
            .as_mut()
            .map_err(|of| failed(std::io::Error::new(of.kind(), of.to_string())))?;
        self.refused += 1;
        let is_full = file.metadata().map_err(failed)?.len() >= REFUSED;
        if !is_full {
            let values = row
                .values
                .iter()
                .map(|(nth, value)| (self.outputs[*nth].clone(), json!(value)));
            let values: serde_json::Map<_, _> = values.collect();
            let line = json!({
                "time_ns": row.at.as_ns(),
                "revision": format!("{:016x}", row.revision),
                "values": values,
                "refused": why,
            });
            writeln!(file, "{line}").map_err(failed)?;
        }
        let full = if is_full {
            ", which is full: it is lost"
        } else {
            ""
        };
        self.news = Some(format!(
            "row {} that is refused is set aside in {}{full}: {why}",
            self.refused,
            path.display()
        ));
        Ok(())
    }
}

impl<S: Store> Outlet for Batches<S> {
    fn put(&mut self, row: &OutRow<'_>) -> Result<(), ConnectorError> {
        if self.rows.len() >= AT_ONCE {
            self.write()?;
        }
        let values = row.outputs.iter().copied().enumerate();
        let values: Vec<_> = values.filter(|(_, value)| value.is_finite()).collect();
        if !values.is_empty() {
            self.rows.push(Row {
                at: row.at,
                revision: row.revision,
                values,
            });
        }
        Ok(())
    }

    fn state(&mut self) -> Result<(), ConnectorError> {
        match (self.news.take(), &self.why) {
            (Some(news), _) => Err(ConnectorError::new(news)),
            (None, Some((why, _))) => Err(ConnectorError::new(why)),
            (None, None) => Ok(()),
        }
    }

    fn flush(&mut self) -> Result<(), ConnectorError> {
        self.write()
    }

    fn held(&self) -> u64 {
        self.rows.len() as u64
    }

    fn kept(&mut self) -> Option<&mut dyn Kept> {
        Some(self)
    }
}

/// A database is not asked which rows it has: those behind the last place that was kept are written again, and are the same.
impl<S: Store> Kept for Batches<S> {
    fn end(&mut self) -> Result<Place, ConnectorError> {
        self.write()?;
        Ok(Place::default())
    }

    fn rows_after(&mut self, _: Place) -> Result<Option<u64>, ConnectorError> {
        Ok(Some(0))
    }

    fn cut(&mut self, _: Place, _: u64) -> Result<(), ConnectorError> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};
    use std::time::Duration;

    use super::*;
    use athermal_serve::connector::{Sink, WiredOutput};

    /// Takes all but rows of a second that it refuses; away at times.
    #[derive(Debug, Clone, Default)]
    struct Shelf {
        rows: Arc<Mutex<Vec<i64>>>,
        refuses: Vec<i64>,
        away: Arc<Mutex<bool>>,
        calls: Arc<Mutex<u32>>,
    }

    impl Store for Shelf {
        fn write(&mut self, rows: &[Row]) -> Result<(), Trouble> {
            *self.calls.lock().unwrap() += 1;
            if *self.away.lock().unwrap() {
                return Err(Trouble::Away("nobody is there".to_owned()));
            }
            let seconds: Vec<_> = rows
                .iter()
                .map(|of| of.at.as_ns() / 1_000_000_000)
                .collect();
            if seconds.iter().any(|of| self.refuses.contains(of)) {
                return Err(Trouble::Refused("no such second".to_owned()));
            }
            self.rows.lock().unwrap().extend(seconds);
            Ok(())
        }
    }

    /// A shelf as a sink, for the test kit.
    #[derive(Debug)]
    struct Shelves(Shelf, PathBuf);

    impl Sink for Shelves {
        fn open(&self, mut wiring: SinkWiring) -> Result<Box<dyn Outlet>, ConnectorError> {
            wiring.state = self.1.clone();
            wiring.retry = Duration::from_millis(50);
            wiring.outputs.push(WiredOutput {
                name: "more".to_owned(),
                unit: None,
            });
            Ok(Box::new(Batches::new(self.0.clone(), &wiring)))
        }
    }

    #[test]
    fn a_row_that_is_refused_is_set_aside_and_the_others_wait_for_a_store_that_is_away() {
        let folder = std::env::temp_dir().join(format!("athermal-batches-{}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        let shelf = Shelf {
            refuses: vec![7, 1999],
            ..Shelf::default()
        };
        let sink = Shelves(shelf.clone(), folder.clone());
        let mut outlet = athermal_serve::testkit::open_sink(&sink, &folder, &["a"]).unwrap();
        let put = |outlet: &mut dyn Outlet, second| athermal_serve::testkit::put(outlet, second, 1);
        for second in 0..2500 {
            put(&mut *outlet, second).unwrap();
        }
        outlet.flush().unwrap();
        let all = |of: &Shelf| of.rows.lock().unwrap().clone();
        let expected: Vec<i64> = (0..2500).filter(|of| ![7, 1999].contains(of)).collect();
        assert_eq!(all(&shelf), expected);
        let aside = fs::read_to_string(folder.join("refused.jsonl")).unwrap();
        let lines: Vec<_> = aside.lines().collect();
        assert!(lines[0].contains("\"time_ns\":7000000000") && lines[0].contains("no such second"));
        assert_eq!(lines.len(), 2, "{aside}");
        assert!(
            outlet
                .state()
                .unwrap_err()
                .to_string()
                .contains("row 2 that is refused")
        );
        assert!(outlet.state().is_ok(), "it is said once");
        *shelf.away.lock().unwrap() = true;
        for second in 2500..3500 {
            put(&mut *outlet, second).unwrap();
        }
        assert!(
            put(&mut *outlet, 3500)
                .unwrap_err()
                .contains("nobody is there")
        );
        let calls = *shelf.calls.lock().unwrap();
        assert!(put(&mut *outlet, 3500).is_err() && outlet.state().is_err());
        assert_eq!(*shelf.calls.lock().unwrap(), calls, "it pauses");
        assert_eq!(outlet.held(), 1000);
        assert!(outlet.kept().unwrap().end().is_err());
        *shelf.away.lock().unwrap() = false;
        std::thread::sleep(Duration::from_millis(150));
        put(&mut *outlet, 3500).unwrap();
        outlet.kept().unwrap().end().unwrap();
        assert_eq!(all(&shelf).len(), 2498 + 1001);
        assert!(outlet.state().is_ok() && outlet.held() == 0);
        fs::remove_dir_all(&folder).unwrap();
    }
}
