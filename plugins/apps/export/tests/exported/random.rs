//! Random graphs of all kinds that are exported, stepped over irregular times with gaps, absent samples, spikes and segments: the same
//! bits as the engine with every compiler and level of optimisation. `ATHERMAL_LONG=1` steps 100,000 ticks of a hundred graphs,
//! `ATHERMAL_SEED=7` one graph.

use athermal_core::compile::Plan;
use athermal_core::engine::Engine;
use athermal_core::prng::Prng;
use athermal_core::time::Duration;
use athermal_export::{Options, Rates, export_c, state};

use crate::graphs::chance;
pub use crate::graphs::graph;
use crate::support::{
    Event, Exhibit, LEVELS, Scratch, compilers, difference, has, made_up, plan, ran, stepped,
};

/// What happens to it: times that jitter, gaps, absent samples and channels, spikes, samples that stay, and segments.
pub fn events(random: &mut Prng, plan: &Plan, ticks: usize) -> Vec<Event> {
    let sources: Vec<&str> = plan.sources.iter().map(|of| &*of.name).collect();
    let mut events = Vec::with_capacity(ticks);
    let mut now: i64 = 1_700_000_000_000_000_000;
    let mut level: Vec<f64> = sources.iter().map(|_| 20.0 + random.normal()).collect();
    let mut speed = vec![0.0; sources.len()];
    let mut silent_until = vec![0; sources.len()];
    // Sensors come off after a third: by numbers of their own, so that what is before stays as it was.
    let mut loose = Prng::stream(ticks as u64, "sensors that come off");
    let mut leaps = vec![(0.0, 0); sources.len()];
    let mut calm = 0;
    for tick in 0..ticks {
        let regular = tick / 500 % 2 == 0;
        let step = if regular {
            1.0
        } else {
            random.between(0.25, 2.5)
        };
        now += (step * 1e9) as i64;
        if chance(random, 0.003) {
            now += (random.between(1.0, 400.0) * 1e9) as i64;
        }
        if chance(random, 0.0008) {
            events.push(Event::Break);
            // Another log may begin earlier.
            now -= (random.between(-100.0, 5000.0) * 1e9) as i64;
        }
        if chance(random, 0.002) {
            calm = tick + 80;
        }
        let mut row = Vec::with_capacity(sources.len());
        for (nth, &name) in sources.iter().enumerate() {
            let temperature = name.starts_with("temperature");
            if tick >= calm {
                speed[nth] = 0.98 * speed[nth] + 0.02 * random.normal();
                let scale = if temperature { 0.2 } else { 15.0 };
                level[nth] += scale * speed[nth] + 0.02 * scale * random.normal();
                if temperature {
                    level[nth] = level[nth].clamp(-60.0, 160.0);
                }
            }
            if temperature && tick > ticks / 3 && chance(&mut loose, 0.005) {
                let long = loose.between(5.0, 30.0) as usize;
                leaps[nth] = (60.0 * loose.normal(), tick + long);
            }
            let leap = if tick < leaps[nth].1 {
                leaps[nth].0
            } else {
                0.0
            };
            if chance(random, 0.0005) {
                silent_until[nth] = tick + random.between(1.0, 120.0) as usize;
            }
            let often = match name.split('.').next() {
                Some("position") => 0.7,
                Some("applied") => 0.3,
                Some("mark") => 0.1,
                Some("voltage") => 0.01,
                _ if regular => 1.0,
                _ => 0.93,
            };
            let value = if tick < silent_until[nth] || !chance(random, often) {
                f64::NAN
            } else if name.starts_with("mark") {
                f64::from(u8::from(chance(random, 0.1)))
            } else if name.starts_with("applied") {
                1e-3 * level[nth]
            } else if chance(random, 0.0005) {
                [f64::INFINITY, 1e9, -1e120, 0.0, -0.0][random.between(0.0, 5.0) as usize % 5]
            } else {
                level[nth] + leap
            };
            row.push(value);
        }
        events.push(Event::Tick(now, row));
    }
    events
}

