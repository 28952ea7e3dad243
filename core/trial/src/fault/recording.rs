//! Decides how faults reach the rows of any recording; not what a fault does to a value.

use super::{FaultSpec, Faults};
use crate::compile::Plan;
use crate::recording::{Event, Recording, Samples, Source, SourceError};
use crate::unit::Unit;

/// A recording whose sensors fail, the same way each time that it is opened. Faults count from the first row of each segment.
pub struct WithFaults<'a> {
    recording: &'a dyn Recording,
    faults: Vec<FaultSpec>,
    seed: u64,
}

impl<'a> WithFaults<'a> {
    /// `recording` with `faults`; the seed is that of spikes and noise.
    #[must_use]
    pub fn new(recording: &'a dyn Recording, faults: Vec<FaultSpec>, seed: u64) -> Self {
        Self {
            recording,
            faults,
            seed,
        }
    }
}

impl Recording for WithFaults<'_> {
    fn open(&self, plan: &Plan) -> Result<Box<dyn Source + '_>, SourceError> {
        let channels: Vec<(&str, &Unit)> = plan
            .sources
            .iter()
            .zip(&plan.channels)
            .map(|(source, planned)| (source.name.as_str(), &planned.channel.unit))
            .collect();
        let faults = self.faults.iter().map(|fault| fault.resolve(&channels));
        let faults = faults.collect::<Result<Vec<_>, _>>()?.concat();
        Ok(Box::new(FaultyRows {
            rows: self.recording.open(plan)?,
            faults: Faults::new(faults, channels.len(), self.seed)?,
        }))
    }
}

struct FaultyRows<'a> {
    rows: Box<dyn Source + 'a>,
    faults: Faults,
}

impl Source for FaultyRows<'_> {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
        let event = self.rows.next(samples)?;
        match event {
            Some(Event::Row(time)) => self.faults.apply(time.as_ns(), &mut samples.values),
            Some(Event::Segment) => self.faults.restart(),
            None => {}
        }
        Ok(event)
    }
}

#[cfg(test)]
mod tests {
    use super::super::FaultKind;
    use super::*;
    use crate::recording::Table;
    use crate::time::{Duration, Instant};

    #[test]
    fn faults_count_from_the_first_row_of_each_segment() {
        let mut table = Table::default();
        for segment in 0..2 {
            if segment > 0 {
                table.segment();
            }
            for second in 0..4 {
                table.push(Instant::from_ns(second * 1_000_000_000), &[second as f64]);
            }
        }
        let spec: FaultSpec = "temperature.room=missing,from=1s,for=2s".parse().unwrap();
        assert_eq!(spec.kind, FaultKind::Missing);
        let unit = Unit::parse("Cel").unwrap();
        let faults = spec.resolve(&[("temperature.room", &unit)]).unwrap();
        assert_eq!(Duration::from_ns(faults[0].for_ns), "2s".parse().unwrap());
        let mut rows = FaultyRows {
            rows: Box::new(table.events().iter()),
            faults: Faults::new(faults, 1, 1).unwrap(),
        };
        let mut samples = Samples::default();
        let mut seen = Vec::new();
        while let Some(event) = rows.next(&mut samples).unwrap() {
            if event != Event::Segment {
                seen.push(samples.values[0].is_nan());
            }
        }
        assert_eq!(seen, [false, true, true, false, false, true, true, false]);
    }
}
