//! What one split or merge does to the stiffness: the hand-over to the inverse.

use faer::Mat;
use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3};
use yawara_mesh::{MeshDelta, RingTet, Tet, VertexId};

use crate::element::LinearTet;
use crate::embedding::Embedding;
use crate::homogenisation::{ChildPair, Excess};

/// The stiffness of the tetrahedra around a bisected edge, before and after.
///
/// In terms of the old displacements u and of d = u_M − ½(u_a+u_b), the refined ring's energy is
/// ½uᵀ(K_p + F Fᵀ − N Nᵀ)u + uᵀB d + ½dᵀA22 d. All in N/m; r = 3 · `vertices.len()` rows,
/// vertex-major.
#[derive(Clone, Debug)]
pub struct RingStiffness {
    /// The ring's old vertices, ascending.
    pub vertices: Vec<VertexId>,
    /// Coarse ring, r×r.
    pub k_p: Mat<f64>,
    /// Refined ring on old degrees of freedom, r×r.
    pub k_c: Mat<f64>,
    /// Refined ring, old × new, r×3.
    pub a12: Mat<f64>,
    /// Refined ring, new × new, 3×3.
    pub a22: Mat<f64>,
    /// B = a12 + HᵀA22, r×3.
    pub b: Mat<f64>,
    /// F, r×q: how much the halves with their edge held straight are stiffer than the parents.
    pub positive: Mat<f64>,
    /// N, r×q': the same where they are softer; empty for every bound-respecting homogenisation.
    pub negative: Mat<f64>,
}

/// One parent of the ring with its geometry and both elasticities.
struct Part {
    rows: [usize; 4],
    geometry: LinearTet,
    pair: ChildPair,
    parent_elasticity: Matrix6<f64>,
    excess: Excess,
}

impl RingStiffness {
    /// Assembles the hand-over of `delta`; `position` gives rest positions (m) of old vertices.
    ///
    /// Cost: a few thousand flops per ring tetrahedron.
    pub fn new(
        delta: &MeshDelta,
        embedding: &Embedding,
        position: impl Fn(VertexId) -> Vector3<f64>,
    ) -> Self {
        let mut vertices: Vec<VertexId> =
            delta.ring.iter().flat_map(|t| t.parent.vertices).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let row = |v: VertexId| vertices.binary_search(&v).unwrap_or_default();
        let parts: Vec<Part> = delta
            .ring
            .iter()
            .map(|RingTet { parent, .. }| Part::new(parent, embedding, &position, &row))
            .collect();
        let ends = delta.edge.map(row);
        Self::assemble(vertices, &parts, ends)
    }

    fn assemble(vertices: Vec<VertexId>, parts: &[Part], ends: [usize; 2]) -> Self {
        let r = 3 * vertices.len();
        let mut k_p = Mat::zeros(r, r);
        let mut k_c = Mat::zeros(r, r);
        let mut b = Mat::zeros(r, 3);
        let mut a22 = Matrix3::zeros();
        let (mut positive, mut negative) = (Vec::new(), Vec::new());
        for part in parts {
            let mean = part.pair.mean_elasticity();
            scatter(&mut k_p, &part.rows, &part.geometry.stiffness(&part.parent_elasticity));
            scatter(&mut k_c, &part.rows, &part.geometry.stiffness(&mean));
            let [coupling, own] = part.coupling();
            let strain = part.geometry.strain_matrix().transpose();
            scatter_rows(&mut b, &part.rows, &(strain * coupling));
            a22 += own.fixed_rows::<3>(0);
            part.excess_columns(&mut positive, &mut negative);
        }
        let mut a12 = b.clone();
        let a22 = 0.5 * (a22 + a22.transpose());
        condense_straight_edge(&mut k_c, &mut a12, &b, &a22, ends);
        symmetrise(&mut k_p);
        symmetrise(&mut k_c);
        Self {
            a22: Mat::from_fn(3, 3, |i, j| a22[(i, j)]),
            positive: columns(&vertices, &positive),
            negative: columns(&vertices, &negative),
            vertices,
            k_p,
            k_c,
            a12,
            b,
        }
    }
}

