//! Repeated faults, summed: a pure state machine, which reads no clock.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// How often a fault that repeats is written.
const EVERY: Duration = Duration::from_secs(60);
/// How many kinds of faults are known apart.
const KINDS: usize = 256;

/// A line of the log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Line {
    /// `note`, `warning` or `error`.
    pub level: String,
    /// The event by name.
    pub event: String,
    /// What is known of it, as JSON.
    pub facts: String,
    /// A sentence.
    pub words: String,
}

/// What came and was not written.
#[derive(Debug)]
struct Kind {
    written: Instant,
    more: u64,
    /// The last of them.
    last: Line,
}

/// Writes the first of a kind of fault, and then once a minute how often it came. Two faults are of a kind where they differ in figures
/// alone. Notes are written as they come.
#[derive(Debug, Default)]
pub struct Summed {
    kinds: BTreeMap<String, Kind>,
}

impl Summed {
    /// Takes a line, and gives what is to be written now.
    pub fn take(&mut self, line: Line, now: Instant) -> Vec<Line> {
        let mut all = self.due(now);
        if line.level == "note" {
            all.push(line);
            return all;
        }
        let mut kind = kind_of(&line);
        if self.kinds.len() >= KINDS && !self.kinds.contains_key(&kind) {
            // A flood of kinds is a kind.
            kind = String::new();
        }
        match self.kinds.get_mut(&kind) {
            Some(known) => {
                known.more += 1;
                known.last = line;
            }
            None => {
                all.push(line.clone());
                let (written, more, last) = (now, 0, line);
                self.kinds.insert(
                    kind,
                    Kind {
                        written,
                        more,
                        last,
                    },
                );
            }
        }
        all
    }

    /// What is to be written by now of what came again. What did not come again for a while is forgotten.
    pub fn due(&mut self, now: Instant) -> Vec<Line> {
        let mut all = Vec::new();
        self.kinds.retain(|_, kind| {
            let passed = now.saturating_duration_since(kind.written);
            if passed < EVERY {
                return true;
            }
            kind.written = now;
            let again = kind.again(passed);
            let is_known = again.is_some();
            all.extend(again);
            is_known
        });
        all
    }

    /// What came and was not written. For the end.
    pub fn rest(&mut self) -> Vec<Line> {
        let mut kinds: Vec<_> = std::mem::take(&mut self.kinds).into_values().collect();
        kinds
            .iter_mut()
            .filter_map(|kind| kind.again(EVERY))
            .collect()
    }
}

impl Kind {
    fn again(&mut self, within: Duration) -> Option<Line> {
        let more = std::mem::take(&mut self.more);
        let words = match more {
            0 => return None,
            1 => self.last.words.clone(),
            more => format!(
                "{}; {more} like it within {} s",
                self.last.words,
                within.as_secs()
            ),
        };
        Some(Line {
            words,
            ..self.last.clone()
        })
    }
}

/// The words of a line without its figures.
fn kind_of(line: &Line) -> String {
    let figure = |c: char| c.is_ascii_digit() || c == '.';
    let mut kind = format!("{} {} ", line.level, line.event);
    let mut was_figure = false;
    for c in line.words.chars() {
        if !figure(c) {
            kind.push(c);
        } else if !was_figure {
            kind.push('#');
        }
        was_figure = figure(c);
    }
    kind
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(level: &str, words: String) -> Line {
        let (level, event, facts) = (level.to_owned(), "it".to_owned(), "{}".to_owned());
        Line {
            level,
            event,
            facts,
            words,
        }
    }

    #[test]
    fn a_fault_that_repeats_is_written_once_and_then_once_a_minute_with_how_often_it_came() {
        let (mut summed, start) = (Summed::default(), Instant::now());
        let mut written = Vec::new();
        for nth in 0..600_u64 {
            let now = start + Duration::from_millis(500 * nth);
            let words = format!("source `plc`: cannot connect; tried again in {nth}.5 s");
            written.extend(summed.take(line("warning", words), now));
        }
        written.extend(summed.rest());
        let words: Vec<_> = written.iter().map(|of| &*of.words).collect();
        assert_eq!(words.len(), 6, "{words:#?}");
        assert!(!words[0].contains("like it"));
        assert!(
            words[1].ends_with("tried again in 119.5 s; 119 like it within 60 s"),
            "{words:#?}"
        );
        let sums = words.iter().skip(1).map(|of| {
            let (_, rest) = of.split_once("s; ").unwrap();
            rest.split(' ').next().unwrap().parse::<u64>().unwrap()
        });
        assert_eq!(sums.sum::<u64>(), 599);
    }

    #[test]
    fn notes_and_faults_of_other_kinds_are_written_as_they_come() {
        let (mut summed, now) = (Summed::default(), Instant::now());
        for level in ["note", "warning"] {
            for words in ["one", "two"] {
                assert_eq!(summed.take(line(level, words.to_owned()), now).len(), 1);
            }
        }
        let again = summed.take(line("note", "one".to_owned()), now);
        assert_eq!(again.len(), 1);
        assert!(
            summed
                .take(line("warning", "one".to_owned()), now)
                .is_empty()
        );
    }

    #[test]
    fn a_flood_of_kinds_is_bounded_and_a_kind_that_is_gone_is_forgotten() {
        let (mut summed, now) = (Summed::default(), Instant::now());
        let name = |nth: usize| -> String {
            let letter = |of: usize| char::from(b'a' + (of % 26) as u8);
            [letter(nth), letter(nth / 26), letter(nth / 676)]
                .iter()
                .collect()
        };
        let written = (0..10_000).map(|nth| summed.take(line("warning", name(nth)), now).len());
        assert_eq!(written.sum::<usize>(), KINDS + 1);
        assert_eq!(summed.kinds.len(), KINDS + 1);
        summed.due(now + EVERY);
        assert_eq!(summed.due(now + 2 * EVERY).len(), 0);
        assert!(summed.kinds.is_empty());
    }
}
