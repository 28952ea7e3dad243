//! Parameters of a module in the place of their names.

use super::Given;
use crate::diagnostic::{Diagnostics, Place};
use crate::document::declare::each::weight;
use crate::document::declare::placeholder;
use crate::document::problem;
use crate::document::tree::{Data, Value};
use crate::quantity::Quantity;
use crate::unit::Unit;

impl Given {
    /// A value of the module with the parameters that it names.
    ///
    /// A text that is nothing but `{name}` becomes the parameter's value, which stands where it was given.
    pub(super) fn fill(&self, value: &Value, diagnostics: &mut Diagnostics) -> Value {
        value.with_texts(&mut |text, place| {
            if let Some(given) = self.whole(text) {
                return given.clone();
            }
            if let Some((given, problem)) = self.unit_twice(text) {
                diagnostics.report(given.place, problem);
                return given.clone();
            }
            Value::new(place, Data::Text(self.fill_text(text, place, diagnostics)))
        })
    }

    /// How much a value weighs once all that it names stands in it, at most.
    pub(super) fn weight_filled(&self, value: &Value) -> usize {
        let add = |sum: usize, value: &Value| sum.saturating_add(self.weight_filled(value));
        match &value.data {
            Data::Text(text) => {
                let given = |name: &str| {
                    let of = self.parameters.get(name).or(self.inputs.get(name));
                    of.map_or(0, weight)
                };
                let named = placeholder::names(text).map(given);
                named.fold(weight(value), usize::saturating_add)
            }
            Data::List(values) => values.iter().fold(1, add),
            Data::Table(entries) => entries.iter().map(|(_, entry)| &entry.value).fold(1, add),
            _ => weight(value),
        }
    }

    /// The parameter that is given with a unit in a text that has one for it, where both together are no quantity.
    fn unit_twice(&self, text: &str) -> Option<(&Value, problem::UnitTwice)> {
        let (parameter, unit) = text.strip_prefix('{')?.split_once('}')?;
        let given = self.parameters.get(parameter)?;
        let written = given.as_text()?;
        let unit = Unit::parse(unit).ok()?;
        let quantity: Quantity = written.parse().ok()?;
        let filled = placeholder::fill(text, &[(parameter, written)]);
        filled.parse::<Quantity>().is_err().then(|| {
            let problem = problem::UnitTwice {
                parameter: parameter.to_owned(),
                module: self.module.clone(),
                given: quantity,
                text: text.to_owned(),
                unit,
            };
            (given, problem)
        })
    }

    fn whole(&self, text: &str) -> Option<&Value> {
        let name = text.strip_prefix('{')?.strip_suffix('}')?;
        self.parameters.get(name)
    }

    /// A text with the parameters that it names; one without a text of its own is refused.
    pub(super) fn fill_text(
        &self,
        text: &str,
        place: Place,
        diagnostics: &mut Diagnostics,
    ) -> String {
        let mut texts = Vec::new();
        for name in placeholder::names(text) {
            let Some(value) = self.parameters.get(name) else {
                continue;
            };
            match &value.data {
                Data::Text(text) | Data::Time(text) => texts.push((name, text.clone())),
                Data::Integer(number) => texts.push((name, number.to_string())),
                Data::Float(number) => texts.push((name, number.to_string())),
                Data::Bool(truth) => texts.push((name, truth.to_string())),
                Data::List(_) | Data::Table(_) => {
                    let problem = problem::WrongType {
                        key: Some(name.to_owned()),
                        expected: "a text or a number within a text".to_owned(),
                        found: value.found(),
                        hint: None,
                    };
                    diagnostics.report(place, problem);
                }
            }
        }
        let texts: Vec<_> = texts.iter().map(|(name, t)| (*name, t.as_str())).collect();
        placeholder::fill(text, &texts)
    }
}
