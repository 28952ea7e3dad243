//! A run that goes on where the one before ended, as a user restarts it. Decides nothing about what a node keeps.

use std::path::{Path, PathBuf};

use crate::workbench::{Graph, Scratch, athermal, athermal_fed, athermal_on, simulated};

/// Two axes of a machine, each by a model that goes on learning.
fn learning() -> Graph {
    Graph::named("learning")
        .section("sets", "axis = ['X', 'Y']")
        .time("time_s")
        .signal("temperature", "Cel", "t1 t2", "1min")
        .with("column = '{channel}_degC'")
        .section("signals.position", "unit = 'nm'; channels = 'axis'")
        .with("column = '{channel}_nm'; max_age = '3min'")
        .slope("drift", "position", "5min", "nm/min")
        .slope("gradients", "temperature", "5min 15min", "mK/min")
        .model("model", "rls", "gradients", "drift.{axis}", "5min")
        .with("each = 'axis'; memory = '6h'; learn = true")
        .vote("vote", "auto_weighted", "['model.{axis}']", "drift.{axis}")
        .with("each = 'axis'; memory = '15min'")
        .outputs("predicted = 'vote'")
}

/// A folder with half a day of a machine, a model that was fitted on half of another, and what a run in one piece gives.
fn desk(test: &str) -> (Scratch, PathBuf, PathBuf, String) {
    let scratch = Scratch::new(&format!("kept-runs-{test}"));
    let graph = scratch.file("graph.toml", learning());
    let history = simulated(&scratch, "history.csv", "linear-axis", 0.5, 1);
    let data = simulated(&scratch, "data.csv", "linear-axis", 0.5, 2);
    let model = scratch.path("model.json");
    athermal_on("fit", &graph, &history, &[&"-o", &model]).ended(0);
    let whole = athermal(&[&"run", &model, &"-i", &data]).ended(0).out;
    (scratch, model, data, whole)
}

#[test]
fn a_run_that_is_restarted_gives_what_one_in_one_piece_does_and_needs_its_state_for_that() {
    let (scratch, model, data, whole) = desk("restarted");
    let text = std::fs::read_to_string(&data).unwrap();
    let lines: Vec<_> = text.lines().collect();
    let half = lines[..2000].join("\n") + "\n";
    let state = scratch.path("state");

    let before = athermal_fed(
        &[&"run", &model, &"-i", &"-", &"--state", &state],
        half.as_bytes(),
    );
    before.tells(&["not there yet, the run begins cold"]);
    let before = before.ended(0).out;
    let after = athermal(&[&"run", &model, &"-i", &data, &"--state", &state]);
    after.tells(&["was seen by the run before"]);
    let after = after.ended(0).out;
    let rows = |text: &str| text.split_once('\n').unwrap().1.to_owned();
    assert_eq!(before.clone() + &rows(&after), whole);

    // A source that gives only what is new is as good.
    let new = [&lines[..1], &lines[2000..]].concat().join("\n") + "\n";
    let cold = athermal_fed(&[&"run", &model, &"-i", &"-"], new.as_bytes());
    assert_ne!(before + &rows(&cold.ended(0).out), whole);
    let again = scratch.path("again");
    let arguments: [&dyn AsRef<std::ffi::OsStr>; 6] =
        [&"run", &model, &"-i", &"-", &"--state", &again];
    let before = athermal_fed(&arguments, half.as_bytes()).ended(0).out;
    let after = athermal_fed(&arguments, new.as_bytes()).ended(0);
    assert!(!after.told.contains("seen"), "{}", after.told);
    assert_eq!(before + &rows(&after.out), whole);
}

/// What lies in `upgraded` was written by a program whose slopes, rows and errors lay otherwise in memory, in a log with gaps.
#[test]
fn a_run_goes_on_warm_from_a_state_that_an_older_program_wrote() {
    let scratch = Scratch::new("kept-runs-upgraded");
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cli/upgraded");
    let of = |name: &str| folder.join(name);
    let state = scratch.path("state");
    std::fs::copy(of("state"), &state).unwrap();
    let (model, rows) = (of("model.json"), of("rows.csv"));
    let after = athermal(&[&"run", &model, &"-i", &rows, &"--state", &state]).ended(0);
    let given = std::fs::read_to_string(of("outputs.csv")).unwrap();
    assert_eq!(after.out, given);
    let cold = athermal(&[&"run", &model, &"-i", &rows]).ended(0);
    assert_ne!(cold.out, given);
}

