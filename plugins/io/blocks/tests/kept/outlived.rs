//! Kept blocks outlive a call that fails, raw rows that are gone, and a change of one of two logs.

use super::*;

#[test]
fn a_call_that_fails_leaves_blocks_as_they_are_and_those_whose_rows_are_gone_stay() {
    let folder = Folder::of("failing");
    let model = folder.model(GRAPH);
    let mut days = days(5);
    let mut files: Vec<PathBuf> = (0..4)
        .map(|nth| folder.file(&format!("day{nth}.csv"), text(&days[nth..=nth])))
        .collect();
    let blocks = folder.0.join("blocks");
    let names = |days: std::ops::RangeInclusive<u32>| -> Vec<String> {
        days.map(|day| format!("1970-01-0{day}.json")).collect()
    };
    let contents = || {
        names(1..=4)
            .iter()
            .map(|name| std::fs::read(blocks.join(name)).unwrap())
            .collect::<Vec<_>>()
    };
    let of_all = kept(&blocks, &model, &files).0;
    let before = contents();
    // A day changes and another graph asks for all: neither call comes to its end.
    let last = days[3].clone();
    let half = last[..last.len() / 2].rfind('\n').unwrap() + 1;
    days[3].truncate(half);
    folder.file("day3.csv", text(&days[3..=3]));
    let refresh = |model: &Model, files: &[PathBuf], fails: bool| {
        KeptBlocks::refresh(
            &blocks,
            &model.plan,
            DAY,
            files,
            "",
            &|files, _| data(&files),
            &mut |data, wanted, take| {
                blocks_of(&model.plan, data, DAY, wanted, &mut |_| {}, take)?;
                match fails {
                    true => Err(FitError::Recording("the disk went away".into())),
                    false => Ok(()),
                }
            },
        )
    };
    let other = folder.model(&GRAPH.replace("\"20min\"", "\"30min\""));
    for model in [&model, &other] {
        assert!(refresh(model, &files, true).is_err());
        assert_eq!(contents(), before);
    }
    days[3] = last;
    folder.file("day3.csv", text(&days[3..=3]));
    assert_eq!(kept(&blocks, &model, &files), (of_all.clone(), 0));
    // The raw rows of two days are deleted, and a day comes.
    files[..2]
        .iter()
        .for_each(|file| std::fs::remove_file(file).unwrap());
    let found = refresh(&model, &files[2..], false).unwrap();
    assert_eq!((found.made, &found.lost), (0, &names(1..=2)));
    let fit = |blocks: &KeptBlocks| {
        let fitted = fit_from_blocks(&model.plan, blocks, &FitOptions::default(), &mut |_| {});
        text_of(&fitted.unwrap().0)
    };
    assert_eq!(fit(&found), of_all);
    files.push(folder.file("day4.csv", text(&days[4..=4])));
    let found = refresh(&model, &files[2..], false).unwrap();
    assert_eq!((found.made, &found.lost), (1, &names(1..=2)));
    let all = [folder.file("whole.csv", text(&days))];
    assert_eq!(fit(&found), text_of(&on_blocks(&model, &all).0));
}

#[test]
fn one_of_two_logs_that_are_merged_may_change_alone() {
    let folder = Folder::of("merged");
    let model = folder.model(GRAPH);
    let part = |name: &str, rows: &[String], columns: &[usize]| {
        let text = text(rows);
        let rows = text.lines().map(|row| {
            let cells: Vec<&str> = row.split(',').collect();
            let cells: Vec<&str> = columns.iter().map(|&nth| cells[nth]).collect();
            cells.join(",") + "\n"
        });
        folder.file(name, rows.collect::<String>())
    };
    let days = days(4);
    let (temperatures, position) = ([0, 1, 2, 3], [0, 4]);
    let mut files: Vec<PathBuf> = Vec::new();
    for (nth, day) in days.chunks(1).enumerate() {
        files.push(part(&format!("t{nth}.csv"), day, &temperatures));
        files.push(part(&format!("z{nth}.csv"), day, &position));
    }
    let options = Options {
        merge: true,
        ..Options::default()
    };
    let blocks = folder.0.join("blocks");
    let of_all = |files: &[PathBuf]| kept_with(&folder.0.join("fresh"), &model, files, &options).0;
    assert_eq!(kept_with(&blocks, &model, &files, &options).1, 4);
    // The position of the second day ends at noon.
    let short = days[1].lines().take(1440).map(|row| format!("{row}\n"));
    part("z1.csv", &[short.collect::<String>()], &position);
    let (fitted, made) = kept_with(&blocks, &model, &files, &options);
    assert_eq!(made, 2);
    assert_eq!(fitted, of_all(&files));
    let (fitted, made) = kept_with(&blocks, &model, &files[2..], &options);
    assert_eq!((fitted, made), (of_all(&files[2..]), 1));
}
