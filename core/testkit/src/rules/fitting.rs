//! Decides whether an estimator or encoder can be fitted, on good data and bad, and keeps what it learned in a model.

use super::super::compared::course;
use super::Subject;
use crate::channel::ABSENT;
use crate::engine::Fitted;
use crate::fit::{FitOptions, fit};
use crate::model::Model;
use crate::node::{Feature, LinearForm, Read, Role};
use crate::prng::Prng;
use crate::recording::Table;
use crate::time::Instant;

pub(super) fn fits(subject: &Subject<'_>) -> Result<(), String> {
    if let Role::Feature(feature) = subject.fixture.plan.nodes[0].spec.role() {
        encodes(subject, feature)?;
    }
    if !subject.is_fitted() {
        return Ok(());
    }
    if let Role::Estimator(estimator) = subject.fixture.plan.nodes[0].spec.role()
        && subject.learns()
        && estimator.keeps_range()
        && let mut predictors = subject.fitted.values()
        && predictors.any(|predictor| predictor.trained_range().is_none())
    {
        return Err(
            "it says that a fit keeps the range of its regressors, and its predictor has no `trained_range`: `learn = { margin = … }` \
             would be taken and do nothing"
                .to_owned(),
        );
    }
    let one = written(&subject.fitted)?;
    for threads in [1, 3] {
        let again = written(&subject.fit(&subject.table, threads)?)?;
        if again != one {
            return Err(format!(
                "fitted again, with {threads} threads, it is another: {one} and {again}"
            ));
        }
    }
    for (table, what) in unusable(&subject.table) {
        survives(subject, &table, &FitOptions::default())
            .map_err(|found| format!("fitted on {what}, {found}"))?;
    }
    let streamed = FitOptions {
        memory: 1,
        ..FitOptions::default()
    };
    survives(subject, &subject.table, &streamed)
        .map_err(|found| format!("fitted on rows that are streamed rather than kept, {found}"))
}

/// A feature is fitted where it has both an encoder and a truth to learn from, and has nothing to say before.
fn encodes(subject: &Subject<'_>, feature: &dyn Feature) -> Result<(), String> {
    let mut ports = (subject.kind.inputs)().iter();
    let has_truth = ports.any(|port| port.read == Read::Truth);
    match (feature.encoder().is_some(), has_truth) {
        (true, false) => Err(
            "it has an encoder, and no port made by `InputPort::truth` to learn from".to_owned(),
        ),
        (false, true) => {
            Err("it has a port `truth`, and no encoder that learns from it".to_owned())
        }
        (false, false) => Ok(()),
        (true, true) => {
            let fixture = &subject.fixture;
            let unfitted = course(
                fixture,
                &mut fixture.engine(&Fitted::new()),
                subject.events(),
            );
            let mut slots = 0..fixture.slots().len();
            if slots.any(|number| unfitted.values(number).any(f64::is_finite)) {
                return Err("it gives values before it has been fitted".to_owned());
            }
            Ok(())
        }
    }
}

