//! Decides whether a combiner tells absent votes from zeros, and whether what stands beside a prediction is what it says to be.

use super::super::compared::course;
use super::Subject;
use crate::engine::{Answer, Engine};
use crate::node::Role;
use crate::prng::Prng;

/// How many times each voter is left out.
const DRAWS: usize = 40;

/// How far a sum by weights may be from the answer, as a share of the largest vote.
const ROUNDING: f64 = 1e-9;

/// Votes that are not there are neither zeros nor weighed, and the answer is the sum by the weights.
pub(super) fn votes(subject: &Subject<'_>) -> Result<(), String> {
    let Role::Combiner(combiner) = subject.fixture.plan.nodes[0].spec.role() else {
        return Ok(());
    };
    of_engine(subject, |engine, voters, when| {
        let mut random = Prng::stream(43, "votes");
        for left_out in 0..voters {
            let (mut as_zero, mut counts) = (true, false);
            for _ in 0..DRAWS {
                let mut votes = drawn(&mut random, voters);
                let with = answer(engine, &votes);
                votes[left_out] = 0.0;
                let with_zero = answer(engine, &votes);
                votes[left_out] = f64::NAN;
                let without = answer(engine, &votes);
                let same = |one: f64, two: f64| one == two || (one.is_nan() && two.is_nan());
                as_zero &= same(without.combined, with_zero.combined);
                counts |= !same(without.combined, with.combined);
                if combiner.has_weights() {
                    weighed(&votes, &without).map_err(|found| format!("{when}, {found}"))?;
                }
            }
            if as_zero && counts {
                return Err(format!(
                    "{when}, it takes vote {left_out} of {voters} for zero where that is absent"
                ));
            }
        }
        Ok(())
    })
}

fn weighed(votes: &[f64], answer: &Answer) -> Result<(), String> {
    let Answer {
        combined, weights, ..
    } = answer;
    let pairs = || votes.iter().zip(weights);
    if let Some((_, weight)) = pairs().find(|(vote, weight)| vote.is_nan() && !weight.is_nan()) {
        return Err(format!(
            "of {votes:?} the absent vote weighs {weight} and not NaN"
        ));
    }
    let there = || pairs().filter(|(vote, _)| !vote.is_nan());
    let sum: f64 = there().map(|(vote, weight)| vote * weight).sum();
    let largest = there().fold(0.0_f64, |largest, (vote, _)| largest.max(vote.abs()));
    // False where a weight has no value.
    let close = (sum - combined).abs() <= ROUNDING * largest;
    if combined.is_finite() && !close {
        return Err(format!(
            "the answer to {votes:?} is {combined}, and {sum} by the weights {weights:?}"
        ));
    }
    Ok(())
}

/// Deviations are none below zero; intervals cover a share of the truths, and their ends stand in order about the answer.
pub(super) fn uncertainty(subject: &Subject<'_>) -> Result<(), String> {
    let role = subject.fixture.plan.nodes[0].spec.role();
    if let Role::Combiner(combiner) = role
        && let Some(covers) = combiner.coverage()
    {
        if !(covers > 0.0 && covers < 1.0) {
            return Err(format!(
                "`coverage` says that intervals cover {covers} of the truths, which is no share between 0 and 1"
            ));
        }
        of_engine(subject, |engine, voters, when| {
            let mut random = Prng::stream(47, "votes about an interval");
            for _ in 0..DRAWS {
                let votes = drawn(&mut random, voters);
                let Answer {
                    combined,
                    interval: [lower, upper],
                    ..
                } = answer(engine, &votes);
                let none = lower.is_nan() && upper.is_nan();
                let about = lower <= combined && combined <= upper;
                if !none && !about {
                    return Err(format!(
                        "{when}, the interval about {combined} is from {lower} to {upper}"
                    ));
                }
            }
            Ok(())
        })?;
    }
    if matches!(role, Role::Estimator(_)) {
        let course = subject.usual();
        for (number, slot) in subject.fixture.slots().enumerate() {
            if subject.fixture.port(slot) != "std_dev" {
                continue;
            }
            // What is predicted in the second half comes after all that is to be learned before.
            let half = subject.events().len() / 2;
            let there = |number: usize| course.values(number).skip(half).any(f64::is_finite);
            let predicts = (0..subject.fixture.slots().len()).find(|&number| {
                subject.fixture.port(subject.fixture.slots().start + number) == "prediction"
            });
            if predicts.is_some_and(there) && !there(number) {
                return Err(format!(
                    "`{}` is never there in the second half of the run, though predictions are",
                    subject.name(number)
                ));
            }
            let below = |(_, value): &(_, f64)| *value < 0.0;
            if let Some((now, value)) = course.instants().zip(course.values(number)).find(below) {
                return Err(format!("`{}` is {value} at {now} s", subject.name(number)));
            }
        }
    }
    Ok(())
}

/// Asks a combiner that has seen nothing yet, and one that has learned.
fn of_engine(
    subject: &Subject<'_>,
    ask: impl Fn(&Engine, usize, &str) -> Result<(), String>,
) -> Result<(), String> {
    let voters = subject.given.iter().find(|given| given.port == "voters");
    let voters = voters.map_or(0, |given| given.channels);
    let mut engine = subject.engine();
    ask(&engine, voters, "before any truth")?;
    course(&subject.fixture, &mut engine, subject.events());
    ask(&engine, voters, "once it has learned")
}

/// Whole numbers, which are easily read.
fn drawn(random: &mut Prng, voters: usize) -> Vec<f64> {
    let votes = (0..voters).map(|_| random.between(-1e2, 1e2).round());
    votes.collect()
}

fn answer(engine: &Engine, votes: &[f64]) -> Answer {
    let answer = engine.answer(votes);
    answer.expect("the node of the graph is a combiner")
}
