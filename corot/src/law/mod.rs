//! How stress follows from strain: the swappable stage [`ConstitutiveLaw`].
//!
//! `linear.rs` is σ = D ε, which the vector kernels do by themselves; `rayleigh.rs` adds damping by
//! stiffness and is the model of a law with a state; `neo_hookean.rs` is for strains of any size; `inelastic.rs` is for
//! materials that remember, each element by what it is made of: moduli that relax (`prony.rs`) and strain that
//! stays (`flow.rs`, as `plastic.rs` or `creep.rs`). `states.rs` keeps the states of a body's
//! elements and adds to the forces what a law has beyond D ε; one that answers for eight elements at once
//! (`packet_law.rs`) is asked by the vector kernels instead. Open `constitutive_law.rs` first. To
//! add one: a file with a type that implements the trait, a line in [`law_by_name`].

mod constitutive_law;
mod creep;
mod flow;
mod inelastic;
mod linear;
mod neo_hookean;
mod packet_law;
mod plastic;
mod prony;
mod rayleigh;
pub(crate) mod states;

pub use constitutive_law::{ConstitutiveLaw, LawHalf, MaterialPoint, StepStart};
pub use creep::Creep;
pub use flow::Flow;
pub use inelastic::{Inelastic, InelasticMaterial};
pub use linear::LinearElastic;
pub use neo_hookean::NeoHookean;
pub use packet_law::{Lanes, PacketLaw, PointPacket};
pub use plastic::Plastic;
pub use prony::{Prony, PronyTerm, Relaxing};
pub use rayleigh::Rayleigh;

use crate::error::CorotError;

/// Scene names of the built-in laws.
pub const LAWS: &[&str] = &["linear", "rayleigh", "neo_hookean"];

/// A built-in law; `damping_stiffness_s` is β of `rayleigh`, s.
///
/// # Errors
/// [`CorotError::Unknown`] listing the choices; [`CorotError::Range`] for β.
pub fn law_by_name(
    name: &str,
    damping_stiffness_s: f64,
) -> Result<Box<dyn ConstitutiveLaw>, CorotError> {
    match name {
        "linear" => Ok(Box::new(LinearElastic)),
        "rayleigh" => Ok(Box::new(Rayleigh::new(damping_stiffness_s)?)),
        "neo_hookean" => Ok(Box::new(NeoHookean)),
        _ => {
            Err(CorotError::Unknown { what: "constitutive law", name: name.into(), choices: LAWS })
        }
    }
}
