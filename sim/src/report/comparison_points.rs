//! Points that are the same for every mesh of a body: what meshes are compared by.

use nalgebra::Vector3;
use yawara_embed::{DetailMesh, Embedding, Follower};
use yawara_mesh::{BisectionForest, Placement, VertexId};

use super::surfaces::rotation;
use crate::body::same_cells;
use crate::error::SimError;

/// The vertices of a uniformly fine mesh that belong to something else than void, and where the
/// embedding carries them while a simulation's own mesh moves and changes.
pub struct Probe {
    detail: DetailMesh,
    follower: Follower,
    /// By number of the probe: the vertex of the detail's forest.
    vertices: Vec<VertexId>,
    rest: Vec<Vector3<f64>>,
    tets: Vec<[u32; 4]>,
}

impl Probe {
    /// Rest positions, solver axes, m; their order depends on the scene and the level alone.
    pub fn rest(&self) -> &[Vector3<f64>] {
        &self.rest
    }

    /// Vertices of the uniform mesh, those in void included.
    pub fn vertex_count(&self) -> usize {
        self.detail.forest().vertex_count()
    }

    /// Point numbers of the fine tetrahedra that are not mostly void.
    pub fn tets(&self) -> &[[u32; 4]] {
        &self.tets
    }

    /// The vertices of the uniform mesh of `level`, or of the finest level of `forest` if that is
    /// finer, on the base cells of `forest`; `placement` is that of `forest`.
    pub(crate) fn new(
        forest: &BisectionForest,
        embedding: &Embedding,
        mut placement: Placement,
        level: u8,
    ) -> Result<Self, SimError> {
        let level = level.max(forest.max_level());
        let tree = forest.tree();
        let domain = same_cells(forest, level);
        let units = f64::from(domain.lattice().units);
        let fine = BisectionForest::new(domain, tree.clone(), level, level)?;
        placement.unit /= units / f64::from(forest.domain().lattice().units);
        let mut number = vec![u32::MAX; fine.vertex_capacity()];
        let (mut vertices, mut rest, mut tets) = (Vec::new(), Vec::new(), Vec::new());
        for tet in fine.leaves().filter(|tet| tree.majority(tet.node) != 0) {
            tets.push(tet.vertices.map(|v| {
                if number[v.index()] == u32::MAX {
                    number[v.index()] = vertices.len() as u32;
                    vertices.push(v);
                    rest.push(placement.position(fine.point(v)));
                }
                number[v.index()]
            }));
        }
        let detail = DetailMesh::embedded(fine, embedding, placement.unit)?;
        let follower = Follower::new(&detail, vertices.iter().copied());
        Ok(Self { detail, follower, vertices, rest, tets })
    }

    /// Where the points are while `forest` carries them with its vertices at `positions`, m.
    pub(crate) fn follow(
        &mut self,
        forest: &BisectionForest,
        positions: &[Vector3<f64>],
    ) -> Result<Vec<Vector3<f64>>, SimError> {
        let now = self.follower.follow(&self.detail, forest, positions, &rotation)?;
        Ok(self.vertices.iter().map(|v| now[v.index()]).collect())
    }
}

#[cfg(test)]
mod tests {
    use yawara_mesh::bisection::lattice::MAX_LEVEL;
    use yawara_mesh::geometry::signed_volume;

    use super::*;
    use crate::{Simulation, Stages, scene_file};

    fn beam(overrides: &[&str]) -> Simulation {
        let overrides: Vec<String> = overrides.iter().map(|&one| one.into()).collect();
        let (scene, _) = scene_file::load("beam", &overrides).unwrap();
        Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap()
    }

    #[test]
    fn at_rest_every_mesh_has_the_points_of_the_fine_one_where_they_rest() {
        let coarse = beam(&["mesh.max_level=3"]);
        let fine = beam(&["mesh.start_level=6", "mesh.max_vertices=3000"]);
        let (mut a, b) = (coarse.probe(6).unwrap(), fine.probe(6).unwrap());
        // 32 × 8 × 8 cubes of 5 mm.
        assert_eq!(a.rest().len(), 33 * 9 * 9);
        assert_eq!(a.vertex_count(), a.rest().len(), "no void in a block");
        assert_eq!(a.rest(), b.rest());
        assert_eq!(a.tets(), b.tets());
        let corners = |tet: &[u32; 4]| tet.map(|v| a.rest()[v as usize]);
        let volume: f64 = a.tets().iter().map(|tet| signed_volume(&corners(tet)).abs()).sum();
        assert!((volume - 0.16 * 0.04 * 0.04).abs() < 1e-15, "{volume}");
        let now = coarse.probe_positions(&mut a).unwrap();
        let off = now.iter().zip(a.rest()).map(|(x, y)| (x - y).norm());
        assert!(off.fold(0.0, f64::max) < 1e-15);
    }

    #[test]
    fn a_held_end_moves_with_its_tool_on_every_mesh() {
        for level in ["mesh.start_level=0", "mesh.start_level=3"] {
            let mut body = beam(&[level, "time.steps=3", "tools.0.hold=vertices"]);
            let mut probe = body.probe(6).unwrap();
            while body.steps_left() > 0 {
                body.step().unwrap();
            }
            let now = body.probe_positions(&mut probe).unwrap();
            for (now, rest) in now.iter().zip(probe.rest()) {
                if rest.x > 0.16 - 1e-9 {
                    // 20 mm in 1 s, after 0.3 s.
                    let want = rest + Vector3::new(0.0, 0.0, 0.006);
                    assert!((now - want).norm() < 1e-9, "{rest} {now}");
                }
            }
        }
    }

    #[test]
    fn a_level_beyond_the_finest_is_refused() {
        let error = beam(&[]).probe(MAX_LEVEL + 1).err().unwrap();
        assert!(error.to_string().contains("at most"), "{error}");
    }
}