#[test]
fn a_run_leaves_out_at_the_end_of_its_input_what_only_more_of_it_would_confirm_and_the_next_reads_it()
 {
    let (scratch, model, data, whole) = desk("confirmed");
    let text = std::fs::read_to_string(&data).unwrap();
    let lines: Vec<_> = text.lines().collect();
    let half = lines[..2000].join("\n") + "\n";
    let last = lines[2000];
    for (test, begun, told) in [
        (
            "cut",
            last[..last.len() - 1].to_owned(),
            "the last line has no end and was left out",
        ),
        (
            "ahead",
            format!("9999{last}\n"),
            "no row follows that decides between a gap and a wrong time; the row was left out",
        ),
    ] {
        let state = scratch.path(test);
        let growing = scratch.file("growing.csv", format!("{half}{begun}"));
        let run = |data| athermal(&[&"run", &model, &"-i", data, &"--state", &state]).ended(0);
        let before = run(&growing);
        before.tells(&[told]);
        let after = run(&data);
        let rows = after.out.split_once('\n').unwrap().1;
        assert_eq!(before.out + rows, whole, "{test}");
    }
}

#[test]
fn a_watched_run_that_is_restarted_goes_on_too() {
    let (scratch, model, data, _) = desk("watched");
    let text = std::fs::read_to_string(&data).unwrap();
    let half = text.lines().take(2000).collect::<Vec<_>>().join("\n") + "\n";
    let state = scratch.path("state");
    let watched = |rows: &str, state: Option<&PathBuf>| {
        let mut arguments: Vec<&dyn AsRef<std::ffi::OsStr>> =
            vec![&"run", &model, &"-i", &"-", &"--watch"];
        if let Some(state) = state {
            arguments.extend([&"--state" as &dyn AsRef<std::ffi::OsStr>, state]);
        }
        athermal_fed(&arguments, rows.as_bytes()).ended(0).out
    };
    let before = watched(&half, Some(&state));
    let after = watched(&text, Some(&state));
    assert_eq!(
        before + after.split_once('\n').unwrap().1,
        watched(&text, None)
    );
}

#[test]
fn a_log_that_names_its_columns_again_in_another_order_gives_the_same_run_in_one_piece_and_restarted()
 {
    let (scratch, model, data, whole) = desk("again");
    let text = std::fs::read_to_string(&data).unwrap();
    let turned = |line: &str| line.rsplit(',').collect::<Vec<_>>().join(",");
    let (names, rows) = text.split_once('\n').unwrap();
    let rows: Vec<_> = rows.lines().collect();
    let before = format!("{names}\n{}\n{}\n", rows[..1000].join("\n"), turned(names));
    let after: String = rows[1000..].iter().map(|row| turned(row) + "\n").collect();
    let all = before.clone() + &after;
    let run = |log: &str, more: &[&str]| {
        let mut arguments: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"run", &model, &"-i", &"-"];
        arguments.extend(more.iter().map(|more| more as &dyn AsRef<std::ffi::OsStr>));
        athermal_fed(&arguments, log.as_bytes()).ended(0)
    };
    for more in [&[][..], &["--lenient"]] {
        let ran = run(&all, more);
        ran.tells(&[
            "standard input:1002: the names of the columns stand here again, in other places",
        ]);
        assert!(ran.out == whole);
    }
    let state = scratch.path("state").display().to_string();
    let first = run(&before, &["--state", &state]).out;
    let second = run(&all, &["--state", &state]).out;
    assert!(first + second.split_once('\n').unwrap().1 == whole);
}

