//! The graph of a package: its files, its folders.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::graph::{Graph, Use};
use super::paths::{Import, Mention};
use super::resolve::Target;
use super::sources::{Read, Sources};
use super::workspace::Package;

/// The files of a package of the workspace at `root`, named by their paths from there.
///
/// # Errors
/// A sentence that names the file that is missing or is not Rust.
pub fn package_graph(root: &Path, package: &Package) -> Result<Graph, String> {
    let read = |path: &Path| std::fs::read_to_string(root.join(path)).ok();
    file_graph(&package.roots, package.library.clone(), &read)
}

/// The files that can be reached from `roots` and which of them use each other; programs name the
/// first root `library`.
///
/// # Errors
/// A sentence that names the file that is missing or is not Rust.
pub fn file_graph(roots: &[PathBuf], library: Option<String>, read: Read) -> Result<Graph, String> {
    let sources = Sources::read(roots, library, read)?;
    let mut edges = BTreeMap::new();
    for (number, module) in sources.modules.iter().enumerate() {
        let mut add = |file, line, text: &str| {
            if file != module.file {
                let place = || Use { line, text: text.to_owned() };
                edges.entry((module.file, file)).or_insert_with(place);
            }
        };
        for import in module.code.imports.iter().filter(|import| !import.public) {
            let star = if import.name.is_none() { "::*" } else { "" };
            let text = format!("use {}{star};", import.path.join("::"));
            for file in sources.imported(number, import) {
                add(file, import.line, &text);
            }
        }
        for mention in &module.code.mentions {
            let text = mention.path.join("::");
            for file in sources.mentioned(number, mention) {
                add(file, mention.line, &text);
            }
        }
    }
    let nodes = sources.files.iter().map(|file| file.display().to_string()).collect();
    Ok(Graph { nodes, edges })
}

/// The folders of a graph of files. A file `a.rs` beside a folder `a` counts as one in it.
pub fn folder_graph(files: &Graph) -> Graph {
    let folder_of = |file: &String| Path::new(file).parent().unwrap_or(Path::new("")).to_owned();
    let folders: Vec<PathBuf> = files.nodes.iter().map(folder_of).collect();
    files.grouped(|file| {
        let below = Path::new(file).with_extension("");
        let folder = if folders.contains(&below) { below } else { folder_of(&file.to_owned()) };
        folder.display().to_string()
    })
}

impl Sources<'_> {
    /// The files that a private import in a module uses. One of a module is a use of what the code
    /// names in it, or, where nothing is seen to be named, of the module's own file.
    fn imported(&self, number: usize, import: &Import) -> Vec<usize> {
        let file = |target| match target {
            Target::Module(module) if self.names_in(number, module, import) => None,
            Target::Module(module) => Some(self.modules[module].file),
            Target::File(file) => Some(file),
            Target::Elsewhere => None,
        };
        self.resolve(number, &import.path).into_iter().filter_map(file).collect()
    }

    /// Whether the code of a module names something through an imported one.
    fn names_in(&self, number: usize, module: usize, import: &Import) -> bool {
        self.modules[number].code.mentions.iter().any(|Mention { path, .. }| match &import.name {
            Some(name) => path.len() > 1 && path[0] == *name,
            None => !self.lookup(module, &path[0], false, &mut Default::default()).is_empty(),
        })
    }

    /// The files of what a path in the code of a module names.
    fn mentioned(&self, number: usize, mention: &Mention) -> Vec<usize> {
        let targets = self.resolve(number, &mention.path);
        let by_name = match &mention.path[..] {
            [name] if mention.is_macro && targets.is_empty() => self.macros.get(name),
            _ => None,
        };
        let file = |target| if let Target::File(file) = target { Some(file) } else { None };
        by_name.copied().into_iter().chain(targets.into_iter().filter_map(file)).collect()
    }
}
