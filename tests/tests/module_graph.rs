//! The reader of module graphs, on small made-up packages.

use std::path::{Path, PathBuf};

use yawara_tests::module_graph::{Graph, file_graph, folder_graph};

/// The graph of a library of these files, whose root is the first.
fn library(files: &[(&str, &str)]) -> Graph {
    package(&files[..1], files)
}

/// The graph of a package with the library `own` and maybe programs.
fn package(roots: &[(&str, &str)], files: &[(&str, &str)]) -> Graph {
    let read = |path: &Path| {
        let found = files.iter().find(|(name, _)| Path::new(name) == path)?;
        Some(found.1.to_owned())
    };
    let roots: Vec<PathBuf> = roots.iter().map(|(name, _)| name.into()).collect();
    file_graph(&roots, Some("own".to_owned()), &read).unwrap()
}

/// `from -> to: place` of every edge, in order.
fn edges(graph: &Graph) -> Vec<String> {
    let name = |node: usize| graph.nodes[node].trim_end_matches(".rs");
    let mut edges: Vec<String> = graph
        .edges
        .iter()
        .map(|(&(from, to), place)| format!("{} -> {}: {}", name(from), name(to), place.text))
        .collect();
    edges.sort();
    edges
}

fn circles(graph: &Graph) -> Vec<Vec<&str>> {
    let names = |nodes: Vec<usize>| nodes.into_iter().map(|node| &*graph.nodes[node]).collect();
    graph.circles().into_iter().map(names).collect()
}

const TWO: &str = "mod a; mod b;";
const THREE: &str = "mod a; mod b; mod c;";

#[test]
fn two_files_that_import_each_other_are_a_circle() {
    let a = ("a.rs", "use crate::b::B;\npub struct A;");
    let b = ("b.rs", "\nuse super::a::A;\npub struct B;");
    let graph = library(&[("lib.rs", TWO), a, b]);
    assert_eq!(circles(&graph), [["a.rs", "b.rs"]]);
    let said = "circle of 2: a.rs, b.rs\n  a.rs:1 <-> b.rs: use crate::b::B;\n  \
                b.rs:2 <-> a.rs: use super::a::A;\n";
    assert_eq!(graph.describe_circles(), said);
}

#[test]
fn a_circle_of_three_is_one_circle() {
    let a = ("a.rs", "use crate::{b::{self, B as Other}, c};\npub struct A(Other, b::B);");
    let b = ("b.rs", "pub struct B; fn f() { crate::c::C; }");
    let c = ("c.rs", "pub struct C; impl From<crate::a::A> for C {}");
    let graph = library(&[("lib.rs", THREE), a, b, c]);
    assert_eq!(circles(&graph), [["a.rs", "b.rs", "c.rs"]]);
}

#[test]
fn a_chain_is_no_circle() {
    let files = [("lib.rs", THREE), ("a.rs", "use crate::b::B;"), ("c.rs", "pub struct C;")];
    let graph = library(&[files[0], files[1], ("b.rs", "pub struct B(crate::c::C);"), files[2]]);
    assert_eq!(edges(&graph), ["a -> b: use crate::b::B;", "b -> c: crate::c::C"]);
    assert!(circles(&graph).is_empty() && graph.describe_circles().is_empty());
}

#[test]
fn a_reexport_is_followed_to_the_file_that_defines() {
    let root = ("lib.rs", "mod a; mod room; pub use room::*; pub(crate) use a::A as First;");
    let a = ("a.rs", "use crate::Inner;\npub struct A(Inner);");
    let room = ("room/mod.rs", "mod inner; mod other; pub use inner::Inner; pub use other::go;");
    let inner = ("room/inner.rs", "pub struct Inner; fn f(_: crate::First) { super::go() }");
    let graph = library(&[root, a, room, inner, ("room/other.rs", "pub fn go() {}")]);
    let expected = [
        "a -> room/inner: use crate::Inner;",
        "room/inner -> a: crate::First",
        "room/inner -> room/other: super::go",
    ];
    assert_eq!(edges(&graph), expected);
}

