//! Points that are the same for every mesh of a body: what meshes are compared by.

use nalgebra::Vector3;
use yawara_embed::{DetailMesh, Follower};
use yawara_mesh::lattice::MAX_LEVEL;
use yawara_mesh::{BisectionForest, Domain, Lattice, VertexId};

use super::surfaces::rotation;
use crate::error::SimError;
use crate::step::Simulation;

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
}

impl Simulation {
    /// The vertices of the uniform mesh of `level` on the same base cells, or of the finest level
    /// that this simulation may refine to if that is finer.
    ///
    /// Cost: as the mesh itself, and one combination of halves per heterogeneous tetrahedron.
    /// # Errors
    /// [`SimError::Value`] for a mesh from a file, which has no levels, or a level beyond
    /// [`MAX_LEVEL`]; [`SimError::Bisection`], [`SimError::Embed`].
    pub fn probe(&self, level: u8) -> Result<Probe, SimError> {
        let refused = |key: &str, value: String, want: &str| SimError::Value {
            place: self.scene.name.clone(),
            key: key.into(),
            value,
            want: want.into(),
        };
        let Some(refiner) = &self.refiner else {
            let path = format!("{:?}", self.scene.mesh.path);
            let want = "an image: a mesh from a file has no finer levels to measure it on";
            return Err(refused("mesh.path", path, want));
        };
        let coarse = refiner.forest.domain();
        let level = level.max(refiner.forest.max_level());
        if level > MAX_LEVEL {
            let want = format!("at most {MAX_LEVEL}");
            return Err(refused("level of the probe", level.to_string(), &want));
        }
        let tree = refiner.forest.tree();
        let lattice = Lattice::new(coarse.lattice().cells, level);
        let mut domain = Domain::of_labels(lattice, tree);
        let dropped: Vec<usize> = domain.cells().filter(|&cell| !coarse.has_cell(cell)).collect();
        domain.exclude(&dropped);
        let forest = BisectionForest::new(domain, tree.clone(), level, level)?;
        let units = f64::from(lattice.units) / f64::from(coarse.lattice().units);
        let mut placement = refiner.placement;
        placement.unit /= units;
        let mut number = vec![u32::MAX; forest.vertex_capacity()];
        let (mut vertices, mut rest, mut tets) = (Vec::new(), Vec::new(), Vec::new());
        for tet in forest.leaves().filter(|tet| tree.majority(tet.node) != 0) {
            tets.push(tet.vertices.map(|v| {
                if number[v.index()] == u32::MAX {
                    number[v.index()] = vertices.len() as u32;
                    vertices.push(v);
                    rest.push(placement.position(forest.point(v)));
                }
                number[v.index()]
            }));
        }
        let detail = DetailMesh::embedded(forest, &refiner.embedding, placement.unit)?;
        let follower = Follower::new(&detail, vertices.iter().copied());
        Ok(Probe { detail, follower, vertices, rest, tets })
    }

    /// Where the points of `probe` now are, solver axes, m, in the order of [`Probe::rest`].
    ///
    /// Cost: a look at every point; arithmetic only where something has moved.
    /// # Errors
    /// [`SimError::Embed`] if `probe` is of another body.
    pub fn probe_positions(&self, probe: &mut Probe) -> Result<Vec<Vector3<f64>>, SimError> {
        let Some(refiner) = &self.refiner else { return Ok(probe.rest.clone()) };
        let Probe { detail, follower, vertices, .. } = probe;
        let now = follower.follow(detail, &refiner.forest, &self.state.positions, &rotation)?;
        Ok(vertices.iter().map(|v| now[v.index()]).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Stages, scene_file};

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
        let volume: f64 = a
            .tets()
            .iter()
            .map(|tet| {
                let x = tet.map(|v| a.rest()[v as usize]);
                yawara_mesh::geometry::signed_volume(&x).abs()
            })
            .sum();
        assert!((volume - 0.16 * 0.04 * 0.04).abs() < 1e-15, "{volume}");
        let now = coarse.probe_positions(&mut a).unwrap();
        let off = now.iter().zip(a.rest()).map(|(x, y)| (x - y).norm());
        assert!(off.fold(0.0, f64::max) < 1e-15);
    }

    #[test]
    fn a_held_end_moves_with_its_tool_on_every_mesh() {
        for level in ["mesh.start_level=0", "mesh.start_level=3"] {
            let mut body = beam(&[level, "time.steps=3"]);
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
