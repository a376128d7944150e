//! What is measured of an equilibrium, and what it changes by with the moduli of the materials.

use std::ops::ControlFlow;

use nalgebra::{DMatrix, Matrix6, Vector3};
use yawara_corot::{
    Attached, Body, Constraints, Disturbance, Element, ElementPoint, Obstacle, Problem, Tolerance,
    locate,
};
use yawara_embed::{FineMaterial, Materials};

use super::contact::ContactState;
use super::equilibrium::StepSolver;
use super::held::Held;
use super::simulation::{SimulatedBody, Simulation};
use super::tool_loads::ToolLoads;
use crate::body::{BodyState, Hold};
use crate::error::SimError;
use crate::inverse::{Applied, InverseLink};
use crate::scene::Scene;
use crate::tools::Tool;

/// By how much ln E is varied for the derivatives of elasticities, which homogenisation makes no straight lines of.
const VARIED: f64 = 1e-4;

/// A component of something that is measured, by scanner axis.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Reading {
    /// How far a point of the material has moved, m.
    Move(ElementPoint, usize),
    /// The force of a tool on the body, N.
    Force(usize, usize),
}

/// By entry of the scene's materials the elasticities of all elements, by number, where ln E is [`VARIED`] less and more.
pub(crate) struct Variations(Vec<[Vec<Matrix6<f64>>; 2]>);

/// A load and motions of tools, all of it small.
#[derive(Debug, Default)]
struct Stir {
    /// N by vertex number and, beside pressures, the entry of these.
    load: Vec<f64>,
    leads: Vec<(usize, Vector3<f64>)>,
}

impl Simulation {
    /// Has steps leave the mesh as it is.
    pub(crate) fn keep_mesh(&mut self) {
        self.scene.mesh.max_level = Some(self.scene.mesh.start_level);
    }

    /// Where points at rest (solver axes, m) lie in the mesh; none of those that lie farther than `reach` (m) outside.
    pub(crate) fn points(&self, rest: &[Vector3<f64>], reach: f64) -> Vec<Option<ElementPoint>> {
        let state = &self.body.state;
        let solid = state.elements().iter().filter(|element| !state.is_void(element.tet));
        let found =
            locate(rest, solid, &state.rest, reach, |tet, at| state.carries(tet, at.weights));
        found.into_iter().map(|found| Some(found?.1)).collect()
    }

    /// The entries of the scene's materials that the body is made of, in their order.
    pub(crate) fn materials_there(&self) -> Vec<usize> {
        let SimulatedBody { state, refiner, .. } = &self.body;
        let mut there: Vec<usize> = match refiner {
            Some(refiner) => refiner.content.material_of.iter().flatten().copied().collect(),
            None => {
                let labels = state.elements().iter().map(|element| state.label(element.tet));
                labels.filter_map(|label| self.scene.material_of(label)).collect()
            }
        };
        there.sort_unstable();
        there.dedup();
        there
    }

    /// What is read at the last equilibrium, m and N.
    pub(crate) fn read(&self, readings: &[Reading]) -> Vec<f64> {
        let BodyState { positions, rest, .. } = &self.body.state;
        let felt = self.felt().reports(&self.tools);
        let value = |reading: &Reading| match *reading {
            Reading::Move(point, axis) => {
                let moved = point.position(positions) - point.position(rest);
                self.recorder.axes.to_ras_direction(&moved)[axis]
            }
            Reading::Force(tool, axis) => felt[tool].force_n[axis],
        };
        readings.iter().map(value).collect()
    }

    /// Whether the force of a tool follows from what it does with the material.
    pub(crate) fn is_felt(&self, tool: usize) -> bool {
        let state = &self.body.state;
        let t = self.solver.reached_s();
        state.grip_tools.contains(&Some(tool))
            || state.holds.contains(&Hold::Grabbed(tool))
            || self.tools[tool].obstacle(t).is_some()
    }

