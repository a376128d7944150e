//! A body as cells that are of material or not.

use nalgebra::{Matrix3, Vector3};
use yawara_mesh::PlainMesh;
use yawara_mesh::volume::LabelVolume;

use crate::body::{Origin, Start};

/// Cells along the longest side of a body from a mesh file.
const CELLS: f64 = 160.0;

/// Cubes of one size, x fastest.
pub(super) struct Solid {
    pub dims: [usize; 3],
    /// Their edge, m.
    pub edge: f64,
    /// Solver position of the lower corner of the first, m.
    pub origin: Vector3<f64>,
    pub is_solid: Vec<bool>,
}

impl Solid {
    pub fn of(start: &Start) -> Self {
        match &start.origin {
            Origin::Image(setup) => Self::of_volume(&setup.volume),
            Origin::MeshFile(mesh) => {
                let organ = &start.places.organ;
                Self::of_mesh(&mesh.mesh, organ.low, organ.high - organ.low)
            }
        }
    }

    fn of_volume(volume: &LabelVolume) -> Self {
        Self {
            dims: volume.grid().dims,
            edge: volume.grid().spacing_mm * 1e-3,
            origin: Vector3::zeros(),
            is_solid: volume.labels().iter().map(|&label| label != 0).collect(),
        }
    }

    /// The cells whose middles lie in tetrahedra.
    fn of_mesh(mesh: &PlainMesh, origin: Vector3<f64>, size: Vector3<f64>) -> Self {
        let edge = size.max() / CELLS;
        let dims = <[f64; 3]>::from(size).map(|x| (x / edge).ceil().max(1.0) as usize);
        let mut is_solid = vec![false; dims.iter().product()];
        for tet in 0..mesh.tets().len() {
            let x = mesh.corners(tet).map(|x| (x - origin) / edge);
            let sides = Matrix3::from_columns(&[x[1] - x[0], x[2] - x[0], x[3] - x[0]]);
            let Some(inverse) = sides.try_inverse() else { continue };
            let low = x[0].inf(&x[1]).inf(&x[2]).inf(&x[3]);
            let high = x[0].sup(&x[1]).sup(&x[2]).sup(&x[3]);
            let range = |i: usize| {
                let first = (low[i] - 0.5).ceil().max(0.0) as usize;
                first..((high[i] + 0.5).floor().max(0.0) as usize).min(dims[i])
            };
            for k in range(2) {
                for j in range(1) {
                    for i in range(0) {
                        let middle = Vector3::new(i as f64, j as f64, k as f64).add_scalar(0.5);
                        let lambda = inverse * (middle - x[0]);
                        if lambda.min() >= -1e-9 && lambda.sum() <= 1.0 + 1e-9 {
                            is_solid[i + dims[0] * (j + dims[1] * k)] = true;
                        }
                    }
                }
            }
        }
        Self { dims, edge, origin, is_solid }
    }

    /// The cell of a solver position, within the grid.
    pub fn cell(&self, x: &Vector3<f64>) -> [usize; 3] {
        let at = (x - self.origin) / self.edge;
        [0, 1, 2].map(|i| (at[i].floor().max(0.0) as usize).min(self.dims[i] - 1))
    }

    pub fn get(&self, [i, j, k]: [usize; 3]) -> bool {
        self.is_solid[i + self.dims[0] * (j + self.dims[1] * k)]
    }
}