/// The same where positions leap: they are zeroed, or pushed for some ticks, or leap again soon after; each in the middle too.
pub fn leaping(events: &[Event], plan: &Plan, seed: u64) -> Vec<Event> {
    let mut events = events.to_vec();
    let mut random = Prng::stream(seed, "leaps");
    let middle = events.len() / 2;
    let sources = plan.sources.iter().enumerate();
    for (nth, _) in sources.filter(|(_, of)| of.name.starts_with("position")) {
        let (mut by, mut pushed, mut again) = (0.0, 0, middle);
        for (tick, event) in events.iter_mut().enumerate() {
            let Event::Tick(_, samples) = event else {
                continue;
            };
            let sample = &mut samples[nth];
            if sample.is_nan() {
                continue;
            }
            if tick >= again || chance(&mut random, 0.004) {
                again = if tick < middle { middle } else { usize::MAX };
                match random.between(0.0, 3.0) as u64 {
                    0 => by = -*sample,
                    1 => pushed = tick + 4,
                    _ => {
                        by += 1e3 * random.normal();
                        again = tick + 1 + random.between(0.0, 15.0) as usize;
                    }
                }
            }
            *sample += by + if tick < pushed { 3e3 } else { 0.0 };
        }
    }
    events
}

pub fn options() -> Options {
    Options {
        rates: Rates::every(Duration::from_ns(240_000_000)),
        ..Options::default()
    }
}

fn cases() -> (std::ops::Range<u64>, usize) {
    let seed = std::env::var("ATHERMAL_SEED").ok();
    let is_long = std::env::var_os("ATHERMAL_LONG").is_some();
    let ticks = if is_long { 100_000 } else { 3_000 };
    match seed.and_then(|seed| seed.parse().ok()) {
        Some(seed) => (seed..seed + 1, ticks),
        None => (0..if is_long { 100 } else { 4 }, ticks),
    }
}

