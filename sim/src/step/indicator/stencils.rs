//! The bumps of a mesh and their stiffness, kept while mesh and material stay.

use std::array::from_fn;

use nalgebra::Matrix3;
use pulp::{Arch, Simd, WithSimd};
use yawara_corot::{EDGES, Element};
use yawara_embed::{MixedModuli, strain_operator};

use crate::body::BodyState;

/// The bumps φ = 4 λ_a λ_b of all edges (a, b) of elements that are not void.
///
/// What a stencil was made of is known by its element's stamp, so nobody has to say what has changed.
#[derive(Default)]
pub(super) struct Stencils {
    /// By element number.
    marks: Vec<Mark>,
    /// Element i is lane i % [`LANES`] of packet i / `LANES`.
    packets: Vec<Packet>,
    is_mixed: bool,
    /// Numbers of the elements that are not void.
    pub solids: Vec<usize>,
    /// The ends of each bump, vertex numbers in ascending order; ascending.
    pub ends: Vec<[usize; 2]>,
    /// How many elements that are not void are around each.
    pub around: Vec<usize>,
    /// By element number the bumps of its edges; nothing of one that is void.
    pub of: Vec<[usize; 6]>,
    /// Where the bumps of each lower end begin.
    firsts: Vec<usize>,
    /// Edges of `solids` on their way into the order of their ends.
    edges: [Vec<Edge>; 2],
}

/// What an element's stencil was made of.
#[derive(PartialEq)]
struct Mark {
    stamp: u64,
    vertices: [usize; 4],
    is_void: bool,
}

/// Elements side by side.
const LANES: usize = 8;

type Row = [f64; LANES];

/// The parts that elements have of the stiffness of their bumps.
#[derive(Clone, Default)]
struct Packet {
    /// Row-major.
    rotation: [Row; 9],
    /// By edge the entries at [`LOWER`] in the element's frame, N/m.
    own: [[Row; 6]; 6],
}

/// Row and column of the entries of a symmetric matrix, and where they are among these.
const LOWER: [[usize; 2]; 6] = [[0, 0], [1, 0], [2, 0], [1, 1], [2, 1], [2, 2]];
const AT: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

/// Edge `k` of an element that is not void.
#[derive(Clone, Copy, Default)]
struct Edge {
    ends: [u32; 2],
    element: u32,
    k: u32,
}

impl Packet {
    fn set_own(&mut self, lane: usize, element: &Element, is_mixed: bool) {
        for (rows, own) in self.own.iter_mut().zip(own_stiffness(element, is_mixed)) {
            for (row, [i, j]) in rows.iter_mut().zip(LOWER) {
                row[lane] = own[(i, j)];
            }
        }
    }

    /// Whether the rotation was another before; no branch by entry, so that these are compared side by side.
    fn set_rotation(&mut self, lane: usize, rotation: &Matrix3<f64>) -> bool {
        let mut differ = 0;
        for (i, row) in self.rotation.iter_mut().enumerate() {
            let entry = rotation[(i / 3, i % 3)];
            differ |= row[lane].to_bits() ^ entry.to_bits();
            row[lane] = entry;
        }
        differ != 0
    }

