//! What one split or merge does to the stiffness: the hand-over to the inverse.

use faer::{Mat, Scale};
use nalgebra::{Matrix4, Vector3};
use yawara_mesh::{MeshDelta, RingTet, TetId, VertexId};

use super::halved::Halved;
use crate::embedding::Embedding;

/// Displacements per vertex, the first of its unknowns.
pub(super) const DISPLACEMENTS: usize = 3;

/// The stiffness of the tetrahedra around a bisected edge, before and after.
///
/// In terms of the old unknowns u and of d = u_M − ½(u_a+u_b), the refined ring's energy is
/// ½uᵀ(K_p + F Fᵀ − N Nᵀ)u + uᵀB d + ½dᵀA22 d. All in N/m; m unknowns per vertex,
/// r = m · `vertices.len()` rows, vertex-major.
#[derive(Clone, Debug)]
pub struct RingStiffness {
    /// The ring's old vertices, ascending.
    pub vertices: Vec<VertexId>,
    /// Coarse ring, r×r.
    pub k_p: Mat<f64>,
    /// Refined ring on old degrees of freedom, r×r.
    pub k_c: Mat<f64>,
    /// Refined ring, old × new, r×m.
    pub a12: Mat<f64>,
    /// Refined ring, new × new, m×m.
    pub a22: Mat<f64>,
    /// B = a12 + HᵀA22, r×m.
    pub b: Mat<f64>,
    /// F, r×q: how much the halves with their edge held straight are stiffer than the parents.
    pub positive: Mat<f64>,
    /// N, r×q': the same where they are softer; with displacements alone, empty for every
    /// bound-respecting homogenisation.
    pub negative: Mat<f64>,
}

/// One parent's share of a ring in its own corners' unknowns u (4m of them, vertex-major) and in
/// d = u_M − ½(u_a+u_b), m unknowns, a its corner 0: the energy of its halves is
/// ½uᵀ`straight`u + uᵀ`coupling`d + ½dᵀ`own`d. With P `positive`, N `negative` and
/// w = u_a − u_b, ½uᵀ(`straight` − `parent`)u is
/// ½uᵀ(P Pᵀ − N Nᵀ)u + ½(`edge`ᵀw)² + Σ_i `lean`_i w·u_i, the last term of displacements alone.
#[derive(Clone, Debug)]
pub struct RingPart {
    /// The parent's own matrix, 4m×4m.
    pub parent: Mat<f64>,
    /// The halves with d = 0, 4m×4m.
    pub straight: Mat<f64>,
    /// Old × d, 4m×m.
    pub coupling: Mat<f64>,
    /// d × d, m×m.
    pub own: Mat<f64>,
    /// 4m rows.
    pub positive: Mat<f64>,
    /// 4m rows.
    pub negative: Mat<f64>,
    /// m entries; the same up to a factor in all parents of a ring, which has one such column for
    /// all of them.
    pub edge: Vec<f64>,
    /// By corner; a ring has at most three columns of either sign for all of them.
    pub lean: [f64; 4],
}

impl RingPart {
    /// The share of a ring with all its matrices multiplied by `factor` > 0.
    #[must_use]
    pub fn scaled(mut self, factor: f64) -> Self {
        for k in [&mut self.parent, &mut self.straight, &mut self.coupling, &mut self.own] {
            *k *= Scale(factor);
        }
        self.positive *= Scale(factor.sqrt());
        self.negative *= Scale(factor.sqrt());
        self.edge.iter_mut().for_each(|e| *e *= factor.sqrt());
        self.lean.iter_mut().for_each(|y| *y *= factor);
        self
    }
}

