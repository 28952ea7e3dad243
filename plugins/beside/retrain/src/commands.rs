//! `athermal retrain`, which is the process that fits anew, and `athermal models`.

use std::path::{Path, PathBuf};

use athermal_command::{
    Answer, Command, Failure, Format, Group, Terminal, numbers, println, register_command,
};
use athermal_core::diagnostic::counted;
use athermal_core::time::Duration;
use athermal_http::client::Address;
use athermal_run::model::Model;
use athermal_serve::journal::JournalRecording;
use clap::Args;
use serde_json::{Value, json};

use crate::propose::{NotProposed, Terms, propose};
use crate::settings::{ON, SHADOW};
use crate::shelf;

/// Fit the graph of a running service anew on its own journal, and propose the fit to it
///
/// The fit is proposed if no sensor is broken in the data, if there are enough of them, and if it is no worse on their last fifth. It
/// is judged on that without having seen it. Then it runs in the shadow of what runs. With `--commit` it takes over if it is no worse
/// there either; otherwise `athermal commit` lets it.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal retrain machine.toml\n  athermal retrain machine.toml --on 7d --shadow 1h --margin 2% --commit"
)]
struct Retrain {
    /// The machine file of the service
    machine: PathBuf,
    /// The state folder, where the service does not keep it beside the machine file
    #[arg(long, value_name = "FOLDER")]
    state: Option<PathBuf>,
    /// Fit on so much of the past
    #[arg(long, value_name = "DURATION")]
    on: Option<Duration>,
    /// Compare the fit with what runs for so long
    #[arg(long, value_name = "DURATION")]
    shadow: Option<Duration>,
    /// By how much its error may be larger, such as "5%"
    #[arg(long, value_name = "PERCENT", default_value = "0%", value_parser = numbers::percent, allow_hyphen_values = true)]
    margin: f64,
    /// Let it take over if it is no worse
    #[arg(long)]
    commit: bool,
}

/// A service that runs, and where it keeps its state.
struct Running {
    address: Address,
    state: PathBuf,
    status: Value,
    terminal: Terminal,
}

impl Running {
    fn of(machine: &Path, state: Option<&Path>, terminal: &Terminal) -> Result<Self, Failure> {
        let (address, state) = Address::of_machine(machine, state)?;
        let status = address.get("/v1/status")?.answered(terminal)?;
        Ok(Self {
            address,
            state,
            status,
            terminal: *terminal,
        })
    }

    fn post(&self, path: &str, body: &Value) -> Result<Value, Failure> {
        self.address.post(path, body)?.answered(&self.terminal)
    }

    fn revision(&self) -> &str {
        self.status["revision"].as_str().unwrap_or_default()
    }

    /// The model that runs.
    fn model(&self) -> Result<Model, Failure> {
        if self.revision().is_empty() {
            let words =
                "the service does not know what runs, since ticks were missed: start it again";
            return Err(Failure::Request(words.to_owned()));
        }
        let paths = athermal_serve::folder::StatePaths::new(&self.state);
        Ok(paths.model(self.revision())?)
    }
}

impl Command for Retrain {
    const GROUP: Group = Group::Service;
    fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let service = Running::of(&self.machine, self.state.as_deref(), terminal)?;
        let running = service.model()?;
        let journal = JournalRecording::in_state(&service.state);
        let terms = Terms {
            on: self.on.unwrap_or(ON),
            margin: self.margin,
        };
        let now = jiff::Timestamp::now();
        let created = now.strftime("%Y-%m-%dT%H:%M:%SZ").to_string();
        let proposed = propose(&running, &journal, &terms, Some(created), terminal);
        let proposal = match proposed {
            Ok(proposal) => proposal,
            Err(NotProposed::Unreadable(error)) => return Err(Failure::Outside(error.to_string())),
            Err(reason) => {
                let words = format!("nothing is proposed: {reason}");
                terminal.warning(&words);
                if terminal.format == Format::Json {
                    println!(
                        "{:#}",
                        json!({ "proposed": null, "reason": reason.to_string() })
                    );
                }
                return Ok(Answer::No);
            }
        };
        let name = service.status["name"]
            .as_str()
            .unwrap_or("model")
            .replace('/', "-");
        let name = format!("{name}-{}", now.strftime("%Y%m%dT%H%M%SZ"));
        let kept = shelf::keep(&service.state, &name, &proposal.model);
        let path =
            kept.map_err(|error| Failure::Outside(format!("cannot keep the proposal: {error}")))?;
        let path = std::path::absolute(&path).unwrap_or(path);
        let staged = service.post("/v1/stage", &json!({ "path": path }))?;
        let shadow = self.shadow.unwrap_or(SHADOW);
        let order = json!({ "duration": shadow, "margin": self.margin, "commit": self.commit });
        service.post("/v1/shadow", &order)?;
        let ratio = proposal.ratio;
        let facts = json!({ "proposed": path, "revision": staged["revision"], "ratio": ratio, "shadow": shadow });
        match terminal.format {
            Format::Json => println!("{facts:#}"),
            Format::Table => println!(
                "{}: its error on what it had not seen is {ratio:.3} times that of what runs; in the shadow for {shadow}",
                path.display()
            ),
        }
        Ok(Answer::Fine)
    }
}

