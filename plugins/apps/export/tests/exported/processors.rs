//! The same bits on other processors: Cortex-M3, M4 and M7 on emulated boards, and AArch64. Prints sizes and instructions.

use std::path::Path;
use std::process::Command;

use athermal_core::engine::Engine;
use athermal_export::c::{flash, operations};
use athermal_export::{Exported, Form, Options, Rates, export_c, lower, st};
use athermal_files::Dataset;
use athermal_run::fit::{FitOptions, fit};
use athermal_run::model::Model;

use crate::shipped::{exported_starter, second, shipped};
use crate::support::{Exhibit, Scratch, SelfTest, has, project, ran};

fn on_cortex(exhibit: &Exhibit, cpu: &str, variables: &[&str]) -> Command {
    let mut make = Command::new("make");
    make.arg("-s")
        .arg("-C")
        .arg(project().join("examples/cortex-m"))
        .arg("run");
    make.arg(format!("EXPORT={}", exhibit.folder.display()));
    make.arg(format!("NAME={}", exhibit.form.name))
        .arg(format!("CPU={cpu}"));
    make.args(variables);
    make
}

/// What `export c` and `export c --fast` write.
pub type Both = [Exported; 2];

fn both(engine: &Engine, options: &Options) -> Both {
    [false, true].map(|fast| {
        let options = Options {
            fast,
            ..options.clone()
        };
        export_c(engine, &options, false).unwrap()
    })
}

/// A shipped graph fitted on its data, with room for the samples of these: what `athermal fit` and `export c` write. None where there are no
/// such data.
pub fn fitted(name: &str) -> Option<(Engine, Both)> {
    let shared = std::env::var_os("ATHERMAL_SHARED")?;
    let machine = ["die-tester", "linear-axis"]
        .into_iter()
        .find(|of| name.starts_with(of))?;
    let file = Path::new(&shared)
        .join("data")
        .join(machine)
        .join("train.csv");
    let model = Model::load(project().join("graphs").join(name)).unwrap();
    let data = Dataset::new(vec![file.exists().then_some(file)?], Default::default());
    let (fitted, report) = fit(&model.plan, &data, &FitOptions::default(), &mut |_| {}).unwrap();
    let engine = Engine::new(model.plan, &fitted).unwrap();
    let options = Options {
        rates: Rates::of_data(&report.rates).unwrap(),
        ..Options::default()
    };
    let both = both(&engine, &options);
    Some((engine, both))
}

/// The instructions of the worst tick.
fn worst_tick(said: &str) -> usize {
    let (_, worst) = said.split_once("instructions a tick, ").unwrap();
    worst.split(' ').next().unwrap().parse().unwrap()
}

pub fn page(name: &str) -> String {
    std::fs::read_to_string(project().join("docs/src").join(name)).unwrap()
}

/// What a page lacks of figures of a graph, which are near within two hundredths.
fn not_on_page(page: &str, begins: &str, figures: &[usize]) -> Option<String> {
    let row = page.lines().find(|line| line.starts_with(begins));
    let digits = |cell: &str| {
        cell.chars()
            .filter(char::is_ascii_digit)
            .collect::<String>()
    };
    let cells = row.unwrap_or_default().split('|').skip(2);
    let of_page: Vec<usize> = cells.filter_map(|cell| digits(cell).parse().ok()).collect();
    let near = |(&is, &of_page): (&usize, &usize)| (is as f64 / of_page as f64 - 1.0).abs() < 0.02;
    let is_there = of_page.len() == figures.len() && figures.iter().zip(&of_page).all(near);
    let own: Vec<String> = figures.iter().map(usize::to_string).collect();
    (!is_there).then(|| format!("\n{begins} {} |", own.join(" | ")))
}

