//! A simulation from a scene, step by step.

use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};

use nalgebra::Vector3;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyMapping, PyString};
use pythonize::{depythonize, pythonize};
use yawara::report::{Frame, StepReport, ToolReport};
use yawara::scene::{Scene, ToolEntry, library};
use yawara::{Pose, SimError, Stages, scene_file};
use yawara_mesh::volume::LabelVolume;

use crate::arrays::{matrix, rows, to_rows, vector};
use crate::error::{of_simulation, refused};
use crate::inverse::{Blocks, blocks};
use crate::raised::Raised;
use crate::stages::{PyHomogenisation, PyIndicator, PyLaw};
use crate::tool::PyTool;
use crate::volume::label_volume;

/// Names and texts (TOML) of the built-in scenes.
#[pyfunction]
pub fn scenes() -> Vec<(&'static str, &'static str)> {
    scene_file::built_in().to_vec()
}

/// The library of materials: dictionaries with `name`, `young_modulus_pa`, `poisson_ratio`, `density_kg_m3`, `source`
/// and `measured`.
#[pyfunction]
pub fn materials(py: Python<'_>) -> PyResult<Vec<Bound<'_, PyDict>>> {
    let row = |one: &yawara::scene::LibraryMaterial| {
        let row = PyDict::new(py);
        row.set_item("name", one.name)?;
        row.set_item("young_modulus_pa", one.young_modulus_pa)?;
        row.set_item("poisson_ratio", one.poisson_ratio)?;
        row.set_item("density_kg_m3", one.density_kg_m3)?;
        row.set_item("source", one.source)?;
        row.set_item("measured", one.measured)?;
        Ok(row)
    };
    library().iter().map(row).collect()
}

/// A body, its tools and the stages that move it.
#[pyclass(frozen, subclass)]
pub struct Simulation {
    simulation: Mutex<yawara::Simulation>,
    raised: Raised,
}

#[pymethods]
impl Simulation {
    /// From a scene: a built-in name, the path of a TOML file or a dictionary of the same keys. `settings` are
    /// `KEY=VALUE`, or a dictionary of them. Labels with their affine come in the place of the scene's image.
    #[new]
    #[pyo3(signature = (scene, settings, *, labels=None, affine=None, homogenisation=None, indicator=None, law=None, tools=Vec::new(), progress=None))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        scene: &Bound<'_, PyAny>,
        settings: &Bound<'_, PyAny>,
        labels: Option<&Bound<'_, PyAny>>,
        affine: Option<&Bound<'_, PyAny>>,
        homogenisation: Option<&Bound<'_, PyAny>>,
        indicator: Option<&Bound<'_, PyAny>>,
        law: Option<&Bound<'_, PyAny>>,
        tools: Vec<Bound<'_, PyAny>>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let (scene, volume) = body(scene, settings, labels, affine)?;
        let raised = Raised::default();
        let mut stages = Stages::by_name(&scene.stages).map_err(of_simulation)?;
        if let Some(own) = homogenisation {
            stages.homogenisation = Box::new(PyHomogenisation::new(own, &raised)?);
        }
        if let Some(own) = indicator {
            stages.indicator = Box::new(PyIndicator::new(own, &raised)?);
        }
        if let Some(own) = law {
            stages.law = Some(Box::new(PyLaw::new(own, &raised)?));
        }
        let own =
            tools.iter().map(|tool| PyTool::new(tool, &raised)).collect::<PyResult<Vec<_>>>()?;
        let (in_progress, in_build) = (raised.clone(), raised.clone());
        let built = py.detach(move || {
            let told = move |part: &'static str, done: f64| {
                in_progress.call(ControlFlow::Break(()), |py| {
                    // Ctrl-C, and what the callback raises.
                    py.check_signals()?;
                    if let Some(progress) = &progress {
                        progress.call1(py, (part, done))?;
                    }
                    in_build.check(py)?;
                    Ok(ControlFlow::Continue(()))
                })
            };
            let mut builder = yawara::Simulation::builder(&scene).stages(stages).progress(told);
            if let Some(volume) = volume {
                builder = builder.volume(volume);
            }
            for tool in own {
                builder = builder.tool(|body| tool.place(body));
            }
            builder.build()
        });
        raised.check(py)?;
        Ok(Self { simulation: Mutex::new(built.map_err(of_simulation)?), raised })
    }

    /// The scene's name.
    #[getter]
    fn name(&self, py: Python<'_>) -> PyResult<String> {
        self.with(py, |simulation| simulation.name().to_owned())
    }

    /// Steps that the scene still has.
    #[getter]
    fn steps_left(&self, py: Python<'_>) -> PyResult<usize> {
        self.with(py, |simulation| simulation.steps_left())
    }

    /// What runs, what does not and why.
    fn plan<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let plan = self.with(py, |simulation| simulation.plan().to_vec())?;
        pythonize(py, &plan).map_err(refused)
    }

    /// Makes a step and returns its report.
    fn step<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let report = self.with(py, yawara::Simulation::step)?.map_err(of_simulation)?;
        report_of(py, &report)
    }

    /// The deformed mesh with its fields.
    fn frame<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let frame = self.with(py, |simulation| simulation.frame())?.map_err(of_simulation)?;
        frame_of(py, frame)
    }

    /// All that has happened so far, as in summary.json.
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let summary = self.with(py, |simulation| simulation.summary())?.map_err(of_simulation)?;
        pythonize(py, &summary).map_err(refused)
    }

    /// What the body stores, J.
    fn energy_j(&self, py: Python<'_>) -> PyResult<f64> {
        self.with(py, |simulation| simulation.energy_j())
    }

    /// The kinds of the tools, by number.
    fn tool_kinds(&self, py: Python<'_>) -> PyResult<Vec<&'static str>> {
        self.with(py, |simulation| simulation.tools().map(|tool| tool.kind()).collect())
    }

    /// Where a tool is at a time: displacement, m, and turn, degrees.
    fn tool_pose(&self, py: Python<'_>, tool: usize, time_s: f64) -> PyResult<([f64; 3], f64)> {
        let pose = self.with(py, |simulation| simulation.tool_pose(tool, time_s))?;
        pose.map(|pose| (pose.move_m, pose.turn_deg)).map_err(of_simulation)
    }

    /// Leads a tool over the next step to a displacement, m, and turn, degrees.
    fn set_tool_pose(
        &self,
        py: Python<'_>,
        tool: usize,
        move_m: [f64; 3],
        turn_deg: f64,
    ) -> PyResult<()> {
        let pose = Pose { move_m, turn_deg };
        self.with(py, |simulation| simulation.set_tool_pose(tool, pose))?.map_err(of_simulation)
    }

    /// Has a tool let go.
    fn release_tool(&self, py: Python<'_>, tool: usize) -> PyResult<()> {
        self.with(py, |simulation| simulation.release_tool(tool))?.map_err(of_simulation)
    }

    /// Adds a grab or a probe, given as in a scene; returns its number.
    fn add_tool(&self, py: Python<'_>, entry: &Bound<'_, PyAny>) -> PyResult<usize> {
        let entry: ToolEntry = depythonize(entry).map_err(refused)?;
        self.with(py, |simulation| simulation.add_tool(entry))?.map_err(of_simulation)
    }

    /// The stiffness that a tool feels, 3 × 3, N/m.
    fn tool_stiffness<'py>(
        &self,
        py: Python<'py>,
        tool: usize,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let stiffness = self.with(py, |simulation| simulation.tool_stiffness(tool))?;
        Ok(rows(py, &stiffness.map_err(of_simulation)?))
    }

    /// Bisects tetrahedra, by their numbers in a frame; returns how many vertices came in.
    fn split(&self, py: Python<'_>, tetrahedra: Vec<usize>) -> PyResult<usize> {
        self.with(py, |simulation| simulation.split(&tetrahedra))?.map_err(of_simulation)
    }

    /// Takes vertices out, by their numbers in a frame; returns how many went.
    fn merge(&self, py: Python<'_>, vertices: Vec<usize>) -> PyResult<usize> {
        self.with(py, |simulation| simulation.merge(&vertices))?.map_err(of_simulation)
    }

    /// Blocks of the stiffness matrix whose inverse is kept, (data, indices, indptr) of a block row matrix of SciPy.
    fn stiffness<'py>(&self, py: Python<'py>) -> PyResult<Blocks<'py>> {
        blocks(
            py,
            &self.with(py, |simulation| simulation.inverse().maintainer().stiffness().clone())?,
        )
    }

    /// The block row of each vertex, -1 of one that has none.
    fn slots<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let slots = self.with(py, |simulation| {
            let inverse = simulation.inverse();
            let slot = |v: usize| inverse.slot(v).map_or(-1, |slot| slot as i64);
            simulation.body().vertices().map(|v| slot(v.index())).collect()
        })?;
        Ok(vector(py, slots))
    }

    /// Which vertices are free.
    fn free<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let free = self.with(py, |simulation| {
            let body = simulation.body();
            body.vertices().map(|v| body.is_free(v.index())).collect()
        })?;
        Ok(vector(py, free))
    }

    /// Columns: the directions of solver axes in the scanner.
    fn axes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let axes = self.with(py, |simulation| simulation.axes())?;
        let columns = [Vector3::x(), Vector3::y(), Vector3::z()].map(|e| axes.to_ras_direction(&e));
        Ok(matrix(py, (3, 3), |i, j| columns[j][i]))
    }

    /// Displacements of the body at rest under forces on its vertices (n × 3, N), m, by the inverse that is kept.
    fn solve<'py>(
        &self,
        py: Python<'py>,
        forces: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let forces = to_rows("the forces", forces, 3)?;
        let moved = self.with(py, |simulation| solve(simulation, &forces))?;
        Ok(rows(py, &moved?))
    }
}