#[test]
fn random_graphs_give_the_bits_of_the_engine_with_every_compiler_and_level_of_optimisation() {
    let compilers = compilers();
    if compilers.is_empty() {
        return;
    }
    let (seeds, ticks) = cases();
    let scratch = Scratch::new("random");
    let (mut values, mut outputs) = (0, 0);
    let (mut reasons, mut became, mut faults) = ([0; 5], [0; 40], [0; 8]);
    for seed in seeds {
        let mut random = Prng::stream(seed, "an exported graph");
        let text = graph(&mut random);
        let plan = plan(&text);
        assert!(plan.gathers.iter().any(|of| !of.rare.is_empty()), "{text}");
        let fitted = made_up(&plan, &mut random);
        let mut engine = Engine::new(plan.clone(), &fitted).unwrap();
        let exported = export_c(&engine, &options(), false).unwrap();
        let options = Options {
            fast: true,
            ..options()
        };
        let fast = export_c(&engine, &options, false).unwrap();
        let exhibits = [(&exported, "as it is"), (&fast, "fast")]
            .map(|(of, how)| Exhibit::new(of, &scratch.path(&format!("{seed} {how}"))));
        let saved = [&exported, &fast].map(|of| state::to_c(&engine, &of.form).unwrap());
        assert!(saved[0] == saved[1], "what is kept is not saved");
        let events = events(&mut random, &plan, ticks);
        let leaping = leaping(&events, &plan, seed);
        let expected = stepped(&mut engine, &events);
        let over_leaps = stepped(&mut Engine::new(plan.clone(), &fitted).unwrap(), &leaping);
        let count = |outputs: &[&str], of: &mut [usize]| {
            let all = plan.outputs.iter().enumerate();
            let is_of = |name: &str| outputs.iter().any(|of| name.starts_with(of));
            for (nth, _) in all.filter(|(_, of)| is_of(&of.name)) {
                let both = expected.iter().chain(&over_leaps);
                let values = both.map(|row| f64::from_bits(row[nth]));
                values
                    .filter(|value| !value.is_nan())
                    .for_each(|value| of[value as usize] += 1);
            }
        };
        count(&["why_trusted"], &mut reasons);
        count(&["became", "learned"], &mut became);
        count(&["why_sound"], &mut faults);
        let there = expected.iter().flatten();
        values += there
            .filter(|&&bits| !f64::from_bits(bits).is_nan())
            .count();
        for (nth, compiler) in compilers.iter().enumerate() {
            // Each seed takes two of the levels with each compiler, the two together all of them.
            for (exhibit, level) in exhibits.iter().zip([
                LEVELS[(seed as usize + 2 * nth) % 4],
                LEVELS[(seed as usize + 2 * nth + 1) % 4],
            ]) {
                let program = exhibit.built(compiler, &[level], "driver.c");
                for (events, expected) in [(&events, &expected), (&leaping, &over_leaps)] {
                    let (found, said) = exhibit.stepped(&program, events);
                    let differs = difference(&exhibit.form, expected, &found);
                    assert_eq!(differs, None, "seed {seed}, {compiler} {level}\n{text}");
                    outputs += found.iter().map(Vec::len).sum::<usize>();
                    assert_eq!(said & 3, 0, "seed {seed}: refused or full");
                    assert_eq!(
                        handed_over(exhibit, &program, &plan, &fitted, events),
                        None,
                        "seed {seed}"
                    );
                }
            }
        }
    }
    assert!(values > 50_000, "{values}");
    println!("{outputs} outputs compared, 0 differ");
    assert!(outputs > 1_000_000, "{outputs}");
    println!(
        "sensors by what is known of them: {reasons:?}, and by what is wrong with them: {faults:?}"
    );
    let enough = reasons.iter().zip([200, 200, 200, 0, 50]);
    assert!(
        { enough }.all(|(&count, least)| count >= least),
        "{reasons:?}"
    );
    assert!(faults.iter().all(|&count| count > 10), "{faults:?}");
    println!("truths by what became of them: {became:?}");
    // By ones what became of truths, by tens who spoke.
    let of = |code: usize| became.iter().skip(code).step_by(10).sum::<usize>();
    let happened = [0, 2, 3, 4, 6, 7].map(of);
    assert!(happened.iter().all(|&count| count > 10), "{became:?}");
    let spoke = became.chunks(10).map(|of| of.iter().sum::<usize>());
    assert!(
        spoke.into_iter().take(3).all(|count| count > 10),
        "{became:?}"
    );
}

#[test]
fn random_graphs_give_the_bits_of_the_engine_on_processors_of_32_bits() {
    let scratch = Scratch::new("narrow");
    let (_, ticks) = cases();
    let mut outputs = 0;
    for (compiler, flags) in [
        ("i686-linux-gnu-gcc", &["-msse2", "-mfpmath=sse"][..]),
        ("arm-linux-gnueabihf-gcc", &[]),
    ] {
        if !has(compiler) || !has("qemu-arm") {
            continue;
        }
        for (seed, level) in [(1, "-O0"), (2, "-O3")] {
            let mut random = Prng::stream(seed, "an exported graph");
            let plan = plan(&graph(&mut random));
            let fitted = made_up(&plan, &mut random);
            let mut engine = Engine::new(plan.clone(), &fitted).unwrap();
            let options = Options {
                fast: level == "-O3",
                ..options()
            };
            let exported = export_c(&engine, &options, false).unwrap();
            let exhibit = Exhibit::new(&exported, &scratch.path(&format!("{compiler}{level}")));
            let events = events(&mut random, &plan, ticks / 2);
            let expected = stepped(&mut engine, &events);
            let flags = [&[level, "-static"], flags].concat();
            let program = exhibit.built(compiler, &flags, "driver.c");
            let (found, said) = exhibit.stepped(&program, &events);
            let differs = difference(&exhibit.form, &expected, &found);
            assert_eq!(differs, None, "seed {seed}, {compiler} {level}");
            assert_eq!(said & 3, 0, "seed {seed}: refused or full");
            outputs += expected.iter().map(Vec::len).sum::<usize>();
        }
    }
    println!("{outputs} outputs of processors of 32 bits compared, 0 differ");
}

