//! What acts on a body, as linear fields and the bumps of edges feel it.

use nalgebra::Vector3;

use crate::element::{EDGES, ElementPoint};

/// Forces on vertices and on edges' bumps φ = 4 λ_a λ_b: ∫ f λ_a and ∫ f φ.
#[derive(Clone, Debug, Default)]
pub struct Loads {
    vertices: Vec<Vector3<f64>>,
    edges: Vec<EdgeLoad>,
}

/// What an element's part of a load does to the bump of an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeLoad {
    /// Vertex numbers, ascending.
    pub ends: [usize; 2],
    /// ∫ f φ, N.
    pub force: Vector3<f64>,
    /// How the force falls with the bump's height, N/m.
    pub stiffness: f64,
}

impl Loads {
    /// By vertex number, N; those beyond have none.
    pub fn vertices(&self) -> &[Vector3<f64>] {
        &self.vertices
    }

    /// Those of edges; one may have several.
    pub fn edges(&self) -> &[EdgeLoad] {
        &self.edges
    }

    /// Adds a force (N) at a point of the body.
    pub fn add_point(&mut self, point: &ElementPoint, force: Vector3<f64>) {
        for (&v, weight) in point.vertices.iter().zip(point.weights) {
            self.add_vertex(v, weight * force);
        }
        for [a, b] in EDGES {
            let height = 4.0 * point.weights[a] * point.weights[b];
            self.add_edge(&point.vertices, [a, b], height * force, 0.0);
        }
    }

    pub(super) fn add_vertex(&mut self, vertex: usize, force: Vector3<f64>) {
        if self.vertices.len() <= vertex {
            self.vertices.resize(vertex + 1, Vector3::zeros());
        }
        self.vertices[vertex] += force;
    }

    pub(super) fn add_edge(
        &mut self,
        corners: &[usize; 4],
        edge: [usize; 2],
        force: Vector3<f64>,
        stiffness: f64,
    ) {
        let [a, b] = edge.map(|corner| corners[corner]);
        self.edges.push(EdgeLoad { ends: [a.min(b), a.max(b)], force, stiffness });
    }
}
