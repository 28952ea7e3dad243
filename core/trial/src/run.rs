//! Decides how a test is run: the engine taken through the data; not what is noted on the way, nor whether it is as expected.

use std::sync::Arc;

use super::declare::Trial;
use super::judge::{Finding, judge};
use super::observed::Observed;
use crate::compile::Plan;
use crate::engine::{Engine, Fitted};
use crate::fault::{FaultError, WithFaults};
use crate::fit::FitError;
use crate::recording::{Event, Recording, pass};
use crate::time::Duration;

/// The seed of the spikes and noise of faults.
const FAULT_SEED: u64 = 1;

/// What came of a test.
#[derive(Debug, Clone, Default)]
pub struct Verdict {
    /// Everything that was checked, in the order of the file.
    pub findings: Vec<Finding>,
    /// Ticks stepped.
    pub ticks: u64,
}

impl Verdict {
    /// Whether everything is as expected.
    #[must_use]
    pub fn passes(&self) -> bool {
        self.findings.iter().all(Finding::holds)
    }
}

/// Steps the plan over the data of a test, with its faults, and checks what comes out.
///
/// The plan is one that [`super::observe`] has seen the test.
///
/// # Errors
/// When the data cannot be read, a fault begins after their end, or the fit does not belong to the plan.
pub fn run(
    plan: &Arc<Plan>,
    trial: &Trial,
    fitted: &Fitted,
    data: &dyn Recording,
) -> Result<Verdict, FitError> {
    let faulty = WithFaults::new(data, trial.faults.clone(), FAULT_SEED);
    let data: &dyn Recording = if trial.faults.is_empty() {
        data
    } else {
        &faulty
    };
    let mut engine = Engine::new(Arc::clone(plan), fitted)?;
    let mut observed = Observed::new(plan, trial);
    let (mut first, mut length) = (None, Duration::ZERO);
    let passed = pass(&mut engine, data, |engine, event, _| {
        observed.look(engine, event);
        match event {
            Event::Row(at) => length = length.max(at - *first.get_or_insert(at)),
            Event::Segment => first = None,
        }
    })?;
    if let Some(late) = trial.faults.iter().find(|fault| fault.from > length) {
        let late = FaultError::Late {
            channel: late.channel.clone(),
            from: late.from,
            length,
        };
        return Err(FitError::Recording(Box::new(late)));
    }
    let expectations = trial.expect.iter();
    Ok(Verdict {
        findings: expectations
            .flat_map(|expectation| judge(plan, expectation, &observed))
            .collect(),
        ticks: passed.ticks,
    })
}
