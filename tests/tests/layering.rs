//! Who may import whom: crates by the table of the workspace, checked against `cargo metadata`; files
//! of a crate without circles, checked against the sources.

use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use yawara_tests::module_graph::{package_graph, packages};

/// One row of the table: what a package may import of ours, always or behind a feature.
struct Row {
    package: &'static str,
    imports: &'static [&'static str],
    /// Only as an optional dependency, and never by default.
    optional: &'static [&'static str],
}

/// Nobody may import `yawara-bench` or `yawara-tests`, so no row names them on the right.
const TABLE: &[Row] = &[
    Row { package: "yawara-mesh", imports: &[], optional: &[] },
    Row { package: "yawara-inverse-update", imports: &[], optional: &[] },
    Row { package: "yawara-embed", imports: &["yawara-mesh"], optional: &[] },
    Row { package: "yawara-corot", imports: &["yawara-mesh", "yawara-embed"], optional: &[] },
    Row { package: "yawara-gpu", imports: &["yawara-inverse-update"], optional: &[] },
    Row { package: "yawara-petsc", imports: &[], optional: &[] },
    Row { package: "yawara", imports: STAGES, optional: &["yawara-gpu"] },
    Row { package: "yawara-bench", imports: LIBRARIES, optional: &["yawara-petsc"] },
    Row { package: "yawara-tests", imports: LIBRARIES, optional: LIBRARIES },
];

const STAGES: &[&str] = &["yawara-mesh", "yawara-embed", "yawara-corot", "yawara-inverse-update"];

const LIBRARIES: &[&str] = &[
    "yawara-mesh",
    "yawara-embed",
    "yawara-corot",
    "yawara-inverse-update",
    "yawara-gpu",
    "yawara",
];

/// What `cargo metadata` says of this workspace.
fn metadata() -> Value {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("../Cargo.toml");
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline", "--manifest-path"])
        .arg(manifest)
        .output()
        .expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("cargo metadata prints JSON")
}

fn list<'a>(value: &'a Value, key: &str) -> &'a [Value] {
    value[key].as_array().unwrap_or_else(|| panic!("no array {key:?} in cargo's answer"))
}

fn text<'a>(value: &'a Value, key: &str) -> &'a str {
    value[key].as_str().unwrap_or_else(|| panic!("no string {key:?} in cargo's answer"))
}

/// Whether a package is of this workspace, by its name; one without a row counts too.
fn is_ours(name: &str) -> bool {
    name == "yawara" || name.starts_with("yawara-")
}

/// Every breach of the table, one sentence each; dependencies of all kinds (normal, dev, build,
/// per target) count alike.
fn breaches(metadata: &Value) -> Vec<String> {
    let mut found = Vec::new();
    let packages = list(metadata, "packages");
    let names: BTreeSet<&str> = packages.iter().map(|package| text(package, "name")).collect();
    for row in TABLE {
        if !names.contains(row.package) {
            found.push(format!("{} is in the table but not in the workspace", row.package));
        }
    }
    for package in packages {
        let name = text(package, "name");
        match TABLE.iter().find(|row| row.package == name) {
            Some(row) => found.extend(breaches_of(row, package)),
            None => found.push(format!("{name} has no row in the table")),
        }
    }
    found
}

fn breaches_of(row: &Row, package: &Value) -> Vec<String> {
    let mut found = Vec::new();
    for dependency in list(package, "dependencies") {
        let import = text(dependency, "name");
        let optional = dependency["optional"].as_bool().expect("cargo says what is optional");
        if is_ours(import) {
            let may = row.imports.contains(&import);
            let may_optionally = row.optional.contains(&import);
            if !may && may_optionally && !optional {
                found.push(format!("{} imports {import}, which must be optional", row.package));
            } else if !may && !may_optionally {
                found.push(format!("{} may not import {import}", row.package));
            }
        }
        if import == "wgpu" && row.package != "yawara-gpu" {
            found.push(format!("{} imports wgpu, which belongs to yawara-gpu", row.package));
        }
    }
    for import in row.optional.iter().filter(|import| !row.imports.contains(import)) {
        if switched_on_by_default(package, import) {
            found.push(format!("{} switches {import} on by default", row.package));
        }
    }
    found
}