/// An engine goes on in C from the middle, and C goes on in an engine: the first difference from the engine that went all the way.
fn handed_over(
    exhibit: &Exhibit,
    program: &std::path::Path,
    plan: &std::sync::Arc<Plan>,
    fitted: &athermal_core::engine::Fitted,
    events: &[Event],
) -> Option<String> {
    let (before, after) = events.split_at(events.len() / 2 + 7);
    let mut engine = Engine::new(plan.clone(), fitted).unwrap();
    stepped(&mut engine, before);
    let saved = state::to_c(&engine, &exhibit.form).unwrap();
    let (begin, end) = (exhibit.folder.join("begin"), exhibit.folder.join("end"));
    std::fs::write(&begin, &saved).unwrap();
    let expected = stepped(&mut engine, after);
    let (found, _) = exhibit.stepped_from(program, after, Some(&begin), None);
    let differs = difference(&exhibit.form, &expected, &found);
    if differs.is_some() {
        return differs.map(|differs| format!("from the engine to C: {differs}"));
    }
    exhibit.stepped_from(program, before, None, Some(&end));
    let mut engine = Engine::new(plan.clone(), fitted).unwrap();
    let mut saved = std::fs::read(&end).unwrap();
    saved[64] ^= 1;
    assert!(state::from_c(&mut engine, &exhibit.form, &saved).is_err());
    saved[64] ^= 1;
    state::from_c(&mut engine, &exhibit.form, &saved).unwrap();
    let found = stepped(&mut engine, after);
    difference(&exhibit.form, &expected, &found)
        .map(|differs| format!("from C to the engine: {differs}"))
}

#[test]
fn after_a_restart_a_clock_that_begins_at_0_begins_a_segment_and_else_no_time_goes_back() {
    let Some(compiler) = compilers().into_iter().next() else {
        return;
    };
    let scratch = Scratch::new("restart");
    let mut random = Prng::stream(3, "an exported graph");
    let plan = plan(&graph(&mut random));
    let fitted = made_up(&plan, &mut random);
    let mut engine = Engine::new(plan.clone(), &fitted).unwrap();
    let exported = export_c(&engine, &options(), false).unwrap();
    let exhibit = Exhibit::new(&exported, &scratch.path("c"));
    let program = exhibit.built(compiler, &["-O2"], "driver.c");
    let rows = events(&mut random, &plan, 1_500).into_iter();
    let ticks = rows.filter_map(|event| match event {
        Event::Tick(_, samples) => Some(samples),
        Event::Break => None,
    });
    // The second half has a clock from boot.
    let ticks = ticks.enumerate().map(|(nth, samples)| {
        let begins = if nth < 1_000 { 1_700_000_000 } else { -1_000 };
        Event::Tick((begins + nth as i64) * 1_000_000_000, samples)
    });
    let ticks: Vec<Event> = ticks.collect();
    let (before, after) = ticks.split_at(1_000);
    stepped(&mut engine, before);
    let (begin, end) = (exhibit.folder.join("begin"), exhibit.folder.join("end"));
    std::fs::write(&begin, state::to_c(&engine, &exhibit.form).unwrap()).unwrap();
    // What is saved as soon as it is loaded is the same.
    exhibit.stepped_from(&program, &[], Some(&begin), Some(&end));
    assert!(std::fs::read(&begin).unwrap() == std::fs::read(&end).unwrap());
    engine.segment();
    let expected = stepped(&mut engine, after);
    let (found, said) = exhibit.stepped_from(&program, after, Some(&begin), None);
    assert_eq!(difference(&exhibit.form, &expected, &found), None);
    assert_eq!(said & 11, 8, "restarted, and neither refused nor full");
    let values = found.iter().flatten();
    let there = values.filter(|&&bits| !f64::from_bits(bits).is_nan());
    assert!(there.count() > 1_000);
    // In a run that goes on, a time that goes back is refused, and gives no outputs.
    let (found, said) = exhibit.stepped(&program, &[after, &after[..1]].concat());
    assert_eq!(said & 11, 1);
    let last = found.last().unwrap();
    assert!(last.iter().all(|&bits| f64::from_bits(bits).is_nan()));
}

