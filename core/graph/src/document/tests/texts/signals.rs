//! Texts of mistakes in times, units and signals.

use super::rendered;

#[test]
fn a_missing_unit_is_asked_for() {
    let files = [(
        "a.toml",
        r#"schema = 1
[signals.p]
channels = ["a"]
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A007]: signal "p" needs the key "unit"
 --> a.toml:2:1
  |
2 | [signals.p]
  | ^^^^^^^^^^^ "unit" is missing
  |
  = help: write a UCUM unit, e.g. unit = "nm", or "1" if it has none
"#
    );
}

#[test]
fn a_bare_number_is_no_duration() {
    let files = [(
        "a.toml",
        r#"schema = 1
[signals.p]
unit = "nm"
channels = ["a", "b"]
max_age = 5
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A008]: expected a duration like "5min" for "max_age", found the number 5
 --> a.toml:5:11
  |
5 | max_age = 5
  |           ^ expected a duration like "5min"
  |
  = help: a duration needs a unit, e.g. "5min"
"#
    );
}

#[test]
fn a_bare_number_is_no_quantity() {
    let files = [(
        "a.toml",
        r#"schema = 1
[signals.p]
unit = "nm"
channels = ["a", "b"]
range = [0, 5.5]
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A008]: expected a quantity in nm for "range", found the number 0
 --> a.toml:5:10
  |
5 | range = [0, 5.5]
  |          ^ expected a quantity in nm
  |
  = help: write "0 nm"

error[A008]: expected a quantity in nm for "range", found the number 5.5
 --> a.toml:5:13
  |
5 | range = [0, 5.5]
  |             ^^^ expected a quantity in nm
  |
  = help: write "5.5 nm"
"#
    );
}

#[test]
fn an_unknown_unit_of_time_gets_the_choices() {
    let files = [(
        "a.toml",
        r#"schema = 1
[time]
unit = "fortnight"
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A009]: "fortnight" is not a choice for "unit"
 --> a.toml:3:8
  |
3 | unit = "fortnight"
  |        ^^^^^^^^^^^ not a choice
  |
  = help: the choices are "ns", "us", "ms", "s", "min", "h", "d", "sample", "rfc3339"
"#
    );
}

#[test]
fn a_format_says_a_whole_time_and_stands_alone() {
    let files = [(
        "a.toml",
        r#"schema = 1
[time]
unit = "ms"
format = "%H:%M:%S"
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A024]: `format` has no meaning with unit = "ms"
 --> a.toml:4:1
  |
4 | format = "%H:%M:%S"
  | ^^^^^^
  |
  = help: leave out one of the two

error[A010]: "format" is refused: it does not give a whole date and time; write year, month, day, hour and minute as strptime does, e.g. "%d.%m.%Y %H:%M:%S"
 --> a.toml:4:10
  |
4 | format = "%H:%M:%S"
  |          ^^^^^^^^^^ refused
"#
    );
}

#[test]
fn a_zone_is_one_that_there_is_and_stands_beside_dates() {
    let files = [(
        "a.toml",
        r#"schema = 1
[time]
unit = "ms"
zone = "berlin"
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A024]: `zone` has no meaning with times that are numbers
 --> a.toml:4:1
  |
4 | zone = "berlin"
  | ^^^^
  |
  = help: leave it out; dates and times have one, by `unit = "rfc3339"` or a `format` without `%z`

error[A010]: "zone" is refused: there is no such time zone; did you mean "Europe/Berlin"? Write one of the tz database such as "Europe/Berlin", or an offset such as "+01:00"
 --> a.toml:4:8
  |
4 | zone = "berlin"
  |        ^^^^^^^^ refused
"#
    );
}

