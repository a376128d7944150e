//! A tool that is written in Python.

use nalgebra::Vector3;
use pyo3::prelude::*;
use yawara::{BodyAtRest, BodyState, ScannerAxes, SimError, SurfacePoints, Tool};
use yawara_corot::Sphere;

use crate::arrays::{rows, to_array, to_rows, to_scanner, to_solver};
use crate::error::refused;
use crate::raised::Raised;
use crate::stages::lasting_name;

/// `loads(time_s, rest, positions)` and `ball(time_s)` of an object, whichever it has.
pub struct PyTool {
    object: Py<PyAny>,
    kind: &'static str,
    /// How far the surface's points lie apart, m, for one with a ball.
    spacing_m: Option<f64>,
    has_loads: bool,
    points: Option<SurfacePoints>,
    axes: ScannerAxes,
    /// At rest, scanner axes, m.
    reference: [f64; 3],
    raised: Raised,
}

impl PyTool {
    /// Not placed yet.
    pub fn new(object: &Bound<'_, PyAny>, raised: &Raised) -> PyResult<Self> {
        let (has_ball, has_loads) = (object.hasattr("ball")?, object.hasattr("loads")?);
        let kind = lasting_name(object)?;
        if !has_ball && !has_loads {
            return Err(refused(format!(
                "tool {kind} has neither `loads` nor `ball`: it does nothing"
            )));
        }
        let spacing_m = match has_ball {
            true => match object.getattr_opt("spacing_m")? {
                Some(spacing) => Some(spacing.extract()?),
                None => {
                    let want =
                        "has a ball and no `spacing_m`, how far apart the surface's points are";
                    return Err(refused(format!("tool {kind} {want}")));
                }
            },
            false => None,
        };
        let reference = match object.getattr_opt("reference")? {
            Some(reference) => to_array("reference", &reference)?,
            None => [0.0; 3],
        };
        Ok(Self {
            object: object.clone().unbind(),
            kind,
            spacing_m,
            has_loads,
            points: None,
            axes: ScannerAxes::identity(),
            reference,
            raised: raised.clone(),
        })
    }

    /// The same on a body.
    pub fn place(mut self, body: &mut BodyAtRest<'_>) -> Result<Self, SimError> {
        self.axes = body.axes();
        self.points = self.spacing_m.map(|spacing| body.surface_points(spacing)).transpose()?;
        Ok(self)
    }

    fn ball(&self, t: f64) -> Option<Sphere> {
        self.spacing_m?;
        self.raised.call(None, |py| {
            let answer = self.object.bind(py).call_method1("ball", (t,))?;
            let ball: Option<(Bound<'_, PyAny>, f64)> = answer.extract()?;
            let Some((centre, radius)) = ball else { return Ok(None) };
            let centre = to_solver(self.axes, to_array("the centre of ball", &centre)?);
            Ok(Some(Sphere { centre, radius }))
        })
    }
}

impl Tool for PyTool {
    fn kind(&self) -> &'static str {
        self.kind
    }

    fn reference(&self, t: f64) -> Vector3<f64> {
        self.ball(t).map_or_else(|| to_solver(self.axes, self.reference), |ball| ball.centre)
    }

    fn obstacle(&self, t: f64) -> Option<Sphere> {
        self.ball(t)
    }

    fn surface_points(&self) -> Option<&SurfacePoints> {
        self.points.as_ref()
    }

    fn surface_points_mut(&mut self) -> Option<&mut SurfacePoints> {
        self.points.as_mut()
    }

    fn resurface(
        &mut self,
        points: &mut dyn FnMut(f64) -> Result<SurfacePoints, SimError>,
    ) -> Result<(), SimError> {
        if let Some(spacing) = self.spacing_m {
            self.points = Some(points(spacing)?);
        }
        Ok(())
    }

    fn add_loads(&self, body: &BodyState, t: f64, loads: &mut [Vector3<f64>]) {
        if !self.has_loads {
            return;
        }
        let vertices: Vec<usize> = body.vertices().map(|v| v.index()).collect();
        let axes = self.axes;
        let of = |x: &[Vector3<f64>]| -> Vec<[f64; 3]> {
            vertices.iter().map(|&v| to_scanner(axes, &x[v])).collect()
        };
        let forces = self.raised.call(Vec::new(), |py| {
            let at = (t, rows(py, &of(body.rest_positions())), rows(py, &of(body.positions())));
            let forces = self.object.bind(py).call_method1("loads", at)?;
            let forces = to_rows("the forces of loads", &forces, 3)?;
            match forces.len() == 3 * vertices.len() {
                true => Ok(forces),
                false => {
                    let (got, want) = (forces.len() / 3, vertices.len());
                    Err(refused(format!("loads gives {got} forces, want {want}: one per vertex")))
                }
            }
        });
        for (&v, force) in vertices.iter().zip(forces.chunks_exact(3)) {
            loads[v] += axes.to_solver_direction(&Vector3::from_column_slice(force));
        }
    }
}
