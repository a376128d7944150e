//! A graph as a picture.

use std::collections::BTreeMap;
use std::path::Path;

use layout::backends::svg::SVGWriter;
use layout::core::base::Orientation::TopToBottom;
use layout::core::geometry::Point;
use layout::core::style::StyleAttr;
use layout::std_shapes::shapes::{Arrow, Element, ShapeKind};
use layout::topo::layout::VisualGraph;
use petgraph::algo::toposort;
use petgraph::algo::tred::{dag_to_toposorted_adjacency_list, dag_transitive_reduction_closure};
use petgraph::graph::DiGraph;
use petgraph::visit::{EdgeRef, IntoEdgeReferences};

use super::graph::{Graph, Use};
use super::uses::package_graph;
use super::workspace::{Package, packages};

/// The pictures of the workspace at `root`, by file: its crates, and the rooms of each crate.
///
/// # Errors
/// A sentence that names the file that can't be read.
pub fn pictures(root: &Path) -> Result<Vec<(String, String)>, String> {
    let packages = packages(root)?;
    let mut pictures = vec![("workspace.svg".to_owned(), svg(&crate_graph(&packages)))];
    for package in &packages {
        let rooms = room_graph(&package_graph(root, package)?);
        pictures.push((format!("{}.svg", package.folder), svg(&rooms)));
    }
    Ok(pictures)
}

/// The crates, by their folders, and who depends on whom.
fn crate_graph(packages: &[Package]) -> Graph {
    let nodes = packages.iter().map(|package| package.folder.clone()).collect();
    let mut edges = BTreeMap::new();
    for (from, package) in packages.iter().enumerate() {
        for (to, _) in
            packages.iter().enumerate().filter(|(_, p)| package.dependencies.contains(&p.name))
        {
            edges.insert((from, to), Use { line: 0, text: "Cargo.toml".to_owned() });
        }
    }
    Graph { nodes, edges }
}

/// The rooms of a package: folders of its `src` and the files beside them. Rooms that use each other
/// in a circle are one node.
pub fn room_graph(files: &Graph) -> Graph {
    let rooms = files.grouped(|file| {
        let inside = file.split_once("src/").map_or(file, |(_, inside)| inside);
        inside.split(['/', '.']).next().unwrap_or(inside).to_owned()
    });
    let circles = rooms.circles();
    rooms.grouped(|room| {
        let mut circles =
            circles.iter().map(|circle| circle.iter().map(|&node| &*rooms.nodes[node]));
        match circles.find(|circle| circle.clone().any(|member| member == room)) {
            Some(circle) => circle.collect::<Vec<_>>().join(" + "),
            None => room.to_owned(),
        }
    })
}

/// An SVG of a graph without circles, users above what they use. An arrow that follows from others
/// is left out: what a node uses may lie several arrows below it.
///
/// # Panics
/// If there is a circle.
fn svg(graph: &Graph) -> String {
    let mut full = DiGraph::<(), ()>::new();
    let numbers: Vec<_> = graph.nodes.iter().map(|_| full.add_node(())).collect();
    full.extend_with_edges(graph.edges.keys().map(|&(from, to)| (numbers[from], numbers[to])));
    let order = toposort(&full, None).expect("there is no circle");
    let (sorted, _) = dag_to_toposorted_adjacency_list::<_, u32>(&full, &order);
    let (reduced, _) = dag_transitive_reduction_closure(&sorted);
    let mut picture = VisualGraph::new(TopToBottom);
    let mut boxes = Vec::new();
    for node in &order {
        let name = &graph.nodes[node.index()];
        let size = Point::new(20.0 + 9.0 * name.chars().count() as f64, 30.0);
        let style = StyleAttr::simple();
        let shape = ShapeKind::new_box(name);
        boxes.push(picture.add_node(Element::create(shape, style, TopToBottom, size)));
    }
    for edge in reduced.edge_references() {
        let [from, to] = [edge.source(), edge.target()].map(|rank| boxes[rank as usize]);
        picture.add_edge(Arrow::simple(""), from, to);
    }
    let mut writer = SVGWriter::new();
    picture.do_it(false, false, false, &mut writer);
    writer.finalize()
}
