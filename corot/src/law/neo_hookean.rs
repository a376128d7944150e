//! `neo_hookean`: a law for strains of any size, inverted elements included.

use nalgebra::{Matrix3, Matrix6, SMatrix, SVector};
use pulp::{Simd, WithSimd};
use yawara_embed::{MixedModuli, Strain};

use super::constitutive_law::{ConstitutiveLaw, MaterialPoint};
use super::packet_law::{Lanes, PacketLaw, PointPacket};
use crate::kernels::simd::{LANES, V};

/// The stable neo-Hookean solid, which has the elasticity D at small strains.
///
/// With the stretch S = I + ε and J = det S its energy is
/// ½μ(S:S − 3) − μ(J − 1) + ½(κ + μ/3)(J − 1)² + w (½ ε·D ε − μ dev ε : dev ε − ½κ (tr ε)²), J/m³:
/// Smith's solid of the bulk modulus κ = 1/(mᵀD⁻¹m) and the shear modulus μ, and what D has beyond an isotropic
/// material of these two as in linear elasticity. 2μ is a bound from below on the eigenvalues of D for changes of
/// shape, the eigenvalue itself where D is isotropic: there the second part vanishes. The force of the isotropic part
/// is a smooth function of the deformation gradient everywhere, where that of linear elasticity has a kink at
/// σ₂ + σ₃ = 0, and a bar that is pulled to many times its length keeps its volume.
///
/// At that kink, where an element turns over, S jumps, and with it would the energy of a material that is not
/// isotropic: going down it ends nowhere. So w goes to 0 there, t³(10 − 15t + 6t²) of t = d/2 where that is below 1, with
/// d = (σ₁+σ₂)(σ₂+σ₃)(σ₃+σ₁) = I₁I₂ − I₃. Since d ≥ 8J, w is 1 wherever an element has a quarter of its volume.
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
    /// J − 1 with its derivative.
    growth: f64,
    cofactors: Strain,
    /// What D has beyond the isotropic part, times the strain, and how it fades.
    beyond: Strain,
    fading: Option<Fading>,
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

/// d below which what is beyond the isotropic part fades; 8 at rest.
const TURNING_OVER: f64 = 2.0;

/// w with its derivative by engineering strains, and that of t.
struct Fading {
    t: f64,
    value: f64,
    first: Strain,
    of_t: Strain,
}

impl Fading {
    /// Of the stretch I + ε with its det S − 1 and cofactors; none where w is 1.
    fn new(strain: &Strain, growth: f64, cofactors: &Strain) -> Option<Self> {
        let (stretch, one) = (stretch(strain), 3.0 + dilation_of(strain));
        let squares = stretch.dot(&(strain + dilation()));
        let two = 0.5 * (one * one - squares);
        let t = (one * two - (1.0 + growth)).max(0.0) / TURNING_OVER;
        if t >= 1.0 {
            return None;
        }
        let m = dilation();
        let of_t = (two * m + one * (one * m - stretch) - cofactors) / TURNING_OVER;
        let first = 30.0 * (t * (1.0 - t)).powi(2) * of_t;
        Some(Self { t, value: t.powi(3) * (10.0 - 15.0 * t + 6.0 * t * t), first, of_t })
    }