    /// The entries of R A Rᵀ of an edge at [`LOWER`]; plain loops, which the compiler brings to the vector unit
    /// that its caller was chosen for.
    #[inline(always)]
    fn turn(&self, edge: usize, turned: &mut [Row; 6]) {
        let (a, r) = (&self.own[edge], &self.rotation);
        let mut half = [[0.0; LANES]; 9];
        for i in 0..3 {
            for j in 0..3 {
                let (x, y, z) = (&a[AT[j][0]], &a[AT[j][1]], &a[AT[j][2]]);
                let (r0, r1, r2) = (&r[3 * i], &r[3 * i + 1], &r[3 * i + 2]);
                for lane in 0..LANES {
                    half[3 * i + j][lane] =
                        r0[lane] * x[lane] + r1[lane] * y[lane] + r2[lane] * z[lane];
                }
            }
        }
        for entry in 0..6 {
            let [i, j] = LOWER[entry];
            let (h0, h1, h2) = (&half[3 * i], &half[3 * i + 1], &half[3 * i + 2]);
            let (r0, r1, r2) = (&r[3 * j], &r[3 * j + 1], &r[3 * j + 2]);
            for lane in 0..LANES {
                turned[entry][lane] =
                    h0[lane] * r0[lane] + h1[lane] * r1[lane] + h2[lane] * r2[lane];
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
    let own: [Matrix3<f64>; 4] = from_fn(|i| operators[i].transpose() * stresses[i]);
    EDGES.map(|[i, j]| {
        // ∫ λ_a² = V/10 and ∫ λ_a λ_b = V/20.
        let across = operators[i].transpose() * stresses[j];
        geometry.volume * (1.6 * (own[i] + own[j]) + 0.8 * (across + across.transpose()))
    })
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
            self.marks.clear();
        }
        let mut is_same_mesh = self.marks.len() == elements.len();
        let mut is_same = true;
        self.marks.truncate(elements.len());
        self.packets.resize(elements.len().div_ceil(LANES), Packet::default());
        for (number, element) in elements.iter().enumerate() {
            let (packet, lane) = (&mut self.packets[number / LANES], number % LANES);
            is_same &= !packet.set_rotation(lane, &state.body.rotation(number));
            let (stamp, vertices) = (state.body.stamp(number), element.vertices);
            let mark = Mark { stamp, vertices, is_void: state.is_void(element.tet) };
            match self.marks.get_mut(number) {
                Some(before) if *before == mark => continue,
                Some(before) => {
                    is_same_mesh &= before.vertices == vertices && before.is_void == mark.is_void;
                    *before = mark;
                }
                None => self.marks.push(mark),
            }
            is_same = false;
            packet.set_own(lane, element, is_mixed);
        }
        if !is_same_mesh {
            self.find_edges(state.positions().len());
        }
        is_same_mesh && is_same
    }

    /// Finds the bumps of `marks`, whose vertex numbers are below `vertices`.
    fn find_edges(&mut self, vertices: usize) {
        let Self { marks, solids, ends, around, of, firsts, edges: [edges, by_upper], .. } = self;
        solids.clear();
        solids.extend((0..marks.len()).filter(|&number| !marks[number].is_void));
        edges.clear();
        for &number in solids.iter() {
            let corners = marks[number].vertices.map(|v| v as u32);
            for (k, [i, j]) in EDGES.into_iter().enumerate() {
                let [a, b] = [corners[i], corners[j]];
                let ends = [a.min(b), a.max(b)];
                edges.push(Edge { ends, element: number as u32, k: k as u32 });
            }
        }
        // By the lower end, then the upper one, then the element.
        by_upper.resize(edges.len(), Edge::default());
        let mut next = vec![0; vertices + 1];
        sort_by_end(edges, 1, &mut next, by_upper);
        sort_by_end(by_upper, 0, &mut next, edges);
        of.clear();
        of.resize(marks.len(), [0; 6]);
        ends.clear();
        around.clear();
        for &Edge { ends: edge, element, k } in edges.iter() {
            let edge = edge.map(|v| v as usize);
            if ends.last() != Some(&edge) {
                ends.push(edge);
                around.push(0);
            }
            of[element as usize][k as usize] = ends.len() - 1;
            around[ends.len() - 1] += 1;
        }
        firsts.clear();
        firsts.resize(vertices + 1, 0);
        ends.iter().for_each(|edge| firsts[edge[0] + 1] += 1);
        for v in 0..vertices {
            firsts[v + 1] += firsts[v];
        }
    }

    /// The bump between two vertices, in ascending order.
    pub fn find(&self, edge: &[usize; 2]) -> Option<usize> {
        let (from, to) = (*self.firsts.get(edge[0])?, *self.firsts.get(edge[0] + 1)?);
        let at = self.ends[from..to].iter().position(|ends| ends[1] == edge[1])?;
        Some(from + at)
    }

    /// By bump Σ ∫ G(∇φ)ᵀ D G(∇φ) over the elements around it, in space, N/m: the entries at [`LOWER`].
    ///
    /// Cost: some five hundred flops per element.
    pub fn stiffness(&self, sums: &mut Vec<[f64; 6]>) {
        sums.clear();
        sums.resize(self.ends.len(), [0.0; 6]);
        Arch::new().dispatch(Sum { stencils: self, sums });
    }
}

/// Adds the parts of all elements up.
struct Sum<'a> {
    stencils: &'a Stencils,
    sums: &'a mut [[f64; 6]],
}

impl WithSimd for Sum<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Stencils { marks, packets, of, .. } = self.stencils;
        for (packet, (marks, of)) in packets.iter().zip(marks.chunks(LANES).zip(of.chunks(LANES))) {
            for edge in 0..6 {
                let mut turned = [[0.0; LANES]; 6];
                packet.turn(edge, &mut turned);
                for (lane, (mark, of)) in marks.iter().zip(of).enumerate() {
                    if mark.is_void {
                        continue;
                    }
                    let sum = &mut self.sums[of[edge]];
                    for entry in 0..6 {
                        sum[entry] += turned[entry][lane];
                    }
                }
            }
        }
    }
}
