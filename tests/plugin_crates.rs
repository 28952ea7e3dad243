//! Crates of one's own: what `new plugin` writes, and what `build` says before it builds anything. That the crates build, keep
//! the rules of every node and end up in a binary is tried by `.ci/template`, which takes minutes.

#![allow(clippy::unwrap_used)]

mod workbench;

use std::path::Path;

use workbench::{Scratch, athermal};

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

#[test]
fn a_new_plugin_has_all_that_a_crate_needs_under_its_own_names() {
    for role in ["feature", "estimator", "combiner"] {
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
        wrote
            .ended(0)
            .tells(&["wrote", "`room_lag`", "build --with path:."]);
        for file in [
            "Cargo.toml",
            "Cargo.lock",
            "README.md",
            "src/lib.rs",
            "tests/conformance.rs",
        ] {
            assert!(folder.join(file).is_file(), "{file}");
        }
        let read = |file: &str| std::fs::read_to_string(folder.join(file)).unwrap();
        assert!(read("src/lib.rs").contains("pub struct RoomLag {"));
        assert!(read("graphs/room-lag.toml").contains("type = \"room_lag\""));
        let core = Path::new(ROOT)
            .canonicalize()
            .unwrap()
            .join("core/framework");
        assert!(read("Cargo.toml").contains(&core.display().to_string()));
    }
}

#[test]
fn a_name_that_is_none_or_taken_is_refused_with_a_reason() {
    for (name, reason) in [
        ("Room Lag", "begin with a small letter"),
        ("slope", "from athermal-features"),
        ("votes", "means something else already"),
        ("async", "means something else already"),
    ] {
        athermal(&[&"new", &"plugin", &name])
            .ended(2)
            .tells(&[reason]);
    }
    let scratch = Scratch::new("new-refused");
    scratch.file("there.txt", "");
    athermal(&[&"new", &"plugin", &"room-lag", &"-o", &scratch.path("")])
        .ended(2)
        .tells(&["not empty"]);
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
            [
                "old-nodes is made for athermal-core ^99.1",
                "this program is athermal",
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
            [
                "two copies do not know each other's nodes",
                "--athermal path:DIR",
            ],
        ),
        (
            with_core(&scratch, "no-nodes", ""),
            ["no-nodes does not depend on athermal-core", "no node type"],
        ),
        (
            format!("path:{}", scratch.path("nothing").display()),
            ["there is no crate in", "nothing"],
        ),
        ("a crate".to_owned(), ["names no crate", "path:DIR"]),
        (
            "nodes@latest".to_owned(),
            ["`latest` is no version", "nodes"],
        ),
    ];
    for (with, told) in cases {
        let built = athermal(&[&"build", &"--with", &with, &"-o", &binary, &"--offline"]);
        assert!(matches!(built.status, 2 | 3), "{built:?}");
        built.tells(&told);
    }
    assert!(!binary.exists() && !scratch.path("ours-project").exists());
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
