//! Charts with names, as files.

use super::Chart;

/// A picture as a file.
#[derive(Debug, Clone)]
pub struct Plot {
    /// Its name, without ending.
    pub name: String,
    /// As SVG.
    pub svg: String,
}

impl Plot {
    /// A chart under a name; none where there is nothing to draw.
    #[must_use]
    pub fn of(name: impl Into<String>, chart: &Chart<'_>) -> Option<Self> {
        let svg = chart.file();
        (!svg.is_empty()).then(|| Self {
            name: name.into(),
            svg,
        })
    }
}
