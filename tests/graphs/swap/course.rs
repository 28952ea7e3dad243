//! The course of a replacement: a sensor out and a voter in, a shadow that refuses or admits, the way back.

use athermal::core::engine::Carry;
use athermal::core::prng::Prng;
use athermal::run::live::{Control, LiveOptions, Notice, StageError, Stepper, pair};
use athermal::{Instant, Model};

use super::model::{d, model, s};

const DIE_TESTER: &str = include_str!("../../../graphs/die-tester.toml");

/// Temperatures every 10 s and positions every 70 s, all of them drifting.
pub fn rows(
    random: &mut Prng,
    channels: usize,
    temperatures: usize,
    count: usize,
) -> Vec<(Instant, Vec<f64>)> {
    let mut values: Vec<f64> = (0..channels).map(|c| 20.0 + c as f64).collect();
    let mut all = Vec::new();
    for tick in 0..count {
        let mut row = vec![f64::NAN; channels];
        for (channel, value) in values.iter_mut().enumerate() {
            let position = channel >= temperatures;
            *value += if position { 8.0 } else { 0.02 } * random.normal();
            if !position || (tick + channel).is_multiple_of(7) {
                row[channel] = *value;
            }
        }
        all.push((s(tick as i64 * 10), row));
    }
    all
}

pub fn live(model: &Model) -> (Stepper, Control) {
    let options = LiveOptions {
        retain: d(7200),
        keep_warm: d(600),
        ..LiveOptions::default()
    };
    pair(model, options).unwrap()
}

#[test]
fn a_sensor_goes_and_a_voter_comes_and_every_tick_has_a_prediction() {
    let old = model(DIE_TESTER, "0");
    let text = DIE_TESTER
        .replace("inputs.signal = \"temperature\"", "inputs.signal = \"temperature.{holder1,plate2,holder2,room,chuck}\"")
        .replace("[nodes.vote]", "[nodes.last]\ntype = \"persistence\"\neach = \"axis\"\ninputs.truth = \"drift.{axis}\"\nahead = \"5min\"\n\n[nodes.vote]")
        .replace("\"both.{axis}\"]", "\"both.{axis}\", \"last.{axis}\"]")
        .replace("predicted = \"vote\"", "predicted = \"vote\"\nlast = \"last\"");
    let new = model(&text, "0");
    let (mut stepper, mut control) = live(&old);
    let channels = stepper.feed().len();
    for (tick, (time, row)) in rows(&mut Prng::stream(1, "rows"), channels, 6, 600)
        .iter()
        .enumerate()
    {
        if tick == 400 {
            let staged = control.stage(&new, false).unwrap();
            let of = |name: &str| {
                &staged
                    .carry()
                    .iter()
                    .find(|node| node.node == name)
                    .unwrap()
                    .outcome
            };
            assert_eq!(*of("drift"), Carry::Carried);
            assert_eq!(*of("motion.Z1"), Carry::Carried);
            assert!(matches!(of("gradients"), Carry::Warmed { .. }));
            assert_eq!(
                *of("last.Z1"),
                Carry::Warmed {
                    reason: "it is new".into()
                }
            );
            control.commit().unwrap();
        }
        let stepped = stepper.step(*time, row).unwrap();
        assert_eq!(stepped.plan.outputs.len(), if tick < 400 { 6 } else { 12 });
        if tick > 200 {
            for (output, value) in stepped.plan.outputs.iter().zip(stepped.outputs) {
                assert!(!value.is_nan(), "{} at tick {tick}", output.name);
            }
        }
    }
    let took_over = control.pump();
    assert!(
        matches!(took_over[..], [Notice::TookOver { tick: 401, .. }]),
        "{took_over:?}"
    );
}

/// A drift that is a steady 6 nm/min, and estimators that say 6, 7 or 30.
fn constant(prediction: f64) -> Model {
    let text = "schema = 1\n[time]\ncolumn = \"t\"\n[signals.temperature]\nunit = \"Cel\"\nchannels = [\"a\"]\nmax_age = \"1min\"\n\
        [signals.position]\nunit = \"nm\"\nchannels = [\"z\"]\nmax_age = \"1min\"\n\
        [nodes.drift]\ntype = \"slope\"\ninputs.signal = \"position\"\nwindows = [\"1min\"]\nunit = \"nm/min\"\n\
        [nodes.warmth]\ntype = \"slope\"\ninputs.signal = \"temperature\"\nwindows = [\"1min\"]\nunit = \"mK/min\"\n\
        [nodes.thermal]\ntype = \"linear\"\ninputs.features = \"warmth\"\ninputs.truth = \"drift.z\"\nahead = \"1min\"\n\
        [outputs]\npredicted = \"thermal\"\n";
    let mut model = model(text, "0");
    let fit = serde_json::json!({ "type": "linear", "regressors": ["warmth.a"], "coefficients": [0.0], "intercept": prediction });
    let fit: Box<dyn athermal::core::node::Predictor> = serde_json::from_value(fit).unwrap();
    model.fitted.insert("thermal".into(), fit.into());
    model
}

