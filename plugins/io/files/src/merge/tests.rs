use athermal_core::document::{Pattern, TableFormat};

use super::*;
use crate::TimeForm;

/// Files in a folder of their own.
struct Folder(PathBuf);

impl Folder {
    fn new(test: &str) -> Self {
        let name = format!("athermal-merge-{}-{test}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        std::fs::create_dir_all(&folder).unwrap();
        Self(folder)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Columns `a`, `b` and `z`; of a time `t` that is a number of seconds.
fn layout() -> Layout {
    Layout::new("t", TimeForm::SECONDS, ["a", "b", "z"])
}

/// Rows by their time and values, breaks as `|`.
fn read(
    test: &str,
    files: &[(&str, &str)],
    layout: Layout,
    options: &Options,
) -> Result<String, String> {
    let folder = Folder::new(test);
    let write = |(name, text): &(&str, &str)| {
        let path = folder.0.join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let paths: Vec<PathBuf> = files.iter().map(write).collect();
    let options = Options {
        offsets: (options.offsets.iter())
            .map(|(name, by)| (folder.0.join(name), *by))
            .collect(),
        ..options.clone()
    };
    let all = || -> Result<String, FileError> {
        let mut joint = Joint::open(&paths, layout, options)?;
        let (mut row, mut lines) = (Row::default(), String::new());
        loop {
            match joint.next_into(&mut row)? {
                Event::Row => {
                    let values = row.values.iter();
                    let values = values.map(|value| match value.is_nan() {
                        true => String::from("-"),
                        false => value.to_string(),
                    });
                    let values: Vec<String> = values.collect();
                    let time = row.time_ns % 100_000_000_000_000;
                    lines += &format!("{}:{} ", time as f64 / 1e9, values.join(","));
                }
                Event::Segment => lines += "| ",
                Event::End => break,
            }
        }
        let names = joint.reports().into_iter().map(|(name, _)| name);
        let given = paths.iter().map(|path| path.display().to_string());
        assert!(names.eq(given), "reports are in the order given");
        Ok(lines.trim_end().to_owned())
    };
    all().map_err(|error| {
        error
            .to_string()
            .replace(&format!("{}/", folder.0.display()), "")
    })
}

fn merged() -> Options {
    Options {
        merge: true,
        ..Options::default()
    }
}

const TEMPERATURES: &str = "t,a,b\n1700000000,1,2\n1700000010,3,4\n1700000020,5,6\n";
const POSITIONS: &str = "t,z\n1700000005,7\n1700000010,8\n1700000025,9\n";

#[test]
fn logs_of_different_columns_are_rows_in_the_order_of_time_whichever_is_named_first() {
    let rows = "0:1,2,- 5:-,-,7 10:3,4,8 20:5,6,- 25:-,-,9";
    for files in [
        [("a.csv", TEMPERATURES), ("z.csv", POSITIONS)],
        [("z.csv", POSITIONS), ("a.csv", TEMPERATURES)],
    ] {
        let files: Vec<_> = files.to_vec();
        if files[0].0 == "a.csv" {
            assert_eq!(
                read("order", &files, layout(), &Options::default()),
                Ok(rows.to_owned())
            );
        } else {
            let mut optional = layout();
            optional
                .channels
                .iter_mut()
                .for_each(|of| of.optional = true);
            let read = read("optional", &files, optional, &Options::default());
            assert_eq!(read, Ok(rows.to_owned()), "also where all are optional");
        }
    }
}

#[test]
fn each_log_may_be_several_files_and_of_either_format() {
    let parts = [
        (
            "z.jsonl",
            "{\"t\":1700000005,\"z\":7}\n{\"t\":1700000025,\"z\":9}\n",
        ),
        ("a2.csv", "t,b,a\n1700000020,6,5\n"),
        ("a1.csv", "t,a,b\n1700000000,1,2\n"),
    ];
    let rows = "0:1,2,- 5:-,-,7 20:5,6,- 25:-,-,9";
    assert_eq!(
        read("parts", &parts, layout(), &Options::default()),
        Ok(rows.to_owned())
    );
}

#[test]
fn what_is_added_to_the_times_of_a_file_moves_its_rows() {
    let options = Options {
        offsets: vec![("z.csv".into(), -5_000_000_000)],
        ..Options::default()
    };
    let files = [("a.csv", TEMPERATURES), ("z.csv", POSITIONS)];
    assert_eq!(
        read("offset", &files, layout(), &options).unwrap(),
        "0:1,2,7 5:-,-,8 10:3,4,- 20:5,6,9"
    );
}

#[test]
fn what_is_added_to_the_times_of_a_recipe_moves_the_instants_that_it_plans_too() {
    let mut layout = layout();
    layout.channels[1].is_instant = true;
    let log = ("z.csv", "t,z\n1700000000,1\n1700000010,2\n1700000020,3\n");
    let recipe = |from: u32| {
        let row = |at: u32| format!("{},{at},{}\n", from + at, from + at + 5);
        format!("t,a,b\n{}{}", row(0), row(10))
    };
    let rows = |test: &str, recipe: &str, by_s: i64| {
        let options = Options {
            offsets: vec![("recipe.csv".into(), by_s * 1_000_000_000)],
            ..Options::default()
        };
        let files = [log, ("recipe.csv", recipe)];
        read(test, &files, layout.clone(), &options).unwrap()
    };
    let expected = "0:0,1700000005,1 10:10,1700000015,2 20:-,-,3";
    assert_eq!(rows("recipe", &recipe(1_700_000_000), 0), expected);
    let behind = recipe(1_699_996_400);
    assert_eq!(rows("recipe-behind", &behind, 3600), expected);
}

#[test]
fn times_that_are_no_dates_are_merged_where_that_is_asked_for_alone() {
    let files = [
        ("a.csv", "t,a,b\n0,1,2\n10,3,4\n"),
        ("z.csv", "t,z\n0,7\n4,8\n"),
    ];
    let refused = read("undated", &files, layout(), &Options::default()).unwrap_err();
    assert!(refused.contains("`--merge`"), "{refused}");
    assert_eq!(
        read("undated-merged", &files, layout(), &merged()).unwrap(),
        "0:1,2,7 4:-,-,8 10:3,4,-"
    );
}

#[test]
fn segments_of_undated_logs_are_set_beside_each_other_if_there_are_as_many() {
    let files = [
        ("a1.csv", "t,a,b\n0,1,2\n10,3,4\n"),
        ("a2.csv", "t,a,b\n0,1,2\n10,3,4\n"),
        ("z1.csv", "t,z\n1,7\n"),
        ("z2.csv", "t,z\n1,8\n"),
    ];
    assert_eq!(
        read("segments", &files, layout(), &merged()).unwrap(),
        "0:1,2,- 1:-,-,7 10:3,4,- | 0:1,2,- 1:-,-,8 10:3,4,-"
    );
    let refused = read("fewer", &files[..3], layout(), &merged()).unwrap_err();
    assert!(refused.contains("2 segments"), "{refused}");
}

#[test]
fn a_segment_of_one_dated_log_is_one_of_all() {
    let mut layout = layout();
    layout.table.base.segment = Some("day".to_owned());
    let files = [
        ("a.csv", "t,a,b,day\n1700000000,1,2,x\n1700000010,3,4,y\n"),
        ("z.csv", "t,z\n1700000005,7\n1700000015,9\n"),
    ];
    assert_eq!(
        read("day", &files, layout, &Options::default()).unwrap(),
        "0:1,2,- 5:-,-,7 | 10:3,4,- 15:-,-,9"
    );
}

#[test]
fn a_log_that_begins_after_the_other_has_ended_is_refused_with_both_times() {
    let files = [("a.csv", TEMPERATURES), ("z.csv", "t,z\n1700003600,7\n")];
    let refused = read("apart", &files, layout(), &Options::default()).unwrap_err();
    let parts = [
        "z.csv begins at `1700003600`",
        "a.csv ends at `1700000020`",
        "--offset",
    ];
    assert!(parts.iter().all(|part| refused.contains(part)), "{refused}");
}

#[test]
fn a_column_in_two_logs_is_refused_by_its_name() {
    let files = [
        ("a.csv", "t,a,b\n1700000000,1,2\n"),
        ("z.csv", "t,b,z\n1700000000,7,1\n"),
    ];
    let refused = read("two", &files, layout(), &Options::default()).unwrap_err();
    assert!(
        refused.contains("`b` stands in a.csv and in z.csv"),
        "{refused}"
    );
    let same = [
        ("a.csv", "t,a,b,z\n0,1,2,3\n"),
        ("z.csv", "t,a,b,z\n0,1,2,3\n"),
    ];
    let refused = read("same", &same, layout(), &merged()).unwrap_err();
    assert!(
        refused.contains("`a` stands in a.csv and in z.csv"),
        "{refused}"
    );
}

#[test]
fn a_column_in_no_file_is_named_with_what_it_may_be_called() {
    let files = [
        ("a.csv", "t,a,b\n0,1,2\n"),
        ("z.csv", "t,z,height_mm\n0,7,8\n"),
    ];
    let mut layout = layout();
    layout.channels.push(ChannelColumn {
        column: "height_um".to_owned(),
        optional: false,
        is_instant: false,
    });
    let refused = read("none", &files, layout.clone(), &Options::default()).unwrap_err();
    let words =
        "a.csv, z.csv: no file has a column `height_um`; did you mean `height_mm` for `height_um`?";
    assert_eq!(refused, words);
    // One that files of another name would have.
    let table = TableFormat {
        rename: [("Value".to_owned(), "height_um".to_owned())].into(),
        ..TableFormat::default()
    };
    layout.table.files.push((Pattern::new("height*"), table));
    let refused = read("renamed", &files, layout, &Options::default()).unwrap_err();
    let more = "; `height_um` is `Value` of files named `height*` by `[[table.files]]`: is a file or its column called otherwise?";
    assert_eq!(refused, format!("{words}{more}"));
}

#[test]
fn files_of_one_logger_whose_times_start_again_are_refused_beside_another() {
    let files = [
        ("a1.csv", TEMPERATURES),
        ("a2.csv", "t,a,b\n1700000015,1,2\n"),
        ("z.csv", POSITIONS),
    ];
    let refused = read("again", &files, layout(), &Options::default()).unwrap_err();
    assert!(refused.contains("start again"), "{refused}");
}
