//! Crates of one's own: what `new plugin` writes, and what `build` says before it builds anything. That the crates build, keep
//! the rules of every node and end up in a binary is tried by `.ci/template`, which takes minutes.

use std::path::Path;

use crate::workbench::{Scratch, athermal};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// A folder with a crate that depends on the core as it is told to.
fn with_core(scratch: &Scratch, name: &str, core: &str) -> String {
    let folder = scratch.path(name);
    std::fs::create_dir_all(folder.join("src")).unwrap();
    std::fs::write(folder.join("src/lib.rs"), "").unwrap();
    let manifest = format!(
        "[package]\nname = \"{name}\"\nversion = \"0.1.0\"\nedition = \"2024\"\n\n[dependencies]\n{core}\n\n[workspace]\n"
    );
    std::fs::write(folder.join("Cargo.toml"), manifest).unwrap();
    format!("path:{}", folder.display())
}

/// Each role, the files that it has beside those that all have, and what the author is told to type.
const ROLES: [(&str, &[&str], &str); 7] = [
    ("feature", &["tests/conformance.rs"], "build --with path:."),
    (
        "estimator",
        &["tests/conformance.rs"],
        "build --with path:.",
    ),
    ("combiner", &["tests/conformance.rs"], "build --with path:."),
    ("source", &["tests/live.rs"], "target/athermal serve"),
    ("sink", &["tests/live.rs"], "target/athermal serve"),
    ("companion", &["tests/live.rs"], "target/athermal serve"),
    ("machine", &["tests/conformance.rs"], "build --with path:."),
];

/// Every file under a folder, as paths from there.
fn files_in(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let inside = path.strip_prefix(folder).unwrap();
                found.push(inside.to_str().unwrap().replace('\\', "/"));
            }
        }
    }
    found.sort();
    found
}

#[test]
fn a_new_plugin_has_all_that_a_crate_needs_under_its_own_names_and_nothing_else() {
    for (role, own, told) in ROLES {
        let scratch = Scratch::new(&format!("new-{role}"));
        let folder = scratch.path("room-lag");
        let wrote = athermal(&[
            &"new",
            &"plugin",
            &"room-lag",
            &"--role",
            &role,
            &"-o",
            &folder,
        ]);
        wrote.ended(0).tells(&["wrote", "cargo test", told]);
        let shared = [
            ".gitignore",
            "Cargo.lock",
            "Cargo.toml",
            "README.md",
            "graphs/room-lag.toml",
            "src/lib.rs",
        ];
        let mut expected: Vec<&str> = shared.iter().chain(own).copied().collect();
        expected.sort_unstable();
        assert_eq!(files_in(&folder), expected, "{role}");
        let read = |file: &str| std::fs::read_to_string(folder.join(file)).unwrap();
        assert!(read("src/lib.rs").contains("pub struct RoomLag"), "{role}");
        assert!(read("graphs/room-lag.toml").contains("[[tests]]"), "{role}");
        for file in expected.iter().filter(|file| **file != "Cargo.lock") {
            let text = read(file);
            for left in ["my-node", "my_node", "MyNode", "CORE", "SERVE"] {
                assert!(!text.contains(left), "{left} in {file} of a {role}");
            }
        }
        let core = Path::new(ROOT)
            .canonicalize()
            .unwrap()
            .join("core/framework");
        assert!(read("Cargo.toml").contains(&core.display().to_string()));
    }
}

#[test]
fn what_was_written_is_told_to_programs_too() {
    let scratch = Scratch::new("new-json");
    for (role, kind) in [
        ("feature", "\"room_lag\""),
        ("source", "\"room_lag\""),
        ("machine", "null"),
    ] {
        let folder = scratch.path(role);
        let wrote = athermal(&[
            &"--format",
            &"json",
            &"new",
            &"plugin",
            &"room-lag",
            &"--role",
            &role,
            &"-o",
            &folder,
        ]);
        let wrote = wrote.ended(0);
        let told: serde_json::Value = serde_json::from_str(&wrote.out).unwrap();
        assert_eq!(told["role"], role);
        assert_eq!(told["kind"].to_string(), kind);
        assert_eq!(
            told["files"].as_array().unwrap().len(),
            files_in(&folder).len()
        );
    }
}