#[test]
fn nothing_is_divided_by_zero_which_a_processor_may_trap() {
    let scratch = Scratch::new("zero");
    let zeros = "float-divide-by-zero,integer-divide-by-zero";
    for (seed, compiler, precision, ends) in [
        (0, "gcc", "-UATHERMAL_FLOAT", "-fno-sanitize-recover"),
        (1, "gcc", "-DATHERMAL_FLOAT", "-fno-sanitize-recover"),
        // Without its library, which is a package of its own.
        (2, "clang", "-UATHERMAL_FLOAT", "-fsanitize-trap"),
    ] {
        if !has(compiler) {
            continue;
        }
        let mut random = Prng::stream(seed, "an exported graph");
        let plan = plan(&graph(&mut random));
        let fitted = made_up(&plan, &mut random);
        let engine = Engine::new(plan.clone(), &fitted).unwrap();
        let exported = export_c(&engine, &options(), false).unwrap();
        let exhibit = Exhibit::new(&exported, &scratch.path(&seed.to_string()));
        let events = events(&mut random, &plan, 2_000);
        let (sanitized, ends) = (format!("-fsanitize={zeros}"), format!("{ends}={zeros}"));
        let flags = ["-O1", precision, &sanitized, &ends];
        exhibit.stepped(&exhibit.built(compiler, &flags, "driver.c"), &events);
    }
}

#[test]
fn no_byte_is_touched_that_is_not_of_the_state_as_valgrind_and_sanitizers_see_it() {
    if !["gcc", "valgrind"].iter().all(|program| has(program)) {
        return;
    }
    let scratch = Scratch::new("memory");
    let mut random = Prng::stream(77, "an exported graph");
    let plan = plan(&graph(&mut random));
    let fitted = made_up(&plan, &mut random);
    let mut engine = Engine::new(plan.clone(), &fitted).unwrap();
    let events = events(&mut random, &plan, 2_500);
    let expected = stepped(&mut engine, &events);
    // With room for all ticks, and with room for one in ten: rings that are full.
    for (name, period) in [("roomy", 240_000_000), ("tight", 2_400_000_000)] {
        let options = Options {
            rates: Rates::every(Duration::from_ns(period)),
            fast: true,
            ..Options::default()
        };
        let exported = export_c(&engine, &options, false).unwrap();
        let exhibit = Exhibit::new(&exported, &scratch.path(name));
        let sanitized = [
            "-O1",
            "-g",
            "-fsanitize=address,undefined",
            "-fno-sanitize-recover=all",
        ];
        let (found, said) = exhibit.stepped(&exhibit.built("gcc", &sanitized, "driver.c"), &events);
        assert_eq!(said & 2 > 0, name == "tight", "{name}: full");
        if name == "roomy" {
            assert_eq!(difference(&exhibit.form, &expected, &found), None);
        }
        let program = exhibit.built("gcc", &["-O1", "-g"], "driver.c");
        let words = [
            exhibit.folder.join("events"),
            exhibit.folder.join("valgrind.out"),
        ];
        let mut valgrind = std::process::Command::new("valgrind");
        ran(valgrind
            .args(["-q", "--error-exitcode=9"])
            .arg(program)
            .args(words));
    }
}
