//! The bumps of a mesh and their stiffness, kept while mesh and material stay.

use nalgebra::{Matrix3, Matrix6};
use yawara_corot::{EDGES, Element};
use yawara_embed::{LinearTet, MixedModuli, strain_operator};

use crate::body::BodyState;

/// The bumps φ = 4 λ_a λ_b of all edges (a, b) of elements that are not void.
///
/// What a stencil is made of is compared by value, so nobody has to say what has changed.
#[derive(Default)]
pub(super) struct Stencils {
    /// By element number.
    kept: Vec<Stencil>,
    is_mixed: bool,
    /// Numbers of the elements that are not void.
    pub solids: Vec<usize>,
    /// The ends of each bump, vertex numbers in ascending order; ascending.
    pub ends: Vec<[usize; 2]>,
    /// Of each edge of each of `solids` its bump.
    pub of: Vec<[usize; 6]>,
    /// The elements around all of them, one bump after the other, and where those of each begin.
    around: Vec<usize>,
    starts: Vec<usize>,
    /// Edges of `solids` on their way into order.
    edges: Vec<Edge>,
}

/// An element's part of the stiffness of its bumps, and what that was made of.
struct Stencil {
    vertices: [usize; 4],
    is_void: bool,
    geometry: LinearTet,
    elasticity: Matrix6<f64>,
    rotation: Matrix3<f64>,
    /// By edge, N/m, in the element's frame and in space.
    own: [Matrix3<f64>; 6],
    turned: [Matrix3<f64>; 6],
}

/// Edge `k` of the element at `at` among those that are not void.
#[derive(Clone, Copy, Default)]
struct Edge {
    ends: [usize; 2],
    at: usize,
    k: usize,
}

impl Stencil {
    fn new(element: &Element, is_void: bool, is_mixed: bool) -> Self {
        let Element { vertices, geometry, elasticity, rotation, .. } = *element;
        let own = own_stiffness(element, is_mixed);
        let turned = turned(&own, &rotation);
        Self { vertices, is_void, geometry, elasticity, rotation, own, turned }
    }

    /// Turns it; whether it has been turned so before.
    fn turn(&mut self, rotation: &Matrix3<f64>) -> bool {
        let is_same = self.rotation == *rotation;
        if !is_same {
            self.rotation = *rotation;
            self.turned = turned(&self.own, rotation);
        }
        is_same
    }
}

/// ∫ G(∇φ)ᵀ D G(∇φ) by edge, in the element's frame.
fn own_stiffness(element: &Element, is_mixed: bool) -> [Matrix3<f64>; 6] {
    let Element { geometry, elasticity, .. } = element;
    let operators = geometry.gradients.map(|g| strain_operator(&g));
    // With pressures a dilation costs what they let it: no more than a change of shape here.
    let elasticity = match is_mixed {
        true => MixedModuli::split(elasticity).with_bulk_at_most(2.0),
        false => *elasticity,
    };
    let stresses = operators.map(|g| elasticity * g);
    EDGES.map(|[i, j]| {
        // ∫ λ_a² = V/10 and ∫ λ_a λ_b = V/20.
        let across = operators[i].transpose() * stresses[j];
        let along = operators[i].transpose() * stresses[i] + operators[j].transpose() * stresses[j];
        geometry.volume * (1.6 * along + 0.8 * (across + across.transpose()))
    })
}

fn turned(own: &[Matrix3<f64>; 6], rotation: &Matrix3<f64>) -> [Matrix3<f64>; 6] {
    own.map(|own| rotation * own * rotation.transpose())
}

impl Stencils {
    /// Brings them to the mesh, the material and the rotations of `state`; whether they were there already.
    ///
    /// Cost: a look at each element, what has changed of it, and O(edges) where the mesh did.
    pub fn follow(&mut self, state: &BodyState) -> bool {
        let (elements, is_mixed) = (state.elements(), state.body.is_mixed());
        if self.is_mixed != is_mixed {
            self.is_mixed = is_mixed;
            self.kept.clear();
        }
        let mut is_same_mesh = self.kept.len() == elements.len();
        let mut is_same_body = is_same_mesh;
        self.kept.truncate(elements.len());
        for (number, element) in elements.iter().enumerate() {
            let is_void = state.is_void(element.tet);
            let made = || Stencil::new(element, is_void, is_mixed);
            let Some(kept) = self.kept.get_mut(number) else {
                self.kept.push(made());
                continue;
            };
            let is_same_place = kept.vertices == element.vertices && kept.is_void == is_void;
            is_same_mesh &= is_same_place;
            let is_same_stiffness = is_same_place
                && kept.geometry == element.geometry
                && kept.elasticity == element.elasticity;
            if !is_same_stiffness {
                *kept = made();
            }
            is_same_body &= is_same_stiffness & kept.turn(&element.rotation);
        }
        if !is_same_mesh {
            self.find_edges(state.positions().len());
        }
        is_same_body
    }

    /// Finds the bumps of `kept`, whose vertex numbers are below `vertices`.
    fn find_edges(&mut self, vertices: usize) {
        let Self { kept, solids, ends, of, around, starts, edges, .. } = self;
        solids.clear();
        solids.extend((0..kept.len()).filter(|&number| !kept[number].is_void));
        // In order of the lower end by counting; few have the same.
        let mut next = vec![0; vertices + 1];
        let ends_of = |number: usize, [i, j]: [usize; 2]| {
            let [a, b] = [kept[number].vertices[i], kept[number].vertices[j]];
            [a.min(b), a.max(b)]
        };
        for &number in &*solids {
            EDGES.into_iter().for_each(|edge| next[ends_of(number, edge)[0] + 1] += 1);
        }
        for v in 0..vertices {
            next[v + 1] += next[v];
        }
        edges.clear();
        edges.resize(6 * solids.len(), Edge::default());
        for (at, &number) in solids.iter().enumerate() {
            for (k, edge) in EDGES.into_iter().enumerate() {
                let ends = ends_of(number, edge);
                edges[next[ends[0]]] = Edge { ends, at, k };
                next[ends[0]] += 1;
            }
        }
        edges
            .chunk_by_mut(|a, b| a.ends[0] == b.ends[0])
            .for_each(|bucket| bucket.sort_unstable_by_key(|edge| (edge.ends[1], edge.at)));
        of.clear();
        of.resize(solids.len(), [0; 6]);
        (ends.clear(), starts.clear(), around.clear());
        for (number, &Edge { ends: edge, at, k }) in edges.iter().enumerate() {
            if ends.last() != Some(&edge) {
                ends.push(edge);
                starts.push(number);
            }
            of[at][k] = ends.len() - 1;
            around.push(solids[at]);
        }
        starts.push(edges.len());
    }

    /// Numbers of the elements around a bump.
    pub fn around(&self, bump: usize) -> &[usize] {
        &self.around[self.starts[bump]..self.starts[bump + 1]]
    }

    /// Σ ∫ G(∇φ)ᵀ D G(∇φ) over the elements around a bump, in space, N/m.
    pub fn stiffness(&self, bump: usize) -> Matrix3<f64> {
        let edges = &self.edges[self.starts[bump]..self.starts[bump + 1]];
        edges.iter().map(|edge| self.kept[self.solids[edge.at]].turned[edge.k]).sum()
    }
}
