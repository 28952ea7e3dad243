//! Decides whether a node has anything to say, in all of the channels that it declares.

use super::super::tried::tried;
use super::Subject;

/// Something comes out in each case, and out of each channel in one of those that have it.
pub(super) fn answers(subject: &Subject<'_>, all: &[Subject<'_>]) -> Result<(), String> {
    let slots = subject.fixture.slots();
    if slots.is_empty() {
        return Err("the node has no output".to_owned());
    }
    if !slots.clone().any(|slot| speaks(subject, slot)) {
        return Err(format!(
            "nothing comes out of the node in {} ticks about {} apart",
            subject.ticks(),
            subject.case.every
        ));
    }
    // Whether a deviation that is promised comes is another rule.
    let slots = slots.filter(|&slot| subject.fixture.port(slot) != "std_dev");
    for slot in slots {
        let place = place(subject, slot);
        let mut same = all.iter().flat_map(|other| {
            let slots = other.fixture.slots();
            let same = slots.filter(|slot| self::place(other, *slot) == place);
            same.map(move |slot| (other, slot))
        });
        // What never comes is reported once.
        let is_first = same
            .clone()
            .next()
            .is_some_and(|(other, _)| std::ptr::eq(other, subject));
        if is_first && !same.any(|(other, slot)| may_speak(other, slot)) {
            let name = &subject.fixture.plan.channels[slot].name;
            return Err(format!("`{name}` has no value at any tick of any case"));
        }
    }
    Ok(())
}

/// Where a channel stands: its port, and its number there.
fn place<'a>(subject: &'a Subject<'_>, slot: usize) -> (&'a str, usize) {
    let port = subject.fixture.port(slot);
    let before = subject.fixture.slots().start..slot;
    let before = before.filter(|&slot| subject.fixture.port(slot) == port);
    (port, before.count())
}

fn speaks(subject: &Subject<'_>, slot: usize) -> bool {
    let number = slot - subject.fixture.slots().start;
    subject.usual().values(number).any(f64::is_finite)
}

/// The same of any case; of one in which it panics, which is reported there, nothing is known.
fn may_speak(subject: &Subject<'_>, slot: usize) -> bool {
    tried(|| Ok(speaks(subject, slot))).unwrap_or(true)
}
