//! What is known of series in which leaps are looked for, between its form in a snapshot and its place in the arrays of the runtime.

use super::image::Image;
use super::snapshot::{Course, Sizes};
use crate::form::Record;

impl Image {
    pub(super) fn put_course(&mut self, to: &Record, course: &Course) {
        let (ints, reals) = (to.place_of("ints"), to.place_of("reals"));
        let Course { last, newest, .. } = course;
        let instants = [last.map(|of| of.0), newest.map(|of| of.0)];
        let instants = instants.into_iter().chain([course.leapt, course.suspected]);
        for (nth, instant) in instants.enumerate() {
            self.put_time(ints + 2 * nth, instant);
        }
        let sizes = [&course.changes, &course.steps, &course.bends];
        let seen = sizes.map(|of| i64::from(of.seen));
        self.ints[ints + 8] = i64::from(course.before.is_some());
        self.ints[ints + 9..][..3].copy_from_slice(&seen);
        self.ints[ints + 12] = course.gaps.into();
        self.ints[ints + 13] = course.homed as i64;
        let changes = [last.map(|of| of.1), newest.map(|of| of.1), course.before];
        let numbers = (changes.into_iter().map(|of| of.unwrap_or(0.0)))
            .chain(sizes.into_iter().flat_map(|of| of.of))
            .chain([course.gap])
            .chain(course.homes);
        for (nth, number) in numbers.enumerate() {
            self.reals[reals + nth] = number;
        }
    }

    pub(super) fn course(&self, from: &Record) -> Course {
        let (ints, reals) = (from.place_of("ints"), from.place_of("reals"));
        let (known, numbers) = (&self.ints[ints..], &self.reals[reals..]);
        let count = |nth: usize| u32::try_from(known[nth]).unwrap_or(u32::MAX);
        let with = |nth: usize, number: f64| self.time(ints + nth).map(|at| (at, number));
        let sizes = |nth: usize| Sizes {
            of: [numbers[3 + 2 * nth], numbers[4 + 2 * nth]],
            seen: count(9 + nth),
        };
        Course {
            last: with(0, numbers[0]),
            newest: with(2, numbers[1]),
            before: (known[8] != 0).then(|| numbers[2]),
            changes: sizes(0),
            steps: sizes(1),
            bends: sizes(2),
            gap: numbers[9],
            gaps: count(12),
            leapt: self.time(ints + 4),
            suspected: self.time(ints + 6),
            homes: std::array::from_fn(|nth| numbers[10 + nth]),
            homed: known[13] as usize,
        }
    }
}
