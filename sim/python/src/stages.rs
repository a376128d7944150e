//! Stages that are written in Python.

use nalgebra::{Matrix6, SMatrix};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use yawara::indicator::{Indicator, RingMember};
use yawara_corot::{ConstitutiveLaw, MaterialPoint};
use yawara_embed::{ChildPair, Excess, Homogenisation, ParentMaterial, Strain};

use crate::arrays::{matrices, matrix, rows, to_array, to_rows, vector};
use crate::error::refused;
use crate::raised::Raised;

/// The name of a stage: its attribute `name`, or that of its class.
fn name_of(object: &Bound<'_, PyAny>) -> PyResult<String> {
    match object.getattr_opt("name")? {
        Some(name) => name.extract(),
        None => Ok(object.get_type().name()?.to_string()),
    }
}

/// A name that lasts as long as the program: stages are few.
pub fn lasting_name(object: &Bound<'_, PyAny>) -> PyResult<&'static str> {
    Ok(name_of(object)?.leak())
}

/// A 6 × 6 matrix.
fn to_matrix6(what: &str, array: &Bound<'_, PyAny>) -> PyResult<Matrix6<f64>> {
    let values = to_rows(what, array, 6)?;
    match values.len() {
        36 => Ok(Matrix6::from_row_slice(&values)),
        other => Err(refused(format!("{what} has {} rows, want 6", other / 6))),
    }
}

/// `combine(elasticity, gradients)` of an object.
pub struct PyHomogenisation {
    object: Py<PyAny>,
    name: String,
    raised: Raised,
}

impl PyHomogenisation {
    pub fn new(object: &Bound<'_, PyAny>, raised: &Raised) -> PyResult<Self> {
        let name = name_of(object)?;
        Ok(Self { object: object.clone().unbind(), name, raised: raised.clone() })
    }

    fn ask(&self, py: Python<'_>, pair: &ChildPair) -> PyResult<ParentMaterial> {
        let elasticity = matrices(py, (2, 6, 6), |half, i, j| pair.elasticity[half][(i, j)]);
        let gradients = matrix(py, (2, 3), |half, i| pair.midpoint_gradients[half][i]);
        let answer = self.object.bind(py).call_method1("combine", (elasticity, gradients))?;
        let (elasticity, midpoint) = match answer.cast::<PyTuple>() {
            Ok(pair) if pair.len() == 2 => {
                let midpoint = to_rows("the midpoint of combine", &pair.get_item(1)?, 6)?;
                if midpoint.len() != 18 {
                    let rows = midpoint.len() / 6;
                    return Err(refused(format!(
                        "the midpoint of combine has {rows} rows, want 3"
                    )));
                }
                (pair.get_item(0)?, SMatrix::from_row_slice(&midpoint))
            }
            _ => (answer, SMatrix::zeros()),
        };
        let elasticity = to_matrix6("the elasticity of combine", &elasticity)?;
        Ok(ParentMaterial { elasticity, midpoint, excess: Excess::Unfactored })
    }
}

impl Homogenisation for PyHomogenisation {
    fn name(&self) -> &str {
        &self.name
    }

    fn combine(&self, pair: &ChildPair) -> ParentMaterial {
        let mean = ParentMaterial::uniform(pair.mean_elasticity());
        self.raised.call(mean, |py| self.ask(py, pair))
    }
}

/// `measure(strain, volume_m3, elasticity, edge_m)` of an object.
pub struct PyIndicator {
    object: Py<PyAny>,
    name: &'static str,
    unit: &'static str,
    raised: Raised,
}

impl PyIndicator {
    pub fn new(object: &Bound<'_, PyAny>, raised: &Raised) -> PyResult<Self> {
        let unit = match object.getattr_opt("unit")? {
            Some(unit) => unit.extract::<String>()?.leak(),
            None => "1",
        };
        let name = lasting_name(object)?;
        Ok(Self { object: object.clone().unbind(), name, unit, raised: raised.clone() })
    }
}

impl Indicator for PyIndicator {
    fn name(&self) -> &'static str {
        self.name
    }

    fn unit(&self) -> &'static str {
        self.unit
    }

    fn measure(&self, ring: &[RingMember]) -> f64 {
        let solid: Vec<&RingMember> = ring.iter().filter(|member| !member.is_void).collect();
        let Some(first) = solid.first() else { return 0.0 };
        self.raised.call(0.0, |py| {
            let strains: Vec<[f64; 6]> = solid.iter().map(|m| m.strain().into()).collect();
            let volumes = vector(py, solid.iter().map(|m| m.geometry.volume).collect());
            let elasticity = matrices(py, (solid.len(), 6, 6), |member, i, j| {
                solid[member].parent.elasticity[(i, j)]
            });
            let edge = vector(py, first.edge.as_slice().to_vec());
            let of_ring = (rows(py, &strains), volumes, elasticity, edge);
            self.object.bind(py).call_method1("measure", of_ring)?.extract()
        })
    }
}

/// `stress`, `tangent`, `stiffening` and, if it has it, `energy` of an object.
pub struct PyLaw {
    object: Py<PyAny>,
    name: String,
    state_len: usize,
    has_energy: bool,
    raised: Raised,
}

impl PyLaw {
    pub fn new(object: &Bound<'_, PyAny>, raised: &Raised) -> PyResult<Self> {
        let state_len = object.getattr_opt("state_len")?.map_or(Ok(0), |len| len.extract())?;
        let has_energy = object.hasattr("energy")?;
        let (name, raised) = (name_of(object)?, raised.clone());
        Ok(Self { object: object.clone().unbind(), name, state_len, has_energy, raised })
    }

    /// Calls a method with strain, elasticity, state and the length of the step.
    fn call<'py>(
        &self,
        py: Python<'py>,
        method: &str,
        point: &MaterialPoint<'_>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let strain = vector(py, point.strain.as_slice().to_vec());
        let elasticity = matrix(py, (6, 6), |i, j| point.elasticity[(i, j)]);
        let state = vector(py, point.state.to_vec());
        self.object.bind(py).call_method1(method, (strain, elasticity, state, point.step_s))
    }
}

impl ConstitutiveLaw for PyLaw {
    fn name(&self) -> &str {
        &self.name
    }

    fn state_len(&self) -> usize {
        self.state_len
    }

    fn stress(&self, point: &MaterialPoint<'_>, trial: &mut [f64]) -> Strain {
        self.raised.call(Strain::zeros(), |py| {
            let answer = self.call(py, "stress", point)?;
            let stress = match self.state_len {
                0 => answer,
                len => {
                    let (stress, state) =
                        answer.extract::<(Bound<'_, PyAny>, Bound<'_, PyAny>)>()?;
                    let state = crate::arrays::to_vec("the state of stress", &state, Some(len))?;
                    trial.copy_from_slice(&state);
                    stress
                }
            };
            Ok(Strain::from(to_array::<6>("the stress", &stress)?))
        })
    }

    fn tangent(&self, point: &MaterialPoint<'_>) -> Matrix6<f64> {
        self.raised.call(*point.elasticity, |py| {
            to_matrix6("the tangent", &self.call(py, "tangent", point)?)
        })
    }

    fn energy(&self, point: &MaterialPoint<'_>) -> Option<f64> {
        self.has_energy
            .then(|| self.raised.call(0.0, |py| self.call(py, "energy", point)?.extract()))
    }

    fn stiffening(&self, step_s: f64) -> f64 {
        self.raised.call(1.0, |py| match self.object.bind(py).getattr_opt("stiffening")? {
            Some(stiffening) => stiffening.call1((step_s,))?.extract(),
            None => Ok(1.0),
        })
    }
}
