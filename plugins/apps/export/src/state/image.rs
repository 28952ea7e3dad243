//! The state of an exported graph as it lies in memory, and as `NAME_save` writes it.

use athermal_core::engine::fnv_1a;

use super::snapshot::{Past, PastEntry};
use crate::c::bits;
use crate::form::{Form, History};

/// What every saved state begins with.
const NAME: u64 = 0x3220_4320_6874_6120;
const HEADER: usize = 5;

/// The two arrays.
pub(super) struct Image {
    pub(super) ints: Vec<i64>,
    pub(super) reals: Vec<f64>,
}

impl Image {
    /// That of a cold start, but for what nodes begin with.
    pub(super) fn new(form: &Form) -> Self {
        Self {
            ints: vec![0; form.layout.ints],
            reals: vec![0.0; form.layout.saved()],
        }
    }

    pub(super) fn to_bytes(&self, revision: u64) -> Vec<u8> {
        let (ints, reals) = (self.ints.len() as u64, self.reals.len() as u64);
        let mut words = vec![NAME, revision, ints, reals, 8];
        words.extend(self.ints.iter().map(|&value| value as u64));
        words.extend(self.reals.iter().map(|&value| bits(value)));
        let mut bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let checksum = fnv_1a(&bytes);
        bytes.extend_from_slice(&checksum.to_le_bytes());
        bytes
    }

    pub(super) fn from_bytes(
        bytes: &[u8],
        form: &Form,
        revision: u64,
    ) -> Result<Self, &'static str> {
        let (words, rest) = bytes.as_chunks::<8>();
        let words: Vec<u64> = words.iter().map(|word| u64::from_le_bytes(*word)).collect();
        let layout = form.layout;
        if !rest.is_empty() || words.len() != HEADER + layout.ints + layout.saved() + 1 {
            return Err("another length than its states have");
        }
        let (last, body) = words.split_last().ok_or("there are none")?;
        if fnv_1a(&bytes[..8 * body.len()]) != *last {
            return Err("the checksum does not fit");
        }
        let (ints, reals) = (layout.ints as u64, layout.saved() as u64);
        if body[..HEADER] != [NAME, revision, ints, reals, 8] {
            return Err("another graph, fit or precision");
        }
        let (ints, reals) = body[HEADER..].split_at(layout.ints);
        Ok(Self {
            ints: ints.iter().map(|&word| word as i64).collect(),
            reals: reals.iter().map(|&word| f64::from_bits(word)).collect(),
        })
    }

    /// Of the past of a channel as much as there is room for.
    pub(super) fn put_history(&mut self, to: &History, past: &Past) {
        let kept = past.entries.len().min(to.room);
        let entries = &past.entries[past.entries.len() - kept..];
        self.ints[to.ints] = 0;
        self.ints[to.ints + 1] = kept as i64;
        for (nth, entry) in entries.iter().enumerate() {
            self.ints[to.ints + 2 + nth] = entry.at;
            if to.stamped {
                self.ints[to.ints + 2 + to.room + nth] = entry.stamp;
            }
            self.reals[to.reals + nth] = entry.value;
        }
    }

    pub(super) fn history(&self, from: &History) -> Vec<PastEntry> {
        let first = self.ints[from.ints] as usize;
        let entry = |nth: usize| {
            let place = (first + nth) % from.room;
            let at = self.ints[from.ints + 2 + place];
            PastEntry {
                at,
                value: self.reals[from.reals + place],
                stamp: match from.stamped {
                    true => self.ints[from.ints + 2 + from.room + place],
                    false => at,
                },
            }
        };
        (0..self.ints[from.ints + 1] as usize).map(entry).collect()
    }
}
