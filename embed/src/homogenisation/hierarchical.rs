//! `hierarchical`: solutions of a patch around each tetrahedron say how it responds.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use rayon::prelude::*;
use yawara_mesh::kuhn::{Point, bisect, midpoint};

use super::halves::{ChildPair, ParentMaterial};
use super::laminate::Laminate;
use super::response::{Place, responses};
use super::rule::{GlobalHomogenisation, Homogenisation};
use crate::error::EmbedError;
use crate::fine::{FineBody, FineVoxels};
use crate::material::Packed6;

/// Levels from one cube to the cubes of half its edge.
const LEVELS_PER_CUBE: u8 = 3;

/// Root cubes between two calls of `progress`.
const BATCH: usize = 16;

/// As `kharevych`, but from the fine body near by alone. A tetrahedron t lies in a cube: the root cube
/// for levels 0 to 2, one of half the edge for levels 3 to 5 and so on. It responds as it does in that
/// cube and one layer of voxels around it, by themselves, under the six uniform tractions:
///
/// D_t = E_t⁻ᵀ (Σ_{fine in t} V εᵀDε) E_t⁻¹ / V_t, E_t the six strains of t's corners.
///
/// Layer and cube are cut off where the body's root cubes end; void is what it is. New vertices are
/// placed where `laminate` by itself has them, and a tetrahedron whose E_t has a condition number
/// above 10⁸ keeps its laminate's matrix. D_t may exceed the Voigt mean of the halves. Cost: a sparse
/// factorisation of (n + 3)³ vertices for every heterogeneous cube of n voxels' edge; in parallel over
/// root cubes.
/// Source: Kharevych, Mullen, Owhadi, Desbrun, ACM Transactions on Graphics 28(3), 2009, with patches
/// oversampled as by Hou, Wu, Journal of Computational Physics 134(1), 1997.
#[derive(Clone, Copy, Debug, Default)]
pub struct Hierarchical;

impl Homogenisation for Hierarchical {
    fn name(&self) -> &str {
        "hierarchical"
    }

    fn combine(&self, pair: &ChildPair) -> ParentMaterial {
        Laminate.combine(pair)
    }

    fn global(&self) -> Option<&dyn GlobalHomogenisation> {
        Some(self)
    }
}

impl GlobalHomogenisation for Hierarchical {
    fn homogenise(
        &self,
        body: &FineBody<'_>,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Vec<Option<Packed6>>, EmbedError> {
        let mut result = vec![None; body.tree().node_count()];
        let cells = body.components().concat();
        let voxels = FineVoxels::new(body, &cells)?;
        let asks: Vec<usize> =
            cells.into_iter().filter(|&cell| !body.tree().cell_nodes(cell).is_empty()).collect();
        for (batch, part) in asks.chunks(BATCH).enumerate() {
            let found: Vec<Vec<(usize, Packed6)>> = part
                .par_iter()
                .map(|&cell| of_root_cube(body, &voxels, cell))
                .collect::<Result<_, _>>()?;
            for (node, elasticity) in found.into_iter().flatten() {
                result[node] = Some(elasticity);
            }
            let done = (batch * BATCH + part.len()) as f64 / asks.len() as f64;
            if progress(done).is_break() {
                return Err(EmbedError::Stopped { done });
            }
        }
        Ok(result)
    }
}

/// D_t of the nodes of one root cube, by their numbers, where there is one.
fn of_root_cube(
    body: &FineBody<'_>,
    voxels: &FineVoxels,
    cell: usize,
) -> Result<Vec<(usize, Packed6)>, EmbedError> {
    let mut found = Vec::new();
    let mut size = body.tree().grid().voxels_per_cell as i32;
    let mut places = Place::roots(body, cell);
    while size > 1 {
        let mut cubes: BTreeMap<Point, Vec<Place>> = BTreeMap::new();
        for place in &places {
            cubes.entry(place.low()).or_default().push(*place);
        }
        for (low, places) in cubes {
            let fields = body.patch_tractions(voxels, low, size)?;
            for place in &places {
                let below = place.level + LEVELS_PER_CUBE;
                found.extend(responses(body, &fields, place, below)?);
            }
        }
        for _ in 0..LEVELS_PER_CUBE {
            places =
                places.iter().flat_map(|place| place.halves(body)).filter(Place::asks).collect();
        }
        size /= 2;
    }
    Ok(found)
}

