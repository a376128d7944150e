//! Positions of a detail mesh while the active mesh moves: only what is asked for, and of that
//! only what has moved.

use nalgebra::Vector3;
use yawara_mesh::{BisectionForest, Point, VertexId};

use super::mesh::{DetailMesh, RotationOf};
use crate::error::EmbedError;

/// The positions of some vertices of a [`DetailMesh`], kept from call to call.
///
/// A position is computed again where one that it depends on has changed, or where its vertex came
/// into or went out of the active mesh; the result is that of a fresh start, bit for bit.
pub struct Follower {
    /// By vertex number of the detail forest: asked for.
    wanted: Vec<bool>,
    positions: Vec<Vector3<f64>>,
    /// Whether the position is that of the last call, and was taken from the active mesh.
    state: Vec<State>,
    changed: Vec<bool>,
    evaluated: usize,
}

#[derive(Clone, Copy, PartialEq)]
enum State {
    Unknown,
    Active,
    Embedded,
}

impl DetailMesh {
    /// Positions by vertex number of the detail forest from those `x` of `active` (in its own
    /// numbers), m; zero for numbers not in use. Cost: O(n), and a rotation per heterogeneous
    /// tetrahedron that the active mesh does not bisect.
    ///
    /// For a surface in motion a [`Follower`] asks for less.
    /// # Errors
    /// [`EmbedError::OtherLattice`] if the meshes have different root cubes or `active` may be
    /// finer; [`EmbedError::PositionCount`].
    pub fn positions(
        &self,
        active: &BisectionForest,
        x: &[Vector3<f64>],
        rotation: RotationOf<'_>,
    ) -> Result<Vec<Vector3<f64>>, EmbedError> {
        let mut follower = Follower::new(self, self.forest().vertices());
        follower.follow(self, active, x, rotation)?;
        Ok(follower.positions)
    }
}

impl Follower {
    /// Asks for the positions of `wanted`, vertices of the detail forest. Cost: O(n).
    pub fn new(mesh: &DetailMesh, wanted: impl IntoIterator<Item = VertexId>) -> Self {
        let n = mesh.forest().vertex_capacity();
        let mut flags = vec![false; n];
        wanted.into_iter().for_each(|v| flags[v.index()] = true);
        Self {
            wanted: flags,
            positions: vec![Vector3::zeros(); n],
            state: vec![State::Unknown; n],
            changed: vec![false; n],
            evaluated: 0,
        }
    }

    /// Brings the positions up to those `x` (m) of `active` (in its own numbers). `mesh` is the
    /// one that this was made for.
    ///
    /// Cost: a look at every vertex that is asked for or depended on; arithmetic only where
    /// something has moved, [`evaluated`](Self::evaluated).
    /// # Errors
    /// As [`DetailMesh::positions`], and [`EmbedError::PositionCount`] for another detail mesh;
    /// nothing has changed then.
    pub fn follow(
        &mut self,
        mesh: &DetailMesh,
        active: &BisectionForest,
        x: &[Vector3<f64>],
        rotation: RotationOf<'_>,
    ) -> Result<&[Vector3<f64>], EmbedError> {
        let (found, want) = (self.positions.len(), mesh.forest().vertex_capacity());
        if found != want {
            return Err(EmbedError::PositionCount { found, want });
        }
        let unit = check(mesh.forest(), active, x)?;
        let vertex_at = |p: Point| {
            let on_coarse = p.iter().all(|c| c % unit == 0);
            on_coarse.then(|| active.vertex_at(p.map(|c| c / unit))).flatten()
        };
        // From fine to coarse: what the vertices asked for depend on, down to active ones.
        let mut needed = self.wanted.clone();
        let mut sources = vec![None; mesh.steps().len()];
        for (step, source) in mesh.steps().iter().zip(&mut sources).rev() {
            if needed[step.vertex.index()] {
                *source = vertex_at(mesh.forest().point(step.vertex));
                if source.is_none() {
                    mesh.each_input(step, |v| needed[v.index()] = true);
                }
            }
        }
        self.evaluated = 0;
        for (step, source) in mesh.steps().iter().zip(sources) {
            let at = step.vertex.index();
            if !needed[at] {
                self.state[at] = State::Unknown;
                continue;
            }
            let (position, state) = match source {
                Some(v) => (x[v.index()], State::Active),
                None => {
                    let mut stale = self.state[at] != State::Embedded;
                    mesh.each_input(step, |v| stale |= self.changed[v.index()]);
                    if !stale {
                        self.changed[at] = false;
                        continue;
                    }
                    self.evaluated += 1;
                    (mesh.place(step, &self.positions, rotation), State::Embedded)
                }
            };
            self.changed[at] =
                self.state[at] == State::Unknown || !same_bits(&position, &self.positions[at]);
            self.positions[at] = position;
            self.state[at] = state;
        }
        Ok(&self.positions)
    }

