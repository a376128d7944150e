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
    for number in 0..sources.modules.len() {
        Uses { sources: &sources, number, edges: &mut edges }.add();
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

/// What one module uses, under way.
struct Uses<'a> {
    sources: &'a Sources,
    number: usize,
    edges: &'a mut BTreeMap<(usize, usize), Use>,
}

impl Uses<'_> {
    fn add(&mut self) {
        let code = &self.sources.modules[self.number].code;
        for import in &code.imports {
            self.import(import);
        }
        for mention in &code.mentions {
            self.mention(mention);
        }
    }

    /// A private import is a use; one of a module is one of what the code names in it, or, where
    /// nothing is seen to be named, of the module's own file.
    fn import(&mut self, import: &Import) {
        if import.public {
            return;
        }
        let star = if import.name.is_none() { "::*" } else { "" };
        let text = format!("use {}{star};", import.path.join("::"));
        for target in self.sources.resolve(self.number, &import.path) {
            match target {
                Target::Module(module) if !self.names_in(module, import) => {
                    self.edge(self.sources.modules[module].file, import.line, text.clone());
                }
                Target::File(file) => self.edge(file, import.line, text.clone()),
                _ => {}
            }
        }
    }

    /// Whether the code names something through an imported module.
    fn names_in(&self, module: usize, import: &Import) -> bool {
        let mut mentions = self.sources.modules[self.number].code.mentions.iter();
        match &import.name {
            Some(name) => {
                mentions.any(|mention| mention.path.len() > 1 && mention.path[0] == *name)
            }
            None => mentions.any(|mention| {
                let first = &mention.path[0];
                !self.sources.lookup(module, first, false, &mut Default::default()).is_empty()
            }),
        }
    }

    fn mention(&mut self, mention: &Mention) {
        let targets = self.sources.resolve(self.number, &mention.path);
        let by_name = match &mention.path[..] {
            [name] if mention.is_macro && targets.is_empty() => self.sources.macros.get(name),
            _ => None,
        };
        for target in by_name.map(|&file| Target::File(file)).into_iter().chain(targets) {
            if let Target::File(file) = target {
                self.edge(file, mention.line, mention.path.join("::"));
            }
        }
    }

    fn edge(&mut self, to: usize, line: usize, text: String) {
        let from = self.sources.modules[self.number].file;
        if from != to {
            self.edges.entry((from, to)).or_insert(Use { line, text });
        }
    }
}
