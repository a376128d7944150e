//! What co-rotation must keep: plain stretch at any rotation, and invariance.

use nalgebra::{Matrix3, Matrix6, Rotation3, Vector3, Vector6};
use yawara_corot::{Anderson, ElementCorotation, equilibrium_by_name};
use yawara_embed::isotropic;

use super::figure::{Row, solve};
use crate::bodies::{Solid, Statics};
use crate::error::Result;

/// A block under dead traction s along its axis, turned by some angle: it gets 1 + s/E longer and
/// 1 − ν s/E thinner, exactly, however large s is.
pub(super) fn stretch() -> Result<Vec<Row>> {
    let (young, poisson_ratio, length) = (1e4, 0.3, 2.0);
    let mut rows = Vec::new();
    for (degrees, part) in [(0u32, 0.1f64), (40, 0.3), (170, 0.3), (170, -0.3)] {
        let axis = nalgebra::Unit::new_normalize(Vector3::new(0.3, 1.0, -0.5));
        let turn = Rotation3::from_axis_angle(&axis, f64::from(degrees).to_radians());
        let solid = Solid::block([4, 2, 2], [length, 1.0, 1.0], isotropic(young, poisson_ratio));
        // Three corners of one end: that takes the rigid motions out, and carries no force.
        let corner = |x: &Vector3<f64>| {
            x.x < 1e-9 && x.y + x.z < 1.0 + 1e-9 && [x.y, x.z].iter().all(|c| c * (1.0 - c) < 1e-9)
        };
        let mut statics = Statics::new(&solid, corner)?;
        let (long, thin) = (1.0 + part, 1.0 - poisson_ratio * part);
        let exact = |x: &Vector3<f64>| turn * Vector3::new(long * x.x, thin * x.y, thin * x.z);
        for v in 0..solid.points.len() {
            let x = solid.points[v];
            statics.positions[v] = if statics.free[v] { turn * x } else { exact(&x) };
        }
        let end = |side: f64| turn * Vector3::new(side * part * young, 0.0, 0.0);
        let mut load = solid.traction(|x| x.x > length - 1e-9, |_| end(1.0));
        let other = solid.traction(|x| x.x < 1e-9, |_| end(-1.0));
        load.iter_mut().zip(other).for_each(|(f, g)| *f += g);
        let mut equilibrium = equilibrium_by_name("fallback")?;
        solve("stretch", &mut statics, &ElementCorotation, equilibrium.as_mut(), &load, 1e-12)?;
        let place = |x: f64, y: f64| {
            let want = Vector3::new(x, y, 1.0);
            let v = (0..solid.points.len()).find(|&v| (solid.points[v] - want).norm() < 1e-9);
            v.map_or(want, |v| statics.positions[v])
        };
        let size = (4, &solid);
        let what = format!("at {degrees}°, s/E = {part}");
        let longer = (place(2.0, 1.0) - place(0.0, 1.0)).norm() / length;
        let thinner = (place(2.0, 1.0) - place(2.0, 0.0)).norm();
        rows.push(Row::new("stretch", size, format!("length {what}"), longer, long));
        rows.push(Row::new("stretch", size, format!("width {what}"), thinner, thin));
        let reaction = (0..solid.points.len())
            .filter(|&v| !statics.free[v])
            .map(|v| (statics.internal[v] - load[v]).norm())
            .fold(0.0, f64::max);
        let force = part.abs() * young;
        rows.push(Row::of_zero("stretch", size, format!("reaction {what} (N)"), reaction, force));
    }
    Ok(rows)
}

/// A body of mixed, anisotropic tissue under a load that turns its end by some 40°: solved, and
/// solved again after the mesh, its material and its loads were turned, moved by ten times its
/// length, or written in other units.
pub(super) fn invariance() -> Result<Vec<Row>> {
    let turn = Rotation3::from_scaled_axis(Vector3::new(0.7, -1.3, 0.4)).into_inner();
    let same =
        Change { turn: Matrix3::identity(), shift: Vector3::zeros(), length: 1.0, modulus: 1.0 };
    let changes = [
        ("rotated", Change { turn, ..same }),
        ("moved", Change { shift: Vector3::new(30.0, -20.0, 25.0), ..same }),
        ("in mm and kPa", Change { length: 1e3, modulus: 1e-3, ..same }),
    ];
    let (solid, reference) = deformed(&same)?;
    let largest = |x: &[Vector3<f64>], back: &dyn Fn(&Vector3<f64>) -> Vector3<f64>| {
        x.iter().zip(&reference).map(|(x, want)| (back(x) - want).norm()).fold(0.0, f64::max)
    };
    let displacement = largest(&solid.points, &|x| *x);
    let mut rows = Vec::new();
    for (name, change) in changes {
        let (_, positions) = deformed(&change)?;
        let back = |x: &Vector3<f64>| change.turn.transpose() * (x - change.shift) / change.length;
        let error = largest(&positions, &back);
        let quantity = format!("largest change of a position when {name} (m)");
        rows.push(Row::of_zero("invariance", (4, &solid), quantity, error, displacement));
    }
    Ok(rows)
}

/// x → turn x · length + shift, and moduli · modulus.
struct Change {
    turn: Matrix3<f64>,
    shift: Vector3<f64>,
    length: f64,
    modulus: f64,
}

/// The body after a change, at rest, and its positions when it is deformed.
fn deformed(change: &Change) -> Result<(Solid, Vec<Vector3<f64>>)> {
    let mut solid = Solid::block([12, 4, 4], [3.0, 1.0, 1.0], isotropic(1e4, 0.3));
    let ends: Vec<bool> = solid.points.iter().map(|x| x.x < 1e-9).collect();
    let load = solid.traction(|x| x.x > 3.0 - 1e-9, |_| Vector3::new(0.0, 60.0, 40.0));
    let bond = bond(&change.turn);
    for (tet, d) in solid.elasticity.iter_mut().enumerate() {
        // Fibres in the direction of one axis or another, up to ten times as stiff.
        let mut fibres = Matrix6::zeros();
        fibres[(tet % 3, tet % 3)] = 1e4 * (tet % 10) as f64;
        *d = bond * (*d + fibres) * bond.transpose() * change.modulus;
    }
    for x in &mut solid.points {
        *x = change.turn * *x * change.length + change.shift;
    }
    let held: Vec<Vector3<f64>> =
        (0..ends.len()).filter(|&v| ends[v]).map(|v| solid.points[v]).collect();
    let mut statics = Statics::new(&solid, |x| held.contains(x))?;
    let force = change.modulus * change.length * change.length;
    let load: Vec<Vector3<f64>> = load.iter().map(|f| change.turn * f * force).collect();
    let mut anderson = Anderson::default();
    solve("invariance", &mut statics, &ElementCorotation, &mut anderson, &load, 1e-12)?;
    Ok((solid, statics.positions))
}

/// σ' = M σ in Voigt order for σ' = Q σ Qᵀ.
fn bond(turn: &Matrix3<f64>) -> Matrix6<f64> {
    const PLACES: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)];
    let columns = PLACES.map(|(i, j)| {
        let mut stress = Matrix3::zeros();
        stress[(i, j)] = 1.0;
        stress[(j, i)] = 1.0;
        let turned = turn * stress * turn.transpose();
        Vector6::from(PLACES.map(|place| turned[place]))
    });
    Matrix6::from_columns(&columns)
}
