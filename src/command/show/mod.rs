//! `athermal show`: a graph as a plan, or as a picture; a model by its coefficients.

mod memory;
mod tables;

use std::path::PathBuf;

use athermal::Model;
use athermal::core::compile::Wanted;
use athermal::core::diagnostic::nearest;
use athermal::diagnosis::{is_asked, is_called};
use athermal::run::model::FittedEstimator;
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser};
use serde::Serialize;
use serde_json::json;

use crate::terminal::{Answer, Failure, Terminal, print};
use athermal_analysis::drawing::{Diagram, diagram, dot, mermaid, plan, svg};
use athermal_jobs::model::{self, load_fitted};

/// Show a graph: its plan, or a picture of it; show a model by its coefficients
///
/// Coefficients are in the units of the data, temperatures as K. Standard errors stand beside them where theory has them.
/// Least squares: the usual ones. With a penalty: those of the posterior of ridge, on which the port `std_dev` stands too.
/// `rls`: what its memory leaves. Models identified by the prediction error: those of its derivatives, and none for a
/// polynomial that would be unstable if the search had let it. All take the errors of rows as independent, and are too small
/// where windows overlap.
///
/// In products regressors count from their means. What follows its own past comes to rest in time constants; those of a
/// state space are its eigenvalues.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  athermal show graphs/die-tester.toml
  athermal show graphs/die-tester.toml --format svg > die-tester.svg
  athermal show graphs/die-tester.toml --format mermaid      for Markdown
  athermal show model.json --format coefficients --node thermal.Z1
  athermal show model.json --format memory --rate 1s
  athermal show model.json --expand --format dot | dot -Tpdf -o graph.pdf")]
pub struct Show {
    /// The graph, or a model
    #[arg(value_parser = athermal_jobs::path::graph_or_model())]
    graph: PathBuf,
    /// What to print
    #[arg(id = "format", long, value_name = "FORMAT", value_parser = formats(), default_value = "plan")]
    format: String,
    /// Show each instance of a node with `each` on its own
    #[arg(long)]
    expand: bool,
    /// With `memory`, the time between two samples, of all signals or of one: 1s, position=10s. By default as in the data of the fit
    #[arg(long, value_name = "[SIGNAL=]TIME")]
    rate: Vec<String>,
    /// Show the coefficients of these estimators only, by node, instance or axis
    #[arg(long = "node", value_name = "NAME")]
    nodes: Vec<String>,
}

fn formats() -> PossibleValuesParser {
    PossibleValuesParser::new([
        PossibleValue::new("plan").help("What stands in which slot, and what is done at a tick"),
        PossibleValue::new("mermaid").help("A flowchart for Markdown and web pages"),
        PossibleValue::new("dot").help("A graph for Graphviz"),
        PossibleValue::new("svg").help("A picture that needs no other program"),
        PossibleValue::new("coefficients")
            .help("What the fitted estimators of a model consist of: coefficients, noises, time constants"),
        PossibleValue::new("memory")
            .help("How many bytes an engine of it holds once all windows are full, window by window"),
        PossibleValue::new("json").help("Boxes and arrows for programs, and the coefficients of a model"),
    ])
}

impl Show {
    /// Compiles and prints.
    ///
    /// # Errors
    /// When the graph has mistakes.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        if self.format == "coefficients" {
            let model = load_fitted(&self.graph, Wanted::default(), terminal)?;
            let estimators = self.estimators(&model)?;
            let mut unfitted = model.unfitted();
            unfitted.retain(|node| is_asked(node, &self.nodes));
            print(tables::text(&estimators, &unfitted).as_bytes())?;
            return Ok(Answer::Fine);
        }
        if !self.nodes.is_empty() && self.format != "json" {
            return Err(Failure::Request(format!(
                "--node chooses coefficients, and the format is {}: add `--format coefficients`",
                self.format
            )));
        }
        if !self.rate.is_empty() && self.format != "memory" {
            return Err(Failure::Request(format!(
                "--rate is how often samples come for `--format memory`, and the format is {}",
                self.format
            )));
        }
        let model = model::load(&self.graph, Wanted::default(), terminal)?;
        let drawn = || diagram(&model.plan, self.expand);
        let text = match self.format.as_str() {
            "mermaid" => mermaid::text(&drawn()),
            "dot" => dot::text(&drawn()),
            "svg" => svg::text(&drawn()),
            "memory" => memory::text(&model, &self.rate, terminal)?,
            "json" => {
                let (diagram, estimators) = (&drawn(), &*self.estimators(&model)?);
                format!(
                    "{:#}\n",
                    json!(Facts {
                        diagram,
                        estimators
                    })
                )
            }
            _ => plan::text(&model.plan, self.expand),
        };
        print(text.as_bytes())?;
        Ok(Answer::Fine)
    }

    /// The coefficients of the estimators asked for; every name must be that of one.
    fn estimators(&self, model: &Model) -> Result<Vec<FittedEstimator>, Failure> {
        let mut estimators = model.estimators();
        let unfitted = model.unfitted();
        let known = estimators.iter().map(|of| &of.node).chain(&unfitted);
        let known: Vec<&str> = known.map(String::as_str).collect();
        let is_known = |name: &&String| known.iter().any(|of| is_called(of, name));
        if let Some(name) = self.nodes.iter().find(|name| !is_known(name)) {
            return Err(Failure::Request(no_estimator(name, &known)));
        }
        estimators.retain(|of| is_asked(&of.node, &self.nodes));
        Ok(estimators)
    }
}

/// That no estimator among those known goes by a name, and which do.
fn no_estimator(name: &str, known: &[&str]) -> String {
    let mut nodes: Vec<&str> = known
        .iter()
        .map(|of| of.split_once('.').map_or(*of, |(node, _)| node))
        .collect();
    nodes.dedup();
    let near = nearest(name, known.iter().chain(&nodes).copied());
    let near = near.map_or_else(String::new, |near| format!(", did you mean `{near}`?"));
    let there = match nodes[..] {
        [] => "nothing in the graph is fitted".to_owned(),
        _ => format!("fitted are {}", nodes.join(", ")),
    };
    format!("there is no fitted estimator `{name}`{near} ({there})")
}

/// The boxes and arrows, and the coefficients where there are any, for programs.
#[derive(Serialize)]
struct Facts<'a> {
    #[serde(flatten)]
    diagram: &'a Diagram,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    estimators: &'a [FittedEstimator],
}
