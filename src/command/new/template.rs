//! The files of a new plugin crate. Their texts are those of `examples/templates/`, in which `my-node`, `my_node` and `MyNode` stand for the
//! name, and `CORE`, `RUN`, `TRIAL`, `TESTKIT`, `ATHERMAL` and `VERSION` for the athermal that it builds on.

use clap::ValueEnum;

/// What a new crate brings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Role {
    /// Channels from channels: filters, monitors, corrections
    Feature,
    /// A prediction of what will be measured, fitted on history
    Estimator,
    /// One prediction of several
    Combiner,
    /// Where samples come from: a bus, a controller
    Source,
    /// Where outputs go: a controller, a screen
    Sink,
    /// A machine to simulate
    Machine,
}

impl Role {
    /// Whether it is a node, with a type in graph files.
    #[must_use]
    pub fn is_node(self) -> bool {
        matches!(self, Self::Feature | Self::Estimator | Self::Combiner)
    }

    /// Its name.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Feature => "feature",
            Self::Estimator => "estimator",
            Self::Combiner => "combiner",
            Self::Source => "source",
            Self::Sink => "sink",
            Self::Machine => "machine",
        }
    }
}

/// The names by which a crate calls what it brings.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Names {
    /// The crate: `my-node`.
    pub package: String,
    /// The type in graph files, and the library: `my_node`.
    pub kind: String,
    /// The type in Rust: `MyNode`.
    pub spec: String,
}

impl Names {
    /// The names made of one, if it is a name.
    #[must_use]
    pub fn of(name: &str) -> Option<Self> {
        let mut letters = name.chars();
        let begins = letters.next().is_some_and(|c| c.is_ascii_lowercase());
        let goes_on = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || "-_".contains(c);
        let kind = name.replace('-', "_");
        let words = kind.split('_');
        if !begins || !letters.all(goes_on) || words.clone().any(str::is_empty) {
            return None;
        }
        let capital = |word: &str| word[..1].to_ascii_uppercase() + &word[1..];
        Some(Self {
            package: name.to_owned(),
            spec: words.map(capital).collect(),
            kind,
        })
    }

    /// Whether the templates, or Rust, use one of the names for something else.
    #[must_use]
    pub fn clash(&self) -> bool {
        let texts = ROLES.map(texts).concat();
        let taken = |word: &str| {
            let is = |c: char| c.is_alphanumeric() || c == '_';
            texts
                .iter()
                .filter(|(path, _)| path.ends_with(".rs"))
                .any(|(_, text)| text.split(|c| !is(c)).any(|known| known == word))
        };
        taken(&self.spec)
            || taken(&format!("{}Fitted", self.spec))
            || KEYWORDS.contains(&self.kind.as_str())
            || CRATES.contains(&self.kind.as_str())
    }

    fn put_into(&self, text: &str) -> String {
        text.replace("my-node", &self.package)
            .replace("my_node", &self.kind)
            .replace("MyNode", &self.spec)
    }
}

const ROLES: [Role; 6] = [
    Role::Feature,
    Role::Estimator,
    Role::Combiner,
    Role::Source,
    Role::Sink,
    Role::Machine,
];

/// The words that Rust keeps for itself.
const KEYWORDS: [&str; 51] = [
    "abstract", "as", "async", "await", "become", "box", "break", "const", "continue", "crate",
    "do", "dyn", "else", "enum", "extern", "false", "final", "fn", "for", "gen", "if", "impl",
    "in", "let", "loop", "macro", "match", "mod", "move", "mut", "override", "priv", "pub", "ref",
    "return", "self", "static", "struct", "super", "trait", "true", "try", "type", "typeof",
    "unsafe", "unsized", "use", "virtual", "where", "while", "yield",
];

/// The crates and modules that a new one cannot be called, because it uses them.
const CRATES: [&str; 12] = [
    "athermal",
    "athermal_core",
    "athermal_run",
    "athermal_testkit",
    "athermal_trial",
    "alloc",
    "core",
    "live",
    "schemars",
    "serde",
    "std",
    "test",
];

/// The athermal that a crate is written for, as it stands in a manifest.
#[derive(Debug, Clone)]
pub struct Athermal<'a> {
    /// The folder of its sources.
    pub folder: String,
    /// The folders of the crates that a plugin may build on, by the words that stand for them in a manifest.
    pub crates: Vec<(&'static str, String)>,
    /// Its version.
    pub version: &'a str,
}

/// The files of a crate: paths in it, and their texts.
#[must_use]
pub fn files(names: &Names, role: Role, athermal: &Athermal<'_>) -> Vec<(String, String)> {
    let texts = texts(role).into_iter().map(|(path, text)| {
        let (path, text) = (names.put_into(path), names.put_into(text));
        if path != "Cargo.toml" {
            return (path, text);
        }
        let mut words = vec![("VERSION", athermal.version)];
        words.extend(
            athermal
                .crates
                .iter()
                .map(|(word, folder)| (*word, folder.as_str())),
        );
        words.push(("ATHERMAL", &athermal.folder));
        (path, put(&text, &words))
    });
    texts.collect()
}

