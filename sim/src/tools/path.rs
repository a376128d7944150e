//! Where a tool goes: keys over time, linear in between.

use nalgebra::Vector3;

use crate::body::ScannerAxes;
use crate::error::SimError;
use crate::scene::Key;
use crate::scene::checks::FARTHEST_M;

use super::path_csv;

/// How far a tool is from where it started.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// Displacement in scanner axes (right, anterior, superior), m.
    pub move_m: [f64; 3],
    /// Turn about the tool's axis, degrees.
    pub turn_deg: f64,
}

impl Pose {
    /// Refuses a pose of a tool that is not finite, or out of reach.
    pub(crate) fn check(&self, tool: usize) -> Result<(), SimError> {
        let far = self.move_m.iter().find(|x| !(x.abs() <= FARTHEST_M));
        if let Some(&value) = far {
            return Err(SimError::Pose { tool, value, want: "at most 1000 m in each axis" });
        }
        match self.turn_deg.is_finite() {
            true => Ok(()),
            false => Err(SimError::Pose { tool, value: self.turn_deg, want: "a finite turn" }),
        }
    }
}

/// A path in scanner axes, which solver axes read.
pub struct ToolPath {
    keys: Vec<Key>,
    axes: ScannerAxes,
}

impl ToolPath {
    /// Through `keys` of ascending times.
    pub fn new(keys: Vec<Key>, axes: ScannerAxes) -> Self {
        Self { keys, axes }
    }

    /// Through a scene's keys, or those of a file in their place.
    pub(crate) fn read(
        keys: &[Key],
        csv: Option<&std::path::Path>,
        axes: ScannerAxes,
    ) -> Result<Self, SimError> {
        let keys = csv.map_or_else(|| Ok(keys.to_vec()), path_csv::read)?;
        Ok(Self::new(keys, axes))
    }

    /// The pose at time `t`: linear between keys, held at both ends.
    pub fn pose(&self, t: f64) -> Pose {
        let Some((a, b, s)) = around(&self.keys, |key| key.time_s, t) else {
            return Pose::default();
        };
        let (move_a, move_b) = (Vector3::from(a.move_m), Vector3::from(b.move_m));
        let turn_deg = a.turn_deg + s * (b.turn_deg - a.turn_deg);
        Pose { move_m: move_a.lerp(&move_b, s).into(), turn_deg }
    }

    /// How far from its start it goes, m.
    pub(crate) fn reach_m(&self) -> f64 {
        let length = |key: &Key| Vector3::from(key.move_m).norm();
        self.keys.iter().map(length).fold(0.0, f64::max)
    }

    /// How far it turns from its start, degrees.
    pub(crate) fn turns_deg(&self) -> f64 {
        self.keys.iter().map(|key| key.turn_deg.abs()).fold(0.0, f64::max)
    }

    /// Displacement (solver axes, m) and turn (rad) at time `t`.
    pub fn motion(&self, t: f64) -> (Vector3<f64>, f64) {
        let Pose { move_m, turn_deg } = self.pose(t);
        (self.axes.to_solver_direction(&Vector3::from(move_m)), turn_deg.to_radians())
    }

    /// Goes on from its last key straight to `pose` at `to_s`, and stays there. A key at or after `to_s`
    /// is replaced.
    pub fn extend(&mut self, to_s: f64, pose: Pose) {
        self.keys.retain(|key| key.time_s < to_s);
        self.keys.push(Key { time_s: to_s, move_m: pose.move_m, turn_deg: pose.turn_deg });
    }

    /// Where it goes, ascending times.
    pub fn keys(&self) -> &[Key] {
        &self.keys
    }

    /// Replaces the path: from where it is at `from_s` straight to `pose` at `to_s`, and stays there.
    pub fn lead(&mut self, from_s: f64, to_s: f64, pose: Pose) {
        let now = self.pose(from_s);
        let key = |time_s, Pose { move_m, turn_deg }: Pose| Key { time_s, move_m, turn_deg };
        self.keys.clear();
        self.keys.extend([key(from_s, now), key(to_s, pose)]);
    }
}

/// The keys before and after time `t`, and which part of the time between them is over; beyond the
/// ends the last one twice. None without keys.
pub(super) fn around<K>(keys: &[K], time_s: impl Fn(&K) -> f64, t: f64) -> Option<(&K, &K, f64)> {
    let after = keys.partition_point(|key| time_s(key) <= t);
    match (after.checked_sub(1).map(|i| &keys[i]), keys.get(after)) {
        (Some(a), Some(b)) => Some((a, b, (t - time_s(a)) / (time_s(b) - time_s(a)))),
        (Some(key), None) | (None, Some(key)) => Some((key, key, 0.0)),
        (None, None) => None,
    }
}

/// The part of a time in which a tool acts, s.
pub(super) fn way(
    begin_s: Option<f64>,
    release_s: Option<f64>,
    from: f64,
    to: f64,
) -> Option<[f64; 2]> {
    let release = release_s.unwrap_or(f64::INFINITY);
    let way = [from.max(begin_s.unwrap_or(0.0)), to.min(release)];
    (way[0] <= way[1] && from < release).then_some(way)
}

/// Whether a tool that comes at `begin_s` and is taken away at `release_s` acts at `t`.
pub(super) fn acts(begin_s: Option<f64>, release_s: Option<f64>, t: f64) -> bool {
    // Up to rounding of the time: a step that ends at the release still holds, one that ends at the
    // beginning does not yet.
    begin_s.is_none_or(|begin| t > begin * (1.0 + 1e-12))
        && release_s.is_none_or(|release| t <= release * (1.0 + 1e-12))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_linear_between_its_keys_and_follows_its_leader() {
        let key = |time_s, x, turn_deg| Key { time_s, move_m: [x, 0.0, 0.0], turn_deg };
        let keys = [key(1.0, 0.0, 0.0), key(3.0, 4.0, 10.0)];
        let mut path = ToolPath::new(keys.to_vec(), ScannerAxes::identity());
        assert_eq!(path.pose(0.0), Pose::default());
        assert_eq!(path.pose(2.5), Pose { move_m: [3.0, 0.0, 0.0], turn_deg: 7.5 });
        assert_eq!(path.pose(9.0).move_m[0], 4.0);
        path.extend(4.0, Pose { move_m: [0.0; 3], turn_deg: 0.0 });
        assert_eq!(path.pose(3.5), Pose { move_m: [2.0, 0.0, 0.0], turn_deg: 5.0 });
        path.extend(4.0, Pose { move_m: [8.0, 0.0, 0.0], turn_deg: 10.0 });
        assert_eq!((path.keys().len(), path.pose(3.5).move_m[0]), (3, 6.0));
        path.lead(2.0, 2.5, Pose { move_m: [2.0, 1.0, 0.0], turn_deg: 0.0 });
        assert_eq!(path.pose(2.25), Pose { move_m: [2.0, 0.5, 0.0], turn_deg: 2.5 });
        assert_eq!(path.pose(8.0).move_m, [2.0, 1.0, 0.0]);
    }

    #[test]
    fn a_tool_acts_after_its_beginning_up_to_its_release() {
        let at = |t| acts(Some(0.3), Some(0.5), t);
        // 0.1 + 0.2 is a little more than 0.3.
        assert_eq!(
            [0.0, 0.3, 0.1 + 0.2, 0.4, 0.5, 0.6].map(at),
            [false, false, false, true, true, false]
        );
        assert!(acts(None, None, 0.0));
    }
}
