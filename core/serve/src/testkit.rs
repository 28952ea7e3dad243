//! What every source and every sink must do, tried on one of yours: [`assert_source`] and [`assert_sink`] in a test of its crate.
//!
//! | rule | a source |
//! |---|---|
//! | stop | ends within a second of being asked to |
//! | repeat | gives each channel once at a stamp |
//! | restart | goes on after the stamps that the service knows, and gives none of them again |
//! | flood | does not wait for an engine that takes nothing: it drops, or holds back and still ends |
//! | cut | ends although nobody takes what it gives any more |
//!
//! | rule | a sink |
//! |---|---|
//! | again | takes a row again after it has failed |
//! | cut | has each row once after rows were cut back and put again, where it keeps rows |

use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration as Wait, Instant as Clock};

use crate::bell::{Bell, Mailbox};
use crate::connector::{
    Arrival, OutRow, Outlet, Remarks, Sink, SinkWiring, Source, SourceCounts, SourceLink,
    SourceWiring, Stop, WiredChannel, WiredOutput, link,
};
use crate::document::{TableBase, TimeBase, TimeForm};
use crate::journal::Progress;
use crate::time::{Duration, Instant, TimeColumns};

/// How long a source may take to end.
const SECOND: Wait = Wait::from_secs(1);

/// What a source gave of one channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Given {
    /// The channel, by its number.
    pub channel: usize,
    /// Its stamp.
    pub stamp: Instant,
    /// The value in the unit of the channel.
    pub value: f64,
}

/// A source under test, and what it is asked for.
#[derive(Debug)]
pub struct SourceTrial<'a> {
    source: &'a dyn Source,
    wiring: SourceWiring,
    patience: Wait,
}

impl<'a> SourceTrial<'a> {
    /// A source that is asked for these channels, each with where it has it. Relative paths start at the folder.
    #[must_use]
    pub fn new(source: &'a dyn Source, folder: &Path, channels: &[(&str, &str)]) -> Self {
        let wired = |(channel, address): &(&str, &str)| WiredChannel {
            channel: crate::compile::SourceChannel {
                name: (*channel).to_owned(),
                column: (*address).to_owned(),
                optional: false,
                range: (f64::NEG_INFINITY, f64::INFINITY),
                planned: None,
                is_instant: false,
            },
            address: (*address).to_owned(),
            unit: crate::unit::Unit::one(),
            mapped: None,
            conversion: None,
            after: Instant::MIN,
        };
        Self {
            source,
            wiring: SourceWiring {
                name: "tried".to_owned(),
                machine: None,
                state: folder.join("tried"),
                folder: folder.to_owned(),
                channels: channels.iter().map(wired).collect(),
                silent: Wait::from_secs(30),
                retry: Wait::from_secs(30),
                time: time_base(),
                table: TableBase::default(),
            },
            patience: Wait::from_secs(5),
        }
    }

    /// How long it may take to give what it is asked for; 5 s unless this says so.
    #[must_use]
    pub fn patience(mut self, patience: Wait) -> Self {
        self.patience = patience;
        self
    }

    /// The unit of its channels in the graph; 1 unless this says so.
    ///
    /// # Panics
    /// When there is no such unit.
    #[must_use]
    pub fn unit(mut self, unit: &str) -> Self {
        let unit = crate::unit::Unit::parse(unit);
        let unit = unit.unwrap_or_else(|error| panic!("{}", error.reason()));
        for channel in &mut self.wiring.channels {
            channel.unit = unit.clone();
        }
        self
    }

    /// What it gives until so many samples are there, or it has ended. It goes on after what `before` has.
    ///
    /// # Errors
    /// The rule that it broke, in words.
    pub fn run(&self, least: usize, before: &[Given]) -> Result<Vec<Given>, String> {
        self.given(least, before, 1 << 12, true)
    }

