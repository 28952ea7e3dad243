//! Why samples are left out, whoever decides that: the source, the sequencer or the graph.

use std::sync::atomic::{AtomicU64, Ordering};

macro_rules! reasons {
    ($($(#[$doc:meta])* $reason:ident $name:literal)*) => {
        /// Why a sample is left out.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum LeftOut {
            $($(#[$doc])* $reason,)*
        }

        impl LeftOut {
            /// All reasons.
            pub const ALL: [Self; [$($name),*].len()] = [$(Self::$reason),*];

            /// The reason as programs know it.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$reason => $name,)*
                }
            }
        }
    };
}

reasons! {
    /// It came after its tick.
    Late "late"
    /// Its channel has a sample of this or a later stamp.
    Repeated "repeated"
    /// It is of the future.
    Future "future"
    /// The rule for the source's clock refuses it.
    Clock "clock"
    /// It is infinite or outside of the range of its signal: it was accepted, and is absent at its tick.
    OutOfRange "out_of_range"
    /// There was no room for it, since the engine was behind.
    NoRoom "no_room"
    /// There is no number where one is expected.
    NoNumber "no_number"
    /// The source says that it is not good.
    BadQuality "bad_quality"
    /// The source says that it is doubtful, and none such is to be taken.
    Uncertain "uncertain"
    /// It has no time that can be read.
    NoTime "no_time"
    /// Its time does not go on from that of the row before.
    OutOfOrder "out_of_order"
    /// Its name, or the topic that it came under, is of no channel.
    NoSuchName "no_such_name"
    /// The row or message as a whole cannot be read.
    Unreadable "unreadable"
    /// It was kept by a broker, and is not fresh.
    Retained "retained"
}

/// How many samples were left out, by channel and reason.
#[derive(Debug, Default)]
pub struct LeftOutCounts {
    /// By channel; the last is of none.
    all: Vec<[AtomicU64; LeftOut::ALL.len()]>,
}

impl LeftOutCounts {
    /// Those of so many channels.
    #[must_use]
    pub fn new(channels: usize) -> Self {
        let all = (0..=channels).map(|_| Default::default());
        Self { all: all.collect() }
    }

    /// Counts samples of a channel, or of none where it is not known.
    pub fn count(&self, channel: Option<usize>, reason: LeftOut, samples: u64) {
        let unknown = self.all.len().saturating_sub(1);
        if let Some(of) = self.all.get(channel.unwrap_or(unknown)) {
            of[reason as usize].fetch_add(samples, Ordering::Relaxed);
        }
    }

    /// How many there were of a channel, or of none.
    #[must_use]
    pub fn of(&self, channel: Option<usize>, reason: LeftOut) -> u64 {
        let of = match channel {
            Some(channel) => self.all.get(channel),
            None => self.all.last(),
        };
        of.map_or(0, |of| of[reason as usize].load(Ordering::Relaxed))
    }
}
