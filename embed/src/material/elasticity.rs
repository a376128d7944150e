//! Linear elasticity: isotropic materials and general ones.

use nalgebra::Matrix6;

use crate::error::EmbedError;

/// A homogeneous isotropic material, checked once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    young_modulus_pa: f64,
    poisson_ratio: f64,
    density_kg_m3: f64,
}

impl Material {
    /// A material with E > 0 (Pa), −1 < ν < 0.5 and density ≥ 0 (kg/m³), all finite.
    ///
    /// # Errors
    /// [`EmbedError::Range`] naming the constant, its value and its range.
    pub fn new(
        young_modulus_pa: f64,
        poisson_ratio: f64,
        density_kg_m3: f64,
    ) -> Result<Self, EmbedError> {
        let refuse = |what, value, want| Err(EmbedError::Range { what, value, want });
        if !(young_modulus_pa > 0.0 && young_modulus_pa.is_finite()) {
            return refuse("young_modulus_pa", young_modulus_pa, "a finite number > 0");
        }
        if !(poisson_ratio > -1.0 && poisson_ratio < 0.5) {
            return refuse("poisson_ratio", poisson_ratio, "-1 < poisson_ratio < 0.5");
        }
        if !(density_kg_m3 >= 0.0 && density_kg_m3.is_finite()) {
            return refuse("density_kg_m3", density_kg_m3, "a finite number >= 0");
        }
        Ok(Self { young_modulus_pa, poisson_ratio, density_kg_m3 })
    }

    /// Young's modulus E, Pa.
    pub fn young_modulus_pa(&self) -> f64 {
        self.young_modulus_pa
    }

    /// Poisson's ratio ν.
    pub fn poisson_ratio(&self) -> f64 {
        self.poisson_ratio
    }

    /// Mass density, kg/m³.
    pub fn density_kg_m3(&self) -> f64 {
        self.density_kg_m3
    }

    /// The elasticity matrix D, Pa.
    pub fn elasticity(&self) -> Matrix6<f64> {
        isotropic(self.young_modulus_pa, self.poisson_ratio)
    }
}

/// A homogeneous material of any symmetry (fibres, say), checked once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FineMaterial {
    elasticity: Matrix6<f64>,
    density_kg_m3: f64,
}

/// Relative difference of mirrored entries up to which an elasticity matrix counts as symmetric.
const SYMMETRY: f64 = 1e-12;

impl FineMaterial {
    /// A material with elasticity matrix D (6×6, Pa, Voigt order xx yy zz xy yz zx, engineering
    /// shear) and density (kg/m³).
    ///
    /// # Errors
    /// [`EmbedError::NotFinite`]; [`EmbedError::Elasticity`] if D is not symmetric to 10⁻¹² of its
    /// largest entry or not positive definite; [`EmbedError::Range`] for the density.
    pub fn new(elasticity: Matrix6<f64>, density_kg_m3: f64) -> Result<Self, EmbedError> {
        if !(density_kg_m3 >= 0.0 && density_kg_m3.is_finite()) {
            let (what, want) = ("density_kg_m3", "a finite number >= 0");
            return Err(EmbedError::Range { what, value: density_kg_m3, want });
        }
        if let Some(at) = elasticity.iter().position(|d| !d.is_finite()) {
            let (row, column, value) = (at % 6, at / 6, elasticity[at]);
            let (matrix, want) = ("an elasticity matrix", "a finite number (Pa)");
            return Err(EmbedError::NotFinite { matrix, row, column, value, want });
        }
        let asymmetry = (elasticity - elasticity.transpose()).amax() / elasticity.amax();
        let symmetric = 0.5 * (elasticity + elasticity.transpose());
        if !(asymmetry <= SYMMETRY && symmetric.cholesky().is_some()) {
            let eigenvalue = symmetric.symmetric_eigenvalues().min();
            return Err(EmbedError::Elasticity { asymmetry, limit: SYMMETRY, eigenvalue });
        }
        Ok(Self { elasticity: symmetric, density_kg_m3 })
    }

    /// The elasticity matrix D, Pa.
    pub fn elasticity(&self) -> &Matrix6<f64> {
        &self.elasticity
    }

    /// Mass density, kg/m³.
    pub fn density_kg_m3(&self) -> f64 {
        self.density_kg_m3
    }
}

impl From<Material> for FineMaterial {
    fn from(material: Material) -> Self {
        Self { elasticity: material.elasticity(), density_kg_m3: material.density_kg_m3 }
    }
}

/// The isotropic elasticity matrix D = E(1−ν)/((1+ν)(1−2ν)) times 1 on the diagonal and
/// a = ν/(1−ν) beside it among the normal strains, b = (1−2ν)/(2(1−ν)) on the shears' diagonal.
///
/// Units: Pa, engineering shear strains. Source: Oishi et al., eq. (4), whose fourth diagonal
/// entry is misprinted as 1 where b must stand.
pub fn isotropic(young_modulus_pa: f64, poisson_ratio: f64) -> Matrix6<f64> {
    let nu = poisson_ratio;
    let scale = young_modulus_pa * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu));
    let a = nu / (1.0 - nu);
    let b = (1.0 - 2.0 * nu) / (2.0 * (1.0 - nu));
    Matrix6::from_fn(|i, j| {
        scale
            * match (i == j, i < 3 && j < 3) {
                (true, true) => 1.0,
                (false, true) => a,
                (true, false) => b,
                (false, false) => 0.0,
            }
    })
}