#[test]
fn a_parent_that_names_its_children_and_is_named_by_them_is_in_a_circle() {
    let root = ("lib.rs", "pub mod stage;");
    let text = "mod one; pub use one::One; pub trait Stage {} \
                pub fn by_name() -> Box<dyn Stage> { Box::new(One) }";
    let one = ("stage/one.rs", "use super::Stage;\npub struct One; impl Stage for One {}");
    let graph = library(&[root, ("stage/mod.rs", text), one]);
    assert_eq!(circles(&graph), [["stage/mod.rs", "stage/one.rs"]]);

    // With the trait in a file of its own there is none.
    let text = "mod one; mod stage; pub use one::One; pub use stage::Stage; \
                pub fn by_name() -> Box<dyn Stage> { Box::new(One) }";
    let stage = ("stage/stage.rs", "pub trait Stage {}");
    let graph = library(&[root, ("stage/mod.rs", text), one, stage]);
    assert!(circles(&graph).is_empty(), "{}", graph.describe_circles());
    assert_eq!(graph.edges.len(), 3);
}

#[test]
fn a_glob_leads_to_what_is_named_through_it() {
    let a = ("a.rs", "use super::b::*;\npub struct A; fn f(_: B) -> C { g() }");
    let b = ("b.rs", "pub use crate::c::C; pub struct B; pub fn g() {}");
    let c = ("c.rs", "use crate::a::*;\npub struct C(A); enum D { E } use D::*;");
    let graph = library(&[("lib.rs", THREE), a, b, c]);
    assert_eq!(edges(&graph), ["a -> b: B", "a -> c: C", "c -> a: A"]);
    // Nothing is seen to be named: methods of a trait, say.
    let a = ("a.rs", "use crate::b::*; fn f() { 1.0.halved() }");
    let b = ("b.rs", "pub trait Halved { fn halved(&self); }");
    assert_eq!(edges(&library(&[("lib.rs", TWO), a, b])), ["a -> b: use crate::b::*;"]);
}

