//! `neo_hookean`: a law for strains of any size, inverted elements included.

use nalgebra::{Matrix3, Matrix6, SMatrix, SVector};
use yawara_embed::{MixedModuli, Strain};

use super::constitutive_law::{ConstitutiveLaw, MaterialPoint};

/// The stable neo-Hookean solid, which has the elasticity D at small strains.
///
/// With the stretch S = I + ε and J = det S its energy is
/// ½ ε·D ε + ½μ(S:S − 3) − μ(J − 1) + ½(κ + μ/3)(J − 1)² − μ dev ε : dev ε − ½κ (tr ε)², J/m³:
/// Smith's solid of the bulk modulus κ = 1/(mᵀD⁻¹m) and the shear modulus μ, and what D has beyond an isotropic
/// material of these two as in linear elasticity. 2μ is a bound from below on the eigenvalues of D for changes of
/// shape, the eigenvalue itself where D is isotropic: there the second part vanishes. The force of the isotropic part
/// is a smooth function of the deformation gradient everywhere, where that of linear elasticity has a kink at
/// σ₂ + σ₃ = 0, and a bar that is pulled to many times its length keeps its volume.
///
/// With pressures p takes the place of κ(J − 1), and p = κ(J − 1) is what they are found from.
/// # Source
/// Smith, de Goes, Kim, Stable neo-Hookean flesh simulation, ACM TOG 37(2), 2018.
#[derive(Clone, Copy, Debug, Default)]
pub struct NeoHookean;

/// Its moduli, Pa.
struct Moduli {
    shear: f64,
    bulk: f64,
}

/// What stress and tangent are made of at a point.
struct Point {
    moduli: Moduli,
    /// The mean stress of the volumetric part, Pa.
    pressure: f64,
    /// J − 1 with its derivatives.
    growth: f64,
    cofactors: Strain,
    second: Matrix6<f64>,
}

/// diag(1, 1, 1, ½, ½, ½): S:S of engineering strains.
fn product() -> Matrix6<f64> {
    Matrix6::from_diagonal(&Strain::new(1.0, 1.0, 1.0, 0.5, 0.5, 0.5))
}

/// dev ε : dev ε of engineering strains.
fn deviator() -> Matrix6<f64> {
    let m = dilation();
    product() - m * m.transpose() / 3.0
}

fn dilation() -> Strain {
    Strain::new(1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
}

impl Moduli {
    fn new(elasticity: &Matrix6<f64>) -> Self {
        let (half, third, twice) = (0.5_f64.sqrt(), 6.0_f64.sqrt().recip(), 2.0_f64.sqrt());
        // Changes of shape of unit size, at right angles to each other.
        let shapes = SMatrix::<f64, 6, 5>::from_columns(&[
            Strain::new(half, -half, 0.0, 0.0, 0.0, 0.0),
            Strain::new(third, third, -2.0 * third, 0.0, 0.0, 0.0),
            twice * Strain::ith(3, 1.0),
            twice * Strain::ith(4, 1.0),
            twice * Strain::ith(5, 1.0),
        ]);
        let of_shape: SMatrix<f64, 5, 5> = shapes.transpose() * elasticity * shapes;
        // Gershgorin's bound, and 1/tr(A⁻¹), which is at least a fifth of the least eigenvalue.
        let row = |i: usize| 2.0 * of_shape[(i, i)] - of_shape.row(i).abs().sum();
        let discs = SVector::<f64, 5>::from_fn(|i, _| row(i)).min();
        let inverse = of_shape.try_inverse().map_or(f64::NAN, |inverse| inverse.trace().recip());
        let bulk = MixedModuli::split(elasticity).bulk;
        Self { shear: 0.5 * inverse.max(discs), bulk }
    }
}

impl Point {
    fn new(point: &MaterialPoint<'_>) -> Self {
        let [shear, bulk] = [0, 1].map(|i| point.moduli[i]);
        let (growth, cofactors, second) = volume(&point.strain);
        let pressure = point.pressure.unwrap_or(bulk * growth);
        Self { moduli: Moduli { shear, bulk }, pressure, growth, cofactors, second }
    }
}

/// J − 1 of S = I + ε with its first and second derivative by engineering strains.
fn volume(strain: &Strain) -> (f64, Strain, Matrix6<f64>) {
    let [xx, yy, zz] = [0, 1, 2].map(|i| 1.0 + strain[i]);
    let [xy, yz, zx] = [3, 4, 5].map(|i| 0.5 * strain[i]);
    let s = Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz);
    let cofactors = Strain::new(
        yy * zz - yz * yz,
        xx * zz - zx * zx,
        xx * yy - xy * xy,
        yz * zx - zz * xy,
        xy * zx - xx * yz,
        xy * yz - yy * zx,
    );
    #[rustfmt::skip]
    let second = Matrix6::new(
        0.0, zz, yy, 0.0, -yz, 0.0,
        zz, 0.0, xx, 0.0, 0.0, -zx,
        yy, xx, 0.0, -xy, 0.0, 0.0,
        0.0, 0.0, -xy, -0.5 * zz, 0.5 * zx, 0.5 * yz,
        -yz, 0.0, 0.0, 0.5 * zx, -0.5 * xx, 0.5 * xy,
        0.0, -zx, 0.0, 0.5 * yz, 0.5 * xy, -0.5 * yy,
    );
    (s.determinant() - 1.0, cofactors, second)
}

