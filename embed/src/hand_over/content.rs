//! What a change of content does to the stiffness: a leaf stays, its material does not.

use faer::Mat;
use nalgebra::{DMatrix, Matrix6};
use yawara_mesh::VertexId;

use super::clamp::clamp;
use crate::element::ElementFormulation;
use crate::error::EmbedError;
use crate::linear_tet::LinearTet;

/// Rounding of an entry of K_new − K_old, in ε √(K_ii K_jj). An entry of BᵀDB has at most 9 terms,
/// by Cauchy and Schwarz no more than 3 √(K_ii K_jj) together, and 8 roundings of ε/2 each: 12 ε,
/// twice, and one for the difference.
const ENTRY_ROUNDING: f64 = 25.0;

/// Of what a leaf is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeafMaterial {
    /// Symmetric positive definite, Pa.
    pub elasticity: Matrix6<f64>,
    /// Read by elements whose matrix has a mass, kg/m³.
    pub density_kg_m3: f64,
}

/// The leaf whose material changes.
pub struct Leaf<'a> {
    /// Its unknowns and its matrix.
    pub element: &'a dyn ElementFormulation,
    /// Its corners.
    pub vertices: [VertexId; 4],
    /// Whose displacements are fixed.
    pub held: [bool; 4],
    /// Its rest geometry.
    pub geometry: LinearTet,
}

/// K_new − K_old = A Aᵀ − B Bᵀ of a leaf, A `added` and B `removed`: the third kind of change,
/// beside the split and the merge of [`RingStiffness`](super::RingStiffness).
///
/// Shapes: 4m rows for m unknowns per vertex, vertex-major; the rows of fixed displacements are
/// zero. At most 6 columns together with `p1`, 10 with `p1p1`, 12 more if the density changes
/// under an element with mass. Units: (N/m)^½.
#[derive(Clone, Debug)]
pub struct ContentStiffness {
    /// The corners of the leaf.
    pub vertices: [VertexId; 4],
    /// What is added.
    pub added: Mat<f64>,
    /// What is removed.
    pub removed: Mat<f64>,
}

impl ContentStiffness {
    /// From the material that a leaf had to the one that it has.
    ///
    /// Columns are eigenvectors of the difference with its rows in units of √max(|K_old|, |K_new|)
    /// on the diagonal, so that soft rows are kept as exactly as stiff ones. Eigenvalues below
    /// 25 n ε (n rows) are rounding and left out. Cost: some n³ flops.
    /// # Errors
    /// [`EmbedError::ElementEntry`] if a matrix is not finite, as where an elasticity is not
    /// positive definite.
    pub fn new(
        leaf: &Leaf<'_>,
        old: &LeafMaterial,
        new: &LeafMaterial,
    ) -> Result<Self, EmbedError> {
        let (old, new) = (leaf.matrix(old)?, leaf.matrix(new)?);
        let n = old.nrows();
        let unit: Vec<f64> = (0..n).map(|i| row_unit(&old, &new, i)).collect();
        let scaled = DMatrix::from_fn(n, n, |i, j| (new[(i, j)] - old[(i, j)]) / unit[i] / unit[j]);
        let eigen = scaled.symmetric_eigen();
        let floor = ENTRY_ROUNDING * n as f64 * f64::EPSILON;
        let columns = |sign: f64| {
            let values = eigen.eigenvalues.iter().map(|value| sign * value);
            let kept: Vec<(usize, f64)> = values.enumerate().filter(|(_, v)| *v > floor).collect();
            Mat::from_fn(n, kept.len(), |i, j| {
                let (column, value) = kept[j];
                unit[i] * eigen.eigenvectors[(i, column)] * value.sqrt()
            })
        };
        Ok(Self { vertices: leaf.vertices, added: columns(1.0), removed: columns(-1.0) })
    }
}

impl Leaf<'_> {
    /// The element's matrix with fixed displacements held.
    fn matrix(&self, material: &LeafMaterial) -> Result<Mat<f64>, EmbedError> {
        let LeafMaterial { elasticity, density_kg_m3 } = material;
        let mut k = self.element.matrix(&self.geometry, elasticity, *density_kg_m3);
        for (row, column) in (0..k.nrows()).flat_map(|i| (0..k.ncols()).map(move |j| (i, j))) {
            let value = k[(row, column)];
            if !value.is_finite() {
                let element = self.element.name();
                return Err(EmbedError::ElementEntry { element, row, column, value });
            }
        }
        clamp(&mut k, &self.held);
        Ok(k)
    }
}

