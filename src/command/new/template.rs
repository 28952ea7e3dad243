//! The files of a new plugin crate. Their texts are those of `examples/templates/`, in which `my-node`, `my_node` and `MyNode` stand for the
//! name, and `CORE`, `SERVE`, `INTERFACE`, `COMMAND`, `TRIAL`, `TESTKIT` and `VERSION` for the athermal that it builds on.

use clap::ValueEnum;
use serde::Serialize;

/// What a new crate brings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
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
    /// What runs beside a service: a section, a page, a command
    Companion,
    /// A machine to simulate
    Machine,
}

impl Role {
    /// Whether it is a node, with a type in graph files.
    #[must_use]
    pub fn is_node(self) -> bool {
        matches!(self, Self::Feature | Self::Estimator | Self::Combiner)
    }

    /// Whether graph files name it as a `type`.
    #[must_use]
    pub fn has_kind(self) -> bool {
        self.is_node() || matches!(self, Self::Source | Self::Sink)
    }

    /// Whether it is part of a service.
    #[must_use]
    pub fn is_live(self) -> bool {
        matches!(self, Self::Source | Self::Sink | Self::Companion)
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

    fn put_into(&self, text: &str) -> String {
        text.replace("my-node", &self.package)
            .replace("my_node", &self.kind)
            .replace("MyNode", &self.spec)
    }
}

/// The files of a crate: paths in it, and their texts. In the manifest `words` are replaced by what they stand for.
#[must_use]
pub fn files(names: &Names, role: Role, words: &[(&str, String)]) -> Vec<(String, String)> {
    let texts = texts(role).into_iter().map(|(path, text)| {
        let (path, text) = (names.put_into(path), names.put_into(text));
        match path.as_str() {
            "Cargo.toml" => (path, put(&text, words)),
            _ => (path, text),
        }
    });
    texts.collect()
}

/// Puts what they stand for in the place of words. What is put in is not looked through again: a folder may be called anything.
fn put(text: &str, words: &[(&str, String)]) -> String {
    let Some(((word, meaning), others)) = words.split_first() else {
        return text.to_owned();
    };
    let parts: Vec<String> = text.split(*word).map(|part| put(part, others)).collect();
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
            "Cargo.toml": "live/Cargo.toml.txt",
        ],
        Role::Companion => files![
            "Cargo.toml": "companion/Cargo.toml.txt", "README.md": "companion/README.md.txt",
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
            "graphs/my-node.toml": "source/graph.toml", "README.md": "source/README.md.txt",
        ],
        Role::Sink => files![
            "src/lib.rs": "sink/lib.rs", "tests/live.rs": "sink/live.rs",
            "graphs/my-node.toml": "sink/graph.toml", "README.md": "sink/README.md.txt",
        ],
        Role::Companion => files![
            "src/lib.rs": "companion/lib.rs", "tests/live.rs": "companion/live.rs",
            "graphs/my-node.toml": "companion/graph.toml",
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
    fn a_folder_may_be_called_like_what_is_replaced() {
        let names = Names::of("room-lag").unwrap();
        let words = [
            ("VERSION", "1.2.3".to_owned()),
            ("CORE", "\"/srv/my-node/SERVE/CORE/VERSION\"".to_owned()),
            ("SERVE", "\"/srv/my-node/SERVE\"".to_owned()),
        ];
        let (path, text) = files(&names, Role::Source, &words).swap_remove(0);
        assert_eq!(path, "Cargo.toml");
        for line in [
            "athermal-core = { path = \"/srv/my-node/SERVE/CORE/VERSION\", version = \"1.2.3\" }\n",
            "athermal-serve = { path = \"/srv/my-node/SERVE\", version = \"1.2.3\" }\n",
        ] {
            assert!(text.contains(line), "{text}");
        }
    }

    #[test]
    fn nothing_of_the_template_is_left_over() {
        let names = Names::of("room-lag").unwrap();
        let words = [
            "VERSION",
            "CORE",
            "SERVE",
            "INTERFACE",
            "COMMAND",
            "TRIAL",
            "TESTKIT",
        ]
        .map(|word| (word, "\"/sources\"".to_owned()));
        for role in Role::value_variants() {
            for (path, text) in files(&names, *role, &words) {
                for left in [
                    "my_node",
                    "my-node",
                    "MyNode",
                    "CORE",
                    "SERVE",
                    "INTERFACE",
                    "COMMAND",
                    "TRIAL",
                    "TESTKIT",
                    "VERSION",
                ] {
                    assert!(!path.contains(left), "{left} in {path}");
                    assert!(!text.contains(left), "{left} in {path}:\n{text}");
                }
            }
        }
    }
}