    /// The positions of the last call by vertex number of the detail forest, m; zero where none
    /// was asked for.
    pub fn positions(&self) -> &[Vector3<f64>] {
        &self.positions
    }

    /// How many positions the last call computed.
    pub fn evaluated(&self) -> usize {
        self.evaluated
    }
}

fn same_bits(a: &Vector3<f64>, b: &Vector3<f64>) -> bool {
    a.iter().zip(b.iter()).all(|(a, b)| a.to_bits() == b.to_bits())
}

/// Lattice units of the detail forest per unit of `active`.
fn check(
    detail: &BisectionForest,
    active: &BisectionForest,
    x: &[Vector3<f64>],
) -> Result<i32, EmbedError> {
    let (coarse, fine) = (active.domain().lattice(), detail.domain().lattice());
    if coarse.cells != fine.cells || coarse.units > fine.units {
        return Err(EmbedError::OtherLattice { found: *coarse, want: *fine });
    }
    if x.len() < active.vertex_capacity() {
        let (found, want) = (x.len(), active.vertex_capacity());
        return Err(EmbedError::PositionCount { found, want });
    }
    Ok(fine.units / coarse.units)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use nalgebra::Matrix3;
    use yawara_mesh::{Domain, LabelTree, Lattice, MeshDelta};

    fn unturned(_: &Matrix3<f64>) -> Matrix3<f64> {
        Matrix3::identity()
    }

    fn forest(start: u8, max: u8) -> BisectionForest {
        let tree = Arc::new(LabelTree::homogeneous([2, 1, 1], 1));
        let domain = Domain::full(Lattice::new([2, 1, 1], max));
        BisectionForest::new(domain, tree, start, max).unwrap()
    }

    /// Positions of `forest` on cubes of edge 1, moved by `map`.
    fn moved(forest: &BisectionForest, map: fn(Vector3<f64>) -> Vector3<f64>) -> Vec<Vector3<f64>> {
        let unit = 1.0 / f64::from(forest.domain().lattice().units);
        let mut x = vec![Vector3::zeros(); forest.vertex_capacity()];
        for v in forest.vertices() {
            x[v.index()] = map(unit * Vector3::from(forest.point(v).map(f64::from)));
        }
        x
    }

    #[test]
    fn an_affine_motion_of_the_coarse_mesh_is_that_of_the_detail() {
        let map = |x: Vector3<f64>| Vector3::new(1.5 * x.x + 0.2 * x.y, x.y - 1.0, x.z + 0.3 * x.x);
        let detail = DetailMesh::new(forest(7, 7));
        for level in 0..5 {
            let active = forest(level, 4);
            let x = detail.positions(&active, &moved(&active, map), &unturned).unwrap();
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
        let positions = detail.positions(&active, &x, &unturned).unwrap();
        let exact = moved(detail.forest(), bend);
        let mut midpoints = 0;
        for v in detail.forest().vertices() {
            if let Some(same) = active.vertex_at(detail.forest().point(v)) {
                assert_eq!(positions[v.index()], x[same.index()]);
                continue;
            }
            midpoints += 1;
            // Linear interpolation of a parabola along an edge of Δx lies ¼ Δx² above at most.
            let above = positions[v.index()].z - exact[v.index()].z;
            assert!((-1e-12..=0.25 + 1e-12).contains(&above), "{above}");
        }
        assert!(midpoints > 20);
    }

    #[test]
    fn a_mesh_that_does_not_belong_is_refused() {
        let detail = DetailMesh::new(forest(3, 3));
        let finer = forest(0, 6);
        let x = vec![Vector3::zeros(); finer.vertex_capacity()];
        let error = detail.positions(&finer, &x, &unturned).unwrap_err();
        assert!(matches!(error, EmbedError::OtherLattice { .. }), "{error}");
        let active = forest(0, 3);
        let error = detail.positions(&active, &[], &unturned).unwrap_err();
        assert_eq!(error, EmbedError::PositionCount { found: 0, want: active.vertex_capacity() });
    }
}
