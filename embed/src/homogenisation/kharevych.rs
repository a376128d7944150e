//! `kharevych`: six solutions of the whole fine body say how each coarse tetrahedron responds.

use std::ops::ControlFlow;

use rayon::prelude::*;

use super::halves::{ChildPair, ParentMaterial};
use super::laminate::Laminate;
use super::response::{Place, responses};
use super::rule::{GlobalHomogenisation, Homogenisation};
use crate::error::EmbedError;
use crate::fine::{FineBody, FineFields};
use crate::material::Packed6;

/// The energy of the fine body under six uniform boundary tractions, handed to each coarse
/// tetrahedron t as the material that stores as much under the strains it sees:
///
/// D_t = E_t⁻ᵀ (Σ_{fine in t} V εᵀDε) E_t⁻¹ / V_t, E_t the six strains of t's corners.
///
/// One set of solves serves all levels. New vertices are placed where `laminate` by itself has
/// them (the h_k would scatter them wildly), and a tetrahedron whose E_t has a condition number
/// above 10⁸ keeps its laminate's matrix. D_t may exceed the Voigt mean of
/// the halves. Near a place where a stiff fibre is held or loaded the body answers unlike under a
/// uniform traction, and D_t is much too soft there.
/// Source: Kharevych, Mullen, Owhadi, Desbrun, ACM Transactions on Graphics 28(3), 2009.
#[derive(Clone, Copy, Debug, Default)]
pub struct Kharevych;

impl Homogenisation for Kharevych {
    fn name(&self) -> &str {
        "kharevych"
    }

    fn combine(&self, pair: &ChildPair) -> ParentMaterial {
        Laminate.combine(pair)
    }

    fn global(&self) -> Option<&dyn GlobalHomogenisation> {
        Some(self)
    }
}

impl GlobalHomogenisation for Kharevych {
    fn homogenise(
        &self,
        body: &FineBody<'_>,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Vec<Option<Packed6>>, EmbedError> {
        let mut result = vec![None; body.tree().node_count()];
        let components = body.components();
        let total: usize = components.iter().map(Vec::len).sum();
        let mut done = 0;
        for cells in &components {
            // A component without nodes has nothing to ask.
            if cells.iter().any(|&cell| !body.tree().cell_nodes(cell).is_empty()) {
                let share = |part: f64| (done as f64 + part * cells.len() as f64) / total as f64;
                let fields = body.unit_tractions(cells, &mut |part| progress(share(part)))?;
                let found: Vec<Vec<(usize, Packed6)>> = cells
                    .par_iter()
                    .map(|&cell| of_root_cube(body, &fields, cell))
                    .collect::<Result<_, _>>()?;
                for (node, elasticity) in found.into_iter().flatten() {
                    result[node] = Some(elasticity);
                }
            }
            done += cells.len();
        }
        Ok(result)
    }
}

/// D_t of the nodes of one root cube, by their numbers, where there is one.
fn of_root_cube(
    body: &FineBody<'_>,
    fields: &FineFields,
    cell: usize,
) -> Result<Vec<(usize, Packed6)>, EmbedError> {
    let mut found = Vec::new();
    for place in Place::roots(body, cell) {
        found.extend(responses(body, fields, &place, u8::MAX)?);
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fine::lattice_tet;
    use crate::{Material, Materials};
    use nalgebra::Matrix6;
    use yawara_mesh::Content;
    use yawara_mesh::kuhn::ROOTS_PER_CELL;
    use yawara_mesh::volume::{Grid, LabelVolume};
    use yawara_mesh::{CellGrid, LabelTree};

    /// Two bodies of one cube of 4³ voxels each, joined in an edge only.
    fn tree() -> LabelTree {
        let labels = (0..256).map(|i: usize| {
            let (x, y) = (i % 8, i / 8 % 8);
            if (x < 4) == (y < 4) { 1 + (i * i % 7 < 3) as u16 } else { 0 }
        });
        let grid = Grid::centred([8, 8, 4], 1.0);
        let volume = LabelVolume::new(grid, labels.collect(), vec![0, 1, 2]).unwrap();
        let grid = CellGrid { cells: [2, 2, 1], voxels_per_cell: 4, first_voxel: [0; 3] };
        LabelTree::new(&volume, grid).unwrap()
    }

    /// Under its own strains every tetrahedron stores the energy of the fine tetrahedra inside,
    /// and all of them that of the loads.
    #[test]
    fn energies_are_those_of_the_fine_body() {
        let tree = tree();
        let moduli = [(1e-3, 0.0), (1.0, 0.3), (50.0, 0.2)];
        let materials: Materials =
            moduli.map(|(e, nu)| Material::new(e, nu, 0.0).unwrap()).to_vec().into();
        let body = FineBody::new(&tree, &materials);
        let mut told = Vec::new();
        let found = Kharevych
            .homogenise(&body, &mut |part| {
                told.push(part);
                ControlFlow::Continue(())
            })
            .unwrap();
        assert!(told.is_sorted() && told.last() == Some(&1.0), "{told:?}");
        assert_eq!(found.len(), tree.node_count());
        let components = body.components();
        assert_eq!(components, vec![vec![0], vec![3]]);
        for cells in &components {
            let fields = body.unit_tractions(cells, &mut |_| ControlFlow::Continue(())).unwrap();
            let mut coarse = Matrix6::zeros();
            for order in 0..ROOTS_PER_CELL {
                let Content::Node(index) = tree.root(cells[0], order).open() else { panic!() };
                let corners = body.root_corners(cells[0], order);
                let geometry = lattice_tet(&corners);
                let strains = fields.strains(&corners, &geometry);
                let d = found[index].unwrap().matrix();
                coarse += geometry.volume * strains.transpose() * d * strains;
            }
            let mut fine = Matrix6::zeros();
            let mut mean = Matrix6::zeros();
            body.visit(cells[0], &mut |corners, d| {
                let geometry = lattice_tet(corners);
                let strains = fields.strains(corners, &geometry);
                fine += geometry.volume * strains.transpose() * d * strains;
                mean += geometry.volume * d * strains;
            })
            .unwrap();
            assert!((coarse - fine).amax() < 1e-9 * fine.amax(), "{coarse}{fine}");
            // The mean stress is the traction's (64 voxels), whatever is inside.
            assert!((mean / 64.0 - Matrix6::identity()).amax() < 1e-9, "{mean}");
        }
    }
}
