//! Strain that stays: what an element does beyond its yield.

use super::creep::Creep;
use super::plastic::Plastic;

/// How strain that stays comes to be.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Flow {
    /// It does not.
    #[default]
    None,
    /// By the stress: J2 plasticity.
    Plastic(Plastic),
    /// By the strain, at a rate.
    Creep(Creep),
}

/// Numbers that stand for a flow.
pub(super) const FLOW_LEN: usize = 4;

impl Flow {
    pub(super) fn numbers(&self) -> [f64; FLOW_LEN] {
        match *self {
            Self::None => [0.0; FLOW_LEN],
            Self::Plastic(Plastic { yield_pa, hardening_pa }) => [1.0, yield_pa, hardening_pa, 0.0],
            Self::Creep(Creep { yield_strain, rate_per_s, max_strain }) => {
                [2.0, yield_strain, rate_per_s, max_strain]
            }
        }
    }

    pub(super) fn of_numbers(numbers: &[f64]) -> Self {
        let [kind, a, b, c] = [0, 1, 2, 3].map(|i| numbers[i]);
        match kind as u8 {
            1 => Self::Plastic(Plastic { yield_pa: a, hardening_pa: b }),
            2 => Self::Creep(Creep { yield_strain: a, rate_per_s: b, max_strain: c }),
            _ => Self::None,
        }
    }
}