impl Simulation {
    /// Works on the simulation while other threads of Python run, then raises what its stages in Python have raised.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut yawara::Simulation) -> T + Send,
    ) -> PyResult<T> {
        self.raised.check(py)?;
        let done = py.detach(|| {
            let mut simulation = self.simulation.lock().unwrap_or_else(PoisonError::into_inner);
            work(&mut simulation)
        });
        self.raised.check(py)?;
        Ok(done)
    }
}

/// A scene with settings, and the labels that take the place of its image.
pub(crate) fn body(
    scene: &Bound<'_, PyAny>,
    settings: &Bound<'_, PyAny>,
    labels: Option<&Bound<'_, PyAny>>,
    affine: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Scene, Option<LabelVolume>)> {
    let scene = read(scene, &changes(settings)?, labels.is_some())?;
    let volume = match (labels, affine) {
        (None, None) => None,
        (Some(labels), Some(affine)) => Some(label_volume(labels, affine)?),
        _ => return Err(refused("labels and affine come together or not at all")),
    };
    Ok((scene, volume))
}

/// Changes of keys as the command line takes them.
fn changes(settings: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
    if settings.cast::<PyMapping>().is_err() {
        return settings.extract();
    }
    let table: toml::Table = depythonize(settings).map_err(refused)?;
    Ok(table.iter().map(|(key, value)| format!("{key}={value}")).collect())
}

