//! Decides how a user asks for orders to be compared, and how it is reported; not how a model of an order is fitted.

use std::collections::BTreeMap;
use std::fmt;

use athermal_core::node::{Mistake, OrderFigure, OrderTable, TrainingReport, TriedOrder};
use athermal_numerics::{InformationCriteria, NumericsError};
use schemars::JsonSchema;
use serde::de::Visitor;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// The most orders that are compared.
const MOST: usize = 500;
/// By how many the rows must outnumber the coefficients for all figures of an order to be finite: AICc divides by
/// `N − k − 1`, and `k` is one more than the coefficients.
const LEFT_OVER: usize = 3;
/// The largest order.
pub(crate) const LARGEST: usize = 100;

/// Orders from one to another, both included: `"1..6"`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, JsonSchema)]
#[schemars(with = "String", extend("pattern" = r"^\d+\.\.\d+$"))]
pub struct OrderRange {
    /// The smallest.
    pub from: usize,
    /// The largest.
    pub to: usize,
}

impl Serialize for OrderRange {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&format_args!("{}..{}", self.from, self.to))
    }
}

impl<'de> Deserialize<'de> for OrderRange {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Text;
        impl Visitor<'_> for Text {
            type Value = OrderRange;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the smallest and the largest order, such as \"1..6\"")
            }

            fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<OrderRange, E> {
                let ends = text.split_once("..");
                let ends = ends.and_then(|(from, to)| {
                    Some((from.trim().parse().ok()?, to.trim().parse().ok()?))
                });
                let (from, to) =
                    ends.ok_or_else(|| E::invalid_value(serde::de::Unexpected::Str(text), &self))?;
                Ok(OrderRange { from, to })
            }
        }
        deserializer.deserialize_str(Text)
    }
}

/// Which orders are compared, and by what. All are fitted on the same rows.
///
/// There are `N` rows, `V` is the mean square of the residuals, and `p` counts coefficients, with `oe` and `bj` the starts
/// that were found too. `k = p + 1`, since the variance of the noise is found too. AIC is `N ln V + 2k`, AICc
/// `AIC + 2k(k + 1)/(N − k − 1)`, BIC `N ln V + k ln N`, FPE `V (N + p)/(N − p)` (Ljung 1999, section 16.4; Hurvich and Tsai
/// 1989). They take rows for independent; those of a drift whose windows overlap are not, and the order then comes out large.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Order {
    /// The figure that chooses: `aic`, `aicc`, `bic` or `fpe`.
    #[serde(default)]
    pub by: OrderFigure,
    /// How many past values of the truth, such as `"1..6"`; for `ar` and `arx`, how many of the first `lags`.
    #[serde(default)]
    pub na: Option<OrderRange>,
    /// How many values of each input; for `arx`, how many of the first `feature_lags`.
    #[serde(default)]
    pub nb: Option<OrderRange>,
    /// How many past innovations.
    #[serde(default)]
    pub nc: Option<OrderRange>,
    /// How many past values of the noise.
    #[serde(default)]
    pub nd: Option<OrderRange>,
    /// How many past values of what each input brings about.
    #[serde(default)]
    pub nf: Option<OrderRange>,
    /// How many samples the newest value of each input that counts lies back.
    #[serde(default)]
    pub nk: Option<OrderRange>,
}

/// A model that was compared with others.
#[derive(Debug)]
pub(crate) struct Tried {
    /// What is open of its orders: each letter with its number.
    pub(crate) letters: Vec<(&'static str, usize)>,
    pub(crate) coefficients: usize,
    /// The starts of filters that were found beside them.
    pub(crate) starts: usize,
    pub(crate) figures: InformationCriteria,
}

/// An order as a report tells it.
fn named(letters: &[(&str, usize)]) -> String {
    let texts = letters
        .iter()
        .map(|(letter, order)| format!("{letter} {order}"));
    texts.collect::<Vec<_>>().join(", ")
}

/// The same for programs.
fn numbered(letters: &[(&str, usize)]) -> BTreeMap<String, usize> {
    let texts = letters
        .iter()
        .map(|&(letter, order)| (letter.to_owned(), order));
    texts.collect()
}

/// An order that may be compared: its letter.
pub(crate) const LETTERS: [&str; 6] = ["na", "nb", "nc", "nd", "nf", "nk"];

impl Order {
    fn ranges(&self) -> [Option<OrderRange>; 6] {
        [self.na, self.nb, self.nc, self.nd, self.nf, self.nk]
    }

