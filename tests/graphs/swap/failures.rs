//! What fails beside a running graph: a source in the middle, a node while it is fitted again. Nothing waits for ever, and what was
//! put out lasts.

use athermal::core::compile::Plan;
use athermal::run::fit::{FitError, FitOptions};
use athermal::run::live::{Frame, Refit, RunError, Sink, SinkError, StageError, run};
use athermal::run::recording::{Event, Recording, Samples, Source, SourceError};

use super::course::live;
use super::model::{model, s};
use crate::workbench::problems;

/// A graph that puts out what it measures, in this unit.
fn shown(unit: &str, output: &str) -> String {
    format!(
        "schema = 1\n[time]\ncolumn = \"t\"\n[signals.position]\nunit = \"{unit}\"\nchannels = [\"Z\"]\nmax_age = \"1min\"\n\
         [nodes.shown]\ntype = \"pick\"\ninputs.signal = \"position.Z\"\nnames = [\"Z\"]\n[outputs]\n{output} = \"shown\"\n"
    )
}

/// Three rows, and then no more for a reason.
struct Unplugged(i64);

impl Source for Unplugged {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
        self.0 += 1;
        if self.0 > 3 {
            return Err("unplugged".into());
        }
        samples.values = vec![1.0];
        Ok(Some(Event::Row(s(self.0))))
    }
}

/// Holds back what it is given until it is told to finish.
#[derive(Default)]
struct Holding {
    held: usize,
    lasting: usize,
}

impl Sink for Holding {
    fn put(&mut self, _frame: &Frame<'_>) -> Result<(), SinkError> {
        self.held += 1;
        Ok(())
    }

    fn finish(&mut self) -> Result<(), SinkError> {
        self.lasting += std::mem::take(&mut self.held);
        Ok(())
    }
}

#[test]
fn what_was_put_out_before_a_source_fails_lasts() {
    let mut engine = model(&shown("nm", "seen"), "0").engine().unwrap();
    let mut sink = Holding::default();
    let ended = run(&mut engine, &mut Unplugged(0), &mut sink);
    assert!(matches!(ended, Err(RunError::Source(error)) if error.to_string() == "unplugged"));
    assert_eq!((sink.held, sink.lasting), (0, 3));
}

/// A recording of a node that panics.
struct Panicking;

impl Recording for Panicking {
    fn open(&self, _plan: &Plan) -> Result<Box<dyn Source + '_>, SourceError> {
        panic!("this node has a mistake")
    }
}

#[test]
fn a_refit_in_which_a_node_panics_is_over() {
    let running = model(&shown("nm", "seen"), "0");
    let mut polled = Refit::on(&running, Panicking, FitOptions::default());
    let outcome = loop {
        if let Some(outcome) = polled.poll() {
            break outcome;
        }
        std::thread::yield_now();
    };
    assert!(matches!(outcome, Err(FitError::Panicked { .. })));
    assert!(polled.poll().is_none(), "it is given once");
    let waited = Refit::on(&running, Panicking, FitOptions::default()).wait();
    assert!(matches!(waited, Some(Err(FitError::Panicked { .. }))));
}

#[test]
fn a_staged_graph_is_set_against_the_one_that_a_rollback_brought_back() {
    let first = model(&shown("nm", "seen"), "0");
    let second = model(&shown("nm", "other"), "0");
    let staged = model(&shown("um", "seen"), "0");
    let (mut stepper, mut control) = live(&first);
    let mut tick = 0;
    let mut step = |count: i64| {
        for _ in 0..count {
            tick += 1;
            stepper.step(s(tick), &[1.0]).unwrap();
        }
    };
    step(3);
    control.stage(&second, false).unwrap();
    control.commit().unwrap();
    step(3);
    control.pump();
    control.stage(&staged, false).unwrap();
    control.rollback().unwrap();
    step(3);
    control.pump();
    assert!(matches!(
        control.commit(),
        Err(StageError::OtherUnit { .. })
    ));
    assert!(control.staged().is_some(), "what is staged stays so");
}

#[test]
fn a_rate_at_which_no_output_passes_over_is_a_mistake() {
    let blended = |rate: &str| {
        shown("nm", "seen").replace(
            "= \"shown\"\n",
            &format!("= {{ from = \"shown\", blend = \"{rate}\" }}\n"),
        )
    };
    for rate in ["5 nm", "5 K/s", "0 nm/s", "-5 nm/s"] {
        let told = problems(&blended(rate));
        let told_of = format!(
            "`blend` is {rate}, and `seen.Z` can only pass over at a rate above zero in nm/s"
        );
        assert!(
            told.contains("error[A057]") && told.contains(&told_of),
            "{told}"
        );
    }
    model(&blended("300 nm/min"), "0");
}