fn read(scene: &Bound<'_, PyAny>, settings: &[String], in_memory: bool) -> PyResult<Scene> {
    let read = match scene.cast::<PyString>() {
        Ok(name) if !in_memory => {
            scene_file::load(name.to_str()?, settings).map(|(scene, _)| scene)
        }
        Ok(name) => {
            let want = "a dictionary: the scene of labels in memory names no image";
            return Err(refused(format!("scene is {:?}, want {want}", name.to_str()?)));
        }
        Err(_) => {
            let table: toml::Table = depythonize(scene).map_err(refused)?;
            let text = toml::to_string(&table).map_err(refused)?;
            let name = table.get("name").and_then(|name| name.as_str()).unwrap_or("scene");
            scene_file::parse(&text, name, settings, in_memory)
        }
    };
    read.map_err(of_simulation)
}

fn solve(simulation: &yawara::Simulation, forces: &[f64]) -> PyResult<Vec<[f64; 3]>> {
    let (body, inverse, axes) = (simulation.body(), simulation.inverse(), simulation.axes());
    let (maintainer, count) = (inverse.maintainer(), body.vertex_count());
    if forces.len() != 3 * count {
        let got = forces.len() / 3;
        return Err(refused(format!("forces has {got} rows, want {count}: one per vertex")));
    }
    let k = maintainer.stiffness();
    let (mut f, mut u) = (vec![0.0; k.dofs()], vec![0.0; k.dofs()]);
    // Where the displacements of each vertex begin.
    let at: Vec<Option<usize>> = body
        .vertices()
        .map(|v| body.is_free(v.index()).then(|| inverse.slot(v.index())).flatten())
        .map(|slot| slot.map(|slot| k.block() * slot))
        .collect();
    for (force, &at) in forces.chunks_exact(3).zip(&at) {
        let force = axes.to_solver_direction(&Vector3::from_column_slice(force));
        if let Some(at) = at {
            f[at..at + 3].copy_from_slice(force.as_slice());
        }
    }
    maintainer.solve(&f, &mut u).map_err(|error| of_simulation(SimError::from(error)))?;
    let moved = |at: &Option<usize>| match at {
        Some(at) => axes.to_ras_direction(&Vector3::from_column_slice(&u[*at..at + 3])).into(),
        None => [0.0; 3],
    };
    Ok(at.iter().map(moved).collect())
}