    /// Its second derivative, with that of J.
    fn second(&self, strain: &Strain, of_volume: &Matrix6<f64>) -> Matrix6<f64> {
        let Self { t, of_t, .. } = self;
        let (m, one) = (dilation(), 3.0 + dilation_of(strain));
        let crossed = m * (one * m - stretch(strain)).transpose();
        let more =
            crossed + crossed.transpose() + one * (m * m.transpose() - product()) - of_volume;
        let (slope, curve) =
            (30.0 * (t * (1.0 - t)).powi(2), 60.0 * t * (1.0 - t) * (1.0 - 2.0 * t));
        curve * of_t * of_t.transpose() + slope / TURNING_OVER * more
    }
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
        let (growth, cofactors) = volume(&point.strain);
        let pressure = point.pressure.unwrap_or(bulk * growth);
        let (strain, m) = (&point.strain, dilation());
        let spread = (bulk - 2.0 / 3.0 * shear) * dilation_of(strain);
        let isotropic = 2.0 * shear * (stretch(strain) - m) + spread * m;
        let beyond = point.elasticity * strain - isotropic;
        let fading = Fading::new(strain, growth, &cofactors);
        Self { moduli: Moduli { shear, bulk }, pressure, growth, cofactors, beyond, fading }
    }

    /// σ of what is beyond the isotropic part.
    fn stress_beyond(&self, strain: &Strain) -> Strain {
        let Self { beyond, fading, .. } = self;
        fading.as_ref().map_or(*beyond, |w| w.value * beyond + 0.5 * strain.dot(beyond) * w.first)
    }

    /// ∂σ/∂ε of the same, of the elasticity A.
    fn tangent_beyond(
        &self,
        strain: &Strain,
        elasticity: Matrix6<f64>,
        of_volume: &Matrix6<f64>,
    ) -> Matrix6<f64> {
        let Self { beyond, fading: Some(w), .. } = self else { return elasticity };
        let crossed = beyond * w.first.transpose();
        let second = 0.5 * strain.dot(beyond) * w.second(strain, of_volume);
        w.value * elasticity + crossed + crossed.transpose() + second
    }
}

/// tr ε.
fn dilation_of(strain: &Strain) -> f64 {
    strain[0] + strain[1] + strain[2]
}

/// S = I + ε, its entries in the order of strains.
fn stretch(strain: &Strain) -> Strain {
    Strain::from_fn(|i, _| if i < 3 { 1.0 + strain[i] } else { 0.5 * strain[i] })
}

/// J − 1 of S = I + ε with its derivative by engineering strains, the cofactors of S.
fn volume(strain: &Strain) -> (f64, Strain) {
    let [xx, yy, zz, xy, yz, zx] = stretch(strain).into();
    let s = Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz);
    let cofactors = Strain::new(
        yy * zz - yz * yz,
        xx * zz - zx * zx,
        xx * yy - xy * xy,
        yz * zx - zz * xy,
        xy * zx - xx * yz,
        xy * yz - yy * zx,
    );
    (s.determinant() - 1.0, cofactors)
}

/// The second derivative of J.
fn second_of_volume(strain: &Strain) -> Matrix6<f64> {
    let [xx, yy, zz, xy, yz, zx] = stretch(strain).into();
    #[rustfmt::skip]
    let second = Matrix6::new(
        0.0, zz, yy, 0.0, -yz, 0.0,
        zz, 0.0, xx, 0.0, 0.0, -zx,
        yy, xx, 0.0, -xy, 0.0, 0.0,
        0.0, 0.0, -xy, -0.5 * zz, 0.5 * zx, 0.5 * yz,
        -yz, 0.0, 0.0, 0.5 * zx, -0.5 * xx, 0.5 * xy,
        0.0, -zx, 0.0, 0.5 * yz, 0.5 * xy, -0.5 * yy,
    );
    second
}

impl ConstitutiveLaw for NeoHookean {
    fn name(&self) -> &str {
        "neo_hookean"
    }

    fn state_len(&self) -> usize {
        0
    }

    fn stress(&self, point: &MaterialPoint<'_>, _: &mut [f64]) -> Strain {
        let at = Point::new(point);
        let Point { moduli: Moduli { shear, .. }, pressure, growth, cofactors, .. } = &at;
        let spherical = (pressure + shear / 3.0 * growth) * cofactors;
        at.stress_beyond(&point.strain) + *shear * (stretch(&point.strain) - cofactors) + spherical
    }

    fn tangent(&self, point: &MaterialPoint<'_>) -> Matrix6<f64> {
        let at = Point::new(point);
        let Point { moduli: Moduli { shear, bulk }, pressure, growth, cofactors, .. } = &at;
        let (m, second) = (dilation(), second_of_volume(&point.strain));
        let stiff = if point.pressure.is_some() { 0.0 } else { *bulk };
        let elasticity = point.elasticity - *bulk * m * m.transpose() - 2.0 * *shear * deviator();
        at.tangent_beyond(&point.strain, elasticity, &second)
            + *shear * product()
            + (pressure + shear / 3.0 * growth - shear) * second
            + (stiff + shear / 3.0) * cofactors * cofactors.transpose()
    }

