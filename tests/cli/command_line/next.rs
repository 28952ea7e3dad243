//! Who has fitted or scored is told what to type next, with the names as they were given; programs and the quiet are not.

use crate::workbench::{Scratch, athermal};

#[test]
fn a_fit_leads_to_a_score_and_a_score_to_a_diagnosis() {
    let scratch = Scratch::new("command-line-next");
    let graph = concat!(env!("CARGO_MANIFEST_DIR"), "/graphs/die-tester.toml");
    let (data, model) = (scratch.path("my data.csv"), scratch.path("model.json"));
    athermal(&[&"simulate", &"die-tester", &"--days", &"0.5", &"-o", &data]).ended(0);
    let fit = [
        &"fit" as &dyn AsRef<std::ffi::OsStr>,
        &graph,
        &"--data",
        &data,
        &"-o",
        &model,
    ];
    let (model_name, data_name) = (model.display(), data.display());
    let flat = |told: &str| told.replace(" \\\n      ", " ");
    let told = flat(&athermal(&fit).ended(0).told);
    let next = format!("athermal evaluate {model_name} --data OTHER.csv\n");
    assert!(told.contains("next: ") && told.ends_with(&next), "{told}");
    let evaluate = [
        &"evaluate" as &dyn AsRef<std::ffi::OsStr>,
        &model,
        &"--lenient",
        &"--data",
        &data,
    ];
    let told = flat(&athermal(&evaluate).ended(0).told);
    let next = format!("athermal diagnose {model_name} --lenient --data '{data_name}'\n");
    assert!(told.contains("next: ") && told.ends_with(&next), "{told}");
    for command in [&fit[..], &evaluate] {
        for more in [&["--format", "json"][..], &["--quiet"]] {
            let more = more.iter().map(|word| word as &dyn AsRef<std::ffi::OsStr>);
            let words: Vec<_> = command.iter().copied().chain(more).collect();
            let silent = athermal(&words).ended(0);
            assert!(!silent.told.contains("next:"), "{}", silent.told);
            assert!(!silent.out.contains("next:"), "{}", silent.out);
        }
    }
}

#[test]
fn a_fit_that_predicts_nothing_leads_to_a_run() {
    let scratch = Scratch::new("command-line-next-run");
    let text = "schema = 1\n[signals.position]\nunit = \"nm\"\nchannels = [\"X1\"]\ncolumn = \"{channel}_nm\"\nmax_age = \"3min\"\n\
         [time]\ncolumn = \"time_s\"\n[nodes.drift]\ntype = \"slope\"\ninputs.signal = \"position\"\nwindows = [\"5min\"]\n\
         [outputs]\ndrift = \"drift\"\n";
    let (graph, data) = (scratch.file("plain.toml", text), scratch.path("data.csv"));
    athermal(&[&"simulate", &"die-tester", &"--days", &"0.1", &"-o", &data]).ended(0);
    let model = scratch.path("m.json");
    let fit = athermal(&[&"fit", &graph, &"--data", &data, &"-o", &model]).ended(0);
    let told = fit.told.replace(" \\\n      ", " ");
    let next = format!("athermal run {} --input OTHER.csv\n", model.display());
    assert!(told.ends_with(&next), "{told}");
    assert!(
        !athermal(&[&"evaluate", &model, &"--data", &data])
            .ended(0)
            .told
            .contains("next:")
    );
}

#[test]
fn where_nothing_could_be_scored_the_reason_is_told_and_no_diagnosis() {
    let scratch = Scratch::new("command-line-next-nothing");
    let text = "schema = 1\n[time]\ncolumn = \"s\"\n[signals.in]\nunit = \"V\"\nchannels = [\"u\"]\nmax_age = \"1s\"\n\
         [signals.out]\nunit = \"V\"\nchannels = [\"y\"]\nmax_age = \"1s\"\n[nodes.m]\ntype = \"linear\"\n\
         inputs = { features = \"in\", truth = \"out\" }\nahead = \"0s\"\n[outputs]\nm = \"m\"\n";
    let graph = scratch.file("graph.toml", text);
    let table = |row: &dyn Fn(f64) -> String| {
        let rows: String = (0..50)
            .map(|s| format!("{s},{}\n", row(f64::from(s))))
            .collect();
        format!("s,u,y\n{rows}")
    };
    let train = scratch.file(
        "train.csv",
        table(&|s| format!("{},{}", s.sin(), 2.0 * s.sin())),
    );
    let model = scratch.path("m.json");
    athermal(&[&"fit", &graph, &"--data", &train, &"-o", &model]).ended(0);
    let silent = table(&|s| format!("{s},"));
    let dead = table(&|s| format!(",{s}"));
    let wild = table(&|s| format!("{}e150,{s}", s - 25.0));
    for (data, remark, next) in [
        (silent, "no truth to compare with", false),
        (dead, "no prediction of any truth", false),
        (wild, "worse than no model", true),
    ] {
        let data = scratch.file("data.csv", data);
        let scored = athermal(&[&"evaluate", &model, &"--data", &data]).ended(0);
        assert!(scored.out.contains(remark), "{}", scored.out);
        assert_eq!(scored.told.contains("next:"), next, "{}", scored.told);
        let widest = scored.out.lines().map(|line| line.chars().count()).max();
        assert!(widest.unwrap() < 120, "{}", scored.out);
    }
}

#[test]
fn more_days_are_asked_for_beside_those_of_the_fit_and_not_beside_those_of_the_test() {
    let scratch = Scratch::new("command-line-more-days");
    let graph = concat!(env!("CARGO_MANIFEST_DIR"), "/graphs/die-tester.toml");
    let [train, test] = [("train.csv", "1"), ("test.csv", "2")].map(|(name, seed)| {
        let data = scratch.path(name);
        let of = ["simulate", "die-tester", "--days", "1", "--seed", seed];
        let mut call: Vec<&dyn AsRef<std::ffi::OsStr>> = of.iter().map(|of| of as _).collect();
        call.extend([&"-o" as &dyn AsRef<std::ffi::OsStr>, &data]);
        athermal(&call).ended(0);
        data
    });
    let model = scratch.path("model.json");
    athermal(&[&"fit", &graph, &"--data", &train, &"-o", &model]).ended(0);
    let call: [&dyn AsRef<std::ffi::OsStr>; 6] =
        [&"diagnose", &model, &"--data", &test, &"--day", &"8h"];
    let told = athermal(&call).ended(0).told.replace(" \\\n      ", " ");
    let fit = format!(
        "athermal fit {} --data {} MORE.csv -o better.json",
        model.display(),
        train.display()
    );
    let beside = "More days may still make it better; with another log beside those of the fit:";
    assert!(told.contains(beside), "{told}");
    assert!(told.contains(&fit), "`{fit}` is not in:\n{told}");
}
