//! What one split or merge does to the stiffness: the hand-over to the inverse.

use faer::Mat;
use nalgebra::{Matrix4, SMatrix, SVector, Vector3};
use yawara_mesh::{MeshDelta, RingTet, TetId, VertexId};

use super::clamp::DISPLACEMENTS;
use super::halved::Halved;
use crate::embedding::Embedding;

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

/// One parent's share of a ring in its own corners' unknowns u (N = 4 M of them, vertex-major) and
/// in d = u_M − ½(u_a+u_b), M unknowns: the energy of its halves is
/// ½uᵀ`straight`u + uᵀ`coupling`d + ½dᵀ`own`d, with
/// `straight` − `parent` = Σ p pᵀ − Σ n nᵀ + e eᵀ.
#[derive(Clone, Debug)]
pub struct RingPart<const M: usize, const N: usize> {
    /// The parent's own matrix.
    pub parent: SMatrix<f64, N, N>,
    /// The halves with d = 0.
    pub straight: SMatrix<f64, N, N>,
    /// Old × d.
    pub coupling: SMatrix<f64, N, M>,
    /// d × d.
    pub own: SMatrix<f64, M, M>,
    /// The columns p.
    pub positive: Vec<SVector<f64, N>>,
    /// The columns n.
    pub negative: Vec<SVector<f64, N>>,
    /// e: its entries at a and b are e₀(1, −1) with the same e₀ up to a factor in all parents of a
    /// ring, all others 0, so that the ring has one such column for all; zero where there is none.
    pub edge: SVector<f64, N>,
}

impl RingStiffness {
    /// Assembles the hand-over of `delta` from the shares of its parents.
    ///
    /// Cost: that of `part` and O(N²) per ring tetrahedron.
    pub fn assemble<const M: usize, const N: usize>(
        delta: &MeshDelta,
        embedding: &Embedding,
        position: &dyn Fn(VertexId) -> Vector3<f64>,
        part: impl Fn(&Halved) -> RingPart<M, N>,
    ) -> Self {
        let mut vertices: Vec<VertexId> =
            delta.ring.iter().flat_map(|t| t.parent.vertices).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let row = |v: VertexId| vertices.binary_search(&v).unwrap_or_default();
        let mut sum = Sum::<M, N>::zeros(vertices.len());
        for RingTet { parent, .. } in &delta.ring {
            let rows = parent.vertices.map(row);
            sum.add(&rows, part(&Halved::new(parent, embedding, position)));
        }
        sum.finish(delta.edge.map(row), vertices)
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

/// Rows of the ring that a tetrahedron's corners have, and the entries of a column there.
type RingColumn<const N: usize> = ([usize; 4], SVector<f64, N>);

/// The parts of a ring summed up, in (u, d).
struct Sum<const M: usize, const N: usize> {
    k_p: Mat<f64>,
    straight: Mat<f64>,
    b: Mat<f64>,
    a22: SMatrix<f64, M, M>,
    positive: Vec<RingColumn<N>>,
    negative: Vec<RingColumn<N>>,
    /// The longest e so far, and Σ |e|².
    edge: RingColumn<N>,
    edge_square: f64,
}

impl<const M: usize, const N: usize> Sum<M, N> {
    fn zeros(vertices: usize) -> Self {
        let r = M * vertices;
        Self {
            k_p: Mat::zeros(r, r),
            straight: Mat::zeros(r, r),
            b: Mat::zeros(r, M),
            a22: SMatrix::zeros(),
            positive: Vec::new(),
            negative: Vec::new(),
            edge: ([0; 4], SVector::zeros()),
            edge_square: 0.0,
        }
    }

    fn add(&mut self, rows: &[usize; 4], part: RingPart<M, N>) {
        let at = |i: usize| M * rows[i / M] + i % M;
        for j in 0..N {
            for i in 0..N {
                self.k_p[(at(i), at(j))] += part.parent[(i, j)];
                self.straight[(at(i), at(j))] += part.straight[(i, j)];
            }
        }
        for j in 0..M {
            for i in 0..N {
                self.b[(at(i), j)] += part.coupling[(i, j)];
            }
        }
        self.a22 += part.own;
        self.positive.extend(part.positive.into_iter().map(|c| (*rows, c)));
        self.negative.extend(part.negative.into_iter().map(|c| (*rows, c)));
        let square = part.edge.norm_squared();
        if square > self.edge.1.norm_squared() {
            self.edge = (*rows, part.edge);
        }
        self.edge_square += square;
    }

    fn finish(mut self, ends: [usize; 2], vertices: Vec<VertexId>) -> RingStiffness {
        let a22 = 0.5 * (self.a22 + self.a22.transpose());
        let longest = self.edge.1.norm();
        if longest > 0.0 {
            let (rows, e) = self.edge;
            self.positive.push((rows, e * (self.edge_square.sqrt() / longest)));
        }
        let mut a12 = self.b.clone();
        let mut k_c = self.straight;
        condense_straight_edge(&mut k_c, &mut a12, &self.b, &a22, ends);
        symmetrise(&mut self.k_p);
        symmetrise(&mut k_c);
        let columns = |entries: &[RingColumn<N>]| columns::<M, N>(vertices.len(), entries);
        RingStiffness {
            a22: Mat::from_fn(M, M, |i, j| a22[(i, j)]),
            positive: columns(&self.positive),
            negative: columns(&self.negative),
            k_p: self.k_p,
            k_c,
            a12,
            b: self.b,
            vertices,
        }
    }
}

fn columns<const M: usize, const N: usize>(vertices: usize, entries: &[RingColumn<N>]) -> Mat<f64> {
    let mut matrix = Mat::zeros(M * vertices, entries.len());
    for (j, (rows, column)) in entries.iter().enumerate() {
        for i in 0..N {
            matrix[(M * rows[i / M] + i % M, j)] = column[i];
        }
    }
    matrix
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
fn condense_straight_edge<const M: usize>(
    k_c: &mut Mat<f64>,
    a12: &mut Mat<f64>,
    b: &Mat<f64>,
    a22: &SMatrix<f64, M, M>,
    ends: [usize; 2],
) {
    for end in ends {
        for i in 0..M {
            for j in 0..M {
                a12[(M * end + i, j)] -= 0.5 * a22[(i, j)];
            }
        }
        for i in 0..b.nrows() {
            for j in 0..M {
                k_c[(i, M * end + j)] -= 0.5 * b[(i, j)];
                k_c[(M * end + j, i)] -= 0.5 * b[(i, j)];
            }
        }
        for other in ends {
            for i in 0..M {
                for j in 0..M {
                    k_c[(M * end + i, M * other + j)] += 0.25 * a22[(i, j)];
                }
            }
        }
    }
}