    /// Ranges that are none, and letters that the kind does not have; `most` is the largest order of each that it has.
    pub(crate) fn mistakes(&self, most: [Option<usize>; 6]) -> Vec<Mistake> {
        let mut mistakes = Vec::new();
        let mut count = 1_usize;
        let has: Vec<&str> = LETTERS
            .iter()
            .zip(most)
            .filter(|(_, most)| most.is_some())
            .map(|(letter, _)| *letter)
            .collect();
        for ((letter, range), most) in LETTERS.iter().zip(self.ranges()).zip(most) {
            let Some(range) = range else { continue };
            let place = format!("order.{letter}");
            let Some(most) = most else {
                let message = format!("this kind has no `{letter}`");
                mistakes
                    .push(Mistake::at(place, message).help(format!("it has {}", has.join(", "))));
                continue;
            };
            if range.from > range.to || range.to > most {
                let message = format!(
                    "`{letter}` is {}..{} and must rise to {most} at most",
                    range.from, range.to
                );
                mistakes.push(Mistake::at(place, message));
                continue;
            }
            count = count.saturating_mul(range.to - range.from + 1);
        }
        if count > MOST {
            let message = format!("these are {count} orders, and at most {MOST} are compared");
            mistakes.push(
                Mistake::at("order", message).help("compare fewer, or one letter after the other"),
            );
        }
        if self.ranges().iter().all(Option::is_none) {
            let message = "no order is left open";
            mistakes.push(
                Mistake::at("order", message)
                    .help(format!("say which, such as `{} = \"1..6\"`", has[0])),
            );
        }
        mistakes
    }

    /// Every combination, the letters left out as they are in `given`, the first letter slowest.
    pub(crate) fn combinations(&self, given: [usize; 6]) -> Vec<[usize; 6]> {
        let mut all = vec![given];
        for (nth, range) in self.ranges().into_iter().enumerate() {
            let Some(range) = range else { continue };
            let longer = all.iter().flat_map(|one| {
                (range.from..=range.to).map(move |order| {
                    let mut one = *one;
                    one[nth] = order;
                    one
                })
            });
            all = longer.collect();
        }
        all
    }

    /// Which orders are open.
    pub(crate) fn open(&self) -> [bool; 6] {
        self.ranges().map(|range| range.is_some())
    }

    /// The open orders, each letter with its number.
    pub(crate) fn letters(
        &self,
        orders: &[usize; 6],
    ) -> impl Iterator<Item = (&'static str, usize)> {
        let open = LETTERS.into_iter().zip(*orders).zip(self.open());
        open.filter_map(|(letter, open)| open.then_some(letter))
    }

    /// The best of what was tried; the table goes into the report. Orders with nearly as many coefficients as there are rows fit
    /// them without any error whatever they are worth, so they are not ranked.
    ///
    /// # Errors
    /// [`NumericsError::TooFewRows`] when no order is left.
    pub(crate) fn best(
        &self,
        rows: usize,
        tried: Vec<Tried>,
        report: &mut TrainingReport,
    ) -> Result<usize, NumericsError> {
        let count = tried.len();
        let found = |tried: &Tried| tried.coefficients + tried.starts;
        let least = tried.iter().map(found).min();
        let ranked: Vec<(usize, Tried)> = tried
            .into_iter()
            .enumerate()
            .filter(|(_, tried)| found(tried) + LEFT_OVER <= rows)
            .collect();
        let places: Vec<usize> = ranked.iter().map(|(place, _)| *place).collect();
        let texts = ranked.into_iter().map(|(_, tried)| TriedOrder {
            order: named(&tried.letters),
            letters: numbered(&tried.letters),
            coefficients: tried.coefficients,
            aic: tried.figures.aic,
            aicc: tried.figures.aicc,
            bic: tried.figures.bic,
            fpe: tried.figures.fpe,
        });
        let tried: Vec<_> = texts.collect();
        let worth = tried.iter().map(|tried| tried.figure(self.by)).enumerate();
        let best = worth
            .filter(|(_, worth)| worth.is_finite())
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((chosen, _)) = best else {
            return Err(NumericsError::TooFewRows {
                needed: (least.unwrap_or(1) + LEFT_OVER) as u64,
                found: rows as u64,
            });
        };
        let left_out = count - tried.len();
        if left_out > 0 {
            report.figure("orders_not_ranked", left_out);
            report.notes.push(format!(
                "{left_out} of {count} orders have too many coefficients to be ranked on {rows} rows"
            ));
        }
        report.orders = Some(Box::new(OrderTable {
            by: self.by,
            rows,
            chosen,
            tried,
        }));
        Ok(places[chosen])
    }
}
