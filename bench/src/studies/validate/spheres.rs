//! Spheres: Lamé's shell under pressure, the coated sphere, Eshelby's inclusion.

use nalgebra::{Matrix3, Matrix6, Vector3};
use yawara_embed::{isotropic, strain_from_gradient};

use super::figure::{Row, solve_linear};
use crate::bodies::{Solid, Statics};
use crate::error::Result;

/// Radii of `layers` layers from `outer` down to `inner`, both included.
fn radii(outer: f64, inner: f64, layers: usize) -> Vec<f64> {
    let at = |i: usize| outer + (inner - outer) * i as f64 / layers as f64;
    (0..=layers).map(at).collect()
}

/// A core of radius ½ in a coat of radius 1, `n` divisions around a quarter.
fn in_a_coat(n: usize, core: Matrix6<f64>, coat: Matrix6<f64>) -> Solid {
    let layers = n / 2;
    let mut all = radii(1.0, 0.5, layers);
    all.extend_from_slice(&radii(0.5, 0.0, layers)[1..]);
    Solid::ball(n, &all, |layer| if layer < layers { coat } else { core })
}

fn on_the_surface(x: &Vector3<f64>) -> bool {
    x.norm() > 1.0 - 1e-9
}

/// Moves the held vertices by `field` of their rest position and solves.
fn solve_with(
    case: &'static str,
    statics: &mut Statics,
    load: &[Vector3<f64>],
    field: impl Fn(&Vector3<f64>) -> Vector3<f64>,
) -> Result<()> {
    for v in (0..statics.rest.len()).filter(|&v| !statics.free[v]) {
        statics.positions[v] = statics.rest[v] + field(&statics.rest[v]);
    }
    solve_linear(case, statics, load)
}

/// Pressure in a shell from ½ to 1 m whose outside is held where Lamé has it:
/// u = p a³/(E (b³ − a³)) ((1 − 2ν) r + (1 + ν) b³/(2 r²)).
pub(super) fn lame(n: usize) -> Result<Row> {
    let (young, poisson_ratio, pressure, inner) = (1e4, 0.3, 100.0, 0.5f64);
    let exact = |r: f64| {
        let a3 = inner.powi(3);
        pressure * a3 / (young * (1.0 - a3))
            * ((1.0 - 2.0 * poisson_ratio) * r + (1.0 + poisson_ratio) / (2.0 * r * r))
    };
    let d = isotropic(young, poisson_ratio);
    let solid = Solid::ball(n, &radii(1.0, inner, n / 2), |_| d);
    let mut statics = Statics::new(&solid, on_the_surface)?;
    let load = solid.traction(|x| x.norm() < 0.75, |x| x.normalize() * pressure);
    solve_with("lame", &mut statics, &load, |x| x * exact(1.0))?;
    let inside: Vec<usize> =
        (0..solid.points.len()).filter(|&v| solid.points[v].norm() < inner + 1e-9).collect();
    let moved = |&v: &usize| statics.displacement(v).dot(&solid.points[v].normalize());
    let computed = inside.iter().map(moved).sum::<f64>() / inside.len() as f64;
    Ok(Row::new("lame", (n, &solid), "u at the inside (m)", computed, exact(inner)))
}

/// E 30 in E 3, both ν .45, pulled evenly: the bulk modulus of the whole by Hashin's assemblage,
/// exact for this one sphere.
pub(super) fn coated(n: usize) -> Result<Row> {
    let solid = in_a_coat(n, isotropic(30.0, 0.45), isotropic(3.0, 0.45));
    let mut statics = Statics::new(&solid, on_the_surface)?;
    let strain = 1e-3;
    let none = vec![Vector3::zeros(); solid.points.len()];
    solve_with("coated", &mut statics, &none, |x| x * strain)?;
    let (mut trace, mut volume) = (0.0, 0.0);
    for element in statics.body.elements() {
        let gradient = element.deformation_gradient(&statics.positions) - Matrix3::identity();
        let stress = element.elasticity * strain_from_gradient(&gradient);
        trace += element.geometry.volume * (stress[0] + stress[1] + stress[2]);
        volume += element.geometry.volume;
    }
    let computed = trace / volume / (9.0 * strain);
    Ok(Row::new("coated", (n, &solid), "bulk modulus (Pa)", computed, 11.42037))
}

/// A sphere ten times as stiff in an endless matrix under a shear at infinity. The matrix is cut at
/// twice the radius, where it is held as Eshelby has it. Inside the strain is β times that at
/// infinity, β = 1/(1 + s(μ₁/μ₀ − 1)), s = 2(4 − 5ν)/(15(1 − ν)); outside
/// u = E x + A ∇(xᵀE x/r⁵) + B (4(1−ν) E x/r³ − ∇(xᵀE x/r³)), A = 3 B a²/5,
/// B = (β − 1) a³/(16/5 − 4ν), which joins both at r = a.
pub(super) fn eshelby(n: usize) -> Result<Row> {
    let (nu, ratio, a, strain) = (0.3, 10.0, 0.5f64, 1e-3);
    let solid = in_a_coat(n, isotropic(ratio * 1e4, nu), isotropic(1e4, nu));
    let mut statics = Statics::new(&solid, on_the_surface)?;
    let s = 2.0 * (4.0 - 5.0 * nu) / (15.0 * (1.0 - nu));
    let beta = 1.0 / (1.0 + s * (ratio - 1.0));
    let b_factor = (beta - 1.0) * a.powi(3) / (3.2 - 4.0 * nu);
    let a_factor = 0.6 * b_factor * a * a;
    let far = Matrix3::new(strain, 0.0, 0.0, 0.0, -strain, 0.0, 0.0, 0.0, 0.0);
    let field = |x: &Vector3<f64>| {
        let (r, ex) = (x.norm(), far * x);
        let q = x.dot(&ex);
        ex + a_factor * (2.0 * ex / r.powi(5) - 5.0 * q * x / r.powi(7))
            + b_factor * ((2.0 - 4.0 * nu) * ex / r.powi(3) + 3.0 * q * x / r.powi(5))
    };
    let none = vec![Vector3::zeros(); solid.points.len()];
    solve_with("eshelby", &mut statics, &none, field)?;
    let (mut sum, mut volume) = (0.0, 0.0);
    for (element, tet) in statics.body.elements().iter().zip(&solid.tets) {
        if tet.iter().all(|&v| solid.points[v].norm() < a + 1e-9) {
            let gradient = element.deformation_gradient(&statics.positions);
            sum += element.geometry.volume * (gradient.m11 - 1.0);
            volume += element.geometry.volume;
        }
    }
    let quantity = "strain inside over that at infinity";
    Ok(Row::new("eshelby", (n, &solid), quantity, sum / volume / strain, beta))
}
