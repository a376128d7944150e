//! The packages of a workspace, by its manifests.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use toml::Table;

/// A member of the workspace.
pub struct Package {
    /// Its name for cargo.
    pub name: String,
    /// Its folder, as the workspace names it.
    pub folder: String,
    /// The root files of its library and its programs, from the workspace's folder on.
    pub roots: Vec<PathBuf>,
    /// How code names its library.
    pub library: Option<String>,
    /// Packages that it depends on when it is not tested, ours and others'.
    pub dependencies: Vec<String>,
}

/// The nearest folder at or above `folder` with the manifest of a workspace.
pub fn root_above(folder: &Path) -> Option<PathBuf> {
    let is_root =
        |folder: &&Path| manifest(folder).is_ok_and(|table| table.contains_key("workspace"));
    folder.ancestors().find(is_root).map(Path::to_owned)
}

/// The packages of the workspace at `root`, in its order.
///
/// # Errors
/// A sentence that names the manifest that can't be read.
pub fn packages(root: &Path) -> Result<Vec<Package>, String> {
    let manifest = manifest(root)?;
    let members = manifest["workspace"]["members"].as_array();
    let members = members.into_iter().flatten().filter_map(|member| member.as_str());
    members.map(|folder| package(root, folder)).collect()
}

fn package(root: &Path, folder: &str) -> Result<Package, String> {
    let manifest = manifest(&root.join(folder))?;
    let name = manifest["package"]["name"].as_str().unwrap_or(folder).to_owned();
    let source = Path::new(folder).join("src");
    let bin = source.join("bin");
    let programs = std::fs::read_dir(root.join(&bin)).into_iter().flatten().flatten();
    let programs: BTreeSet<_> = programs.map(|entry| bin.join(entry.file_name())).collect();
    let roots = ["lib.rs", "main.rs"].map(|file| source.join(file)).into_iter().chain(programs);
    let roots: Vec<PathBuf> = roots.filter(|file| root.join(file).is_file()).collect();
    let has_library = roots.first().is_some_and(|file| file.ends_with("lib.rs"));
    let library = has_library.then(|| name.replace('-', "_"));
    let dependencies = manifest.get("dependencies").and_then(|list| list.as_table());
    let dependencies = dependencies.into_iter().flat_map(|list| list.keys().cloned()).collect();
    Ok(Package { name, folder: folder.to_owned(), roots, library, dependencies })
}

fn manifest(folder: &Path) -> Result<Table, String> {
    let file = folder.join("Cargo.toml");
    let text = std::fs::read_to_string(&file).map_err(|error| error.to_string());
    let parsed =
        text.and_then(|text| text.parse().map_err(|error: toml::de::Error| error.to_string()));
    parsed.map_err(|error| format!("{}: {error}", file.display()))
}
