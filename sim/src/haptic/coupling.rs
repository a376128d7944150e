//! The virtual coupling: a spring and a damper between a haptic device and a tool.

use nalgebra::{Matrix3, Vector3};

/// F = K (x_d − x_t) + B (v_d − v_t): what pulls the tool to the device, and the device back.
///
/// A device that is sampled every T seconds and has damping b of its own, held against a spring K
/// and damper B that are computed, stays passive (no hand can make it oscillate) if and only if
///
/// b > K T/2 + |B|.
/// # Source
/// Colgate, Schenkel, Passivity of a class of sampled-data systems: application to haptic
/// interfaces, J. Robotic Systems 14(1), 1997; the coupling: Colgate, Stanley, Brown, Issues in the
/// haptic display of tool use, IROS 1995.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VirtualCoupling {
    /// K ≥ 0, N/m.
    pub stiffness_n_m: f64,
    /// B, N s/m.
    pub damping_n_s_m: f64,
}

/// The force that a tool exerts on the body near its last position: F(x) = F₀ + S (x − x₀).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceModel {
    /// x₀, m.
    pub position: Vector3<f64>,
    /// F₀, N.
    pub force: Vector3<f64>,
    /// S, N/m, symmetric positive semi-definite: the inverse of the compliance at the tool.
    pub stiffness: Matrix3<f64>,
    /// Whether it can only push: F then never points against F₀.
    pub is_unilateral: bool,
}

impl VirtualCoupling {
    /// K T/2 + |B|: a device is passive if its own damping is larger, N s/m.
    pub fn damping_limit(&self, period_s: f64) -> f64 {
        0.5 * self.stiffness_n_m * period_s + self.damping_n_s_m.abs()
    }

    /// Whether a device of damping `device_n_s_m`, sampled every `period_s`, is passive with it.
    pub fn is_passive(&self, device_n_s_m: f64, period_s: f64) -> bool {
        device_n_s_m > self.damping_limit(period_s)
    }

    /// 2 (b − |B|)/T: the stiffness that stays below the limit for a device of damping b, N/m; 0 if
    /// the damper alone is above it.
    pub fn stiffest(&self, device_n_s_m: f64, period_s: f64) -> f64 {
        (2.0 * (device_n_s_m - self.damping_n_s_m.abs()) / period_s).max(0.0)
    }

    /// Where the tool, which has no mass, is one period after it was at `before`: where the
    /// coupling's force equals that of the body, a system with the matrix (K + B/T) I + S. Returns
    /// the position, m, and that force, N.
    ///
    /// `device`: position now and before, m. At rest and without contact, the tool is where the
    /// device is.
    pub fn tool(
        &self,
        device: &Vector3<f64>,
        device_before: &Vector3<f64>,
        before: &Vector3<f64>,
        period_s: f64,
        met: &ForceModel,
    ) -> (Vector3<f64>, Vector3<f64>) {
        let (k, rate) = (self.stiffness_n_m, self.damping_n_s_m / period_s);
        let pull = device * k + (device - device_before + before) * rate;
        let at = |stiffness: &Matrix3<f64>, force: &Vector3<f64>| {
            let matrix = stiffness + Matrix3::identity() * (k + rate);
            let rhs = pull - force + stiffness * met.position;
            matrix.cholesky().map_or(*device, |factor| factor.solve(&rhs))
        };
        let mut x = at(&met.stiffness, &met.force);
        let mut force = met.force + met.stiffness * (x - met.position);
        if met.is_unilateral && !(force.dot(&met.force) > 0.0) {
            x = at(&Matrix3::zeros(), &Vector3::zeros());
            force = Vector3::zeros();
        }
        (x, force)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COUPLING: VirtualCoupling = VirtualCoupling { stiffness_n_m: 500.0, damping_n_s_m: 0.2 };

    #[test]
    fn the_limit_is_that_of_a_sampled_spring_and_damper() {
        // 500 N/m · 1 ms / 2 + 0.2 N s/m.
        assert!((COUPLING.damping_limit(1e-3) - 0.45).abs() < 1e-15);
        assert!(COUPLING.is_passive(0.451, 1e-3) && !COUPLING.is_passive(0.449, 1e-3));
        assert!((COUPLING.stiffest(0.45, 1e-3) - 500.0).abs() < 1e-9);
        assert_eq!(COUPLING.stiffest(0.1, 1e-3), 0.0);
        // A negative damper needs as much damping as a positive one.
        let driven = VirtualCoupling { damping_n_s_m: -0.2, ..COUPLING };
        assert!((driven.damping_limit(1e-3) - 0.45).abs() < 1e-15);
    }

    /// A hand's worth of mass on a sampled spring: swings die out within the limit, grow far
    /// beyond.
    #[test]
    fn a_device_within_the_limit_comes_to_rest_and_one_far_beyond_does_not() {
        let swing = |stiffness: f64, device_damping: f64| {
            let (mass, period, fine) = (0.05, 1e-3, 1e-6);
            let (mut x, mut v) = (0.01_f64, 0.0_f64);
            for _ in 0..4000 {
                let force = -stiffness * x;
                for _ in 0..(period / fine) as usize {
                    v += fine * (force - device_damping * v) / mass;
                    x += fine * v;
                }
            }
            (x * x + v * v * mass / stiffness).sqrt()
        };
        let coupling = VirtualCoupling { stiffness_n_m: 500.0, damping_n_s_m: 0.0 };
        let limit = coupling.damping_limit(1e-3);
        // Sampling takes K T/2 off the damping: exp(−(b − K T/2) t/2m) of 1 cm after 4 s.
        assert!(swing(500.0, 2.0 * limit) < 1e-5);
        assert!(swing(500.0, 0.2 * limit) > 0.02);
    }

    #[test]
    fn the_tool_lies_between_the_device_and_what_it_meets() {
        let met = ForceModel {
            position: Vector3::zeros(),
            force: Vector3::new(0.5, 0.0, 0.0),
            stiffness: Matrix3::from_diagonal(&Vector3::new(1500.0, 0.0, 0.0)),
            is_unilateral: true,
        };
        let spring = VirtualCoupling { stiffness_n_m: 500.0, damping_n_s_m: 0.0 };
        let device = Vector3::new(0.005, 0.002, 0.0);
        let (x, force) = spring.tool(&device, &device, &Vector3::zeros(), 1e-3, &met);
        // 500 (0.005 − x) = 0.5 + 1500 x.
        assert!((x - Vector3::new(0.001, 0.002, 0.0)).norm() < 1e-15, "{x}");
        assert!((force - (device - x) * 500.0).norm() < 1e-12);
        // Drawn back it lets go and follows.
        let away = Vector3::new(-0.01, 0.0, 0.0);
        let (x, force) = spring.tool(&away, &away, &Vector3::zeros(), 1e-3, &met);
        assert_eq!(force, Vector3::zeros());
        assert!((x - away).norm() < 1e-15);
    }
}
