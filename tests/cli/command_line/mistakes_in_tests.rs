//! What is wrong with the tests of a graph is told beside what is wrong with the graph.

use super::mistakes::{SOUND, assert_told};
use super::{csv, desk, rows};
use crate::workbench::{Scratch, athermal};

#[test]
fn mistakes_in_tests_are_told_together_with_those_of_the_graph() {
    let tests = r#"[nodes.thermal]
type = "zero"
inputs.truth = "drft.X"
ahead = "0s"
[[tests]]
name = "a"
inputs = { "temperature.a" = { ramp = "1 K/s" } }
expects = []
[[tests]]
name = "a"
on = { simulate = "die-testr", days = 1 }
faults = [{ channel = "temperature.a", kind = "stick" }]
expect = [{ of = "thermal", rmse_below = "-1 nm" },
    { of = "thermal" },
    { of = "thermal", within = 0.1 }]
"#;
    let expected = [
        (20, "drft"),
        (24, "needs the key \"every\""),
        (25, "no key \"expects\""),
        (27, "\"a\""),
        (28, "die-testr"),
        (29, "stick"),
        (30, "rmse_below"),
        (31, "the expectation checks nothing"),
        (32, "within"),
    ];
    assert_told("command-line-tests", &(SOUND.to_owned() + tests), &expected);
}

#[test]
fn rivals_that_are_no_nodes_are_known_and_so_are_the_forms_of_a_sample() {
    let test = r#"[[tests]]
name = "a"
inputs = { "temperature.a" = { every = "1s", samples = [["0s", "1 Cel"]] } }
expect = [{ of = "drift", equals = "1 nm/min", within = [1] },
    { of = "drift", beats = ["zeros", "persistance"] }]
"#;
    let scratch = Scratch::new("command-line-rivals");
    let graph = scratch.file("graph.toml", SOUND.to_owned() + test);
    athermal(&[&"check", &graph]).ended(2).tells(&[
        "expected a quantity like \"20 nm\", or nan for no value",
        "found a list",
        "expected a number, or a quantity like \"5 nm\"",
        "did you mean `zero`?",
        "did you mean `persistence`?",
    ]);
}

#[test]
fn a_fit_does_without_the_tests_of_a_graph_and_says_so() {
    let scratch = Scratch::new("command-line-fit-tests");
    let text = SOUND.to_owned()
        + "[nodes.thermal]\ntype = \"linear\"\ninputs.features = \"temperature\"\ninputs.truth = \"drift.X\"\nahead = \"0s\"\n";
    let mut rows = "time_s,a,b,X,Y\n".to_owned();
    for row in 0..200 {
        let t = f64::from(row) * 10.0;
        let (a, b) = ((t / 300.0).sin(), (t / 700.0).cos());
        rows += &format!("{t},{},{},{},{}\n", 20.0 + a, 20.0 + b, 50.0 * a, 70.0 * b);
    }
    let data = scratch.file("data.csv", &rows);
    let fitted = |name: &str, text: &str| {
        let graph = scratch.file(name, text);
        let model = scratch.path("model.json");
        athermal(&[&"fit", &graph, &"--data", &data, &"-o", &model])
            .ended(0)
            .told
    };
    assert!(!fitted("sound.toml", &text).contains("the tests of"));
    let wrong = text + "[[tests]]\nname = \"a\"\nexpcts = []\n";
    let told = fitted("wrong.toml", &wrong);
    assert!(
        told.contains("the tests of")
            && told.contains("2 mistakes")
            && told.contains("athermal check"),
        "{told}"
    );
}