/// What the pages lack of a graph in Structured Text with all channels each 10 s, and of the bytes and operations that a dry run reports.
fn not_on_pages(name: &str, engine: &Engine, exported: &Form) -> Vec<String> {
    let options = Options {
        rates: Rates::every(second(10.0)),
        ..Options::default()
    };
    let st = st::export(engine, &options).unwrap();
    let text = &st.files[1].text;
    let test = text.lines().skip_while(|line| !line.contains("_TEST_"));
    let test: usize = test
        .take_while(|line| *line != "END_VAR")
        .map(str::len)
        .sum();
    let figures = [
        st::state_bytes(&st.form) / 100,
        (text.len() - test) / 1000,
        test / 1000,
    ];
    println!("{name} in Structured Text: {figures:?} of 100, 1000 and 1000 bytes");
    let of_st = page("export-st.md");
    let row = of_st
        .lines()
        .find(|line| line.contains(&format!("(`{name}`)")));
    let mut lacks = Vec::new();
    if let Some(row) = row {
        let (begins, _) = row.split_once(") |").unwrap();
        lacks.extend(not_on_page(&of_st, begins, &figures));
    }
    let (of_c, flash) = (page("export-c.md"), flash(exported));
    let mut lines = Vec::new();
    if name == "die-tester.toml" {
        let all = flash.runtime + flash.tables + flash.self_test;
        lines.push(format!("state: {} bytes with", exported.layout.bytes(8)));
        lines.push(format!("a tick: about {} operations", operations(exported)));
        lines.push(format!(
            "flash: about {all} bytes on a Cortex-M4: {} of the runtime, {} of tables",
            flash.runtime, flash.tables
        ));
    }
    if name == "die-tester-compensate.toml" {
        for (rates, begins) in [
            (
                Rates::every(second(1.0)).with("position", second(10.0)),
                "`die-tester-compensate` takes ",
            ),
            (Rates::every(second(1.0)), "With both each second it takes "),
        ] {
            let options = Options {
                rates,
                ..Options::default()
            };
            let bytes = lower(engine, &options).unwrap().layout.bytes(8);
            lines.push(format!("{begins}{},{:03}", bytes / 1000, bytes % 1000));
        }
    }
    lacks.extend(
        lines
            .into_iter()
            .filter(|line| !of_c.contains(line))
            .map(|line| format!("\n{line}")),
    );
    lacks
}