/// List the models of a running service, compare two, or take one back
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal models machine.toml\n  athermal models machine.toml --compare 5f0c 9a31\n  athermal models machine.toml --take 5f0c"
)]
struct Models {
    /// The machine file of the service
    machine: PathBuf,
    /// The state folder, where the service does not keep it beside the machine file
    #[arg(long, value_name = "FOLDER")]
    state: Option<PathBuf>,
    /// Show two models beside each other, by the beginnings of their revisions
    #[arg(long, value_name = "REVISION", num_args = 2, conflicts_with = "take")]
    compare: Vec<String>,
    /// Let the model of this revision take over
    #[arg(long, value_name = "REVISION")]
    take: Option<String>,
}

impl Models {
    /// The one model whose revision begins so.
    fn named<'a>(all: &'a [shelf::Shelved], name: &str) -> Result<&'a shelf::Shelved, Failure> {
        let mut named = all.iter().filter(|of| of.revision.starts_with(name));
        match (named.next(), named.next()) {
            (Some(one), None) => Ok(one),
            (None, _) => Err(Failure::Request(format!(
                "no model has a revision that begins with {name}"
            ))),
            _ => Err(Failure::Request(format!(
                "several models have a revision that begins with {name}"
            ))),
        }
    }
}

/// What is known of a model.
fn facts(of: &shelf::Shelved, running: &str) -> Value {
    let card = of.model.card.as_ref();
    let estimators = card.map_or_else(Vec::new, |card| {
        let estimator = |of: &athermal_run::model::EstimatorCard| {
            json!({ "node": of.node, "rows": of.rows, "rmse": of.report.in_sample_rmse, "unit": of.unit })
        };
        card.estimators.iter().map(estimator).collect()
    });
    json!({
        "revision": of.revision,
        "file": of.path,
        "created": card.and_then(|card| card.created.clone()),
        "ticks": card.map(|card| card.ticks),
        "runs": of.revision == running,
        "proposal": of.is_proposal,
        "estimators": estimators,
    })
}

fn line(of: &Value) -> String {
    let text = |key: &str| of[key].as_str().unwrap_or("-").to_owned();
    let runs = if of["runs"] == true { "  runs" } else { "" };
    let proposed = if of["proposal"] == true {
        "  proposed"
    } else {
        ""
    };
    let fitted = match of["ticks"].as_u64() {
        Some(ticks) => format!("fitted {} on {}", text("created"), counted(ticks, "tick")),
        None => "not fitted by itself".to_owned(),
    };
    format!("{}  {fitted}{proposed}{runs}", text("revision"))
}

impl Command for Models {
    const GROUP: Group = Group::Service;
    fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let service = Running::of(&self.machine, self.state.as_deref(), terminal)?;
        let all = shelf::all(&service.state);
        if let Some(name) = &self.take {
            let taken = Self::named(&all, name)?;
            let path = std::path::absolute(&taken.path).unwrap_or_else(|_| taken.path.clone());
            service.post("/v1/stage", &json!({ "path": path }))?;
            let done = service.post("/v1/commit", &json!({}))?;
            match terminal.format {
                Format::Json => println!("{done:#}"),
                Format::Table => println!("{} takes over before the next tick", taken.revision),
            }
            return Ok(Answer::Fine);
        }
        let shown: Vec<_> = match &*self.compare {
            [] => all.iter().collect(),
            names => names
                .iter()
                .map(|name| Self::named(&all, name))
                .collect::<Result<_, _>>()?,
        };
        let facts: Vec<_> = shown
            .iter()
            .map(|of| facts(of, service.revision()))
            .collect();
        if terminal.format == Format::Json {
            println!("{:#}", json!({ "models": facts }));
            return Ok(Answer::Fine);
        }
        facts.iter().for_each(|of| println!("{}", line(of)));
        if let ([_, _], [one, two]) = (&*self.compare, &*facts) {
            let figures = |of: &Value, node: &Value| {
                let mut all = of["estimators"].as_array().into_iter().flatten();
                let found = all.find(|of| of["node"] == *node);
                found.map_or_else(
                    || "-".to_owned(),
                    |of| format!("{} over {} rows", of["rmse"], of["rows"]),
                )
            };
            for of in one["estimators"].as_array().into_iter().flatten() {
                let node = &of["node"];
                println!(
                    "{}: RMSE of the fit {}; {}",
                    node.as_str().unwrap_or_default(),
                    figures(one, node),
                    figures(two, node)
                );
            }
        }
        Ok(Answer::Fine)
    }
}

register_command!(Retrain, "retrain");
register_command!(Models, "models");
