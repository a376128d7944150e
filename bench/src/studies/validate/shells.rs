//! A shell whose inside is pushed outwards, beyond linear elasticity: Hill's, which yields, and one of rubber.

use std::sync::Arc;

use nalgebra::Vector3;
use yawara_corot::{
    ConstitutiveLaw, ElementCorotation, Flow, Inelastic, InelasticMaterial, NeoHookean, Newton,
    Plastic,
};
use yawara_embed::{P1P1, isotropic};

use super::figure::{Row, solve};
use crate::bodies::{Solid, Statics};
use crate::error::Result;

/// Radius of the inside, m; that of the outside is 1 m.
const INNER: f64 = 0.5;

/// Steps to the end.
const STEPS: usize = 5;

/// A shell of displacements with pressures, held at its inside.
struct Shell {
    solid: Solid,
    statics: Statics,
    /// Volume inside at rest, m³.
    hollow: f64,
}

impl Shell {
    /// Of `n` divisions around a quarter, under a law that knows of each element what it is `made_of`.
    fn new(
        n: usize,
        (young, poisson_ratio): (f64, f64),
        law: Arc<dyn ConstitutiveLaw>,
        made_of: &[f64],
    ) -> Result<Self> {
        let layers = n / 2;
        let radius = |i: usize| 1.0 + (INNER - 1.0) * i as f64 / layers as f64;
        let radii: Vec<f64> = (0..=layers).map(radius).collect();
        let solid = Solid::ball(n, &radii, |_| isotropic(young, poisson_ratio));
        let element = P1P1::default();
        let statics = Statics::under(&solid, |x| x.norm() < INNER + 1e-9, element, law, made_of)?;
        let inside = |face: &[usize; 3]| face.iter().all(|&v| !statics.free[v]);
        let volume = |face: [usize; 3]| {
            let [a, b, c] = face.map(|v| solid.points[v]);
            a.dot(&b.cross(&c)).abs() / 6.0
        };
        let hollow = solid.boundary().into_iter().filter(inside).map(volume).sum();
        Ok(Self { solid, statics, hollow })
    }

    /// Brings the inside to `radius` and solves.
    fn widen(&mut self, case: &'static str, radius: f64) -> Result<()> {
        let rest = self.statics.rest.clone();
        self.statics.body.begin_step(1.0);
        self.statics.drag(&ElementCorotation, |v| rest[v] * (radius / INNER));
        let none = vec![Vector3::zeros(); rest.len()];
        solve(case, &mut self.statics, &ElementCorotation, &mut Newton::default(), &none, 1e-7)?;
        self.statics.body.commit();
        Ok(())
    }

    /// The pressure on the inside at `radius`, Pa: the work of what holds it there by how much more is in it.
    fn pressure(&self, radius: f64) -> f64 {
        let Statics { internal, rest, free, .. } = &self.statics;
        let held = (0..rest.len()).filter(|&v| !free[v]);
        let force: f64 = held.map(|v| internal[v].dot(&rest[v].normalize())).sum();
        force / (3.0 * self.hollow * radius * radius / INNER.powi(3))
    }
}

/// The pressure that has brought yielding to the radius c = ¾ m: Y (2 ln(c/a) + ⅔ (1 − c³/b³)), with the inside moved
/// by Y/E ((1 − ν) c³/a² − ⅔ (1 − 2ν) a (1 + 3 ln(c/a) − c³/b³)).
///
/// Source: Hill, The mathematical theory of plasticity, 1950, chapter V.2.
pub(super) fn hill(n: usize) -> Result<Row> {
    let (young, poisson_ratio, yield_pa, front) = (1e6, 0.3, 100.0, 0.75f64);
    let material = InelasticMaterial {
        relaxed: isotropic(young, poisson_ratio),
        terms: Vec::new(),
        flow: Flow::Plastic(Plastic::new(yield_pa, 0.0)?),
    };
    let law = Arc::new(Inelastic::new(Vec::new(), true));
    let mut shell = Shell::new(n, (young, poisson_ratio), law, &material.numbers())?;
    let (c3, depth) = (front.powi(3), (front / INNER).ln());
    let moved = yield_pa / young
        * ((1.0 - poisson_ratio) * c3 / INNER.powi(2)
            - 2.0 / 3.0 * (1.0 - 2.0 * poisson_ratio) * INNER * (1.0 + 3.0 * depth - c3));
    for step in 1..=STEPS {
        shell.widen("hill", INNER + moved * step as f64 / STEPS as f64)?;
    }
    let expected = yield_pa * (2.0 * depth + 2.0 / 3.0 * (1.0 - c3));
    let computed = shell.pressure(INNER + moved);
    Ok(Row::new("hill", (n, &shell.solid), "pressure at the inside (Pa)", computed, expected))
}

/// The pressure in a shell of rubber, blown up to 1½ times its inner radius: μ (g(λ_b) − g(λ_a)) with
/// g(λ) = 2/λ + 1/(2λ⁴) of what cannot be compressed.
///
/// Source: Green, Zerna, Theoretical elasticity, 1954, chapter III.
pub(super) fn inflation(n: usize) -> Result<Row> {
    let (young, poisson_ratio, widened) = (1e4, 0.4999, 1.5f64);
    let law = Arc::new(NeoHookean);
    let mut shell = Shell::new(n, (young, poisson_ratio), law, &[])?;
    for step in 1..=STEPS {
        let part = step as f64 / STEPS as f64;
        shell.widen("inflation", INNER * (1.0 + part * (widened - 1.0)))?;
    }
    let outside = (1.0 + INNER.powi(3) * (widened.powi(3) - 1.0)).cbrt();
    let g = |stretch: f64| 2.0 / stretch + 0.5 / stretch.powi(4);
    let shear = young / (2.0 * (1.0 + poisson_ratio));
    let expected = shear * (g(outside) - g(widened));
    let computed = shell.pressure(INNER * widened);
    Ok(Row::new("inflation", (n, &shell.solid), "pressure at the inside (Pa)", computed, expected))
}