/// Steps so many ticks of 10 s from tick `from` on, with the position rising by 6 nm/min.
fn go(stepper: &mut Stepper, from: i64, count: i64) -> Vec<u64> {
    let step = |tick: i64| {
        let row = [21.0 + (tick % 3) as f64 / 100.0, tick as f64];
        stepper.step(s(tick * 10), &row).unwrap().outputs[0].to_bits()
    };
    (from..from + count).map(step).collect()
}

#[test]
fn a_better_graph_passes_the_shadow_and_a_worse_one_does_not_and_figures_say_why() {
    for (prediction, rmse, passes) in [(7.0, 1.0, true), (30.0, 24.0, false), (6.0, 0.0, true)] {
        let (mut stepper, mut control) = live(&constant(8.0));
        go(&mut stepper, 0, 30);
        control.stage(&constant(prediction), false).unwrap();
        control.shadow(d(600), 0.05).unwrap();
        go(&mut stepper, 30, 30);
        control.pump();
        assert!(!control.verdict().unwrap().over);
        go(&mut stepper, 60, 30);
        control.pump();
        let verdict = control.verdict().unwrap();
        assert!(verdict.over);
        assert_eq!(verdict.passes, Some(passes));
        let output = &verdict.outputs[0];
        assert_eq!((&*output.output, &*output.unit), ("predicted.z", "nm/min"));
        // The first prediction in the shadow is of the truth a minute later.
        assert_eq!(output.n, 60 - 6);
        assert!((output.running_rmse - 2.0).abs() < 1e-9, "{output:?}");
        assert!((output.candidate_rmse - rmse).abs() < 1e-9, "{output:?}");
    }
}

#[test]
fn the_margin_is_what_a_new_graph_may_be_worse_by() {
    for (margin, passes) in [(0.49, false), (0.51, true)] {
        let (mut stepper, mut control) = live(&constant(8.0));
        go(&mut stepper, 0, 30);
        control.stage(&constant(9.0), false).unwrap();
        control.shadow(d(300), margin).unwrap();
        go(&mut stepper, 30, 40);
        control.pump();
        assert_eq!(control.verdict().unwrap().passes, Some(passes));
    }
}

#[test]
fn where_nothing_can_be_compared_nothing_passes() {
    let (mut stepper, mut control) = live(&constant(8.0));
    go(&mut stepper, 0, 30);
    control.stage(&constant(6.0), false).unwrap();
    control.shadow(d(30), 0.0).unwrap();
    go(&mut stepper, 30, 4);
    control.pump();
    let verdict = control.verdict().unwrap();
    assert_eq!(
        (verdict.over, verdict.passes, verdict.ratio),
        (true, None, None)
    );
}

#[test]
fn time_that_starts_again_does_not_confuse_the_shadow() {
    let (mut stepper, mut control) = live(&constant(8.0));
    go(&mut stepper, 1000, 30);
    control.stage(&constant(6.0), false).unwrap();
    control.shadow(d(300), 0.0).unwrap();
    go(&mut stepper, 1030, 10);
    stepper.segment();
    go(&mut stepper, 0, 10);
    control.pump();
    assert!(!control.verdict().unwrap().over);
    go(&mut stepper, 10, 20);
    control.pump();
    let verdict = control.verdict().unwrap();
    assert!(verdict.over);
    assert!((verdict.outputs[0].running_rmse - 2.0).abs() < 1e-9);
    // Six ticks pass before a truth has a prediction, and six more in a segment before there is a first prediction.
    assert_eq!(verdict.outputs[0].n, (10 - 6) + (30 - 6 - 6));
}

#[test]
fn a_graph_that_reads_time_otherwise_is_refused_and_what_runs_goes_on() {
    let running = constant(8.0);
    let (mut stepper, mut control) = live(&running);
    go(&mut stepper, 0, 30);
    let mut other = constant(7.0);
    let plan = std::sync::Arc::make_mut(&mut other.plan);
    let athermal::core::document::TimeBase::Column { column, .. } = &mut plan.time;
    *column = athermal::core::time::TimeColumns::one("t_ms");
    let refused = control.stage(&other, false).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "the new graph reads time from the column `t_ms` in steps of 1s and what runs from the column `t` in steps of 1s: \
         let both have the same [time]"
    );
    assert_eq!(control.commit(), Err(StageError::NothingStaged));
    assert_eq!(go(&mut stepper, 30, 3), vec![8f64.to_bits(); 3]);
}

