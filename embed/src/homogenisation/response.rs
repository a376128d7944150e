//! How a coarse tetrahedron responds, by the fine strains and energies inside.

use nalgebra::Matrix6;
use yawara_mesh::kuhn::{Point, ROOTS_PER_CELL};
use yawara_mesh::{Content, NodeRef};

use crate::error::EmbedError;
use crate::fine::{FineBody, FineFields, lattice_tet};
use crate::material::Packed6;

/// The largest cond₂(E_t) at which D_t is taken.
const MOST_CONDITION: f64 = 1e8;

/// A tetrahedron of the tree.
#[derive(Clone, Copy)]
pub(super) struct Place {
    pub of: NodeRef,
    pub corners: [Point; 4],
    pub level: u8,
}

impl Place {
    /// The root tetrahedra of a cube that are heterogeneous: below a label there is no node that asks.
    pub fn roots(body: &FineBody<'_>, cell: usize) -> Vec<Self> {
        let root = |order| {
            let (of, corners) = (body.tree().root(cell, order), body.root_corners(cell, order));
            Self { of, corners, level: 0 }
        };
        (0..ROOTS_PER_CELL).map(root).filter(Self::asks).collect()
    }

    /// Whether it is a node of the tree.
    pub fn asks(&self) -> bool {
        matches!(self.of.open(), Content::Node(_))
    }
}

/// D_t = E_t⁻ᵀ (Σ_{fine in t} V εᵀDε) E_t⁻¹ / V_t of the nodes at and inside a tetrahedron that are
/// coarser than the level `below`, by their numbers; E_t the six strains of t's corners. Nodes with a
/// condition number of E_t above [`MOST_CONDITION`] are left out.
///
/// # Errors
/// Those of [`FineBody::elasticity`].
pub(super) fn responses(
    body: &FineBody<'_>,
    fields: &FineFields,
    place: &Place,
    below: u8,
) -> Result<Vec<(usize, Packed6)>, EmbedError> {
    let mut found = Vec::new();
    // Σ V εᵀDε over the finest tetrahedra inside.
    body.fold_at(place.of, &place.corners, place.level, &mut |of, corners, level, halves| {
        let geometry = lattice_tet(corners);
        let strains = || fields.strains(corners, &geometry);
        let Some([first, second]): Option<[Matrix6<f64>; 2]> = halves else {
            let (d, strains) = (body.elasticity(of, corners)?, strains());
            return Ok(geometry.volume * strains.transpose() * d * strains);
        };
        let energy = first + second;
        if let (Content::Node(index), true) = (of.open(), level < below) {
            let answer = response(&energy, &strains(), geometry.volume);
            found.extend(answer.map(|d| (index, Packed6::new(&d))));
        }
        Ok(energy)
    })?;
    Ok(found)
}

/// D_t, if E_t can be inverted safely.
fn response(energy: &Matrix6<f64>, strains: &Matrix6<f64>, volume: f64) -> Option<Matrix6<f64>> {
    let singular = strains.singular_values();
    // Negated, so that a NaN is refused too.
    if !(singular.max() <= MOST_CONDITION * singular.min()) {
        return None;
    }
    let transposed = strains.transpose().lu();
    let half = transposed.solve(energy)?;
    let whole = transposed.solve(&half.transpose())? / volume;
    let elasticity = 0.5 * (whole + whole.transpose());
    elasticity.cholesky().map(|_| elasticity)
}
