//! What ARCHITECTURE.md says of the sources: the paths that it names, the pictures of modules.

use std::path::{Path, PathBuf};

use yawara_tests::module_graph::pictures;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The paths in backticks: what has a slash and nothing that paths have not.
fn paths(text: &str) -> Vec<&str> {
    let is_path = |code: &&str| {
        let plain = |c: char| c.is_ascii_alphanumeric() || "/._-".contains(c);
        code.contains('/') && code.chars().all(plain)
    };
    text.split('`').skip(1).step_by(2).filter(is_path).collect()
}

#[test]
fn every_path_in_it_exists() {
    let text = std::fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let prose: String = text.split("```").step_by(2).collect();
    let paths = paths(&prose);
    assert!(paths.len() > 60, "{paths:?}");
    let missing: Vec<&str> = paths.into_iter().filter(|path| !root().join(path).exists()).collect();
    assert!(missing.is_empty(), "ARCHITECTURE.md names what is not there: {missing:?}");
}

#[test]
fn the_pictures_are_current() {
    let folder = root().join("docs/picture/modules");
    let stale: Vec<String> = pictures(&root())
        .unwrap()
        .into_iter()
        .filter(|(name, svg)| std::fs::read_to_string(folder.join(name)).ok().as_ref() != Some(svg))
        .map(|(name, _)| name)
        .collect();
    let command = "cargo run -p yawara-tests --bin modules -- --svg docs/picture/modules";
    assert!(stale.is_empty(), "{stale:?} are not of these sources; make them with\n{command}");
}

#[test]
fn paths_are_told_from_other_code() {
    let text = "`a/b.rs` and `Stages::x`, `run -- --x a/b`, `m/` `http://x`, `f(x)/2`";
    assert_eq!(paths(text), ["a/b.rs", "m/"]);
}
