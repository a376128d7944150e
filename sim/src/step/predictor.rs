//! The first iterate of a pressed body: what the last step did, done again.

use nalgebra::Vector3;

use super::contact::Probing;
use super::equilibrium::StepOutcome;
use super::simulation::Simulation;
use crate::body::Hold;

/// A probe that goes on by less than this fraction of its move as it went before has turned: what
/// the body did then says nothing about now.
const ALIKE: f64 = 0.5;

/// The most that the last step is stretched.
const LONGEST: f64 = 2.0;

/// How probes moved in the last step and move in the one under way.
#[derive(Default)]
pub(crate) struct Predictor {
    /// Where vertices were when the step began, m.
    from: Vec<Vector3<f64>>,
    /// Of each probe, m; empty unless the last step went as a whole.
    last: Vec<(usize, Vector3<f64>)>,
    now: Vec<(usize, Vector3<f64>)>,
}

impl Predictor {
    /// How much of the last step the probes' moves in this one are; 0 where they are not alike.
    fn share(&self) -> f64 {
        let same_tools = self.last.iter().map(|x| x.0).eq(self.now.iter().map(|x| x.0));
        if self.last.is_empty() || !same_tools {
            return 0.0;
        }
        let pairs = || self.last.iter().zip(&self.now).map(|(old, new)| (old.1, new.1));
        let share = pairs().map(|(old, new)| old.dot(&new)).sum::<f64>()
            / pairs().map(|(old, _)| old.norm_squared()).sum::<f64>();
        let off: f64 = pairs().map(|(old, new)| (new - share * old).norm_squared()).sum();
        let size: f64 = pairs().map(|(_, new)| new.norm_squared()).sum();
        let is_alike = share > 0.0 && share <= LONGEST && off <= ALIKE * ALIKE * size;
        // A NaN where nothing moved is not alike either.
        if is_alike { share } else { 0.0 }
    }
}

impl Simulation {
    /// Begins a step.
    pub(crate) fn begin_trend(&mut self) {
        self.predictor.from.clone_from(&self.state.positions);
        self.contact.begin();
    }

    /// Moves the free vertices of a quasi-static body that probes press as the last step did,
    /// stretched as the probes' moves are. Returns that factor, which is also that of the probes'
    /// forces; 0 where nothing goes on.
    ///
    /// Under a steady push this leaves a residual of second order in the step.
    pub(crate) fn follow_trend(&mut self, probing: &[Probing]) -> f64 {
        if self.motion.is_some() {
            return 0.0;
        }
        self.predictor.now = probing.iter().map(|probe| (probe.tool, probe.moved)).collect();
        let share = self.predictor.share();
        let state = &mut self.state;
        for v in 0..state.positions.len() {
            if share > 0.0 && state.holds[v] == Hold::Free {
                state.positions[v] += share * self.scene.time.step_s * state.velocities[v];
            }
        }
        share
    }

    /// Ends a step of a quasi-static body: its velocities are those that the next step begins with.
    pub(crate) fn end_trend(&mut self, outcome: &StepOutcome) {
        if self.motion.is_some() {
            return;
        }
        let goes_on = outcome.converged && outcome.substeps == 1 && self.contact.is_pressed();
        self.predictor.last.clear();
        if goes_on {
            std::mem::swap(&mut self.predictor.last, &mut self.predictor.now);
        }
        self.contact.end(goes_on);
        let state = &mut self.state;
        for (v, from) in self.predictor.from.iter().enumerate() {
            let moved = state.positions[v] - from;
            state.velocities[v] =
                if goes_on { moved / self.scene.time.step_s } else { Vector3::zeros() };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trend(last: [f64; 3], now: [f64; 3]) -> f64 {
        let one = |x: [f64; 3]| vec![(3, Vector3::from(x))];
        Predictor { from: vec![], last: one(last), now: one(now) }.share()
    }

    #[test]
    fn a_probe_that_goes_on_takes_the_body_along() {
        assert_eq!(trend([2e-4, 0.0, 0.0], [1e-4, 0.0, 0.0]), 0.5);
        assert_eq!(trend([2e-4, 0.0, 0.0], [2e-4, 1e-5, 0.0]), 1.0);
    }

    #[test]
    fn one_that_turns_stops_or_leaps_does_not() {
        for now in [[-1e-4, 0.0, 0.0], [1e-4, 1e-4, 0.0], [0.0; 3], [1e-2, 0.0, 0.0]] {
            assert_eq!(trend([2e-4, 0.0, 0.0], now), 0.0, "{now:?}");
        }
        assert_eq!(trend([0.0; 3], [1e-4, 0.0, 0.0]), 0.0);
        assert_eq!(Predictor::default().share(), 0.0);
    }
}
