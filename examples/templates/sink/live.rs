//! The sink keeps the rules of every sink, and the largest values.

use std::fs;
use std::path::PathBuf;

use athermal_serve::testkit::{assert_sink, check_again, open_sink, put};
use my_node::MyNode;

/// An empty folder of its own.
fn folder(name: &str) -> PathBuf {
    let name = format!("my-node-{name}-{}", std::process::id());
    let folder = std::env::temp_dir().join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

#[test]
fn it_keeps_the_rules_of_every_sink() {
    let folder = folder("rules");
    assert_sink(&MyNode::new("largest.txt"), &folder, &["a", "b"]);
}

#[test]
fn the_largest_values_are_kept_also_across_a_restart() {
    let (folder, sink) = (folder("restart"), MyNode::new("largest.txt"));
    for second in [7, 3] {
        let mut outlet = open_sink(&sink, &folder, &["a", "b"]).unwrap();
        put(&mut *outlet, second, 2).unwrap();
        outlet.flush().unwrap();
    }
    let text = fs::read_to_string(folder.join("largest.txt")).unwrap();
    assert_eq!(text, "a 7\nb 8\n");
}

#[test]
fn a_folder_that_is_gone_is_reported_and_the_row_is_taken_again() {
    let folder = folder("gone");
    let mut outlet = open_sink(&MyNode::new("largest.txt"), &folder, &["a"]).unwrap();
    let fail = |fails: bool| {
        let _ = match fails {
            true => fs::remove_dir_all(&folder),
            false => fs::create_dir_all(&folder),
        };
    };
    check_again(&mut *outlet, 1, fail).unwrap();
}
