//! A scene on a mesh that stays, as a model of what was measured.

use nalgebra::DMatrix;
use yawara_corot::ElementPoint;
use yawara_mesh::volume::LabelVolume;

use super::measured::{Measured, Measurement};
use crate::error::SimError;
use crate::scene::{GrabHold, Scene, SupportHold, ToolEntry};
use crate::step::{Reading, Simulation, Variations};

/// The largest relative residual of an equilibrium that derivatives are taken at.
const RESIDUAL: f64 = 1e-8;

/// Points that lie no farther outside the mesh count as on it, mm.
const REACH_MM: f64 = 3.0;

/// What a scene says of measurements.
#[derive(Clone, Debug)]
pub(super) struct Predicted {
    /// Of each component that was measured, in the order of the measurements, mm and N.
    pub values: Vec<f64>,
    /// Vertices of the mesh at the end.
    pub vertices: usize,
}

/// A scene and what was measured in it.
pub(super) struct Model<'a> {
    scene: Scene,
    volume: Option<&'a LabelVolume>,
    measurements: &'a [Measurement],
    /// By measurement the number of its step.
    steps: Vec<usize>,
    /// The entries of the scene's materials that the body is made of.
    pub entries: Vec<usize>,
    /// Whether the mesh stays as it is at the start.
    keeps_mesh: bool,
}

impl<'a> Model<'a> {
    /// # Errors
    /// [`SimError::Value`] for a time that is the end of no step, for a tool that is not there; those of a scene that can't be
    /// simulated; that it has inertia, a memory or a tool that changes labels.
    pub fn new(
        scene: &Scene,
        volume: Option<&'a LabelVolume>,
        measurements: &'a [Measurement],
    ) -> Result<Self, SimError> {
        let refused = |key: &str, value: &str, want: &str| {
            Err(SimError::value(&scene.name, key, value, want))
        };
        if scene.dynamics.is_some() {
            return refused("dynamics", "there", "none: moduli are found from equilibria");
        }
        if scene.tools.iter().any(ToolEntry::edits) {
            return refused("tools", "one that changes labels or cuts", "none of these");
        }
        let mut model = Self {
            scene: scene.clone(),
            volume,
            measurements,
            steps: Vec::new(),
            entries: Vec::new(),
            keeps_mesh: false,
        };
        for one in measurements {
            model.steps.push(model.step_of(one)?);
            if let Measured::Force(tool) = one.of
                && tool >= scene.tools.len()
            {
                let want = format!("below {}, the number of tools", scene.tools.len());
                return Err(SimError::value(&one.place, "tool", tool, want));
            }
        }
        let start = model.build(&model.scene)?;
        if start.body().body.law().state_len() > 0 {
            return refused("materials", "with a law that remembers", "laws of the strain alone");
        }
        model.entries = start.materials_there();
        model.hold_on(&start);
        Ok(model)
    }

    /// The step that a measurement was made after.
    fn step_of(&self, one: &Measurement) -> Result<usize, SimError> {
        let time = &self.scene.time;
        let steps = one.time_s / time.step_s;
        let is_whole = (steps - steps.round()).abs() < 1e-6 * steps.max(1.0);
        if !is_whole || !(1.0..=time.steps as f64).contains(&steps.round()) {
            let (last, length) = (time.steps as f64 * time.step_s, time.step_s);
            let want = format!("the end of a step: a multiple of {length} s, at most {last} s");
            return Err(SimError::value(&one.place, "time_s", one.time_s, want));
        }
        Ok(steps.round() as usize)
    }

    /// Gives what holds the body the stiffness that it has for the moduli of the scene: it is no tissue whose modulus is
    /// looked for.
    fn hold_on(&mut self, start: &Simulation) {
        let Scene { support, tools, .. } = &mut self.scene;
        if support.hold == SupportHold::Elastic && support.stiffness_n_m4.is_none() {
            support.stiffness_n_m4 = start.body().grip_stiffness(None);
        }
        for (number, tool) in tools.iter_mut().enumerate() {
            if let ToolEntry::Grab(grab) = tool
                && grab.hold == GrabHold::Pad
                && grab.stiffness_n_m4.is_none()
            {
                grab.stiffness_n_m4 = start.body().grip_stiffness(Some(number));
            }
        }
    }

