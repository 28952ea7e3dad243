//! What a model's card says of data of which a stretch of time was taken.

use std::path::{Path, PathBuf};

use athermal_core::compile::Plan;
use athermal_files::Report;
use athermal_run::model::DataCard;

use super::Data;
use crate::RowsId;
use athermal_core::failure::{Failure, outside};

impl Data {
    /// Of each file that has rows of the stretch these, read by themselves; all rows where a file cannot be read by itself, such as one
    /// with a time of its own beside others.
    ///
    /// # Errors
    /// When the rows cannot be read.
    pub(super) fn cards_of_rows(
        &self,
        plan: &Plan,
        reports: &[(String, Report)],
    ) -> Result<Vec<DataCard>, Failure> {
        let mut of_one = plan.clone();
        // Files that are merged have other columns each.
        of_one.sources.iter_mut().for_each(|of| of.optional = true);
        let tables = of_one.table.files.iter_mut().map(|(_, table)| table);
        let tables = tables.chain([&mut of_one.table.base]);
        tables.for_each(|table| table.segment = None);
        let taken = reports.iter().filter(|(_, report)| report.rows > 0);
        let card = |(name, _): &(String, Report)| {
            let mut file = self.others(vec![PathBuf::from(name)]);
            file.reading.times = self.reading.times.clone();
            let rows = RowsId::of(&file.dataset(), &of_one).ok()?;
            Some(DataCard {
                path: match self.tables.has(Path::new(name)) {
                    true => String::new(),
                    false => name.clone(),
                },
                from: self.reading.times.from.clone(),
                to: self.reading.times.to.clone(),
                ..rows.card()
            })
        };
        let cards: Option<Vec<DataCard>> = taken.map(card).collect();
        if let Some(cards) = cards {
            return Ok(cards);
        }
        let rows = RowsId::of(&self.dataset(), plan).map_err(outside)?;
        Ok(vec![DataCard {
            from: self.reading.times.from.clone(),
            to: self.reading.times.to.clone(),
            ..rows.card()
        }])
    }

    /// The files that a model was fitted on as its card has them, with the times that were taken; none where it has none.
    #[must_use]
    pub fn of_fit(&self, cards: &[DataCard]) -> Option<Self> {
        let cards = || cards.iter().filter(|card| !card.path.is_empty());
        let first = cards().next()?;
        let mut data = self.others(cards().map(|card| PathBuf::from(&card.path)).collect());
        (data.reading.times.from, data.reading.times.to) = (first.from.clone(), first.to.clone());
        Some(data)
    }

    /// Whether the file of a card of which a part was taken is among these: its times are what they were.
    pub(super) fn has_rest_of(&self, card: &DataCard) -> bool {
        let is_it = |path: &Path| path.display().to_string() == card.path;
        card.is_part() && self.paths().any(is_it)
    }
}
