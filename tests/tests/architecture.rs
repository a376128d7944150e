//! What the documents say of the sources and of each other: paths in ARCHITECTURE.md and all others,
//! links, the pages of the book, the pictures of modules.

use std::path::{Path, PathBuf};

use yawara_tests::module_graph::{packages, pictures};

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

/// ARCHITECTURE.md and the others: at the root, in `docs` and in each crate.
fn documents() -> Vec<PathBuf> {
    let entries = |folder: PathBuf| std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries(root()).map(|entry| entry.path()).collect();
    files.extend(entries(root().join("docs")).map(|entry| entry.path()));
    let packages = packages(&root()).unwrap();
    files.extend(packages.iter().map(|package| root().join(&package.folder).join("README.md")));
    // What has been, the changelog may name.
    files.retain(|file| file.extension().is_some_and(|end| end == "md"));
    files.retain(|file| !file.ends_with("CHANGELOG.md"));
    files
}

#[test]
fn every_path_in_the_documents_exists() {
    let mut folders: Vec<String> =
        packages(&root()).unwrap().into_iter().map(|package| package.folder).collect();
    folders.extend(["docs".to_owned(), ".ci".to_owned()]);
    let (mut checked, mut missing) = (0, Vec::new());
    for document in documents() {
        let text = std::fs::read_to_string(&document).unwrap();
        let prose: String = text.split("```").step_by(2).collect();
        for path in paths(&prose) {
            let folder = path.split('/').next().unwrap_or_default();
            if folders.iter().any(|ours| ours == folder) {
                checked += 1;
                if !root().join(path).exists() && !document.with_file_name(path).exists() {
                    missing.push(format!("{} names {path}", document.display()));
                }
            }
        }
    }
    assert!(checked > 100, "only {checked} paths were found");
    assert!(missing.is_empty(), "what is not there:\n{}", missing.join("\n"));
}

/// Where links outside of code go, but those to other sites.
fn links(text: &str) -> Vec<&str> {
    let prose = text.split("```").step_by(2).flat_map(|part| part.split("](").skip(1));
    let targets = prose.filter_map(|rest| rest.split(')').next());
    targets.filter(|target| !target.contains("://")).collect()
}

/// The anchor that GitHub and mdBook give a heading; the second of two alike would have another.
fn anchor(heading: &str) -> String {
    let kept = |c: &char| c.is_alphanumeric() || " -_".contains(*c);
    let letters = heading.trim_start_matches('#').trim().chars().filter(kept);
    letters.collect::<String>().to_lowercase().replace(' ', "-")
}

#[test]
fn every_link_in_the_documents_leads_somewhere() {
    let (mut checked, mut dead) = (0, Vec::new());
    for document in documents() {
        let is_in_book = document.parent().is_some_and(|folder| folder.ends_with("docs"));
        let text = std::fs::read_to_string(&document).unwrap();
        for link in links(&text) {
            let (file, heading) = link.split_once('#').unwrap_or((link, ""));
            let target = match file {
                "" => document.clone(),
                file => document.with_file_name(file),
            };
            let leads = target.exists() && !(is_in_book && file.starts_with("../"));
            let lines = std::fs::read_to_string(&target).unwrap_or_default();
            let mut headings = lines.lines().filter(|line| line.starts_with('#'));
            if !leads || !heading.is_empty() && !headings.any(|line| anchor(line) == heading) {
                dead.push(format!("{} links {link}", document.display()));
            }
            checked += 1;
        }
    }
    assert!(checked > 100, "only {checked} links were found");
    assert!(dead.is_empty(), "what leads nowhere, or out of the book:\n{}", dead.join("\n"));
}

#[test]
fn every_page_is_in_the_book() {
    let folder = root().join("docs");
    let summary = std::fs::read_to_string(folder.join("SUMMARY.md")).unwrap();
    let mut listed = links(&summary);
    listed.sort_unstable();
    let entries = std::fs::read_dir(folder).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut pages: Vec<String> =
        names.filter(|name| name.ends_with(".md") && name != "SUMMARY.md").collect();
    pages.sort_unstable();
    assert_eq!(listed, pages);
}

/// Traits are quoted with the file that they stand in as a comment before them.
#[test]
fn every_line_that_is_quoted_stands_in_its_file() {
    let text = std::fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let quotes = text.split("```rust\n// ").skip(1);
    let mut quoted = 0;
    for quote in quotes.map(|quote| quote.split("```").next().unwrap()) {
        let (file, lines) = quote.split_once('\n').unwrap();
        let source = std::fs::read_to_string(root().join(file)).unwrap();
        for line in lines.lines().map(str::trim) {
            assert!(source.lines().any(|found| found.trim() == line), "{file} lacks: {line}");
        }
        quoted += 1;
    }
    assert!(quoted >= 5, "only {quoted} quotes");
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

#[test]
fn links_are_told_from_code_and_headings_have_their_anchors() {
    let text = "[a](b.md#c-d), ![e](f.png) [g](https://h)\n```\n[i](j)\n```\n[k](#l)";
    assert_eq!(links(text), ["b.md#c-d", "f.png", "#l"]);
    assert_eq!(anchor("## A hand, `x_y` (2 × 3)"), "a-hand-x_y-2--3");
}

/// Where a package names the roots of its tests, a file that none of them has as a module is never run.
#[test]
fn every_test_file_is_run() {
    let mut checked = 0;
    for folder in ["sim", "tests"].map(|package| root().join(package).join("tests")) {
        let manifest = std::fs::read_to_string(folder.join("../Cargo.toml")).unwrap();
        let manifest: toml::Table = manifest.parse().unwrap();
        assert_eq!(manifest["package"]["autotests"].as_bool(), Some(false), "{}", folder.display());
        let roots = manifest["test"].as_array().unwrap().iter();
        let roots: Vec<_> = roots.map(|test| test["path"].as_str().unwrap()).collect();
        let sources =
            roots.iter().map(|root| std::fs::read_to_string(folder.join("..").join(root)));
        let modules: String = sources.map(Result::unwrap).collect();
        for file in std::fs::read_dir(&folder).unwrap() {
            let name = file.unwrap().file_name().into_string().unwrap();
            let Some(module) = name.strip_suffix(".rs") else { continue };
            let is_root = roots.iter().any(|root| *root == format!("tests/{name}"));
            let times = modules.lines().filter(|line| *line == format!("mod {module};")).count();
            assert_eq!(times + usize::from(is_root), 1, "how often {name} is run");
            checked += 1;
        }
    }
    assert!(checked > 60, "only {checked} files were found");
}
