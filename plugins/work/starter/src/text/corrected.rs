//! Decides how what a correction applied is taken back, and what drifts then.

use std::fmt::Write as _;

use super::{Group, Writer, beside, list, toml_string};

impl Writer<'_> {
    /// The columns that were corrected, of all that drift.
    fn corrected(&self) -> impl Iterator<Item = (usize, usize)> {
        let columns = self.drifting.iter().flat_map(|group| &group.columns);
        columns.filter_map(|&nth| Some((nth, self.columns[nth].applied?)))
    }

    /// What was corrected, as it would have been without.
    pub(super) fn uncorrected(&self, text: &mut String) {
        let (positions, applied): (Vec<usize>, Vec<usize>) = self.corrected().unzip();
        if !positions.is_empty() {
            let _ = writeln!(
                text,
                "\n{}\ntype = \"uncorrected\"\ninputs.position = {}\ninputs.applied = {}",
                beside(
                    "[nodes.uncorrected]",
                    "as it would have been: a model never learns its own correction"
                ),
                list(&references(&self.drifting, &positions)),
                list(&references(&self.applied, &applied)),
            );
        }
    }

    /// What drifts, without what a correction applied.
    pub(super) fn drifts(&self) -> String {
        let corrected: Vec<usize> = self.corrected().map(|(nth, _)| nth).collect();
        let all = self
            .drifting
            .iter()
            .flat_map(|group| &group.columns)
            .copied();
        let rest: Vec<usize> = all.filter(|nth| !corrected.contains(nth)).collect();
        let node = (!corrected.is_empty()).then(|| toml_string("uncorrected"));
        list(
            &node
                .into_iter()
                .chain(references(&self.drifting, &rest))
                .collect::<Vec<_>>(),
        )
    }
}

/// What reads these columns in their order: signals where all of theirs follow each other, else channels.
fn references(groups: &[Group], mut columns: &[usize]) -> Vec<String> {
    let mut read = Vec::new();
    while let Some((first, rest)) = columns.split_first() {
        let whole = groups
            .iter()
            .find(|group| columns.starts_with(&group.columns));
        if let Some(group) = whole {
            read.push(toml_string(&group.signal));
            columns = &columns[group.columns.len()..];
            continue;
        }
        let channel = groups.iter().find_map(|group| {
            let place = group.columns.iter().position(|of| of == first)?;
            Some(format!("{}.{}", group.signal, group.channels[place]))
        });
        read.extend(channel.map(|channel| toml_string(&channel)));
        columns = rest;
    }
    read
}
