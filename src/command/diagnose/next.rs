//! The commands worth trying after a diagnosis: two at most, each for something that was found.

use athermal::Model;
use athermal::diagnosis::lag::FeatureLags;
use athermal::diagnosis::text::is_of;
use athermal::diagnosis::{Main, is_called};

use super::Diagnose;
use crate::invocation::{command, program, quoted, words_with};
use athermal_analysis::figures::paragraph;
use athermal_jobs::diagnose::tables::Tables;

impl Diagnose {
    /// What to try next, each with its reason; none where nothing follows. `drifts`: whether any truth is a slope.
    pub(super) fn next(&self, tables: &Tables, model: &Model, drifts: bool) -> Option<String> {
        let left = self.what_is_left(tables, model);
        let left = left.or_else(|| self.wider_windows(tables).filter(|_| drifts));
        let found: Vec<String> = left
            .into_iter()
            .chain(self.more_days(tables, model))
            .collect();
        (!found.is_empty()).then(|| found.join("\n"))
    }

    fn diagnose(&self, more: &[&str]) -> String {
        let mut words = words_with(&self.job.data, "diagnose", &self.model);
        words.extend(more.iter().map(|&word| word.to_owned()));
        command(&words)
    }

    /// Fits the graph anew on what the model was fitted on, since what is diagnosed is kept for tests; on what is diagnosed where the
    /// model does not say. More data may follow.
    fn fit(&self, model: &Model, more: &[&str]) -> String {
        let seen = model
            .card
            .as_ref()
            .and_then(|card| self.job.data.of_fit(&card.data));
        let data = seen.as_ref().unwrap_or(&self.job.data);
        let mut words = words_with(data, "fit", &self.model);
        words.extend(more.iter().map(|&word| word.to_owned()));
        command(&words)
    }

    /// A feature explains something of what a prediction leaves: does no estimator use it, or is it of little use there?
    fn what_is_left(&self, tables: &Tables, model: &Model) -> Option<String> {
        let (main, feature) = most_left(tables)?;
        let name = &feature.feature;
        let users: Vec<&str> = tables.users_of(main, name).collect();
        let why = format!("What {} leaves goes with {name}, ", main.prediction);
        let own = users.iter().find(|user| is_of(&main.prediction, user));
        let (what, look) = if let Some(own) = own.filter(|own| !has_coefficients(model, own)) {
            if self.job.of.iter().any(|asked| is_called(own, asked)) {
                return None;
            }
            let look = self.diagnose(&["--of", &quoted(own), "--no-fit"]);
            ("which it uses; how it answers each of its sensors:", look)
        } else if let Some(own) = own {
            let model = quoted(&self.model.display().to_string());
            // Without `each` a node is called by its own name, and its prediction by that of its axis too.
            let node = quoted(own);
            let words = [
                &program(),
                "show",
                &model,
                "--format coefficients --node",
                &node,
            ];
            ("which it uses; its coefficients:", command(&words))
        } else if let Some(user) = users.first().filter(|_| !tables.is_estimator(main)) {
            let look = self.diagnose(&["--of", &quoted(user), "--no-fit"]);
            (
                &*format!("which {user} uses; what that leaves by itself:"),
                look,
            )
        } else {
            let look = self.fit(model, &["--candidates", "-o again.json"]);
            (
                "which it does not use; what a fit tries before it stops:",
                look,
            )
        };
        Some(paragraph("", 0, &(why + what)) + &look)
    }

    fn more_days(&self, tables: &Tables, model: &Model) -> Option<String> {
        let fit = self.fit(model, &["MORE.csv", "-o better.json"]);
        let wanted = tables.more_days_may_help();
        wanted.then(|| format!("More days may still make it better; with another log beside those of the fit:\n{fit}"))
    }

    /// Where what is left is white, a truth over another window may be predicted better.
    fn wider_windows(&self, tables: &Tables) -> Option<String> {
        let of = self.job.of.iter().map(|name| quoted(name));
        let of = of.flat_map(|name| ["--of".to_owned(), name]);
        let more: Vec<String> = of.chain(["--window --no-fit".to_owned()]).collect();
        let more: Vec<&str> = more.iter().map(String::as_str).collect();
        let look = self.diagnose(&more);
        let wanted = !self.job.window && tables.all_white();
        wanted
            .then(|| format!("What is left is white; signal to noise over other windows:\n{look}"))
    }
}

/// Of what predictions leave, that which a feature surely explains most of.
fn most_left<'a>(tables: &'a Tables<'_>) -> Option<(&'a Main, &'a FeatureLags)> {
    let left = tables.main().filter_map(|main| {
        let features = tables.lags_of(main)?.features.iter();
        let sure = features.filter(|of| of.residual.is_significant());
        let size = |of: &FeatureLags| of.residual.best.abs();
        let most = sure.max_by(|a, b| size(a).total_cmp(&size(b)))?;
        Some((main, most))
    });
    left.max_by(|a, b| a.1.residual.best.abs().total_cmp(&b.1.residual.best.abs()))
}

/// Whether a fitted estimator has coefficients to show: not every kind does.
fn has_coefficients(model: &Model, node: &str) -> bool {
    let fit = model.fitted.get(node);
    fit.is_some_and(|fit| fit.coefficients().is_some())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use athermal::core::node::{Coefficients, Predictor};
    use serde::{Deserialize, Serialize};

    use super::*;

    /// Predicts zero, with coefficients or without.
    #[derive(Debug, Serialize, Deserialize)]
    struct Reserved {
        tells: bool,
    }

    impl Predictor for Reserved {
        fn uses(&self) -> &[String] {
            &[]
        }

        fn predict(&self, _regressors: &[f64]) -> f64 {
            0.0
        }

        fn coefficients(&self) -> Option<Coefficients> {
            self.tells.then(|| Coefficients::linear(0.0, &[], None))
        }
    }

    athermal::core::predictor!(Reserved, "reserved");

    #[test]
    fn only_what_tells_its_coefficients_is_asked_for_them() {
        let text = r#"{"athermal_model": 1, "card": null, "fitted": {}, "graph": {
            "signals": {"room": {"unit": "nm", "channels": ["a"]}}, "nodes": {}, "outputs": {"out": "room"}
        }}"#;
        let mut model = Model::from_text("model.json", text.to_owned()).unwrap();
        for (node, tells) in [("open", true), ("closed", false)] {
            let fit: Arc<dyn Predictor> = Arc::new(Reserved { tells });
            model.fitted.insert(node.to_owned(), fit);
        }
        let asked = ["open", "closed", "none"].map(|node| has_coefficients(&model, node));
        assert_eq!(asked, [true, false, false]);
    }
}
