//! The same bits on other processors: Cortex-M3, M4 and M7 on emulated boards, and AArch64. Prints sizes and instructions.

use std::path::Path;
use std::process::Command;

use athermal_export::c::flash;
use athermal_export::{Options, Rates};

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
    // Of the starter it is looked at the size of the runtime alone, where it is largest.
    for (name, cpus) in [
        ("die-tester.toml", &["m3", "m4", "m7"][..]),
        ("die-tester-compensate.toml", &["m3", "m4", "m7"][..]),
        ("die-tester-control.toml", &["m3", "m4", "m7"][..]),
        ("starter", &["m4"][..]),
    ] {
        let (_, exported) = match name {
            "starter" => exported_starter(&options),
            _ => shipped(name, rates()),
        };
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
            continue;
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
