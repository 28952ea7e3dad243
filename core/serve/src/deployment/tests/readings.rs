use std::path::Path;

use super::super::{DeclaredSource, Runtime};
use super::{MACHINE, read, read_from};
use crate::document::Memory;
use crate::sequencer::{ClockRemedy, ClockRule};
use crate::time::Duration;

const TABLE: &str = "[sources.table]\ntype = \"test_table\"\npath = \"a\"\n";

fn secs(secs: f64) -> Duration {
    Duration::from_secs_f64(secs).unwrap()
}

/// Each channel of a source with its address.
fn given(source: &DeclaredSource) -> Vec<(&str, &str)> {
    let channels = source.channels.iter();
    channels
        .map(|of| (of.channel.name.as_str(), of.address.as_str()))
        .collect()
}

#[test]
fn a_source_without_channels_gives_all_that_no_other_names_in_the_columns_of_the_signals() {
    let bus = "[sources.bus]\ntype = \"test_bus\"\nchannels = { \"position.{axis}\" = \"s=Axis.{axis}\" }\n";
    let read = read(&format!("{TABLE}{bus}")).unwrap();
    assert_eq!(
        given(&read.sources[0]),
        [
            ("temperature.plate", "T_plate"),
            ("temperature.room", "T_room")
        ]
    );
    assert_eq!(
        given(&read.sources[1]),
        [("position.X", "s=Axis.X"), ("position.Y", "s=Axis.Y")]
    );
    assert_eq!(read.sources[0].silent, secs(30.0));
    assert_eq!(read.sources[0].clock, None);
    assert_eq!(read.sources[1].kind.name, "test_bus");
}

