//! What is measured after a step: how far figures are off, and what the mesh wants.

use nalgebra::Vector3;

use super::equilibrium::Acting;
use super::figures::{self, Figure};
use super::indicator::{Dual, Sight};
use super::proximity::Proximity;
use super::refinement::Estimates;
use super::simulation::{SimulatedBody, Simulation};
use crate::body::{BodyState, Hold};
use crate::error::SimError;
use crate::report::{GoalReport, StageTimes, StepReport, ToolReport};

/// By how much positions may change, relative to the largest coordinate, while nothing moves: what tools hold is put
/// where they have it in every step.
const NO_MOVE: f64 = 1e-12;

/// How far a tool may be from where it was then, mm.
const STANDS_MM: f64 = 1e-9;

/// By how much forces may change then, relative to the largest.
const ROUNDING: f64 = 1e-9;

/// A torque that rounds as a force does, at such a lever, m.
const LEVER_M: f64 = 1e-2;

/// What one step has measured, for those after it in which nothing moves.
pub(super) struct Stood {
    positions: Vec<Vector3<f64>>,
    holds: Vec<Hold>,
    /// Of the elements, [`yawara_corot::Body::stamp`].
    stamps: Vec<u64>,
    felt: Vec<ToolReport>,
    /// Whether it asked what the mesh wants, and that would be the same at any time.
    ranks: bool,
    found: Found,
}

#[derive(Clone)]
struct Found {
    /// What the body stores, J, if what the mesh wants was asked for.
    stored_j: Option<f64>,
    error_estimate: Option<f64>,
    /// By tool.
    force_errors_n: Vec<Option<f64>>,
    goal: Option<GoalReport>,
}

impl Stood {
    fn has_not_moved(&self, state: &BodyState) -> bool {
        let both = || self.positions.iter().zip(&state.positions);
        let [moved, size] = both().fold([0.0_f64; 2], |[moved, size], (then, now)| {
            [moved.max((now - then).amax()), size.max(now.amax())]
        });
        moved <= NO_MOVE * size
    }

    fn is(&self, state: &BodyState, felt: &[ToolReport], ranks: bool) -> bool {
        let remembers = state.is_dynamic || state.body.law().state_len() > 0;
        let elements = state.elements().len();
        !remembers
            && (self.ranks || !ranks)
            && are_same(&self.felt, felt)
            && self.positions.len() == state.positions.len()
            && self.has_not_moved(state)
            && self.holds == state.holds
            && self.stamps.len() == elements
            && (0..elements).all(|number| self.stamps[number] == state.body.stamp(number))
    }
}

/// Whether tools are where they were and do what they did, but for rounding.
fn are_same(then: &[ToolReport], now: &[ToolReport]) -> bool {
    let both = || then.iter().zip(now);
    let stands = |(then, now): (&ToolReport, &ToolReport)| {
        let moved = Vector3::from(now.reference_mm) - Vector3::from(then.reference_mm);
        then.contacts == now.contacts && moved.amax() <= STANDS_MM
    };
    let most = |of: fn(&ToolReport) -> [f64; 3]| {
        now.iter().map(|tool| Vector3::from(of(tool)).amax()).fold(0.0, f64::max)
    };
    let forces = most(|tool| tool.force_n);
    let keeps = |of: fn(&ToolReport) -> [f64; 3], size: f64| {
        let far = |(then, now)| (Vector3::from(of(now)) - Vector3::from(of(then))).amax();
        both().map(far).fold(0.0, f64::max) <= ROUNDING * size
    };
    then.len() == now.len()
        && both().all(stands)
        && keeps(|tool| tool.force_n, forces)
        && keeps(|tool| tool.torque_n_m, most(|tool| tool.torque_n_m).max(LEVER_M * forces))
}

impl Simulation {
    /// The estimates of a step, and, if it `ranks`, what the mesh wants; returns what the body stores then, J.
    ///
    /// Where nothing has moved or changed since this was last asked for, it is what it was then.
    pub(super) fn measure(
        &mut self,
        step: usize,
        ranks: bool,
        felt: &mut [ToolReport],
        report: &mut StepReport,
    ) -> Result<Option<f64>, SimError> {
        let state = &self.body.state;
        let known = self.stood.as_ref().filter(|stood| stood.is(state, felt, ranks));
        let found = match known {
            Some(stood) => stood.found.clone(),
            None => {
                let found = self.find(step, ranks, felt, &mut report.times)?;
                let SimulatedBody { state, refiner, .. } = &self.body;
                let settles = refiner.as_ref().is_some_and(|refiner| refiner.is_settling(step));
                self.stood = Some(Stood {
                    positions: state.positions.clone(),
                    holds: state.holds.clone(),
                    stamps: (0..state.elements().len()).map(|i| state.body.stamp(i)).collect(),
                    felt: felt.to_vec(),
                    ranks: ranks && !settles,
                    found: found.clone(),
                });
                found
            }
        };
        for (tool, error) in felt.iter_mut().zip(found.force_errors_n) {
            tool.force_error_n = error;
        }
        (report.error_estimate, report.goal) = (found.error_estimate, found.goal);
        Ok(found.stored_j.filter(|_| ranks))
    }

    fn find(
        &mut self,
        step: usize,
        ranks: bool,
        felt: &[ToolReport],
        times: &mut StageTimes,
    ) -> Result<Found, SimError> {
        let mut found = Found {
            stored_j: None,
            error_estimate: None,
            force_errors_n: vec![None; felt.len()],
            goal: None,
        };
        let Self { body, tools, contact, solver, goal, recorder, .. } = self;
        let SimulatedBody { state, inverse, refiner } = body;
        let Some(refiner) = refiner else { return Ok(found) };
        let mut loads = solver.grips.loads(state);
        contact.add_to(&mut loads);
        let mut acting = Acting { state, contact, tools, inverse };
        let alone = figures::alone(solver, &acting, felt);
        let figures = match refiner.estimates() {
            true => figures::asked(*goal, solver, &acting, felt),
            false => Vec::new(),
        };
        let forces: Vec<_> = felt
            .iter()
            .map(|tool| recorder.axes.to_solver_direction(&tool.force_n.into()))
            .collect();
        let duals = figures.iter().map(|figure| figure.dual(solver, &mut acting, &forces));
        let duals: Vec<Dual> = duals.collect::<Result<_, _>>()?;
        let sight = Sight { body: state, loads: &loads, duals: &duals };
        if ranks {
            let near = Proximity::of(refiner.near_probe(), tools, solver.reached_s());
            found.stored_j = Some(refiner.rank(&sight, near.as_ref(), step, times)?);
        } else {
            refiner.measure(&sight, times);
        }
        let Estimates { energy, figures: errors } = refiner.take_estimates();
        found.error_estimate = energy;
        if let (Some(alone), Some(energy)) = (alone, energy) {
            found.force_errors_n[alone] = Some(energy * forces[alone].norm());
        }
        let errors = errors.into_iter().map(Some).chain(std::iter::repeat(None));
        for ((figure, dual), error) in figures.iter().zip(&duals).zip(errors) {
            if let (Figure::Force(tool), Some(_)) = (figure, error) {
                found.force_errors_n[*tool] = error;
            }
            if Some(*figure) == *goal {
                let (name, value) = (figure.name(), dual.value);
                found.goal = Some(GoalReport { name, value, error });
            }
        }
        Ok(found)
    }
}