/// Whether the feature `default`, followed through the features it names, reaches `import`.
fn switched_on_by_default(package: &Value, import: &str) -> bool {
    let mut seen = BTreeSet::new();
    let mut open = vec!["default"];
    while let Some(feature) = open.pop() {
        if !seen.insert(feature) {
            continue;
        }
        // `name?/feature` alone does not switch `name` on; `name/feature` does.
        let named = feature.strip_prefix("dep:").unwrap_or(feature);
        if named.split('/').next() == Some(import) {
            return true;
        }
        if let Some(names) = package["features"][feature].as_array() {
            open.extend(names.iter().map(|name| name.as_str().expect("feature names are strings")));
        }
    }
    false
}

/// The packages that `cargo run` and `cargo build` take when none is named.
fn default_members(metadata: &Value) -> Vec<&str> {
    let ids = list(metadata, "workspace_default_members");
    let packages = list(metadata, "packages").iter();
    packages.filter(|package| ids.contains(&package["id"])).map(|p| text(p, "name")).collect()
}

/// Whether a crate's root forbids unsafe code, in a line of its own.
fn forbids_unsafe_code(source: &str) -> bool {
    source.lines().any(|line| line.trim() == "#![forbid(unsafe_code)]")
}

#[test]
fn nobody_imports_what_the_table_forbids() {
    let found = breaches(&metadata());
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn no_files_of_a_crate_use_each_other_in_a_circle() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let packages = packages(&root).unwrap();
    let circles = |package| package_graph(&root, package).unwrap().describe_circles();
    let found: String = packages.iter().map(circles).collect();
    assert!(found.is_empty(), "\n{found}");
}

#[test]
fn the_default_member_is_sim() {
    assert_eq!(default_members(&metadata()), ["yawara"]);
}

#[test]
fn every_crate_but_gpu_and_petsc_forbids_unsafe_code() {
    let metadata = metadata();
    let packages = list(&metadata, "packages").iter();
    for package in
        packages.filter(|package| !["yawara-gpu", "yawara-petsc"].contains(&text(package, "name")))
    {
        let name = text(package, "name");
        let roots: Vec<&Value> = list(package, "targets")
            .iter()
            .filter(|target| list(target, "kind").iter().any(|kind| kind == "lib" || kind == "bin"))
            .collect();
        assert!(!roots.is_empty(), "{name} has neither a library nor a program");
        for root in roots {
            let file = text(root, "src_path");
            let source = std::fs::read_to_string(file).expect("cargo names files that exist");
            assert!(forbids_unsafe_code(&source), "{file} lacks #![forbid(unsafe_code)]");
        }
    }
}

/// A workspace that keeps the table: every allowed import present, gpu optional.
fn forged() -> Value {
    let dependency =
        |name: &&str, optional| json!({"name": name, "kind": null, "optional": optional});
    let packages: Vec<Value> = TABLE
        .iter()
        .map(|row| {
            let always = row.imports.iter().map(|name| dependency(name, false));
            let behind = row.optional.iter().filter(|name| !row.imports.contains(name));
            let mut dependencies: Vec<Value> =
                always.chain(behind.map(|name| dependency(name, true))).collect();
            dependencies.push(dependency(&"thiserror", false));
            json!({"name": row.package, "id": format!("{}#1", row.package),
                   "dependencies": dependencies, "features": {"default": []}})
        })
        .collect();
    json!({"packages": packages, "workspace_default_members": ["yawara#1"]})
}

/// The forged workspace with one more edge.
fn with_edge(from: &str, to: &str, kind: Value, optional: bool) -> Value {
    let mut workspace = forged();
    let package = package_mut(&mut workspace, from);
    let edge = json!({"name": to, "kind": kind, "optional": optional});
    package["dependencies"].as_array_mut().unwrap().push(edge);
    workspace
}