/// Steps so many segment breaks that an engine on its way has missed more than are kept for it.
fn leave_behind(stepper: &mut Stepper) {
    for _ in 0..300 {
        stepper.segment();
    }
}

#[test]
fn a_graph_that_comes_too_late_is_sent_back_and_can_be_committed_again() {
    let (mut stepper, mut control) = live(&constant(8.0));
    go(&mut stepper, 0, 30);
    let staged = control.stage(&constant(7.0), false).unwrap();
    let carry = staged.carry().to_vec();
    control.commit().unwrap();
    leave_behind(&mut stepper);
    assert_eq!(go(&mut stepper, 30, 7)[6], 8f64.to_bits());
    assert_eq!(control.pump(), [Notice::SentBack]);
    assert_eq!(control.staged().unwrap().carry(), carry);
    control.commit().unwrap();
    assert_eq!(go(&mut stepper, 37, 3), vec![7f64.to_bits(); 3]);
    let told = control.pump();
    assert!(
        matches!(told[..], [Notice::TookOver { tick: 38, .. }]),
        "{told:?}"
    );
    let same = |control: &Control, stepper: &Stepper| {
        let replica = control.replica().unwrap();
        assert_eq!(replica.snapshot(), stepper.engine().snapshot());
    };
    same(&control, &stepper);
    // The way back, too, may be too late at first.
    control.rollback().unwrap();
    leave_behind(&mut stepper);
    assert_eq!(go(&mut stepper, 40, 7)[6], 7f64.to_bits());
    assert_eq!(control.pump(), [Notice::SentBack]);
    control.rollback().unwrap();
    assert_eq!(go(&mut stepper, 47, 3), vec![8f64.to_bits(); 3]);
    control.pump();
    same(&control, &stepper);
}

#[test]
fn the_old_graph_comes_back_as_if_it_had_never_gone_until_it_is_cold() {
    let (old, new) = (constant(8.0), constant(7.0));
    let unswapped = go(&mut live(&old).0, 0, 200);
    let (mut stepper, mut control) = live(&old);
    go(&mut stepper, 0, 30);
    assert_eq!(control.rollback(), Err(StageError::NothingToTakeBack));
    control.stage(&new, false).unwrap();
    control.commit().unwrap();
    assert!(matches!(control.stage(&new, false), Err(StageError::Busy)));
    assert_eq!(control.rollback(), Err(StageError::NothingToTakeBack));
    assert_eq!(go(&mut stepper, 30, 60), vec![7f64.to_bits(); 60]);
    control.rollback().unwrap();
    assert_eq!(go(&mut stepper, 90, 10), unswapped[90..100]);
    // And forward again, for the new graph is now the one that is kept.
    control.rollback().unwrap();
    assert_eq!(go(&mut stepper, 100, 61), vec![7f64.to_bits(); 61]);
    control.pump();
    // Taken over at tick 100, and 600 s later still warm, but no longer.
    assert!(go(&mut stepper, 161, 1) == [7f64.to_bits()]);
    assert_eq!(control.rollback(), Err(StageError::NothingToTakeBack));
}

#[test]
fn when_ticks_are_missed_the_next_graph_is_warmed_and_says_so() {
    let model = constant(8.0);
    let options = LiveOptions {
        mirrored: 16,
        ..LiveOptions::default()
    };
    let (mut stepper, mut control) = pair(&model, options).unwrap();
    go(&mut stepper, 0, 40);
    assert_eq!(stepper.missed(), 24);
    assert_eq!(control.pump(), []);
    go(&mut stepper, 40, 12);
    assert_eq!(control.pump(), [Notice::Missed { ticks: 24 }]);
    assert!(control.replica().is_none());
    let staged = control.stage(&constant(7.0), false).unwrap();
    let lost = "ticks were missed, so that nothing is known of what runs";
    for node in staged.carry() {
        assert_eq!(
            node.outcome,
            Carry::Warmed {
                reason: lost.into()
            }
        );
    }
    assert_eq!(control.shadow(d(60), 0.0), Err(StageError::NotMirrored));
    control.commit().unwrap();
    assert_eq!(go(&mut stepper, 52, 3), vec![7f64.to_bits(); 3]);
    control.pump();
    assert!(control.replica().is_some());
    control.rollback().unwrap();
    assert_eq!(
        go(&mut stepper, 55, 3),
        vec![8f64.to_bits(); 3],
        "what ran came back whole"
    );
}

