//! Rotations, co-rotational forces and equilibrium solvers.
//!
//! Linear elasticity in a frame that turns with the material: each element (or vertex) has a
//! rotation R, and forces come from the strain of Rᵀx − X. Two stages are swappable: how forces
//! follow from positions ([`Corotation`]) and how positions are found at which they balance the
//! loads ([`Equilibrium`]). The inverse stiffness enters as a function; this crate knows no
//! maintainer of it.
#![forbid(unsafe_code)]

mod anderson;
mod body;
mod contact;
mod direct;
mod element_corotation;
mod element_kernel;
mod element_reference;
mod equilibrium;
mod error;
mod fallback;
mod gauss_seidel;
mod implicit_euler;
mod lanes;
mod lbfgs;
mod line_search;
mod mixed;
mod newton;
mod no_corotation;
mod obstacle;
mod packet_rotation;
mod packets;
mod paper_corotation;
mod point;
pub mod rotation;
mod row_corotation;
mod stress;
mod sums;
mod tangent;
mod vectors;
mod vertex_kernel;

pub use anderson::Anderson;
pub use body::{Body, Element};
pub use contact::{Contact, ContactOutcome, SurfacePoint, solve_with_contact};
pub use direct::Direct;
pub use element_corotation::ElementCorotation;
pub use element_kernel::StiffnessPacket;
pub use element_reference::ElementReference;
pub use equilibrium::{Equilibrium, Iterate, Outcome, Problem, Tolerance};
pub use error::CorotError;
pub use fallback::Fallback;
pub use implicit_euler::{EulerStep, ImplicitEuler};
pub use lbfgs::Lbfgs;
pub use newton::Newton;
pub use no_corotation::NoCorotation;
pub use obstacle::{Obstacle, Sphere};
pub use paper_corotation::PaperCorotation;
pub use row_corotation::RowCorotation;
pub use tangent::{ElementTangent, element_tangent};

use nalgebra::Vector3;
use yawara_embed::LinearTet;

/// How internal forces follow from positions.
pub trait Corotation: Send + Sync {
    /// The scene name.
    fn name(&self) -> &'static str;

    /// Adds nothing, overwrites `forces` with f_int(x) (N, one per vertex number) and renews the
    /// rotations of `body`. Returns √Σ_e ‖f_e‖², the scale against which residuals are measured.
    ///
    /// Cost: O(elements).
    fn internal_forces(
        &self,
        body: &mut Body,
        positions: &[Vector3<f64>],
        forces: &mut [Vector3<f64>],
    ) -> f64;

    /// ∂f_int/∂x of one element at its stored rotation, if there is such a thing. N/m.
    fn tangent(&self, element: &Element, positions: &[Vector3<f64>]) -> Option<ElementTangent> {
        let _ = (element, positions);
        None
    }

    /// Whether it reads the pressures of a [mixed](Body::mixed) body; without it they stay out of
    /// its forces.
    fn carries_pressures(&self) -> bool {
        false
    }

    /// A bound on the entries of ∂f_int/∂x, N/m: what rounding of positions does to forces goes
    /// with it.
    fn stiffness_scale(&self, body: &Body) -> f64 {
        body.stiffness_scale()
    }
}

/// Scene names of the built-in co-rotations.
pub const COROTATIONS: &[&str] = &["element", "element_reference", "row", "paper", "none"];

/// Scene names of the built-in equilibrium solvers.
pub const EQUILIBRIA: &[&str] =
    &["fallback", "fallback_newton", "anderson", "lbfgs", "direct", "newton"];

/// A built-in co-rotation.
///
/// # Errors
/// [`CorotError::Unknown`] listing the choices.
pub fn corotation_by_name(name: &str) -> Result<Box<dyn Corotation>, CorotError> {
    match name {
        "element" => Ok(Box::new(ElementCorotation)),
        "element_reference" => Ok(Box::new(ElementReference)),
        "row" => Ok(Box::new(RowCorotation)),
        "paper" => Ok(Box::new(PaperCorotation)),
        "none" => Ok(Box::new(NoCorotation)),
        _ => Err(CorotError::Unknown {
            what: "co-rotation",
            name: name.into(),
            choices: COROTATIONS,
        }),
    }
}

/// A built-in equilibrium solver.
///
/// # Errors
/// [`CorotError::Unknown`] listing the choices.
pub fn equilibrium_by_name(name: &str) -> Result<Box<dyn Equilibrium>, CorotError> {
    match name {
        "anderson" => Ok(Box::new(Anderson::default())),
        "lbfgs" => Ok(Box::new(Lbfgs::default())),
        "direct" => Ok(Box::new(Direct)),
        "newton" => Ok(Box::new(Newton)),
        "fallback" => Ok(Box::new(Fallback::new(
            "fallback",
            vec![Box::new(Anderson::default()), Box::new(Lbfgs::default())],
        ))),
        "fallback_newton" => Ok(Box::new(Fallback::new(
            "fallback_newton",
            vec![Box::new(Anderson::default()), Box::new(Lbfgs::default()), Box::new(Newton)],
        ))),
        _ => Err(CorotError::Unknown {
            what: "equilibrium solver",
            name: name.into(),
            choices: EQUILIBRIA,
        }),
    }
}

/// Whether these two work together.
///
/// # Errors
/// [`CorotError::NoTangent`] if the solver needs the tangent of a co-rotation that has none.
pub fn check_pair(
    corotation: &dyn Corotation,
    equilibrium: &dyn Equilibrium,
) -> Result<(), CorotError> {
    let geometry = LinearTet { gradients: [Vector3::zeros(); 4], volume: 0.0 };
    let element = Element {
        tet: yawara_mesh::TetId(0),
        vertices: [0; 4],
        geometry,
        elasticity: nalgebra::Matrix6::zeros(),
        rotation: nalgebra::Matrix3::identity(),
    };
    let has_tangent = corotation.tangent(&element, &[Vector3::zeros()]).is_some();
    if equilibrium.needs_tangent() && !has_tangent {
        let (corotation, equilibrium) = (corotation.name(), equilibrium.name());
        return Err(CorotError::NoTangent { corotation, equilibrium });
    }
    Ok(())
}

/// Whether these two work on a [mixed](Body::mixed) body.
///
/// # Errors
/// [`CorotError::NoPressures`] naming the stage that does not.
pub fn check_mixed(
    corotation: &dyn Corotation,
    equilibrium: &dyn Equilibrium,
) -> Result<(), CorotError> {
    let refused = |stage, name, choices| Err(CorotError::NoPressures { stage, name, choices });
    if !corotation.carries_pressures() {
        return refused("corotation", corotation.name(), "element, none");
    }
    if equilibrium.needs_definite() {
        return refused("equilibrium", equilibrium.name(), "fallback, anderson, direct");
    }
    Ok(())
}
