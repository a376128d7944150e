//! What a scene starts from: a mesh at rest, from an image or from a mesh file.

use nalgebra::{Matrix3, Vector3};
use yawara_mesh::VertexId;
use yawara_mesh::volume::Grid;

use crate::error::SimError;
use crate::fixed_mesh::FixedMesh;
use crate::scene::Scene;
use crate::setup::{OrganBox, Setup};

/// How solver coordinates (m) lie in the scanner.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScannerAxes {
    /// Solver axes → scanner axes.
    rotation: Matrix3<f64>,
    /// Scanner RAS position of the solver's origin, mm.
    origin_mm: Vector3<f64>,
}

impl ScannerAxes {
    pub fn of_grid(grid: &Grid) -> Self {
        Self { rotation: grid.rotation, origin_mm: grid.origin_mm }
    }

    /// Solver axes that are the scanner's.
    pub fn identity() -> Self {
        Self { rotation: Matrix3::identity(), origin_mm: Vector3::zeros() }
    }

    /// Scanner RAS, mm, of a solver position, m.
    pub fn to_ras_mm(self, x: &Vector3<f64>) -> Vector3<f64> {
        self.origin_mm + self.rotation * (x * 1e3)
    }

    pub fn to_ras_direction(self, direction: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * direction
    }

    pub fn to_solver_direction(self, direction: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.transpose() * direction
    }
}

/// Where the mesh comes from.
pub(crate) enum Origin {
    Image(Box<Setup>),
    MeshFile(Box<FixedMesh>),
}

/// A mesh at rest, and what tools and regions ask of it.
pub(crate) struct Start {
    /// What its source is called in messages.
    pub name: String,
    pub axes: ScannerAxes,
    pub organ: OrganBox,
    /// Length of a typical element's edge, m.
    pub edge_m: f64,
    pub vertices: Vec<VertexId>,
    /// By vertex number: rest position, m, and whether it touches anything but void.
    pub rest: Vec<Vector3<f64>>,
    pub solid: Vec<bool>,
    pub origin: Origin,
}

impl Start {
    /// Reads the image or the mesh file of a scene and builds what depends on no stage.
    pub fn new(scene: &Scene) -> Result<Self, SimError> {
        match &scene.mesh.path {
            Some(path) => Ok(Self::of_file(FixedMesh::new(scene, path)?)),
            None => Ok(Self::of_image(Setup::new(scene)?)),
        }
    }

    fn of_image(mut setup: Setup) -> Self {
        let vertices: Vec<VertexId> = setup.forest.vertices().collect();
        let mut rest = vec![Vector3::zeros(); setup.forest.vertex_capacity()];
        for &v in &vertices {
            rest[v.index()] = setup.rest(v);
        }
        Self {
            name: setup.image_name().into(),
            axes: ScannerAxes::of_grid(setup.volume.grid()),
            organ: setup.organ,
            edge_m: setup.start_edge_m(),
            vertices,
            rest,
            solid: std::mem::take(&mut setup.solid),
            origin: Origin::Image(Box::new(setup)),
        }
    }

    fn of_file(mesh: FixedMesh) -> Self {
        let rest = mesh.points().to_vec();
        Self {
            name: mesh.name.clone(),
            axes: ScannerAxes::identity(),
            organ: mesh.organ,
            edge_m: mesh.longest_edge_m,
            vertices: (0..rest.len() as u32).map(VertexId).collect(),
            solid: vec![true; rest.len()],
            rest,
            origin: Origin::MeshFile(Box::new(mesh)),
        }
    }

    /// True where a scene region fixes `vertex`.
    pub fn is_fixed(&self, scene: &Scene, vertex: VertexId) -> bool {
        let x = &self.rest[vertex.index()];
        scene.fixed.iter().any(|region| region.contains(&self.organ, x))
    }
}

/// True where the points do not lie on one line: enough to hold a rigid body.
pub(crate) fn spans_a_plane(points: &[Vector3<f64>]) -> bool {
    let Some((first, others)) = points.split_first() else {
        return false;
    };
    let Some(line) = others
        .iter()
        .map(|p| p - first)
        .max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))
    else {
        return false;
    };
    // A millionth of the length off the line is no lever, and rounding stays far below.
    others.iter().any(|p| (p - first).cross(&line).norm() > 1e-6 * line.norm_squared())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_on_one_line_hold_nothing() {
        let at = |x: f64, y: f64| Vector3::new(x, y, 0.1 * x);
        assert!(!spans_a_plane(&[]));
        assert!(!spans_a_plane(&[at(1.0, 0.0); 4]));
        assert!(!spans_a_plane(&[at(0.1, 0.3), at(0.2, 0.6), at(0.3, 0.9)]));
        assert!(spans_a_plane(&[at(0.1, 0.3), at(0.2, 0.6), at(0.3, 0.91)]));
    }
}
