use super::*;

#[derive(Debug, Clone)]
struct Colour {
    name: &'static str,
    severity: Severity,
}

impl Problem for Colour {
    fn code(&self) -> &'static Code {
        const fn colour(severity: Severity) -> Code {
            Code {
                code: "A009",
                severity,
                title: "",
                explanation: "",
                wrong: "",
                right: "",
            }
        }
        const ERROR: Code = colour(Severity::Error);
        const WARNING: Code = colour(Severity::Warning);
        match self.severity {
            Severity::Error => &ERROR,
            Severity::Warning => &WARNING,
        }
    }
    fn message(&self) -> String {
        format!("\"{}\" is no colour", self.name)
    }
    fn label(&self) -> String {
        "not a colour".to_owned()
    }
    fn help(&self) -> Option<String> {
        Some("did you mean \"red\"?".to_owned())
    }
}

const RAD: Colour = Colour {
    name: "rad",
    severity: Severity::Error,
};
const BLEU: Colour = Colour {
    name: "bleu",
    severity: Severity::Warning,
};

fn two_files() -> (Sources, Place, Place) {
    let mut sources = Sources::new();
    let first = sources.add("a.toml", "x = 1\ncolour = \"rad\"\n");
    let second = sources.add("b.toml", "colour = \"bleu\"\n");
    (
        sources,
        Place::new(first, 15, 20),
        Place::new(second, 9, 15),
    )
}

#[test]
fn members_with_the_same_mistake_are_counted_and_not_repeated() {
    let (sources, place, _) = two_files();
    let mut diagnostics = Diagnostics::new();
    for member in ["X1", "Y1", "Y1", "Z1"] {
        diagnostics.report_in(
            format!("in node \"thermal\", member \"{member}\""),
            place,
            RAD,
        );
    }
    assert_eq!(diagnostics.error_count(), 1);
    assert_eq!(
        diagnostics.render(&sources, false, 80),
        r#"error[A009]: "rad" is no colour
 --> a.toml:2:10
  |
2 | colour = "rad"
  |          ^^^^^ not a colour
  |
  = note: in node "thermal", member "X1", and 2 more members
  = help: did you mean "red"?
"#
    );
}

#[test]
fn diagnostics_are_sorted_by_file_and_position() {
    let (sources, first, second) = two_files();
    let mut diagnostics = Diagnostics::new();
    diagnostics.report(second, BLEU);
    diagnostics.report(first, RAD);
    assert!(diagnostics.has_errors());
    assert_eq!(
        (
            diagnostics.error_count(),
            diagnostics.warning_count(),
            diagnostics.len()
        ),
        (1, 1, 2)
    );
    assert_eq!(
        diagnostics.to_json(&sources),
        serde_json::json!({ "diagnostics": [
            { "code": "A009", "severity": "error", "file": "a.toml", "line": 2, "column": 10, "span": [15, 20],
              "message": "\"rad\" is no colour", "help": "did you mean \"red\"?" },
            { "code": "A009", "severity": "warning", "file": "b.toml", "line": 1, "column": 10, "span": [9, 15],
              "message": "\"bleu\" is no colour", "help": "did you mean \"red\"?" },
        ] })
    );
}

#[test]
fn a_scope_gives_its_context_to_what_is_reported_inside() {
    let (sources, first, second) = two_files();
    let mut diagnostics = Diagnostics::new();
    diagnostics.within("in node \"n\"", |diagnostics| {
        diagnostics.report(first, RAD)
    });
    diagnostics.report(second, BLEU);
    let contexts: Vec<Option<String>> =
        diagnostics.iter().map(Diagnostic::context_phrase).collect();
    assert_eq!(contexts, [Some("in node \"n\"".to_owned()), None]);
    let json = diagnostics.to_json(&sources);
    assert_eq!(
        json["diagnostics"][0]["message"],
        "\"rad\" is no colour (in node \"n\")"
    );
}

#[test]
fn warnings_alone_are_no_errors_and_colour_is_only_colour() {
    let (sources, _, second) = two_files();
    let mut diagnostics = Diagnostics::new();
    diagnostics.report(second, BLEU);
    assert!(!diagnostics.has_errors());
    let plain = diagnostics.render(&sources, false, 80);
    assert!(
        plain.starts_with("warning[A009]: \"bleu\" is no colour\n --> b.toml:1:10\n"),
        "{plain}"
    );
    let coloured = diagnostics.render(&sources, true, 80);
    assert!(coloured.contains("\u{1b}["));
    assert_eq!(Diagnostics::new().render(&sources, false, 80), "");
}
