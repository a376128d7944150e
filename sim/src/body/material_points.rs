//! Points of the fine material in a region, each with the volume that it stands for, m³.

use std::ops::Range;

use nalgebra::{Matrix3, Vector3};
use yawara_corot::WeightedPoint;
use yawara_mesh::PlainMesh;
use yawara_mesh::volume::LabelVolume;

use super::organ_box::{OrganBox, Zone};

/// Weight of one corner in the quadrature of four points that is exact for squares.
const NEAR: f64 = 0.585_410_196_624_968_5;
const FAR: f64 = (1.0 - NEAR) / 3.0;

/// How often a tetrahedron of a mesh file is divided until a region that has one of its corners has a point of it.
const THINNEST: u32 = 6;

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

/// A region of more voxels than this has points by cubes of several of them.
const MOST_VOXELS: usize = 1 << 18;

/// Points of all voxels in `zone` that are not void, two along each axis (Gauss). In a flat region
/// those of voxels' faces in its plane, which stand for a layer of one voxel. What is quadratic over a
/// voxel is summed exactly.
///
/// Where there are more than [`MOST_VOXELS`], cubes of 2³, 4³, … of them that lie in the region as a whole
/// have the points of one: as fine as the count allows, and voxels along the boundary are on their own.
///
/// Cost: O(voxels in the box around the region).
pub(crate) fn of_volume(volume: &LabelVolume, organ: &OrganBox, zone: &Zone) -> Vec<WeightedPoint> {
    points_of(volume, organ, zone, MOST_VOXELS)
}

/// The same with another limit.
fn points_of(
    volume: &LabelVolume,
    organ: &OrganBox,
    zone: &Zone,
    most_voxels: usize,
) -> Vec<WeightedPoint> {
    let voxels = Voxels::new(volume, organ, zone);
    let mut points = Vec::new();
    if let Some(axis) = zone.flat_axis() {
        voxels.visit(1, |at| voxels.add_face(axis, at, &mut points));
        return points;
    }
    let mut count = 0;
    voxels.visit(1, |at| count += usize::from(voxels.is_solid(at)));
    let mut edge = 1;
    while count > most_voxels * edge * edge * edge {
        edge *= 2;
    }
    voxels.visit(edge, |at| voxels.add_cube(at, edge, &mut points));
    points
}

/// Voxels that are not void and that have a point in `zone` but in none of `others`.
///
/// Cost: O(voxels in the box around the region).
pub(crate) fn count_voxels(
    volume: &LabelVolume,
    organ: &OrganBox,
    zone: &Zone,
    others: &[Zone],
) -> usize {
    let voxels = Voxels::new(volume, organ, zone);
    let flat = zone.flat_axis();
    let is_free = |x: &Vector3<f64>| !others.iter().any(|other| other.contains(organ, x));
    let (mut count, mut points) = (0, Vec::new());
    voxels.visit(1, |at| {
        points.clear();
        match flat {
            Some(axis) => voxels.add_face(axis, at, &mut points),
            None => voxels.add_cube(at, 1, &mut points),
        }
        count += usize::from(points.iter().any(|point: &WeightedPoint| is_free(&point.rest)));
    });
    count
}

/// The voxels around a zone.
struct Voxels<'a> {
    volume: &'a LabelVolume,
    organ: &'a OrganBox,
    zone: &'a Zone,
    /// Edge of a voxel, m.
    edge_m: f64,
    /// The box around the zone, voxels, and the layers that it meets.
    low: Vector3<f64>,
    layers: [Range<usize>; 3],
}

impl<'a> Voxels<'a> {
    fn new(volume: &'a LabelVolume, organ: &'a OrganBox, zone: &'a Zone) -> Self {
        let edge_m = volume.grid().spacing_mm * 1e-3;
        let dims = volume.grid().dims;
        let [low, high] = zone.bounds(organ).map(|x| x / edge_m);
        // The layers on both sides of a plane; the one that it lies in, if it is no boundary of voxels.
        let layers = [0, 1, 2].map(|axis| {
            let first = (low[axis] - 1e-6).floor().max(0.0) as usize;
            let behind = (high[axis] + 1e-6).floor().max(-1.0) + 1.0;
            first..(behind as usize).min(dims[axis])
        });
        Self { volume, organ, zone, edge_m, low, layers }
    }

    /// Visits the first voxels of all cubes of `edge` voxels, x fastest.
    fn visit(&self, edge: usize, mut visit: impl FnMut([usize; 3])) {
        let [x, y, z] = self
            .layers
            .each_ref()
            .map(|layers| (layers.start / edge * edge..layers.end).step_by(edge));
        for z in z {
            for y in y.clone() {
                x.clone().for_each(|x| visit([x, y, z]));
            }
        }
    }

