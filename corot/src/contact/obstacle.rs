//! What stands in a body's way.

use nalgebra::{Matrix3, Vector3};

/// A rigid, smooth body that others may touch but not enter. A new shape is a new implementation.
///
/// An obstacle of one's own, a floor:
/// ```
/// use nalgebra::Vector3;
/// use yawara_corot::Obstacle;
///
/// /// All that is below z.
/// struct Floor(f64);
///
/// impl Obstacle for Floor {
///     fn gap(&self, x: &Vector3<f64>) -> (f64, Vector3<f64>) {
///         (x.z - self.0, Vector3::z())
///     }
/// }
///
/// let (gap, normal) = Floor(0.1).gap(&Vector3::new(3.0, 0.0, 0.0));
/// assert_eq!((gap, normal), (-0.1, Vector3::z()));
/// ```
pub trait Obstacle: Send + Sync {
    /// How far `x` is outside (m, negative inside), and the unit normal there, away from it.
    ///
    /// Where no direction is the nearest (the centre of a ball), any unit vector will do.
    fn gap(&self, x: &Vector3<f64>) -> (f64, Vector3<f64>);

    /// The derivative of the normal at `x`, 1/m, symmetric: how much the obstacle curves.
    ///
    /// Zero as it stands here, which is right where all sides are flat; elsewhere solves take more iterations with
    /// it, to the same end.
    fn curvature(&self, x: &Vector3<f64>) -> Matrix3<f64> {
        let _ = x;
        Matrix3::zeros()
    }
}

/// A ball: gap ‖x − c‖ − R, normal n = (x − c)/‖x − c‖, curvature (1 − n nᵀ)/‖x − c‖.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// c, m.
    pub centre: Vector3<f64>,
    /// R > 0, m.
    pub radius: f64,
}

impl Obstacle for Sphere {
    fn gap(&self, x: &Vector3<f64>) -> (f64, Vector3<f64>) {
        let offset = x - self.centre;
        let distance = offset.norm();
        let normal = if distance > 0.0 { offset / distance } else { Vector3::z() };
        (distance - self.radius, normal)
    }

    fn curvature(&self, x: &Vector3<f64>) -> Matrix3<f64> {
        let (gap, normal) = self.gap(x);
        let distance = gap + self.radius;
        if distance > 0.0 {
            (Matrix3::identity() - normal * normal.transpose()) / distance
        } else {
            Matrix3::zeros()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ball_has_a_gap_and_a_normal_everywhere() {
        let ball = Sphere { centre: Vector3::new(1.0, 2.0, 3.0), radius: 0.5 };
        let (gap, normal) = ball.gap(&Vector3::new(1.0, 2.0, 5.0));
        assert_eq!((gap, normal), (1.5, Vector3::z()));
        let (gap, normal) = ball.gap(&Vector3::new(0.75, 2.0, 3.0));
        assert_eq!((gap, normal), (-0.25, -Vector3::x()));
        let (gap, normal) = ball.gap(&ball.centre);
        assert_eq!((gap, normal.norm()), (-0.5, 1.0));
        assert_eq!(ball.curvature(&ball.centre), Matrix3::zeros());
    }

    #[test]
    fn a_ball_s_normal_turns_by_its_curvature() {
        let ball = Sphere { centre: Vector3::new(1.0, 2.0, 3.0), radius: 0.5 };
        for x in [Vector3::new(1.3, 1.8, 2.9), Vector3::new(-4.0, 2.5, 3.2)] {
            let curvature = ball.curvature(&x);
            for axis in 0..3 {
                let aside = Vector3::ith(axis, 1e-5);
                let change = (ball.gap(&(x + aside)).1 - ball.gap(&(x - aside)).1) / 2e-5;
                assert!((curvature.column(axis) - change).norm() < 1e-8 * curvature.norm());
            }
        }
    }
}
