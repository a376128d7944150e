//! The finest vertices of a body under uniform boundary tractions.

use std::ops::ControlFlow;

use nalgebra::Matrix6;
use yawara_mesh::kuhn::Point;

use super::body::{FineBody, SixFields, lattice_tet};
use super::cholesky::DIRECT_VERTICES;
use super::conjugate_gradients::conjugate_gradients;
use super::grid::FineGrid;
use super::multigrid::Multigrid;
use super::region::{FineVoxels, Region};
use super::stiffness::FineStiffness;
use crate::error::EmbedError;
use crate::linear_tet::{LinearTet, strain_operator};

impl FineBody<'_> {
    /// The displacements h_k of the finest vertices of a component under the six uniform boundary
    /// tractions σ = e_k (Pa, Voigt order), the body free otherwise: ∫ ε(v)ᵀDε(h_k) = ∮ vᵀσ_k n.
    ///
    /// Up to [`DIRECT_VERTICES`] vertices by a sparse Cholesky factorisation, beyond by conjugate
    /// gradients; the same whatever the number of threads. `progress` is told the fraction done
    /// and may stop the work.
    ///
    /// # Errors
    /// [`EmbedError::FineFactor`], [`EmbedError::FineSolve`], [`EmbedError::Stopped`]; those of [`Self::elasticity`].
    pub fn unit_tractions(
        &self,
        cells: &[usize],
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<FineFields, EmbedError> {
        FineFields::new(
            &Region {
                cubes: cells.iter().map(|&cell| self.root_low(cell)).collect(),
                units: self.tree().grid().voxels_per_cell as i32,
                visit: &|visit| cells.iter().try_for_each(|&cell| self.visit(cell, visit)),
            },
            progress,
        )
    }

    /// As [`unit_tractions`](Self::unit_tractions), of a cube of `size` voxels and one layer of
    /// voxels around it, cut off where the body ends: what hangs together with the cube by faces.
    pub(crate) fn patch_tractions(
        &self,
        voxels: &FineVoxels,
        low: Point,
        size: i32,
    ) -> Result<FineFields, EmbedError> {
        voxels.patch(self, low, size, |region| {
            FineFields::new(region, &mut |_| ControlFlow::Continue(()))
        })
    }
}

/// ∮ N_i σ_k n dA = Σ_tets V G(∇λ_i)ᵀ σ_k, for the σ_k are the same everywhere.
pub(super) fn traction_loads(
    region: &Region<'_>,
    grid: &FineGrid,
) -> Result<Vec<SixFields>, EmbedError> {
    let mut loads = vec![SixFields::zeros(); grid.len()];
    (region.visit)(&mut |corners, _| {
        let geometry = lattice_tet(corners);
        for (p, g) in corners.iter().zip(&geometry.gradients) {
            loads[grid.vertex(*p)] += geometry.volume * strain_operator(g).transpose();
        }
    })?;
    Ok(loads)
}

/// Displacements of all finest vertices of a region under six loads.
pub struct FineFields {
    grid: FineGrid,
    values: Vec<SixFields>,
}

impl FineFields {
    fn new(
        region: &Region<'_>,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Self, EmbedError> {
        let grid = FineGrid::new(&region.cubes, region.units);
        let stiffness = FineStiffness::new(region, &grid)?;
        let loads = traction_loads(region, &grid)?;
        let values = if grid.len() > DIRECT_VERTICES {
            let [softest, stiffest] = stiffness.moduli;
            let refused = EmbedError::FineFactor { rows: 3 * grid.len(), softest, stiffest };
            let multigrid = Multigrid::new(stiffness.rows, grid.points()).ok_or(refused)?;
            conjugate_gradients(&multigrid, &loads, progress)?
        } else {
            let solution = stiffness.cholesky(&grid.elimination_order(), &loads)?;
            if progress(1.0).is_break() {
                return Err(EmbedError::Stopped { done: 1.0 });
            }
            solution
        };
        Ok(Self { grid, values })
    }

    /// The displacements of the vertex at a lattice point of the region, in voxels.
    pub fn at(&self, p: Point) -> &SixFields {
        &self.values[self.grid.vertex(p)]
    }

    /// E: the strains of the linear interpolation between a tetrahedron's corners, a column per
    /// load.
    pub fn strains(&self, corners: &[Point; 4], geometry: &LinearTet) -> Matrix6<f64> {
        let mut strains = Matrix6::zeros();
        for (p, g) in corners.iter().zip(&geometry.gradients) {
            strains += strain_operator(g) * self.at(*p);
        }
        strains
    }
}
