//! Decides what a new plugin crate consists of; the texts are files beside this one, in which `my-node`, `my_node` and
//! `MyNode` stand for the name.

use clap::ValueEnum;

/// What a new node is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Role {
    /// Channels from channels: filters, monitors, corrections
    Feature,
    /// A prediction of what will be measured, fitted on history
    Estimator,
    /// One prediction of several
    Combiner,
}

/// The names by which a crate calls its node.
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
        if !begins || !letters.all(goes_on) || name.ends_with(['-', '_']) {
            return None;
        }
        let kind = name.replace('-', "_");
        let words = kind.split('_').filter(|word| !word.is_empty());
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
        let texts = ROLES.map(library);
        let taken = |word: &str| {
            let is = |c: char| c.is_alphanumeric() || c == '_';
            texts
                .iter()
                .any(|text| text.split(|c| !is(c)).any(|known| known == word))
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

const ROLES: [Role; 3] = [Role::Feature, Role::Estimator, Role::Combiner];

/// The words that Rust keeps for itself.
const KEYWORDS: [&str; 51] = [
    "abstract", "as", "async", "await", "become", "box", "break", "const", "continue", "crate",
    "do", "dyn", "else", "enum", "extern", "false", "final", "fn", "for", "gen", "if", "impl",
    "in", "let", "loop", "macro", "match", "mod", "move", "mut", "override", "priv", "pub", "ref",
    "return", "self", "static", "struct", "super", "trait", "true", "try", "type", "typeof",
    "unsafe", "unsized", "use", "virtual", "where", "while", "yield",
];

/// The crates that a new one cannot be called, because it uses them.
const CRATES: [&str; 9] = [
    "athermal",
    "athermal_core",
    "alloc",
    "core",
    "schemars",
    "serde",
    "std",
    "test",
    "typetag",
];

/// The files of a crate: paths in it and what they say. `core` is the folder of the core as it stands in a manifest.
#[must_use]
pub fn files(names: &Names, role: Role, core: &str, version: &str) -> Vec<(String, String)> {
    let cases = match role {
        Role::Feature => {
            r#"Case::new("samples = 5"),
    Case::new("samples = 1").input("signal", 3, "Cel"),"#
        }
        Role::Estimator => {
            r#"Case::new("ahead = '1min'"),
    Case::new("ahead = '0s'\nshrinkage = 0.5").input("features", 1, "Cel"),"#
        }
        Role::Combiner => {
            r#"Case::new(""),
    Case::new("pace = 1.0").input("voters", 5, "nm"),"#
        }
    };
    // What is put in last is not looked through again: a folder may be called anything.
    let manifest = names
        .put_into(include_str!("template/Cargo.toml.txt"))
        .replace("VERSION", version)
        .replace("CORE", core);
    let conformance = include_str!("template/conformance.rs.txt").replace(
        "conformance!(MyNode, CASES);",
        &format!("conformance!(\n    MyNode,\n    {cases}\n);"),
    );
    let graph = match role {
        Role::Feature => include_str!("template/feature/graph.toml"),
        Role::Estimator => include_str!("template/estimator/graph.toml"),
        Role::Combiner => include_str!("template/combiner/graph.toml"),
    };
    let mut files = vec![("Cargo.toml".to_owned(), manifest)];
    let others = [
        (
            "README.md".to_owned(),
            include_str!("template/README.md.txt"),
        ),
        (".gitignore".to_owned(), "/target\n"),
        ("src/lib.rs".to_owned(), library(role)),
        ("tests/conformance.rs".to_owned(), conformance.as_str()),
        (format!("graphs/{}.toml", names.package), graph),
    ];
    files.extend(others.map(|(path, text)| (path, names.put_into(text))));
    files
}

fn library(role: Role) -> &'static str {
    match role {
        Role::Feature => include_str!("template/feature/lib.rs"),
        Role::Estimator => include_str!("template/estimator/lib.rs"),
        Role::Combiner => include_str!("template/combiner/lib.rs"),
    }
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
        for taken in ["feature", "votes", "instant", "type", "errors", "vec-deque"] {
            assert!(Names::of(taken).unwrap().clash(), "{taken}");
        }
        assert!(!Names::of("room-lag").unwrap().clash());
    }

    #[test]
    fn a_folder_may_be_called_like_what_is_replaced() {
        let names = Names::of("room-lag").unwrap();
        let core = "\"/srv/my-node/CORE/VERSION\"";
        let (path, text) = files(&names, Role::Feature, core, "1.2.3").swap_remove(0);
        assert_eq!(path, "Cargo.toml");
        let line = format!("athermal-core = {{ path = {core}, version = \"1.2.3\" }}\n");
        assert!(text.contains(&line), "{text}");
    }

    #[test]
    fn nothing_of_the_template_is_left_over() {
        let names = Names::of("room-lag").unwrap();
        for role in ROLES {
            for (path, text) in files(&names, role, "\"/sources\"", "1.2.3") {
                for left in ["my_node", "my-node", "MyNode", "CORE", "VERSION", "CASES"] {
                    assert!(!text.contains(left), "{left} in {path}:\n{text}");
                }
            }
        }
    }
}
