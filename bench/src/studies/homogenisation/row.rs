//! What the study finds.

use serde::Serialize;

use crate::error::BenchError;

/// One choice on one case.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// What the cube holds.
    pub case: &'static str,
    /// Largest over smallest Young's modulus.
    pub ratio: f64,
    /// Poisson's ratio of all materials.
    pub nu: f64,
    /// Levels from the finest mesh to the coarse one.
    pub levels: u8,
    /// The homogenisation.
    pub choice: &'static str,
    /// Coarse displacement, linear between coarse vertices, against that of the fine solution:
    /// relative L2 error, mean of tension and shear.
    pub error_coarse: f64,
    /// The same with all finer vertices where the embedding has them.
    pub error_fine: f64,
    /// Relative error of the loads' work, mean of tension and shear.
    pub compliance_error: f64,
    /// Smallest eigenvalue of the coarse tetrahedra's elasticity; the matrix has E = 1.
    pub min_eigenvalue: f64,
    /// Time to homogenise all levels, s.
    pub seconds: f64,
    /// Memory of the homogenised materials.
    pub bytes: usize,
    /// Whether the case is one of the mean.
    #[serde(skip)]
    pub counts: bool,
}

/// What it costs to homogenise an organ of 128 voxels' length.
#[derive(Clone, Debug)]
pub(super) struct PhantomCost {
    pub choice: &'static str,
    /// Heterogeneous tetrahedra.
    pub nodes: usize,
    pub seconds: f64,
    pub bytes: usize,
}

impl Row {
    /// Refuses a figure that nobody can read.
    ///
    /// # Errors
    /// [`BenchError::NotFinite`].
    pub(super) fn checked(self) -> Result<Self, BenchError> {
        let values = [
            ("error_coarse", self.error_coarse),
            ("error_fine", self.error_fine),
            ("compliance_error", self.compliance_error),
            ("min_eigenvalue", self.min_eigenvalue),
        ];
        for (name, value) in values {
            if !value.is_finite() {
                let what = format!("{name} of {} by {}", self.case, self.choice);
                return Err(BenchError::NotFinite { what, value });
            }
        }
        Ok(self)
    }
}
