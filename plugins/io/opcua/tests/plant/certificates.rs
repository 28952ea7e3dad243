//! Certificates that are unknown, expired, of another host; a policy that is not offered; a user who is not let in.

use std::path::{Path, PathBuf};
use std::time::Duration;

use athermal_command::{CommandKind, Terminal};
use athermal_core::registry::find;

use crate::plant::{Folder, Plant, certificate};
use crate::service::{GRAPH, Running, declared};

pub fn machine(port: u16, keys: &str) -> String {
    format!(
        "{GRAPH}[runtime]\nstate = \"state\"\nwait = \"0 s\"\nsettle = \"0 s\"\n\
         [sources.plc]\ntype = \"opcua\"\nendpoint = \"opc.tcp://127.0.0.1:{port}\"\nnamespace = \"urn:plant\"\n\
         retry = \"500 ms\"\nchannels = {{ \"temperature.plate\" = \"s=Therm.0\" }}\n{keys}\n\
         [sinks.history]\ntype = \"csv\"\npath = \"history.csv\"\n"
    )
}

/// Why there is no session.
fn refused(folder: &Folder, port: u16, keys: &str) -> String {
    let (model, deployment) =
        declared(folder, &machine(port, keys)).unwrap_or_else(|of| panic!("{of}"));
    let found = deployment.look(
        &model.plan,
        &folder.0.join("state"),
        Duration::from_secs(20),
    );
    found[0].channels.as_ref().unwrap_err().to_string()
}

/// `athermal trust` with these words.
fn trust(words: &[&str]) -> Result<String, String> {
    let kind = find::<CommandKind>("trust").unwrap();
    let words = ["trust"].iter().chain(words);
    let matches = (kind.declare)().try_get_matches_from(words);
    let options = athermal_command::terminal::Options {
        format: "table".to_owned(),
        quiet: true,
    };
    let done = (kind.run)(&matches.unwrap(), &Terminal::new(&options));
    done.map(|of| format!("{of:?}"))
        .map_err(|of| format!("{of:?}"))
}

fn files(folder: &Path, name: &str) -> Vec<PathBuf> {
    let found = std::fs::read_dir(folder.join("state/sources/plc").join(name));
    found
        .into_iter()
        .flatten()
        .map(|of| of.unwrap().path())
        .collect()
}

const SECURE: &str = "security = \"Basic256Sha256\"";

#[test]
fn an_unknown_certificate_is_kept_and_said_and_its_server_taken_once_it_is_trusted() {
    let folder = Folder::new("trusted");
    let arguments = |path: &str| {
        let policies = "Basic256Sha256_SignAndEncrypt";
        ["--policies", policies, "--certificate", path, "--hz", "20"].map(str::to_owned)
    };
    if Plant::start(&[]).is_none() {
        return;
    }
    let path = certificate(&folder, "right");
    let of: Vec<_> = arguments(&path).into();
    let of: Vec<_> = of.iter().map(String::as_str).collect();
    let plant = Plant::start(&of).unwrap();
    let port = plant.port;
    let why = refused(&folder, port, SECURE);
    assert!(
        why.contains("`the plant`, valid until 20") && why.contains("athermal trust MACHINE "),
        "{why}"
    );
    let fingerprint = why
        .rsplit([' ', '`'])
        .find(|of| of.len() == 40)
        .unwrap()
        .to_owned();
    assert_eq!(files(&folder.0, "rejected").len(), 1);
    let path = folder.0.join("machine.toml").to_string_lossy().into_owned();
    assert_eq!(trust(&[&path]), Ok("Fine".to_owned()));
    assert!(
        trust(&[&path, "0000"])
            .unwrap_err()
            .contains("fingerprint 0000")
    );
    // Nothing has been moved by that.
    assert!(refused(&folder, port, SECURE).contains("not trusted"));
    assert_eq!(
        trust(&[&path, &fingerprint.to_uppercase()]),
        Ok("Fine".to_owned())
    );
    assert!(files(&folder.0, "rejected").is_empty() && files(&folder.0, "trusted").len() == 1);
    let own = std::fs::read(&files(&folder.0, "own")[0]).unwrap();
    let mut service = Running::start(&folder, &machine(port, SECURE));
    service.until("data", |of| of.given() > 20);
    service.stop();
    assert_eq!(
        own,
        std::fs::read(&files(&folder.0, "own")[0]).unwrap(),
        "it is made once"
    );
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let mode = std::fs::metadata(&files(&folder.0, "private")[0])
            .unwrap()
            .permissions()
            .mode();
        assert_eq!(mode & 0o77, 0, "others read the key: {mode:o}");
    }
    // Only signed, or by another policy: neither is offered.
    for (keys, why) in [
        (
            "security = \"Basic256Sha256\"\nmode = \"sign\"",
            "it offers Basic256Sha256 (SignAndEncrypt)",
        ),
        (
            "security = \"Aes256_Sha256_RsaPss\"",
            "does not offer security = \"Aes256_Sha256_RsaPss\"",
        ),
        ("security = \"none\"", "does not offer security = \"none\""),
    ] {
        let found = refused(&folder, port, keys);
        assert!(
            found.contains(why) && found.contains("write one of these"),
            "{found}"
        );
    }
}

#[test]
fn a_certificate_that_is_expired_or_of_another_host_is_refused_although_it_is_trusted() {
    if Plant::start(&[]).is_none() {
        return;
    }
    for (kind, why) in [
        ("expired", "is not valid now: renew it on the server"),
        ("wrong-host", "is not for `127.0.0.1`: write the `endpoint`"),
    ] {
        let folder = Folder::new(kind);
        let path = certificate(&folder, kind);
        let arguments = [
            "--policies",
            "Basic256Sha256_SignAndEncrypt",
            "--certificate",
            &path,
        ];
        let plant = Plant::start(&arguments).unwrap();
        let unknown = refused(&folder, plant.port, SECURE);
        let fingerprint = unknown
            .rsplit([' ', '`'])
            .find(|of| of.len() == 40)
            .unwrap();
        let state = folder.0.join("state").to_string_lossy().into_owned();
        trust(&[&state, fingerprint]).unwrap();
        let found = refused(&folder, plant.port, SECURE);
        assert!(found.contains(why), "{found}");
    }
}

#[test]
fn a_user_who_is_not_let_in_is_a_state_and_no_end() {
    let Some(plant) = Plant::start(&["--login", "me:w0rd", "--hz", "20"]) else {
        return;
    };
    let folder = Folder::new("login");
    let of = |password: &str| {
        std::fs::write(folder.0.join("password"), password).unwrap();
        "login = { name = \"me\", password = { file = \"password\" } }"
    };
    let why = refused(&folder, plant.port, of("other"));
    assert!(
        why.contains("does not take this user and password; see `login`"),
        "{why}"
    );
    assert!(!why.contains("other"), "{why}");
    let mut service = Running::start(&folder, &machine(plant.port, of("w0rd\n")));
    service.until("data", |of| of.given() > 20);
    service.stop();
    let mut service = Running::start(&folder, &machine(plant.port, of("other")));
    service.until("it is refused again and again", |of| {
        of.events
            .iter()
            .filter(|of| of.contains("see `login`"))
            .count()
            > 1
    });
    service.stop();
}
