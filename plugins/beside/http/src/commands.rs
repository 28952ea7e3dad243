//! The commands that ask a running service. Each is a request and what is shown of the answer.

use std::io::{self, BufRead as _, Read as _};
use std::path::{Path, PathBuf};

use athermal_command::{
    Answer, Command, Failure, Format, Group, Terminal, numbers, println, register_command,
};
use athermal_serve::facts::{ChannelsFacts, Known as _, StatusFacts};
use clap::Args;
use serde_json::{Value, json};

use crate::client::{Address, Reply, escaped};
use crate::shown;

/// Which service is asked.
#[derive(Debug, Args)]
pub struct Service {
    /// Its name, its machine file, its state folder, its socket, or `http://127.0.0.1:PORT`
    service: String,
    /// The file with the token, for orders over `http://`
    #[arg(long, value_name = "FILE")]
    token: Option<PathBuf>,
}

impl Service {
    fn address(&self) -> Result<Address, Failure> {
        Ok(Address::of(&self.service, self.token.as_deref())?)
    }

    fn get(&self, terminal: &Terminal, path: &str) -> Result<Value, Failure> {
        self.address()?.get(path)?.answered(terminal)
    }

    fn post(&self, terminal: &Terminal, path: &str, body: &Value) -> Result<Value, Failure> {
        self.address()?.post(path, body)?.answered(terminal)
    }

    /// Orders something, and shows a sentence about it or the answer as JSON.
    fn order(
        &self,
        terminal: &Terminal,
        path: &str,
        words: impl FnOnce(&Value) -> String,
    ) -> Result<Answer, Failure> {
        let done = self.post(terminal, path, &json!({}))?;
        show(terminal, &done, || words(&done))
    }
}

fn show(
    terminal: &Terminal,
    body: &Value,
    words: impl FnOnce() -> String,
) -> Result<Answer, Failure> {
    match terminal.format {
        Format::Json => println!("{body:#}"),
        Format::Table => println!("{}", words().trim_end()),
    }
    Ok(Answer::Fine)
}

fn revision(body: &Value) -> &str {
    body["revision"].as_str().unwrap_or("it")
}

/// Ask a running service how it is
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal status die-tester\n  athermal status machine.toml --format json"
)]
struct Status {
    #[command(flatten)]
    service: Service,
}

impl Command for Status {
    const GROUP: Group = Group::Service;
    fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let mut status = self.service.get(terminal, "/v1/status")?;
        let channels = self.service.get(terminal, "/v1/channels")?;
        status["channels"] = channels["channels"].clone();
        let kinds = [StatusFacts::declared(), ChannelsFacts::declared()];
        let words = || {
            kinds
                .into_iter()
                .flatten()
                .map(|of| of.words(&status))
                .collect()
        };
        show(terminal, &status, words)?;
        // A script asks whether all is well.
        Ok(match status["state"].as_str() {
            Some("running") => Answer::Fine,
            _ => Answer::No,
        })
    }
}

/// Show what a running service puts out, tick by tick, and what happens
///
/// A line for each tick, until Ctrl-C. Whoever reads slowly misses some, which is reported; the service does not wait.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal tap die-tester\n  athermal tap die-tester --channel temperature.room --format json"
)]
struct Tap {
    #[command(flatten)]
    service: Service,
    /// Show this channel besides, as `explain` names it; `*` is all
    #[arg(long, value_name = "CHANNEL")]
    channel: Vec<String>,
    /// End after so many ticks
    #[arg(long, value_name = "TICKS", value_parser = numbers::read::<u64>("a whole number of ticks"))]
    count: Option<u64>,
}

impl Command for Tap {
    const GROUP: Group = Group::Service;
    fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let mut path = "/v1/events?ticks=1".to_owned();
        for channel in &self.channel {
            path += "&channel=";
            path += &escaped(channel);
        }
        let (status, mut lines) = self.service.address()?.listen(&path)?;
        let outside = |error: io::Error| Failure::Outside(error.to_string());
        if status != 200 {
            let mut body = Vec::new();
            lines.read_to_end(&mut body).map_err(outside)?;
            let refused = Reply { status, body }.answered(terminal);
            return refused.map(|_| Answer::Fine);
        }
        let (mut event, mut ticks) = (String::new(), 0);
        for line in lines.lines() {
            let line = line.map_err(outside)?;
            if let Some(name) = line.strip_prefix("event: ") {
                name.clone_into(&mut event);
            }
            let data = line.strip_prefix("data: ");
            let Some(data) = data.and_then(|data| serde_json::from_str::<Value>(data).ok()) else {
                continue;
            };
            match terminal.format {
                Format::Json => println!("{}", json!({ "event": event, "data": data })),
                Format::Table => println!("{}", shown::item(&event, &data)),
            }
            ticks += u64::from(event == "tick");
            if self.count.is_some_and(|count| ticks >= count) {
                break;
            }
        }
        Ok(Answer::Fine)
    }
}

