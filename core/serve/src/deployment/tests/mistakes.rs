use super::read;

const TABLE: &str = "[sources.table]\ntype = \"test_table\"\npath = \"a\"\n";

/// What is wrong with these lines: no more and no less.
fn assert_wrong(lines: &str, expected: &[&str]) {
    let found = read(lines).expect_err(lines);
    let fits = |(found, expected): (&String, &&str)| {
        let mut rest = found.as_str();
        expected.split(" … ").all(|part| {
            let at = rest.find(part);
            rest = at.map_or("", |at| &rest[at + part.len()..]);
            at.is_some()
        })
    };
    let fine = found.len() == expected.len() && found.iter().zip(expected).all(fits);
    assert!(fine, "{lines}\n{found:#?}\n{expected:#?}");
}

#[test]
fn a_file_without_sources_is_no_deployment() {
    assert_wrong("", &["A209 … declares no source"]);
}

#[test]
fn a_kind_or_key_that_there_is_not_is_reported_with_the_nearest() {
    assert_wrong(
        "[sources.a]\ntype = \"test_tabel\"\n",
        &["A200 at `\"test_tabel\"` … did you mean `test_table`?"],
    );
    assert_wrong(
        "[sources.a]\npath = \"a\"\n",
        &["A007 at … the source `a` needs the key \"type\""],
    );
    assert_wrong(
        &format!("{TABLE}chanels = [\"*\"]\n"),
        &["A006 at `chanels` … the source `table` has no key … did you mean \"channels\"?"],
    );
    assert_wrong(
        "[sources.a]\ntype = \"test_table\"\npth = \"a\"\n",
        &["A006 at `pth` … did you mean \"path\"?"],
    );
    assert_wrong(
        &format!("{TABLE}[sinks.b]\ntype = \"test_stag\"\n"),
        &["A200 … no kind of sink `test_stag` … did you mean `test_stage`?"],
    );
    assert_wrong(
        &format!("{TABLE}[sinks.b]\ntype = \"parquet\"\n"),
        &["A200 … no kind of sink `parquet` … a program that was built with `--features parquet`"],
    );
    // No program reads it as a source.
    assert_wrong(
        "[sources.a]\ntype = \"parquet\"\n",
        &["A200 … no kind of source `parquet` … kinds of sources in this program"],
    );
}

#[test]
fn a_kind_that_two_crates_bring_is_reported_and_only_where_it_is_used() {
    assert_wrong(
        "[sources.a]\ntype = \"test_twice\"\n",
        &[
            "A211 at `\"test_twice\"`: the kind of source `test_twice` is brought by several crates: `athermal-serve`, `athermal-serve`; leave one",
        ],
    );
}

#[test]
fn values_out_of_range_are_reported_at_their_place() {
    assert_wrong(
        &format!(
            "{TABLE}every = \"0s\"\nsilent = \"0s\"\nclock = {{ within = \"5s\", else = \"shft\" }}\n"
        ),
        &[
            "A010 at `\"0s\"`: `every` is 0s and must be greater than 0",
            "A009 at `\"shft\"` … did you mean \"shift\"?",
        ],
    );
}

