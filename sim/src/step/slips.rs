//! What splits and merges move of the material that tools press or hold, and the work of bringing it back.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use yawara_corot::Sphere;

use super::checkpoint::{KeptMean, KeptPoint};
use super::contact::ContactState;
use crate::body::BodyState;
use crate::tools::Tool;

/// Points this fraction of the radius outside a probe may be pressed once the mesh is another.
const NEAR: f64 = 0.1;

/// A force and a torque, N and N m, or a move and a turn, m and rad.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pair {
    pub along: Vector3<f64>,
    pub about: Vector3<f64>,
}

/// Where material is that tools press or hold, m.
#[derive(Default)]
pub(super) struct Places {
    /// Points of the surface by tool and number.
    points: BTreeMap<(usize, usize), Vector3<f64>>,
    /// The mean of what each grip without springs holds.
    means: Vec<(usize, Pair)>,
}

/// What has moved of it while all vertices stayed where they were.
#[derive(Default)]
pub(super) struct Slips {
    /// By tool and number by how much, m, and with what force it was pressed, N.
    points: BTreeMap<(usize, usize), (Vector3<f64>, Vector3<f64>)>,
    /// By tool by how much, and where the mean was, m.
    means: Vec<(usize, Pair, Vector3<f64>)>,
}

impl Places {
    /// Those near probes and in grips at time `t`.
    pub fn new(state: &BodyState, tools: &[Box<dyn Tool>], t: f64) -> Self {
        let mut places = Self::default();
        for (number, tool) in tools.iter().enumerate() {
            let (Some(skin), Some(sphere)) = (tool.surface_points(), tool.obstacle(t)) else {
                continue;
            };
            let Sphere { centre, radius } = sphere;
            let reach = (1.0 + NEAR) * radius;
            skin.each_near(&state.positions, &centre, reach, |i, point| {
                let x = point.position(&state.positions);
                if (x - centre).norm() <= reach {
                    places.points.insert((number, i), x);
                }
            });
        }
        for (grip, tool) in state.body.grips().iter().zip(&state.grip_tools) {
            if let (Some(tool), None) = (tool, grip.stiffness()) {
                let (along, about) = grip.placement(&state.positions);
                places.means.push((*tool, Pair { along, about }));
            }
        }
        places
    }

    /// How far it is from there to where the same material is `now`.
    pub fn slips(
        &self,
        now: &Self,
        state: &BodyState,
        contact: &ContactState,
        tools: &[Box<dyn Tool>],
    ) -> Slips {
        let mut slips = Slips::default();
        let forces: BTreeMap<_, _> = contact.pushes().collect();
        for (key, from) in &self.points {
            let point = tools[key.0].surface_points().and_then(|skin| skin.point(key.1));
            let Some(point) = point else { continue };
            let moved = point.position(&state.positions) - from;
            let force = forces.get(key).copied().unwrap_or_default();
            slips.points.insert(*key, (moved, force));
        }
        for ((tool, from), (_, to)) in self.means.iter().zip(&now.means) {
            let moved = Pair { along: to.along - from.along, about: to.about - from.about };
            slips.means.push((*tool, moved, from.along));
        }
        slips
    }
}

impl Slips {
    /// All of them: points and means.
    pub fn kept(&self) -> (Vec<KeptPoint>, Vec<KeptMean>) {
        let points = self.points.iter().map(|(key, (a, b))| (*key, [(*a).into(), (*b).into()]));
        let mean = |(tool, pair, at): &(usize, Pair, Vector3<f64>)| {
            (*tool, [pair.along.into(), pair.about.into()], (*at).into())
        };
        (points.collect(), self.means.iter().map(mean).collect())
    }

    /// Drops the points.
    pub fn forget_points(&mut self) {
        self.points.clear();
    }

    /// Of what was kept.
    pub fn resumed(points: &[KeptPoint], means: &[KeptMean]) -> Self {
        let points = points.iter().map(|(key, [a, b])| (*key, ((*a).into(), (*b).into())));
        let mean = |(tool, [along, about], at): &KeptMean| {
            (*tool, Pair { along: (*along).into(), about: (*about).into() }, (*at).into())
        };
        Self { points: points.collect(), means: means.iter().map(mean).collect() }
    }

    /// −½ (f₀ + f₁)·δ and −½ (τ₀ + τ₁)·θ of each, J: the work of what has brought it back in a step that
    /// has come to `contact`. `forces` gives the forces of a tool when the step began and now, with torques
    /// about a point.
    pub fn works(
        &self,
        contact: &ContactState,
        forces: impl Fn(usize, &Vector3<f64>) -> [Pair; 2],
    ) -> Vec<f64> {
        let now: BTreeMap<_, _> = contact.pushes().collect();
        let mut works = Vec::new();
        for (key, (moved, before)) in &self.points {
            let force = now.get(key).copied().unwrap_or_default();
            works.push(-0.5 * (before + force).dot(moved));
        }
        for (tool, moved, mean) in &self.means {
            let [before, now] = forces(*tool, mean);
            let along = (before.along + now.along).dot(&moved.along);
            works.push(-0.5 * (along + (before.about + now.about).dot(&moved.about)));
        }
        works
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_that_has_slipped_is_brought_back_by_forces_and_torques() {
        let moved =
            Pair { along: Vector3::new(0.25, 0.0, 0.0), about: Vector3::new(0.0, 0.5, 0.0) };
        let slips = Slips { means: vec![(1, moved, Vector3::z())], ..Slips::default() };
        let forces = |tool: usize, point: &Vector3<f64>| {
            assert_eq!((tool, *point), (1, Vector3::z()));
            let pair = |force: f64, torque: f64| Pair {
                along: Vector3::new(-force, 7.0, 0.0),
                about: Vector3::new(7.0, torque, 0.0),
            };
            [pair(2.0, 1.0), pair(4.0, 2.0)]
        };
        // ½ (2 + 4) N · ¼ m against the slip, ½ (1 + 2) N m · ½ with it.
        assert_eq!(slips.works(&ContactState::default(), forces), [0.0]);
        let forces = |_: usize, _: &Vector3<f64>| {
            [Pair::default(), Pair { along: -Vector3::x(), ..Pair::default() }]
        };
        assert_eq!(slips.works(&ContactState::default(), forces), [0.125]);
    }
}