    fn energy(&self, point: &MaterialPoint<'_>) -> Option<f64> {
        let Point { moduli: Moduli { shear, .. }, pressure, growth, beyond, fading, .. } =
            Point::new(point);
        let strain = &point.strain;
        let faded = fading.map_or(1.0, |w| w.value);
        let sheared = stretch(strain) - dilation();
        let of_shape = dilation_of(strain) + 0.5 * strain.dot(&sheared) - growth;
        let volumetric = (shear / 6.0 * growth + 0.5 * pressure) * growth;
        Some(0.5 * faded * strain.dot(&beyond) + shear * of_shape + volumetric)
    }

    fn stiffening(&self, _: f64) -> f64 {
        1.0
    }

    fn packets(&self) -> Option<&dyn PacketLaw> {
        Some(self)
    }

    fn growth(&self, strain: &Strain) -> Option<(f64, Strain)> {
        Some(volume(strain))
    }

    fn moduli_len(&self) -> usize {
        2
    }

    fn set_moduli(&self, elasticity: &Matrix6<f64>, _: &[f64], moduli: &mut [f64]) {
        let Moduli { shear, bulk } = Moduli::new(elasticity);
        moduli.copy_from_slice(&[shear, bulk]);
    }
}

impl PacketLaw for NeoHookean {
    fn stress(&self, points: &PointPacket<'_>, stress: &mut [Lanes; 6], growth: &mut Lanes) {
        pulp::Arch::new().dispatch(Eight { points, stress, growth });
    }
}

/// The stress of eight elements.
struct Eight<'a> {
    points: &'a PointPacket<'a>,
    stress: &'a mut [Lanes; 6],
    growth: &'a mut Lanes,
}

impl WithSimd for Eight<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for part in 0..LANES / S::F64_LANES {
            stress_of_part(simd, self.points, self.stress, self.growth, part);
        }
    }
}