/// √max(|old|, |new|) of a diagonal entry, 1 for a row of zeros.
fn row_unit(old: &Mat<f64>, new: &Mat<f64>, i: usize) -> f64 {
    let largest = old[(i, i)].abs().max(new[(i, i)].abs());
    if largest > 0.0 { largest.sqrt() } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::{P1, P1P1};
    use crate::material::isotropic;
    use nalgebra::Vector3;

    const CORNERS: [[f64; 3]; 4] =
        [[0.0, 0.0, 0.0], [0.9, 0.1, 0.2], [0.3, 1.1, 0.1], [0.2, 0.4, 0.7]];

    fn leaf(element: &dyn ElementFormulation, held: [bool; 4]) -> Leaf<'_> {
        let geometry = LinearTet::new(&CORNERS.map(|x| Vector3::from(x) * 1e-2));
        Leaf { element, vertices: [3, 1, 4, 5].map(VertexId), held, geometry }
    }

    fn material(young_pa: f64, poisson_ratio: f64) -> LeafMaterial {
        LeafMaterial { elasticity: isotropic(young_pa, poisson_ratio), density_kg_m3: 1e3 }
    }

    /// The columns give the difference to the floor of what is left out and as much for the
    /// eigenvectors' own rounding; returns how many there are.
    fn check(leaf: &Leaf<'_>, old: &LeafMaterial, new: &LeafMaterial) -> [usize; 2] {
        let ContentStiffness { added, removed, .. } =
            ContentStiffness::new(leaf, old, new).unwrap();
        let got = &added * added.transpose() - &removed * removed.transpose();
        let (old, new) = (leaf.matrix(old).unwrap(), leaf.matrix(new).unwrap());
        let n = old.nrows();
        let limit = 2.0 * ENTRY_ROUNDING * n as f64 * f64::EPSILON;
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let want = new[(i, j)] - old[(i, j)];
            let error = (got[(i, j)] - want).abs();
            let scale = row_unit(&old, &new, i) * row_unit(&old, &new, j);
            assert!(error <= limit * scale, "({i}, {j}): {error:e} of {scale:e}");
        }
        [added.ncols(), removed.ncols()]
    }

    #[test]
    fn columns_give_the_difference_for_any_ratio_of_materials() {
        let elements: [(&dyn ElementFormulation, usize); 2] = [(&P1, 6), (&P1P1::default(), 10)];
        for (element, most) in elements {
            for held in [[false; 4], [true, false, true, false]] {
                let leaf = leaf(element, held);
                for exponent in [0, 1, 3, 6, 9] {
                    let stiff = 1e3 * 10f64.powi(exponent);
                    for [from, to] in [[0.3, 0.3], [0.0, 0.45], [0.45, 0.499], [-0.3, 0.2]] {
                        let [soft, stiff] = [material(1e3, from), material(stiff, to)];
                        let [added, removed] = check(&leaf, &soft, &stiff);
                        assert!(added + removed <= most, "{added} + {removed}");
                        assert_eq!(check(&leaf, &stiff, &soft), [removed, added]);
                        assert_eq!(added + removed == 0, soft == stiff);
                    }
                }
            }
        }
    }

    #[test]
    fn a_stiffer_leaf_only_adds_and_no_change_has_no_column() {
        let leaf = leaf(&P1, [false; 4]);
        assert_eq!(check(&leaf, &material(1e3, 0.3), &material(2e3, 0.3)), [6, 0]);
        assert_eq!(check(&leaf, &material(1e3, 0.3), &material(1e3, 0.3)), [0, 0]);
        let nothing = LeafMaterial { elasticity: Matrix6::zeros(), density_kg_m3: 0.0 };
        assert_eq!(check(&leaf, &material(1e3, 0.3), &nothing), [0, 6]);
    }

    #[test]
    fn a_material_that_is_no_number_is_refused() {
        for element in [&P1 as &dyn ElementFormulation, &P1P1::default()] {
            let (good, mut bad) = (material(1e3, 0.3), material(1e3, 0.3));
            bad.elasticity[(0, 0)] = f64::NAN;
            let leaf = leaf(element, [false; 4]);
            assert!(ContentStiffness::new(&leaf, &good, &bad).is_err());
            assert!(ContentStiffness::new(&leaf, &bad, &good).is_err());
        }
    }
}
