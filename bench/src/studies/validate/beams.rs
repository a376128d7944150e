//! Patch test, Timoshenko's cantilever, Saint-Venant's torsion, the elastica.

use nalgebra::{Matrix3, Vector3};
use yawara_corot::{ElementCorotation, equilibrium_by_name};
use yawara_embed::isotropic;

use super::figure::{Row, solve, solve_linear};
use crate::bodies::{Solid, Statics};
use crate::error::Result;

/// Coordinates are products of few rounded numbers.
fn near(x: f64, to: f64) -> bool {
    (x - to).abs() < 1e-9
}

/// The vertices at a distance from the held end.
fn section(solid: &Solid, at: f64) -> impl Iterator<Item = usize> + Clone {
    (0..solid.points.len()).filter(move |&v| near(solid.points[v].x, at))
}

fn mean(values: impl Iterator<Item = f64> + Clone) -> f64 {
    values.clone().sum::<f64>() / values.count() as f64
}

/// A linear field on the boundary is one inside, whatever the mesh: inner vertices are shifted by
/// up to a tenth of an edge.
pub(super) fn patch() -> Result<Vec<Row>> {
    let field = Matrix3::new(0.3, -0.2, 0.1, 0.5, 0.2, -0.4, 0.1, 0.6, -0.1) * 1e-2;
    let mut rows = Vec::new();
    for (n, poisson_ratio) in [(3, 0.3), (6, 0.3), (6, 0.49)] {
        let mut solid = Solid::block([n; 3], [1.0; 3], isotropic(1e4, poisson_ratio));
        let inside = |x: &Vector3<f64>| x.iter().all(|&c| c > 1e-9 && c < 1.0 - 1e-9);
        for x in solid.points.iter_mut().filter(|x| inside(x)) {
            *x += Vector3::new((31.0 * x.y).sin(), (47.0 * x.z).sin(), (29.0 * x.x).sin()) * 0.1
                / n as f64;
        }
        let mut statics = Statics::new(&solid, |x| !inside(x))?;
        for v in (0..solid.points.len()).filter(|&v| !statics.free[v]) {
            statics.positions[v] += field * solid.points[v];
        }
        solve_linear("patch", &mut statics, &vec![Vector3::zeros(); solid.points.len()])?;
        let error = (0..solid.points.len())
            .map(|v| (statics.displacement(v) - field * solid.points[v]).norm())
            .fold(0.0, f64::max);
        let quantity = format!("largest error of u at ν {poisson_ratio} (m)");
        rows.push(Row::of_zero("patch", (n, &solid), quantity, error, field.norm()));
    }
    Ok(rows)
}

/// 5 × 1 × 1 m, ν = 0 so that the clamp strains nothing, a shear force on the end face:
/// w = P L³/(3 E I) + P L/(k G A), k = 5/6.
pub(super) fn timoshenko(n: usize) -> Result<Row> {
    let (length, young, force) = (5.0, 1e4, 1.0);
    let solid = Solid::block([5 * n, n, n], [length, 1.0, 1.0], isotropic(young, 0.0));
    let mut statics = Statics::new(&solid, |x| near(x.x, 0.0))?;
    let load = solid.traction(|x| near(x.x, length), |_| Vector3::new(0.0, 0.0, force));
    solve_linear("timoshenko", &mut statics, &load)?;
    let sag = mean(section(&solid, length).map(|v| statics.displacement(v).z));
    let expected =
        force * length.powi(3) / (3.0 * young / 12.0) + force * length / (5.0 / 6.0 * young / 2.0);
    Ok(Row::new("timoshenko", (n, &solid), "tip deflection (m)", sag, expected))
}

/// A bar of 4 × 1 × 1 m turned by tractions on its end: J = T Δx / (G Δφ) between the sections at
/// 1.5 and 2.5 m, far from the ends' warping.
pub(super) fn torsion(n: usize) -> Result<Row> {
    let (length, young, poisson_ratio) = (4.0, 1e4, 0.3);
    let solid = Solid::block([4 * n, n, n], [length, 1.0, 1.0], isotropic(young, poisson_ratio));
    let mut statics = Statics::new(&solid, |x| near(x.x, 0.0))?;
    let arm = |x: &Vector3<f64>| Vector3::new(0.0, x.y - 0.5, x.z - 0.5);
    let load = solid.traction(|x| near(x.x, length), |x| Vector3::x().cross(&arm(x)));
    let torque: f64 = solid.points.iter().zip(&load).map(|(x, f)| arm(x).cross(f).x).sum();
    solve_linear("torsion", &mut statics, &load)?;
    let turn = |at: f64| {
        let section = section(&solid, at);
        // Least squares of u = φ e_x × r over the section.
        let moment = |v: usize| arm(&solid.points[v]).cross(&statics.displacement(v)).x;
        section.clone().map(moment).sum::<f64>()
            / section.map(|v| arm(&solid.points[v]).norm_squared()).sum::<f64>()
    };
    let shear = young / (2.0 * (1.0 + poisson_ratio));
    let computed = torque / (shear * (turn(2.5) - turn(1.5)));
    Ok(Row::new("torsion", (n, &solid), "J (m⁴)", computed, 0.140_577_0))
}

/// P L²/(E I), and deflection and shortening of the tip over the length.
const ELASTICA: [(usize, f64, f64); 4] = [
    (1, 0.301_72, 0.056_43),
    (2, 0.493_46, 0.160_64),
    (5, 0.713_79, 0.387_63),
    (10, 0.810_61, 0.555_00),
];

/// A cantilever twenty times as long as high and wide, one element across, ν = 0, under a dead
/// force at its end. (A narrow one would buckle sideways. The elastica neither shears nor
/// stretches: at this slenderness that is worth 2·10⁻³.)
pub(super) fn elastica(n: usize) -> Result<Vec<Row>> {
    let (length, young) = (20.0, 1e4);
    let solid = Solid::block([20 * n, 1, n], [length, 1.0, 1.0], isotropic(young, 0.0));
    let mut statics = Statics::new(&solid, |x| near(x.x, 0.0))?;
    // Force over the end's area; I over it is 1/12.
    let unit = young / 12.0 / (length * length);
    let mut equilibrium = equilibrium_by_name("fallback")?;
    let mut rows = Vec::new();
    let mut reached = 0;
    for (k, w, u) in ELASTICA {
        for part in reached + 1..=k {
            let traction = Vector3::new(0.0, 0.0, part as f64 * unit);
            let load = solid.traction(|x| near(x.x, length), |_| traction);
            solve("elastica", &mut statics, &ElementCorotation, equilibrium.as_mut(), &load, 1e-9)?;
        }
        reached = k;
        let end = section(&solid, length);
        let moved = |axis: usize| mean(end.clone().map(|v| statics.displacement(v)[axis])) / length;
        let size = (n, &solid);
        rows.push(Row::new("elastica", size, format!("w/L at k = {k:2}"), moved(2), w));
        rows.push(Row::new("elastica", size, format!("u/L at k = {k:2}"), -moved(0), u));
    }
    Ok(rows)
}
