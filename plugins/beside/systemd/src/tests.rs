//! A service whose systemd is the test: it listens at `NOTIFY_SOCKET`.

use std::fs;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration as Wait, Instant as Clock};

use athermal_connectors as _;
use athermal_core::compile::Wanted;
use athermal_core::diagnostic::{Diagnostics, Sources};
use athermal_core::node::prelude::*;
use athermal_features as _;
use athermal_http::client::Address;
use athermal_run::model::Model;
use athermal_serve::deployment::Deployment;
use athermal_serve::service::{Service, ServiceEvent, ServiceOptions};

/// Passes nothing on, and never comes back once a file is there.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hang {
    /// The file.
    when: String,
}

impl Feature for Hang {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "what is not passed on")] }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let channels = inputs.port("signal").to_vec();
        let name = "hang";
        Ok(vec![OutputPort { name, channels }])
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::Own
    }

    fn build(&self, _inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        Box::new(Hanging(self.when.clone()))
    }
}

struct Hanging(String);

impl Operator for Hanging {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        // The control thread has a copy, which would hang too.
        let is_engine = std::thread::current().name() == Some("engine");
        while is_engine && Path::new(&self.0).exists() {
            std::thread::sleep(Wait::from_millis(10));
        }
        for (i, &value) in tick.port(0).iter().enumerate() {
            outputs.set(i, value);
        }
    }

    fn segment(&mut self) {}
}

athermal_core::register!(Hang, Feature, "hang");

const FOLDER: &str = "ATHERMAL_SYSTEMD_TEST";

fn machine(folder: &Path, window: &str) -> String {
    let hang = folder.join("hang");
    format!(
        "schema = 1\nname = \"line\"\ntime = {{ column = \"time_s\", unit = \"s\" }}\n\
         signals.temperature = {{ unit = \"Cel\", channels = [\"room\"], max_age = \"3s\" }}\n\
         nodes.trend = {{ type = \"slope\", inputs.signal = \"temperature\", windows = [\"{window}\"] }}\n\
         nodes.hang = {{ type = \"hang\", inputs.signal = \"temperature\", when = {hang:?} }}\n\
         outputs.trend = \"trend\"\noutputs.same = \"hang\"\n\
         [runtime]\nwait = \"0 s\"\nsettle = \"0 s\"\n\
         [sources.log]\ntype = \"replay\"\npath = \"log.csv\"\nspeed = 10\n\
         [sinks.history]\ntype = \"csv\"\npath = \"history.csv\"\n"
    )
}

/// What `athermal serve` does, in a process of its own.
#[test]
#[ignore = "a process of the other tests"]
fn child() {
    let Some(folder) = std::env::var_os(FOLDER).map(PathBuf::from) else {
        return;
    };
    // As `athermal serve machine.toml` names it, in the folder of the file.
    let path = PathBuf::from("machine.toml");
    let (mut sources, mut mistakes) = (Sources::new(), Diagnostics::new());
    let model = Model::load_from(&path, Wanted::default(), &mut sources, &mut mistakes);
    let model = model.unwrap_or_else(|error| panic!("{error}"));
    let deployment = Deployment::read(&model.graph, &model.plan, &sources, &mut mistakes);
    let options = ServiceOptions {
        machine: path,
        ..ServiceOptions::new(PathBuf::from("state"))
    };
    let (mut service, _) = Service::start(&model, deployment.unwrap(), &options).unwrap();
    while !service.is_over() && !folder.join("end").exists() {
        for event in service.pump() {
            if let ServiceEvent::NotStaged(reason) = event {
                fs::write(folder.join("refused"), reason).unwrap();
            }
        }
        std::thread::sleep(Wait::from_millis(5));
    }
    service.stop().unwrap();
}

/// A service, and what systemd hears of it.
struct Unit {
    folder: PathBuf,
    socket: UnixDatagram,
    child: Child,
    heard: Vec<String>,
}

