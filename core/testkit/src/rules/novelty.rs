//! What the port `novelty` of an estimator says, and what it does to predictions.

use super::super::compared::course;
use super::super::fixture::Fixture;
use super::Subject;
use crate::node::{Predictor, Role};
use crate::prng::Prng;

/// The most ticks of a hundred on the data of the fit that may lie outside of it: one row of a thousand does, and runs between rows.
const MOST_OUTSIDE: usize = 5;

/// Novelty is not negative, hardly ever above 1 on the data of the fit, above 1 somewhere far from them, and up to 1 changes nothing.
pub(super) fn novelty(subject: &Subject<'_>) -> Result<(), String> {
    let Role::Estimator(estimator) = subject.fixture.plan.nodes[0].spec.role() else {
        return Ok(());
    };
    let reads = |of: &dyn Predictor| !of.uses().is_empty();
    if !estimator.has_novelty() || !subject.fitted.values().any(|of| reads(&**of)) {
        return Ok(());
    }
    of_predictors(subject)?;
    of_course(subject)
}

fn of_predictors(subject: &Subject<'_>) -> Result<(), String> {
    let mut random = Prng::stream(53, "rows far outside");
    for predictor in subject.fitted.values() {
        let used = predictor.uses().len();
        if used == 0 {
            continue;
        }
        let mut row: Vec<f64> = vec![0.0; used];
        let mut largest = f64::NAN;
        for _ in 0..100 {
            row.fill_with(|| 1e6 * random.normal());
            let novelty = predictor.novelty(&row);
            if novelty < 0.0 {
                return Err(format!("the novelty of {row:?} is {novelty}"));
            }
            largest = largest.max(novelty);
        }
        if largest.is_nan() {
            return Err("it says `has_novelty`, and its fit gives none".to_owned());
        }
        if largest <= 1.0 {
            return Err(format!(
                "of 100 rows far outside of its fit the largest novelty is {largest}"
            ));
        }
    }
    Ok(())
}

fn of_course(subject: &Subject<'_>) -> Result<(), String> {
    let run = |outside: &str| {
        let mut parameters = subject.parameters.clone();
        parameters.insert("outside".to_owned(), outside.into());
        let fixture = Fixture::new(subject.kind, &parameters, &subject.given)?;
        let mut engine = fixture.engine(&subject.fitted);
        Ok::<_, String>(course(&fixture, &mut engine, subject.events()))
    };
    let (passed, shrunk) = (run("pass")?, run("shrink")?);
    let first = subject.fixture.slots().start;
    let slots = 0..subject.fixture.slots().len();
    let of_port = |name: &str| {
        let is = |number: &usize| subject.fixture.port(first + number) == name;
        slots.clone().filter(is).collect::<Vec<_>>()
    };
    for (prediction, novelty) in of_port("prediction").into_iter().zip(of_port("novelty")) {
        let values = passed.values(prediction).zip(shrunk.values(prediction));
        let (mut outside, mut all) = (0, 0);
        for ((passed, shrunk), novelty) in values.zip(shrunk.values(novelty)) {
            all += usize::from(!novelty.is_nan());
            if novelty > 1.0 {
                outside += 1;
            } else if passed.to_bits() != shrunk.to_bits() {
                return Err(format!(
                    "at a novelty of {novelty} it predicts {passed} where `outside` is \"pass\", and {shrunk} where it is \"shrink\""
                ));
            }
        }
        if 100 * outside > MOST_OUTSIDE * all {
            return Err(format!(
                "`{}` is above 1 at {outside} of {all} ticks of the data of the fit",
                subject.name(novelty)
            ));
        }
    }
    Ok(())
}
