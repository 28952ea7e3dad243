//! What a source leaves out: counted by reason, shown the first time, and then ever more rarely.

use std::collections::BTreeMap;
use std::fmt;

use athermal_serve::connector::Remarks;

use crate::payload::Reason;

/// What was left out, by reason.
#[derive(Debug, Default)]
pub struct LeftOutCounts(BTreeMap<Reason, u64>);

impl LeftOutCounts {
    /// Counts one, and reports it where it is the first of its reason, the tenth, the hundredth …
    pub fn count(&mut self, reason: Reason, topic: &str, what: &dyn fmt::Display, to: &Remarks) {
        let count = self.0.entry(reason).or_default();
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
        to.report(format_args!(
            "`{topic}`: left out, since {reason}{what}; {so_far}"
        ));
    }
}