impl RingStiffness {
    /// Assembles the hand-over of `delta` from the shares of its parents, `m` unknowns per vertex.
    ///
    /// Cost: that of `part` and O(m²) per ring tetrahedron.
    pub fn assemble(
        m: usize,
        delta: &MeshDelta,
        embedding: &Embedding,
        position: &dyn Fn(VertexId) -> Vector3<f64>,
        part: impl Fn(&Halved) -> RingPart,
    ) -> Self {
        let mut vertices: Vec<VertexId> =
            delta.ring.iter().flat_map(|t| t.parent.vertices).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let row = |v: VertexId| vertices.binary_search(&v).unwrap_or_default();
        let place = |RingTet { parent, .. }: &RingTet| {
            let halved = Halved::new(parent, embedding, position);
            let corners = parent.vertices.map(row);
            Placed { corners, ends: [0, halved.end].map(|i| corners[i]), part: part(&halved) }
        };
        let parts =
            Parts { m, vertices: vertices.len(), placed: delta.ring.iter().map(place).collect() };
        let (r, ends) = (m * vertices.len(), delta.edge.map(row));
        let [mut k_p, mut k_c] =
            [parts.sum(r, |part| &part.parent), parts.sum(r, |part| &part.straight)];
        let b = parts.sum(m, |part| &part.coupling);
        let (mut a12, mut a22) = (b.clone(), Mat::zeros(m, m));
        parts.placed.iter().for_each(|placed| a22 += &placed.part.own);
        symmetrise(&mut a22);
        condense_straight_edge(&mut k_c, &mut a12, &b, &a22, ends);
        symmetrise(&mut k_p);
        symmetrise(&mut k_c);
        let [lean, opposed] = parts.lean(ends);
        let positive = beside(&parts.columns(|part| &part.positive), &parts.edge());
        let negative = beside(&parts.columns(|part| &part.negative), &opposed);
        Self { vertices, k_p, k_c, a12, a22, b, positive: beside(&positive, &lean), negative }
    }

    /// The same with a further energy that is linear in the fine points of material, such as that of
    /// an elastic support: `of` tells its matrix on a half's corners, the same for each axis, N/m.
    ///
    /// As the spaces of coarse and refined ring are nested, the halves with d = 0 have the energy of
    /// the parents: F and N stay as they are. Cost: O(1) per half.
    #[must_use]
    pub fn with_springs(
        mut self,
        delta: &MeshDelta,
        of: &dyn Fn(TetId) -> Option<Matrix4<f64>>,
    ) -> Self {
        let m = self.a22.nrows();
        let vertices = std::mem::take(&mut self.vertices);
        let row = |v: VertexId| vertices.binary_search(&v).unwrap_or_default();
        let halves = delta.ring.iter().flat_map(|ring_tet| &ring_tet.children);
        for (half, springs) in halves.filter_map(|half| Some((half, of(half.id)?))) {
            // What a corner weighs of old vertices while d = 0.
            let straight = |v: VertexId| match v == delta.vertex {
                true => delta.edge.map(|end| (row(end), 0.5)).to_vec(),
                false => vec![(row(v), 1.0)],
            };
            for (i, j) in (0..4).flat_map(|j| (0..4).map(move |i| (i, j))) {
                let (v, w, s) = (half.vertices[i], half.vertices[j], springs[(i, j)]);
                let add = |part: &mut Mat<f64>, i: usize, j: usize, s: f64| {
                    (0..DISPLACEMENTS).for_each(|axis| part[(m * i + axis, m * j + axis)] += s);
                };
                for (i, a) in straight(v) {
                    straight(w).iter().for_each(|(j, b)| add(&mut self.k_p, i, *j, a * b * s));
                    if w == delta.vertex {
                        add(&mut self.b, i, 0, a * s);
                    }
                }
                match (v == delta.vertex, w == delta.vertex) {
                    (false, false) => add(&mut self.k_c, row(v), row(w), s),
                    (false, true) => add(&mut self.a12, row(v), 0, s),
                    (true, true) => add(&mut self.a22, 0, 0, s),
                    (true, false) => {}
                }
            }
        }
        Self { vertices, ..self }
    }