    /// The same scene on a mesh that stays as it is at the start.
    pub fn on_fixed_mesh(&self) -> Self {
        let mut scene = self.scene.clone();
        scene.refinement.near_probe = None;
        scene.solver.residual = scene.solver.residual.min(RESIDUAL);
        Self {
            scene,
            steps: self.steps.clone(),
            entries: self.entries.clone(),
            keeps_mesh: true,
            ..*self
        }
    }

    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    fn build(&self, scene: &Scene) -> Result<Simulation, SimError> {
        let builder = Simulation::builder(scene);
        let mut simulation = match self.volume {
            Some(volume) => builder.volume(volume.clone()).build()?,
            None => builder.build()?,
        };
        if self.keeps_mesh {
            simulation.keep_mesh();
        }
        Ok(simulation)
    }

    /// What the scene says with these moduli (Pa) of all its materials.
    ///
    /// Cost: a run of the scene up to the last measurement.
    /// # Errors
    /// [`SimError::Value`] for a point outside the body, a force that a tool is given, a step that does not converge.
    pub fn predict(&self, moduli: &[f64]) -> Result<Predicted, SimError> {
        self.run(moduli, &mut |_, _| Ok(()))
    }

    /// The same, and ∂ value / ∂ ln E: a row a value, a column for each of these entries of the scene's materials.
    ///
    /// Cost: besides, a linear solve for each entry and each component of a force that was measured.
    /// # Errors
    /// As [`predict`](Self::predict); [`SimError::NoResponse`].
    pub fn slopes(
        &self,
        moduli: &[f64],
        entries: &[usize],
    ) -> Result<(Predicted, DMatrix<f64>), SimError> {
        let mut slopes = DMatrix::zeros(self.component_count(), entries.len());
        let mut variations = None;
        let predicted = self.run(moduli, &mut |simulation, read| {
            let readings: Vec<Reading> = read.iter().map(|read| read.reading).collect();
            let found =
                simulation.slopes(&readings, once(&mut variations, simulation, entries)?)?;
            for (read, found) in read.iter().zip(found.row_iter()) {
                slopes.set_row(read.row, &(read.unit() * found));
            }
            Ok(())
        })?;
        Ok((predicted, slopes))
    }

    /// Σ ½ ((value − measured)/sd)² and its derivatives by ln E of these entries, by one adjoint state for each time at which
    /// something was measured.
    ///
    /// Cost: besides a run, a linear solve a time.
    /// # Errors
    /// As [`slopes`](Self::slopes).
    pub fn gradient(
        &self,
        moduli: &[f64],
        entries: &[usize],
        data: &[(f64, f64)],
    ) -> Result<(f64, Vec<f64>), SimError> {
        let (mut misfit, mut gradient) = (0.0, vec![0.0; entries.len()]);
        let mut variations = None;
        self.run(moduli, &mut |simulation, read| {
            let readings: Vec<Reading> = read.iter().map(|read| read.reading).collect();
            let off = |read: &Read| (read.value - data[read.row].0) / data[read.row].1;
            misfit += read.iter().map(|read| 0.5 * off(read).powi(2)).sum::<f64>();
            let weights = read.iter().map(|read| read.unit() * off(read) / data[read.row].1);
            let variations = once(&mut variations, simulation, entries)?;
            let weights: Vec<f64> = weights.collect();
            let found = simulation.slope_of_sum(&readings, &weights, variations)?;
            gradient.iter_mut().zip(found).for_each(|(sum, slope)| *sum += slope);
            Ok(())
        })?;
        Ok((misfit, gradient))
    }

    fn component_count(&self) -> usize {
        self.measurements.iter().map(|one| one.values.iter().flatten().count()).sum()
    }

