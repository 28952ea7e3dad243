//! Decides as which files a chart is kept.

use super::Chart;

/// A picture as files.
#[derive(Debug, Clone)]
pub struct Plot {
    /// Its name, without ending.
    pub name: String,
    /// As SVG.
    pub svg: String,
    /// As PNG.
    #[cfg(feature = "png")]
    pub png: Vec<u8>,
}

impl Plot {
    /// A chart under a name; none where there is nothing to draw.
    #[must_use]
    pub fn of(name: impl Into<String>, chart: &Chart<'_>) -> Option<Self> {
        #[cfg(feature = "png")]
        let png = chart.png()?;
        Some(Self {
            name: name.into(),
            svg: chart.file(),
            #[cfg(feature = "png")]
            png,
        })
    }
}
