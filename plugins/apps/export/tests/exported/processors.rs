//! The same bits on other processors: Cortex-M3, M4 and M7 on emulated boards, and AArch64. Prints sizes and instructions.

use std::path::Path;
use std::process::Command;

use athermal_core::engine::Engine;
use athermal_export::c::flash;
use athermal_export::{Exported, Options, Rates, export_c};
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

/// A shipped graph fitted on its data, with room for the samples of these: what `athermal fit` and `export c` write. None where there are no
/// such data.
fn fitted(name: &str) -> Option<(Engine, Exported)> {
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
    let exported = export_c(&engine, &options, false).unwrap();
    Some((engine, exported))
}

/// What the page lacks of figures of a graph, which are near within two hundredths.
fn not_on_page(graph: &str, figures: &[usize]) -> Option<String> {
    let page = std::fs::read_to_string(project().join("docs/src/export-c.md")).unwrap();
    let begins = format!("| `{graph}` | ");
    let row = page.lines().find(|line| line.starts_with(&begins));
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
    (!is_there).then(|| format!("\n{begins}{} |", own.join(" | ")))
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
        let (_, exported) = match name {
            "starter" => exported_starter(&options),
            _ => of_data.unwrap_or_else(|| shipped(name, rates())),
        };
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
            assert!(code <= 32_768, "{code} bytes of runtime");
            let (_, worst) = said.split_once("instructions a tick, ").unwrap();
            let worst = worst.split(' ').next().unwrap().parse().unwrap();
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
            let page = std::fs::read_to_string(project().join("docs/src/export-c.md")).unwrap();
            let (_, of_page) = page
                .split_once("`init` writes, the runtime takes ")
                .unwrap();
            let of_page = of_page.split(' ').next().unwrap().replace(',', "");
            let off = figures[2] as f64 / of_page.parse::<f64>().unwrap() - 1.0;
            assert!(off.abs() < 0.02, "{figures:?}, on the page {of_page}");
            continue;
        }
        if is_of_data {
            missing.extend(not_on_page(name.trim_end_matches(".toml"), &figures));
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
