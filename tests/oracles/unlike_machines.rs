//! Simulated fleets whose machines differ by 0 to 50 %: how many that are as they should be are named by `fleet compare`, and which of two
//! that are not. 5 fleets, and with `ATHERMAL_LONG=1` 200: 40 of each spread.

use std::collections::BTreeMap;

use athermal::core::registry::find;
use athermal::core::watch::Kept;
use athermal::run::fit::FitOptions;
use athermal::run::model::Model;
use athermal::run::recording::{Event, Table};
use athermal::trial::machine::{Individual, KnownMachine, Setup, Simulated};
use athermal_fleet::fit_machine;
use athermal_fleet::unlike::{Traits, compare, traits_of};

use crate::workbench::graph;

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Healthy,
    /// All that its temperatures do to it is twice as much.
    Twice,
    /// A sensor on a holder measures three tenths of the holder and the room for the rest, a quarter of an hour late.
    Loose,
}

/// What a machine is compared by after so many days.
fn traits(model: &Model, spread: &str, seed: u64, days: f64, kind: Kind) -> Traits {
    let setup = Setup {
        days,
        seed,
        individual: Individual {
            spread: spread.parse().unwrap(),
            seed,
        },
        ..Setup::default()
    };
    let tester = find::<KnownMachine>("die-tester").unwrap().machine;
    let own = Table::read(&Simulated::new(tester, setup), &model.plan).unwrap();
    let place = |name: &str| {
        let mut sources = model.plan.sources.iter();
        sources.position(|of| of.name == name).unwrap()
    };
    let (holder, room) = (place("temperature.holder1"), place("temperature.room"));
    let (mut rows, mut shown) = (Table::default(), None);
    for (event, values) in own.events() {
        let Event::Row(time) = event else { continue };
        let mut values = values.clone();
        match kind {
            Kind::Healthy => {}
            Kind::Twice => {
                for (value, source) in values.iter_mut().zip(&model.plan.sources) {
                    if source.name.starts_with("position.") {
                        *value *= 2.0;
                    }
                }
            }
            Kind::Loose => {
                let near = 0.3 * values[holder] + 0.7 * values[room];
                // Rows come each 10 s.
                let before = shown.unwrap_or(near);
                shown = Some(before + (near - before) * 10.0 / 900.0);
                values[holder] = shown.unwrap();
            }
        }
        rows.push(*time, &values);
    }
    let fit = fit_machine(model, &rows, &FitOptions::default(), None, &Kept::default());
    traits_of(&fit.unwrap().model)
}

#[test]
fn healthy_machines_are_named_at_the_stated_rate_and_those_that_are_not_are_found() {
    let is_long = std::env::var_os("ATHERMAL_LONG").is_some();
    // Of the long mode each machine has a part in three fleets.
    let (fleets, size, pool, days) = match is_long {
        true => (40, 30, 400, 4.0),
        false => (1, 15, 15, 2.0),
    };
    let model = Model::load(graph("die-tester-fleet")).unwrap();
    let (mut named, mut healthy) = (0, 0);
    for spread in ["0%", "5%", "10%", "30%", "50%"] {
        let all = (0..pool).map(|nth| (nth, Kind::Healthy));
        let faults = [Kind::Twice, Kind::Loose].map(|kind| (0..fleets).map(move |nth| (nth, kind)));
        let jobs: Vec<(usize, Kind)> = all.chain(faults.into_iter().flatten()).collect();
        let seed = |nth: usize| 1 + nth as u64;
        let of = |&(nth, kind): &(usize, Kind)| traits(&model, spread, seed(nth), days, kind);
        let (left, right) = jobs.split_at(jobs.len() / 2);
        let made: Vec<Traits> = std::thread::scope(|scope| {
            let right = scope.spawn(|| right.iter().map(of).collect::<Vec<_>>());
            let mut left: Vec<Traits> = left.iter().map(of).collect();
            left.extend(right.join().unwrap());
            left
        });
        let (mut found, mut names) = ([0; 2], 0);
        for fleet in 0..fleets {
            let member = |nth: usize| (fleet + nth * pool / size) % pool;
            let mut machines: BTreeMap<String, Traits> = (0..size)
                .map(|nth| (format!("m{nth}"), made[member(nth)].clone()))
                .collect();
            let unlike = |machines: &BTreeMap<String, Traits>| -> Vec<String> {
                let named = compare(machines)
                    .machines
                    .into_iter()
                    .filter(|of| of.unlike);
                named.map(|of| of.machine).collect()
            };
            names += unlike(&machines).len();
            for kind in 0..2 {
                machines.insert("m0".to_owned(), made[pool + kind * fleets + fleet].clone());
                found[kind] += usize::from(unlike(&machines).contains(&"m0".to_owned()));
            }
        }
        let share = |count: usize, of: usize| 100.0 * count as f64 / of as f64;
        let [twice, loose] = found.map(|of| share(of, fleets));
        println!(
            "spread {spread}: {:.2} % of {} healthy machines are named; twice the expansion is found in {twice:.0} %, a loose sensor in \
             {loose:.0} % of {fleets} fleets",
            share(names, fleets * size),
            fleets * size
        );
        named += names;
        healthy += fleets * size;
        if !["30%", "50%"].contains(&spread) {
            let most = if is_long { 90.0 } else { 100.0 };
            assert!(twice >= most, "{spread}: {twice} %");
            assert!(!is_long || loose >= most, "{spread}: {loose} %");
        }
        // Two of a hundred, and what chance makes of that.
        assert!(
            share(names, fleets * size) <= if is_long { 3.0 } else { 7.0 },
            "{spread}: {names}"
        );
    }
    let share = named as f64 / healthy as f64;
    println!(
        "{:.2} % of {healthy} healthy machines are named",
        100.0 * share
    );
    assert!(share <= if is_long { 0.022 } else { 0.04 }, "{share}");
}
