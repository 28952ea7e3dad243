//! `mqtts://`: a broker with a certificate that this test makes; or the sentence with which a program without TLS refuses it.

use crate::server::Folder;
#[cfg(feature = "tls")]
use crate::service::deployment;
use crate::service::{TOGETHER, machine};

/// Why a service does not start.
#[cfg(feature = "tls")]
fn refusal(folder: &Folder, machine: &str) -> String {
    std::fs::write(folder.0.join("machine.toml"), machine).unwrap();
    let (model, deployment) = deployment(&folder.0);
    let options = athermal_serve::service::ServiceOptions::new(folder.0.join("state"));
    let started = athermal_serve::service::Service::start(&model, deployment, &options);
    started.map(|_| ()).unwrap_err().to_string()
}

/// What `check` reports of a machine file.
fn mistakes(folder: &Folder, machine: &str) -> String {
    std::fs::write(folder.0.join("machine.toml"), machine).unwrap();
    crate::service::declared(&folder.0).unwrap_err()
}

#[test]
fn a_certificate_of_the_client_without_tls_is_refused() {
    let folder = Folder::new("certificate");
    let keys = "tls = { certificate = \"a.pem\", key = \"a.key\" }\n";
    let why = mistakes(&folder, &machine(1, &format!("{keys}{TOGETHER}"), ""));
    assert!(
        why.contains("a certificate of the client is of TLS"),
        "{why}"
    );
}

fn secure(port: u16, keys: &str) -> String {
    machine(port, &format!("{keys}{TOGETHER}"), "").replace("mqtt://", "mqtts://")
}

#[cfg(not(feature = "tls"))]
#[test]
fn a_program_without_tls_refuses_such_a_broker_before_anything_runs() {
    let folder = Folder::new("plain");
    let source = secure(1, "");
    let sink = "[sinks.out]\ntype = \"mqtt\"\nbroker = \"mqtts://broker\"\ntopic = \"out\"\nspool = \"1 MB\"\n";
    for machine in [source, machine(1, TOGETHER, sink)] {
        let why = mistakes(&folder, &machine);
        assert!(
            why.contains("asks for TLS, and this program was built without it"),
            "{why}"
        );
        assert!(why.contains("--features tls"), "{why}");
        assert_eq!(why.matches("error[").count(), 1, "{why}");
    }
}

#[cfg(feature = "tls")]
mod with_tls {
    use std::fs;
    use std::path::Path;
    use std::process::Command;

    use super::*;
    use crate::peer::Peer;
    use crate::server::{Broker, SAFE, free_port, has};
    use crate::service::{Running, both};

