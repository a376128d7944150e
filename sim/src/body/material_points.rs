//! Points of the fine material in a region, each with the volume that it stands for, m³.

use nalgebra::{Matrix3, Vector3};
use yawara_corot::WeightedPoint;
use yawara_mesh::PlainMesh;
use yawara_mesh::volume::LabelVolume;

use super::organ_box::{OrganBox, Zone};

/// Weight of one corner in the quadrature of four points that is exact for squares.
const NEAR: f64 = 0.585_410_196_624_968_5;
const FAR: f64 = (1.0 - NEAR) / 3.0;

/// How far the two points of a quadrature along an edge of 1 are from its middle: 1/(2√3).
const OFF: f64 = 0.288_675_134_594_812_9;

/// Barycentric coordinates that are off by no more than this are of one place.
const SAME: f64 = 1e-9;

impl Zone {
    /// The axis along which it has no thickness within the organ's box, if it is one.
    fn flat_axis(&self) -> Option<usize> {
        let Self::Box { min, max } = self else { return None };
        let is_flat = |axis: usize| min[axis].max(0.0) == max[axis].min(1.0);
        let mut flat = (0..3).filter(|&axis| is_flat(axis));
        flat.next().filter(|_| flat.next().is_none())
    }

    /// The box around it, solver axes, m.
    fn bounds(&self, organ: &OrganBox) -> [Vector3<f64>; 2] {
        match self {
            Self::Box { min, max } => {
                [organ.at(min.map(|x| x.max(0.0))), organ.at(max.map(|x| x.min(1.0)))]
            }
            Self::Sphere { centre, radius_m } => {
                [-1.0, 1.0].map(|side| organ.at(*centre).add_scalar(side * radius_m))
            }
        }
    }
}

/// Points of all voxels in `zone` that are not void, two along each axis (Gauss). In a flat region
/// those of voxels' faces in its plane, which stand for a layer of one voxel. What is quadratic over a
/// voxel is summed exactly.
///
/// Cost: O(voxels in the box around the region).
pub(crate) fn of_volume(volume: &LabelVolume, organ: &OrganBox, zone: &Zone) -> Vec<WeightedPoint> {
    let voxel = volume.grid().spacing_mm * 1e-3;
    let dims = volume.grid().dims;
    let flat = zone.flat_axis();
    let [low, high] = zone.bounds(organ).map(|x| x / voxel);
    // The layers on both sides of a plane; the one that it lies in, if it is no boundary of voxels.
    let range = |axis: usize| {
        let first = (low[axis] - 1e-6).floor().max(0.0) as usize;
        let behind = (high[axis] + 1e-6).floor().max(-1.0) + 1.0;
        first..(behind as usize).min(dims[axis])
    };
    let count = if flat.is_some() { 4 } else { 8 };
    let weight = voxel.powi(3) / count as f64;
    let side = |corner: usize, axis: usize| if corner >> axis & 1 == 0 { -OFF } else { OFF };
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
                for corner in
                    (0..8).filter(|corner| flat.is_none_or(|axis| corner >> axis & 1 == 0))
                {
                    let mut rest = middle;
                    for axis in (0..3).filter(|&axis| flat != Some(axis)) {
                        rest[axis] += side(corner, axis) * voxel;
                    }
                    if zone.contains(organ, &rest) {
                        points.push(WeightedPoint { rest, weight });
                    }
                }
            }
        }
    }
    points
}

/// Four points of each tetrahedron, those in `zone`. In a flat region three of each outer face
/// whose corners lie in it, which stand for a layer as thick as `thickness`, m.
///
/// Cost: O(tetrahedra).
pub(crate) fn of_mesh(
    mesh: &PlainMesh,
    organ: &OrganBox,
    zone: &Zone,
    thickness: f64,
) -> Vec<WeightedPoint> {
    let mut points = Vec::new();
    if zone.flat_axis().is_some() {
        for face in mesh.boundary_faces() {
            let x = face.map(|v| mesh.points()[v as usize]);
            if x.iter().all(|x| zone.contains(organ, x)) {
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
        let inside = inner.into_iter().filter(|x| zone.contains(organ, x));
        points.extend(inside.map(|rest| WeightedPoint { rest, weight }));
    }
    points
}

/// The point nearest to `x` of all voxels that are not void, as whole cubes; none without any.
///
/// Cost: O(voxels).
pub(crate) fn nearest_of_volume(volume: &LabelVolume, x: &Vector3<f64>) -> Option<Vector3<f64>> {
    let voxel = volume.grid().spacing_mm * 1e-3;
    let dims = volume.grid().dims;
    let mut nearest = (f64::INFINITY, None);
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            for at in (0..dims[0]).map(|x| [x, y, z]).filter(|&[x, y, z]| volume.get(x, y, z) != 0)
            {
                let inside =
                    |i: usize, _| x[i].clamp(at[i] as f64 * voxel, (at[i] + 1) as f64 * voxel);
                let point = Vector3::from_fn(inside);
                let distance = (point - x).norm_squared();
                if distance < nearest.0 {
                    nearest = (distance, Some(point));
                }
            }
        }
    }
    nearest.1
}

/// `x` if it lies in a tetrahedron, up to rounding, else the vertex nearest to it.
///
/// Cost: O(tetrahedra).
pub(crate) fn nearest_of_mesh(mesh: &PlainMesh, x: &Vector3<f64>) -> Option<Vector3<f64>> {
    let holds = |tet: usize| {
        let [a, b, c, d] = mesh.corners(tet);
        let lambda = Matrix3::from_columns(&[b - a, c - a, d - a]).lu().solve(&(x - a));
        lambda.is_some_and(|lambda| lambda.min() >= -SAME && lambda.sum() <= 1.0 + SAME)
    };
    if (0..mesh.tets().len()).any(holds) {
        return Some(*x);
    }
    let distance = |point: &&Vector3<f64>| (*point - x).norm_squared();
    mesh.points().iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).copied()
}

#[cfg(test)]
mod tests {
    use yawara_mesh::volume::Grid;

    use super::*;

    #[test]
    fn the_nearest_of_the_material_is_a_point_of_a_voxel_or_of_a_tetrahedron() {
        // The second of two voxels of 10 mm.
        let grid = Grid::centred([2, 1, 1], 10.0);
        let volume = LabelVolume::new(grid, vec![0, 1], vec![0, 1]).unwrap();
        let cases = [
            ([0.013, 0.002, 0.01], [0.013, 0.002, 0.01]),
            ([0.004, 0.002, 0.005], [0.01, 0.002, 0.005]),
            ([0.023, -0.001, 0.011], [0.02, 0.0, 0.01]),
        ];
        for (x, want) in cases {
            let got = nearest_of_volume(&volume, &Vector3::from(x)).unwrap();
            assert!((got - Vector3::from(want)).norm() < 1e-17, "{x:?}: {got}");
        }
        let corners = [Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()];
        let (mesh, _) = PlainMesh::new(corners.to_vec(), vec![[0, 1, 2, 3]], vec![1]).unwrap();
        // Inside, on a face, beyond it.
        for (x, want) in [
            ([0.1, 0.2, 0.3], [0.1, 0.2, 0.3]),
            ([0.5, 0.25, 0.25], [0.5, 0.25, 0.25]),
            ([0.7, 0.3, 0.4], [1.0, 0.0, 0.0]),
        ] {
            assert_eq!(nearest_of_mesh(&mesh, &Vector3::from(x)), Some(Vector3::from(want)));
        }
    }
}