/// As a service manager restarts it: the same command again, after a kill that cut the last row in two.
#[test]
fn a_run_that_is_restarted_goes_on_with_its_output_as_it_was_left() {
    let (scratch, model, data, whole) = desk("same-output");
    let text = std::fs::read_to_string(&data).unwrap();
    let lines: Vec<_> = text.lines().collect();
    let state = scratch.path("state");
    for (name, whole) in [
        ("out.csv", whole),
        ("out.jsonl", {
            let out = scratch.path("whole.jsonl");
            athermal(&[&"run", &model, &"-i", &data, &"-o", &out]).ended(0);
            std::fs::read_to_string(out).unwrap()
        }),
    ] {
        let out = scratch.path(name);
        let run = |rows: usize| {
            let arguments: [&dyn AsRef<std::ffi::OsStr>; 8] =
                [&"run", &model, &"-i", &"-", &"-o", &out, &"--state", &state];
            athermal_fed(&arguments, (lines[..rows].join("\n") + "\n").as_bytes()).ended(0)
        };
        run(2000);
        let kept = std::fs::read(&state).unwrap();
        run(3000);
        std::fs::write(&state, kept).unwrap();
        let put_out = std::fs::read_to_string(&out).unwrap();
        std::fs::write(&out, &put_out[..put_out.len() - 5]).unwrap();
        run(lines.len());
        assert!(std::fs::read_to_string(&out).unwrap() == whole, "{name}");
        std::fs::write(&out, &put_out[..put_out.len() / 2]).unwrap();
        run(lines.len()).tells(&["its last row is", "is lost"]);
        std::fs::remove_file(&state).unwrap();
    }
}

/// The state is gone, damaged, or from before the first row; a controller gives only what is new.
#[test]
fn a_run_that_begins_cold_goes_on_with_its_output_too_and_loses_no_row_of_it() {
    let (scratch, model, data, whole) = desk("cold-output");
    let text = std::fs::read_to_string(&data).unwrap();
    let lines: Vec<_> = text.lines().collect();
    let (state, out) = (scratch.path("state"), scratch.path("out.csv"));
    let arguments: [&dyn AsRef<std::ffi::OsStr>; 8] =
        [&"run", &model, &"-i", &"-", &"-o", &out, &"--state", &state];
    let run =
        |rows: &[&str]| athermal_fed(&arguments, (rows.join("\n") + "\n").as_bytes()).ended(0);
    run(&lines[..2001]);
    let before = std::fs::read_to_string(&out).unwrap();
    std::fs::remove_file(&state).unwrap();
    let told = run(&[&lines[..1], &lines[2001..2101]].concat());
    told.tells(&[
        "out.csv: rows of a run before stand there and stay, though this one begins cold",
        "of 19990 s, is written again",
    ]);
    let after = std::fs::read_to_string(&out).unwrap();
    assert!(after.starts_with(&before), "what stood there stays");
    assert_eq!(after.lines().count(), 2101);

    // Rows that stand there are stepped, so that those behind them are as in one piece.
    std::fs::write(&out, &before).unwrap();
    std::fs::remove_file(&state).unwrap();
    run(&lines);
    assert!(std::fs::read_to_string(&out).unwrap() == whole);
}

#[test]
fn an_output_that_no_run_like_it_wrote_is_left_as_it_is() {
    let (scratch, model, data, _) = desk("other-output");
    let state = scratch.path("state");
    athermal(&[&"run", &model, &"-i", &data, &"--state", &state]).ended(0);
    for (name, content, why) in [
        (
            "columns.csv",
            "time_s,other\n0,1\n",
            "its columns are `time_s`, `other` and not `time_s`, `predicted.X`",
        ),
        (
            "time.csv",
            "time_s,predicted.X,predicted.Y\nnever,1,2\n",
            "wrote it: its last line: column `time_s`: expected a decimal number, found `never`",
        ),
        (
            "text.jsonl",
            "once\n",
            "wrote it: its last line: it is no JSON object",
        ),
        ("line.csv", "a note of mine", "it has no whole line"),
        (
            "keys.jsonl",
            "{\"time_s\":0,\"predicted.X\":1}\n",
            "its columns are `time_s`, `predicted.X` and not",
        ),
    ] {
        let out = scratch.file(name, content);
        let run = athermal(&[
            &"run", &model, &"-i", &data, &"-o", &out, &"--state", &state,
        ]);
        run.ended(2)
            .tells(&[name, why, "name another file, or move this one away"]);
        assert_eq!(std::fs::read_to_string(&out).unwrap(), content);
    }
}