#[test]
fn braces_in_the_column_of_time_name_columns_each_once() {
    let files = [(
        "a.toml",
        r#"schema = 1
[time]
column = "{Date} {Time"
format = "%d.%m.%Y %H:%M:%S"
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A010]: "column" is refused: a brace is not closed in `{Time`; write the name of one column, or of several each in braces, e.g. "{Date} {Time}"
 --> a.toml:3:10
  |
3 | column = "{Date} {Time"
  |          ^^^^^^^^^^^^^^ refused
"#
    );
}

#[test]
fn a_step_is_longer_than_zero() {
    let files = [(
        "a.toml",
        r#"schema = 1
[time]
step = "0s"
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A010]: the step from one sample to the next is longer than 0
 --> a.toml:3:8
  |
3 | step = "0s"
  |        ^^^^
"#
    );
}

#[test]
fn a_step_excludes_a_unit() {
    let files = [(
        "a.toml",
        r#"schema = 1
[time]
unit = "ms"
step = "1s"
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A024]: `step` has no meaning with unit = "ms"
 --> a.toml:4:1
  |
4 | step = "1s"
  | ^^^^
  |
  = help: leave out `step`, or write `unit = "sample"`
"#
    );
}

#[test]
fn an_unknown_unit_gets_the_nearest_one() {
    let files = [(
        "a.toml",
        r#"schema = 1
[signals.p]
unit = "nm/mn"
channels = ["a"]
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A017]: "mn" in "nm/mn" is not a unit that UCUM knows
 --> a.toml:3:8
  |
3 | unit = "nm/mn"
  |        ^^^^^^^ not a unit
  |
  = help: write the unit as "nm/min"
"#
    );
}

#[test]
fn a_temperature_rate_is_in_kelvin() {
    let files = [(
        "a.toml",
        r#"schema = 1
[signals.p]
unit = "degC/min"
channels = ["a"]
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A017]: "degC/min" has a temperature scale in a compound, where only differences have a meaning
 --> a.toml:3:8
  |
3 | unit = "degC/min"
  |        ^^^^^^^^^^ not a unit
  |
  = help: write the unit as "K/min"
"#
    );
}

#[test]
fn a_wrong_duration_says_which_units_there_are() {
    let files = [(
        "a.toml",
        r#"schema = 1
[signals.p]
unit = "nm"
channels = ["a", "b"]
max_age = "5 minuets"
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A018]: "minuets" is not a unit of time; the units are ns, us, ms, s, min (or m), h and d
 --> a.toml:5:11
  |
5 | max_age = "5 minuets"
  |           ^^^^^^^^^^^ not a duration
"#
    );
}

#[test]
fn a_wrong_quantity_says_what_is_missing() {
    let files = [(
        "a.toml",
        r#"schema = 1
[signals.p]
unit = "nm"
channels = ["a", "b"]
range = ["0", "5 nn"]
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A008]: expected a quantity in nm for "range", found the text "0"
 --> a.toml:5:10
  |
5 | range = ["0", "5 nn"]
  |          ^^^ expected a quantity in nm
  |
  = help: write "0 nm"

error[A018]: "nn" is not a unit that UCUM knows
 --> a.toml:5:15
  |
5 | range = ["0", "5 nn"]
  |               ^^^^^^ the unit is not known
  |
  = help: write the unit as "nm"
"#
    );
}

#[test]
fn samples_need_a_sample_time() {
    let files = [(
        "a.toml",
        r#"schema = 1
[signals.p]
unit = "nm"
channels = ["a", "b"]
max_age = "2 samples"
[nodes.n]
type = "lag"
by = ["1 sample"]
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A020]: "2 samples" counts samples, and the time of this graph does not
 --> a.toml:5:11
  |
5 | max_age = "2 samples"
  |           ^^^^^^^^^^^
  |
  = help: write a duration like "5min", or count samples: `[time] unit = "sample"`

error[A020]: "1 sample" counts samples, and the time of this graph does not
 --> a.toml:8:7
  |
8 | by = ["1 sample"]
  |       ^^^^^^^^^^
  |
  = help: write a duration like "5min", or count samples: `[time] unit = "sample"`
"#
    );
}

