//! Where a body lies, and where it can be taken hold of.

use yawara_mesh::volume::LabelVolume;

/// How much of a body's depth counts as a side of it.
const LAYER: f64 = 0.08;

/// How much of what faces away from the support may be grabbed.
const FAR: f64 = 0.25;

/// A radius that holds what a pull takes, by the longest side.
const RADIUS: f64 = 0.07;

/// The six sides: axis, whether it is the high one, what it is called. Of equal ones the first is taken,
/// the table that a patient lies on.
pub(super) const SIDES: [(usize, bool, &str); 6] = [
    (1, false, "back"),
    (2, false, "feet"),
    (2, true, "head"),
    (1, true, "front"),
    (0, false, "left"),
    (0, true, "right"),
];

/// What a scene fixes and pulls, in fractions of the body's box.
pub(super) struct Places {
    /// One of [`SIDES`].
    pub side: (usize, bool, &'static str),
    /// Corners of the fixed box.
    pub fixed: [[f64; 3]; 2],
    /// The middle of what is pulled.
    pub grab: [f64; 3],
    /// Its radius, mm.
    pub radius_mm: f64,
    /// The box's edges, mm.
    pub size_mm: [f64; 3],
}

/// The longest edge of the body's box, mm; 0 without a body.
pub(super) fn longest_mm(volume: &LabelVolume) -> f64 {
    volume
        .bounding_box()
        .map_or(0.0, |[low, high]| size_mm(volume, low, high).into_iter().fold(0.0, f64::max))
}

fn size_mm(volume: &LabelVolume, low: [usize; 3], high: [usize; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| (high[i] + 1 - low[i]) as f64 * volume.grid().spacing_mm)
}

impl Places {
    /// The flattest side of the largest part, and what of that part is far from it; none without a
    /// body.
    pub fn new(volume: &LabelVolume) -> Option<Self> {
        let [low, high] = volume.bounding_box()?;
        let part = largest_part(volume);
        let fractions = |at: [usize; 3]| {
            [0, 1, 2].map(|i| (at[i] as f64 + 0.5 - low[i] as f64) / (high[i] + 1 - low[i]) as f64)
        };
        let voxels: Vec<[f64; 3]> = part.into_iter().map(fractions).collect();
        let depth = |at: &[f64; 3], (axis, is_high, _): (usize, bool, &str)| {
            if is_high { 1.0 - at[axis] } else { at[axis] }
        };
        let size_mm = size_mm(volume, low, high);
        // The part of the box's side that material covers in a layer, whole and cut voxels, times the
        // side's area.
        let contact = |side: (usize, bool, &str)| {
            let count = (high[side.0] + 1 - low[side.0]) as f64;
            let layer = LAYER * count;
            let inside = |at| (layer - (depth(at, side) * count - 0.5)).clamp(0.0, 1.0);
            voxels.iter().map(inside).sum::<f64>() / (layer * size_mm[side.0] / count)
        };
        let sides = SIDES.map(|side| (side, contact(side)));
        let (side, _) = sides.into_iter().rev().max_by(|a, b| a.1.total_cmp(&b.1))?;
        let (axis, is_high, _) = side;
        let mut fixed = [[0.0; 3], [1.0; 3]];
        // Deep enough to have something of every part of an uneven side.
        let deep = 2.0 * LAYER;
        fixed[usize::from(!is_high)][axis] = if is_high { 1.0 - deep } else { deep };
        let longest = size_mm.into_iter().fold(0.0, f64::max);
        let radius_mm = (RADIUS * longest).max(3.0 * volume.grid().spacing_mm);
        let deepest = voxels.iter().map(|at| depth(at, side)).fold(0.0, f64::max);
        let far: Vec<&[f64; 3]> =
            voxels.iter().filter(|at| depth(at, side) > (1.0 - FAR) * deepest).collect();
        let mean = [0, 1, 2].map(|i| far.iter().map(|at| at[i]).sum::<f64>() / far.len() as f64);
        let off = |at: &[f64; 3]| (0..3).map(|i| (at[i] - mean[i]).powi(2)).sum::<f64>();
        let grab = **far.iter().min_by(|a, b| off(a).total_cmp(&off(b)))?;
        Some(Self { side, fixed, grab, radius_mm, size_mm })
    }

    /// The direction away from the support.
    pub fn away(&self) -> [f64; 3] {
        let (axis, is_high, _) = self.side;
        let mut away = [0.0; 3];
        away[axis] = if is_high { -1.0 } else { 1.0 };
        away
    }
}

/// The voxels of the largest part that hangs together by faces.
fn largest_part(volume: &LabelVolume) -> Vec<[usize; 3]> {
    let dims = volume.grid().dims;
    let index = |[x, y, z]: [usize; 3]| x + dims[0] * (y + dims[1] * z);
    let mut is_new: Vec<bool> = volume.labels().iter().map(|label| *label != 0).collect();
    let mut largest = Vec::new();
    for first in 0..is_new.len() {
        if !is_new[first] {
            continue;
        }
        let at = [first % dims[0], first / dims[0] % dims[1], first / (dims[0] * dims[1])];
        is_new[first] = false;
        let mut part = vec![at];
        let mut done = 0;
        while done < part.len() {
            let at = part[done];
            done += 1;
            for axis in 0..3 {
                for step in [usize::MAX, 1] {
                    let mut near = at;
                    near[axis] = at[axis].wrapping_add(step);
                    if near[axis] < dims[axis] && std::mem::take(&mut is_new[index(near)]) {
                        part.push(near);
                    }
                }
            }
        }
        if part.len() > largest.len() {
            largest = part;
        }
    }
    largest
}
