//! Rotations, co-rotational forces and equilibrium solvers.
//!
//! Linear elasticity in a frame that turns with the material: each element (or vertex) has a
//! rotation R, and forces come from the strain of Rᵀx − X. Two stages are swappable: how forces
//! follow from positions ([`InternalForces`]) and how positions are found at which they balance the
//! loads ([`Equilibrium`]). The inverse stiffness enters as a function; this crate knows no
//! maintainer of it.
#![forbid(unsafe_code)]

mod body;
mod contact;
mod element;
mod equilibrium;
mod error;
mod field;
mod forces;
mod grip;
mod kernels;
mod law;
mod time;
mod vectors;

pub use body::{Body, LawState};
pub use contact::{Contact, ContactOutcome, Obstacle, Pushes, Sphere, solve_with_contact};
pub use element::{EDGES, Element, ElementPoint, locate, rotation};
pub use equilibrium::{
    Anderson, Attached, Direct, Disturbance, EQUILIBRIA, Equilibrium, Fallback, Following, Inverse,
    Iterate, Iteration, Lbfgs, Newton, Outcome, Problem, ResidualNewton, Tolerance, check_mixed,
    check_pair, equilibrium_by_name, reply_by_two,
};
pub use error::CorotError;
pub use field::Field;
pub use forces::{
    ElementCorotation, ElementReference, ElementTangent, FORCES, InternalForces, MassSpring,
    NoCorotation, PaperCorotation, RowCorotation, TangentOf, element_tangent, forces_by_name,
};
pub use grip::{Constraints, EdgeLoad, Grip, Loads, Responses, WeightedPoint};
pub use kernels::element::StiffnessPacket;
pub use law::{
    ConstitutiveLaw, Creep, Flow, Inelastic, InelasticMaterial, LAWS, Lanes, LawHalf,
    LinearElastic, MaterialPoint, NeoHookean, PacketLaw, Plastic, PointPacket, Prony, PronyTerm,
    Rayleigh, Relaxing, StepStart, law_by_name,
};
pub use time::{
    INTEGRATORS, ImplicitEuler, Inertia, Newmark, QuasiStatic, TimeIntegrator, TimeStep,
    VertexMotion, forces_with_inertia, integrator_by_name,
};