#[test]
fn a_break_that_is_missed_is_noticed() {
    let options = LiveOptions {
        mirrored: 4,
        ..LiveOptions::default()
    };
    let (mut stepper, mut control) = pair(&constant(8.0), options).unwrap();
    go(&mut stepper, 100, 4);
    stepper.segment();
    control.pump();
    go(&mut stepper, 0, 1);
    assert_eq!(control.pump(), [Notice::Missed { ticks: 1 }]);
}

#[test]
fn what_was_committed_before_ticks_were_missed_still_takes_over_and_is_told() {
    let options = LiveOptions {
        mirrored: 8,
        ..LiveOptions::default()
    };
    let (mut stepper, mut control) = pair(&constant(8.0), options).unwrap();
    go(&mut stepper, 0, 8);
    control.stage(&constant(7.0), false).unwrap();
    control.commit().unwrap();
    assert_eq!(go(&mut stepper, 8, 20)[12..], [7f64.to_bits(); 8]);
    control.pump();
    go(&mut stepper, 28, 1);
    control.pump();
    // Taken over while the first eight were still mirrored.
    assert!(control.replica().is_none());
    control.stage(&constant(6.0), false).unwrap();
    control.commit().unwrap();
    assert_eq!(go(&mut stepper, 29, 10)[9], 6f64.to_bits());
}

#[test]
fn an_engine_that_is_behind_catches_up_through_a_break() {
    let (old, new) = (constant(8.0), constant(7.0));
    let (mut stepper, mut control) = live(&old);
    go(&mut stepper, 100, 30);
    control.stage(&new, false).unwrap();
    control.commit().unwrap();
    stepper.segment();
    let after = go(&mut stepper, 0, 30);
    assert!(
        after[..6].iter().all(|&bits| f64::from_bits(bits).is_nan()),
        "windows start afresh"
    );
    assert_eq!(after[6..], [7f64.to_bits(); 24]);
}

#[test]
fn what_runs_is_fitted_again_on_the_retained_past_and_takes_over() {
    let running = constant(8.0);
    let (mut stepper, mut control) = live(&running);
    go(&mut stepper, 0, 400);
    control.pump();
    let mut refit = control.refit(
        &running,
        s(0),
        s(4000),
        athermal::run::fit::FitOptions::default(),
    );
    let outcome = loop {
        if let Some(outcome) = refit.poll() {
            break outcome;
        }
        std::thread::yield_now();
    };
    let (fitted, _) = outcome.unwrap();
    let staged = control.stage(&fitted, false).unwrap();
    let thermal = staged
        .carry()
        .iter()
        .find(|node| node.node == "thermal")
        .unwrap();
    assert_eq!(
        thermal.outcome,
        Carry::Warmed {
            reason: "it was fitted anew".into()
        }
    );
    control.shadow(d(300), 0.0).unwrap();
    go(&mut stepper, 400, 40);
    control.pump();
    assert_eq!(control.verdict().unwrap().passes, Some(true));
    control.commit().unwrap();
    let after = f64::from_bits(go(&mut stepper, 440, 1)[0]);
    assert!((after - 6.0).abs() < 1e-6, "{after}");
}

#[test]
fn what_was_learned_of_a_new_fit_is_carried_only_when_asked_for_and_said() {
    let vote = |salt: &str| model(DIE_TESTER, salt);
    let (mut stepper, mut control) = live(&vote("0"));
    let channels = stepper.feed().len();
    for (time, row) in rows(&mut Prng::stream(2, "rows"), channels, 6, 300) {
        stepper.step(time, &row).unwrap();
    }
    let of = |control: &mut Control, learned: bool, name: &str| {
        let staged = control.stage(&vote("1"), learned).unwrap();
        staged
            .carry()
            .iter()
            .find(|node| node.node == name)
            .unwrap()
            .outcome
            .clone()
    };
    let changed = "`thermal.Z1`, which it reads, changed".to_owned();
    assert_eq!(
        of(&mut control, false, "vote.Z1"),
        Carry::Warmed {
            reason: changed.clone()
        }
    );
    assert_eq!(
        of(&mut control, true, "vote.Z1"),
        Carry::Adopted { reason: changed }
    );
    assert_eq!(of(&mut control, true, "gradients"), Carry::Carried);
}
