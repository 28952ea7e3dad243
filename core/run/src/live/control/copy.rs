//! How the replica comes back after something was missed: a copy of what runs, taken where all before it has been taken in.

use super::{Control, Notice};

impl Control {
    /// Takes the copy where nothing more is on its way: what was missed last may have no tick behind it that shows it.
    pub(super) fn take_copy_at_rest(&mut self, notices: &mut Vec<Notice>) {
        if let Some(copy) = &self.copy
            && self.ticks.is_empty()
            && !(self.next_ticks.is_some() && self.ticks.is_abandoned())
            && copy.event > self.event
        {
            let (event, missed) = (copy.event, copy.event - self.event);
            self.lose(missed, notices);
            self.event = event;
        }
        self.take_copy(notices);
    }

    /// Takes the copy of what runs as the replica, where it is at the same place.
    pub(super) fn take_copy(&mut self, notices: &mut Vec<Notice>) {
        let at = self.event;
        let Some(copy) = self.copy.take_if(|copy| copy.event <= at) else {
            return;
        };
        if copy.event == at && self.replica.is_none() {
            self.frozen = copy.engine.frozen();
            self.replica = Some(*copy);
            self.look_into();
            self.find_given_up();
            notices.extend(std::mem::take(&mut self.is_lost).then_some(Notice::Mirrored));
        }
    }
}
