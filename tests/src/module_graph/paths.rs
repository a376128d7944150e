//! The paths that a piece of code mentions, found in its tokens: macros' arguments count too.

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use syn::punctuated::Punctuated;
use syn::spanned::Spanned;
use syn::{ItemUse, Meta, Token, UseTree, Visibility};

/// A path in code outside tests: `crate::a::B`, `b::c`, `D`.
pub struct Mention {
    /// Its names, `crate`, `self` and `super` among them.
    pub path: Vec<String>,
    /// The line that it starts in.
    pub line: usize,
    /// Whether a macro of this name is called.
    pub is_macro: bool,
}

/// One name, or all names of a module, that a `use` brings in.
pub struct Import {
    /// What is imported, as it is written.
    pub path: Vec<String>,
    /// The name that it gets here; none: all of its names (`*`).
    pub name: Option<String>,
    /// Whether others may import it from here.
    pub public: bool,
    /// The line of the name.
    pub line: usize,
}

/// What the code of one module mentions.
#[derive(Default)]
pub struct Code {
    /// Paths outside of `use`.
    pub mentions: Vec<Mention>,
    /// All `use`, those inside functions too.
    pub imports: Vec<Import>,
}

impl Code {
    /// Adds what a piece of code mentions, leaving out what is compiled for tests only.
    pub fn scan(&mut self, code: TokenStream) {
        let tokens: Vec<TokenTree> = code.into_iter().collect();
        let mut at = 0;
        while at < tokens.len() {
            at = match &tokens[at] {
                TokenTree::Punct(mark) if mark.as_char() == '#' => self.attribute(&tokens, at),
                TokenTree::Group(group) => {
                    self.scan(group.stream());
                    at + 1
                }
                TokenTree::Ident(word) if word == "use" => self.local_import(&tokens, at),
                TokenTree::Ident(_) => self.path(&tokens, at),
                _ => at + 1,
            };
        }
    }

    /// Adds the names that a `use` brings in.
    pub fn import(&mut self, item: &ItemUse) {
        if item.leading_colon.is_none() {
            let public = !matches!(item.vis, Visibility::Inherited);
            self.import_tree(&item.tree, &[], public);
        }
    }

    fn import_tree(&mut self, tree: &UseTree, prefix: &[String], public: bool) {
        let with = |name: &syn::Ident| {
            let own = (name != "self" || prefix.is_empty()).then(|| plain(name));
            prefix.iter().cloned().chain(own).collect::<Vec<_>>()
        };
        let (path, name) = match tree {
            UseTree::Path(path) => {
                return self.import_tree(&path.tree, &with(&path.ident), public);
            }
            UseTree::Group(group) => {
                return group.items.iter().for_each(|tree| self.import_tree(tree, prefix, public));
            }
            UseTree::Name(leaf) => (with(&leaf.ident), with(&leaf.ident).pop()),
            UseTree::Rename(leaf) => (with(&leaf.ident), Some(plain(&leaf.rename))),
            UseTree::Glob(_) => (prefix.to_vec(), None),
        };
        self.imports.push(Import { path, name, public, line: tree.span().start().line });
    }

    /// The `use` at `at`, inside a function; returns where the code goes on.
    fn local_import(&mut self, tokens: &[TokenTree], at: usize) -> usize {
        let length = tokens[at..].iter().position(|token| is_mark(Some(token), ';'));
        let end = length.map_or(at + 1, |length| at + length + 1);
        // `impl Trait + use<'a>` is none.
        match syn::parse2(tokens[at..end].iter().cloned().collect()) {
            Ok(item) => {
                self.import(&item);
                end
            }
            Err(_) => at + 1,
        }
    }

    /// The attribute at `at`: what it mentions, or the item behind it passed over.
    fn attribute(&mut self, tokens: &[TokenTree], at: usize) -> usize {
        let Some(TokenTree::Group(group)) = tokens.get(at + 1) else { return at + 1 };
        if syn::parse2(group.stream()).is_ok_and(|meta| is_for_tests(&meta)) {
            return item_end(tokens, at + 2);
        }
        self.scan(group.stream());
        at + 2
    }

    /// The path that starts at `at`, if one does.
    fn path(&mut self, tokens: &[TokenTree], at: usize) -> usize {
        let mut path = Vec::new();
        let mut end = at;
        while let Some(TokenTree::Ident(word)) = tokens.get(end) {
            path.push(plain(word));
            let goes_on = is_mark(tokens.get(end + 1), ':') && is_mark(tokens.get(end + 2), ':');
            end += if goes_on { 3 } else { 1 };
            if !goes_on {
                break;
            }
        }
        if starts_path(&tokens[..at], &path[0]) && is_named(&path, tokens.get(end)) {
            let line = tokens[at].span().start().line;
            self.mentions.push(Mention { path, line, is_macro: is_mark(tokens.get(end), '!') });
        }
        end
    }
}

/// Whether what an attribute stands before is compiled for tests only.
pub fn is_for_tests(attribute: &Meta) -> bool {
    match attribute {
        Meta::List(list) if list.path.is_ident("cfg") || list.path.is_ident("all") => list
            .parse_args_with(Punctuated::<Meta, Token![,]>::parse_terminated)
            .is_ok_and(|conditions| conditions.iter().any(is_for_tests)),
        _ => attribute.path().is_ident("test"),
    }
}

/// Behind the item, statement, field or variant that starts at `at`.
fn item_end(tokens: &[TokenTree], at: usize) -> usize {
    let length = tokens[at..].iter().position(|token| match token {
        TokenTree::Group(group) => group.delimiter() == Delimiter::Brace,
        _ => is_mark(Some(token), ';') || is_mark(Some(token), ','),
    });
    length.map_or(tokens.len(), |length| at + length + 1)
}

/// Whether a word behind `before` starts a path: no field, method, lifetime or macro variable.
fn starts_path(before: &[TokenTree], word: &str) -> bool {
    let mut before = before.iter().rev();
    let (last, earlier) = (before.next(), before.next());
    let is_field = is_mark(last, '.') && !is_mark(earlier, '.');
    let is_tail = is_mark(last, ':') && is_mark(earlier, ':');
    let is_variable = is_mark(last, '$') && word != "crate";
    !(is_field || is_tail || is_variable || is_mark(last, '\''))
}

/// Whether a path names an item. A single word in lower case is a keyword or a local variable,
/// unless it is called.
fn is_named(path: &[String], next: Option<&TokenTree>) -> bool {
    let is_call = match next {
        Some(TokenTree::Group(group)) => group.delimiter() == Delimiter::Parenthesis,
        _ => is_mark(next, '!'),
    };
    path.len() > 1 || is_call || path[0].starts_with(char::is_uppercase)
}

fn is_mark(token: Option<&TokenTree>, mark: char) -> bool {
    matches!(token, Some(TokenTree::Punct(punct)) if punct.as_char() == mark)
}

/// A name without the prefix of raw identifiers.
pub fn plain(name: &syn::Ident) -> String {
    name.to_string().trim_start_matches("r#").to_owned()
}
