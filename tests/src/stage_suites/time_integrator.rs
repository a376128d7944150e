//! What an integrator must do, whatever its formula.

use nalgebra::Vector3;
use yawara_corot::{TimeStep, VertexMotion, integrator_by_name};

use super::order::order;

/// A scene name and the order that the integrator claims.
type Claim<'a> = (&'a str, f64);

fn start() -> VertexMotion {
    VertexMotion {
        position: Vector3::new(0.2, -0.1, 0.4),
        velocity: Vector3::new(1.0, 3.0, -2.0),
        acceleration: Vector3::zeros(),
    }
}

/// Where a unit mass on a spring of ω² N/m, pulled by g and damped by α, is after 1 s of steps of
/// h: each solves c (x' − x̃) + ω² x' = g.
fn after_a_second(name: &str, h: f64, alpha: f64, omega: f64, g: f64) -> f64 {
    let (integrator, step) =
        (integrator_by_name(name).unwrap(), TimeStep { length_s: h, damping_mass_per_s: alpha });
    let c = integrator.mass_per_s2(&step).unwrap();
    let at = |x, v| VertexMotion {
        position: Vector3::x() * x,
        velocity: Vector3::x() * v,
        acceleration: Vector3::x() * (g - alpha * v - omega * omega * x),
    };
    let mut motion = at(1.0, 0.0);
    for _ in 0..(1.0 / h).round() as usize {
        if !integrator.uses_accelerations() {
            motion.acceleration = Vector3::zeros();
        }
        let ahead = integrator.predict(&step, &motion);
        let end = (c * ahead + Vector3::x() * g) / (c + omega * omega);
        motion = integrator.finish(&step, &motion, end);
    }
    motion.position.x
}

fn assert_order((_, claimed): Claim<'_>, exact: f64, end: impl Fn(f64) -> f64) {
    let steps = [0.02, 0.01, 0.005];
    let errors = steps.map(|h| (end(h) - exact).abs());
    // 200 steps, each with the rounding of some terms.
    let slope = order(&steps, &errors, 1e4 * f64::EPSILON);
    // The next term of the error is h times as large: some per cent of the slope.
    assert!(slope > claimed - 0.1, "errors {errors:?}, order {slope}, claimed {claimed}");
}

/// Nothing pulls: x̃ = x + h v, v stays and there is no acceleration.
pub fn uniform_motion_stays_uniform((name, _): Claim<'_>) {
    let (step, start) = (TimeStep { length_s: 0.03, damping_mass_per_s: 0.0 }, start());
    let ahead = integrator_by_name(name).unwrap().predict(&step, &start);
    let end = integrator_by_name(name).unwrap().finish(&step, &start, ahead);
    let rounding = 8.0 * f64::EPSILON * (start.position.norm() + 0.03 * start.velocity.norm());
    assert!((ahead - start.position - 0.03 * start.velocity).norm() <= rounding);
    assert!((end.velocity - start.velocity).norm() <= rounding / 0.03);
    assert!(end.acceleration.norm() <= rounding / 0.03_f64.powi(2));
}

/// x = 1 + g t²/2.
pub fn constant_acceleration_is_followed(claim: Claim<'_>) {
    assert_order(claim, 1.0 + 0.5 * 9.81, |h| after_a_second(claim.0, h, 0.0, 0.0, 9.81));
}

/// x = e^{−αt/2} (cos νt + α/(2ν) sin νt), ν² = ω² − α²/4.
pub fn a_damped_oscillator_is_followed(claim: Claim<'_>) {
    let (alpha, omega) = (0.5_f64, 2.0_f64);
    let nu = (omega * omega - 0.25 * alpha * alpha).sqrt();
    let exact = (-0.5 * alpha).exp() * (nu.cos() + 0.5 * alpha / nu * nu.sin());
    assert_order(claim, exact, |h| after_a_second(claim.0, h, alpha, omega, 0.0));
}

/// a' + α v' = c (x' − x̃): nothing at x̃, and what its c says elsewhere.
pub fn inertia_and_damping_vanish_at_the_prediction((name, _): Claim<'_>) {
    let (step, start) = (TimeStep { length_s: 0.03, damping_mass_per_s: 5.0 }, start());
    let integrator = integrator_by_name(name).unwrap();
    let c = integrator.mass_per_s2(&step).unwrap();
    let ahead = integrator.predict(&step, &start);
    for off in [Vector3::zeros(), Vector3::new(0.1, 0.0, -0.3)] {
        let end = integrator.finish(&step, &start, ahead + off);
        let force = end.acceleration + 5.0 * end.velocity;
        let rounding = 16.0 * f64::EPSILON * c * (start.position + off).norm();
        assert!((force - c * off).norm() <= rounding, "{force}, want {}", c * off);
    }
}

/// No inertia; what is left alone stays, and nothing has a velocity.
pub fn without_inertia_nothing_moves(name: &str) {
    let (step, start) = (TimeStep { length_s: 0.03, damping_mass_per_s: 5.0 }, start());
    let integrator = integrator_by_name(name).unwrap();
    assert_eq!(integrator.mass_per_s2(&step), None);
    assert_eq!(integrator.predict(&step, &start), start.position);
    let end = integrator.finish(&step, &start, Vector3::x());
    assert_eq!((end.position, end.velocity), (Vector3::x(), Vector3::zeros()));
    assert_eq!(end.acceleration, Vector3::zeros());
}
