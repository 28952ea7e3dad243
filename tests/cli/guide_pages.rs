//! README and guide: how long they may be, that each link leads somewhere, and that each page is reached. What their commands print is
//! compared by `.ci/readme`, and what the program knows of itself by `.ci/reference`.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use crate::workbench::{Scratch, athermal};

const LONGEST_README: usize = 250;
const LONGEST_SENTENCE: usize = 30;
/// Written by `.ci/reference` and by tests, from what the code says of itself: `athermal nodes KIND` and `athermal explain CODE` print
/// the cells of their tables too, so that no sentence there is long either.
const MADE: [&str; 5] = [
    "kinds-features.md",
    "kinds-estimators.md",
    "kinds-combiners.md",
    "kinds-sources-and-sinks.md",
    "codes.md",
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The pages of the guide, and the README.
fn pages() -> BTreeMap<PathBuf, String> {
    let guide = fs::read_dir(root().join("docs/src")).unwrap();
    let files = guide.map(|file| file.unwrap().path());
    let pages = files.filter(|path| path.extension().is_some_and(|kind| kind == "md"));
    let all = pages.chain([
        root().join("README.md"),
        root().join("examples/logs/README.md"),
    ]);
    all.map(|path| (path.clone(), fs::read_to_string(path).unwrap()))
        .collect()
}

/// A text without what stands in code.
fn without_code(text: &str) -> String {
    text.split('`').step_by(2).collect::<Vec<_>>().join("X")
}

/// Paragraphs and items of lists, without blocks of code, tables, headings and pictures.
fn paragraphs(page: &str) -> Vec<String> {
    let (mut all, mut is_code) = (vec![String::new()], false);
    for line in page.lines().map(str::trim) {
        let begins = |with: &[&str]| with.iter().any(|of| line.starts_with(of));
        if line.starts_with("```") {
            is_code = !is_code;
        }
        if is_code || line.is_empty() || begins(&["```", "#", "|", "!["]) {
            all.push(String::new());
            continue;
        }
        let number = line.trim_start_matches(|c: char| c.is_ascii_digit());
        if begins(&["- ", "* ", "> "]) || number.len() < line.len() && number.starts_with(". ") {
            all.push(String::new());
        }
        let last = all.last_mut().unwrap();
        last.push(' ');
        last.push_str(line);
    }
    all
}

/// Sentences that are too long, with their numbers of words.
fn too_long(paragraph: &str) -> Vec<(usize, String)> {
    let text = without_code(paragraph);
    let mut sentences = vec![String::new()];
    for word in text.split_whitespace() {
        let last = sentences.last_mut().unwrap();
        last.push_str(word);
        last.push(' ');
        let bare = word.trim_end_matches(['"', '”', ')', '*', '_']);
        if bare.ends_with(['.', '!', '?']) {
            sentences.push(String::new());
        }
    }
    let words = |of: &String| {
        let words = of.split_whitespace();
        words
            .filter(|word| word.contains(char::is_alphanumeric))
            .count()
    };
    let long = sentences.into_iter().map(|of| (words(&of), of));
    long.filter(|(count, _)| *count > LONGEST_SENTENCE)
        .collect()
}

#[test]
fn the_readme_is_short() {
    let lines = fs::read_to_string(root().join("README.md"))
        .unwrap()
        .lines()
        .count();
    assert!(lines <= LONGEST_README, "{lines} lines");
}

#[test]
fn no_sentence_of_readme_guide_or_help_is_long() {
    let mut found = Vec::new();
    for (path, page) in pages() {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if name == "commands.md" {
            continue;
        }
        let mut texts = paragraphs(&page);
        if MADE.contains(&&*name) {
            let rows = page.lines().filter(|line| line.starts_with('|'));
            texts.extend(rows.flat_map(|row| row.split(" | ").map(str::to_owned)));
        }
        let long = texts.iter().flat_map(|of| too_long(of));
        found.extend(long.map(|(count, sentence)| format!("{name}: {count} words: {sentence}")));
    }
    // Of help its paragraphs and what it says of each option and value; names, lists of commands and examples are none.
    let help = fs::read_to_string(root().join("docs/src/commands.md")).unwrap();
    for block in help.split("```text\n").skip(1) {
        let block = block.split("```").next().unwrap();
        let block = block.split("\nExample").next().unwrap();
        let is_list = |line: &str| {
            let heads = ["-", "Usage:", "Commands:", "[", "Possible"];
            let line = line.strip_prefix("- ").unwrap_or(line);
            heads.iter().any(|head| line.starts_with(head)) || line.contains("   ")
        };
        let mut paragraphs = vec![String::new()];
        for line in block.lines().map(str::trim) {
            if line.starts_with("- ") {
                paragraphs.push(String::new());
            }
            match paragraphs.last_mut() {
                Some(last) if !line.is_empty() && !is_list(line) => {
                    last.push(' ');
                    last.push_str(line);
                }
                _ => paragraphs.push(String::new()),
            }
        }
        let long = paragraphs.iter().flat_map(|of| too_long(of));
        found.extend(long.map(|of| format!("help: {of:?}")));
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn a_task_is_one_screen_of_text() {
    for (path, page) in pages() {
        let name = path.file_name().unwrap().to_string_lossy();
        let text = page.split("```").step_by(2);
        let words: usize = text.map(|of| of.split_whitespace().count()).sum();
        assert!(
            !name.starts_with("how-") || words <= 450,
            "{name}: {words} words"
        );
    }
}

/// The place of a heading, as books and GitHub write it.
fn place(heading: &str) -> String {
    let heading = heading.trim_start_matches('#').trim().to_lowercase();
    let kept = heading
        .chars()
        .filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.collect::<String>().replace(' ', "-")
}

fn places(page: &str) -> BTreeSet<String> {
    let mut is_code = false;
    let headings = page.lines().filter(|line| {
        is_code ^= line.starts_with("```");
        !is_code && line.starts_with('#')
    });
    headings.map(place).collect()
}

/// Where the links and pictures of a page lead, without those to other sites.
fn targets(page: &str) -> Vec<String> {
    let mut is_code = false;
    let lines = page.lines().filter(|line| {
        is_code ^= line.trim_start().starts_with("```");
        !is_code
    });
    let text = lines.collect::<Vec<_>>().join("\n");
    // `[text](target)`, in which the text may be code.
    let links = text
        .split("](")
        .skip(1)
        .filter_map(|of| of.split(')').next());
    let inner = links.filter(|of| !of.contains("://") && !of.contains(char::is_whitespace));
    inner.map(str::to_owned).collect()
}

#[test]
fn every_link_leads_somewhere_and_every_page_has_one() {
    let pages = pages();
    let (mut dead, mut linked) = (Vec::new(), BTreeSet::new());
    for (path, page) in &pages {
        for target in targets(page) {
            let (file, anchor) = target.split_once('#').unwrap_or((&target, ""));
            let to = match file {
                "" => path.clone(),
                file => path.parent().unwrap().join(file),
            };
            let there = to.canonicalize();
            let (from, is_there) = (path.display(), there.is_ok());
            let text = there.ok().and_then(|to| {
                if path.file_name().unwrap() != "SUMMARY.md" && to != *path {
                    linked.insert(to.clone());
                }
                fs::read_to_string(to).ok()
            });
            if !is_there
                || !anchor.is_empty() && !places(&text.unwrap_or_default()).contains(anchor)
            {
                dead.push(format!("{from}: {target}"));
            }
        }
    }
    assert!(dead.is_empty(), "{}", dead.join("\n"));
    let summary = fs::read_to_string(root().join("docs/src/SUMMARY.md")).unwrap();
    for path in pages
        .keys()
        .filter(|path| path.starts_with(root().join("docs")))
    {
        let name = path.file_name().unwrap().to_string_lossy();
        if name != "SUMMARY.md" {
            assert!(
                summary.contains(&format!("({name})")),
                "SUMMARY.md lacks {name}"
            );
            let path = path.canonicalize().unwrap();
            assert!(
                name == "index.md" || linked.contains(&path),
                "no page links to {name}"
            );
        }
    }
}

#[test]
fn every_kind_and_command_has_its_place_in_the_reference_and_none_is_there_that_the_program_lacks()
{
    let read = |page: &str| fs::read_to_string(root().join("docs/src").join(page)).unwrap();
    let headings = |page: &str| -> BTreeSet<String> {
        let page = read(page);
        let headings = page.lines().filter_map(|line| line.strip_prefix("## "));
        headings
            .map(|of| of.split(',').next().unwrap().to_owned())
            .collect()
    };
    let facts = athermal(&[&"nodes", &"--format", &"json"]).ended(0).json();
    let names = |list: &str, role: Option<&str>| -> BTreeSet<String> {
        let kinds = facts[list].as_array().unwrap().iter();
        let kinds = kinds.filter(|of| role.is_none_or(|role| of["role"] == role));
        kinds
            .map(|of| of["name"].as_str().unwrap().to_owned())
            .collect()
    };
    for role in ["feature", "estimator", "combiner"] {
        assert_eq!(
            headings(&format!("kinds-{role}s.md")),
            names("nodes", Some(role))
        );
    }
    // What features bring has its place there beside it: the whole pages are compared by `.ci/reference`, with all features.
    let of_features = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    let connectors = read("kinds-sources-and-sinks.md");
    for (list, role, brought) in [
        ("sources", ", a source", &["opcua", "sparkplug"][..]),
        (
            "sinks",
            ", a sink",
            &["influx", "opcua", "parquet", "postgres", "sparkplug"][..],
        ),
    ] {
        let headings = connectors
            .lines()
            .filter_map(|line| line.strip_prefix("## "));
        let there = headings.filter_map(|line| Some(line.strip_suffix(role)?.to_owned()));
        let brought: BTreeSet<String> = of_features(brought);
        assert_eq!(
            there.collect::<BTreeSet<_>>(),
            &names(list, None) | &brought
        );
    }
    let help = athermal(&[&"--help"]).ended(0).out;
    let commands = help.lines().filter_map(|line| line.strip_prefix("  "));
    let commands = commands.take_while(|line| !line.starts_with("    --"));
    let commands = commands.filter(|line| line.starts_with(|c: char| c.is_ascii_lowercase()));
    let commands = commands.map(|line| line.split_whitespace().next().unwrap().to_owned());
    let commands: BTreeSet<String> = commands.collect();
    let brought: BTreeSet<String> = of_features(&["top", "trust"]);
    assert_eq!(headings("commands.md"), &commands | &brought);
}

#[test]
fn each_kind_has_its_equation_its_parameters_an_example_and_a_picture() {
    for role in ["features", "estimators", "combiners"] {
        let page = fs::read_to_string(root().join(format!("docs/src/kinds-{role}.md"))).unwrap();
        for kind in page.split("\n## ").skip(1) {
            let name = kind.lines().next().unwrap();
            let (words, rest) = kind.split_once("```toml").unwrap();
            let mut formulas = words.split('`').skip(1).step_by(2);
            let is_equation = |of: &str| {
                of.contains([' ', '/'])
                    && of.contains(['=', '←', '<', '>', '∫', 'Σ', '±'])
                    && !of.contains('"')
            };
            assert!(formulas.any(is_equation), "{name}: an equation");
            assert!(rest.contains(&format!("type = \"{name}\"")), "{name}");
            assert!(rest.contains("| key or port | what it is |"), "{name}");
            assert!(rest.contains(&format!("(kinds/{name}.svg)")), "{name}");
        }
    }
}

#[test]
fn init_prints_commands_that_run_as_they_stand() {
    let scratch = Scratch::new("guide-init");
    let log = root().join("examples/logs/plc/export.csv");
    fs::copy(log, scratch.path("my log.csv")).unwrap();
    let graph = scratch.path("my graph.toml");
    let data = scratch.path("my log.csv");
    let told = athermal(&[&"init", &data, &"-o", &graph]).ended(0).told;
    for expected in [
        "`now`, the drift of the last 5min",
        "`result` is what goes out",
        "edit its line",
        "last fifth",
    ] {
        assert!(
            told.replace("\n  ", " ").contains(expected),
            "{expected}: {told}"
        );
    }
    let commands = told[told.find("\n  /").unwrap()..].trim_start_matches('\n');
    let commands = commands.replace(" \\\n     ", "");
    assert_eq!(commands.lines().count(), 4, "{commands}");
    let cut: BTreeSet<&str> = commands
        .split("--")
        .filter_map(|of| of.strip_prefix("to ").or(of.strip_prefix("from ")))
        .collect();
    assert_eq!(cut, BTreeSet::from(["'04.03.2026 05:00:00' "]));
    let mut scores = String::new();
    for command in commands.lines() {
        let mut shell = std::process::Command::new("sh");
        let shell = shell.args(["-c", command]).current_dir(scratch.path(""));
        let run = shell.output().unwrap();
        let told = String::from_utf8_lossy(&run.stderr);
        assert!(run.status.success(), "{command}: {told}");
        if command.contains(" evaluate ") {
            scores = String::from_utf8(run.stdout).unwrap();
        }
    }
    let page = fs::read_to_string(scratch.path("report.html")).unwrap();
    for expected in [
        "2026-03-04 05:00 to 2026-03-04 17:59 UTC",
        "left of ",
        "Sensors: all 4 are in order",
        "predictions beside these",
    ] {
        assert!(page.contains(expected), "{expected}");
    }
    // Report and evaluate give what goes out the same score.
    let mut compared = 0;
    for row in scores.lines().filter(|row| row.contains("/result.")) {
        let cells: Vec<&str> = row.split_whitespace().collect();
        let Ok(rmse) = cells[2].parse::<f64>() else {
            continue;
        };
        let digits = if rmse < 9.995 { 2 } else { 1 };
        let begin = format!(
            "<td>{}</td><td>nm/min</td><td>{rmse:.digits$}</td>",
            cells[0]
        );
        let found = page.split("<tr>").find(|of| of.starts_with(&begin));
        let found = found.unwrap_or_else(|| panic!("{begin}: {page}"));
        assert!(found.contains(&format!("<td>{}</td>", cells[3])), "{row}");
        compared += 1;
    }
    assert_eq!(compared, 2, "{scores}");
    let browser = scratch.file("browser", "#!/bin/sh\nmv \"$1\" opened.html\n");
    let words = [
        "report",
        "model.json",
        "--data",
        "my log.csv",
        "--from",
        "2026-03-04 12:00:00",
        "--open",
    ];
    let mut opens = std::process::Command::new(env!("CARGO_BIN_EXE_athermal"));
    let opens = opens.args(words).current_dir(scratch.path(""));
    let refused = opens.env("BROWSER", "/no such browser").output().unwrap();
    let told = String::from_utf8_lossy(&refused.stderr);
    assert!(told.contains("no browser opens "), "{told}");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        fs::set_permissions(&browser, fs::Permissions::from_mode(0o755)).unwrap();
        let opened = opens.env("BROWSER", &browser).output().unwrap();
        assert!(opened.status.success());
        let page = scratch.path("opened.html");
        for _ in 0..100 {
            if page.exists() {
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(50));
        }
        assert!(fs::read_to_string(page).unwrap().contains("</html>"));
    }
}