impl Place {
    /// The corner of its cube with the smallest coordinates.
    fn low(&self) -> Point {
        // x0 and x3 are opposite corners of the cube.
        std::array::from_fn(|axis| self.corners[0][axis].min(self.corners[3][axis]))
    }

    fn halves(&self, body: &FineBody<'_>) -> [Self; 2] {
        let halved = bisect(&self.corners, self.level, midpoint(&self.corners, self.level));
        let halves = body.tree().children(self.of);
        [0, 1].map(|i| Self { of: halves[i], corners: halved[i], level: self.level + 1 })
    }
}

#[cfg(test)]
mod tests {
    use super::super::kharevych::Kharevych;
    use super::*;
    use crate::{Material, Materials};
    use yawara_mesh::volume::{Grid, LabelVolume};
    use yawara_mesh::{CellGrid, LabelTree};

    fn both(cells: usize) -> [Vec<Option<Packed6>>; 2] {
        let labels = (0..64 * cells).map(|i| (i * i % 7 % 3) as u16).collect();
        let grid = Grid::centred([4 * cells, 4, 4], 1.0);
        let volume = LabelVolume::new(grid, labels, vec![0, 1, 2]).unwrap();
        let grid = CellGrid { cells: [cells, 1, 1], voxels_per_cell: 4, first_voxel: [0; 3] };
        let tree = LabelTree::new(&volume, grid).unwrap();
        let moduli = [(1e-3, 0.0), (1.0, 0.3), (50.0, 0.2)];
        let materials: Materials =
            moduli.map(|(e, nu)| Material::new(e, nu, 0.0).unwrap()).to_vec().into();
        let body = FineBody::new(&tree, &materials);
        let mut go_on = |_| ControlFlow::Continue(());
        [&Hierarchical as &dyn GlobalHomogenisation, &Kharevych]
            .map(|rule| rule.homogenise(&body, &mut go_on).unwrap())
    }

    /// Nodes to which both rules give the same.
    fn equals([a, b]: [Vec<Option<Packed6>>; 2]) -> usize {
        assert_eq!(a.len(), b.len());
        let equal = a.iter().zip(&b).filter(|(a, b)| match (a, b) {
            (Some(a), Some(b)) => {
                let (a, b) = (a.matrix(), b.matrix());
                (a - b).amax() < 1e-6 * b.amax()
            }
            _ => false,
        });
        equal.count()
    }

    /// In a body of one root cube its patch is the body; the patches of half the edge lack a layer.
    #[test]
    fn the_patch_of_the_only_cube_is_the_body() {
        assert_eq!(equals(both(1)), 6 * (1 + 2 + 4));
        assert_eq!(equals(both(2)), 0);
    }

    #[test]
    fn the_watch_may_stop_it() {
        let volume = LabelVolume::new(
            Grid::centred([2; 3], 1.0),
            (0..8).map(|i| 1 + i % 2).collect(),
            vec![0, 1, 2],
        );
        let grid = CellGrid { cells: [1; 3], voxels_per_cell: 2, first_voxel: [0; 3] };
        let tree = LabelTree::new(&volume.unwrap(), grid).unwrap();
        let materials: Materials = vec![Material::new(1.0, 0.3, 0.0).unwrap(); 3].into();
        let stopped = Hierarchical
            .homogenise(&FineBody::new(&tree, &materials), &mut |_| ControlFlow::Break(()));
        assert!(matches!(stopped, Err(EmbedError::Stopped { done: 1.0 })));
    }
}
