//! What goes on learning, between its form in a snapshot and its place in the arrays of the runtime.

use athermal_core::node::numbers;
use athermal_numerics::{Learned, Rls, RlsFit};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::CarryError;
use super::image::Image;
use super::nodes::{places, read, written};
use super::snapshot::{Node, Recent, Standing, Withheld};
use crate::form::{Form, Record};
use crate::lower::{KNOWN, WINDOWS};

#[derive(Serialize, Deserialize)]
struct Online {
    state: String,
    frame: Value,
    recursion: Recursion,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Recursion {
    LeastSquares {
        #[serde(with = "numbers")]
        of_fit: Vec<f64>,
        learned: Learned,
        last: Option<i64>,
    },
}

/// No instant, in C.
const NEVER: i64 = i64::MIN;
/// Where among integers instants of a learner lie: since when errors were too large, when the last truth taught, up to when what was
/// learned has faded, when the newest window began and when the last truth came; then how many windows there were, and the newest.
const SINCE: usize = 6;
const LESSON: usize = 7;
const FADED: usize = 8;
const FROM: usize = 9;
const LAST: usize = 10;
const COUNT: usize = 11;
const NEWEST: usize = 12;

/// Where the parts of a learner lie.
pub(super) struct Pupil<'a> {
    node: &'a Record,
    learner: &'a Record,
    width: usize,
    runs: usize,
    waiting: usize,
    ints: usize,
    arrived: usize,
    run_ints: usize,
    rows: usize,
    reals: usize,
    windows: usize,
    truths: usize,
}

impl<'a> Pupil<'a> {
    /// None of a node that does not learn.
    pub(super) fn new(node: &'a Record) -> Option<Self> {
        let learner = node.struct_of("learner")?;
        let (ints, reals) = places(learner);
        let width = node.place_of("width");
        let order = width + 1;
        let windows = reals + 3 + order * (order + 1) + 4 * order;
        Some(Self {
            node,
            learner,
            width,
            runs: learner.place_of("runs"),
            waiting: learner.place_of("waiting"),
            ints,
            arrived: ints + KNOWN,
            run_ints: learner.place_of("run_ints"),
            rows: learner.place_of("run_reals"),
            reals,
            windows,
            truths: windows + 2 * WINDOWS,
        })
    }

    fn list(&self, of: &Record, name: &str) -> Vec<f64> {
        of.reals_of(name).to_vec()
    }

    /// The recursion as it began.
    fn beginning(&self) -> Option<Rls> {
        let fit = RlsFit {
            memory_s: self.learner.real_of("memory"),
            share: self.learner.real_of("share"),
            coefficients: self.list(self.learner, "start"),
            information: self.list(self.learner, "information"),
            rows: self.learner.real_of("rows"),
            variance: self.node.struct_of("spread")?.real_of("variance"),
        };
        let mut rls = Rls::try_from(fit).ok()?;
        let squares = self.learner.real_of("squares");
        let begun = Learned {
            squares,
            ..rls.learned().clone()
        };
        rls.resume(&begun).then_some(rls)
    }

    /// Puts what was learned, and what follows from it.
    fn put_squares(&self, image: &mut Image, rls: &Rls) {
        let Learned {
            information,
            start,
            pull,
            rows,
            squares,
        } = rls.learned();
        let theta = rls.coefficients();
        let mut place = self.reals + 1;
        let counts = [*rows, *squares];
        let parts: [&[f64]; 6] = [information, start, pull, &counts, rls.root(), theta];
        for part in parts {
            image.reals[place..][..part.len()].copy_from_slice(part);
            place += part.len();
        }
        let spread = self.node.struct_of("spread");
        let of = |name| spread.map_or_else(Vec::new, |spread| self.list(spread, name));
        for (nth, scale) in of("scale").iter().enumerate() {
            image.reals[place + nth] = theta[nth] / scale;
        }
        let form = athermal_core::node::LinearForm {
            constant: 0.0,
            coefficients: &image.reals[place..][..self.width],
        };
        let shift = form.at(&of("mean"));
        let level = self.learner.real_of("level");
        image.reals[place + self.width] = theta[self.width] + level - shift;
    }