#[test]
fn code_for_tests_does_not_count() {
    let a = "
        #[cfg(test)] use crate::b::B;
        #[cfg(test)] mod tests { use super::super::b::B; }
        #[cfg(all(test, unix))] fn helper() { crate::b::g() }
        #[test] fn checks() { crate::b::g() }
        struct A { #[cfg(test)] seen: crate::b::B, real: u8 }
        impl A { #[cfg(test)] fn h() -> crate::b::B { B } fn real() {} }
        fn f() { #[cfg(test)] crate::b::g(); }";
    let files = [("lib.rs", "mod a; mod b; #[cfg(test)] mod absent;"), ("a.rs", a)];
    let graph = library(&[files[0], files[1], ("b.rs", "pub struct B; pub fn g() {}")]);
    assert_eq!(edges(&graph), [""; 0]);

    // A condition that also holds without tests counts.
    let a = "#[cfg(any(test, feature = \"x\"))] fn f() { crate::b::g() }";
    let graph = library(&[files[0], ("a.rs", a), ("b.rs", "pub fn g() {}")]);
    assert_eq!(edges(&graph), ["a -> b: crate::b::g"]);
}

#[test]
fn paths_are_found_wherever_they_stand() {
    for code in [
        "fn f() { crate::b::B; }",
        "fn f() { let x = vec![1, super::b::B::new()]; }",
        "type T = Vec<Option<crate::b::B>>;",
        "use super::b; fn f() -> b::B { todo!() }",
        "use super::b as other; const X: u8 = other::N;",
        "fn f() { use crate::b::B; }",
        "fn f() { use super::b::{self}; b::g(); }",
        "macro_rules! m { () => { $crate::b::g() } }",
        "impl Trait for crate::b::B {}",
        "#[derive(crate::b::B)] struct S;",
        "mod inner { use super::super::b::B; }",
        "mod inner { fn f() { super::super::b::g() } }",
        "fn f() { 0..crate::b::N; }",
        "fn f() { crate::b::made_by_a_macro(); }",
        "fn f() { textual!(); }",
    ] {
        let b =
            "pub struct B; pub fn g() {} pub const N: u8 = 1; macro_rules! textual { () => {} }";
        let graph = library(&[("lib.rs", TWO), ("a.rs", code), ("b.rs", b)]);
        let found: Vec<[&str; 2]> =
            graph.edges.keys().map(|&(from, to)| [from, to].map(|n| &*graph.nodes[n])).collect();
        assert_eq!(found, [["a.rs", "b.rs"]], "{code}");
    }
}

#[test]
fn what_only_looks_like_a_use_is_none() {
    for code in [
        "fn f(x: &S) { x.b.g(); x.b::<u8>(); }",
        "pub use crate::b::B;",
        "pub(crate) use super::b::g;",
        "fn f() { b::g(); std::b::g(); ::b::g(); }",
        "use faer::b::B; fn f() -> B {}",
        "fn f() { T::b::g(); \"crate::b::B\"; /* crate::b::B */ }",
        "use crate::External; fn f(_: External) {}",
        "pub(in crate::b) struct S;",
    ] {
        let root = ("lib.rs", "mod a; mod b; pub use nalgebra::Matrix3 as External;");
        let graph = library(&[root, ("a.rs", code), ("b.rs", "pub struct B; pub fn g() {}")]);
        assert_eq!(edges(&graph), [""; 0], "{code}");
    }
}

#[test]
fn names_that_lead_to_themselves_end() {
    let a = ("a.rs", "pub use crate::b::*; pub use crate::b::X; fn f() { X; Y::z(); }");
    let b = ("b.rs", "pub use crate::a::*; pub use crate::a::X; fn f() { X; Y::z(); }");
    assert_eq!(edges(&library(&[("lib.rs", TWO), a, b])), [""; 0]);
    // A function of the name of its module, imported beside it.
    let a = ("a.rs", "use crate::{b, c::C}; fn f() { b(); }");
    let root = ("lib.rs", "mod a; mod b; mod c; use b::b;");
    let graph = library(&[root, a, ("b.rs", "pub fn b() {}"), ("c.rs", "pub struct C;")]);
    let expected = ["a -> b: use crate::b;", "a -> c: use crate::c::C;", "lib -> b: use b::b;"];
    assert_eq!(edges(&graph), expected);
}

#[test]
fn a_program_may_use_its_library() {
    let roots = [("src/lib.rs", "mod a; pub use a::A;"), ("src/main.rs", "mod cli; fn main() {}")];
    let files = [("src/a.rs", "pub struct A;"), ("src/cli.rs", "use own::A;\nfn f(_: A) {}")];
    let graph = package(&roots, &[roots[0], roots[1], files[0], files[1]]);
    assert_eq!(edges(&graph), ["src/cli -> src/a: use own::A;"]);
}

#[test]
fn folders_have_circles_of_their_own() {
    let files = [
        ("lib.rs", "mod a; mod b;"),
        ("a.rs", "pub mod inner; pub struct A(crate::b::B);"),
        ("a/inner.rs", "pub struct Inner;"),
        ("b/mod.rs", "mod deep; mod top; pub use top::B;"),
        ("b/top.rs", "pub struct B;"),
        ("b/deep.rs", "use crate::a::inner::Inner;\nfn f(_: Inner) {}"),
    ];
    let graph = library(&files);
    assert!(circles(&graph).is_empty());
    let folders = folder_graph(&graph);
    assert_eq!(folders.nodes, ["", "a", "b"]);
    assert_eq!(circles(&folders), [["a", "b"]]);
    let said = folders.describe_circles();
    assert!(said.contains("b:1 <-> a: use crate::a::inner::Inner; in b/deep.rs"), "{said}");
}

#[test]
fn what_cannot_be_read_is_named() {
    let read = |text: &'static str| {
        move |path: &Path| (path == Path::new("lib.rs")).then(|| text.to_owned())
    };
    let refused = |text| file_graph(&["lib.rs".into()], None, &read(text)).unwrap_err();
    assert_eq!(refused("mod gone;"), "lib.rs declares the module gone, which has no file");
    assert!(refused("mod\n 1").starts_with("lib.rs:2: "), "{}", refused("mod\n 1"));
    let missing = file_graph(&["main.rs".into()], None, &read("")).unwrap_err();
    assert_eq!(missing, "main.rs is missing");
}