    /// ∂ reading / ∂ ln E at the last equilibrium, for the E of each entry of `variations`: a row a reading. The mesh and all
    /// that holds the body stay.
    ///
    /// Cost: [`Problem::respond`] for each entry, and for each component of a force.
    /// # Errors
    /// [`SimError::NoResponse`], those of the inverse.
    pub(crate) fn slopes(
        &self,
        readings: &[Reading],
        variations: &Variations,
    ) -> Result<DMatrix<f64>, SimError> {
        let pulls = self.pulls(variations);
        let mut slopes = DMatrix::zeros(readings.len(), pulls.len());
        if readings.iter().any(|reading| matches!(reading, Reading::Move(..))) {
            for (column, pull) in pulls.iter().enumerate() {
                let load = pull.iter().map(|pull| -pull).collect();
                let change = self.respond(&Stir { load, leads: Vec::new() })?;
                for (row, reading) in readings.iter().enumerate() {
                    if let Reading::Move(point, axis) = reading {
                        let moves = self.moved(point, &change);
                        slopes[(row, column)] = self.recorder.axes.to_ras_direction(&moves)[*axis];
                    }
                }
            }
        }
        for (row, reading) in readings.iter().enumerate() {
            if let Reading::Force(tool, axis) = *reading {
                let along = self.along(axis);
                let way = self.respond(&Stir { load: Vec::new(), leads: vec![(tool, along)] })?;
                for (column, pull) in pulls.iter().enumerate() {
                    slopes[(row, column)] = way.iter().zip(pull).map(|(a, b)| a * b).sum();
                }
            }
        }
        Ok(slopes)
    }

    /// ∂/∂ ln E of Σ weight · reading, for the E of each entry of `variations`, by one adjoint state.
    ///
    /// Cost: one [`Problem::respond`], and two evaluations of forces for each entry.
    /// # Errors
    /// As [`slopes`](Self::slopes).
    pub(crate) fn slope_of_sum(
        &self,
        readings: &[Reading],
        weights: &[f64],
        variations: &Variations,
    ) -> Result<Vec<f64>, SimError> {
        let m = self.body.state.body.unknowns_per_vertex();
        let mut stir = Stir { load: vec![0.0; self.rows()], leads: Vec::new() };
        for (reading, weight) in readings.iter().zip(weights) {
            match *reading {
                Reading::Move(point, axis) => {
                    let pull = -*weight * self.along(axis);
                    for (v, share) in point.vertices.into_iter().zip(point.weights) {
                        (0..3).for_each(|a| stir.load[m * v + a] += share * pull[a]);
                    }
                }
                Reading::Force(tool, axis) => stir.leads.push((tool, *weight * self.along(axis))),
            }
        }
        let adjoint = self.respond(&stir)?;
        let dot = |pull: &Vec<f64>| adjoint.iter().zip(pull).map(|(a, b)| a * b).sum();
        Ok(self.pulls(variations).iter().map(dot).collect())
    }

    /// A scanner axis in solver axes.
    fn along(&self, axis: usize) -> Vector3<f64> {
        self.recorder.axes.to_solver_direction(&Vector3::ith(axis, 1.0))
    }

    fn rows(&self) -> usize {
        let state = &self.body.state;
        state.body.unknowns_per_vertex() * state.positions.len()
    }

    fn moved(&self, point: &ElementPoint, change: &[f64]) -> Vector3<f64> {
        let m = self.body.state.body.unknowns_per_vertex();
        let of = |v: usize| Vector3::from_column_slice(&change[m * v..m * v + 3]);
        point.vertices.iter().zip(point.weights).map(|(&v, share)| share * of(v)).sum()
    }

    fn respond(&self, stir: &Stir) -> Result<Vec<f64>, SimError> {
        let SimulatedBody { state, inverse, .. } = &self.body;
        let step = self.recorder.statistics.steps();
        let found = self.solver.respond(stir, state, &self.contact, &self.tools, inverse)?;
        found.ok_or(SimError::NoResponse(step))
    }