    fn openssl(folder: &Path, arguments: &str) {
        let mut command = Command::new("openssl");
        command.args(arguments.split(' ')).current_dir(folder);
        let output = command.output().unwrap();
        let words = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "openssl {arguments}: {words}");
    }

    /// An authority, as `NAME.pem` and `NAME.key`.
    fn authority(folder: &Path, name: &str) {
        openssl(
            folder,
            &format!(
                "req -x509 -newkey rsa:2048 -nodes -keyout {name}.key -out {name}.pem -days 2 -subj /CN={name} -addext keyUsage=critical,keyCertSign"
            ),
        );
    }

    /// Mosquitto on two ports, the second one with a certificate for 127.0.0.1.
    fn broker() -> Option<(Broker, u16)> {
        if !has("openssl") {
            return None;
        }
        let mut broker = Broker::mosquitto_down(SAFE)?;
        let folder = &broker.folder.0;
        authority(folder, "ours");
        authority(folder, "other");
        fs::write(
            folder.join("names"),
            "subjectAltName=DNS:localhost,IP:127.0.0.1\nbasicConstraints=CA:FALSE\n",
        )
        .unwrap();
        openssl(
            folder,
            "req -newkey rsa:2048 -nodes -keyout broker.key -out broker.csr -subj /CN=localhost",
        );
        openssl(
            folder,
            "x509 -req -in broker.csr -CA ours.pem -CAkey ours.key -CAcreateserial -days 2 -extfile names -out broker.pem",
        );
        let port = free_port();
        let (conf, at) = (folder.join("conf"), folder.display());
        let text = fs::read_to_string(&conf).unwrap();
        let more = format!(
            "listener {port} 127.0.0.1\ncertfile {at}/broker.pem\nkeyfile {at}/broker.key\n"
        );
        fs::write(conf, text + &more).unwrap();
        broker.start();
        Some((broker, port))
    }

    #[test]
    fn a_broker_with_tls_is_a_source_and_takes_outputs_in_both_versions() {
        let Some((broker, port)) = broker() else {
            return;
        };
        let ours = broker.folder.0.join("ours.pem");
        for version in ["5", "3.1.1"] {
            let folder = Folder::new("tls");
            let keys = format!(
                "authorities = \"{}\"\nversion = \"{version}\"\n",
                ours.display()
            );
            let sink = format!(
                "[sinks.out]\ntype = \"mqtt\"\nbroker = \"mqtts://localhost:{port}\"\n{keys}topic = \"out/tick\"\nspool = \"1 MB\"\n"
            );
            let mut listener = Peer::connect(broker.port, "listener", true).unwrap();
            listener.subscribe("out/tick");
            let mut service = Running::start(&folder, &(secure(port, &keys) + &sink));
            service.settle();
            let mut peer = Peer::connect(broker.port, "peer", true).unwrap();
            peer.publish_safely("plant/all", both(10).as_bytes(), false);
            service.until_given(2);
            let mut came = false;
            service.until("an output", |_| {
                came |= listener
                    .receive(std::time::Duration::from_millis(50))
                    .unwrap()
                    .is_some();
                came
            });
            service.stop();
        }
    }

    #[test]
    fn a_broker_whose_certificate_is_by_another_authority_is_not_spoken_to() {
        let Some((broker, port)) = broker() else {
            return;
        };
        let other = broker.folder.0.join("other.pem");
        let folder = Folder::new("tls-other");
        let keys = format!("authorities = \"{}\"\n", other.display());
        let mut service = Running::start(&folder, &secure(port, &keys));
        service.until("that it is reported", |of| {
            of.heard("SourceFailed") && of.heard("UnknownIssuer")
        });
        assert_eq!(service.given(), 0);
        service.stop();
    }

    /// A certificate by `ours`, as `NAME.pem` and `NAME.key`. Without an extension it would be of version 1, which nobody takes.
    fn certificate(folder: &Path, name: &str) {
        fs::write(folder.join("leaf"), "basicConstraints=CA:FALSE\n").unwrap();
        openssl(
            folder,
            &format!(
                "req -newkey rsa:2048 -nodes -keyout {name}.key -out {name}.csr -subj /CN={name}"
            ),
        );
        openssl(
            folder,
            &format!(
                "x509 -req -in {name}.csr -CA ours.pem -CAkey ours.key -CAcreateserial -days 2 -extfile leaf -out {name}.pem"
            ),
        );
    }

    #[test]
    fn a_broker_that_asks_for_a_certificate_is_given_that_of_the_client() {
        let Some((mut broker, port)) = broker() else {
            return;
        };
        let at = broker.folder.0.clone();
        certificate(&at, "client");
        let conf = fs::read_to_string(at.join("conf")).unwrap();
        let more = format!(
            "cafile {}/ours.pem\nrequire_certificate true\n",
            at.display()
        );
        fs::write(at.join("conf"), conf + &more).unwrap();
        broker.kill();
        broker.start();
        let ours = format!("authorities = \"{}/ours.pem\"\n", at.display());
        let own = format!(
            "tls = {{ certificate = \"{0}/client.pem\", key = \"{0}/client.key\" }}\n",
            at.display()
        );
        for version in ["5", "3.1.1"] {
            let keys = format!("{ours}version = \"{version}\"\n");
            let folder = Folder::new("tls-without");
            let mut service = Running::start(&folder, &secure(port, &keys));
            service.until("that it is reported", |of| of.heard("SourceFailed"));
            service.stop();
            let folder = Folder::new("tls-client");
            let mut service = Running::start(&folder, &secure(port, &(keys + &own)));
            service.settle();
            let mut peer = Peer::connect(broker.port, "peer", true).unwrap();
            peer.publish_safely("plant/all", both(10).as_bytes(), false);
            service.until_given(2);
            service.stop();
        }
    }

    #[test]
    fn a_certificate_of_the_client_that_cannot_be_used_is_refused_by_its_name() {
        let folder = Folder::new("tls-client-none");
        let at = &folder.0;
        authority(at, "ours");
        certificate(at, "one");
        certificate(at, "other");
        fs::write(at.join("empty.pem"), "").unwrap();
        for (certificate, key, words) in [
            ("missing.pem", "one.key", "missing.pem"),
            ("empty.pem", "one.key", "there is none in it"),
            ("one.pem", "missing.key", "missing.key"),
            ("one.pem", "empty.pem", "empty.pem"),
            ("one.pem", "other.key", "does not go with the key"),
        ] {
            let keys = format!(
                "authorities = \"ours.pem\"\ntls = {{ certificate = \"{certificate}\", key = \"{key}\" }}\n"
            );
            let why = refusal(&folder, &secure(1, &keys));
            assert!(why.contains(words), "{why}");
        }
    }

    #[test]
    fn authorities_that_cannot_be_read_are_refused_before_anything_runs() {
        let folder = Folder::new("tls-none");
        fs::write(folder.0.join("empty.pem"), "").unwrap();
        for (name, words) in [
            ("missing.pem", "missing.pem"),
            ("empty.pem", "there is none in it"),
        ] {
            let why = refusal(&folder, &secure(1, &format!("authorities = \"{name}\"\n")));
            assert!(why.contains(words), "{why}");
        }
    }
}
