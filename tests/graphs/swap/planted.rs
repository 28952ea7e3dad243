//! That a fault of a swap would be found: into what came of sound cases one of each kind is planted.

use std::panic::{AssertUnwindSafe, catch_unwind};

use athermal::core::engine::Carry;

use super::properties::{Case, Observed, cases_of};

/// So many times each fault is planted.
const TIMES: usize = 5;

/// Plants a fault, where a case has a place for it.
type Plant = fn(&Case<'_>, &mut Observed) -> bool;

const FAULTS: [(&str, Plant); 10] = [
    ("a row is lost", |case, observed| {
        observed.rows.remove(case.swapped().start);
        true
    }),
    ("a row comes twice", |case, observed| {
        let again = observed.rows[case.swapped().start].clone();
        observed.rows.insert(case.swapped().start, again);
        true
    }),
    ("two rows change places", |case, observed| {
        let before = 1..case.swapped().start;
        let other = before
            .rev()
            .find(|&row| observed.rows[row] != observed.rows[row - 1]);
        other.is_some_and(|row| {
            observed.rows.swap(row, row - 1);
            true
        })
    }),
    (
        "an output changes that the edit does not touch",
        |case, observed| {
            let untouched = case.untouched();
            flip(observed, case.swapped().start, |column| {
                untouched.contains(&case.shown(column))
            })
        },
    ),
    ("a graph takes over a row too early", |case, observed| {
        let first = case.swapped().start;
        first > 0 && differs(observed, first - 1, first)
    }),
    ("a graph takes over a row too late", |case, observed| {
        let first = case.swapped().start;
        first > 0 && differs(observed, first, first - 1)
    }),
    (
        "going back leaves something of the new graph",
        |case, observed| {
            let after = case.swapped().end;
            after < observed.rows.len()
                && flip(observed, after, |column| !column.starts_with("slow_"))
        },
    ),
    ("nobody is told that it took over", |_, observed| {
        observed.notices.pop().is_some()
    }),
    ("the report says carried of what is not", |_, observed| {
        let other = observed
            .carry
            .iter_mut()
            .find(|node| node.outcome != Carry::Carried);
        other.is_some_and(|node| {
            node.outcome = Carry::Carried;
            true
        })
    }),
    ("the report says cold of what is carried", |_, observed| {
        let carried = observed
            .carry
            .iter_mut()
            .find(|node| node.outcome == Carry::Carried);
        carried.is_some_and(|node| {
            let reason = String::new();
            node.outcome = Carry::Cold { reason };
            true
        })
    }),
];

/// Flips the last bit of the first of such columns in a row.
fn flip(observed: &mut Observed, row: usize, is_such: impl Fn(&str) -> bool) -> bool {
    let mut columns = observed.rows[row].iter_mut();
    let such = columns.find(|(column, _)| is_such(column));
    such.is_some_and(|(_, bits)| {
        *bits ^= 1;
        true
    })
}

/// Lets a row be of the revision of another, where that is another one.
fn differs(observed: &mut Observed, row: usize, of: usize) -> bool {
    let other = observed.revisions[of].clone();
    let is_other = observed.revisions[row] != other;
    observed.revisions[row] = other;
    is_other
}

#[test]
fn a_fault_of_each_kind_is_found_that_is_planted_in_a_swap() {
    let mut planted = [0; FAULTS.len()];
    for seed in 0..400 {
        if planted.iter().all(|&times| times >= TIMES) {
            return;
        }
        cases_of(seed, |case| {
            for ((name, plant), times) in FAULTS.iter().zip(&mut planted) {
                if *times >= TIMES {
                    continue;
                }
                let mut observed = case.observed();
                case.judge(&observed);
                if plant(case, &mut observed) {
                    let judged = catch_unwind(AssertUnwindSafe(|| case.judge(&observed)));
                    assert!(judged.is_err(), "not found in seed {seed}: {name}");
                    *times += 1;
                }
            }
        });
    }
    panic!("there was not place enough for each: {planted:?}");
}