#[test]
fn a_number_of_samples_that_a_member_makes_is_told_once_for_all_members() {
    let files = [(
        "a.toml",
        r#"schema = 1
[sets]
n = ["1", "2"]
[nodes.late]
type = "lag"
each = "n"
by = ["{n} samples"]
inputs.x = { from = "y", max_age = "{n}" }
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A020]: "1 samples" counts samples, and the time of this graph does not
 --> a.toml:7:7
  |
7 | by = ["{n} samples"]
  |       ^^^^^^^^^^^^^
  |
  = note: node `late`, member `1`, and 1 more member
  = help: write a duration like "5min", or count samples: `[time] unit = "sample"`

error[A018]: the number 1 needs a unit of time, e.g. "1s"; the units are ns, us, ms, s, min (or m), h and d
 --> a.toml:8:36
  |
8 | inputs.x = { from = "y", max_age = "{n}" }
  |                                    ^^^^^ not a duration
  |
  = note: node `late`, member `1`, and 1 more member
"#
    );
}

#[test]
fn several_channels_need_several_columns() {
    let files = [(
        "a.toml",
        r#"schema = 1
[signals.p]
unit = "nm"
channels = ["a", "b"]
column = "pos"
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A021]: 2 channels would all be read from the column "pos"
 --> a.toml:5:10
  |
5 | column = "pos"
  |          ^^^^^
  |
  = help: put `{channel}` into the pattern
"#
    );
}

#[test]
fn a_column_pattern_knows_only_the_channel() {
    let files = [(
        "a.toml",
        r#"schema = 1
[signals.p]
unit = "nm"
channels = ["a", "b"]
column = "{channel}_{axis}"
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A014]: "{axis}" stands for nothing in a column of signal "p"
 --> a.toml:5:10
  |
5 | column = "{channel}_{axis}"
  |          ^^^^^^^^^^^^^^^^^^ stands for nothing
  |
  = help: it may be "{channel}"
"#
    );
}

#[test]
fn a_range_is_in_the_unit_of_its_signal() {
    let files = [(
        "a.toml",
        r#"schema = 1
[signals.p]
unit = "nm"
channels = ["a", "b"]
range = ["0 K", "5 um"]
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A022]: the range is in "K", which does not convert to the signal's unit "nm"
 --> a.toml:5:10
  |
5 | range = ["0 K", "5 um"]
  |          ^^^^^ does not convert to nm
  |
  = help: write it in nm, or correct the signal's unit
"#
    );
}

#[test]
fn a_range_has_its_low_end_first() {
    let files = [(
        "a.toml",
        r#"schema = 1
[signals.p]
unit = "nm"
channels = ["a", "b"]
range = ["1 um", "5 nm"]
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A022]: the range from 1000 nm to 5 nm contains nothing
 --> a.toml:5:9
  |
5 | range = ["1 um", "5 nm"]
  |         ^^^^^^^^^^^^^^^^
  |
  = help: write the lower limit first
"#
    );
}

#[test]
fn a_range_has_two_ends() {
    let files = [(
        "a.toml",
        r#"schema = 1
[signals.p]
unit = "nm"
channels = ["a", "b"]
range = ["1 um"]
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A008]: expected a list of two quantities, the low end first for "range", found a list of 1 value
 --> a.toml:5:9
  |
5 | range = ["1 um"]
  |         ^^^^^^^^ expected a list of two quantities, the low end first
"#
    );
}

#[test]
fn an_optional_channel_is_one_of_the_signal() {
    let files = [(
        "a.toml",
        r#"schema = 1
[signals.p]
unit = "nm"
channels = ["a", "b"]
optional = ["c"]
"#,
    )];
    assert_eq!(
        rendered(&files),
        r#"
error[A023]: signal "p" has no channel "c"
 --> a.toml:5:13
  |
5 | optional = ["c"]
  |             ^^^ not a channel
  |
  = help: its channels are "a", "b"
"#
    );
}