    /// Takes what was learned.
    fn take_squares(&self, image: &Image) -> Learned {
        let order = self.width + 1;
        let cells = order * (order + 1) / 2;
        let (information, rest) = image.reals[self.reals + 1..].split_at(cells);
        let (start, rest) = rest.split_at(order);
        let (pull, counts) = rest.split_at(order);
        Learned {
            information: information.to_vec(),
            start: start.to_vec(),
            pull: pull.to_vec(),
            rows: counts[0],
            squares: counts[1],
        }
    }

    /// Whether a channel stopped it at the last tick: without a clear 0 it does not go on.
    fn is_frozen(&self, image: &Image, form: &Form) -> bool {
        let freeze = usize::try_from(self.learner.int_of("freeze")).ok();
        let Some(gather) = freeze.map(|freeze| &form.gathers[freeze]) else {
            return false;
        };
        let stamps = form.layout.slot_ints;
        let [tick, last] = [image.ints[0], image.ints[1]];
        gather.entries.iter().any(|of| {
            let age = last.saturating_sub(image.ints[stamps + of.slot]);
            let counts = match gather.held {
                true => age <= of.max_age_ns,
                false => image.ints[stamps + form.slots.len() + of.slot] == tick,
            };
            let is_clear = image.reals[form.layout.slot_reals + of.slot] == 0.0;
            !(is_clear && counts && of.history.is_none())
        })
    }

    /// What it begins with.
    pub(super) fn begin(&self, image: &mut Image) {
        if let Some(rls) = self.beginning() {
            self.put_squares(image, &rls);
        }
        image.ints[self.ints + SINCE..=self.ints + LAST].fill(NEVER);
    }

    pub(super) fn put(
        &self,
        image: &mut Image,
        form: &Form,
        known: &Node,
    ) -> Result<(), CarryError> {
        if let Some(own) = &known.own {
            let Online {
                recursion: Recursion::LeastSquares { learned, last, .. },
                ..
            } = read(self.node, own)?;
            if let Some(mut rls) = self.beginning()
                && rls.resume(&learned)
            {
                self.put_squares(image, &rls);
            }
            image.ints[self.ints + FADED] = last.unwrap_or(NEVER);
        }
        if let Some(recent) = &known.recent {
            let numbers = [recent.seen, recent.refused, recent.weighed.into()];
            image.ints[self.ints + 3..][..3].copy_from_slice(&numbers.map(i64::from));
            image.reals[self.reals] = recent.mean_square;
            image.ints[self.ints + SINCE] = recent.since.unwrap_or(NEVER);
            image.ints[self.ints + LESSON] = recent.lesson.unwrap_or(NEVER);
        }
        if let Some(standing) = &known.standing {
            image.ints[self.ints + FROM] = standing.from.unwrap_or(NEVER);
            image.ints[self.ints + LAST] = standing.last.unwrap_or(NEVER);
            image.ints[self.ints + COUNT] = standing.squares.len() as i64;
            image.ints[self.ints + NEWEST] = standing.newest as i64;
            let all = standing.squares.as_flattened();
            image.reals[self.windows..][..all.len()].copy_from_slice(all);
        }
        image.ints[self.ints + 2] = if self.is_frozen(image, form) { 2 } else { 0 };
        let Some(embargo) = &known.learning else {
            return Ok(());
        };
        let pairing = &embargo.pairing;
        let first = pairing.number - pairing.past as u64;
        let own_first = image.ints[self.run_ints + 1].max(0) as u64;
        let total = first + pairing.runs.times.len() as u64;
        // Of several that share them each kept what it still needs.
        let known_before = image.ints[self.run_ints] > 0;
        image.ints[self.run_ints] = total as i64;
        image.ints[self.run_ints + 1] = match known_before {
            true => own_first.min(first) as i64,
            false => first as i64,
        };
        let slots = form.layout.slot_ints + form.slots.len();
        image.ints[self.run_ints + 2] = image.ints[slots + self.node.place_of("slot")];
        for (nth, &time) in pairing.runs.times.iter().enumerate() {
            let place = (first as usize + nth) % self.runs;
            let row = &pairing.runs.numbers[nth * (self.width + 1)..][..=self.width];
            image.ints[self.run_ints + 3 + place] = time;
            image.ints[self.run_ints + 3 + self.runs + place] = row[self.width] as i64;
            image.reals[self.rows + place * self.width..][..self.width]
                .copy_from_slice(&row[..self.width]);
        }
        let kept = embargo.withheld.len().min(self.waiting);
        let withheld = &embargo.withheld[embargo.withheld.len() - kept..];
        image.ints[self.ints + 1] = kept as i64;
        for (nth, late) in withheld.iter().enumerate() {
            image.ints[self.arrived + nth] = late.arrived;
            image.ints[self.arrived + self.waiting + nth] = late.run as i64;
            image.ints[self.arrived + 2 * self.waiting + nth] = late.note as i64;
            image.reals[self.truths + nth] = late.truth;
        }
        Ok(())
    }

