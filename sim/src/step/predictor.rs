//! The first iterate of a body that probes press: it moves on as in the last step.

use nalgebra::Vector3;

use super::contact::Probing;
use crate::body::{BodyState, Hold, Standing};

/// The largest part of the probes' moves, as a fraction, that may lie off the direction of their
/// last ones. Beyond it they have turned, and the last step says nothing about this one.
const ALIKE: f64 = 0.5;

/// The largest multiple of the last step that is taken again.
const LONGEST: f64 = 2.0;

/// How probes moved in the last step and move in the current one.
#[derive(Default)]
pub(crate) struct Predictor {
    /// Where the body stood when the step began.
    from: Standing,
    /// The move of each probe in the last step, m; empty if it does not count.
    last: Vec<(usize, Vector3<f64>)>,
    /// The same in this step.
    now: Vec<(usize, Vector3<f64>)>,
}

impl Predictor {
    /// The probes' moves in this step as a multiple of those in the last one; 0 where their
    /// directions differ.
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
        // False for a NaN, which is what probes that do not move give.
        if is_alike { share } else { 0.0 }
    }

    /// The last step says nothing about this one.
    pub fn turn(&mut self) {
        self.last.clear();
    }

    /// The move of each probe in the last step, m; empty if it does not count.
    pub fn last(&self) -> &[(usize, Vector3<f64>)] {
        &self.last
    }

    /// After a step with these moves.
    pub fn after(last: Vec<(usize, Vector3<f64>)>) -> Self {
        Self { last, ..Self::default() }
    }

    /// Begins a step where the body stands.
    pub fn begin(&mut self, state: &BodyState) {
        self.from = state.standing();
    }

    /// Moves the free vertices, and pressures, as the last step did, scaled as the moves of the probes are. Returns
    /// that factor, which also holds for the growth of the probes' forces; 0 if the probes move
    /// otherwise than before.
    ///
    /// Under a steady push this leaves a residual of second order in the step.
    pub fn follow(&mut self, probing: &[Probing], state: &mut BodyState, step_s: f64) -> f64 {
        self.now = probing.iter().map(|probe| (probe.tool, probe.moved)).collect();
        let share = self.share();
        if share == 0.0 {
            return share;
        }
        for v in 0..state.positions.len() {
            if state.holds[v] == Hold::Free {
                state.positions[v] += share * step_s * state.velocities[v];
            }
            let pressure = state.body.pressure(v) + share * step_s * state.pressure_rates[v];
            state.body.set_pressure(v, pressure);
        }
        share
    }

    /// Ends a step; `continues` tells whether the next one may start as this one went. Sets the
    /// velocities and rates of pressures that it then starts with.
    pub fn end(&mut self, continues: bool, state: &mut BodyState, step_s: f64) {
        self.last.clear();
        if continues {
            std::mem::swap(&mut self.last, &mut self.now);
        }
        for (v, from) in self.from.positions.iter().enumerate() {
            let moved = state.positions[v] - from;
            state.velocities[v] = if continues { moved / step_s } else { Vector3::zeros() };
        }
        for (v, from) in self.from.pressures.iter().enumerate() {
            let changed = state.body.pressure(v) - from;
            state.pressure_rates[v] = if continues { changed / step_s } else { 0.0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trend(last: [f64; 3], now: [f64; 3]) -> f64 {
        let one = |x: [f64; 3]| vec![(3, Vector3::from(x))];
        Predictor { last: one(last), now: one(now), ..Predictor::default() }.share()
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
