//! What is measured after a step: how far figures are off, and what the mesh wants.

use std::time::Instant;

use super::equilibrium::Acting;
use super::figures::{self, Figure};
use super::indicator::{Dual, Sight};
use super::proximity::Proximity;
use super::refinement::Estimates;
use super::simulation::{SimulatedBody, Simulation};
use super::stood::{Found, Stood};
use crate::error::SimError;
use crate::report::{GoalReport, StageTimes, StepReport, ToolReport, milliseconds};

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
        let begin = Instant::now();
        let SimulatedBody { state, refiner, .. } = &self.body;
        let remembers = refiner.as_ref().is_some_and(|refiner| refiner.rules.indicator.remembers());
        let known = self.stood.as_ref().filter(|stood| !remembers && stood.is(state, felt, ranks));
        let found = match known {
            Some(stood) => {
                report.times.indicator_ms = milliseconds(begin);
                stood.found.clone()
            }
            None => {
                let found = self.find(step, ranks, felt, &mut report.times)?;
                let SimulatedBody { state, refiner, .. } = &self.body;
                let settles = refiner.as_ref().is_some_and(|refiner| refiner.is_settling(step));
                self.stood = Some(Stood::new(state, felt, ranks && !settles, found.clone()));
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