    fn is_solid(&self, [x, y, z]: [usize; 3]) -> bool {
        self.volume.get(x, y, z) != 0
    }

    /// The eight points of a cube of `edge` voxels.
    fn gauss(&self, at: [usize; 3], edge: usize) -> impl Iterator<Item = Vector3<f64>> {
        let edge = edge as f64;
        let middle = Vector3::from(at.map(|i| (i as f64 + 0.5 * edge) * self.edge_m));
        let off = OFF * self.edge_m * edge;
        let side = move |corner: usize, axis| if corner >> axis & 1 == 0 { -off } else { off };
        (0..8).map(move |corner| middle + Vector3::from_fn(|axis, _| side(corner, axis)))
    }

    /// Whether all of a cube is material of the zone, which is convex.
    fn is_whole(&self, at: [usize; 3], edge: usize) -> bool {
        let dims = self.volume.grid().dims;
        let ends = at.map(|first| first + edge);
        let corner = |corner: usize| {
            let x = |axis: usize| if corner >> axis & 1 == 0 { at[axis] } else { ends[axis] };
            Vector3::from_fn(|axis, _| x(axis) as f64 * self.edge_m)
        };
        (0..3).all(|axis| ends[axis] <= dims[axis])
            && (0..8).all(|i| self.zone.contains(self.organ, &corner(i)))
            && (at[2]..ends[2]).all(|z| {
                (at[1]..ends[1]).all(|y| (at[0]..ends[0]).all(|x| self.is_solid([x, y, z])))
            })
    }

    /// The points of a cube, or of its parts.
    fn add_cube(&self, at: [usize; 3], edge: usize, points: &mut Vec<WeightedPoint>) {
        if edge > 1 && !self.is_whole(at, edge) {
            let half = edge / 2;
            for corner in 0..8 {
                let part = [0, 1, 2].map(|axis| at[axis] + half * (corner >> axis & 1));
                if (0..3).all(|axis| part[axis] < self.layers[axis].end) {
                    self.add_cube(part, half, points);
                }
            }
        } else if self.is_solid(at) {
            let weight = (edge as f64 * self.edge_m).powi(3) / 8.0;
            let inside = self.gauss(at, edge).filter(|x| self.zone.contains(self.organ, x));
            points.extend(inside.map(|rest| WeightedPoint { rest, weight }));
        }
    }

    /// The points of a voxel's face in the plane of a zone that is flat along `axis`.
    fn add_face(&self, axis: usize, at: [usize; 3], points: &mut Vec<WeightedPoint>) {
        if !self.is_solid(at) {
            return;
        }
        // A face between two voxels of material counts once.
        let mut lower = at;
        lower[axis] = lower[axis].saturating_sub(1);
        if at[axis] > self.layers[axis].start && self.is_solid(lower) {
            return;
        }
        let weight = self.edge_m.powi(3) / 4.0;
        for (corner, mut rest) in self.gauss(at, 1).enumerate() {
            rest[axis] = self.low[axis] * self.edge_m;
            if corner >> axis & 1 == 0 && self.zone.contains(self.organ, &rest) {
                points.push(WeightedPoint { rest, weight });
            }
        }
    }
}

/// Four points of each tetrahedron, those in `zone`; of one that has a corner but no point in it the same of its
/// eighths, and so on, so that a thin region holds something of coarse tetrahedra. In a flat region three of each outer face
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
    let is_inside = |x: &Vector3<f64>| zone.contains(organ, x);
    for tet in 0..mesh.tets().len() {
        add_tet(&mesh.corners(tet), &is_inside, THINNEST, &mut points);
    }
    points
}

/// Adds the points of a tetrahedron, which may be divided so many times.
fn add_tet(
    x: &[Vector3<f64>; 4],
    is_inside: &impl Fn(&Vector3<f64>) -> bool,
    times: u32,
    points: &mut Vec<WeightedPoint>,
) {
    let weight = (x[1] - x[0]).cross(&(x[2] - x[0])).dot(&(x[3] - x[0])).abs() / 24.0;
    let sum: Vector3<f64> = x.iter().sum();
    let inner = x.map(|x| FAR * sum + (NEAR - FAR) * x);
    let before = points.len();
    let inside = inner.into_iter().filter(is_inside);
    points.extend(inside.map(|rest| WeightedPoint { rest, weight }));
    if points.len() == before && times > 0 && x.iter().any(is_inside) {
        eighths(x).iter().for_each(|part| add_tet(part, is_inside, times - 1, points));
    }
}

/// A tetrahedron in eight of equal volume: four at its corners, four around a diagonal between them.
fn eighths(x: &[Vector3<f64>; 4]) -> [[Vector3<f64>; 4]; 8] {
    let half = |i: usize, j: usize| 0.5 * (x[i] + x[j]);
    let [a, b, c] = [half(0, 1), half(0, 2), half(0, 3)];
    let [d, e, f] = [half(1, 2), half(1, 3), half(2, 3)];
    [
        [x[0], a, b, c],
        [x[1], a, d, e],
        [x[2], b, d, f],
        [x[3], c, e, f],
        [a, f, b, c],
        [a, f, c, e],
        [a, f, e, d],
        [a, f, d, b],
    ]
}

