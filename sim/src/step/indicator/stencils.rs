//! The bumps of a mesh and their stiffness, kept while mesh and material stay.

use std::array::from_fn;

use nalgebra::Matrix3;
use pulp::Arch;
use yawara_corot::{EDGES, Element};
use yawara_embed::{MixedModuli, strain_operator};

use crate::body::BodyState;

/// The bumps φ = 4 λ_a λ_b of all edges (a, b) of elements that are not void.
///
/// What a stencil was made of is known by its element's stamp, so nobody has to say what has changed.
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
    /// Edges of `solids` by their ends, and on their way into that order.
    edges: [Vec<Edge>; 2],
    /// Elements whose stiffness in space is not what it was.
    turning: Vec<usize>,
}

/// An element's part of the stiffness of its bumps, and what that was made of.
struct Stencil {
    stamp: u64,
    vertices: [usize; 4],
    is_void: bool,
    rotation: Matrix3<f64>,
    /// In its frame, N/m: entries of all edges side by side, column by column.
    own: [[f64; 6]; 9],
    /// In space, N/m: the entries of each edge at [`LOWER`].
    turned: [[f64; 6]; 6],
}

/// Row and column of the entries that a factor is made of.
const LOWER: [[usize; 2]; 6] = [[0, 0], [1, 0], [2, 0], [1, 1], [2, 1], [2, 2]];

/// Edge `k` of the element at `at` among those that are not void.
#[derive(Clone, Copy, Default)]
struct Edge {
    ends: [u32; 2],
    at: u32,
    k: u32,
}

impl Stencil {
    fn new(
        stamp: u64,
        element: &Element,
        rotation: Matrix3<f64>,
        is_void: bool,
        is_mixed: bool,
    ) -> Self {
        let vertices = element.vertices;
        let own = own_stiffness(element, is_mixed);
        let own = from_fn(|entry| own.map(|own| own[entry]));
        Self { stamp, vertices, is_void, rotation, own, turned: [[0.0; 6]; 6] }
    }

    /// R A Rᵀ with plain loops, which the compiler brings to the vector unit that its caller was chosen for.
    #[inline(always)]
    fn turn(&mut self) {
        let r = &self.rotation;
        let mut half = [[0.0; 6]; 9];
        for row in 0..3 {
            for column in 0..3 {
                let [a, b, c] = [0, 1, 2].map(|m| &self.own[3 * column + m]);
                for k in 0..6 {
                    half[3 * column + row][k] =
                        r[(row, 0)] * a[k] + r[(row, 1)] * b[k] + r[(row, 2)] * c[k];
                }
            }
        }
        for (entry, [row, column]) in LOWER.into_iter().enumerate() {
            let [a, b, c] = [0, 1, 2].map(|m| &half[3 * m + row]);
            for k in 0..6 {
                self.turned[k][entry] =
                    a[k] * r[(column, 0)] + b[k] * r[(column, 1)] + c[k] * r[(column, 2)];
            }
        }
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

/// Whether both have the same bits; no branch by number, so that they are compared side by side.
fn is_same(a: &Matrix3<f64>, b: &Matrix3<f64>) -> bool {
    a.iter().zip(b).fold(0, |differ, (a, b)| differ | (a.to_bits() ^ b.to_bits())) == 0
}

/// Orders edges by one of their ends, those of the same as they were.
fn sort_by_end(edges: &[Edge], end: usize, next: &mut [usize], sorted: &mut [Edge]) {
    next.fill(0);
    edges.iter().for_each(|edge| next[edge.ends[end] as usize + 1] += 1);
    for v in 1..next.len() {
        next[v] += next[v - 1];
    }
    for edge in edges {
        let place = &mut next[edge.ends[end] as usize];
        sorted[*place] = *edge;
        *place += 1;
    }
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
        self.turning.clear();
        self.kept.truncate(elements.len());
        for (number, element) in elements.iter().enumerate() {
            let is_void = state.is_void(element.tet);
            let stamp = state.body.stamp(number);
            let rotation = state.body.rotation(number);
            let made = || Stencil::new(stamp, element, rotation, is_void, is_mixed);
            let Some(kept) = self.kept.get_mut(number) else {
                self.kept.push(made());
                self.turning.push(number);
                continue;
            };
            is_same_mesh &= kept.vertices == element.vertices && kept.is_void == is_void;
            let is_same_element = kept.stamp == stamp && kept.is_void == is_void;
            if is_same_element && is_same(&kept.rotation, &rotation) {
                continue;
            }
            match is_same_element {
                true => kept.rotation = rotation,
                false => *kept = made(),
            }
            self.turning.push(number);
        }
        Arch::new().dispatch(|| {
            for &number in &self.turning {
                self.kept[number].turn();
            }
        });
        if !is_same_mesh {
            self.find_edges(state.positions().len());
        }
        is_same_mesh && self.turning.is_empty()
    }

    /// Finds the bumps of `kept`, whose vertex numbers are below `vertices`.
    fn find_edges(&mut self, vertices: usize) {
        let Self { kept, solids, ends, of, around, starts, edges: [edges, by_upper], .. } = self;
        solids.clear();
        solids.extend((0..kept.len()).filter(|&number| !kept[number].is_void));
        edges.clear();
        for (at, &number) in solids.iter().enumerate() {
            let corners = kept[number].vertices.map(|v| v as u32);
            for (k, [i, j]) in EDGES.into_iter().enumerate() {
                let [a, b] = [corners[i], corners[j]];
                edges.push(Edge { ends: [a.min(b), a.max(b)], at: at as u32, k: k as u32 });
            }
        }
        // By the lower end, then the upper one, then the element.
        by_upper.resize(edges.len(), Edge::default());
        let mut next = vec![0; vertices + 1];
        sort_by_end(edges, 1, &mut next, by_upper);
        sort_by_end(by_upper, 0, &mut next, edges);
        of.clear();
        of.resize(solids.len(), [0; 6]);
        ends.clear();
        starts.clear();
        around.clear();
        for (number, &Edge { ends: edge, at, k }) in edges.iter().enumerate() {
            let edge = edge.map(|v| v as usize);
            if ends.last() != Some(&edge) {
                ends.push(edge);
                starts.push(number);
            }
            of[at as usize][k as usize] = ends.len() - 1;
            around.push(solids[at as usize]);
        }
        starts.push(edges.len());
    }

    /// Numbers of the elements around a bump.
    pub fn around(&self, bump: usize) -> &[usize] {
        &self.around[self.starts[bump]..self.starts[bump + 1]]
    }

    /// Σ ∫ G(∇φ)ᵀ D G(∇φ) over the elements around a bump, in space, N/m: the entries at [`LOWER`].
    pub fn stiffness(&self, bump: usize) -> [f64; 6] {
        let mut sums = [0.0; 6];
        for edge in &self.edges[0][self.starts[bump]..self.starts[bump + 1]] {
            let turned = &self.kept[self.solids[edge.at as usize]].turned[edge.k as usize];
            sums.iter_mut().zip(turned).for_each(|(sum, entry)| *sum += entry);
        }
        sums
    }
}
