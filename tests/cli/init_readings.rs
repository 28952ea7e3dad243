//! What is another reading of the position explains it, and nothing of why it drifts: `init` leaves it out.

use std::fmt::Write as _;

use crate::workbench::Folder;

/// Noise of one row, even between -1 and 1.
fn noise(row: f64, of: f64) -> f64 {
    let wild = (row * 12.9898 + of).sin() * 43_758.545_3;
    2.0 * (wild - wild.floor()) - 1.0
}

/// A log of a machine whose position follows its plate late, the named columns made of the row, the heater's duty and the position in µm;
/// every 500 rows the position is zeroed anew where that is asked for.
fn log(names: &str, zeroed: bool, columns: impl Fn(f64, f64, f64) -> Vec<f64>) -> String {
    let mut text = format!("time_s,plate_degC,X_um,{names}\n");
    let (mut plate, mut x, mut zero) = (22.0, 0.0, 0.0);
    for row in 0..4000 {
        let at = f64::from(row);
        let duty = 0.5 + 0.4 * (at / 400.0).sin();
        plate += (20.0 + 10.0 * duty - plate) / 60.0;
        x += (4.0 * plate - x) / 40.0;
        if zeroed && row % 500 == 499 {
            zero = x;
        }
        let shown = x - zero + 0.02 * noise(at, 2.0);
        let _ = write!(
            text,
            "{},{:.3},{shown:.4}",
            10 * row,
            plate + 0.005 * noise(at, 1.0)
        );
        for value in columns(at, duty, x) {
            let _ = write!(text, ",{value}");
        }
        text.push('\n');
    }
    text
}

fn init(folder: &Folder, name: &str, log: &str, more: &[&str]) -> (bool, String) {
    let file = format!("{name}.csv");
    std::fs::write(folder.0.join(&file), log).unwrap();
    let output = folder.run(
        &[
            &["init", &file, "-o", &format!("{name}.toml"), "--force"],
            more,
        ]
        .concat(),
    );
    let said = String::from_utf8(output.stderr).unwrap();
    let words: Vec<&str> = said.split_whitespace().collect();
    (output.status.success(), words.join(" "))
}