    /// The rows of the old vertices that `has_rows`: the hand-over to a matrix in which the others
    /// are fixed. Cost: O(r²).
    #[must_use]
    pub fn restricted(&self, has_rows: impl Fn(VertexId) -> bool) -> Self {
        let kept: Vec<usize> =
            (0..self.vertices.len()).filter(|&i| has_rows(self.vertices[i])).collect();
        let m = self.a22.nrows();
        let (row, n) = (|i: usize| m * kept[i / m] + i % m, m * kept.len());
        let rows = |part: &Mat<f64>| Mat::from_fn(n, part.ncols(), |i, j| part[(row(i), j)]);
        let square = |part: &Mat<f64>| Mat::from_fn(n, n, |i, j| part[(row(i), row(j))]);
        Self {
            vertices: kept.iter().map(|&i| self.vertices[i]).collect(),
            k_p: square(&self.k_p),
            k_c: square(&self.k_c),
            a12: rows(&self.a12),
            a22: self.a22.clone(),
            b: rows(&self.b),
            positive: rows(&self.positive),
            negative: rows(&self.negative),
        }
    }
}

/// The share of one parent: the ring's vertices at its corners, and at a and b.
struct Placed {
    corners: [usize; 4],
    ends: [usize; 2],
    part: RingPart,
}

impl Placed {
    /// The ring's row of the corners' unknown `i`.
    fn row(&self, i: usize) -> usize {
        let m = self.part.own.nrows();
        m * self.corners[i / m] + i % m
    }
}

/// The shares of a ring's parents, in the order of the ring.
struct Parts {
    /// Unknowns per vertex.
    m: usize,
    vertices: usize,
    placed: Vec<Placed>,
}

impl Parts {
    /// The sum of a matrix whose rows are the corners' unknowns, and so its columns or those of d.
    fn sum(&self, columns: usize, of: impl Fn(&RingPart) -> &Mat<f64>) -> Mat<f64> {
        let mut sum = Mat::zeros(self.m * self.vertices, columns);
        for placed in &self.placed {
            let part = of(&placed.part);
            for j in 0..part.ncols() {
                let column = if part.ncols() == part.nrows() { placed.row(j) } else { j };
                (0..part.nrows()).for_each(|i| sum[(placed.row(i), column)] += part[(i, j)]);
            }
        }
        sum
    }

    /// The columns of all of them.
    fn columns(&self, of: impl Fn(&RingPart) -> &Mat<f64>) -> Mat<f64> {
        let count = self.placed.iter().map(|placed| of(&placed.part).ncols()).sum();
        let mut all = Mat::zeros(self.m * self.vertices, count);
        let mut at = 0;
        for placed in &self.placed {
            for column in of(&placed.part).col_iter() {
                (0..column.nrows()).for_each(|i| all[(placed.row(i), at)] = column[i]);
                at += 1;
            }
        }
        all
    }

    /// The one column of the edge, or none.
    fn edge(&self) -> Mat<f64> {
        let square = |e: &[f64]| 2.0 * e.iter().map(|e| e * e).sum::<f64>();
        let total: f64 = self.placed.iter().map(|placed| square(&placed.part.edge)).sum();
        let longer =
            |a: &&Placed, b: &&Placed| square(&a.part.edge).total_cmp(&square(&b.part.edge));
        let longest = self.placed.iter().rev().max_by(longer).filter(|_| total != 0.0);
        let mut column = Mat::zeros(self.m * self.vertices, usize::from(longest.is_some()));
        if let Some(Placed { ends: [a, b], part, .. }) = longest {
            let factor = total.sqrt() / square(&part.edge).sqrt();
            for (i, e) in part.edge.iter().enumerate() {
                column[(self.m * a + i, 0)] = e * factor;
                column[(self.m * b + i, 0)] = -e * factor;
            }
        }
        column
    }

