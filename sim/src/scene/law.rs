//! The law of a material.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use yawara_corot::{CorotError, Creep, Flow, Plastic, Prony, PronyTerm, Relaxing};

/// How a material's stress follows from what has happened to it, by its `kind`; its Young's modulus is that of a
/// sudden strain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum LawEntry {
    /// It remembers nothing.
    Linear,
    /// Its stress relaxes: the generalised Maxwell solid.
    Prony {
        /// The terms, unless a power law gives them.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        terms: Vec<PronyEntry>,
        /// What terms are fitted to.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        power_law: Option<PowerLaw>,
        /// Which part of the stress relaxes.
        #[serde(default)]
        relaxing: RelaxingPart,
    },
    /// Strain stays beyond a yield stress: J2 plasticity with linear isotropic hardening.
    Plastic {
        /// Yield stress of a bar that is pulled, > 0, Pa.
        yield_pa: f64,
        /// By how much it grows with the equivalent plastic strain, ≥ 0, Pa.
        #[serde(default)]
        hardening_pa: f64,
    },
    /// Strain stays at a rate beyond a yield strain, after Müller and Gross.
    Creep {
        /// Size of the elastic strain up to which nothing stays, ≥ 0.
        yield_strain: f64,
        /// Part of the elastic strain that comes to stay, > 0, 1/s.
        rate_per_s: f64,
        /// The most that stays, > 0.
        max_strain: f64,
    },
}

/// One exponential of a relaxation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PronyEntry {
    /// Its part of the modulus of a sudden strain, 0 to 1; all parts together at most 1.
    pub fraction: f64,
    /// Its relaxation time, > 0, s.
    pub time_s: f64,
}

/// A modulus that falls with time to the power −`exponent`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PowerLaw {
    /// More than 0 and less than 1.
    pub exponent: f64,
    /// From when on it holds, > 0, s.
    pub from_s: f64,
    /// Until when, s.
    pub to_s: f64,
    /// How many terms, 1 to 32.
    pub terms: usize,
}

/// Which part of the stress relaxes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RelaxingPart {
    /// That of changes of shape.
    #[default]
    Deviator,
    /// All of it.
    Whole,
}

/// A law as it runs.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct MaterialLaw {
    pub prony: Prony,
    pub flow: Flow,
    /// The largest relative error of the terms that stand for a power law.
    pub fit_error: Option<f64>,
}

impl LawEntry {
    /// The scene name of its kind.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Prony { .. } => "prony",
            Self::Plastic { .. } => "plastic",
            Self::Creep { .. } => "creep",
        }
    }

    /// # Errors
    /// [`CorotError::Range`] for numbers of no law.
    pub(crate) fn law(&self) -> Result<MaterialLaw, CorotError> {
        let mut law = MaterialLaw::default();
        match self {
            Self::Linear => {}
            Self::Prony { terms, power_law, relaxing } => {
                let relaxing = match relaxing {
                    RelaxingPart::Deviator => Relaxing::Deviator,
                    RelaxingPart::Whole => Relaxing::Whole,
                };
                if let Some(PowerLaw { exponent, from_s, to_s, terms }) = *power_law {
                    let (prony, error) =
                        Prony::power_law(exponent, [from_s, to_s], terms, relaxing)?;
                    (law.prony, law.fit_error) = (prony, Some(error));
                } else {
                    let terms = terms.iter();
                    let terms = terms
                        .map(|&PronyEntry { fraction, time_s }| PronyTerm { fraction, time_s });
                    law.prony = Prony::new(terms.collect(), relaxing)?;
                }
            }
            Self::Plastic { yield_pa, hardening_pa } => {
                law.flow = Flow::Plastic(Plastic::new(*yield_pa, *hardening_pa)?);
            }
            Self::Creep { yield_strain, rate_per_s, max_strain } => {
                law.flow = Flow::Creep(Creep::new(*yield_strain, *rate_per_s, *max_strain)?);
            }
        }
        Ok(law)
    }
}