    fn given(
        &self,
        least: usize,
        before: &[Given],
        room: usize,
        takes: bool,
    ) -> Result<Vec<Given>, String> {
        let mut wiring = self.wiring.clone();
        for given in before {
            let after = &mut wiring.channels[given.channel].after;
            *after = given.stamp.max(*after);
        }
        let mut tried = self.begin(wiring, room)?;
        let (mut all, mut is_late) = (Vec::new(), false);
        let began = Clock::now();
        while all.len() < least && !tried.worker.is_finished() {
            is_late = takes && began.elapsed() > self.patience;
            // Once it has had time to fill the ring, the engine goes.
            if is_late || !takes && began.elapsed() > Wait::from_millis(300) {
                break;
            }
            thread::sleep(Wait::from_millis(5));
            if takes {
                all.extend(tried.take());
            }
        }
        if !takes {
            tried.link = None;
            thread::sleep(Wait::from_millis(50));
        }
        match tried.end(&mut all)? {
            Err(error) if all.is_empty() && takes => Err(format!("it fails: {error}")),
            _ if is_late => Err(format!(
                "it gives {} of {least} samples in {:?}",
                all.len(),
                self.patience
            )),
            _ => Ok(all),
        }
    }

    /// It at work, for whoever takes what it gives by hand.
    ///
    /// # Errors
    /// When it does not open.
    pub fn start(&self) -> Result<Tried, String> {
        self.begin(self.wiring.clone(), 1 << 16)
    }

    fn begin(&self, wiring: SourceWiring, room: usize) -> Result<Tried, String> {
        let places: Vec<u32> = (0..).take(wiring.channels.len()).collect();
        let (tell, heard) = channel();
        let remarks = Remarks::new("it", &Mailbox::new(tell, &Bell::here()));
        let engine = (thread::current(), Arc::<Progress>::default(), remarks);
        let stamps = self.source.stamps();
        let (mut out, link) = link(room, &wiring.channels, &places, stamps, engine);
        let opened = self.source.open(wiring);
        let mut inlet = opened.map_err(|error| format!("it does not open: {error}"))?;
        let (counts, stop) = (Arc::clone(out.counts()), Stop::default());
        let stops = stop.clone();
        let worker = thread::spawn(move || {
            let ran = inlet.run(&mut out, &stops);
            // What a source that fails has given counts all the same; the service starts it again.
            ran.map_err(|error| error.to_string())
        });
        Ok(Tried {
            link: Some(link),
            counts,
            heard,
            stop,
            worker,
        })
    }

    /// Tries all rules.
    ///
    /// # Errors
    /// The rule that it broke, in words.
    pub fn check(&self, least: usize) -> Result<(), String> {
        let first = self.run(least, &[])?;
        if first.is_empty() {
            return Err("it gives nothing".to_owned());
        }
        let key = |given: &Given| (given.channel, given.stamp);
        let mut seen = HashSet::new();
        for given in first.iter().filter(|given| !given.value.is_nan()) {
            if !seen.insert(key(given)) {
                return Err(format!(
                    "repeat: it gives channel {} twice at {} ns",
                    given.channel,
                    given.stamp.as_ns()
                ));
            }
        }
        // One that has ended has nothing more to give.
        let again = if self.source.ends() { 0 } else { 1 };
        let second = self.run(again, &first)?;
        if let Some(old) = second.iter().find(|given| seen.contains(&key(given))) {
            return Err(format!(
                "restart: it gives channel {} at {} ns again, which the service knows",
                old.channel,
                old.stamp.as_ns()
            ));
        }
        self.flood()
    }

    /// Tries what it does where nothing that it gives is taken, and then nobody is there any more.
    ///
    /// # Errors
    /// The rule that it broke, in words.
    pub fn flood(&self) -> Result<(), String> {
        let flooded = self.given(usize::MAX, &[], 4, false);
        flooded
            .map(|_| ())
            .map_err(|error| format!("flood and cut: {error}"))
    }
}