/// Puts what they stand for in the place of words. What is put in is not looked through again: a folder may be called anything.
fn put(text: &str, words: &[(&str, &str)]) -> String {
    let Some(((word, meaning), others)) = words.split_first() else {
        return text.to_owned();
    };
    let parts: Vec<String> = text.split(word).map(|part| put(part, others)).collect();
    parts.join(meaning)
}

/// Files of a crate, each with its place there and the template of its text.
macro_rules! files {
    ($($path:literal: $template:literal),* $(,)?) => {
        vec![$(($path, include_str!(concat!("../../../examples/templates/", $template)))),*]
    };
}

/// The files of a role: paths and texts, with what stands for the names still in them.
#[rustfmt::skip]
fn texts(role: Role) -> Vec<(&'static str, &'static str)> {
    let mut texts = match role {
        Role::Feature | Role::Estimator | Role::Combiner => files![
            "Cargo.toml": "node/Cargo.toml.txt", "README.md": "node/README.md.txt",
        ],
        Role::Source | Role::Sink => files![
            "Cargo.toml": "live/Cargo.toml.txt", "graphs/my-node.toml": "live/graph.toml",
        ],
        Role::Machine => files![
            "Cargo.toml": "machine/Cargo.toml.txt", "README.md": "machine/README.md.txt",
        ],
    };
    texts.extend(match role {
        Role::Feature => files![
            "src/lib.rs": "feature/lib.rs", "tests/conformance.rs": "feature/conformance.rs",
            "graphs/my-node.toml": "feature/graph.toml",
        ],
        Role::Estimator => files![
            "src/lib.rs": "estimator/lib.rs", "tests/conformance.rs": "estimator/conformance.rs",
            "graphs/my-node.toml": "estimator/graph.toml",
        ],
        Role::Combiner => files![
            "src/lib.rs": "combiner/lib.rs", "tests/conformance.rs": "combiner/conformance.rs",
            "graphs/my-node.toml": "combiner/graph.toml",
        ],
        Role::Source => files![
            "src/lib.rs": "source/lib.rs", "tests/live.rs": "source/live.rs",
            "examples/run.rs": "source/run.rs", "README.md": "source/README.md.txt",
        ],
        Role::Sink => files![
            "src/lib.rs": "sink/lib.rs", "tests/live.rs": "sink/live.rs",
            "examples/run.rs": "sink/run.rs", "README.md": "sink/README.md.txt",
        ],
        Role::Machine => files![
            "src/lib.rs": "machine/lib.rs", "tests/conformance.rs": "machine/conformance.rs",
            "graphs/my-node.toml": "machine/graph.toml",
        ],
    });
    texts.push((".gitignore", "/target\n"));
    texts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_spelt_as_cargo_graphs_and_rust_spell_it() {
        let names = Names::of("room-lag2").unwrap();
        assert_eq!(
            (names.kind.as_str(), names.spec.as_str()),
            ("room_lag2", "RoomLag2")
        );
        for no_name in ["", "Room", "2nd", "room lag", "room-", "räume", "../room"] {
            assert_eq!(Names::of(no_name), None, "{no_name}");
        }
    }

    #[test]
    fn names_that_mean_something_else_already_are_known() {
        for taken in [
            "feature",
            "votes",
            "instant",
            "type",
            "errors",
            "vec-deque",
            "frame",
            "warming",
        ] {
            assert!(Names::of(taken).unwrap().clash(), "{taken}");
        }
        assert!(!Names::of("room-lag").unwrap().clash());
    }

    #[test]
    fn a_folder_may_be_called_like_what_is_replaced() {
        let names = Names::of("room-lag").unwrap();
        let athermal = Athermal {
            folder: "\"/srv/my-node\"".to_owned(),
            crates: vec![("CORE", "\"/srv/my-node/ATHERMAL/CORE/VERSION\"".to_owned())],
            version: "1.2.3",
        };
        let (path, text) = files(&names, Role::Source, &athermal).swap_remove(0);
        assert_eq!(path, "Cargo.toml");
        for line in [
            "athermal-core = { path = \"/srv/my-node/ATHERMAL/CORE/VERSION\", version = \"1.2.3\" }\n",
            "athermal = { path = \"/srv/my-node\", version = \"1.2.3\", default-features = false }\n",
        ] {
            assert!(text.contains(line), "{text}");
        }
    }

    #[test]
    fn nothing_of_the_template_is_left_over() {
        let names = Names::of("room-lag").unwrap();
        let athermal = Athermal {
            folder: "\"/sources\"".to_owned(),
            crates: ["CORE", "RUN", "TRIAL", "TESTKIT"]
                .map(|word| (word, "\"/sources/core\"".to_owned()))
                .to_vec(),
            version: "1.2.3",
        };
        for role in ROLES {
            for (path, text) in files(&names, role, &athermal) {
                for left in [
                    "my_node", "my-node", "MyNode", "CORE", "RUN", "TRIAL", "TESTKIT", "VERSION",
                    "ATHERMAL",
                ] {
                    assert!(!path.contains(left), "{left} in {path}");
                    assert!(!text.contains(left), "{left} in {path}:\n{text}");
                }
            }
        }
    }
}