#[test]
fn readings_of_the_position_are_no_inputs_and_causes_are() {
    let folder = Folder::new("init-readings");
    let coarse = |x: f64| (x / 5.0).floor();
    let logs: [(&str, &str, String, &[&str]); 9] = [
        (
            "counts",
            "enc_counts",
            log("enc_counts", false, |_, _, x| {
                vec![(x / 0.05).round() + 4711.0]
            }),
            &["enc_counts: left out"],
        ),
        (
            "steps",
            "motor_steps",
            log("motor_steps", false, |row, _, x| {
                vec![(x / 0.4 + 0.2 * noise(row, 3.0)).round()]
            }),
            &["motor_steps: left out"],
        ),
        (
            "zeroed",
            "a copy",
            log("raw", true, |row, _, x| {
                vec![3.0 * x + 0.01 * noise(row, 4.0)]
            }),
            &["raw: left out"],
        ),
        (
            "both",
            "a sum",
            log("coarse,fine", false, |_, _, x| {
                vec![coarse(x), x - 5.0 * coarse(x)]
            }),
            &["coarse: left out", "fine: left out"],
        ),
        (
            "angle",
            "an angle",
            log("motor_deg", false, |_, _, x| vec![360.0 * x / 0.5]),
            &["motor_deg: left out"],
        ),
        (
            "asked",
            "what was commanded",
            log("X_cmd_um", false, |_, _, x| vec![x]),
            &["X_cmd_um: left out, a set point"],
        ),
        (
            "encoders",
            "two encoders",
            log("X2_um", false, |row, _, x| vec![x + 0.03 * noise(row, 5.0)]),
            &["X_um: drifts", "X2_um: drifts"],
        ),
        (
            "duty",
            "causes",
            log("duty,tilt_deg,fan", false, |row, duty, _| {
                vec![duty, 0.01 * (row / 900.0).cos(), f64::from(duty > 0.6)]
            }),
            &["duty: input", "tilt_deg: input", "fan: input"],
        ),
        (
            "sample",
            "a counter",
            log("sample", false, |row, _, _| vec![(row * 7.3).floor()]),
            &["sample: left out"],
        ),
    ];
    for (name, what, log, expected) in &logs {
        let (fine, said) = init(&folder, name, log, &[]);
        assert!(fine, "{what}: {said}");
        for expected in *expected {
            assert!(said.contains(expected), "{what}: {said}");
        }
        assert!(said.contains("plate_degC: temperature"), "{what}: {said}");
    }
    let kept = init(&folder, "counts", &logs[0].2, &["--keep", "enc_counts"]);
    assert!(kept.1.contains("enc_counts: input"), "{}", kept.1);
    let unknown = init(&folder, "counts", &logs[0].2, &["--keep", "enc_count"]);
    assert!(
        !unknown.0 && unknown.1.contains("there is no column `enc_count`"),
        "{}",
        unknown.1
    );
    let probe = init(&folder, "encoders", &logs[6].2, &["--drifts", "X_um"]);
    assert!(
        probe
            .1
            .contains("X2_um: left out, you say that something else drifts"),
        "{}",
        probe.1
    );
    let alone = logs[0].2.lines().map(|line| {
        let cells: Vec<&str> = line.split(',').collect();
        format!("{},{},{}\n", cells[0], cells[2], cells[3])
    });
    let (fine, said) = init(&folder, "alone", &alone.collect::<String>(), &[]);
    assert!(
        fine && said.contains("enc_counts: input")
            && said.contains("if it is another reading of it"),
        "{said}"
    );
}

/// A log of a machine that corrects itself: its position holds what was applied, of which `reported` says what the log has.
fn corrected(
    name: &str,
    applied: impl Fn(usize, f64, f64) -> f64,
    reported: impl Fn(usize, f64) -> String,
) -> String {
    let mut text = format!("time_s,plate_degC,X_nm,{name}\n");
    let (mut plate, mut x, mut taken) = (22.0, 0.0, 0.0);
    for row in 0..6000_usize {
        let at = row as f64;
        plate += (25.0 + 5.0 * (at / 400.0).sin() - plate) / 60.0;
        x += (400.0 * plate - x) / 40.0;
        taken = applied(row, x, taken);
        let shown = x + taken + 2.0 * noise(at, 2.0);
        let _ = writeln!(
            text,
            "{},{:.3},{shown:.1},{}",
            10 * row,
            plate + 0.005 * noise(at, 1.0),
            reported(row, taken)
        );
    }
    text
}

/// The spread of what drifts, and the share of it that the vote explains.
fn scored(folder: &Folder, name: &str) -> (f64, f64) {
    let [log, graph, model] = ["csv", "toml", "json"].map(|ending| format!("{name}.{ending}"));
    let fitted = folder.run(&["fit", &graph, "-d", &log, "-o", &model]);
    let said = String::from_utf8_lossy(&fitted.stderr);
    assert!(
        fitted.status.success() && !said.contains("applied"),
        "{name}: {said}"
    );
    let scores = folder.run(&["evaluate", &model, "-d", &log, "--format", "json"]);
    let scores: serde_json::Value = serde_json::from_slice(&scores.stdout).unwrap();
    let scores = scores["scores"].as_array().unwrap();
    let of = scores
        .iter()
        .find(|of| of["output"].as_str().unwrap().starts_with("now/result"))
        .unwrap();
    (
        of["baseline_zero"].as_f64().unwrap(),
        of["r2_zero"].as_f64().unwrap(),
    )
}