#[test]
fn a_name_that_is_none_or_taken_is_refused_with_a_reason() {
    for (name, role, reason) in [
        ("Room Lag", "feature", "begin with a small letter"),
        (
            "slope",
            "feature",
            "a node type `slope` already, from athermal-features",
        ),
        (
            "csv",
            "sink",
            "a kind of sink `csv` already, from athermal-connectors",
        ),
        (
            "linear-axis",
            "machine",
            "a simulated machine `linear-axis` already, from athermal-simulation",
        ),
    ] {
        athermal(&[&"new", &"plugin", &name, &"--role", &role])
            .ended(2)
            .tells(&[reason]);
    }
    let scratch = Scratch::new("new-refused");
    scratch.file("there.txt", "");
    athermal(&[&"new", &"plugin", &"room-lag", &"-o", &scratch.path("")])
        .ended(2)
        .tells(&["not empty"]);
    // A source may have the name of a node: both are looked up where they stand.
    let folder = scratch.path("slope");
    athermal(&[
        &"new", &"plugin", &"slope", &"--role", &"source", &"-o", &folder,
    ])
    .ended(0);
}

#[test]
fn sources_that_are_not_there_are_asked_for() {
    let scratch = Scratch::new("new-without-sources");
    let nowhere = format!("path:{}", scratch.path("nowhere").display());
    let folder = scratch.path("room-lag");
    athermal(&[
        &"new",
        &"plugin",
        &"room-lag",
        &"-o",
        &folder,
        &"--athermal",
        &nowhere,
    ])
    .ended(3)
    .tells(&["nowhere", "not on crates.io yet", "--athermal path:DIR"]);
    assert!(!folder.exists(), "nothing is written before all is known");
    athermal(&[
        &"new",
        &"plugin",
        &"room-lag",
        &"-o",
        &folder,
        &"--athermal",
        &"1.0",
    ])
    .ended(2)
    .tells(&["path:DIR"]);
}

#[test]
fn a_crate_that_is_not_made_for_this_athermal_is_refused_before_anything_is_built() {
    let scratch = Scratch::new("build-refused");
    let binary = scratch.path("ours");
    let other = scratch.path("other-core");
    std::fs::create_dir_all(other.join("src")).unwrap();
    let manifest = "[package]\nname = \"athermal-core\"\nversion = \"0.1.0\"\nedition = \"2024\"\n";
    std::fs::write(other.join("Cargo.toml"), manifest).unwrap();
    std::fs::write(other.join("src/lib.rs"), "").unwrap();
    let cases = [
        (
            with_core(&scratch, "old-nodes", "athermal-core = \"^99.1\""),
            3,
            [
                "cargo cannot put the crates of",
                "athermal-core = \"^99.1\"",
            ],
        ),
        (
            with_core(
                &scratch,
                "other-nodes",
                &format!(
                    "athermal-core = {{ path = {:?} }}",
                    other.display().to_string()
                ),
            ),
            3,
            ["cargo cannot put the crates of", "other-core"],
        ),
        (
            with_core(
                &scratch,
                "tested-nodes",
                &format!(
                    "athermal-core = {{ path = \"{ROOT}/core/framework\" }}\nathermal-testkit = {{ path = \"{ROOT}/core/testkit\" }}"
                ),
            ),
            2,
            [
                "tested-nodes has athermal-testkit under `[dependencies]`",
                "`[dev-dependencies]`",
            ],
        ),
        (
            format!("path:{}", scratch.path("nothing").display()),
            3,
            ["there is no crate in", "nothing"],
        ),
        ("a crate".to_owned(), 2, ["names no crate", "path:DIR"]),
        (
            "nodes@latest".to_owned(),
            2,
            ["`latest` is no version", "nodes"],
        ),
    ];
    for (with, status, told) in cases {
        let built = athermal(&[&"build", &"--with", &with, &"-o", &binary, &"--offline"]);
        built.ended(status).tells(&told);
    }
    assert!(!binary.exists());
}

#[test]
fn a_project_of_somebody_else_is_not_written_over() {
    let scratch = Scratch::new("build-project");
    let with = with_core(
        &scratch,
        "our-nodes",
        &format!(
            "athermal-core = {{ path = {:?} }}",
            format!("{ROOT}/core/framework")
        ),
    );
    let project = scratch.path("our-nodes");
    let built = athermal(&[
        &"build",
        &"--with",
        &with,
        &"-o",
        &scratch.path("ours"),
        &"--project",
        &project,
        &"--offline",
    ]);
    built.ended(2).tells(&["did not write", "--project"]);
    let absent = athermal(&[
        &"build",
        &"--with",
        &with,
        &"-o",
        &scratch.path("ours"),
        &"--vendored",
        &scratch.path("vendor"),
    ]);
    absent.ended(3).tells(&["no vendored crates in"]);
}