#[test]
fn what_tests_say_of_sound_nodes_is_told_beside_the_mistakes_of_others() {
    let text = SOUND.to_owned()
        + r#"[nodes.thermal]
type = "linear"
inputs.features = "temperatur"
inputs.truth = "drift.X"
ahead = "0s"
[[tests]]
name = "a"
inputs = { "temperature.c" = { constant = "20 Cel", for = "1min", every = "1s" } }
faults = [{ channel = "position.X", kind = "offset", size = "3 K", from = "0s" }]
expect = [{ of = "drift.Z", given_above = 0.5 }, { of = "drift.X", equals = "3 K" },
    { of = "thermal.Q", given_above = 0.5 }, { of = "predicted.Q", given_above = 0.5 },
    { of = "drft", beats = ["thermal", "zer"] }]
"#;
    let expected = [
        (20, "temperatur"),
        (25, "`c`"),
        (26, "K"),
        (27, "`Z`"),
        (27, "K"),
        (29, "drft"),
        (29, "zer"),
    ];
    assert_told("command-line-tests-beside", &text, &expected);
}

#[test]
fn an_inherited_test_of_a_node_that_was_removed_names_the_way_out() {
    let scratch = Scratch::new("command-line-inherited-tests");
    let of_it = "[nodes.old]\ntype = \"zero\"\ninputs.truth = \"drift.X\"\nahead = \"0s\"\n\
                 [[tests]]\nname = \"a\"\ninputs = { \"temperature.a\" = { ramp = \"1 K/s\", for = \"1h\", every = \"10s\" } }\n\
                 expect = [{ of = \"old\", absent = true }]\n";
    let sound = SOUND.replace("thermal", "drift");
    scratch.file("base.toml", sound.clone() + of_it);
    let extending = |own: &str| {
        let text = format!("schema = 1\nextends = \"base.toml\"\n{own}nodes.old = false\n");
        let graph = scratch.file("mine.toml", text);
        athermal(&[&"check", &graph])
    };
    let told = extending("").ended(2).told;
    let told: String = told.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(told.contains("there is no node or signal `old`"), "{told}");
    let file = scratch.path("mine.toml");
    let way_out = format!(
        "`tests = []` in {}, or tests of its own there, take the place of those that it inherits",
        file.display()
    );
    assert!(told.contains(&way_out), "{told}");
    extending("tests = []\n").ended(0);
    // In the file where the test stands, that is no way out.
    let wrong = sound + &of_it.replace("of = \"old\"", "of = \"older\"");
    let own = scratch.file("own.toml", wrong);
    let own = athermal(&[&"check", &own]).ended(2).told;
    assert!(!own.contains("inherits"), "{own}");
}

#[test]
fn files_of_tests_that_overlap_are_told_once_beside_the_results() {
    let (scratch, plain, _, _) = desk("tests-overlap");
    // Seconds since 1970.
    let since = 1_700_000_000;
    scratch.file("one.csv", csv(&rows(since, 60)));
    scratch.file("two.csv", csv(&rows(since + 400, 60)));
    let of = |name: &str, on: &str| {
        format!(
            "[[tests]]\nname = \"{name}\"\nfit = [\"one.csv\", \"two.csv\"]\non = {on}\n\
             expect = [{{ of = \"drift.Z\", given_above = 0.1 }}]\n"
        )
    };
    let tests = of("a", "\"two.csv\"") + &of("b", "[\"two.csv\", \"two.csv\"]");
    let text = std::fs::read_to_string(&plain).unwrap() + &tests;
    let graph = scratch.file("tested.toml", text);
    let tested = athermal(&[&"test", &graph]).ended(0);
    let told = tested.told.split_whitespace().collect::<Vec<_>>().join(" ");
    let overlaps = "20 of its 60 rows lie in the period of";
    assert_eq!(told.matches(overlaps).count(), 1, "{told}");
    assert!(
        told.contains("two.csv: this file is given more than once"),
        "{told}"
    );
    let json = athermal(&[&"test", &graph, &"--format", &"json"])
        .ended(0)
        .json();
    let warnings = json["tests"][0]["warnings"].as_array().unwrap();
    assert!(warnings[0].as_str().unwrap().contains(overlaps), "{json}");
}
