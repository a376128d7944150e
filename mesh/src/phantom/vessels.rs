//! A portal tree that feeds all of the liver, its radii by Murray's law.

use nalgebra::{Matrix3, Vector3};

use super::random::SplitMix64;
use super::shape::{HALF_EXTENT, HILUM, RIGHT_LOBE, gallbladder, liver_field};
use super::size::{LiverPhantom, PARENCHYMA, VESSELS};
use crate::image::ImageError;
use crate::image::volume::Grid;

/// Points of tissue to be fed; each takes the same share of the flow.
const POINTS: usize = 320;
/// Branches that feed no more points end.
const POINTS_PER_LEAF: usize = 4;
/// Radius of the portal vein, in lengths of the organ.
const TRUNK_RADIUS: f64 = 0.03;
/// Length of the portal vein inside the liver.
const TRUNK_LENGTH: f64 = 0.07;
/// Distance of fed points from the surface, so that no branch runs along it.
const DEPTH: f64 = 0.03;
/// How far a branch goes towards the middle of what it feeds, where it forks and where it ends.
const FORK_AT: f64 = 0.55;
const END_AT: f64 = 0.9;

/// One straight piece of a vessel, round, of constant radius.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VesselSegment {
    /// Middle of its beginning, scanner RAS, mm.
    pub start: Vector3<f64>,
    /// Middle of its end, scanner RAS, mm.
    pub end: Vector3<f64>,
    /// Radius, mm.
    pub radius: f64,
    /// Position in the list of the segment it branches from, always an earlier one; `None` for
    /// the trunk.
    pub parent: Option<usize>,
}

/// The vessels of [`liver`](fn@super::liver): a binary tree, the trunk first.
///
/// Points spread evenly in the tissue are split again and again in two sets, each fed by one
/// branch that heads for its middle. Flow goes by the number of points, and r³ by the flow, so
/// that r₀³ = r₁³ + r₂³ at every fork (Murray's law).
///
/// Units: mm, scanner RAS. Cost: O(p log p) for 320 points.
///
/// # Errors
/// [`ImageError::Parameter`] if a size is not finite or out of range.
/// # Source
/// Murray, "The physiological principle of minimum work", PNAS 12, 1926.
pub fn vessel_tree(size: LiverPhantom) -> Result<Vec<VesselSegment>, ImageError> {
    size.check()?;
    let mut random = SplitMix64::new(size.seed);
    let mut points = Vec::with_capacity(POINTS);
    while points.len() < POINTS {
        let p = random.in_box(HALF_EXTENT);
        if liver_field(p) < -DEPTH && gallbladder(p) > 0.0 {
            points.push(p);
        }
    }
    let inwards = (RIGHT_LOBE - HILUM).normalize();
    let end = HILUM + inwards * TRUNK_LENGTH;
    let trunk = VesselSegment { start: HILUM, end, radius: TRUNK_RADIUS, parent: None };
    let mut tree = vec![trunk];
    grow(&mut tree, 0, &mut points, &mut random);
    for segment in &mut tree {
        segment.start *= size.length_mm;
        segment.end *= size.length_mm;
        segment.radius *= size.length_mm;
    }
    Ok(tree)
}

/// Forks `tree[parent]` into two branches for the two halves of `points`, and so on.
fn grow(
    tree: &mut Vec<VesselSegment>,
    parent: usize,
    points: &mut [Vector3<f64>],
    random: &mut SplitMix64,
) {
    let direction = widest_direction(points);
    points.sort_by(|a, b| a.dot(&direction).total_cmp(&b.dot(&direction)));
    let share = random.between(0.35, 0.65);
    let at = ((points.len() as f64 * share) as usize).clamp(1, points.len() - 1);
    let (low, high) = points.split_at_mut(at);
    for half in [low, high] {
        let ends = half.len() <= POINTS_PER_LEAF;
        let start = tree[parent].end;
        let end = reach(start, mean(half), if ends { END_AT } else { FORK_AT });
        let radius = TRUNK_RADIUS * cube_root(half.len() as f64 / POINTS as f64);
        let branch = tree.len();
        tree.push(VesselSegment { start, end, radius, parent: Some(parent) });
        if !ends {
            grow(tree, branch, half, random);
        }
    }
}

/// Part of the way from `start` to `goal`, less where the straight way leaves the liver.
fn reach(start: Vector3<f64>, goal: Vector3<f64>, part: f64) -> Vector3<f64> {
    let inside = |part: f64| {
        (1..=8).all(|i| liver_field(start + (goal - start) * (part * i as f64 / 8.0)) < 0.0)
    };
    let mut part = part;
    while part > 0.05 && !inside(part) {
        part *= 0.8;
    }
    start + (goal - start) * part
}

