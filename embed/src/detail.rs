//! A fine mesh that follows a coarse one: what is too fine to be simulated moves along.

use nalgebra::Vector3;
use yawara_mesh::{BisectionForest, VertexId};

use crate::error::EmbedError;

/// A forest, as fine as surfaces want it, whose vertices get their positions from the active
/// mesh of a simulation on the same root cubes.
///
/// Every vertex has one position, whatever tetrahedra it belongs to, so surfaces bound to its
/// edges stay closed: a vertex that is active in the simulation is where the simulation has it;
/// any other one lies in the middle of the edge that it bisects, in generation order.
pub struct DetailMesh {
    forest: BisectionForest,
    /// Ascending generations; the ends of the bisected edge come before their middle.
    order: Vec<(VertexId, Option<[VertexId; 2]>)>,
}

impl DetailMesh {
    /// Orders the vertices of `forest`. Cost: O(n log n).
    pub fn new(forest: BisectionForest) -> Self {
        let lattice = *forest.domain().lattice();
        let ends = |v: VertexId| {
            let [a, b] = lattice.edge_ends(forest.point(v))?;
            Some([forest.vertex_at(a)?, forest.vertex_at(b)?])
        };
        let mut order: Vec<_> = forest.vertices().map(|v| (v, ends(v))).collect();
        order.sort_by_key(|&(v, _)| forest.generation(v));
        Self { forest, order }
    }

    /// The forest, for surfaces and fields on it.
    pub fn forest(&self) -> &BisectionForest {
        &self.forest
    }

    /// Positions by vertex number of the detail forest from those `x` of `active` (in its own
    /// numbers), in the unit of `x`; zero for numbers not in use. Cost: O(n).
    ///
    /// # Errors
    /// [`EmbedError::OtherLattice`] if the meshes have different root cubes or `active` may be
    /// finer; [`EmbedError::PositionCount`].
    pub fn positions(
        &self,
        active: &BisectionForest,
        x: &[Vector3<f64>],
    ) -> Result<Vec<Vector3<f64>>, EmbedError> {
        let (coarse, fine) = (active.domain().lattice(), self.forest.domain().lattice());
        if coarse.cells != fine.cells || coarse.units > fine.units {
            let (found, found_units) = (coarse.cells, coarse.units);
            let (want, want_units) = (fine.cells, fine.units);
            return Err(EmbedError::OtherLattice { found, found_units, want, want_units });
        }
        if x.len() < active.vertex_capacity() {
            let (found, want) = (x.len(), active.vertex_capacity());
            return Err(EmbedError::PositionCount { found, want });
        }
        let unit = fine.units / coarse.units;
        let mut positions = vec![Vector3::zeros(); self.forest.vertex_capacity()];
        for &(v, ends) in &self.order {
            let p = self.forest.point(v);
            let on_coarse = p.iter().all(|c| c % unit == 0);
            let same = on_coarse.then(|| active.vertex_at(p.map(|c| c / unit))).flatten();
            positions[v.index()] = match (same, ends) {
                (Some(same), _) => x[same.index()],
                (None, Some([a, b])) => 0.5 * (positions[a.index()] + positions[b.index()]),
                // A root cube that the active mesh leaves out: it does not move, nor is it drawn.
                (None, None) => Vector3::repeat(f64::NAN),
            };
        }
        Ok(positions)
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.forest.bytes() + self.order.capacity() * size_of::<(VertexId, [VertexId; 2])>()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use yawara_mesh::{Domain, LabelTree, Lattice, MeshDelta, Placement};

    fn forest(start: u8, max: u8) -> BisectionForest {
        let tree = Arc::new(LabelTree::homogeneous([2, 1, 1], 1));
        let domain = Domain::full(Lattice::new([2, 1, 1], max));
        BisectionForest::new(domain, tree, start, max).unwrap()
    }

    /// Positions of `forest` on cubes of edge 1, moved by `map`.
    fn moved(
        forest: &BisectionForest,
        map: impl Fn(Vector3<f64>) -> Vector3<f64>,
    ) -> Vec<Vector3<f64>> {
        let unit = 1.0 / f64::from(forest.domain().lattice().units);
        let placement = Placement { origin: Vector3::zeros(), unit };
        let mut x = vec![Vector3::zeros(); forest.vertex_capacity()];
        for v in forest.vertices() {
            x[v.index()] = map(placement.position(forest.point(v)));
        }
        x
    }

    #[test]
    fn an_affine_motion_of_the_coarse_mesh_is_that_of_the_detail() {
        let map = |x: Vector3<f64>| Vector3::new(1.5 * x.x + 0.2 * x.y, x.y - 1.0, x.z + 0.3 * x.x);
        let detail = DetailMesh::new(forest(7, 7));
        for level in 0..5 {
            let active = forest(level, 4);
            let x = detail.positions(&active, &moved(&active, map)).unwrap();
            for (got, want) in x.iter().zip(moved(detail.forest(), map)) {
                assert!((got - want).norm() < 1e-14, "{got} {want}");
            }
        }
    }

    #[test]
    fn vertices_of_both_meshes_are_where_the_simulation_has_them() {
        let mut active = forest(2, 6);
        let mut delta = MeshDelta::empty();
        for _ in 0..40 {
            let p = active.candidates()[7];
            active.split(p, &mut delta).unwrap();
        }
        let bend = |x: Vector3<f64>| Vector3::new(x.x, x.y, x.z + x.x * x.x);
        let x = moved(&active, bend);
        let detail = DetailMesh::new(forest(6, 6));
        let positions = detail.positions(&active, &x).unwrap();
        let mut midpoints = 0;
        for v in detail.forest().vertices() {
            let p = detail.forest().point(v);
            if let Some(same) = active.vertex_at(p) {
                assert_eq!(positions[v.index()], x[same.index()]);
                continue;
            }
            midpoints += 1;
            // Linear interpolation of a parabola along an edge of Δx lies ¼ Δx² above at most.
            let exact = bend(p.map(f64::from).map(|c| 0.25 * c).into());
            let above = positions[v.index()].z - exact.z;
            assert!((-1e-12..=0.25 + 1e-12).contains(&above), "{above}");
        }
        assert!(midpoints > 20);
    }

    #[test]
    fn a_mesh_that_does_not_belong_is_refused() {
        let detail = DetailMesh::new(forest(3, 3));
        let finer = forest(0, 6);
        let x = vec![Vector3::zeros(); finer.vertex_capacity()];
        let error = detail.positions(&finer, &x).unwrap_err();
        assert!(matches!(error, EmbedError::OtherLattice { .. }), "{error}");
        let active = forest(0, 3);
        let error = detail.positions(&active, &[]).unwrap_err();
        assert_eq!(error, EmbedError::PositionCount { found: 0, want: active.vertex_capacity() });
    }
}
