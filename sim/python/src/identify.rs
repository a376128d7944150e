//! Moduli from measurements, and what a skin feels like.

use pyo3::prelude::*;
use pythonize::pythonize;
use yawara::feel::Options as FeelOptions;
use yawara::identify::{Measured, Measurement, Options};

use crate::error::{of_simulation, refused};
use crate::simulation::body;

/// A measurement: time (s), where the point rests (scanner RAS, mm) or the tool, values by scanner axis (mm or N), the
/// standard deviation of their noise.
type Row = (f64, Option<[f64; 3]>, Option<usize>, [Option<f64>; 3], Option<f64>);

/// Finds moduli; a dictionary as the JSON of `yawara identify`.
#[pyfunction]
#[pyo3(signature = (scene, settings, measured, entries, prior_factor, *, labels=None, affine=None))]
#[allow(clippy::too_many_arguments)]
pub fn identify<'py>(
    py: Python<'py>,
    scene: &Bound<'py, PyAny>,
    settings: &Bound<'py, PyAny>,
    measured: Vec<Row>,
    entries: Vec<usize>,
    prior_factor: f64,
    labels: Option<&Bound<'py, PyAny>>,
    affine: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (scene, volume) = body(scene, settings, labels, affine)?;
    let of = |(number, row): (usize, Row)| {
        let (time_s, rest_mm, tool, values, sd) = row;
        let place = format!("measured[{number}]");
        let of = match (rest_mm, tool) {
            (Some(rest_mm), None) => Measured::Move(rest_mm),
            (None, Some(tool)) => Measured::Force(tool),
            _ => return Err(refused(format!("{place}: want either a point or a tool"))),
        };
        Ok(Measurement { time_s, of, values, sd, place })
    };
    let measured = measured.into_iter().enumerate().map(of).collect::<PyResult<Vec<_>>>()?;
    let options = Options { entries, prior_factor, ..Options::default() };
    let found = py.detach(|| {
        yawara::identify::identify(&scene, volume.as_ref(), &measured, &options, &mut |_, _| {})
    });
    pythonize(py, &found.map_err(of_simulation)?).map_err(refused)
}

/// Feels a skin; a dictionary as the JSON of `yawara feel`.
#[pyfunction]
#[pyo3(signature = (scene, settings, points, radius_mm, nodule, *, labels=None, affine=None))]
#[allow(clippy::too_many_arguments)]
pub fn feel<'py>(
    py: Python<'py>,
    scene: &Bound<'py, PyAny>,
    settings: &Bound<'py, PyAny>,
    points: usize,
    radius_mm: f64,
    nodule: Option<[usize; 2]>,
    labels: Option<&Bound<'py, PyAny>>,
    affine: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (scene, volume) = body(scene, settings, labels, affine)?;
    let options = FeelOptions { points, radius_mm, nodule, ..FeelOptions::default() };
    let skin = py.detach(|| yawara::feel::feel(&scene, volume.as_ref(), &options));
    pythonize(py, &skin.map_err(of_simulation)?).map_err(refused)
}
