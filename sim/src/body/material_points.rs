//! Points of the fine material in a region, each with the volume that it stands for, m³.

use nalgebra::Vector3;
use yawara_corot::WeightedPoint;
use yawara_mesh::PlainMesh;
use yawara_mesh::volume::LabelVolume;

use super::organ_box::OrganBox;
use crate::scene::Region;

/// Weight of one corner in the quadrature of four points that is exact for squares.
const NEAR: f64 = 0.585_410_196_624_968_5;
const FAR: f64 = (1.0 - NEAR) / 3.0;

impl Region {
    /// The axis along which it has no thickness, if it is one.
    fn flat_axis(&self) -> Option<usize> {
        let Self::Box { min, max } = self else { return None };
        let mut flat = (0..3).filter(|&axis| min[axis] == max[axis]);
        flat.next().filter(|_| flat.next().is_none())
    }

    /// The box around it, solver axes, m.
    fn bounds(&self, organ: &OrganBox) -> [Vector3<f64>; 2] {
        match self {
            Self::Box { min, max } => [organ.at(*min), organ.at(*max)],
            Self::Sphere { centre, radius_m } => {
                [-1.0, 1.0].map(|side| organ.at(*centre).add_scalar(side * radius_m))
            }
        }
    }
}

/// The middles of all voxels in `region` that are not void. In a flat region the middles of voxels'
/// faces in its plane, which stand for a layer of one voxel.
///
/// Cost: O(voxels in the box around the region).
pub(crate) fn of_volume(
    volume: &LabelVolume,
    organ: &OrganBox,
    region: &Region,
) -> Vec<WeightedPoint> {
    let voxel = volume.grid().spacing_mm * 1e-3;
    let dims = volume.grid().dims;
    let flat = region.flat_axis();
    let [low, high] = region.bounds(organ).map(|x| x / voxel);
    // The layers on both sides of a plane; the one that it lies in, if it is no boundary of voxels.
    let range = |axis: usize| {
        let first = (low[axis] - 1e-6).floor().max(0.0) as usize;
        let behind = (high[axis] + 1e-6).floor().max(-1.0) + 1.0;
        first..(behind as usize).min(dims[axis])
    };
    let weight = voxel.powi(3);
    let mut points = Vec::new();
    for z in range(2) {
        for y in range(1) {
            for x in range(0) {
                if volume.get(x, y, z) == 0 {
                    continue;
                }
                let mut at = [x, y, z];
                let mut middle = Vector3::from(at.map(|i| (i as f64 + 0.5) * voxel));
                if let Some(axis) = flat {
                    middle[axis] = low[axis] * voxel;
                    // A face between two voxels of material counts once.
                    let is_upper = at[axis] > range(axis).start;
                    at[axis] = at[axis].saturating_sub(1);
                    if is_upper && volume.get(at[0], at[1], at[2]) != 0 {
                        continue;
                    }
                }
                if region.contains(organ, &middle) {
                    points.push(WeightedPoint { rest: middle, weight });
                }
            }
        }
    }
    points
}

/// Four points of each tetrahedron, those in `region`. In a flat region three of each outer face
/// whose corners lie in it, which stand for a layer as thick as `thickness`, m.
///
/// Cost: O(tetrahedra).
pub(crate) fn of_mesh(
    mesh: &PlainMesh,
    organ: &OrganBox,
    region: &Region,
    thickness: f64,
) -> Vec<WeightedPoint> {
    let mut points = Vec::new();
    if region.flat_axis().is_some() {
        for face in mesh.boundary_faces() {
            let x = face.map(|v| mesh.points()[v as usize]);
            if x.iter().all(|x| region.contains(organ, x)) {
                let area = 0.5 * (x[1] - x[0]).cross(&(x[2] - x[0])).norm();
                let middle = |i: usize| 0.5 * (x[i] + x[(i + 1) % 3]);
                let weight = area / 3.0 * thickness;
                points.extend([0, 1, 2].map(|i| WeightedPoint { rest: middle(i), weight }));
            }
        }
        return points;
    }
    for tet in 0..mesh.tets().len() {
        let x = mesh.corners(tet);
        let weight = (x[1] - x[0]).cross(&(x[2] - x[0])).dot(&(x[3] - x[0])).abs() / 24.0;
        let sum: Vector3<f64> = x.iter().sum();
        let inner = x.map(|x| FAR * sum + (NEAR - FAR) * x);
        let inside = inner.into_iter().filter(|x| region.contains(organ, x));
        points.extend(inside.map(|rest| WeightedPoint { rest, weight }));
    }
    points
}
