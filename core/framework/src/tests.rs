//! The path of a reader, as the page of this crate names it, is short enough for an afternoon.

use std::fs;
use std::path::Path;

const MOST: usize = 8_000;

/// The files of the path, in order.
fn path(page: &str) -> Vec<String> {
    let (_, path) = page.split_once("# The afternoon").unwrap();
    let (_, path) = path.split_once("```text\n").unwrap();
    let (path, _) = path.split_once("//! ```").unwrap();
    let lines = path.lines().map(|line| line.trim_start_matches("//! "));
    lines
        .flat_map(|line| {
            let (folder, files) = line.split_once(' ').unwrap();
            let files = files.split_whitespace();
            files.map(move |file| format!("{folder}/{file}.rs"))
        })
        .collect()
}

/// Lines that are neither blank nor comment, up to the tests at the end of a file.
fn lines(source: &str) -> usize {
    let code = source
        .split("#[cfg(test)]\nmod tests {")
        .next()
        .unwrap_or_default();
    let lines = code.lines().map(str::trim_start);
    lines
        .filter(|line| !line.is_empty() && !line.starts_with("//"))
        .count()
}

#[test]
fn the_path_of_a_reader_is_an_afternoon_long() {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let read = |file: &str| fs::read_to_string(sources.join(file)).unwrap();
    let files = path(&read("lib.rs"));
    assert!(files.len() > 30, "{files:?}");
    let sum: usize = files.iter().map(|file| lines(&read(file))).sum();
    assert!(sum > 1_000 && sum <= MOST, "{sum} lines of code");
    println!(
        "the afternoon: {sum} lines of code in {} files",
        files.len()
    );
}
