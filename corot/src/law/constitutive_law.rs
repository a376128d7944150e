//! The stage from strains to stresses.

use nalgebra::Matrix6;
use yawara_embed::Strain;

use super::packet_law::PacketLaw;

/// One element in its co-rotated frame, as a law sees it. Voigt order xx yy zz xy yz zx,
/// engineering shear.
#[derive(Clone, Copy, Debug)]
pub struct MaterialPoint<'a> {
    /// The homogenised elasticity D, Pa.
    pub elasticity: &'a Matrix6<f64>,
    /// What the law derived from D when the element came in, [`ConstitutiveLaw::moduli_len`] numbers.
    pub moduli: &'a [f64],
    /// The assumed strain ε̃ at the end of the step. With displacements alone it is
    /// ε = sym(RᵀF) − I. With pressures it is ε + D⁻¹m (μ q̄ − κ mᵀε), m = (1,1,1,0,0,0), for which
    /// D ε̃ = D'ε + μ q̄ m: one law serves both elements and knows of no pressure. A law with a
    /// [`growth`](ConstitutiveLaw::growth) of its own sees ε always.
    pub strain: Strain,
    /// μ q̄, Pa, for a law with a growth of its own in an element with pressures.
    pub pressure: Option<f64>,
    /// The state at the start of the step, [`ConstitutiveLaw::state_len`] numbers.
    pub state: &'a [f64],
    /// Length of the step, s; infinite where no time passes.
    pub step_s: f64,
    /// What the law [prepared](ConstitutiveLaw::prepare) for the step, [`ConstitutiveLaw::prepared_len`] numbers.
    pub prepared: &'a [f64],
}

/// An element when a step begins.
#[derive(Clone, Copy, Debug)]
pub struct StepStart<'a> {
    /// As in a [`MaterialPoint`].
    pub elasticity: &'a Matrix6<f64>,
    /// As in a [`MaterialPoint`].
    pub moduli: &'a [f64],
    /// As in a [`MaterialPoint`].
    pub state: &'a [f64],
    /// As in a [`MaterialPoint`].
    pub step_s: f64,
}

/// One half of a bisected tetrahedron that merges.
#[derive(Clone, Copy, Debug)]
pub struct LawHalf<'a> {
    /// Its elasticity D, Pa.
    pub elasticity: &'a Matrix6<f64>,
    /// Its volume, m³.
    pub volume: f64,
    /// Its state.
    pub state: &'a [f64],
}

/// How stress follows from strain, in the co-rotated frame of each element.
///
/// The matrix whose inverse is kept holds [`stiffening`](Self::stiffening) · D; what a law has
/// beyond that only costs iterations. States begin at zero, the body at rest.
///
/// A law of one's own, Maxwell's (all stress relaxes with time τ):
/// ```
/// use nalgebra::Matrix6;
/// use yawara_corot::{ConstitutiveLaw, MaterialPoint};
/// use yawara_embed::{Strain, isotropic};
///
/// /// σ̇ = D ε̇ − σ/τ by implicit Euler: σ = (σₙ + D (ε − εₙ))/(1 + Δt/τ), state (σₙ, εₙ).
/// struct Maxwell(f64);
///
/// impl ConstitutiveLaw for Maxwell {
///     fn name(&self) -> &str {
///         "maxwell"
///     }
///     fn state_len(&self) -> usize {
///         12
///     }
///     fn stress(&self, point: &MaterialPoint<'_>, trial: &mut [f64]) -> Strain {
///         let [stress, strain] = [0, 6].map(|at| Strain::from_column_slice(&point.state[at..at + 6]));
///         let stress = self.stiffening(point.step_s)
///             * (stress + point.elasticity * (point.strain - strain));
///         trial[..6].copy_from_slice(stress.as_slice());
///         trial[6..].copy_from_slice(point.strain.as_slice());
///         stress
///     }
///     fn tangent(&self, point: &MaterialPoint<'_>) -> Matrix6<f64> {
///         self.stiffening(point.step_s) * point.elasticity
///     }
///     fn stiffening(&self, step_s: f64) -> f64 {
///         1.0 / (1.0 + step_s / self.0)
///     }
/// }
///
/// let (elasticity, strain) = (isotropic(1e3, 0.3), Strain::new(0.01, 0.0, 0.0, 0.0, 0.0, 0.0));
/// let mut state = [0.0; 12];
/// for _ in 0..1000 {
///     let committed = state;
///     let point = MaterialPoint {
///         elasticity: &elasticity,
///         moduli: &[],
///         strain,
///         pressure: None,
///         state: &committed,
///         step_s: 0.1,
///         prepared: &[],
///     };
///     Maxwell(1.0).stress(&point, &mut state);
/// }
/// assert!(state[0].abs() < 1e-12, "held long enough, nothing is left");
/// ```
pub trait ConstitutiveLaw: Send + Sync {
    /// The scene name.
    fn name(&self) -> &str;

