//! What a change of content does to the stiffness: a leaf stays, its material does not.

use faer::Mat;
use nalgebra::DMatrix;
use yawara_mesh::VertexId;

use super::clamp::clamp;
use crate::error::EmbedError;

/// Rounding of an entry of K_new − K_old, in ε √(K_ii K_jj). An entry of BᵀDB has at most 9 terms,
/// by Cauchy and Schwarz no more than 3 √(K_ii K_jj) together, and 8 roundings of ε/2 each: 12 ε,
/// twice, and one for the difference.
const ENTRY_ROUNDING: f64 = 25.0;

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
    /// From the matrices ([`ElementFormulation::matrix`](crate::ElementFormulation::matrix)) that a
    /// leaf with these corners had and has; `held` are those whose displacements are fixed.
    ///
    /// Columns are eigenvectors of the difference with its rows in units of √max(|K_old|, |K_new|)
    /// on the diagonal, so that soft rows are kept as exactly as stiff ones. Eigenvalues below
    /// 25 n ε (n rows) are rounding and left out. Cost: some n³ flops.
    /// # Errors
    /// [`EmbedError::NotFinite`] if a matrix is not finite, as where an elasticity is not
    /// positive definite.
    pub fn new(
        vertices: [VertexId; 4],
        held: [bool; 4],
        mut matrices: [Mat<f64>; 2],
    ) -> Result<Self, EmbedError> {
        for k in &mut matrices {
            check_finite(k)?;
            clamp(k, &held);
        }
        let [old, new] = matrices;
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
        Ok(Self { vertices, added: columns(1.0), removed: columns(-1.0) })
    }
}

fn check_finite(k: &Mat<f64>) -> Result<(), EmbedError> {
    for (row, column) in (0..k.nrows()).flat_map(|i| (0..k.ncols()).map(move |j| (i, j))) {
        let value = k[(row, column)];
        if !value.is_finite() {
            let want = "a finite number (N/m): its elasticity has to be positive definite";
            return Err(EmbedError::NotFinite {
                matrix: "an element's matrix",
                row,
                column,
                value,
                want,
            });
        }
    }
    Ok(())
}

/// √max(|old|, |new|) of a diagonal entry, 1 for a row of zeros.
fn row_unit(old: &Mat<f64>, new: &Mat<f64>, i: usize) -> f64 {
    let largest = old[(i, i)].abs().max(new[(i, i)].abs());
    if largest > 0.0 { largest.sqrt() } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::{ElementFormulation, P1, P1P1};
    use crate::linear_tet::LinearTet;
    use crate::material::isotropic;
    use nalgebra::{Matrix6, Vector3};

    type Formulation<'a> = &'a dyn ElementFormulation;

    const CORNERS: [[f64; 3]; 4] =
        [[0.0, 0.0, 0.0], [0.9, 0.1, 0.2], [0.3, 1.1, 0.1], [0.2, 0.4, 0.7]];

    fn change(
        element: Formulation<'_>,
        held: [bool; 4],
        materials: [Matrix6<f64>; 2],
    ) -> ([Mat<f64>; 2], Result<ContentStiffness, EmbedError>) {
        let geometry = LinearTet::new(&CORNERS.map(|x| Vector3::from(x) * 1e-2));
        let matrices = materials.map(|d| element.matrix(&geometry, &d, 1e3));
        let vertices = [3, 1, 4, 5].map(VertexId);
        (matrices.clone(), ContentStiffness::new(vertices, held, matrices))
    }

    /// The columns give the difference to the floor of what is left out and as much for the
    /// eigenvectors' own rounding; returns how many there are.
    fn check(
        element: Formulation<'_>,
        held: [bool; 4],
        materials: [Matrix6<f64>; 2],
    ) -> [usize; 2] {
        let (mut matrices, content) = change(element, held, materials);
        let ContentStiffness { added, removed, .. } = content.unwrap();
        let got = &added * added.transpose() - &removed * removed.transpose();
        matrices.iter_mut().for_each(|k| clamp(k, &held));
        let [old, new] = matrices;
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
        let elements: [(Formulation<'_>, usize); 2] = [(&P1, 6), (&P1P1::default(), 10)];
        for (element, most) in elements {
            for held in [[false; 4], [true, false, true, false]] {
                for exponent in [0, 1, 3, 6, 9] {
                    let stiff = 1e3 * 10f64.powi(exponent);
                    for [from, to] in [[0.3, 0.3], [0.0, 0.45], [0.45, 0.499], [-0.3, 0.2]] {
                        let [soft, stiff] = [isotropic(1e3, from), isotropic(stiff, to)];
                        let [added, removed] = check(element, held, [soft, stiff]);
                        assert!(added + removed <= most, "{added} + {removed}");
                        assert_eq!(check(element, held, [stiff, soft]), [removed, added]);
                        assert_eq!(added + removed == 0, soft == stiff);
                    }
                }
            }
        }
    }

    #[test]
    fn a_stiffer_leaf_only_adds_and_no_change_has_no_column() {
        let [once, twice] = [1e3, 2e3].map(|young_pa| isotropic(young_pa, 0.3));
        assert_eq!(check(&P1, [false; 4], [once, twice]), [6, 0]);
        assert_eq!(check(&P1, [false; 4], [once, once]), [0, 0]);
        assert_eq!(check(&P1, [false; 4], [once, Matrix6::zeros()]), [0, 6]);
    }

    #[test]
    fn a_material_that_is_no_number_is_refused() {
        let (good, mut bad) = (isotropic(1e3, 0.3), isotropic(1e3, 0.3));
        bad[(0, 0)] = f64::NAN;
        for element in [&P1 as Formulation<'_>, &P1P1::default()] {
            for materials in [[good, bad], [bad, good]] {
                assert!(change(element, [false; 4], materials).1.is_err());
            }
        }
    }
}
