//! `plastic`: J2 plasticity with linear isotropic hardening.

use nalgebra::Matrix6;
use yawara_embed::Strain;

use crate::error::CorotError;

/// A stress that a step has come to without flow, and what flow makes of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Flowed {
    pub stress: Strain,
    /// The strain that has come to stay in this step.
    pub strain: Strain,
    /// By how much the equivalent plastic strain has grown.
    pub equivalent: f64,
    /// ∂σ/∂ε.
    pub tangent: Matrix6<f64>,
}

/// |dev σ| ≤ √⅔ (σ_y + H α), α the equivalent plastic strain √⅔ Σ|Δε_p|; beyond it strain flows along dev σ until
/// it holds (radial return), which for an isotropic D is implicit Euler of the associated flow.
/// # Source
/// Simo, Hughes, Computational Inelasticity, 1998, box 3.1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plastic {
    /// σ_y of a bar that is pulled, Pa.
    pub yield_pa: f64,
    /// H = dσ_y/dα, Pa.
    pub hardening_pa: f64,
}

impl Plastic {
    /// # Errors
    /// [`CorotError::Range`] unless the yield stress is more than 0 and the hardening at least 0, both finite.
    pub fn new(yield_pa: f64, hardening_pa: f64) -> Result<Self, CorotError> {
        let refuse = |what, value, want| Err(CorotError::Range { what, value, want });
        if !(yield_pa > 0.0 && yield_pa.is_finite()) {
            return refuse("the yield stress, Pa,", yield_pa, "a finite number > 0");
        }
        if !(hardening_pa >= 0.0 && hardening_pa.is_finite()) {
            return refuse("the hardening, Pa,", hardening_pa, "a finite number >= 0");
        }
        Ok(Self { yield_pa, hardening_pa })
    }

    /// What becomes of `trial` in an element of the tangent D (Pa) after the equivalent plastic strain
    /// `equivalent`.
    ///
    /// With n = dev σ*/|dev σ*| the strain Δλ n stays and dev σ = dev σ* − Δλ dev(D n) is on the yield surface: a
    /// quadratic equation for Δλ, of which the least root counts.
    pub(super) fn flow(
        &self,
        trial: &Strain,
        elasticity: &Matrix6<f64>,
        equivalent: f64,
    ) -> Flowed {
        let root = (2.0_f64 / 3.0).sqrt();
        let shape = deviator(trial);
        let size = double(&shape, &shape).sqrt();
        let radius = root * (self.yield_pa + self.hardening_pa * equivalent);
        if !(size > radius) {
            let (strain, tangent) = (Strain::zeros(), *elasticity);
            return Flowed { stress: *trial, strain, equivalent: 0.0, tangent };
        }
        let normal = shape / size;
        let along = engineering(&normal);
        let drop = elasticity * along;
        let turn = deviator(&drop);
        let growth = 2.0 / 3.0 * self.hardening_pa;
        // (a·a − h²) Δλ² − 2 (s·a + r h) Δλ + s·s − r² = 0.
        let square = double(&turn, &turn) - growth * growth;
        let half = double(&shape, &turn) + radius * growth;
        let left = (size - radius) * (size + radius);
        let slope = (half * half - square * left).max(0.0).sqrt();
        let amount = left / (half + slope);
        Flowed {
            stress: trial - amount * drop,
            strain: amount * along,
            equivalent: root * amount,
            tangent: self.tangent(elasticity, &normal, amount / size, &drop),
        }
    }

    /// D − D n ⊗ ∂Δλ/∂ε − Δλ D ∂n/∂ε, with ∂Δλ/∂ε = n·D/(n·D n + ⅔H), exact where D is isotropic.
    fn tangent(
        &self,
        elasticity: &Matrix6<f64>,
        normal: &Strain,
        relative: f64,
        drop: &Strain,
    ) -> Matrix6<f64> {
        let rate = double(normal, drop) + 2.0 / 3.0 * self.hardening_pa;
        let columns = std::array::from_fn::<_, 6, _>(|i| {
            let change = deviator(&elasticity.column(i).into_owned());
            let turned = change - double(normal, &change) * normal;
            elasticity.column(i)
                - drop * (drop[i] / rate)
                - relative * elasticity * engineering(&turned)
        });
        Matrix6::from_columns(&columns)
    }
}

/// a:b of two stresses in Voigt order.
fn double(a: &Strain, b: &Strain) -> f64 {
    a.dot(b) + a.rows(3, 3).dot(&b.rows(3, 3))
}

/// The part of a stress that changes shape.
fn deviator(stress: &Strain) -> Strain {
    let mean = (stress[0] + stress[1] + stress[2]) / 3.0;
    stress - mean * Strain::new(1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
}

/// A stress as strain and a strain as stress would be: engineering shears are twice those of the tensor.
fn engineering(tensor: &Strain) -> Strain {
    let mut strain = *tensor;
    strain.rows_mut(3, 3).scale_mut(2.0);
    strain
}