/// Data that allow no fit, or hardly one.
fn unusable(table: &Table) -> [(Table, &'static str); 5] {
    let changed = |change: &dyn Fn(usize, &mut [f64])| {
        let mut table = table.clone();
        for (tick, (_, row)) in table.events_mut().iter_mut().enumerate() {
            change(tick, row);
        }
        table
    };
    let few = |tick: usize| if tick < 12 { tick as f64 } else { ABSENT };
    let nothing = changed(&|_, row| row.fill(ABSENT));
    let dozen = changed(&|tick, row| row.fill(few(tick)));
    let still = changed(&|_, row| row.fill(20.5));
    let alike = changed(&|tick, row| row.fill((tick % 7) as f64));
    [
        (Table::default(), "no ticks"),
        (nothing, "ticks that measure nothing"),
        (dozen, "a dozen rows"),
        (still, "channels that never change"),
        (alike, "channels that are all the same"),
    ]
}

/// A fit may fail in words; what it gives must be written, read and run, and predict nothing infinite.
fn survives(subject: &Subject<'_>, table: &Table, options: &FitOptions) -> Result<(), String> {
    let (fitted, _) = fit(&subject.fixture.plan, table, options, &mut |_| ())
        .map_err(|error| error.to_string())?;
    let fitted = through_a_model(subject, &fitted)?;
    let mut engine = subject.fixture.engine(&fitted);
    let course = course(&subject.fixture, &mut engine, subject.events());
    let mut slots = 0..subject.fixture.slots().len();
    match slots.any(|number| course.find(number, f64::is_infinite).is_some()) {
        true => Err("it predicts infinity".to_owned()),
        false => Ok(()),
    }
}

pub(super) fn models(subject: &Subject<'_>) -> Result<(), String> {
    if !subject.is_fitted() {
        return Ok(());
    }
    let fixture = &subject.fixture;
    let read = through_a_model(subject, &subject.fitted)?;
    let before = subject.usual();
    let after = course(fixture, &mut fixture.engine(&read), subject.events());
    match before.difference(&after, fixture) {
        None => Ok(()),
        Some(difference) => Err(format!(
            "read back from its model, it predicts otherwise: {difference}"
        )),
    }
}

pub(super) fn linear(subject: &Subject<'_>) -> Result<(), String> {
    let mut random = Prng::stream(41, "rows for a linear form");
    for predictor in subject.fitted.values() {
        let used = predictor.uses().len();
        if let Some(form) = predictor.linear() {
            is_predicted(form, used, &mut random, |row| predictor.predict(row))
                .map_err(|found| format!("it {found}"))?;
        }
        let Some(mut learner) = predictor.learner() else {
            continue;
        };
        for seconds in 1..10 {
            let at = Instant::from_ns(seconds * 1_000_000_000);
            if let Some(form) = learner.linear() {
                is_predicted(form, used, &mut random, |row| learner.predict(row, at))
                    .map_err(|found| format!("its learner {found}"))?;
            }
            let row: Vec<_> = (0..used).map(|_| random.normal()).collect();
            learner.learn(&row, random.normal(), at);
        }
    }
    Ok(())
}

/// A linear form is what is predicted from any regressors.
fn is_predicted(
    form: LinearForm<'_>,
    used: usize,
    random: &mut Prng,
    predict: impl Fn(&[f64]) -> f64,
) -> Result<(), String> {
    let found = form.coefficients.len();
    if found != used {
        return Err(format!(
            "has a linear form of {found} coefficients for {used} regressors"
        ));
    }
    for _ in 0..100 {
        let row: Vec<_> = (0..used).map(|_| random.between(-1e3, 1e3)).collect();
        let (form, predicted) = (form.at(&row), predict(&row));
        if form.to_bits() != predicted.to_bits() {
            return Err(format!(
                "predicts {predicted:?} from regressors of which its linear form is {form:?}"
            ));
        }
    }
    Ok(())
}

/// What was fitted, written into a model and read back.
fn through_a_model(subject: &Subject<'_>, fitted: &Fitted) -> Result<Fitted, String> {
    let text = text_of(subject, fitted)?;
    let read = Model::from_text("model.json", text.clone())
        .map_err(|error| format!("its model cannot be read back: {error}"))?;
    let again = read.to_text().map_err(|error| error.to_string())?;
    if again == text {
        Ok(read.fitted)
    } else {
        Err(format!(
            "its model, read back, is written otherwise: {text} and {again}"
        ))
    }
}

/// The text of a model of what was fitted.
pub(super) fn text_of(subject: &Subject<'_>, fitted: &Fitted) -> Result<String, String> {
    let model = Model {
        graph: subject.fixture.graph.clone().into(),
        plan: subject.fixture.plan.clone(),
        fitted: fitted.clone(),
        card: None,
    };
    model
        .to_text()
        .map_err(|error| format!("its model cannot be written: {error}"))
}

/// What was fitted, as a model holds it.
fn written(fitted: &Fitted) -> Result<String, String> {
    let of = |(node, predictor): (&String, &std::sync::Arc<dyn crate::node::Predictor>)| {
        serde_json::to_string(&**predictor)
            .map(|text| format!("{node}: {text}"))
            .map_err(|error| format!("what was fitted cannot be written: {error}"))
    };
    let all: Result<Vec<_>, _> = fitted.iter().map(of).collect();
    Ok(all?.join("\n"))
}
