//! What forces must be, whatever the co-rotation.

use nalgebra::{Matrix3, Rotation3, SVector, Vector3};
use yawara_corot::{Body, LAWS, forces_by_name};

use super::block::{Positions, block, block_under, forces, moved, norm, rounding, waves};
use super::order::order;

/// K u of linear elasticity, element by element.
fn linear_forces(body: &Body, u: &[Vector3<f64>]) -> Positions {
    let mut forces = vec![Vector3::zeros(); u.len()];
    for e in body.elements() {
        let corners = SVector::<f64, 12>::from_fn(|i, _| u[e.vertices[i / 3]][i % 3]);
        let f = e.geometry.stiffness(&e.elasticity) * corners;
        (0..4).for_each(|i| forces[e.vertices[i]] += f.fixed_rows::<3>(3 * i));
    }
    forces
}

fn assert_no_force(name: &str, place: impl Fn(&Vector3<f64>) -> Vector3<f64>) {
    let (stage, (mut body, rest)) = (forces_by_name(name).unwrap(), block(Body::new()));
    let x: Positions = rest.iter().map(place).collect();
    let (got, bar) = (norm(&forces(&*stage, &mut body, &x)), rounding(&*stage, &body, &x));
    assert!(got <= bar, "{got:e} N, want at most {bar:e} N");
}

/// f(X) = 0.
pub fn at_rest_there_is_no_force(name: &str) {
    assert_no_force(name, |x| *x);
}

/// f(X + t) = 0.
pub fn a_translation_gives_no_force(name: &str) {
    assert_no_force(name, |x| x + Vector3::new(0.3, -0.2, 0.1));
}

/// f(Q X) = 0.
pub fn a_rotation_gives_no_force(name: &str) {
    let turn = Rotation3::from_scaled_axis(Vector3::new(1.9, 0.8, -1.4));
    assert_no_force(name, |x| turn * x);
}

/// Σ f = 0, however the body is deformed.
pub fn forces_balance(name: &str) {
    let (stage, (mut body, rest)) = (forces_by_name(name).unwrap(), block(Body::new()));
    let x = moved(&rest, 0.3, &waves(rest.len()));
    let net = forces(&*stage, &mut body, &x).iter().sum::<Vector3<f64>>().norm();
    let bar = rounding(&*stage, &body, &x);
    assert!(net <= bar, "{net:e} N, want at most {bar:e} N");
}

/// f(S X) = K (S − I) X for a symmetric stretch S: nothing turns.
pub fn a_stretch_gives_the_linear_force(name: &str) {
    let (stage, (mut body, rest)) = (forces_by_name(name).unwrap(), block(Body::new()));
    let change = Matrix3::new(0.1, 0.03, -0.02, 0.03, -0.08, 0.05, -0.02, 0.05, 0.06);
    let u: Positions = rest.iter().map(|x| change * x).collect();
    let x = moved(&rest, 1.0, &u);
    let off = moved(&forces(&*stage, &mut body, &x), -1.0, &linear_forces(&body, &u));
    assert!(norm(&off) <= rounding(&*stage, &body, &x), "{:e} N", norm(&off));
}

/// f(X + s d) = s K d + O(s²).
pub fn small_displacements_give_the_linear_force(name: &str) {
    let (stage, (mut body, rest)) = (forces_by_name(name).unwrap(), block(Body::new()));
    let d = waves(rest.len());
    let linear = linear_forces(&body, &d);
    let sizes = [4e-3, 2e-3, 1e-3];
    let errors = sizes.map(|s| {
        let got = forces(&*stage, &mut body, &moved(&rest, s, &d));
        norm(&moved(&got, -s, &linear))
    });
    let slope = order(&sizes, &errors, rounding(&*stage, &body, &rest));
    assert!(slope > 1.9, "errors {errors:?}, order {slope}");
}

/// Crushed to a plane, a line, a point, or turned inside out: forces are numbers.
pub fn flat_and_inverted_elements_give_finite_forces(name: &str) {
    let (stage, (mut body, rest)) = (forces_by_name(name).unwrap(), block(Body::new()));
    for scale in [[1.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0; 3], [1.0, 1.0, -1.0], [-1.0; 3]] {
        let x: Positions = rest.iter().map(|x| x.component_mul(&Vector3::from(scale))).collect();
        let got = norm(&forces(&*stage, &mut body, &x));
        assert!(got.is_finite(), "{got} at {scale:?}");
    }
}

/// ∂f/∂x d by central differences under every law: with steps of ∛ε the error is of order ε^⅔.
pub fn the_tangent_is_the_derivative(name: &str) {
    let stage = forces_by_name(name).unwrap();
    let Some(tangent) = stage.tangent() else { return };
    for law in LAWS {
        let (mut body, rest) = block_under(law, Body::new());
        let (n, step) = (rest.len(), f64::EPSILON.cbrt());
        let x = moved(&rest, 0.2, &waves(n));
        forces(&*stage, &mut body, &moved(&rest, 0.1, &waves(n)));
        body.commit();
        let d: Positions = waves(n).iter().map(|d| d.zxy()).collect();
        let [up, down] = [step, -step].map(|s| forces(&*stage, &mut body, &moved(&x, s, &d)));
        let want: Positions = up.iter().zip(&down).map(|(u, d)| (u - d) / (2.0 * step)).collect();
        forces(&*stage, &mut body, &x);
        let mut got = vec![Vector3::zeros(); n];
        for (number, e) in body.elements().iter().enumerate() {
            let f = tangent(&body, number, &x)
                * SVector::<f64, 12>::from_fn(|i, _| d[e.vertices[i / 3]][i % 3]);
            (0..4).for_each(|i| got[e.vertices[i]] += f.fixed_rows::<3>(3 * i));
        }
        let off = norm(&moved(&got, -1.0, &want)) / norm(&want);
        assert!(off <= 1e3 * step * step, "{law}: off by {off:e}");
    }
}