/// A source at work that is tried.
#[derive(Debug)]
pub struct Tried {
    /// None once the engine is gone.
    link: Option<SourceLink>,
    /// What it counts, and how its channels are.
    pub counts: Arc<SourceCounts>,
    heard: Receiver<(String, String)>,
    stop: Stop,
    worker: thread::JoinHandle<Result<(), String>>,
}

impl Tried {
    /// What it has given since.
    pub fn take(&mut self) -> Vec<Given> {
        let mut all = Vec::new();
        while let Some(arrival) = self.link.as_mut().and_then(SourceLink::next) {
            if let Arrival::Sample(sample) = arrival {
                all.push(Given {
                    channel: sample.channel as usize,
                    stamp: sample.stamp,
                    value: sample.value,
                });
            }
        }
        all
    }

    /// What it has reported since.
    #[must_use]
    pub fn remarks(&self) -> Vec<String> {
        self.heard.try_iter().map(|(_, words)| words).collect()
    }

    /// Ends it, and gives why it has ended where it failed, and what it gave last.
    ///
    /// # Errors
    /// The rule that it broke, in words.
    pub fn end(mut self, last: &mut Vec<Given>) -> Result<Result<(), String>, String> {
        self.stop.ask();
        let ended = Clock::now();
        while !self.worker.is_finished() {
            if ended.elapsed() > SECOND {
                return Err("stop: it does not end within a second of being asked to".to_owned());
            }
            last.extend(self.take());
            thread::sleep(Wait::from_millis(5));
        }
        last.extend(self.take());
        self.worker.join().map_err(|_| "it panics".to_owned())
    }
}

/// Tries all rules on a source that is asked for these channels, each with where it has it: so many samples at least.
///
/// # Panics
/// Where it breaks a rule, with what it did.
pub fn assert_source(source: &dyn Source, folder: &Path, channels: &[(&str, &str)], least: usize) {
    if let Err(broken) = SourceTrial::new(source, folder, channels).check(least) {
        panic!("{broken}: {source:?}");
    }
}

/// Tries all rules on a sink that is given these outputs. Relative paths start at the folder, which must be empty of what it keeps.
///
/// # Panics
/// Where it breaks a rule, with what it did.
pub fn assert_sink(sink: &dyn Sink, folder: &Path, outputs: &[&str]) {
    if let Err(broken) = check_sink(sink, folder, outputs) {
        panic!("{broken}: {sink:?}");
    }
}

/// A sink at work in a folder, given these outputs.
///
/// # Errors
/// Why it does not open.
pub fn open_sink(
    sink: &dyn Sink,
    folder: &Path,
    outputs: &[&str],
) -> Result<Box<dyn Outlet>, String> {
    let wired = |name: &&str| WiredOutput {
        name: (*name).to_owned(),
        unit: Some("nm".to_owned()),
    };
    let opened = sink.open(SinkWiring {
        name: "tried".to_owned(),
        machine: None,
        state: folder.join("tried"),
        folder: folder.to_owned(),
        outputs: outputs.iter().map(wired).collect(),
        time: time_base(),
        retry: Wait::from_secs(30),
    });
    opened.map_err(|error| format!("it does not open: {error}"))
}

/// Puts out a row that second: its outputs are the second, and one more each.
///
/// # Errors
/// Why it cannot be put out.
pub fn put(outlet: &mut dyn Outlet, second: i64, outputs: usize) -> Result<(), String> {
    let values: Vec<f64> = (0..outputs)
        .map(|nth| (second + nth as i64) as f64)
        .collect();
    let row = OutRow {
        at: Instant::from_ns(second * 1_000_000_000),
        is_beat: false,
        behind: Duration::ZERO,
        revision: 1,
        is_degraded: false,
        outputs: &values,
    };
    outlet.put(&row).map_err(|error| error.to_string())
}