#[test]
fn a_machine_that_corrects_itself_is_modelled_as_it_would_have_been_without() {
    let folder = Folder::new("init-corrected");
    let half = |x: f64| -0.5 * (x - 9_000.0);
    let shown = |_: usize, taken: f64| format!("{taken:.1}");
    let logs = [
        (
            "none",
            corrected("spare_V", |_, _, _| 0.0, |row, _| format!("{}", row % 7)),
        ),
        (
            "lags",
            corrected(
                "X_applied_nm",
                |_, x, taken| taken + (half(x) - taken) / 30.0,
                shown,
            ),
        ),
        (
            "clips",
            corrected(
                "X_applied_nm",
                |_, x, _| half(x).clamp(-200.0, 200.0),
                shown,
            ),
        ),
        (
            "stops",
            corrected(
                "X_applied_nm",
                |row, x, taken| if row < 3000 { half(x) } else { taken },
                shown,
            ),
        ),
        (
            "units",
            corrected(
                "Applied X (um)",
                |_, x, _| half(x),
                |_, taken| format!("{:.4}", taken / 1000.0),
            ),
        ),
        (
            "hole",
            corrected(
                "X_applied_nm",
                |_, x, _| half(x),
                |row, taken| match row {
                    2000..2360 => String::new(),
                    _ => format!("{taken:.1}"),
                },
            ),
        ),
    ];
    let mut without = None;
    for (name, log) in &logs {
        let (fine, said) = init(&folder, name, log, &["--drifts", "X_nm"]);
        let says =
            "what a correction applied to X_nm, which is taken as it would have been without";
        assert!(
            fine && said.contains(says) == (*name != "none"),
            "{name}: {said}"
        );
        let (spread, explained) = scored(&folder, name);
        let (of_all, share) = *without.get_or_insert((spread, explained));
        assert!(
            (spread / of_all - 1.0).abs() < 0.05 && explained > share - 0.02,
            "{name}: {spread} {explained}, without {of_all} {share}"
        );
    }
    let lags = logs[1].1.replacen("X_applied_nm", "piezo_nm", 1);
    let (fine, said) = init(&folder, "named", &lags, &["--applied", "piezo_nm"]);
    assert!(fine && said.contains("piezo_nm: applied"), "{said}");
    let (fine, said) = init(&folder, "other", &logs[0].1, &["--applied", "plate_degC"]);
    assert!(
        !fine && said.contains("cannot have been applied to `X_nm`"),
        "{said}"
    );
}

#[test]
fn a_fit_below_the_noise_of_what_it_explains_is_doubted_and_a_rod_with_one_temperature_is_not() {
    let folder = Folder::new("below-noise");
    let rows = log("spare", false, |row, _, _| vec![row % 7.0]);
    let made = |of: &dyn Fn(&[&str]) -> String| -> String {
        rows.lines()
            .skip(1)
            .map(|line| of(&line.split(',').collect::<Vec<_>>()))
            .collect()
    };
    let reading = made(&|of| {
        format!(
            "{},{},{}\n",
            of[0],
            of[2],
            (of[2].parse::<f64>().unwrap() * 1e4).round()
        )
    });
    let rod = made(&|of| format!("{},{},{}\n", of[0], of[2], of[1]));
    let fitted = |name: &str, log: &str, more: &[&str]| {
        let (fine, said) = init(&folder, name, log, more);
        assert!(fine, "{said}");
        let [log, graph, model] = ["csv", "toml", "json"].map(|ending| format!("{name}.{ending}"));
        let output = folder.run(&["fit", &graph, "-d", &log, "-o", &model]);
        let said = String::from_utf8(output.stderr).unwrap();
        said.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let said = fitted(
        "reading",
        &format!("time_s,X_um,enc_counts\n{reading}"),
        &["--keep", "enc_counts"],
    );
    assert!(
        said.contains("below its noise of") && said.contains("enc holds what is measured there"),
        "{said}"
    );
    let said = fitted("rod", &format!("time_s,X_um,plate_degC\n{rod}"), &[]);
    assert!(!said.contains("below its noise"), "{said}");
}
