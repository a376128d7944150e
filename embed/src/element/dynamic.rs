//! An element in a time step: its stiffness, mass and damping in one matrix.

use faer::{Mat, Scale};
use nalgebra::Matrix6;

use super::formulation::ElementFormulation;
use super::mass::{Mass, add_block};
use crate::error::EmbedError;
use crate::hand_over::{Halved, RingPart};
use crate::linear_tet::LinearTet;

/// The weights of an element's mass and stiffness in a time step: the effective matrix is s K + c M.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepWeights {
    /// How mass lies on the corners.
    pub mass: Mass,
    /// c, 1/s²: of the time integrator.
    pub mass_per_s2: f64,
    /// s: of the constitutive law, 1 for linear elasticity.
    pub stiffness: f64,
}

impl StepWeights {
    /// With c ≥ 0 and s > 0.
    ///
    /// # Errors
    /// [`EmbedError::Range`] for other values, NaN and infinity among them.
    pub fn new(mass: Mass, mass_per_s2: f64, stiffness: f64) -> Result<Self, EmbedError> {
        let refuse = |what, value, want| Err(EmbedError::Range { what, value, want });
        if !(mass_per_s2 >= 0.0 && mass_per_s2.is_finite()) {
            return refuse("the weight of the mass, 1/s²,", mass_per_s2, "a finite number >= 0");
        }
        if !(stiffness > 0.0 && stiffness.is_finite()) {
            return refuse("the weight of the stiffness", stiffness, "a finite number > 0");
        }
        Ok(Self { mass, mass_per_s2, stiffness })
    }
}

/// An element with its mass: s K + c M, M on the displacements alone. Under damping by stiffness
/// pressures are damped as all stress is, so that s multiplies the whole matrix of `p1p1`.
///
/// With [`Mass::Consistent`] a split changes the matrix by the rank of the element alone where
/// densities do not differ. Where they do, the homogenised parent has the mean of its halves and
/// their mass leans to one end of the edge: that adds three columns of either sign for the whole
/// ring. [`Mass::Lumped`] adds −(ρV/16) c (e_a − e_b)(e_a − e_b)ᵀ: three negative ones,
/// and as many positive where densities differ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dynamic<E> {
    /// The element without mass.
    pub element: E,
    /// The step.
    pub weights: StepWeights,
}

impl<E: ElementFormulation> ElementFormulation for Dynamic<E> {
    fn name(&self) -> &'static str {
        self.element.name()
    }

    fn unknowns(&self) -> usize {
        self.element.unknowns()
    }

    fn negative(&self) -> usize {
        self.element.negative()
    }

    fn stiffness(&self, geometry: &LinearTet, elasticity: &Matrix6<f64>) -> Mat<f64> {
        self.element.stiffness(geometry, elasticity)
    }

    fn matrix(&self, geometry: &LinearTet, elasticity: &Matrix6<f64>, density: f64) -> Mat<f64> {
        let StepWeights { mass, mass_per_s2, stiffness } = self.weights;
        let mut k = self.stiffness(geometry, elasticity);
        k *= Scale(stiffness);
        add_block(&mut k, &mass.matrix(geometry.volume * density), mass_per_s2);
        k
    }

    fn part(&self, halved: &Halved) -> RingPart {
        let StepWeights { mass, mass_per_s2, stiffness } = self.weights;
        let mut part = self.element.part(halved).scaled(stiffness);
        mass.add_to(&mut part, halved, mass_per_s2);
        part
    }
}