/// The point nearest to `x` of all voxels that are not void, as whole cubes; none without any.
///
/// Cost: O(voxels nearer than the nearest that is not void).
pub(crate) fn nearest_of_volume(volume: &LabelVolume, x: &Vector3<f64>) -> Option<Vector3<f64>> {
    let voxel = volume.grid().spacing_mm * 1e-3;
    let dims = volume.grid().dims.map(|n| n as i64);
    let own: [i64; 3] = x.map(|x| (x / voxel).floor() as i64).into();
    let off = |axis: usize, at: i64| (at - own[axis]).abs();
    // How many voxels it is from the image, and from its farthest side.
    let beside = (0..3).map(|axis| off(axis, own[axis].clamp(0, dims[axis] - 1)));
    let across = (0..3).map(|axis| off(axis, 0).max(off(axis, dims[axis] - 1)));
    let mut nearest: Option<Near> = None;
    for radius in beside.max()?..=across.max()? {
        let layers =
            |axis: usize| (own[axis] - radius).max(0)..(own[axis] + radius + 1).min(dims[axis]);
        for z in layers(2) {
            for y in layers(1) {
                let is_cap = off(2, z) == radius || off(1, y) == radius;
                if is_cap {
                    layers(0).for_each(|i| look(volume, x, [i, y, z], &mut nearest));
                } else {
                    let sides = [own[0] - radius, own[0] + radius];
                    let inside = sides.into_iter().filter(|i| layers(0).contains(i));
                    inside.for_each(|i| look(volume, x, [i, y, z], &mut nearest));
                }
            }
        }
        // What lies farther out is at least as far away as a layer before this one.
        if nearest.is_some_and(|near| near.distance < (radius as f64 * voxel).powi(2)) {
            break;
        }
    }
    Some(nearest?.point)
}

/// A point of a voxel that is not void.
#[derive(Clone, Copy)]
struct Near {
    /// Squared, m².
    distance: f64,
    voxel: [i64; 3],
    point: Vector3<f64>,
}