#[test]
fn patterns_and_signals_name_channels() {
    let with = |channels: &str| read(&format!("{TABLE}channels = {channels}\n"));
    for all in [
        r#"["temperature.*", "position.{axis}"]"#,
        r#"["temperature", "position", "temperature.plate"]"#,
        r#"["*"]"#,
    ] {
        let read = with(all).unwrap();
        assert_eq!(read.sources[0].channels.len(), 4, "{all}");
    }
    let read = with(r#"["temperature.plate", "position.*"]"#).unwrap();
    assert_eq!(read.sources[0].channels.len(), 3);
}

#[test]
fn a_channel_has_an_address_a_unit_that_is_converted_and_a_time_that_it_may_be_late() {
    let lines = format!(
        "{TABLE}late = \"1s\"\n[sources.table.channels]\n\
         temperature.plate = {{ from = \"Plate\", unit = \"degF\" }}\n\
         \"temperature.r*\" = {{ from = \"TC {{channel}}\", unit = \"K\" }}\n\
         \"position.X\" = {{ unit = \"um\", late = \"2s\" }}\n\"position.Y\" = {{ unit = \"nm\" }}\n"
    );
    let read = read(&lines).unwrap();
    let source = &read.sources[0];
    assert_eq!(
        given(source),
        [
            ("temperature.plate", "Plate"),
            ("temperature.room", "TC room"),
            ("position.X", "X"),
            ("position.Y", "Y"),
        ]
    );
    let converted = |nth: usize, value: f64| {
        let (factor, offset) = source.channels[nth].conversion.unwrap();
        value * factor + offset
    };
    assert!((converted(0, 212.0) - 100.0).abs() < 1e-9);
    assert!((converted(1, 300.0) - 26.85).abs() < 1e-9);
    assert_eq!(converted(2, 1.5), 1500.0);
    assert_eq!(source.channels[3].conversion, None);
    let late: Vec<_> = source.channels.iter().map(|of| of.late).collect();
    assert_eq!(late, [secs(1.0), secs(1.0), secs(2.0), secs(1.0)]);
}

#[test]
fn the_clock_of_a_source_is_judged_as_written() {
    let clock = |text: &str| {
        let read = read(&format!("{TABLE}silent = \"10s\"\nclock = {text}\n")).unwrap();
        assert_eq!(read.sources[0].silent, secs(10.0));
        read.sources[0].clock
    };
    let rule = |otherwise| ClockRule {
        within: secs(5.0),
        otherwise,
    };
    let shift = clock(r#"{ within = "5s", else = "shift" }"#);
    assert_eq!(shift, Some(rule(ClockRemedy::Shift)));
    let refuse = clock(r#"{ within = "5s" }"#);
    assert_eq!(refuse, Some(rule(ClockRemedy::Refuse)));
}

#[test]
fn what_runtime_leaves_out_has_its_default_and_a_relative_state_starts_at_its_file() {
    assert_eq!(read(TABLE).unwrap().runtime, Runtime::default());
    let lines = format!(
        "{TABLE}[runtime]\nstate = \"state\"\nheartbeat = \"1s\"\njoin = \"20ms\"\nkeep = {{ at_most = \"500 MB\" }}\n"
    );
    let runtime = read(&lines).unwrap().runtime;
    assert_eq!(runtime.state.as_deref(), Some(Path::new("site/state")));
    assert_eq!(runtime.heartbeat, Some(secs(1.0)));
    assert_eq!(runtime.join, secs(0.02));
    assert_eq!(runtime.wait, secs(0.2));
    assert_eq!(runtime.keep.at_most.0, 500_000_000);
    assert_eq!(runtime.keep.checkpoints, 3);
}

#[test]
fn a_relative_path_of_a_source_starts_at_the_file_in_which_it_stands() {
    let folder = |lines: &str| read(lines).unwrap().sources.remove(0).folder;
    assert_eq!(folder(TABLE), Path::new("site"));
    let base = format!(
        "{}[sources.log]\ntype = \"test_table\"\npath = \"log.csv\"\n",
        MACHINE
    );
    let files = Memory::new().with("plant/base.toml", base).with(
        "site/machine.toml",
        "schema = 1\nextends = \"../plant/base.toml\"\n",
    );
    assert_eq!(
        read_from(&files).unwrap().sources[0].folder,
        Path::new("site/../plant")
    );
    let files = files.with(
        "site/machine.toml",
        "schema = 1\nextends = \"../plant/base.toml\"\nsources.log.path = \"own.csv\"\n",
    );
    assert_eq!(
        read_from(&files).unwrap().sources[0].folder,
        Path::new("site")
    );
}

#[test]
fn a_sink_is_given_outputs_by_name_column_or_pattern_and_all_without() {
    let outputs = |of: &str| {
        let lines = format!("{TABLE}[sinks.log]\ntype = \"test_log\"\n{of}");
        let read = read(&lines).unwrap();
        let sink = read.sinks.into_iter().next().unwrap();
        assert_eq!(sink.behind, None);
        assert_eq!(sink.rate, vec![None; sink.outputs.len()]);
        sink.outputs
    };
    let all = outputs("");
    assert_eq!(all.len(), 4);
    let [plate, room, x, y] = &all[..] else {
        panic!("{all:?}")
    };
    assert_eq!(outputs("outputs = \"correction\""), [x.clone(), y.clone()]);
    assert_eq!(
        outputs("outputs = [\"correction.{axis}*\", \"trend.r*\"]"),
        [x.clone(), y.clone(), room.clone()]
    );
    let column = outputs(&format!("outputs = [{plate:?}]"));
    assert_eq!(column, std::slice::from_ref(plate));
}

#[test]
fn a_command_is_recent_and_changes_at_most_at_its_rate_in_the_unit_of_each_output() {
    let stage = |more: &str| {
        let lines = format!(
            "{TABLE}[sinks.stage]\ntype = \"test_stage\"\noutputs = [\"correction\"]\n{more}"
        );
        let sink = read(&lines).unwrap().sinks.into_iter().next().unwrap();
        (sink.behind, sink.rate)
    };
    assert_eq!(stage(""), (Some(secs(5.0)), vec![None, None]));
    let (behind, rate) = stage("behind = \"2s\"\nrate = \"0.3 um/min\"\n");
    assert_eq!(behind, Some(secs(2.0)));
    assert_eq!(rate, [Some(5.0), Some(5.0)]);
    // What is said of a column holds, wherever it stands.
    let (_, rate) = stage("rate = { \"correction.Y*\" = \"2 nm/s\", correction = \"5 nm/s\" }\n");
    assert_eq!(rate, [Some(5.0), Some(2.0)]);
    let (_, rate) = stage("rate = { \"correction.Y*\" = \"2 nm/s\" }\n");
    assert_eq!(rate, [None, Some(2.0)]);
}