    /// Runs the scene and calls `visit` with what is read after each step after which something was measured.
    fn run(&self, moduli: &[f64], visit: &mut Visit<'_>) -> Result<Predicted, SimError> {
        let mut scene = self.scene.clone();
        let materials = scene.materials.iter_mut().zip(moduli);
        materials.for_each(|(material, modulus)| material.young_modulus_pa = *modulus);
        let mut simulation = self.build(&scene)?;
        let mut values = vec![0.0; self.component_count()];
        for step in 1..=self.steps.iter().copied().max().unwrap_or(0) {
            let report = simulation.step()?;
            if !report.converged {
                let value =
                    format!("not found at {} s with moduli of {moduli:?} Pa", report.time_s);
                let want = "shorter steps, or other moduli to start from";
                return Err(SimError::value(&self.scene.name, "an equilibrium", value, want));
            }
            if !self.steps.contains(&step) {
                continue;
            }
            let (mut read, mut first) = (Vec::new(), 0);
            let mut carried = self.carried(step, &simulation);
            for (one, own) in self.measurements.iter().zip(&self.steps) {
                let count = one.values.iter().flatten().count();
                if *own == step {
                    let readings = readings_of(one, &mut carried, &simulation)?;
                    let here = readings.into_iter().zip(first..);
                    read.extend(here.map(|(reading, row)| Read { reading, row, value: 0.0 }));
                }
                first += count;
            }
            let readings: Vec<Reading> = read.iter().map(|read| read.reading).collect();
            for (read, value) in read.iter_mut().zip(simulation.read(&readings)) {
                read.value = read.unit() * value;
                values[read.row] = read.value;
            }
            visit(&simulation, &read)?;
        }
        Ok(Predicted { values, vertices: simulation.body().vertex_count() })
    }

    /// As the mesh carries them after a step, the points whose moves were measured then, in their order.
    fn carried(
        &self,
        step: usize,
        simulation: &Simulation,
    ) -> impl Iterator<Item = Option<ElementPoint>> {
        let here = self.measurements.iter().zip(&self.steps).filter(|(_, own)| **own == step);
        let rest = here.filter_map(|(one, _)| match one.of {
            Measured::Move(rest_mm) => Some(simulation.axes().to_solver(&rest_mm.into())),
            Measured::Force(_) => None,
        });
        simulation.points(&rest.collect::<Vec<_>>(), 1e-3 * REACH_MM).into_iter()
    }
}

/// The variations of these entries' moduli, made when they are asked for first: the mesh stays.
fn once<'a>(
    made: &'a mut Option<Variations>,
    simulation: &Simulation,
    entries: &[usize],
) -> Result<&'a Variations, SimError> {
    Ok(match made {
        Some(made) => made,
        None => made.insert(simulation.variations(entries)?),
    })
}

/// A component that was measured.
struct Read {
    reading: Reading,
    /// Its number among all.
    row: usize,
    /// What the scene says, mm or N.
    value: f64,
}

impl Read {
    /// In m or N, in the unit of measurements.
    fn unit(&self) -> f64 {
        match self.reading {
            Reading::Move(..) => 1e3,
            Reading::Force(..) => 1.0,
        }
    }
}

/// Called with what is read after a step.
type Visit<'a> = dyn FnMut(&Simulation, &[Read]) -> Result<(), SimError> + 'a;

/// A reading for each component that was measured; of a move the next of the points that are `carried`.
fn readings_of(
    one: &Measurement,
    carried: &mut impl Iterator<Item = Option<ElementPoint>>,
    simulation: &Simulation,
) -> Result<Vec<Reading>, SimError> {
    let axes = (0..3).filter(|&axis| one.values[axis].is_some());
    match one.of {
        Measured::Move(rest_mm) => {
            let found = carried.next().flatten().ok_or_else(|| {
                let want = format!("a point of the body, or within {REACH_MM} mm of it");
                SimError::value(&one.place, "x_mm, y_mm, z_mm", format!("{rest_mm:?}"), want)
            })?;
            Ok(axes.map(|axis| Reading::Move(found, axis)).collect())
        }
        Measured::Force(tool) => {
            if !simulation.is_felt(tool) {
                let want = "that of a grab or a probe, which follows from the material";
                return Err(SimError::value(&one.place, "tool", tool, want));
            }
            Ok(axes.map(|axis| Reading::Force(tool, axis)).collect())
        }
    }
}
