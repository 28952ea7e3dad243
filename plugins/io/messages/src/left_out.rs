//! What a source leaves out: counted by channel and reason, shown the first time, and then ever more rarely.

use std::collections::BTreeMap;
use std::fmt;

use athermal_serve::connector::{LeftOut, Outflow};

use crate::payload::Reason;

/// What was left out, by channel and reason; no channel where it is not known.
#[derive(Debug, Default)]
pub struct LeftOutCounts(BTreeMap<(Option<usize>, Reason), u64>);

impl LeftOutCounts {
    /// Counts one of each of these channels, and reports it where it is the first of its channel and reason, the tenth, the hundredth …
    pub fn count(
        &mut self,
        (channels, reason): (&[usize], Reason),
        topic: &str,
        what: &dyn fmt::Display,
        out: &Outflow,
    ) {
        let kind = kind(reason);
        match channels {
            [] => out.left_out(None, kind, 1),
            all => all.iter().for_each(|of| out.left_out(Some(*of), kind, 1)),
        }
        let known = (channels.first().copied(), reason);
        let count = self.0.entry(known).or_default();
        *count += 1;
        if count
            .checked_ilog10()
            .is_none_or(|of| 10_u64.pow(of) != *count)
        {
            return;
        }
        let so_far = match *count {
            1 => "others like it are counted".to_owned(),
            count => format!("{count} so far"),
        };
        let topic: String = topic.chars().take(100).collect();
        let (topic, what) = (topic.escape_debug(), what.to_string());
        let what = if what.is_empty() {
            what
        } else {
            format!(": {what}")
        };
        out.remarks().report(format_args!(
            "`{topic}`: left out, since {reason}{what}; {so_far}"
        ));
    }
}

/// The reason as all sources count it.
fn kind(reason: Reason) -> LeftOut {
    match reason {
        Reason::Empty | Reason::TooLong | Reason::NotText | Reason::NotJson | Reason::TooDeep => {
            LeftOut::Unreadable
        }
        Reason::NotThere
        | Reason::Null
        | Reason::NotANumber
        | Reason::Truth
        | Reason::NotFinite => LeftOut::NoNumber,
        Reason::NoTime | Reason::WrongTime => LeftOut::NoTime,
        Reason::Bad => LeftOut::BadQuality,
        Reason::NoName | Reason::UnknownName | Reason::NoMapping => LeftOut::NoSuchName,
        Reason::Retained => LeftOut::Retained,
    }
}