impl ConstitutiveLaw for NeoHookean {
    fn name(&self) -> &str {
        "neo_hookean"
    }

    fn state_len(&self) -> usize {
        0
    }

    fn stress(&self, point: &MaterialPoint<'_>, _: &mut [f64]) -> Strain {
        let Point { moduli: Moduli { shear, bulk }, pressure, growth, cofactors, .. } =
            Point::new(point);
        let (strain, m) = (&point.strain, dilation());
        let stretch = product() * strain + m;
        let spherical = (pressure + shear / 3.0 * growth) * cofactors - bulk * strain.dot(&m) * m;
        point.elasticity * strain
            + shear * (stretch - cofactors - 2.0 * deviator() * strain)
            + spherical
    }

    fn tangent(&self, point: &MaterialPoint<'_>) -> Matrix6<f64> {
        let Point { moduli: Moduli { shear, bulk }, pressure, growth, cofactors, second } =
            Point::new(point);
        let m = dilation();
        let stiff = if point.pressure.is_some() { 0.0 } else { bulk };
        point.elasticity - bulk * m * m.transpose()
            + shear * (product() - 2.0 * deviator())
            + (pressure + shear / 3.0 * growth - shear) * second
            + (stiff + shear / 3.0) * cofactors * cofactors.transpose()
    }

    fn energy(&self, point: &MaterialPoint<'_>) -> Option<f64> {
        let Point { moduli: Moduli { shear, bulk }, pressure, growth, .. } = Point::new(point);
        let strain = &point.strain;
        let squares = |form: &Matrix6<f64>| strain.dot(&(form * strain));
        let dilation = strain.dot(&dilation());
        let linear = 0.5 * (squares(point.elasticity) - bulk * dilation * dilation);
        let of_shape = dilation + 0.5 * squares(&product()) - growth - squares(&deviator());
        Some(linear + shear * of_shape + (shear / 6.0 * growth + 0.5 * pressure) * growth)
    }

    fn stiffening(&self, _: f64) -> f64 {
        1.0
    }

    fn growth(&self, strain: &Strain) -> Option<(f64, Strain)> {
        let (growth, cofactors, _) = volume(strain);
        Some((growth, cofactors))
    }

    fn moduli_len(&self) -> usize {
        2
    }

    fn set_moduli(&self, elasticity: &Matrix6<f64>, _: &[f64], moduli: &mut [f64]) {
        let Moduli { shear, bulk } = Moduli::new(elasticity);
        moduli.copy_from_slice(&[shear, bulk]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yawara_embed::isotropic;

    /// σ of a stretch along the axes.
    fn stress(elasticity: &Matrix6<f64>, stretches: [f64; 3]) -> Strain {
        let [a, b, c] = stretches.map(|s| s - 1.0);
        let strain = Strain::new(a, b, c, 0.0, 0.0, 0.0);
        let mut moduli = [0.0; 2];
        NeoHookean.set_moduli(elasticity, &[], &mut moduli);
        let (moduli, state) = (&moduli[..], &[][..]);
        let step_s = f64::INFINITY;
        let (pressure, prepared) = (None, &[][..]);
        let point = MaterialPoint { elasticity, moduli, strain, pressure, state, step_s, prepared };
        NeoHookean.stress(&point, &mut [])
    }

    /// Smith et al., eq. 14 on: P = μ F + ((λ+μ)(J − 1) − μ) cof F, along the axes.
    #[test]
    fn an_isotropic_one_has_the_known_stress() {
        let (young, nu) = (1e3, 0.45);
        let (shear, first) =
            (0.5 * young / (1.0 + nu), young * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)));
        for [a, b, c] in [[1.0, 1.0, 1.0], [4.0, 0.4, 0.6], [0.2, 1.5, 1.5], [1.1, 0.3, -0.5]] {
            let got = stress(&isotropic(young, nu), [a, b, c]);
            let spread = (first + shear) * (a * b * c - 1.0) - shear;
            let want = [shear * a + spread * b * c, shear * b + spread * a * c];
            for (got, want) in got.iter().zip(want) {
                assert!((got - want).abs() < 1e-11 * young * (a * a + 1.0), "{got}, want {want}");
            }
        }
    }

    /// The isotropic part stays below D: what is left over of it is no elasticity that gives way.
    #[test]
    fn what_is_beyond_the_isotropic_part_stays_positive() {
        let base = isotropic(1e3, 0.3);
        let fibre = Strain::new(0.8, 0.1, 0.1, 0.3, 0.0, 0.2);
        let elasticity = base + 5e3 * fibre * fibre.transpose();
        let Moduli { shear, .. } = Moduli::new(&elasticity);
        let own = 0.5e3 / 1.3;
        assert!(shear > 0.2 * own && shear <= own * (1.0 + 1e-12), "{shear} Pa of {own} Pa");
        assert!((Moduli::new(&base).shear - own).abs() < 1e-12 * own);
    }
}
