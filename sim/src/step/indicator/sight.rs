//! What an indicator that looks at the whole body sees and says.

use nalgebra::Vector3;
use yawara_corot::Loads;

use crate::body::BodyState;

/// A body in equilibrium, as an indicator sees all of it.
pub struct Sight<'a> {
    /// The body.
    pub body: &'a BodyState,
    /// What holds it and pushes it. What else acts is spread over elements: weight,
    /// inertia, loads that tools name by vertex.
    pub loads: &'a Loads,
    /// Figures of interest: the scene's goal, then forces of tools.
    pub duals: &'a [Dual],
}

/// A figure J of a body in equilibrium, and the field z by which what is out of balance becomes an error
/// of J: its residual r on a function of a finer mesh counts r(z).
///
/// Of a force of a tool z is how the body moves when the tool does, of any other figure what the body
/// answers to the figure's gradient as a load. Source: Becker and Rannacher, Acta Numerica 10, 2001.
pub struct Dual {
    /// J: N, m or m³.
    pub value: f64,
    /// z by vertex number, m per unit of J's conjugate.
    pub field: Vec<Vector3<f64>>,
    /// The pressures q that belong to it, by vertex number; empty without pressures.
    pub pressures: Vec<f64>,
    /// What holds z and pushes it.
    pub loads: Loads,
}

/// What an indicator says of all elements.
#[derive(Clone, Debug)]
pub struct Measured {
    /// By element, in the order of [`BodyState::elements`].
    pub values: Vec<f64>,
    /// What the body stores where it is, J, if that was seen on the way.
    pub stored_j: Option<f64>,
    /// How much more energy the body has than on a mesh without end, J.
    pub energy_error: Option<f64>,
    /// How far the figure of each of [`Sight::duals`] is from that on a mesh without end, in its unit.
    pub errors: Vec<f64>,
}

impl From<Vec<f64>> for Measured {
    fn from(values: Vec<f64>) -> Self {
        Self { values, stored_j: None, energy_error: None, errors: Vec::new() }
    }
}