#[cfg(unix)]
#[test]
fn what_is_read_from_a_pipe_by_name_is_put_out_at_once() {
    use std::io::Write;

    let (scratch, model, data, _) = desk("pipe");
    let (pipe, out) = (scratch.path("pipe"), scratch.path("out.csv"));
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    assert!(made.unwrap().success());
    let text = std::fs::read_to_string(&data).unwrap();
    let rows = text.lines().take(100).collect::<Vec<_>>().join("\n") + "\n";
    std::thread::scope(|threads| {
        let run = threads.spawn(|| athermal(&[&"run", &model, &"-i", &pipe, &"-o", &out]).ended(0));
        let mut feed = std::fs::File::options().write(true).open(&pipe).unwrap();
        feed.write_all(rows.as_bytes()).unwrap();
        let put_out = || std::fs::read_to_string(&out).map_or(0, |text| text.lines().count());
        let begun = std::time::Instant::now();
        while put_out() < 100 && begun.elapsed().as_secs() < 60 {
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
        assert_eq!(put_out(), 100, "while the pipe is still open");
        drop(feed);
        run.join().unwrap();
    });
}

#[test]
fn what_was_rejected_in_a_run_is_not_told_again_by_the_next() {
    let (scratch, model, data, _) = desk("rejected");
    let text = std::fs::read_to_string(&data).unwrap();
    let mut lines: Vec<_> = text.lines().take(40).map(str::to_owned).collect();
    let column = lines[0].split(',').position(|name| name == "t1_degC");
    let mut cells: Vec<_> = lines[5].split(',').collect();
    cells[column.unwrap()] = "1e400";
    lines[5] = cells.join(",");
    let state = scratch.path("state");
    let run = |lines: &[String]| {
        let arguments: [&dyn AsRef<std::ffi::OsStr>; 7] = [
            &"run",
            &model,
            &"-i",
            &"-",
            &"--lenient",
            &"--state",
            &state,
        ];
        athermal_fed(&arguments, (lines.join("\n") + "\n").as_bytes())
            .ended(0)
            .told
    };
    let first = run(&lines[..20]);
    assert!(first.contains("1 sample is infinite"), "{first}");
    let second = run(&[&lines[..1], &lines[20..]].concat());
    assert!(!second.contains("sample"), "{second}");
}

#[test]
fn a_state_of_another_fit_is_refused_and_stays_as_it_is() {
    let (scratch, model, data, _) = desk("other-fit");
    let state = scratch.path("state");
    athermal(&[&"run", &model, &"-i", &data, &"--state", &state]).ended(0);
    let kept = std::fs::read(&state).unwrap();
    let other = scratch.path("other.json");
    let graph = scratch.path("graph.toml");
    athermal_on("fit", &graph, &data, &[&"-o", &other]).ended(0);
    let run = athermal(&[&"run", &other, &"-i", &data, &"--state", &state]).ended(2);
    run.tells(&[
        "cannot go on from",
        "belongs to revision",
        "name another file",
    ]);
    assert_eq!(run.out, "");
    assert_eq!(std::fs::read(&state).unwrap(), kept);

    let half = scratch.file("half", &kept[..kept.len() / 2]);
    let run = athermal(&[&"run", &model, &"-i", &data, &"--state", &half]).ended(2);
    run.tells(&["damaged"]);
}

#[test]
fn a_state_that_cannot_be_written_is_told_before_the_first_row() {
    let (scratch, model, data, _) = desk("unwritable");
    let state = scratch.path("nowhere/state");
    let run = athermal(&[&"run", &model, &"-i", &data, &"--state", &state]).ended(3);
    run.tells(&["cannot write", "nowhere"]);
    assert_eq!(run.out, "");
}

/// As on a disk that is full, or where it may be read alone.
#[test]
fn a_state_that_was_read_and_cannot_be_written_for_a_while_is_gone_on_from() {
    let (scratch, model, data, whole) = desk("full");
    let text = std::fs::read_to_string(&data).unwrap();
    let lines: Vec<_> = text.lines().collect();
    let half = lines[..2000].join("\n") + "\n";
    let state = scratch.path("state");
    let arguments: [&dyn AsRef<std::ffi::OsStr>; 6] =
        [&"run", &model, &"-i", &"-", &"--state", &state];
    let before = athermal_fed(&arguments, half.as_bytes()).ended(0).out;
    let kept = std::fs::read(&state).unwrap();
    // Where it is written aside.
    let aside = scratch.path("state.part");
    std::fs::create_dir(&aside).unwrap();
    let after = athermal_fed(&arguments, text.as_bytes());
    after.tells(&[
        "cannot write",
        "the run goes on from what was read, and tries again after the first row",
        "tries again in a minute",
    ]);
    assert_eq!(after.status, 3, "nothing of it is kept at the end");
    assert_eq!(
        before.clone() + after.out.split_once('\n').unwrap().1,
        whole
    );
    assert_eq!(std::fs::read(&state).unwrap(), kept);

    std::fs::remove_dir(&aside).unwrap();
    let after = athermal_fed(&arguments, text.as_bytes()).ended(0);
    assert_eq!(before + after.out.split_once('\n').unwrap().1, whole);
}

#[test]
fn a_state_is_no_stream() {
    let (_scratch, model, data, _) = desk("stream");
    let run = athermal(&[&"run", &model, &"-i", &data, &"--state", &"-"]).ended(2);
    run.tells(&[
        "--state -: what a run knows is kept in a file",
        "name a file",
    ]);
    assert_eq!(run.out, "");
}

#[test]
fn a_state_that_is_the_output_is_refused_be_it_there_or_not() {
    let (scratch, model, data, _) = desk("output");
    let both = scratch.path("both.csv");
    let run = || {
        athermal(&[
            &"run", &model, &"-i", &data, &"-o", &both, &"--state", &both,
        ])
    };
    run()
        .ended(2)
        .tells(&["--state", "the same file as", "name another file"]);
    assert!(!both.exists());
    std::fs::write(&both, "kept").unwrap();
    run().ended(2);
    assert_eq!(std::fs::read_to_string(&both).unwrap(), "kept");
}

#[test]
fn a_run_that_was_once_told_of_a_far_future_says_why_the_next_predicts_nothing() {
    let (scratch, model, data, _) = desk("future");
    let text = std::fs::read_to_string(&data).unwrap();
    let lines: Vec<_> = text.lines().collect();
    let ahead = [1000, 1001].map(|row| format!("9{}\n", lines[row]));
    let state = scratch.path("state");
    let arguments: [&dyn AsRef<std::ffi::OsStr>; 6] =
        [&"run", &model, &"-i", &"-", &"--state", &state];
    let first = lines[..1000].join("\n") + "\n" + &ahead.concat();
    athermal_fed(&arguments, first.as_bytes()).ended(0);
    let rest = [&lines[..1], &lines[1002..2000]].concat().join("\n");
    let next = athermal_fed(&arguments, rest.as_bytes());
    next.tells(&[
        "warning: ",
        "before what the run before saw last: nothing was predicted",
        "begins cold",
    ]);
    assert_eq!(next.ended(0).out.lines().count(), 1);
}

/// A clock that was set back goes on for as long without a prediction, while the pipe stays open.
#[test]
fn rows_of_a_pipe_that_are_passed_over_are_told_at_ten_a_hundred_and_so_on_also_to_who_wants_little()
 {
    let (scratch, model, data, _) = desk("set-back");
    let text = std::fs::read_to_string(&data).unwrap();
    let lines: Vec<_> = text.lines().collect();
    let state = scratch.path("state");
    let arguments: [&dyn AsRef<std::ffi::OsStr>; 7] =
        [&"run", &model, &"-i", &"-", &"--state", &state, &"-q"];
    athermal_fed(&arguments, (lines[..2001].join("\n") + "\n").as_bytes()).ended(0);
    let back = [&lines[..1], &lines[1001..2500]].concat().join("\n") + "\n";
    let told = athermal_fed(&arguments, back.as_bytes()).ended(0).told;
    for part in [
        "10 rows so far, up to that of 10090.0, which is 2h45min before the last of the run before: nothing is put out until",
        "100 rows so far",
        "1,000 rows so far",
        "begins cold and goes on from there",
    ] {
        assert_eq!(told.matches(part).count().min(1), 1, "{part}: {told}");
    }
    assert_eq!(told.lines().count(), 3, "{told}");
}