    /// ∂(f_int − f_ext)/∂ ln E in the rows of residuals, at all vertices, of each entry of `variations`.
    fn pulls(&self, variations: &Variations) -> Vec<Vec<f64>> {
        let state = &self.body.state;
        let unbalanced = |elasticities: &Vec<Matrix6<f64>>| {
            let of =
                |e: &Element| state.body.number(e.tet).map_or(e.elasticity, |n| elasticities[n]);
            self.solver.unbalanced(state.body.with_elasticities(of), state, &self.tools)
        };
        let pull = |both: &[Vec<Matrix6<f64>>; 2]| {
            let [less, more] = both.each_ref().map(unbalanced);
            less.iter().zip(&more).map(|(less, more)| (less - more) / (2.0 * VARIED)).collect()
        };
        variations.0.iter().map(pull).collect()
    }

    /// What the elements are made of where the modulus of each of these entries of the scene's materials is another.
    ///
    /// Cost: twice a homogenisation of the body for each entry.
    /// # Errors
    /// Those of homogenisation.
    pub(crate) fn variations(&self, entries: &[usize]) -> Result<Variations, SimError> {
        let both = |&entry: &usize| {
            Ok([self.varied(entry, (-VARIED).exp())?, self.varied(entry, VARIED.exp())?])
        };
        Ok(Variations(entries.iter().map(both).collect::<Result<_, SimError>>()?))
    }

    /// The elasticities of all elements, by number, with the modulus of an entry of the scene's materials so many times as
    /// large.
    fn varied(&self, entry: usize, factor: f64) -> Result<Vec<Matrix6<f64>>, SimError> {
        let SimulatedBody { state, refiner, .. } = &self.body;
        let Some(refiner) = refiner else {
            let is_it = |e: &Element| self.scene.material_of(state.label(e.tet)) == Some(entry);
            let scaled = |e: &Element| if is_it(e) { factor * e.elasticity } else { e.elasticity };
            return Ok(state.elements().iter().map(scaled).collect());
        };
        let content = &refiner.content;
        let before = content.embedding.materials();
        let materials = varied(before, &content.material_of, &self.scene, entry, factor)?;
        let others = content.embedding.of_others(&materials, &mut |_| ControlFlow::Continue(()))?;
        let mut elasticities: Vec<_> = state.elements().iter().map(|e| e.elasticity).collect();
        for tet in content.forest.leaves() {
            if let Some(number) = state.body.number(tet.id) {
                elasticities[number] = others.of(tet.node);
            }
        }
        Ok(elasticities)
    }
}

/// The materials with the modulus of an entry of the scene's so many times as large, and that of void as soft as
/// then the softest asks for.
fn varied(
    materials: &Materials,
    material_of: &[Option<usize>],
    scene: &Scene,
    entry: usize,
    factor: f64,
) -> Result<Materials, SimError> {
    let scale = |position: usize| if position == entry { factor } else { 1.0 };
    let softest = |scale: &dyn Fn(usize) -> f64| {
        let moduli = material_of.iter().flatten();
        let moduli = moduli.map(|&at| scale(at) * scene.materials[at].young_modulus_pa);
        moduli.fold(f64::INFINITY, f64::min)
    };
    let of_void = softest(&scale) / softest(&|_| 1.0);
    let varied = materials.by_label().iter().zip(material_of).map(|(material, position)| {
        let scale = position.map_or(of_void, scale);
        FineMaterial::new(scale * material.elasticity(), material.density_kg_m3())
    });
    let varied = varied.collect::<Result<Vec<_>, _>>()?;
    Ok(Materials::new(varied).with_void(materials.void()))
}

