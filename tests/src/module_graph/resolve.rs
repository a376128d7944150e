//! From a path to the file that defines what it names.

use std::collections::BTreeSet;

use super::sources::Sources;

/// What a path leads to.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Target {
    /// A module of the package, itself: its items are what a use is about.
    Module(usize),
    /// An item, or one in a type, that this file defines.
    File(usize),
    /// Something of another crate that one of this package re-exports.
    Elsewhere,
}

/// Names under way, by module: a name that leads to itself ends there.
type Open = BTreeSet<(usize, String)>;

impl Sources<'_> {
    /// Where `path`, written in module `from`, leads to; nowhere for other crates, keywords and
    /// local names.
    pub fn resolve(&self, from: usize, path: &[String]) -> BTreeSet<Target> {
        self.follow(from, path, &mut Open::new())
    }

    fn follow(&self, from: usize, path: &[String], open: &mut Open) -> BTreeSet<Target> {
        let mut module = from;
        let mut names = path;
        while let [first, rest @ ..] = names {
            module = match first.as_str() {
                "crate" => self.modules[module].root,
                "self" => module,
                "super" => self.modules[module].parent.unwrap_or(module),
                _ => break,
            };
            names = rest;
        }
        let anchored = names.len() < path.len();
        let Some((first, rest)) = names.split_first() else {
            return [Target::Module(module)].into();
        };
        let mut found = self.first(module, first, rest.is_empty(), open);
        if found.is_empty() && anchored {
            // Defined by a macro: it stands in the module that the path names.
            return [Target::File(self.modules[module].file)].into();
        }
        for (number, name) in rest.iter().enumerate() {
            let modules: Vec<usize> = found.iter().filter_map(Target::module).collect();
            if modules.is_empty() {
                break;
            }
            let is_last = number + 1 == rest.len();
            let look = |&module: &usize| match self.lookup(module, name, is_last, open) {
                none if none.is_empty() => [Target::File(self.modules[module].file)].into(),
                some => some,
            };
            found = modules.iter().flat_map(look).collect();
        }
        found
    }

    /// The first name of a path; a program may name the library of its package.
    fn first(&self, module: usize, name: &str, is_last: bool, open: &mut Open) -> BTreeSet<Target> {
        let found = self.lookup(module, name, is_last, open);
        let is_library = self.library.as_deref() == Some(name) && self.modules[module].root != 0;
        if found.is_empty() && is_library { [Target::Module(0)].into() } else { found }
    }

    /// What `name` means in `module`: its own items and modules, then what it imports by name, then
    /// what it imports by `*`.
    pub fn lookup(
        &self,
        module: usize,
        name: &str,
        is_last: bool,
        open: &mut Open,
    ) -> BTreeSet<Target> {
        let here = &self.modules[module];
        let children = here.children.get(name).into_iter().flatten();
        let mut found: BTreeSet<Target> = children.map(|&child| Target::Module(child)).collect();
        if !is_last && !found.is_empty() {
            return found;
        }
        if here.items.contains(name) {
            found.insert(Target::File(here.file));
        }
        if !open.insert((module, name.to_owned())) {
            return found;
        }
        for import in here.code.imports.iter().filter(|i| i.name.as_deref() == Some(name)) {
            let leads_to = self.follow(module, &import.path, open);
            let elsewhere = leads_to.is_empty().then_some(Target::Elsewhere);
            found.extend(leads_to.into_iter().chain(elsewhere));
        }
        if !found.is_empty() {
            return found;
        }
        let globs = here.code.imports.iter().filter(|import| import.name.is_none());
        for glob in globs {
            let modules = self.follow(module, &glob.path, open);
            for module in modules.iter().filter_map(Target::module) {
                found.extend(self.lookup(module, name, is_last, open));
            }
        }
        found
    }
}

impl Target {
    /// The module that it is.
    pub fn module(&self) -> Option<usize> {
        if let Self::Module(module) = self { Some(*module) } else { None }
    }
}