#[test]
fn a_wheel_is_refused_where_what_makes_it_is_missing() {
    let scratch = Scratch::new("build-wheel");
    let core = format!(
        "athermal-core = {{ path = {:?} }}",
        format!("{ROOT}/core/framework")
    );
    let with = with_core(&scratch, "wheel-nodes", &core);
    let wheels = scratch.path("wheels");
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_athermal"))
        .args(["build", "--wheel", "--with", &with, "-o"])
        .arg(&wheels)
        .env("MATURIN", scratch.path("no-maturin"))
        .output()
        .unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(3), "{message}");
    assert!(message.contains("pip install maturin"), "{message}");
    assert!(!wheels.exists() && !scratch.path("wheels-project").exists());
}

#[cfg(unix)]
#[test]
fn a_wheel_is_for_the_python_that_is_named_else_that_of_pyo3_and_one_that_cannot_be_it_is_refused_before_the_build()
 {
    use std::os::unix::fs::PermissionsExt;

    let scratch = Scratch::new("build-python");
    let core = format!(
        "athermal-core = {{ path = {:?} }}",
        format!("{ROOT}/core/framework")
    );
    let with = with_core(&scratch, "python-nodes", &core);
    let script = |name: &str, text: &str| {
        let path = scratch.file(name, format!("#!/bin/sh\n{text}\n"));
        std::fs::set_permissions(&path, PermissionsExt::from_mode(0o755)).unwrap();
        path
    };
    let called = scratch.path("called");
    let note = format!("echo \"$PYO3_PYTHON $*\" >> {}; exit 1", called.display());
    let maturin = script(
        "maturin",
        &format!("[ \"$1\" = --version ] && exit 0\n{note}"),
    );
    let old = script("old-python", "echo False 3.9.2");
    let new = script("new-python", "echo True 3.12.1");
    let build = |named: Option<&std::path::Path>, of_pyo3: &std::path::Path| {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_athermal"))
            .args(["build", "--wheel", "--with", &with, "-o"])
            .arg(scratch.path("wheels"))
            .args(named.map(|path| format!("--python={}", path.display())))
            .env("MATURIN", &maturin)
            .env("PYO3_PYTHON", of_pyo3)
            .output()
            .unwrap();
        let message = String::from_utf8(output.stderr).unwrap();
        (output.status.code(), message)
    };
    let (status, message) = build(None, &old);
    assert!(
        status == Some(2) && message.contains("Python 3.9.2"),
        "{message}"
    );
    let (status, message) = build(Some(&scratch.path("no-python")), &new);
    assert!(
        status == Some(3) && message.contains("--python PATH"),
        "{message}"
    );
    assert!(!called.exists());
    for (named, of_pyo3) in [(Some(&*new), &*old), (None, &*new)] {
        let (_, message) = build(named, of_pyo3);
        let asked = std::fs::read_to_string(&called).unwrap_or_else(|_| panic!("{message}"));
        let (python, arguments) = asked.split_once(' ').unwrap();
        assert_eq!(python, new.to_str().unwrap());
        assert!(
            arguments.contains(&format!("--interpreter {python}")),
            "{arguments}"
        );
        std::fs::remove_file(&called).unwrap();
    }
}

/// A cargo that notes how it is called to build, and builds nothing.
#[cfg(unix)]
#[test]
fn cargo_is_as_quiet_as_the_program_is_asked_to_be() {
    use std::os::unix::fs::PermissionsExt;

    let scratch = Scratch::new("build-quiet");
    let core = format!("{ROOT}/core/framework");
    let with = with_core(
        &scratch,
        "quiet-nodes",
        &format!("athermal-core = {{ path = {core:?} }}"),
    );
    let called = scratch.path("called");
    let script = format!(
        "#!/bin/sh\nif [ \"$1\" = build ]; then echo \"$@\" >> {called:?}; exit 1; fi\nexec {:?} \"$@\"\n",
        env!("CARGO")
    );
    let cargo = scratch.file("cargo", script);
    std::fs::set_permissions(&cargo, std::fs::Permissions::from_mode(0o755)).unwrap();
    for quiet in [false, true] {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_athermal"))
            .args(["build", "--with", &with, "--offline", "-o"])
            .arg(scratch.path("ours"))
            .args(quiet.then_some("-q"))
            .env("CARGO", &cargo)
            .output()
            .unwrap();
        let told = String::from_utf8(output.stderr).unwrap();
        assert!(told.contains("cargo could not build"), "{told}");
    }
    let called = std::fs::read_to_string(called).unwrap();
    let quiet: Vec<bool> = called
        .lines()
        .map(|line| line.contains("--quiet"))
        .collect();
    assert_eq!(quiet, [false, true], "{called}");
}