#[test]
fn cortex_m3_m4_and_m7_give_the_hash_of_the_host_and_fused_products_are_seen() {
    let needed = ["gcc", "make", "arm-none-eabi-gcc", "qemu-system-arm"];
    if !needed.iter().all(|program| has(program)) {
        return;
    }
    let scratch = Scratch::new("cortex");
    let rates = || Rates::every(second(10.0));
    let options = Options {
        rates: rates(),
        ..Options::default()
    };
    let mut missing = Vec::new();
    // Of the starter it is looked at the size of the runtime alone, where it is largest.
    for (name, cpus) in [
        ("die-tester.toml", &["m3", "m4", "m7"][..]),
        ("die-tester-compensate.toml", &["m4", "m7"][..]),
        ("die-tester-control.toml", &["m4", "m7"][..]),
        ("die-tester-sensor.toml", &["m4", "m7"][..]),
        ("linear-axis.toml", &["m4", "m7"][..]),
        ("linear-axis-compensate.toml", &["m4", "m7"][..]),
        ("starter", &["m4"][..]),
    ] {
        let of_data = (name != "starter").then(|| fitted(name)).flatten();
        let is_of_data = of_data.is_some();
        let (engine, [exported, fast]) = of_data.unwrap_or_else(|| {
            let (engine, _) = match name {
                "starter" => exported_starter(&options),
                _ => shipped(name, rates()),
            };
            let both = both(&engine, &options);
            (engine, both)
        });
        let mut figures = vec![exported.form.layout.bytes(8)];
        let exhibit = Exhibit::new(&exported, &scratch.path(name));
        let host = ran(&mut Command::new(exhibit.built(
            "gcc",
            &["-O2"],
            "example/main.c",
        )));
        for cpu in cpus {
            let said = ran(&mut on_cortex(&exhibit, cpu, &[]));
            println!("{name}, cortex-{cpu}\n{said}");
            assert_eq!(SelfTest::of(&said), SelfTest::of(&host), "{name}, {cpu}");
            // The runtime comes first of the two, with code and constants in the first column.
            let mut sizes = said.lines().skip(1).map_while(|line| {
                let word = line.split_whitespace().next()?;
                word.parse::<usize>().ok()
            });
            let (code, tables) = (sizes.next().unwrap(), sizes.next().unwrap());
            // The graph that `init` writes has what learns in it.
            let most = if cpus.len() == 1 { 36_864 } else { 32_768 };
            assert!(code <= most, "{code} bytes of runtime");
            let worst = worst_tick(&said);
            if *cpu != "m3" {
                figures.extend(if figures.len() == 1 {
                    vec![tables, code, worst]
                } else {
                    vec![code, worst]
                });
            }
            let foreseen = flash(&exhibit.form);
            println!("{foreseen:?} for {code} and {tables}");
            for (foreseen, found) in [
                (foreseen.runtime, code),
                (foreseen.tables + foreseen.self_test, tables),
            ] {
                let off = foreseen as f64 / found as f64 - 1.0;
                assert!(
                    *cpu == "m7" || off.abs() < 0.1,
                    "{name}, {cpu}: {foreseen} for {found}"
                );
            }
        }
        if cpus.len() == 1 {
            let page = page("export-c.md");
            let (_, of_page) = page
                .split_once("`init` writes, the runtime takes ")
                .unwrap();
            let of_page = of_page.split(' ').next().unwrap().replace(',', "");
            let off = figures[2] as f64 / of_page.parse::<f64>().unwrap() - 1.0;
            assert!(off.abs() < 0.02, "{figures:?}, on the page {of_page}");
            continue;
        }
        figures.push(fast.form.layout.bytes(8));
        let faster = Exhibit::new(&fast, &scratch.path(&format!("{name}-fast")));
        for cpu in ["m4", "m7"] {
            let said = ran(&mut on_cortex(&faster, cpu, &[]));
            println!("{name}, --fast, cortex-{cpu}\n{said}");
            assert_eq!(SelfTest::of(&said), SelfTest::of(&host), "{name}, {cpu}");
            figures.push(worst_tick(&said));
        }
        if is_of_data {
            let begins = format!("| `{}` | ", name.trim_end_matches(".toml"));
            missing.extend(not_on_page(&page("export-c.md"), &begins, &figures));
            missing.extend(not_on_pages(name, &engine, &exported.form));
        }
        let out = format!("OUT={}", exhibit.folder.join("fused").display());
        let fused = on_cortex(&exhibit, "m7", &["CONTRACT=fast", &out])
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&fused.stdout).into_owned();
        assert!(
            !fused.status.success() && SelfTest::of(&said).differs > 0,
            "{said}"
        );
    }
    assert!(missing.is_empty(), "the page lacks{}", missing.concat());
}

#[test]
fn aarch64_gives_the_hash_of_the_host_and_fused_products_are_seen() {
    if !["gcc", "aarch64-linux-gnu-gcc", "qemu-aarch64"]
        .iter()
        .all(|program| has(program))
    {
        return;
    }
    let scratch = Scratch::new("aarch64");
    let (_, exported) = shipped("die-tester-compensate.toml", Rates::every(second(10.0)));
    let exhibit = Exhibit::new(&exported, &scratch.path("exported"));
    let host = ran(&mut Command::new(exhibit.built(
        "gcc",
        &["-O2"],
        "example/main.c",
    )));
    let emulated = |program: &Path| {
        let output = Command::new("qemu-aarch64").arg(program).output().unwrap();
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    for level in ["-O0", "-O3"] {
        let program = exhibit.built(
            "aarch64-linux-gnu-gcc",
            &[level, "-static"],
            "example/main.c",
        );
        let said = emulated(&program);
        assert_eq!(SelfTest::of(&said), SelfTest::of(&host), "{level}");
    }
    let flags = ["-O2", "-static", "-ffp-contract=fast"];
    let said = emulated(&exhibit.built("aarch64-linux-gnu-gcc", &flags, "example/main.c"));
    assert!(SelfTest::of(&said).differs > 0, "{said}");
}