fn check_sink(sink: &dyn Sink, folder: &Path, outputs: &[&str]) -> Result<(), String> {
    let count = outputs.len();
    let words = |error: crate::connector::ConnectorError| error.to_string();
    let mut outlet = open_sink(sink, folder, outputs)?;
    for second in 0..5 {
        put(&mut *outlet, second, count)?;
    }
    outlet.flush().map_err(words)?;
    let Some(kept) = outlet.kept() else {
        // What keeps no rows takes one again.
        return put(&mut *outlet, 4, count);
    };
    let end = kept.end().map_err(words)?;
    for second in 5..10 {
        put(&mut *outlet, second, count)?;
    }
    outlet.flush().map_err(words)?;
    drop(outlet);
    // As after a kill: the rows behind the last place that was kept are looked at, and put again from one of them on.
    let mut outlet = open_sink(sink, folder, outputs)?;
    let rows = |outlet: &mut Box<dyn Outlet>| {
        let kept = outlet
            .kept()
            .ok_or("cut: it kept rows, and no longer does")?;
        kept.rows_after(end).map_err(words)
    };
    let expect = |rows: Option<u64>, expected: u64, when: &str| {
        let is_right = rows == Some(expected);
        is_right.then_some(()).ok_or_else(|| {
            format!("cut: it has {rows:?} rows behind a place {when}, not {expected}")
        })
    };
    expect(rows(&mut outlet)?, 5, "after a restart")?;
    if let Some(kept) = outlet.kept() {
        kept.cut(end, 3).map_err(words)?;
    }
    expect(rows(&mut outlet)?, 3, "after a cut")?;
    for second in 8..10 {
        put(&mut *outlet, second, count)?;
    }
    if let Some(kept) = outlet.kept() {
        kept.end().map_err(words)?;
    }
    expect(rows(&mut outlet)?, 5, "after rows were put again")
}

/// Tries that a sink which fails takes the same row again once it can: `fail` makes it fail, and lets it work again.
///
/// # Errors
/// The rule that it broke, in words.
pub fn check_again(
    outlet: &mut dyn Outlet,
    outputs: usize,
    mut fail: impl FnMut(bool),
) -> Result<(), String> {
    fail(true);
    if put(outlet, 0, outputs).is_ok() && outlet.flush().is_ok() {
        return Err("again: it does not report that it cannot put a row out".to_owned());
    }
    fail(false);
    put(outlet, 0, outputs).map_err(|error| format!("again: it still fails: {error}"))?;
    outlet.flush().map_err(|error| error.to_string())
}