fn package_mut<'a>(workspace: &'a mut Value, name: &str) -> &'a mut Value {
    let packages = workspace["packages"].as_array_mut().unwrap();
    packages.iter_mut().find(|package| package["name"] == name).unwrap()
}

#[test]
fn a_workspace_that_keeps_the_table_passes() {
    assert_eq!(breaches(&forged()), [""; 0]);
    assert_eq!(default_members(&forged()), ["yawara"]);
}

#[test]
fn every_forged_edge_outside_the_table_is_caught() {
    for from in TABLE {
        for to in TABLE {
            if from.imports.contains(&to.package) || from.optional.contains(&to.package) {
                continue;
            }
            for kind in [Value::Null, json!("dev"), json!("build")] {
                for optional in [false, true] {
                    let workspace = with_edge(from.package, to.package, kind.clone(), optional);
                    let sentence = format!("{} may not import {}", from.package, to.package);
                    assert_eq!(breaches(&workspace), [sentence]);
                }
            }
        }
    }
}

#[test]
fn the_table_is_the_documented_one() {
    // Spelled out a second time, so that a slip in TABLE does not hide a breach.
    let forbidden = [
        ("yawara-mesh", "yawara-embed"),
        ("yawara-inverse-update", "yawara-mesh"),
        ("yawara-embed", "yawara-inverse-update"),
        ("yawara-embed", "yawara-corot"),
        ("yawara-corot", "yawara-inverse-update"),
        ("yawara-gpu", "yawara-mesh"),
        ("yawara-gpu", "yawara"),
        ("yawara-corot", "yawara-gpu"),
        ("yawara-mesh", "yawara"),
        ("yawara", "yawara-bench"),
        ("yawara", "yawara-tests"),
        ("yawara-bench", "yawara-tests"),
        ("yawara-tests", "yawara-bench"),
    ];
    for (from, to) in forbidden {
        assert_eq!(breaches(&with_edge(from, to, Value::Null, false)).len(), 1, "{from} {to}");
    }
}

#[test]
fn gpu_is_optional_in_sim_and_off_by_default() {
    let required = with_edge("yawara", "yawara-gpu", Value::Null, false);
    assert_eq!(breaches(&required), ["yawara imports yawara-gpu, which must be optional"]);
    for route in ["dep:yawara-gpu", "yawara-gpu/f64", "gpu", "yawara-gpu"] {
        let mut workspace = forged();
        package_mut(&mut workspace, "yawara")["features"] =
            json!({"default": ["nifti", route], "gpu": ["dep:yawara-gpu"], "nifti": []});
        let found = breaches(&workspace);
        assert_eq!(found, ["yawara switches yawara-gpu on by default"], "{route}");
    }
    let mut behind_a_feature = forged();
    package_mut(&mut behind_a_feature, "yawara")["features"] =
        json!({"default": ["nifti"], "gpu": ["dep:yawara-gpu"], "nifti": ["yawara-gpu?/f64"]});
    assert_eq!(breaches(&behind_a_feature), [""; 0]);
}

#[test]
fn strangers_and_wgpu_elsewhere_are_caught() {
    let wgpu = with_edge("yawara-corot", "wgpu", Value::Null, true);
    assert_eq!(breaches(&wgpu), ["yawara-corot imports wgpu, which belongs to yawara-gpu"]);
    assert_eq!(breaches(&with_edge("yawara-gpu", "wgpu", Value::Null, false)), [""; 0]);

    let mut renamed = forged();
    package_mut(&mut renamed, "yawara-bench")["name"] = json!("yawara-common");
    let found = breaches(&renamed);
    assert!(found.contains(&"yawara-common has no row in the table".to_owned()));
    assert!(found.contains(&"yawara-bench is in the table but not in the workspace".to_owned()));
}

#[test]
fn only_the_plain_attribute_forbids_unsafe_code() {
    assert!(forbids_unsafe_code("//! Doc.\n#![forbid(unsafe_code)]\n\nmod a;"));
    for source in ["", "// #![forbid(unsafe_code)]", "#![deny(unsafe_code)]", "forbid(unsafe_code)"]
    {
        assert!(!forbids_unsafe_code(source), "{source}");
    }
}
