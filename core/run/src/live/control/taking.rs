//! What an event of the engine thread does to the engines that the control has.

use super::{Committed, Control, Origin, Previous};
use crate::live::handover::{Happening, LiveEngine, Mark};
use crate::live::notice::Notice;
use crate::live::staged::Staged;
use crate::live::tick_view::TickView;
use crate::time::{Duration, Instant};

impl Control {
    /// Does to the engines here what an event did on the engine thread.
    pub(super) fn take_in(&mut self, mark: Mark, notices: &mut Vec<Notice>) {
        let mut row = std::mem::take(&mut self.row);
        row.resize(mark.width as usize, f64::NAN);
        // It was put there together with its mark.
        if self.ticks.pop_entire_slice(&mut row).is_ok() {
            self.take_in_row(mark, &row, notices);
        }
        self.row = row;
    }

    fn take_in_row(&mut self, mark: Mark, row: &[f64], notices: &mut Vec<Notice>) {
        let missed = mark.event - self.event - 1;
        if missed > 0 {
            self.lose(missed, notices);
            self.event += missed;
        }
        if self.replica.is_none() {
            self.take_back(notices);
            self.take_copy(notices);
        }
        self.event = mark.event;
        match mark.what {
            Happening::Break => self.segment(),
            Happening::Freeze(frozen) => self.freeze(frozen),
            Happening::Tick(time) => self.tick(mark, time, row, notices),
        }
    }

    pub(super) fn segment(&mut self) {
        self.last = None;
        self.retained.segment();
        self.watching.segment();
        self.for_all(LiveEngine::segment);
        if let Some(shadow) = self
            .staged
            .as_mut()
            .and_then(|staged| staged.shadow.as_mut())
        {
            shadow.segment();
        }
    }

    pub(super) fn freeze(&mut self, frozen: bool) {
        self.frozen = frozen;
        self.for_all(|live| live.freeze(frozen));
    }

    pub(super) fn tick(
        &mut self,
        mark: Mark,
        time: Instant,
        row: &[f64],
        notices: &mut Vec<Notice>,
    ) {
        let (samples, made) = row.split_at(self.feed.len());
        let elapsed = self.last.map_or(Duration::ZERO, |last| time - last);
        self.last = Some(time);
        self.watching.row(time, samples);
        if let Some(previous) = &mut self.previous {
            previous.left -= elapsed;
            if previous.left < Duration::ZERO {
                self.previous = None;
            }
        }
        if mark.generation != self.generation {
            self.generation = mark.generation;
            self.took_over(mark, time, notices);
        }
        self.for_all(|live| {
            // A tick that ran there runs here: the engines are the same.
            let _ = live.step(time, samples);
        });
        self.retained.push(time, samples);
        self.given_up_there = mark.given_up as usize;
        self.find_given_up();
        let (outputs, values) = made.split_at(self.running.outputs.len());
        let view = TickView {
            at: time,
            event: mark.event,
            revision: &self.revision,
            plan: &self.running,
            outputs,
            engine: self.replica.as_ref().map(|of| &of.engine),
            shown: &self.shown,
            values,
        };
        self.watching.stepped(&view);
        if let Some(look) = &mut self.look {
            look(&view);
        }
        if let (Some(staged), Some(replica)) = (&mut self.staged, &self.replica)
            && let Some(shadow) = &mut staged.shadow
        {
            shadow.look(&replica.engine, &staged.live.engine, time, elapsed);
        }
    }

    /// Finds out which nodes were given up, where what runs is known as it is.
    pub(super) fn find_given_up(&mut self) {
        if let Some(replica) = &self.replica
            && replica.engine.panics().len() > self.given_up.len()
        {
            let panics = replica.engine.panics().iter();
            self.given_up = panics.map(ToString::to_string).collect();
        }
    }

    fn for_all(&mut self, act: impl FnMut(&mut LiveEngine)) {
        let staged = self.staged.iter_mut().map(|staged| &mut staged.live);
        let committed = self.committed.iter_mut();
        let previous = self.previous.iter_mut();
        self.replica
            .iter_mut()
            .chain(staged)
            .chain(committed.filter_map(|committed| committed.live.as_mut()))
            .chain(previous.map(|previous| &mut previous.live))
            .for_each(act);
    }

    fn took_over(&mut self, mark: Mark, time: Instant, notices: &mut Vec<Notice>) {
        self.take_back(notices);
        let returned = self.returned.take();
        let Some(Committed {
            live,
            revision,
            plan,
            shown,
            ..
        }) = self.committed.take()
        else {
            return;
        };
        // The engine that ran stands in where there is no replica of it; a copy of what has taken over stays.
        let is_copy = |of: &mut LiveEngine| of.is_replica && of.revision == revision;
        let copy = self.replica.take_if(|of| live.is_none() && is_copy(of));
        let old = self.replica.take().or_else(|| {
            returned
                .map(|returned| *returned)
                .filter(|returned| returned.event + 1 == mark.event)
        });
        notices.push(Notice::TookOver {
            revision: revision.clone(),
            tick: mark.tick,
            time,
        });
        self.retained.keep(self.options.retain.max(plan.warm_up));
        (self.running, self.revision, self.shown) = (plan, revision, shown);
        self.given_up.clear();
        self.is_lost |= live.is_none() && copy.is_none();
        self.replica = copy;
        if let (Some(mut live), Some(old)) = (live, old) {
            live.take_over(&old.engine);
            self.replica = Some(live);
            self.look_into();
            self.previous = Some(Previous {
                live: old,
                left: self.options.keep_warm,
            });
        }
        self.watch_on(time);
    }

    /// Takes what the engine thread has sent back; it is freed here.
    pub(super) fn take_back(&mut self, notices: &mut Vec<Notice>) {
        while let Ok(returned) = self.returning.pop() {
            if returned.is_replica {
                self.copy = Some(returned);
                continue;
            }
            if !returned.refused {
                self.returned = Some(returned);
                continue;
            }
            notices.push(Notice::SentBack);
            let Some(Committed {
                live: Some(live),
                origin,
                ..
            }) = self.committed.take()
            else {
                continue;
            };
            match origin {
                Origin::Staged { carry, past, gave } => {
                    self.staged = Some(Staged {
                        live,
                        carry,
                        past,
                        gave,
                        shadow: None,
                    });
                }
                Origin::Previous { left } => self.previous = Some(Previous { live, left }),
            }
        }
    }

    pub(super) fn lose(&mut self, ticks: u64, notices: &mut Vec<Notice>) {
        notices.push(Notice::Missed { ticks });
        self.last = None;
        self.is_lost = true;
        self.replica = None;
        self.staged = None;
        self.previous = None;
        // The engine thread has what was committed, and may yet take it over.
        if let Some(committed) = &mut self.committed {
            committed.live = None;
        }
        self.retained.clear();
    }
}
