//! `athermal alarm`: the alarms of a service, acknowledged, and tried.

use std::path::PathBuf;

use athermal_command::{
    Answer, Command, Failure, Format, Group, Terminal, println, register_command,
};
use athermal_core::compile::Wanted;
use athermal_core::diagnostic::{Diagnostics, Sources};
use athermal_core::figures;
use athermal_http::client::Address;
use athermal_run::model::Model;
use athermal_serve::deployment::Deployment;
use clap::{Args, Subcommand};
use serde_json::json;

use crate::alarm::Became;
use crate::asked::{Change, Message};

/// Show the alarms of a running service, acknowledge one, or try whether messages arrive
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal alarm list die-tester\n  athermal alarm acknowledge die-tester drift.Z1\n  athermal alarm test machine.toml"
)]
struct Alarm {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Show the alarms of a running service
    List(Of),
    /// Say that somebody knows of an alarm that is raised
    Acknowledge {
        #[command(flatten)]
        of: Of,
        /// The alarm
        alarm: String,
    },
    /// Send a message to every receiver that a machine file names, without a service
    Test {
        /// The machine file
        machine: PathBuf,
    },
}

#[derive(Debug, Args)]
struct Of {
    /// Its name, its machine file, its state folder, its socket, or `http://127.0.0.1:PORT`
    service: String,
    /// The file with the token, for orders over `http://`
    #[arg(long, value_name = "FILE")]
    token: Option<PathBuf>,
}

register_command!(Alarm, "alarm");

impl Command for Alarm {
    const GROUP: Group = Group::Service;
    fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        match &self.what {
            What::List(of) => list(of, terminal),
            What::Acknowledge { of, alarm } => {
                let address = Address::of(&of.service, of.token.as_deref())?;
                let body = json!({ "name": alarm });
                let done = address
                    .post("/v1/alarms/acknowledge", &body)?
                    .answered(terminal)?;
                match terminal.format {
                    Format::Json => println!("{done:#}"),
                    Format::Table => println!("{alarm} is acknowledged"),
                }
                Ok(Answer::Fine)
            }
            What::Test { machine } => test(machine, terminal),
        }
    }
}

fn list(of: &Of, terminal: &Terminal) -> Result<Answer, Failure> {
    let address = Address::of(&of.service, of.token.as_deref())?;
    let all = address.get("/v1/alarms")?.answered(terminal)?;
    if terminal.format == Format::Json {
        println!("{all:#}");
        return Ok(Answer::Fine);
    }
    let mut rows = Vec::new();
    let mut is_quiet = true;
    for alarm in all["alarms"].as_array().into_iter().flatten() {
        let text = |key: &str| alarm[key].as_str().unwrap_or_default().to_owned();
        is_quiet &= alarm["state"] == "clear";
        let value = figures::or_dash(alarm["value"].as_f64());
        let since = alarm["since_s"]
            .as_f64()
            .map_or_else(String::new, figures::instant);
        rows.push(vec![
            text("name"),
            text("state"),
            since,
            value,
            text("unit"),
            text("text"),
        ]);
    }
    println!(
        "{}",
        figures::table(&["alarm", "state", "since", "value", "unit"], &rows).trim_end()
    );
    // A script asks whether all is well.
    Ok(if is_quiet { Answer::Fine } else { Answer::No })
}

fn test(machine: &std::path::Path, terminal: &Terminal) -> Result<Answer, Failure> {
    let (mut sources, mut mistakes) = (Sources::new(), Diagnostics::new());
    let model = Model::load_to_fit(machine, Wanted::default(), &mut sources, &mut mistakes);
    let model = model.map_err(|error| Failure::Request(error.to_string()))?;
    let deployment = Deployment::read(&model.graph, &model.plan, &sources, &mut mistakes);
    let deployment =
        deployment.ok_or_else(|| Failure::Request(mistakes.render(&sources, false, 100)))?;
    let section = model.graph.deployment.get("alarms");
    let settings = section.and_then(|of| {
        athermal_core::document::decode::<crate::settings::Alarms>(of, "`[alarms]`", &mut mistakes)
    });
    let settings = settings.unwrap_or_default();
    if settings.0.is_empty() {
        return Err(Failure::Request(format!(
            "{}: it declares no `[alarms.NAME]`",
            machine.display()
        )));
    }
    let (state, sinks) = (deployment.state(machine), deployment.sinks.iter());
    let sinks: Vec<_> = sinks
        .map(|of| (of.parameters.clone(), of.wiring(&model.plan, &state)))
        .collect();
    let mut tried = std::collections::BTreeMap::new();
    for (name, alarm) in &settings.0 {
        let message = Message {
            machine: model.graph.name.clone().unwrap_or_default(),
            count: 1,
            left_out: 0,
            changes: vec![Change {
                number: 0,
                time_s: 0.0,
                host_s: athermal_serve::host::now().map_or(0.0, |of| of.as_ns() as f64 / 1e9),
                alarm: name.clone(),
                change: Became::Raised,
                text: Some("a test: nothing has happened".to_owned()),
                of: alarm.of.clone(),
                value: None,
                unit: String::new(),
                by: None,
            }],
        };
        let text = serde_json::to_string(&message).unwrap_or_default();
        let ways = crate::receivers::ways(name, alarm, &sinks, machine, "-alarm-test");
        let ways = ways.map_err(|error| Failure::Request(error.to_string()))?;
        for (receiver, open) in ways {
            let sent = || {
                let mut messages = open()?;
                // A connection is made at the first.
                let mut sent = messages.send(&text);
                for _ in 0..9 {
                    if sent.is_ok() {
                        break;
                    }
                    std::thread::sleep(std::time::Duration::from_millis(300));
                    sent = messages.send(&text);
                }
                sent
            };
            tried.entry(receiver).or_insert_with(sent);
        }
    }
    let has_failed = tried.values().any(Result::is_err);
    for (receiver, sent) in &tried {
        let words = sent
            .as_ref()
            .map_or_else(ToString::to_string, |()| "has it".to_owned());
        match terminal.format {
            Format::Json => println!(
                "{}",
                json!({ "receiver": receiver, "taken": sent.is_ok(), "message": words })
            ),
            Format::Table => println!("{receiver}: {words}"),
        }
    }
    if tried.is_empty() {
        println!(
            "no alarm has a `topic` or a `webhook`: they stand in the journal, and on the page"
        );
    }
    Ok(if has_failed { Answer::No } else { Answer::Fine })
}