    /// The columns of either sign that stand for all that leans to an end of the edge.
    fn lean(&self, [a, b]: [usize; 2]) -> [Mat<f64>; 2] {
        let (mut x, mut y) = (vec![0.0; self.vertices], vec![0.0; self.vertices]);
        (x[a], x[b]) = (1.0, -1.0);
        for Placed { corners, ends, part } in &self.placed {
            let sign = if ends[0] == a { 1.0 } else { -1.0 };
            for (v, lean) in corners.iter().zip(part.lean) {
                y[*v] += sign * lean;
            }
        }
        let (m, r) = (self.m, self.m * self.vertices);
        signed_pair(&x, &y).map(|column| match column {
            None => Mat::zeros(r, 0),
            Some(c) => Mat::from_fn(r, 3, |i, j| if i % m == j { c[i / m] } else { 0.0 }),
        })
    }
}

/// The columns p and n with x yᵀ + y xᵀ = p pᵀ − n nᵀ; a column that is nothing but rounding is
/// left out.
fn signed_pair(x: &[f64], y: &[f64]) -> [Option<Vec<f64>>; 2] {
    let norm = |v: &[f64]| v.iter().map(|a| a * a).sum::<f64>().sqrt();
    let (long, short) = (norm(x), norm(y));
    if !(short > 0.0) || !(long > 0.0) {
        return [None, None];
    }
    // Both as long as each other: then p and n are orthogonal and nothing cancels.
    let balance = (short / long).sqrt();
    [1.0, -1.0].map(|sign| {
        let column: Vec<f64> = x
            .iter()
            .zip(y)
            .map(|(x, y)| std::f64::consts::FRAC_1_SQRT_2 * (x * balance + sign * y / balance))
            .collect();
        (norm(&column) > 1e-14 * balance * long).then_some(column)
    })
}

pub(super) fn beside(left: &Mat<f64>, right: &Mat<f64>) -> Mat<f64> {
    let n = left.ncols();
    Mat::from_fn(left.nrows(), n + right.ncols(), |i, j| match j < n {
        true => left[(i, j)],
        false => right[(i, j - n)],
    })
}

/// Takes out the rounding that differs between mirrored entries: near incompressibility it is
/// that of the bulk modulus, far above the shear stiffness.
fn symmetrise(k: &mut Mat<f64>) {
    for j in 0..k.ncols() {
        for i in 0..j {
            let mean = 0.5 * (k[(i, j)] + k[(j, i)]);
            k[(i, j)] = mean;
            k[(j, i)] = mean;
        }
    }
}

/// From (u, d) to nodal (u, u_M): a12 = B − HᵀA22, K_c = K_0 − B H − HᵀBᵀ + HᵀA22 H, with
/// H = ½ on both ends of the edge.
fn condense_straight_edge(
    k_c: &mut Mat<f64>,
    a12: &mut Mat<f64>,
    b: &Mat<f64>,
    a22: &Mat<f64>,
    ends: [usize; 2],
) {
    let m = a22.nrows();
    for end in ends {
        for i in 0..m {
            for j in 0..m {
                a12[(m * end + i, j)] -= 0.5 * a22[(i, j)];
            }
        }
        for i in 0..b.nrows() {
            for j in 0..m {
                k_c[(i, m * end + j)] -= 0.5 * b[(i, j)];
                k_c[(m * end + j, i)] -= 0.5 * b[(i, j)];
            }
        }
        for other in ends {
            for i in 0..m {
                for j in 0..m {
                    k_c[(m * end + i, m * other + j)] += 0.25 * a22[(i, j)];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signed_pair_is_a_symmetric_product() {
        let (x, y) = ([1.0, -1.0, 0.0], [1e-3, 2e-3, 4e-3]);
        let [p, n] = signed_pair(&x, &y).map(Option::unwrap);
        for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
            let want = x[i] * y[j] + y[i] * x[j];
            assert!((p[i] * p[j] - n[i] * n[j] - want).abs() < 1e-17);
        }
        let down = x.map(|x| -2.0 * x);
        let [p, n] = signed_pair(&x, &down);
        assert!(p.is_none() && n.is_some());
        assert_eq!(signed_pair(&x, &[0.0; 3]), [None, None]);
    }
}