#[test]
fn a_mapping_that_names_no_channel_is_reported_with_the_nearest() {
    let with = |channels: &str| format!("{TABLE}channels = {channels}\n");
    assert_wrong(
        &with(r#"["temprature.plate"]"#),
        &["A201 at `\"temprature.plate\"` … did you mean `temperature.plate`?"],
    );
    assert_wrong(
        &with(r#"["temperature.{axes}"]"#),
        &["A013 … no set \"axes\" … did you mean \"axis\"?"],
    );
    assert_wrong(
        &with(r#"{ "temperature.{axis}" = "T_{axis}" }"#),
        &["A201 … `temperature.X`", "A201 … `temperature.Y`"],
    );
    assert_wrong(
        &with(r#"{ "position.{axis}" = "s={axes}" }"#),
        &["A014 at `\"s={axes}\"` … the address of `position.{axis}` … did you mean \"{axis}\"?"],
    );
    assert_wrong(
        &with(r#"{ "position.{axis}" = "pos", "temperature.*" = "T_{channel}" }"#),
        &["A021 at `\"pos\"` … 2 channels"],
    );
    assert_wrong(
        &with(r#"{ "position.{axis}" = { frm = "pos" }, temperature.plate = 3 }"#),
        &[
            "A006 at `frm` … did you mean \"from\"?",
            "A008 at `3` … expected an address",
        ],
    );
    assert_wrong(
        &with("3"),
        &["A008 at `3` … a list of channels, or a table"],
    );
}

#[test]
fn a_channel_from_two_sources_or_from_none_is_reported() {
    let two = format!("{TABLE}channels = [\"*\"]\n");
    assert_wrong(
        &format!(
            "{two}[sources.bus]\ntype = \"test_bus\"\nchannels = {{ \"position.{{axis}}\" = \"{{axis}}\" }}\n"
        ),
        &[
            "A202 at `\"position.{axis}\"`: `position.X` and 1 more come already from the source `table`",
        ],
    );
    assert_wrong(
        &format!("{TABLE}[sources.other]\ntype = \"test_table\"\npath = \"b\"\n"),
        &[
            "A202 at `other`: `temperature.plate` and 3 more come already from the source `table` … without `channels`",
        ],
    );
    // The room is optional.
    assert_wrong(
        &format!("{TABLE}channels = [\"temperature.plate\"]\n"),
        &[
            "A203 at … no source gives `position.X` and 1 more … signals.position.optional = [\"X\"]",
        ],
    );
}

#[test]
fn a_bus_needs_addresses() {
    assert_wrong(
        "[sources.bus]\ntype = \"test_bus\"\n",
        &["A204 at `bus`: where `test_bus` finds `temperature.plate` and 3 more is not known"],
    );
    assert_wrong(
        "[sources.bus]\ntype = \"test_bus\"\nchannels = { \"*\" = { late = \"1s\" } }\n",
        &["A204 at `{ \"*\" … finds `temperature.plate`"],
    );
}

#[test]
fn a_unit_that_measures_something_else_is_reported_at_its_place() {
    assert_wrong(
        &format!(
            "{TABLE}channels = {{ \"temperature.*\" = {{ unit = \"mm\" }}, \"position.*\" = {{ unit = \"parsek\" }} }}\n"
        ),
        &[
            "A205 at `\"mm\"`: `temperature.plate` is in Cel, and mm measures something else",
            "A017 at `\"parsek\"`",
        ],
    );
}

#[test]
fn what_is_wrong_with_a_sink_is_reported_at_its_place() {
    let stage = |more: &str| format!("{TABLE}[sinks.s]\ntype = \"test_stage\"\n{more}\n");
    assert_wrong(
        &stage("outputs = [\"corection\"]"),
        &[
            "A206 at `\"corection\"`: the graph has no output `corection`; did you mean `correction`?",
        ],
    );
    assert_wrong(
        &stage("rate = \"5 nm/s\""),
        &["A207 at `\"5 nm/s\"`: `trend.plate … no rate of that; … one for each output"],
    );
    assert_wrong(
        &stage("outputs = [\"correction\"]\nrate = \"0 nm/s\""),
        &["A207 at `\"0 nm/s\"`"],
    );
    assert_wrong(
        &stage(
            "outputs = [\"correction\"]\nrate = { trend = \"1 K/min\", corection = \"5 nm/s\" }",
        ),
        &[
            "A206 at `trend`: the sink is given no output `trend`",
            "A206 at `corection`: the graph has no output",
        ],
    );
    assert_wrong(
        &stage("outputs = [\"correction\"]\nrate = 5"),
        &["A008 at `5` … a quantity"],
    );
    assert_wrong(
        &format!(
            "{TABLE}[sinks.s]\ntype = \"test_log\"\nrate = \"1 nm/s\"\nbehind = \"5s\"\noutputs = [\"correction\"]\n"
        ),
        &[
            "A208 at `rate`: `rate` has no meaning for `test_log`",
            "A208 at `behind`",
        ],
    );
}

#[test]
fn what_is_wrong_with_runtime_is_reported_at_its_place() {
    assert_wrong(
        &format!("{TABLE}[runtime]\nheartbeat = 1\nhartbeat = \"1s\"\n"),
        &[
            "A008 at `1`: expected a duration",
            "A006 at `hartbeat` … did you mean \"heartbeat\"?",
        ],
    );
    assert_wrong(
        &format!("{TABLE}[runtime]\nsync = \"0s\"\nkeep = {{ checkpoints = 0 }}\n"),
        &[
            "A010 at `\"0s\"`: `sync` is 0s and must be greater than 0",
            "A010 at `0`: `checkpoints` is 0 and must be 1 or more",
        ],
    );
    assert_wrong(
        &format!("{TABLE}[runtime]\nkeep = {{ at_most = \"20\" }}\n"),
        &["A010 at `\"20\"`: \"at_most\" is refused: a size is a number and a unit of bytes"],
    );
}