fn mean(points: &[Vector3<f64>]) -> Vector3<f64> {
    points.iter().sum::<Vector3<f64>>() / points.len() as f64
}

/// The direction of largest variance, by power iteration on the covariance.
fn widest_direction(points: &[Vector3<f64>]) -> Vector3<f64> {
    let middle = mean(points);
    let mut covariance = Matrix3::zeros();
    for p in points {
        covariance += (p - middle) * (p - middle).transpose();
    }
    let mut direction = Vector3::new(1.0, 0.9, 0.8);
    for _ in 0..8 {
        let next = covariance * direction;
        // Coinciding points have no direction: any will do.
        if next.norm() == 0.0 {
            return direction;
        }
        direction = next / next.norm();
    }
    direction
}

/// ∛v for 0 < v ≤ 1 by Newton's method: libraries' cube roots differ in the last bit.
fn cube_root(v: f64) -> f64 {
    let mut root = 1.0;
    loop {
        let next = (2.0 * root + v / (root * root)) / 3.0;
        // From above the sequence falls until rounding stops it.
        if next >= root {
            return root;
        }
        root = next;
    }
}

/// Labels the tissue of slice `z` that lies in a vessel.
pub(super) fn paint(tree: &[VesselSegment], grid: &Grid, z: usize, slice: &mut [u16]) {
    let centre = |axis: usize, i: usize| grid.origin_mm[axis] + (i as f64 + 0.5) * grid.spacing_mm;
    for segment in tree {
        let (low, high) = (segment.start.inf(&segment.end), segment.start.sup(&segment.end));
        if centre(2, z) < low.z - segment.radius || centre(2, z) > high.z + segment.radius {
            continue;
        }
        let range = |axis: usize| {
            let first = (low[axis] - segment.radius - grid.origin_mm[axis]) / grid.spacing_mm;
            let last = (high[axis] + segment.radius - grid.origin_mm[axis]) / grid.spacing_mm;
            // The cast saturates at 0 below the grid.
            first as usize..(last as usize + 1).min(grid.dims[axis])
        };
        for y in range(1) {
            for x in range(0) {
                let voxel = &mut slice[y * grid.dims[0] + x];
                let p = Vector3::new(centre(0, x), centre(1, y), centre(2, z));
                if i64::from(*voxel) == PARENCHYMA
                    && distance_squared(segment, p) < segment.radius * segment.radius
                {
                    *voxel = VESSELS as u16;
                }
            }
        }
    }
}

/// From a point to the middle line of a segment.
fn distance_squared(segment: &VesselSegment, p: Vector3<f64>) -> f64 {
    let axis = segment.end - segment.start;
    let along = (p - segment.start).dot(&axis) / axis.norm_squared().max(f64::MIN_POSITIVE);
    (p - segment.start - axis * along.clamp(0.0, 1.0)).norm_squared()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cube_roots_are_exact_to_rounding() {
        for n in 1..=POINTS {
            let v = n as f64 / POINTS as f64;
            let root = cube_root(v);
            assert!((root * root * root / v - 1.0).abs() < 8.0 * f64::EPSILON, "{n}");
        }
    }

    #[test]
    fn vessels_stay_in_the_liver() {
        for seed in 0..50 {
            let size = LiverPhantom { length_mm: 1.0, voxel_mm: 0.05, seed };
            for segment in vessel_tree(size).unwrap() {
                for i in 0..=16 {
                    let p = segment.start + (segment.end - segment.start) * (i as f64 / 16.0);
                    assert!(liver_field(p) < 1e-3, "seed {seed}, {segment:?}");
                }
            }
        }
    }
    #[test]
    fn segments_end_in_half_balls() {
        let (start, end) = (Vector3::zeros(), Vector3::new(0.0, 4.0, 0.0));
        let segment = VesselSegment { start, end, radius: 1.0, parent: None };
        for (p, want) in [([3.0, 1.0, 0.0], 9.0), ([0.0, 6.0, 0.0], 4.0), ([0.0, -3.0, 4.0], 25.0)]
        {
            assert_eq!(distance_squared(&segment, Vector3::from(p)), want);
        }
    }

    #[test]
    fn branches_stop_short_of_the_hollow() {
        // From the left tip to the low end of the right lobe: straight across the underside.
        let (start, goal) = (Vector3::new(-0.33, 0.13, 0.13), Vector3::new(0.17, 0.0, -0.28));
        let leaves = |end: Vector3<f64>| {
            (0..=100).any(|i| liver_field(start + (end - start) * (i as f64 / 100.0)) > 1e-3)
        };
        assert!(liver_field(start) < 0.0 && liver_field(goal) < 0.0 && leaves(goal));
        let end = reach(start, goal, 1.0);
        assert!(end != start && !leaves(end), "{end}");
    }
}
