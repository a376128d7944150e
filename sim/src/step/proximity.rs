//! Where a probe is about to touch, and how fine the mesh is to be there beforehand.

use nalgebra::Vector3;
use yawara_corot::Sphere;
use yawara_mesh::Tet;

use crate::body::BodyState;
use crate::scene::NearProbe;
use crate::tools::{Blade, Tool};

/// What is near to a probe.
pub(crate) struct Proximity {
    /// The least level of a tetrahedron there.
    level: u8,
    /// The balls of all probes, larger by how far they see.
    balls: Vec<Sphere>,
    /// What is about to cut.
    blade: Option<Blade>,
}

impl Proximity {
    /// Of the probes at time `t`, s; none without a rule or where nothing can touch.
    pub fn of(rule: Option<&NearProbe>, tools: &[Box<dyn Tool>], t: f64) -> Option<Self> {
        let NearProbe { level, within_m } = rule?;
        let wider = |ball: Sphere| Sphere { radius: ball.radius + within_m, ..ball };
        let balls: Vec<Sphere> =
            tools.iter().filter_map(|tool| tool.obstacle(t)).map(wider).collect();
        (!balls.is_empty()).then_some(Self { level: *level, balls, blade: None })
    }

    /// Of a blade that is about to cut.
    pub fn of_blade(level: u8, blade: Blade) -> Self {
        Self { level, balls: Vec::new(), blade: Some(blade) }
    }

    /// Whether a tetrahedron is to be bisected, or if there were one such, not to be made again. It is the same question for
    /// both, so that nothing comes in that goes out at once.
    pub fn wants_finer(&self, tet: &Tet, state: &BodyState) -> bool {
        tet.level < self.level && {
            let corners = tet.vertices.map(|v| state.positions[v.index()]);
            let [first, others @ ..] = corners;
            let low = others.iter().fold(first, |low, x| low.inf(x));
            let high = others.iter().fold(first, |high, x| high.sup(x));
            let is_met = |blade: &Blade| blade.meets(&corners, [&low, &high]);
            self.balls.iter().any(|ball| touches(ball, &low, &high))
                || self.blade.as_ref().is_some_and(is_met)
        }
    }
}

/// Whether a ball and a box have a point in common.
fn touches(ball: &Sphere, low: &Vector3<f64>, high: &Vector3<f64>) -> bool {
    let nearest = ball.centre.sup(low).inf(high);
    (nearest - ball.centre).norm_squared() <= ball.radius * ball.radius
}

/// How far a point is from a segment, m.
pub(super) fn distance(x: &Vector3<f64>, from: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
    let along = to - from;
    let length2 = along.norm_squared();
    let part = if length2 > 0.0 { (x - from).dot(&along) / length2 } else { 0.0 };
    (x - from - along * part.clamp(0.0, 1.0)).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ball_touches_a_box_at_a_side_an_edge_and_a_corner_and_from_inside() {
        let [low, high] = [Vector3::zeros(), Vector3::new(1.0, 2.0, 3.0)];
        let ball = |x, y, z| Sphere { centre: Vector3::new(x, y, z), radius: 0.5 };
        assert!(touches(&ball(0.5, 1.0, 1.5), &low, &high));
        assert!(touches(&ball(-0.49, 1.0, 1.0), &low, &high));
        assert!(!touches(&ball(-0.51, 1.0, 1.0), &low, &high));
        // From an edge (.3, .4), from a corner (.2, .3, .3).
        assert!(touches(&ball(-0.29, 2.4, 1.0), &low, &high));
        assert!(!touches(&ball(-0.31, 2.4, 1.0), &low, &high));
        assert!(touches(&ball(1.2, 2.3, 3.3), &low, &high));
        assert!(!touches(&ball(1.3, 2.3, 3.3), &low, &high));
    }
}