impl StepSolver {
    /// How the body of the last equilibrium, and tools with what they hold of it, answer; none where they do not.
    fn respond(
        &self,
        stir: &Stir,
        state: &BodyState,
        contact: &ContactState,
        tools: &[Box<dyn Tool>],
        inverse: &InverseLink,
    ) -> Result<Option<Vec<f64>>, SimError> {
        let t = self.reached_s();
        let held = Held::new(state, inverse)?;
        let m = state.body.unknowns_per_vertex();
        let rows = m * state.positions.len();
        let add = |vector: &mut [f64], v: usize, part: &Vector3<f64>| {
            (0..3).for_each(|axis| vector[m * v + axis] += part[axis]);
        };
        let mut load = stir.load.clone();
        load.resize(rows, 0.0);
        let mut moved = vec![0.0; rows];
        let constraints = self.grips.constraints();
        let count = constraints.map_or(0, Constraints::len);
        let mut attached = Attached::default();
        attached.rows.extend((0..count).filter_map(|k| Some(constraints?.row(k).to_vec())));
        let mut targets = vec![0.0; count];
        for (tool, lead) in &stir.leads {
            let mut pads = vec![Vector3::zeros(); state.positions.len()];
            self.grips.add_pads(*tool, lead, state, &mut pads);
            pads.iter().enumerate().for_each(|(v, pull)| add(&mut load, v, pull));
            let leads = self.grips.leads(*tool, lead, state);
            targets.iter_mut().zip(leads.iter()).for_each(|(target, lead)| *target += lead);
            for v in state.vertices().filter(|v| state.holds[v.index()] == Hold::Grabbed(*tool)) {
                add(&mut moved, v.index(), lead);
            }
        }
        for (tool, point, force) in contact.touching() {
            let Some(sphere) = tools[tool].obstacle(t) else { continue };
            let turning = -force.norm() * sphere.curvature(&point.position(&state.positions));
            let normal = force.normalize();
            let leads = stir.leads.iter().filter(|(of, _)| *of == tool);
            let lead: Vector3<f64> = leads.map(|(_, lead)| lead).sum();
            let corners = point.vertices.into_iter().zip(point.weights);
            corners.clone().for_each(|(v, share)| add(&mut load, v, &(share * turning * lead)));
            attached.rows.push(corners.map(|(v, share)| (v, share * normal)).collect());
            targets.push(normal.dot(&lead));
            attached.points.push((point, turning));
        }
        let applied = Applied::new(&held.constrained);
        let tool_loads = ToolLoads::new(state, tools, t, true);
        let none = vec![Vector3::zeros(); state.positions.len()];
        // Nothing of it changes: its rotations are those that the inverse is turned by.
        let mut body = state.body.clone();
        let problem = Problem {
            body: &mut body,
            forces: &*self.forces,
            inertia: None,
            external: &none,
            free: &held.free,
            constraints: None,
            pushes: None,
            following: &tool_loads.following,
            inverse: &applied,
        };
        let disturbance = Disturbance { load: &load, moved: &moved, targets: &targets };
        let found = problem.respond(&state.positions, &attached, &disturbance);
        match applied.end().1 {
            Some(error) => Err(error),
            None => Ok(found),
        }
    }

    /// f_ext − f_int of another body where this one is, in the rows of residuals and at all vertices, but for loads that do not
    /// depend on the material.
    fn unbalanced(&self, mut body: Body, state: &BodyState, tools: &[Box<dyn Tool>]) -> Vec<f64> {
        let count = state.positions.len();
        let tool_loads = ToolLoads::new(state, tools, self.reached_s(), true);
        let none = vec![Vector3::zeros(); count];
        let mut problem = Problem {
            body: &mut body,
            forces: &*self.forces,
            inertia: None,
            external: &none,
            free: &vec![true; count],
            constraints: None,
            pushes: None,
            following: &tool_loads.following,
            inverse: &|_: &[f64], _: &mut [f64]| {},
        };
        let mut residual = vec![0.0; problem.rows()];
        let mut internal = none.clone();
        problem.evaluate(&state.positions, &mut internal, &mut residual, &Tolerance::new(1.0, 0));
        residual
    }
}
