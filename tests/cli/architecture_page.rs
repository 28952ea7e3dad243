//! The page on the architecture names files that are there.

use std::path::Path;

#[test]
fn every_path_on_the_page_of_the_architecture_is_there() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(root.join("docs/src/architecture.md")).unwrap();
    let of_the_tree = |path: &&str| {
        let folders = ["core/", "plugins/", "src/", "tests/", "graphs/", ".ci/"];
        folders.iter().any(|folder| path.starts_with(folder)) && !path.contains('*')
    };
    let quoted = page.split('`').skip(1).step_by(2);
    let paths: Vec<_> = quoted.filter(of_the_tree).collect();
    let missing: Vec<_> = paths
        .iter()
        .filter(|path| !root.join(path).exists())
        .collect();
    assert!(paths.len() > 20, "{paths:?}");
    assert!(missing.is_empty(), "{missing:?}");
}