    /// Numbers of state per element.
    fn state_len(&self) -> usize;

    /// The stress σ at the end of the step, Pa; writes the state that the element would then have
    /// to `trial`. Called once per element in every evaluation of forces.
    fn stress(&self, point: &MaterialPoint<'_>, trial: &mut [f64]) -> Strain;

    /// ∂σ/∂ε̃ at the end of the step, Pa, with the pressure as it is where the point has one.
    fn tangent(&self, point: &MaterialPoint<'_>) -> Matrix6<f64>;

    /// What it stores, J/m³, where that is not ½ σ·ε. With the pressure p of a point ½ p times the growth stands
    /// for what the change of volume stores.
    fn energy(&self, _point: &MaterialPoint<'_>) -> Option<f64> {
        None
    }

    /// The factor of D in the matrix whose inverse is kept, for steps of `step_s`; > 0.
    fn stiffening(&self, step_s: f64) -> f64;

    /// Whether σ = D ε̃ always: then the vector kernels do all of it and nothing else here is asked.
    fn is_linear(&self) -> bool {
        false
    }

    /// The same law for eight elements at once, if it has no states and says so; only worth having where steps take too
    /// long.
    fn packets(&self) -> Option<&dyn PacketLaw> {
        None
    }

    /// By how much an element has grown, as part of its volume, with its derivative by ε, for a law that does not
    /// take tr ε for it. In an element with pressures its mean stress is then κ times this growth, and the law finds
    /// the pressure in its point.
    fn growth(&self, _strain: &Strain) -> Option<(f64, Strain)> {
        None
    }

    /// How many numbers it derives from an element's D once for all.
    fn moduli_len(&self) -> usize {
        0
    }

    /// Sets these numbers, from D and from what else the element [is made of](crate::Body::insert_made_of).
    fn set_moduli(&self, _elasticity: &Matrix6<f64>, _made_of: &[f64], _moduli: &mut [f64]) {}

    /// How many numbers it derives from an element's state once for all evaluations of a step.
    fn prepared_len(&self) -> usize {
        0
    }

    /// Sets these numbers.
    fn prepare(&self, _start: &StepStart<'_>, _prepared: &mut [f64]) {}

    /// Completes the state at the end of a step, which [`stress`](Self::stress) has begun at the strain there:
    /// for what no evaluation of forces needs.
    fn finish(&self, _start: &StepStart<'_>, _trial: &mut [f64]) {}

    /// What a material in this state has turned into heat so far, J/m³, if the law keeps count.
    fn dissipated(&self, _state: &[f64]) -> Option<f64> {
        None
    }

    /// The equivalent plastic strain of this state, if strain can stay.
    fn plastic_strain(&self, _state: &[f64]) -> Option<f64> {
        None
    }

    /// The state of a half of a tetrahedron that splits: a copy.
    fn split(&self, parent: &[f64], half: &mut [f64]) {
        half.copy_from_slice(parent);
    }

    /// The state of a tetrahedron whose halves merge: their mean by volume.
    fn merge(&self, halves: &[LawHalf<'_>; 2], parent: &mut [f64]) {
        let total = halves[0].volume + halves[1].volume;
        for (i, value) in parent.iter_mut().enumerate() {
            *value = halves.iter().map(|half| half.volume * half.state[i]).sum::<f64>() / total;
        }
    }
}

impl LawHalf<'_> {
    /// (Σ V D)⁻¹ Σ V D ε of the strains that the states of two halves hold from `at` on: the strain
    /// of the whole that has their mean stress. Not a number where an elasticity is not positive
    /// definite.
    pub fn mean_strain(halves: &[Self; 2], at: usize) -> Strain {
        let (mut stiffness, mut stress) = (Matrix6::zeros(), Strain::zeros());
        for half in halves {
            let scaled = half.elasticity * half.volume;
            stress += scaled * Strain::from_column_slice(&half.state[at..at + 6]);
            stiffness += scaled;
        }
        stiffness.cholesky().map_or(Strain::repeat(f64::NAN), |factor| factor.solve(&stress))
    }
}
