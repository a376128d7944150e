//! The state of a simulation as volumes on the image's grid, in material coordinates.

use nalgebra::{Matrix3, Vector3};
use yawara_mesh::volume::{IntensityVolume, LabelVolume};

use super::capture::von_mises;
use crate::body::BodyState;
use crate::error::SimError;

/// How far outside a tetrahedron a voxel's centre may be and count as inside, in barycentric
/// coordinates: centres lie on faces, and rounding puts them to either side.
const SLACK: f64 = 1e-9;

/// Fields on the grid of the image, each voxel where it was before anything moved (material
/// coordinates): a voxel of `displacement_mm` says how far the matter that was there has gone.
/// 0 in void and in parts that are not simulated.
#[derive(Clone, Debug, PartialEq)]
pub struct Fields {
    /// Length of the displacement, mm.
    pub displacement_mm: IntensityVolume,
    /// Von Mises stress of the tetrahedron that holds the voxel's centre, Pa; of centres on a
    /// face, that of the tetrahedron with the lowest number.
    pub von_mises_pa: IntensityVolume,
    /// The labels that were simulated.
    pub label: LabelVolume,
}

impl Fields {
    /// The current state of a body on the grid of `volume`, its labels.
    pub(crate) fn of(state: &BodyState, volume: &LabelVolume) -> Result<Self, SimError> {
        let grid = volume.grid();
        let count = volume.labels().len();
        let mut displacement = vec![0f32; count];
        let mut stress = vec![0f32; count];
        let mut label = vec![0u16; count];
        let BodyState { body, rest, positions, .. } = state;
        for (number, element) in state.elements_by_number() {
            let tet = element.tet;
            let moved = element.vertices.map(|v| positions[v] - rest[v]);
            let rest = element.vertices.map(|v| rest[v]);
            let here = von_mises(&body.stress_without_pressure(number, positions));
            for_each_centre(&rest, grid.dims, grid.spacing_mm * 1e-3, |voxel, weights| {
                let id = volume.labels()[voxel];
                // Void has no matter, and a voxel that a face divides is its first tetrahedron's.
                if id == 0 || label[voxel] != 0 || !state.carries(tet, weights) {
                    return;
                }
                let u: Vector3<f64> = moved.iter().zip(weights).map(|(u, w)| u * w).sum();
                label[voxel] = id;
                displacement[voxel] = (u.norm() * 1e3) as f32;
                stress[voxel] = here as f32;
            });
        }
        Ok(Fields {
            displacement_mm: IntensityVolume::new(grid.clone(), displacement)?,
            von_mises_pa: IntensityVolume::new(grid.clone(), stress)?,
            label: LabelVolume::new(grid.clone(), label, volume.values().to_vec())?,
        })
    }
}

/// The voxels whose centres lie in a closed tetrahedron, with barycentric coordinates.
fn for_each_centre(
    corners: &[Vector3<f64>; 4],
    dims: [usize; 3],
    voxel_m: f64,
    mut visit: impl FnMut(usize, [f64; 4]),
) {
    let edges = [1, 2, 3].map(|i| corners[i] - corners[0]);
    let Some(to_weights) = Matrix3::from_columns(&edges).try_inverse() else { return };
    let range = |axis: usize| {
        let along = corners.map(|x| x[axis] / voxel_m - 0.5);
        let low = along.into_iter().fold(f64::INFINITY, f64::min);
        let high = along.into_iter().fold(f64::NEG_INFINITY, f64::max);
        // Saturating: negative numbers become 0, and an empty range stays empty.
        let end = ((high + SLACK).floor() + 1.0) as usize;
        ((low - SLACK).ceil() as usize)..end.min(dims[axis])
    };
    for z in range(2) {
        for y in range(1) {
            for x in range(0) {
                let centre = Vector3::new(x as f64, y as f64, z as f64).add_scalar(0.5) * voxel_m;
                let w = to_weights * (centre - corners[0]);
                let weights = [1.0 - w.sum(), w[0], w[1], w[2]];
                if weights.iter().all(|&w| w >= -SLACK) {
                    visit(x + dims[0] * (y + dims[1] * z), weights);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn centres_of_a_cube_cut_in_two_corners_are_found_once_or_on_the_cut() {
        // The corner x + y + z ≤ 4 of 4³ voxels of 1 m.
        let corners = [[0., 0., 0.], [4., 0., 0.], [0., 4., 0.], [0., 0., 4.]].map(Vector3::from);
        let mut found = Vec::new();
        for_each_centre(&corners, [4; 3], 1.0, |voxel, weights| {
            let position: Vector3<f64> = corners.iter().zip(weights).map(|(x, w)| x * w).sum();
            let at = [voxel % 4, voxel / 4 % 4, voxel / 16];
            let centre = Vector3::from(at.map(|c| c as f64 + 0.5));
            assert!((position - centre).norm() < 1e-12, "{at:?}");
            found.push(at);
        });
        // Centres sum to at most 4: indices to at most 2.5, so 2.
        let mut want = Vec::new();
        for z in 0..4 {
            for y in 0..4 {
                want.extend((0..4).map(|x| [x, y, z]).filter(|at| at.iter().sum::<usize>() <= 2));
            }
        }
        assert_eq!(found, want);
        // A tetrahedron outside, on the negative side too, reaches nothing.
        for shift in [-9.0, 9.0] {
            let away = corners.map(|x| x.add_scalar(shift));
            for_each_centre(&away, [4; 3], 1.0, |voxel, _| panic!("{voxel}"));
        }
    }
}
