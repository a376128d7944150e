//! Graphs as pictures.

use std::collections::BTreeSet;
use std::path::Path;

use layout::backends::svg::SVGWriter;
use layout::core::base::Orientation::TopToBottom;
use layout::core::geometry::Point;
use layout::core::style::{LineStyleKind, StyleAttr};
use layout::std_shapes::shapes::{Arrow, Element, ShapeKind};
use layout::topo::layout::VisualGraph;
use petgraph::algo::tred::{dag_to_toposorted_adjacency_list, dag_transitive_reduction_closure};
use petgraph::algo::{greedy_feedback_arc_set, toposort};
use petgraph::graph::DiGraph;
use petgraph::visit::{EdgeRef, IntoEdgeReferences};

use super::graph::Graph;
use super::uses::package_graph;
use super::workspace::{Package, packages};

/// The pictures of the workspace at `root`, by file: its crates, and the folders of each crate.
///
/// # Errors
/// A sentence that names the file that can't be read.
pub fn pictures(root: &Path) -> Result<Vec<(String, String)>, String> {
    let packages = packages(root)?;
    let mut pictures = vec![("workspace.svg".to_owned(), crates(&packages))];
    for package in &packages {
        let svg = folders(&package_graph(root, package)?);
        pictures.push((format!("{}.svg", package.folder), svg));
    }
    Ok(pictures)
}

/// The crates, by their folders, and who depends on whom.
fn crates(packages: &[Package]) -> String {
    let names: Vec<&str> = packages.iter().map(|package| &*package.folder).collect();
    let uses = packages.iter().enumerate().flat_map(|(from, user)| {
        let to =
            (0..packages.len()).filter(move |&to| user.dependencies.contains(&packages[to].name));
        to.map(move |to| (from, to))
    });
    svg(&names, uses)
}

/// The folders of a package's `src`, and the files beside them.
fn folders(files: &Graph) -> String {
    let folder_of = |file: &usize| {
        let file = &files.nodes[*file];
        let inside = file.split_once("src/").map_or(&**file, |(_, inside)| inside);
        inside.split(['/', '.']).next().unwrap_or(inside)
    };
    let folders: BTreeSet<&str> = (0..files.nodes.len()).map(|file| folder_of(&file)).collect();
    let names: Vec<&str> = folders.into_iter().collect();
    let number =
        |file: &usize| names.binary_search(&folder_of(file)).expect("every folder is there");
    svg(&names, files.edges.keys().map(|(from, to)| (number(from), number(to))))
}

/// An SVG of a graph, users above what they use; `uses` may repeat. Where nodes use each other in a
/// circle, the fewest uses are dashed arrows upwards. Others that follow from several arrows are
/// left out.
fn svg(names: &[&str], uses: impl Iterator<Item = (usize, usize)>) -> String {
    let mut all = DiGraph::<(), ()>::new();
    let nodes: Vec<_> = names.iter().map(|_| all.add_node(())).collect();
    all.extend_with_edges(uses.filter(|(a, b)| a != b).map(|(a, b)| (nodes[a], nodes[b])));
    let back: Vec<_> = greedy_feedback_arc_set(&all).map(|edge| edge.id()).collect();
    let ends = |edge| all.edge_endpoints(edge).expect("an edge of this graph");
    let upwards: BTreeSet<_> = back.into_iter().map(ends).collect();
    let mut down = all.clone();
    down.retain_edges(|graph, edge| {
        !graph.edge_endpoints(edge).is_some_and(|e| upwards.contains(&e))
    });
    let order = toposort(&down, None).expect("no circle is left");
    let (sorted, rank) = dag_to_toposorted_adjacency_list::<_, u32>(&down, &order);
    let (reduced, _) = dag_transitive_reduction_closure(&sorted);

    let mut picture = VisualGraph::new(TopToBottom);
    let mut boxes = Vec::new();
    for node in &order {
        let name = names[node.index()];
        let size = Point::new(20.0 + 9.0 * name.chars().count() as f64, 30.0);
        let (shape, look) = (ShapeKind::new_box(name), StyleAttr::simple());
        boxes.push(picture.add_node(Element::create(shape, look, TopToBottom, size)));
    }
    let drawn: BTreeSet<(u32, u32)> =
        reduced.edge_references().map(|edge| (edge.source(), edge.target())).collect();
    for (from, to) in drawn {
        picture.add_edge(Arrow::simple(""), boxes[from as usize], boxes[to as usize]);
    }
    for (from, to) in upwards {
        let [from, to] = [from, to].map(|node| boxes[rank[node.index()] as usize]);
        let arrow = Arrow { line_style: LineStyleKind::Dashed, ..Arrow::simple("").reverse() };
        picture.add_edge(arrow, to, from);
    }
    let mut writer = SVGWriter::new();
    picture.do_it(false, false, false, &mut writer);
    writer.finalize()
}