/// As [`Point`] has it, in all lanes the same way: w is 1 and its slope 0 where t is cut off at 1.
#[inline(always)]
fn stress_of_part<S: Simd>(
    simd: S,
    points: &PointPacket<'_>,
    stress: &mut [Lanes; 6],
    growth: &mut Lanes,
    part: usize,
) {
    let (zero, half, one, third) =
        (V::splat(simd, 0.0), V::splat(simd, 0.5), V::splat(simd, 1.0), V::splat(simd, 1.0 / 3.0));
    let (shear, bulk) =
        (V::load(simd, &points.moduli[0], part), V::load(simd, &points.moduli[1], part));
    let (mut strain, mut beyond) = ([zero; 6], [zero; 6]);
    for i in 0..6 {
        strain[i] = V::load(simd, &points.strain[i], part);
        beyond[i] = V::load(simd, &points.elastic[i], part);
    }
    let dilation = strain[0] + strain[1] + strain[2];
    let [xx, yy, zz] = [one + strain[0], one + strain[1], one + strain[2]];
    let [xy, yz, zx] = [half * strain[3], half * strain[4], half * strain[5]];
    let stretch = [xx, yy, zz, xy, yz, zx];
    let cofactors = [
        yy * zz - yz * yz,
        xx * zz - zx * zx,
        xx * yy - xy * xy,
        yz * zx - zz * xy,
        xy * zx - xx * yz,
        xy * yz - yy * zx,
    ];
    let volume = (xx * cofactors[0]).plus(xy, cofactors[3]).plus(zx, cofactors[5]);
    let grown = volume - one;
    // Of what pressures stand for there is nothing in D'.
    let (pressure, spread) = match points.pressure {
        Some(pressure) => (V::load(simd, pressure, part), zero),
        None => (bulk * grown, bulk * dilation),
    };
    let mean = third * dilation;
    let mut work = zero;
    for i in 0..6 {
        let isotropic = match i < 3 {
            true => (shear + shear) * (strain[i] - mean) + spread,
            false => shear * strain[i],
        };
        beyond[i] = beyond[i] - isotropic;
        work = work.plus(strain[i], beyond[i]);
    }
    let sum = xx + yy + zz;
    let squares = (xx * xx).plus(yy, yy).plus(zz, zz);
    let crossed = (xy * xy).plus(yz, yz).plus(zx, zx);
    let two = half * (sum * sum - squares) - crossed;
    let over = V::splat(simd, 1.0 / TURNING_OVER);
    let t = ((sum * two - volume) * over).or_more(zero).or_less(one);
    let left = one - t;
    let faded =
        t * t * t * (V::splat(simd, 10.0) - t * (V::splat(simd, 15.0) - V::splat(simd, 6.0) * t));
    let slope = V::splat(simd, 15.0) * (t * left) * (t * left) * work * over;
    let spherical = pressure + third * shear * grown;
    for i in 0..6 {
        let of_two = if i < 3 { sum - stretch[i] } else { -stretch[i] };
        let of_t = if i < 3 { two } else { zero } + sum * of_two - cofactors[i];
        let sum = (faded * beyond[i]).plus(slope, of_t);
        let sum = sum.plus(shear, stretch[i] - cofactors[i]).plus(spherical, cofactors[i]);
        sum.store(&mut stress[i], part);
    }
    grown.store(growth, part);
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::array::from_fn;
    use yawara_embed::isotropic;

    /// σ of a stretch along the axes.
    fn stress(elasticity: &Matrix6<f64>, stretches: [f64; 3]) -> Strain {
        let [a, b, c] = stretches.map(|s| s - 1.0);
        let strain = Strain::new(a, b, c, 0.0, 0.0, 0.0);
        at(elasticity, strain, |point| ConstitutiveLaw::stress(&NeoHookean, point, &mut []))
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

    /// Stiffer along a fibre, which lies off the axes.
    fn fibred() -> Matrix6<f64> {
        let fibre = Strain::new(0.1, 0.8, 0.1, 0.3, 0.0, 0.2);
        isotropic(1e3, 0.3) + 5e3 * fibre * fibre.transpose()
    }

    fn at<T>(elasticity: &Matrix6<f64>, strain: Strain, of: impl Fn(&MaterialPoint<'_>) -> T) -> T {
        let mut moduli = [0.0; 2];
        NeoHookean.set_moduli(elasticity, &[], &mut moduli);
        let (moduli, state, step_s) = (&moduli[..], &[][..], f64::INFINITY);
        let (pressure, prepared) = (None, &[][..]);
        of(&MaterialPoint { elasticity, moduli, strain, pressure, state, step_s, prepared })
    }

    /// With a pressure, D' = D − κ m mᵀ is what the packet has; elements of all shapes, some turned over.
    #[test]
    fn eight_elements_at_once_have_the_stress_of_each() {
        let law = NeoHookean;
        let (mut faded, mut whole) = (0, 0);
        for group in 0..40 {
            let strains: [Strain; 8] = from_fn(|lane| {
                let wave = |k: usize| (1.7 * ((8 * group + lane) * 6 + k) as f64).sin();
                Strain::from_fn(|k, _| if k < 3 { wave(k) - 0.4 } else { wave(k) })
            });
            let elasticity = fibred() * (1.0 + group as f64);
            let mut of_each = [0.0; 2];
            law.set_moduli(&elasticity, &[], &mut of_each);
            let moduli = of_each.map(|modulus| [modulus; 8]);
            let m = dilation();
            for pressed in [None, Some(70.0)] {
                let felt = match pressed {
                    Some(_) => elasticity - of_each[1] * m * m.transpose(),
                    None => elasticity,
                };
                let rows = |of: &dyn Fn(&Strain) -> Strain| -> [Lanes; 6] {
                    from_fn(|i| strains.map(|strain| of(&strain)[i]))
                };
                let (strain, elastic) = (rows(&|strain| *strain), rows(&|strain| felt * strain));
                let lanes = pressed.map(|pressure| [pressure; 8]);
                let points = PointPacket {
                    strain: &strain,
                    elastic: &elastic,
                    moduli: &moduli,
                    pressure: lanes.as_ref(),
                };
                let (mut stress, mut growth) = ([[0.0; 8]; 6], [0.0; 8]);
                PacketLaw::stress(&law, &points, &mut stress, &mut growth);
                for (lane, strain) in strains.iter().enumerate() {
                    let (state, step_s, prepared) = (&[][..], f64::INFINITY, &[][..]);
                    let (elasticity, moduli) = (&elasticity, &of_each[..]);
                    let (strain, pressure) = (*strain, pressed);
                    let point = MaterialPoint {
                        elasticity,
                        moduli,
                        strain,
                        pressure,
                        state,
                        step_s,
                        prepared,
                    };
                    let want = ConstitutiveLaw::stress(&law, &point, &mut []);
                    let got = Strain::from_fn(|i, _| stress[i][lane]);
                    assert!(
                        (got - want).amax() < 1e-12 * elasticity.amax(),
                        "{strain}: {got} {want}"
                    );
                    let (want, cofactors) = volume(&strain);
                    assert!((growth[lane] - want).abs() < 1e-14, "{want}");
                    match Fading::new(&strain, want, &cofactors) {
                        Some(_) => faded += 1,
                        None => whole += 1,
                    }
                }
            }
        }
        assert!(faded > 100 && whole > 100, "{faded} faded, {whole} whole");
    }

    /// Singular values 1.2, .5 and just below or above −.5: the stretch of one is diag(1.2, .5, −.5), that of the
    /// other diag(1.2, −.5, .5), where the linear energies of a fibred material differ by the half of them.
    #[test]
    fn energy_and_forces_go_on_where_an_element_turns_over() {
        let (elasticity, off) = (fibred(), 1e-4);
        let strains = [
            Strain::new(0.2, -0.5, -1.5 + off, 0.0, 0.0, 0.0),
            Strain::new(0.2, -1.5 - off, -0.5, 0.0, 0.0, 0.0),
        ];
        let [a, b] = strains.map(|e| at(&elasticity, e, |p| NeoHookean.energy(p)).unwrap());
        let linear = strains.map(|e| 0.5 * e.dot(&(elasticity * e)));
        assert!((linear[0] - linear[1]).abs() > 0.3 * linear[0], "{linear:?}");
        assert!((a - b).abs() < 2.0 * off * a, "{a} and {b} J/m³");
        // The same directions in space: what pulls along y and z.
        let [a, b] = strains
            .map(|e| at(&elasticity, e, |p| ConstitutiveLaw::stress(&NeoHookean, p, &mut [])));
        for (axis, turned) in [(0, 1.0), (1, -1.0), (2, -1.0)] {
            let gap = (a[axis] - turned * b[axis]).abs();
            assert!(gap < 10.0 * off * a.norm(), "{axis}: {a:?} and {b:?}");
        }
    }

    #[test]
    fn stress_is_the_derivative_of_energy_and_tangent_that_of_stress() {
        let h = 1e-5;
        let (mut faded, mut whole) = (0, 0);
        for number in 0..200 {
            let wave = |k: usize| (1.7 * (number * 6 + k) as f64).sin();
            let strain = Strain::from_fn(|k, _| if k < 3 { wave(k) - 0.4 } else { wave(k) });
            let (growth, cofactors) = volume(&strain);
            match Fading::new(&strain, growth, &cofactors) {
                Some(w) if w.value > 0.0 => faded += 1,
                Some(_) => continue,
                None => whole += 1,
            }
            let elasticity = fibred();
            let stress =
                at(&elasticity, strain, |p| ConstitutiveLaw::stress(&NeoHookean, p, &mut []));
            let tangent = at(&elasticity, strain, |p| NeoHookean.tangent(p));
            for k in 0..6 {
                let moved = [h, -h].map(|h| strain + h * Strain::ith(k, 1.0));
                let energies = moved.map(|e| at(&elasticity, e, |p| NeoHookean.energy(p)).unwrap());
                let slope = (energies[0] - energies[1]) / (2.0 * h);
                assert!((slope - stress[k]).abs() < 1e-6 * tangent.amax(), "{strain:?} {k}");
                let stresses = moved.map(|e| {
                    at(&elasticity, e, |p| ConstitutiveLaw::stress(&NeoHookean, p, &mut []))
                });
                let slopes = (stresses[0] - stresses[1]) / (2.0 * h);
                let off = (slopes - tangent.column(k)).amax();
                assert!(off < 1e-6 * tangent.amax(), "{strain:?} {k}: {off}");
            }
        }
        assert!(faded > 10 && whole > 50, "{faded} faded, {whole} whole");
    }
}