impl Unit {
    fn start(name: &str, watchdog: Option<Wait>) -> Self {
        let folder =
            std::env::temp_dir().join(format!("athermal-systemd-{}-{name}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        let rows = (0..5_000)
            .map(|nth| format!("{}.{},{}\n", nth / 10, nth % 10, 20.0 + f64::from(nth % 7)));
        fs::write(
            folder.join("log.csv"),
            "time_s,room\n".to_owned() + &rows.collect::<String>(),
        )
        .unwrap();
        fs::write(folder.join("machine.toml"), machine(&folder, "2s")).unwrap();
        let socket = UnixDatagram::bind(folder.join("notify")).unwrap();
        socket
            .set_read_timeout(Some(Wait::from_millis(50)))
            .unwrap();
        let mut command = Command::new(std::env::current_exe().unwrap());
        command
            .args(["--exact", "tests::child", "--ignored", "--nocapture"])
            .env(FOLDER, &folder)
            .current_dir(&folder)
            .env("NOTIFY_SOCKET", folder.join("notify"))
            .stdout(Stdio::null());
        if let Some(watchdog) = watchdog {
            command.env("WATCHDOG_USEC", watchdog.as_micros().to_string());
        }
        Self {
            child: command.spawn().unwrap(),
            folder,
            socket,
            heard: Vec::new(),
        }
    }

    /// Listens until something holds.
    fn until(&mut self, what: &str, holds: impl Fn(&Self) -> bool) {
        let began = Clock::now();
        while !holds(self) {
            self.listen();
            assert!(
                began.elapsed() < Wait::from_secs(30),
                "{what}: {:?}",
                self.heard
            );
        }
    }

    fn listen(&mut self) {
        let mut buffer = [0; 4096];
        while let Ok(count) = self.socket.recv(&mut buffer) {
            let text = String::from_utf8_lossy(&buffer[..count]);
            self.heard.extend(text.lines().map(str::to_owned));
        }
    }

    fn count(&self, line: &str) -> usize {
        self.heard.iter().filter(|of| *of == line).count()
    }

    /// How many lines for `systemctl status` there were.
    fn statuses(&self) -> usize {
        let lines = self.heard.iter();
        lines.filter(|of| of.starts_with("STATUS=")).count()
    }

    fn signal(&self, signal: &str) {
        let id = self.child.id().to_string();
        assert!(
            Command::new("kill")
                .args(["-s", signal, &id])
                .status()
                .unwrap()
                .success()
        );
    }
}

impl Drop for Unit {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = fs::remove_dir_all(&self.folder);
    }
}

#[test]
fn a_service_says_when_it_is_ready_and_feeds_the_watchdog_while_its_engine_works() {
    let mut unit = Unit::start("works", Some(Wait::from_millis(400)));
    unit.until("ready", |of| of.count("READY=1") == 1);
    // Whoever waited for that is answered.
    let address = Address::of(&unit.folder.join("state").to_string_lossy(), None);
    let status = address.unwrap().get("/v1/status").unwrap();
    assert_eq!(status.json()["state"], "running");
    unit.until("fed", |of| of.count("WATCHDOG=1") > 5);
    assert!(
        unit.heard
            .iter()
            .any(|of| of.starts_with("STATUS=") && of.contains("ticks"))
    );
    fs::write(unit.folder.join("end"), "").unwrap();
    unit.until("stopping", |of| of.count("STOPPING=1") == 1);
    assert!(unit.child.wait().unwrap().success());
    assert_eq!(unit.count("READY=1"), 1);
}

#[test]
fn a_node_that_hangs_is_not_fed() {
    let mut unit = Unit::start("hangs", Some(Wait::from_millis(400)));
    unit.until("fed", |of| of.count("WATCHDOG=1") > 3);
    fs::write(unit.folder.join("hang"), "").unwrap();
    // What was on its way.
    std::thread::sleep(Wait::from_millis(600));
    unit.listen();
    let (before, lines) = (unit.count("WATCHDOG=1"), unit.statuses());
    std::thread::sleep(Wait::from_millis(1_500));
    unit.listen();
    assert_eq!(unit.count("WATCHDOG=1"), before, "{:?}", unit.heard);
    // The control thread lives, and says so.
    assert!(unit.statuses() > lines, "{:?}", unit.heard);
    fs::remove_file(unit.folder.join("hang")).unwrap();
    unit.until("fed again", |of| of.count("WATCHDOG=1") > before + 2);
}

#[test]
fn a_hangup_lets_the_machine_file_take_over_as_it_is_now_and_one_with_mistakes_is_refused() {
    if !super::hears_hangups() {
        println!("skipped: SIGHUP is ignored here, as under nohup");
        return;
    }
    let mut unit = Unit::start("hangup", None);
    unit.until("ready", |of| of.count("READY=1") == 1);
    let path = unit.folder.join("machine.toml");
    fs::write(&path, machine(&unit.folder, "2 apples")).unwrap();
    unit.signal("HUP");
    let refused = unit.folder.join("refused");
    unit.until("the refusal", |_| {
        fs::read_to_string(&refused).is_ok_and(|text| !text.is_empty())
    });
    let reason = fs::read_to_string(&refused).unwrap();
    assert!(
        reason.contains("machine.toml:5") && reason.contains('^'),
        "{reason}"
    );
    fs::write(&path, machine(&unit.folder, "5s")).unwrap();
    unit.signal("HUP");
    let history = unit.folder.join("history.csv");
    let revisions = move || {
        let text = fs::read_to_string(&history).unwrap_or_default();
        let lines = text
            .lines()
            .skip(1)
            .filter_map(|line| Some(line.rsplit_once(',')?.1.to_owned()));
        let mut all: Vec<_> = lines.filter(|of| of.len() == 16).collect();
        all.dedup();
        all.len()
    };
    unit.until("the swap", |_| revisions() == 2);
}