/// Give a running service another graph or model
///
/// The service makes it ready: nodes that mean the same go on as they were, the others are warmed by the past. What runs goes on until
/// it is committed. All mistakes of the graph are reported with their places, and what runs is untouched.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal swap die-tester new.toml\n  athermal swap die-tester new.json --shadow 30min --margin 2% --commit"
)]
struct Swap {
    #[command(flatten)]
    service: Service,
    /// The graph or model
    new: PathBuf,
    /// Compare it with what runs for so long
    #[arg(long, value_name = "DURATION")]
    shadow: Option<String>,
    /// By how much its error may be larger, such as "5%"
    #[arg(long, value_name = "PERCENT", default_value = "0%", value_parser = numbers::percent, requires = "shadow")]
    margin: f64,
    /// Let it take over: at once, or after a comparison that it passes
    #[arg(long)]
    commit: bool,
}

impl Command for Swap {
    const GROUP: Group = Group::Service;
    fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let given = given(&self.new)?;
        let mut staged = self.service.post(terminal, "/v1/stage", &given)?;
        if terminal.format == Format::Table {
            if let Some(doubts) = staged["doubts"].as_str().filter(|text| !text.is_empty()) {
                terminal.note(doubts.trim_end());
            }
            println!("{}", shown::staged(&self.new, &staged));
        }
        let next = match &self.shadow {
            Some(duration) => {
                let order =
                    json!({ "duration": duration, "margin": self.margin, "commit": self.commit });
                self.service.post(terminal, "/v1/shadow", &order)?;
                let then = match self.commit {
                    true => "it takes over then, if it is no worse",
                    false => {
                        "`athermal status` shows the comparison, `athermal commit` lets it take over"
                    }
                };
                format!("in the shadow for {duration}; {then}")
            }
            None if self.commit => {
                self.service.post(terminal, "/v1/commit", &json!({}))?;
                "it takes over before the next tick; `athermal rollback` takes it back".to_owned()
            }
            None => "staged; `athermal commit` lets it take over, `athermal discard` lets it go"
                .to_owned(),
        };
        staged["next"] = json!(next);
        show(terminal, &staged, || next)
    }
}

/// A graph is read by the service, since it may name other files; a model is sent as it is.
fn given(path: &Path) -> Result<Value, Failure> {
    let shown = path.display();
    let failed = |error| Failure::Outside(format!("cannot read {shown}: {error}"));
    if path.extension().is_some_and(|of| of == "toml") {
        let path = std::path::absolute(path).map_err(failed)?;
        return Ok(json!({ "path": path }));
    }
    let text = std::fs::read_to_string(path).map_err(failed)?;
    Ok(json!({ "model": text }))
}

macro_rules! orders {
    ($($(#[$doc:meta])* $name:ident $command:literal $path:literal $words:expr;)*) => {
        $(
            $(#[$doc])*
            #[derive(Debug, Args)]
            #[command(after_help = concat!("Example:\n  athermal ", $command, " die-tester"))]
            struct $name {
                #[command(flatten)]
                service: Service,
            }

            impl Command for $name {
                const GROUP: Group = Group::Service;
                fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
                    self.service.order(terminal, $path, $words)
                }
            }

            register_command!($name, $command);
        )*
    };
}

orders! {
    /// Let the staged graph of a running service take over
    Commit "commit" "/v1/commit"
        |done| format!("{} takes over before the next tick", revision(done));
    /// Let the graph before the last swap take over again
    ///
    /// It is as if it had never been replaced. It stays warm for an hour after it was.
    Rollback "rollback" "/v1/rollback"
        |done| format!("{} takes over again before the next tick", revision(done));
    /// Let go of the staged graph of a running service
    Discard "discard" "/v1/discard" |_| "nothing is staged any more".to_owned();
    /// Let no estimator of a running service learn
    Freeze "freeze" "/v1/freeze" |_| "learning is frozen before the next tick".to_owned();
    /// Let the estimators of a running service learn again
    Thaw "thaw" "/v1/thaw" |_| "learning goes on before the next tick".to_owned();
    /// Let a running service take a checkpoint
    Snapshot "snapshot" "/v1/snapshot"
        |done| format!("a checkpoint after {} ticks, beats, breaks and freezes, saved once the journal is on the disk", done["happenings"]);
    /// End a running service: what waits is stepped, and everything is kept
    Stop "stop" "/v1/stop" |_| "the service ends".to_owned();
}

register_command!(Status, "status");
register_command!(Tap, "tap");
register_command!(Swap, "swap");
