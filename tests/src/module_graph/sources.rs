//! The modules of a package, as its files declare them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use quote::ToTokens;
use syn::{Attribute, Item, ItemMod};

use super::paths::{Code, is_for_tests, plain};

/// A module, in a file of its own or inside one.
pub struct Module {
    /// The file that it stands in, by number.
    pub file: usize,
    /// The root module of its library or program.
    pub root: usize,
    /// The module that declares it.
    pub parent: Option<usize>,
    /// Modules that it declares; several of one name under exclusive conditions.
    pub children: BTreeMap<String, Vec<usize>>,
    /// Items that it defines.
    pub items: BTreeSet<String>,
    /// What its code outside tests mentions.
    pub code: Code,
}

/// All modules of a package: of its library, then of its programs.
pub struct Sources<'a> {
    /// Files in the order in which they were reached.
    pub files: Vec<PathBuf>,
    /// Modules, each behind its parent.
    pub modules: Vec<Module>,
    /// The files that define macros, which are known by their name alone.
    pub macros: BTreeMap<String, usize>,
    /// How programs name the library, whose root is module 0.
    pub library: Option<String>,
    read: Read<'a>,
}

/// How a file's text is had: none if there is no such file.
pub type Read<'a> = &'a dyn Fn(&Path) -> Option<String>;

impl<'a> Sources<'a> {
    /// Reads the files that can be reached from `roots`; the first is the library if it has a name.
    pub fn read(
        roots: &[PathBuf],
        library: Option<String>,
        read: Read<'a>,
    ) -> Result<Self, String> {
        let (files, modules, macros) = (Vec::new(), Vec::new(), BTreeMap::new());
        let mut sources = Self { files, modules, macros, library, read };
        for root in roots {
            let text =
                (sources.read)(root).ok_or_else(|| format!("{} is missing", root.display()))?;
            let folder = root.parent().unwrap_or(Path::new("")).to_owned();
            sources.file(root.clone(), &text, &folder, None)?;
        }
        Ok(sources)
    }

    /// Adds the module of a file; files of its children lie in `folder`.
    fn file(
        &mut self,
        path: PathBuf,
        text: &str,
        folder: &Path,
        parent: Option<usize>,
    ) -> Result<usize, String> {
        let parsed = syn::parse_file(text).map_err(|error| {
            format!("{}:{}: {error}", path.display(), error.span().start().line)
        })?;
        let file = self.files.len();
        self.files.push(path);
        self.module(file, &parsed.items, folder, parent)
    }

    fn module(
        &mut self,
        file: usize,
        items: &[Item],
        folder: &Path,
        parent: Option<usize>,
    ) -> Result<usize, String> {
        let number = self.modules.len();
        let root = parent.map_or(number, |parent| self.modules[parent].root);
        self.modules.push(Module {
            file,
            root,
            parent,
            children: BTreeMap::new(),
            items: BTreeSet::new(),
            code: Code::default(),
        });
        for item in items {
            match item {
                Item::Mod(child) if !compiled_for_tests(&child.attrs) => {
                    self.child(number, child, folder)?;
                }
                Item::Use(import) if !compiled_for_tests(&import.attrs) => {
                    self.modules[number].code.import(import);
                }
                Item::Mod(_) | Item::Use(_) => {}
                _ => self.item(number, item),
            }
        }
        Ok(number)
    }

    fn item(&mut self, module: usize, item: &Item) {
        if let Item::Macro(definition) = item
            && let Some(name) = &definition.ident
        {
            self.macros.insert(plain(name), self.modules[module].file);
        }
        let module = &mut self.modules[module];
        module.items.extend(name_of(item));
        module.code.scan(item.to_token_stream());
    }

    /// Adds a module that `parent` declares.
    fn child(&mut self, parent: usize, declaration: &ItemMod, folder: &Path) -> Result<(), String> {
        let name = plain(&declaration.ident);
        let below = folder.join(&name);
        let number = if let Some((_, items)) = &declaration.content {
            self.module(self.modules[parent].file, items, &below, Some(parent))?
        } else {
            let places = [folder.join(format!("{name}.rs")), below.join("mod.rs")];
            let mut found =
                places.into_iter().filter_map(|place| Some(((self.read)(&place)?, place)));
            let (text, place) = found.next().ok_or_else(|| {
                let file = self.files[self.modules[parent].file].display();
                format!("{file} declares the module {name}, which has no file")
            })?;
            self.file(place, &text, &below, Some(parent))?
        };
        self.modules[parent].children.entry(name).or_default().push(number);
        Ok(())
    }
}

/// The name that an item gives to its module.
fn name_of(item: &Item) -> Option<String> {
    let name = match item {
        Item::Const(item) => &item.ident,
        Item::Enum(item) => &item.ident,
        Item::Fn(item) => &item.sig.ident,
        Item::Macro(item) => item.ident.as_ref()?,
        Item::Static(item) => &item.ident,
        Item::Struct(item) => &item.ident,
        Item::Trait(item) => &item.ident,
        Item::Type(item) => &item.ident,
        Item::Union(item) => &item.ident,
        _ => return None,
    };
    Some(plain(name))
}

fn compiled_for_tests(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| is_for_tests(&attribute.meta))
}