impl Part {
    fn new(
        parent: &Tet,
        embedding: &Embedding,
        position: &impl Fn(VertexId) -> Vector3<f64>,
        row: &impl Fn(VertexId) -> usize,
    ) -> Self {
        let geometry = LinearTet::new(&parent.vertices.map(position));
        let (pair, combined) = embedding.combine(parent.node, &geometry, parent.level);
        Self {
            rows: parent.vertices.map(row),
            geometry,
            pair,
            parent_elasticity: embedding.elasticity(parent.node),
            excess: combined.excess,
        }
    }

    /// Σ V_c D_c G_c (6×3) and Σ V_c G_cᵀD_cG_c (upper 3×3 of the second).
    fn coupling(&self) -> [SMatrix<f64, 6, 3>; 2] {
        let half = 0.5 * self.geometry.volume;
        let mut coupling = SMatrix::<f64, 6, 3>::zeros();
        let mut own = SMatrix::<f64, 6, 3>::zeros();
        for (g, d) in self.pair.strain_operators().iter().zip(&self.pair.elasticity) {
            let stress = half * d * g;
            let energy = g.transpose() * stress;
            coupling += stress;
            let mut upper = own.fixed_rows_mut::<3>(0);
            upper += energy;
        }
        [coupling, own]
    }

    /// Appends the columns √V Bᵀ E of ½(D₁+D₂) − D_p = Σ ± E Eᵀ.
    fn excess_columns(&self, positive: &mut Vec<RingColumn>, negative: &mut Vec<RingColumn>) {
        let root_volume = self.geometry.volume.sqrt();
        let strain = self.geometry.strain_matrix().transpose();
        match &self.excess {
            Excess::Zero => {}
            Excess::Rank3(factor) => {
                let f = strain * factor * root_volume;
                positive.extend(f.column_iter().map(|c| (self.rows, c.into_owned())));
            }
            Excess::Unfactored => {
                let excess = self.pair.mean_elasticity() - self.parent_elasticity;
                let eigen = excess.symmetric_eigen();
                for (value, vector) in
                    eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter())
                {
                    let column = strain * vector * (root_volume * value.abs().sqrt());
                    let side = if *value >= 0.0 { &mut *positive } else { &mut *negative };
                    if *value != 0.0 {
                        side.push((self.rows, column));
                    }
                }
            }
        }
    }
}

/// Rows of the ring that a tetrahedron's corners have, and its 12 entries of a column.
type RingColumn = ([usize; 4], nalgebra::SVector<f64, 12>);

fn columns(vertices: &[VertexId], entries: &[RingColumn]) -> Mat<f64> {
    let mut matrix = Mat::zeros(3 * vertices.len(), entries.len());
    for (j, (rows, column)) in entries.iter().enumerate() {
        for corner in 0..4 {
            for axis in 0..3 {
                matrix[(3 * rows[corner] + axis, j)] = column[3 * corner + axis];
            }
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

fn scatter(target: &mut Mat<f64>, rows: &[usize; 4], k: &SMatrix<f64, 12, 12>) {
    for i in 0..12 {
        for j in 0..12 {
            target[(3 * rows[i / 3] + i % 3, 3 * rows[j / 3] + j % 3)] += k[(i, j)];
        }
    }
}

fn scatter_rows(target: &mut Mat<f64>, rows: &[usize; 4], block: &SMatrix<f64, 12, 3>) {
    for i in 0..12 {
        for j in 0..3 {
            target[(3 * rows[i / 3] + i % 3, j)] += block[(i, j)];
        }
    }
}

/// From (u, d) to nodal (u, u_M): a12 = B − HᵀA22, K_c = K_0 − B H − HᵀBᵀ + HᵀA22 H, with
/// H = ½ on both ends of the edge.
fn condense_straight_edge(
    k_c: &mut Mat<f64>,
    a12: &mut Mat<f64>,
    b: &Mat<f64>,
    a22: &Matrix3<f64>,
    ends: [usize; 2],
) {
    for end in ends {
        for i in 0..3 {
            for j in 0..3 {
                a12[(3 * end + i, j)] -= 0.5 * a22[(i, j)];
            }
        }
        for i in 0..b.nrows() {
            for j in 0..3 {
                k_c[(i, 3 * end + j)] -= 0.5 * b[(i, j)];
                k_c[(3 * end + j, i)] -= 0.5 * b[(i, j)];
            }
        }
        for other in ends {
            for i in 0..3 {
                for j in 0..3 {
                    k_c[(3 * end + i, 3 * other + j)] += 0.25 * a22[(i, j)];
                }
            }
        }
    }
}