fn report_of<'py>(py: Python<'py>, report: &StepReport) -> PyResult<Bound<'py, PyDict>> {
    let row = PyDict::new(py);
    row.set_item("step", report.step)?;
    row.set_item("time_s", report.time_s)?;
    row.set_item("vertices", report.vertices)?;
    row.set_item("tetrahedra", report.tets)?;
    row.set_item("splits", report.splits)?;
    row.set_item("merges", report.merges)?;
    row.set_item("waiting", report.waiting)?;
    row.set_item("iterations", report.iterations)?;
    row.set_item("substeps", report.substeps)?;
    row.set_item("residual", report.residual)?;
    row.set_item("converged", report.converged)?;
    row.set_item("error_estimate", report.error_estimate)?;
    row.set_item("goal", report.goal.map(|goal| (goal.name, goal.value, goal.error)))?;
    row.set_item("failure", pythonize(py, &report.failure).map_err(refused)?)?;
    let times = PyDict::new(py);
    times.set_item("tool", report.times.tool_ms)?;
    times.set_item("solve", report.times.solve_ms)?;
    times.set_item("indicator", report.times.indicator_ms)?;
    times.set_item("remesh", report.times.remesh_ms)?;
    times.set_item("inverse", report.times.inverse_ms)?;
    row.set_item("times_ms", times)?;
    let tools = report.tools.iter().map(|tool| tool_of(py, tool)).collect::<PyResult<Vec<_>>>()?;
    row.set_item("tools", PyList::new(py, tools)?)?;
    Ok(row)
}

fn tool_of<'py>(py: Python<'py>, tool: &ToolReport) -> PyResult<Bound<'py, PyDict>> {
    let row = PyDict::new(py);
    row.set_item("kind", tool.kind)?;
    row.set_item("force_n", vector(py, tool.force_n.to_vec()))?;
    row.set_item("force_error_n", tool.force_error_n)?;
    row.set_item("torque_n_m", vector(py, tool.torque_n_m.to_vec()))?;
    row.set_item("work_j", tool.work_j)?;
    row.set_item("reference_m", vector(py, tool.reference_mm.map(|x| 1e-3 * x).to_vec()))?;
    row.set_item("contacts", tool.contacts)?;
    row.set_item("penetration_m", tool.penetration_m)?;
    Ok(row)
}

fn frame_of(py: Python<'_>, frame: Frame) -> PyResult<Bound<'_, PyDict>> {
    let metres = |rows: &[[f64; 3]]| -> Vec<[f64; 3]> {
        rows.iter().map(|row| row.map(|x| 1e-3 * x)).collect()
    };
    let row = PyDict::new(py);
    row.set_item("time_s", frame.time_s)?;
    row.set_item("positions", rows(py, &metres(&frame.points_mm)))?;
    row.set_item("displacements", rows(py, &metres(&frame.displacement_mm)))?;
    row.set_item("tetrahedra", rows(py, &frame.tets))?;
    row.set_item("level", vector(py, frame.level))?;
    row.set_item("label", vector(py, frame.label))?;
    row.set_item("young_modulus_pa", vector(py, frame.young_modulus_pa))?;
    row.set_item("von_mises_pa", vector(py, frame.von_mises_pa))?;
    row.set_item("plastic_strain", vector(py, frame.plastic_strain))?;
    row.set_item("dissipated_j_m3", vector(py, frame.dissipated_j_m3))?;
    row.set_item("indicator", vector(py, frame.indicator))?;
    Ok(row)
}