/// Takes the point of a voxel if it is nearer to `x`; of equals that of the first voxel in the image.
fn look(volume: &LabelVolume, x: &Vector3<f64>, at: [i64; 3], nearest: &mut Option<Near>) {
    let [i, j, k] = at.map(|at| at as usize);
    if volume.get(i, j, k) == 0 {
        return;
    }
    let edge = volume.grid().spacing_mm * 1e-3;
    let inside =
        |axis: usize, _| x[axis].clamp(at[axis] as f64 * edge, (at[axis] + 1) as f64 * edge);
    let point = Vector3::from_fn(inside);
    let distance = (point - x).norm_squared();
    let is_before = |a: [i64; 3], b: [i64; 3]| [a[2], a[1], a[0]] < [b[2], b[1], b[0]];
    let is_nearer = nearest.is_none_or(|near| {
        distance < near.distance || (distance == near.distance && is_before(at, near.voxel))
    });
    if is_nearer {
        *nearest = Some(Near { distance, voxel: at, point });
    }
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

    /// A cube of five tetrahedra of 1 m, whose own points are .138 m away from its sides.
    #[test]
    fn a_thin_region_holds_material_of_coarse_tetrahedra() {
        let corner = |i: usize| Vector3::from([i & 1, i >> 1 & 1, i >> 2 & 1].map(|x| x as f64));
        let tets = vec![[0, 1, 3, 5], [0, 3, 2, 6], [5, 6, 4, 0], [3, 7, 6, 5], [0, 3, 6, 5]];
        let (mesh, _) = PlainMesh::new((0..8).map(corner).collect(), tets, vec![1; 5]).unwrap();
        let organ = OrganBox { low: Vector3::zeros(), high: Vector3::repeat(1.0) };
        let held = |depth: f64| {
            let zone = Zone::Box { min: [0.0; 3], max: [depth, 1.0, 1.0] };
            moments(&of_mesh(&mesh, &organ, &zone, 0.25))
        };
        let (all, first, _) = held(1.0);
        assert!((all - 1.0).abs() < 1e-12 && (first - Vector3::repeat(0.5)).norm() < 1e-12);
        for depth in [0.3, 0.1, 0.03, 0.01] {
            let (weight, first, second) = held(depth);
            assert!((0.3..3.0).contains(&(weight / depth)), "{depth}: {weight} m³");
            // Spread over the whole side, about its middle.
            let middle = first / weight;
            assert!((middle.yz() - nalgebra::Vector2::repeat(0.5)).norm() < 0.05, "{middle}");
            let spread = second / weight - middle * middle.transpose();
            assert!(spread[(1, 1)].min(spread[(2, 2)]) > 0.03, "{spread}");
        }
        let parts = eighths(&[0, 1, 2, 4].map(corner));
        for x in parts {
            let volume = (x[1] - x[0]).cross(&(x[2] - x[0])).dot(&(x[3] - x[0])).abs();
            assert!((volume - 0.125).abs() < 1e-15, "{volume}");
        }
    }

    /// A ball with a hole, of 29³ voxels of 2 mm.
    fn hollow() -> LabelVolume {
        let n = 29;
        let label = |i: usize| {
            let at = [i % n, i / n % n, i / (n * n)].map(|x| (x as f64 - 14.0) / 14.5);
            let radius = at.iter().map(|x| x * x).sum::<f64>().sqrt();
            u16::from((0.2..1.0).contains(&radius))
        };
        let labels = (0..n * n * n).map(label).collect();
        LabelVolume::new(Grid::centred([n; 3], 2.0), labels, vec![0, 1]).unwrap()
    }

    /// Σ w, Σ w x and Σ w x xᵀ.
    fn moments(points: &[WeightedPoint]) -> (f64, Vector3<f64>, Matrix3<f64>) {
        let weight = points.iter().map(|p| p.weight).sum();
        let first = points.iter().map(|p| p.weight * p.rest).sum();
        let second = points.iter().map(|p| p.weight * p.rest * p.rest.transpose()).sum();
        (weight, first, second)
    }

    #[test]
    fn cubes_of_voxels_have_the_moments_of_their_voxels() {
        let volume = hollow();
        let organ = OrganBox::of(&volume).unwrap();
        let zones = [
            Zone::Box { min: [0.0; 3], max: [1.0; 3] },
            Zone::Box { min: [0.3, 0.0, 0.11], max: [0.83, 0.7, 1.0] },
            Zone::Sphere { centre: [0.6, 0.4, 0.3], radius_m: 0.017 },
        ];
        for zone in zones {
            let fine = points_of(&volume, &organ, &zone, usize::MAX);
            let (weight, first, second) = moments(&fine);
            for most in [4000, 500, 50] {
                let coarse = points_of(&volume, &organ, &zone, most);
                assert!(3 * coarse.len() < 2 * fine.len() || most == 4000, "{}", coarse.len());
                let (w, x, xx) = moments(&coarse);
                assert!((w - weight).abs() < 1e-11 * weight, "{w} for {weight}");
                assert!((x - first).norm() < 1e-11 * first.norm(), "{x} for {first}");
                assert!((xx - second).norm() < 1e-11 * second.norm(), "{xx} for {second}");
            }
        }
    }

    #[test]
    fn the_nearest_is_that_of_a_look_at_all_voxels() {
        let volume = hollow();
        let part = |i: usize| ((7919 * i + 13) % 1009) as f64 / 1009.0 * 0.2 - 0.07;
        // Places within the image and far outside of it, in its hole, on faces between voxels.
        let mut places: Vec<Vector3<f64>> =
            (0..60).map(|i| Vector3::from_fn(|axis, _| part(3 * i + axis))).collect();
        places.extend([0.029, 0.028, 0.03, 0.0, 7.0].map(Vector3::repeat));
        for x in places {
            let mut all: Option<Near> = None;
            for i in 0..29 * 29 * 29 {
                look(&volume, &x, [i % 29, i / 29 % 29, i / 841], &mut all);
            }
            assert_eq!(nearest_of_volume(&volume, &x), all.map(|near| near.point), "{x}");
        }
    }

    #[test]
    fn voxels_are_counted_once_and_without_those_of_other_zones() {
        let volume = hollow();
        let organ = OrganBox::of(&volume).unwrap();
        let all = Zone::Box { min: [0.0; 3], max: [1.0; 3] };
        let half = Zone::Box { min: [0.0; 3], max: [0.5, 1.0, 1.0] };
        let solid = (0..29 * 29 * 29).filter(|i| volume.get(i % 29, i / 29 % 29, i / 841) != 0);
        let solid = solid.count();
        assert_eq!(count_voxels(&volume, &organ, &all, &[]), solid);
        let left = count_voxels(&volume, &organ, &half, &[]);
        let right = count_voxels(&volume, &organ, &all, &[half]);
        // The layer in the middle has points on both sides.
        let middle = (0..841).filter(|i| volume.get(14, i % 29, i / 29) != 0).count();
        assert_eq!(left + right, solid + middle);
        let flat = Zone::Box { min: [0.5, 0.0, 0.0], max: [0.5, 1.0, 1.0] };
        assert_eq!(count_voxels(&volume, &organ, &flat, &[]), middle);
    }
}
