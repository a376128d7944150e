//! Who uses whom, and the circles in it.

use std::collections::BTreeMap;
use std::fmt::Write;

use petgraph::algo::tarjan_scc;
use petgraph::graph::DiGraph;

/// One place at which a file uses another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Use {
    /// The line in the file that uses.
    pub line: usize,
    /// The import or the path that is written there.
    pub text: String,
}

/// Files (or folders, or crates) and which of them use each other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Graph {
    /// Names, without repetition.
    pub nodes: Vec<String>,
    /// From a node to one that it uses, with the first place; never to itself.
    pub edges: BTreeMap<(usize, usize), Use>,
}

impl Graph {
    /// Strongly connected nodes, two or more, each circle and the circles themselves in order.
    pub fn circles(&self) -> Vec<Vec<usize>> {
        let edges = self.edges.keys().map(|&(from, to)| (from as u32, to as u32));
        let graph = DiGraph::<(), ()>::from_edges(edges);
        let mut circles: Vec<Vec<usize>> = tarjan_scc(&graph)
            .into_iter()
            .filter(|nodes| nodes.len() > 1)
            .map(|nodes| nodes.into_iter().map(|node| node.index()).collect())
            .collect();
        circles.iter_mut().for_each(|nodes| nodes.sort_by_key(|&node| &self.nodes[node]));
        circles.sort_by_key(|nodes| &self.nodes[nodes[0]]);
        circles
    }

    /// One node for all nodes that `name` gives the same name.
    pub fn grouped(&self, name: impl Fn(&str) -> String) -> Self {
        let names: Vec<String> = self.nodes.iter().map(|node| name(node)).collect();
        let mut nodes = names.clone();
        nodes.sort();
        nodes.dedup();
        let number = |of: usize| nodes.binary_search(&names[of]).expect("every name is there");
        let mut edges = BTreeMap::new();
        for (&(from, to), place) in &self.edges {
            if number(from) != number(to) {
                let text = format!("{} in {}", place.text, self.nodes[from]);
                let place = Use { line: place.line, text };
                edges.entry((number(from), number(to))).or_insert(place);
            }
        }
        Self { nodes, edges }
    }

    /// The circles in words: the nodes of each and one place for every edge inside it; empty if
    /// there is none.
    pub fn describe_circles(&self) -> String {
        let mut text = String::new();
        for circle in self.circles() {
            let names: Vec<&str> = circle.iter().map(|&node| &*self.nodes[node]).collect();
            _ = writeln!(text, "circle of {}: {}", names.len(), names.join(", "));
            for (&(from, to), Use { line, text: place }) in &self.edges {
                if circle.contains(&from) && circle.contains(&to) {
                    let both = if self.edges.contains_key(&(to, from)) { "<->" } else { "->" };
                    let [from, to] = [from, to].map(|node| &self.nodes[node]);
                    _ = writeln!(text, "  {from}:{line} {both} {to}: {place}");
                }
            }
        }
        text
    }
}