    pub(super) fn take(&self, image: &Image, known: &mut Node) -> Result<(), CarryError> {
        let instant =
            |place: usize| Some(image.ints[self.ints + place]).filter(|instant| *instant != NEVER);
        if let Some(own) = &known.own {
            let mut state: Online = read(self.node, own)?;
            let Recursion::LeastSquares { learned, last, .. } = &mut state.recursion;
            *learned = self.take_squares(image);
            *last = instant(FADED);
            known.own = written(self.node, &state)?;
        }
        let number = |place: usize| u32::try_from(image.ints[self.ints + place]).unwrap_or(0);
        known.recent = Some(Recent {
            seen: number(3),
            mean_square: image.reals[self.reals],
            refused: number(4),
            weighed: number(5) != 0,
            since: instant(SINCE),
            lesson: instant(LESSON),
        });
        let windows = image.reals[self.windows..].as_chunks::<2>().0;
        known.standing = Some(Standing {
            squares: windows[..WINDOWS.min(number(COUNT) as usize)].to_vec(),
            newest: number(NEWEST) as usize,
            from: instant(FROM),
            last: instant(LAST),
        });
        let Some(embargo) = &mut known.learning else {
            return Ok(());
        };
        let total = image.ints[self.run_ints] as usize;
        let first = (image.ints[self.run_ints + 1] as usize).max(total.saturating_sub(self.runs));
        let pairing = &mut embargo.pairing;
        (pairing.past, pairing.number) = (0, first as u64);
        let time = |run: usize| image.ints[self.run_ints + 3 + run % self.runs];
        let note = |run: usize| image.ints[self.run_ints + 3 + self.runs + run % self.runs] as f64;
        let row = |run: usize| {
            let first = self.rows + (run % self.runs) * self.width;
            let row = &image.reals[first..first + self.width];
            row.iter().copied().chain([note(run)])
        };
        pairing.runs.times = (first..total).map(time).collect();
        pairing.runs.numbers = (first..total).flat_map(row).collect();
        let from = image.ints[self.ints] as usize;
        let withheld = (0..image.ints[self.ints + 1] as usize).map(|nth| {
            let place = (from + nth) % self.waiting;
            Withheld {
                arrived: image.ints[self.arrived + place],
                truth: image.reals[self.truths + place],
                note: image.ints[self.arrived + 2 * self.waiting + place] as f64,
                run: image.ints[self.arrived + self.waiting + place] as u64,
            }
        });
        embargo.withheld = withheld.collect();
        let needed = embargo.withheld.first().map(|late| late.run);
        embargo.pairing.needed = needed.unwrap_or(u64::MAX);
        Ok(())
    }
}