/// Time in seconds, as graphs without `[time]` have it.
fn time_base() -> TimeBase {
    TimeBase::Column {
        column: TimeColumns::one("time_s"),
        form: TimeForm::Numbers {
            unit: Duration::from_ns(1_000_000_000),
        },
        zone: None,
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};

    use super::*;
    use crate::connector::{ConnectorError, Inlet, Kept, Outflow, Place};

    /// A counter that may break a rule.
    #[derive(Debug, Clone, Copy, PartialEq)]
    enum Counter {
        Sound,
        Deaf,
        Stutters,
        Forgets,
        Silent,
    }

    impl Source for Counter {
        fn open(&self, wiring: SourceWiring) -> Result<Box<dyn Inlet>, ConnectorError> {
            let after = wiring.channels.iter().map(|of| of.after.as_ns()).max();
            let from = after.filter(|_| *self != Self::Forgets).unwrap_or(0);
            Ok(Box::new(Counting(*self, from.max(0))))
        }
    }

    struct Counting(Counter, i64);

    impl Inlet for Counting {
        fn run(&mut self, out: &mut Outflow, stop: &Stop) -> Result<(), ConnectorError> {
            let began = Clock::now();
            while stop.wait(Wait::from_millis(1)) || self.0 == Counter::Deaf {
                self.1 += i64::from(self.0 != Counter::Stutters || self.1 == 0);
                if self.0 != Counter::Silent {
                    out.sample(0, Instant::from_ns(self.1), self.1 as f64);
                }
                if began.elapsed() > Wait::from_secs(3) {
                    break;
                }
            }
            Ok(())
        }
    }

    fn check(source: &Counter) -> Result<(), String> {
        let trial = SourceTrial::new(source, Path::new("."), &[("t.a", "a")]);
        trial.patience(Wait::from_millis(300)).check(20)
    }

    #[test]
    fn a_sound_source_passes_and_each_rule_can_be_broken() {
        assert_eq!(check(&Counter::Sound), Ok(()));
        for (counter, rule) in [
            (Counter::Deaf, "stop: "),
            (Counter::Stutters, "repeat: "),
            (Counter::Forgets, "restart: "),
            (Counter::Silent, "it gives 0 of 20 samples"),
        ] {
            let broken = check(&counter).expect_err(rule);
            assert!(broken.contains(rule), "{counter:?}: {broken}");
        }
    }

    /// Rows in a file, a byte each; one that is careless keeps those that are cut off.
    #[derive(Debug)]
    struct Bytes {
        is_careless: bool,
    }

    struct Writing(std::path::PathBuf, bool);

    impl Sink for Bytes {
        fn open(&self, wiring: SinkWiring) -> Result<Box<dyn Outlet>, ConnectorError> {
            let path = wiring.folder.join("rows");
            Ok(Box::new(Writing(path, self.is_careless)))
        }
    }

    impl Writing {
        fn bytes(&self) -> Vec<u8> {
            std::fs::read(&self.0).unwrap_or_default()
        }
    }

    impl Outlet for Writing {
        fn put(&mut self, _: &OutRow<'_>) -> Result<(), ConnectorError> {
            let rows = [self.bytes(), vec![b'.']].concat();
            std::fs::write(&self.0, rows).map_err(ConnectorError::new)
        }

        fn kept(&mut self) -> Option<&mut dyn Kept> {
            Some(self)
        }
    }

    impl Kept for Writing {
        fn end(&mut self) -> Result<Place, ConnectorError> {
            let rows = self.bytes().len() as u64;
            Ok(Place { file: 0, rows })
        }

        fn rows_after(&mut self, end: Place) -> Result<Option<u64>, ConnectorError> {
            Ok((self.bytes().len() as u64).checked_sub(end.rows))
        }

        fn cut(&mut self, end: Place, rows: u64) -> Result<(), ConnectorError> {
            let mut bytes = self.bytes();
            if !self.1 {
                bytes.truncate((end.rows + rows) as usize);
            }
            std::fs::write(&self.0, bytes).map_err(ConnectorError::new)
        }
    }

    #[test]
    fn a_sound_sink_passes_and_one_that_keeps_what_is_cut_off_does_not() {
        let folder = crate::tests::Folder::new();
        let sound = Bytes { is_careless: false };
        assert_eq!(check_sink(&sound, &folder.0, &["a", "b"]), Ok(()));
        let folder = crate::tests::Folder::new();
        let broken = check_sink(&Bytes { is_careless: true }, &folder.0, &["a"]);
        assert!(broken.expect_err("it is careless").starts_with("cut: "));
    }

    /// A line that may be out of order.
    struct Line(Arc<AtomicBool>, bool);

    impl Outlet for Line {
        fn put(&mut self, _: &OutRow<'_>) -> Result<(), ConnectorError> {
            match self.0.load(Ordering::Relaxed) && !self.1 {
                true => Err(ConnectorError::new("out of order")),
                false => Ok(()),
            }
        }
    }

    #[test]
    fn a_sink_reports_that_it_fails_and_takes_the_row_again() {
        let broken = Arc::new(AtomicBool::new(false));
        let fail = |is: bool| broken.store(is, Ordering::Relaxed);
        let mut line = Line(Arc::clone(&broken), false);
        assert_eq!(check_again(&mut line, 1, fail), Ok(()));
        let mut mute = Line(Arc::clone(&broken), true);
        assert!(check_again(&mut mute, 1, fail).is_err());
    }
}
