//! The first iterate of a body that tools move: it moves on as in the last step.

use nalgebra::{Vector3, Vector6};

use crate::body::{BodyState, Hold, Standing};

/// The largest part of the tools' moves, as a fraction, that may lie off the direction of their
/// last ones. Beyond it they have turned, and the last step says nothing about this one.
const ALIKE: f64 = 0.5;

/// The largest multiple of the last step that is taken again.
const LONGEST: f64 = 2.0;

/// Steps after a change of the mesh until the last two moved on as one: the first also makes up for the change.
const STEADY: usize = 3;

/// How tools that hold or press the body moved in the last step and move in the current one.
#[derive(Default)]
pub(crate) struct Predictor {
    /// Where the body stood when the step began.
    from: Standing,
    /// The move of each tool in the last step; empty if it does not count.
    last: Vec<Move>,
    /// The same in this step.
    now: Vec<Move>,
    /// What of the last step this one takes again; 0 for none.
    share: f64,
    /// Steps since the mesh or what it is made of changed.
    steady: usize,
}

/// The number of a tool, how far it goes (three entries, m) and how far it turns (three, rad).
pub(crate) type Move = (usize, Vector6<f64>);

impl Predictor {
    /// The tools' moves in this step as a multiple of those in the last one; 0 where they differ in direction.
    fn share(&self) -> f64 {
        let same_tools = self.last.iter().map(|x| x.0).eq(self.now.iter().map(|x| x.0));
        if self.last.is_empty() || !same_tools {
            return 0.0;
        }
        // By ways, or by turns where there are none: metres and radians do not add up.
        let part = |first: usize| {
            let part = move |x: &Move| x.1.fixed_rows::<3>(first).into_owned();
            self.last.iter().zip(&self.now).map(move |(old, new)| (part(old), part(new)))
        };
        let size = |first: usize| part(first).map(|(_, new)| new.norm_squared()).sum::<f64>();
        let leading = if size(0) > 0.0 { 0 } else { 3 };
        let share = part(leading).map(|(old, new)| old.dot(&new)).sum::<f64>()
            / part(leading).map(|(old, _)| old.norm_squared()).sum::<f64>();
        let off = |first: usize| {
            part(first).map(|(old, new)| (new - share * old).norm_squared()).sum::<f64>()
        };
        let is_alike = |first: usize| off(first) <= ALIKE * ALIKE * size(first);
        // False for a NaN, which is what tools that do not move give.
        let goes_on = share > 0.0 && share <= LONGEST && is_alike(0) && is_alike(3);
        if goes_on { share } else { 0.0 }
    }

    /// The last step says nothing about this one.
    pub fn turn(&mut self) {
        self.last.clear();
    }

    /// The move of each tool in the last step; empty if it does not count.
    pub fn last(&self) -> &[Move] {
        &self.last
    }

    /// Steps since the mesh or what it is made of changed.
    pub fn steady(&self) -> usize {
        self.steady
    }

    /// After a step with these moves, the last of so many since the mesh or what it is made of changed.
    pub fn after(last: Vec<Move>, steady: usize) -> Self {
        Self { last, steady, ..Self::default() }
    }

    /// The mesh or what it is made of has changed.
    pub fn jolt(&mut self) {
        self.steady = 0;
    }

    /// Begins a step where the body stands.
    pub fn begin(&mut self, state: &BodyState) {
        self.from = state.standing();
    }

    /// Moves the free vertices, and pressures, as the last step did, scaled as the moves of the tools are. Returns
    /// that factor, which also holds for the growth of the probes' forces; 0 if the tools move
    /// otherwise than before.
    ///
    /// Under a steady hand this leaves a residual of second order in the step, and of third order where nothing
    /// presses and the mesh has stayed: then the change from step to step goes on too.
    pub fn follow(&mut self, moves: Vec<Move>, state: &mut BodyState, step_s: f64) -> f64 {
        self.now = moves;
        let share = self.share();
        self.share = share;
        if share == 0.0 {
            return share;
        }
        let first = share * step_s;
        let second =
            if self.steady < STEADY { 0.0 } else { share * (share + 1.0) * step_s.powi(2) };
        for v in 0..state.positions.len() {
            if state.holds[v] == Hold::Free {
                state.positions[v] += first * state.velocities[v] + second * state.accelerations[v];
            }
            let change = first * state.pressure_rates[v] + second * state.pressure_bends[v];
            let pressure = state.body.pressure(v) + change;
            state.body.set_pressure(v, pressure);
        }
        share
    }

    /// Ends a step; `continues` tells whether the next one may start as this one went, `is_smooth` whether the change from
    /// this step to the next will be as that to this one. Sets what it then starts with: velocities and rates
    /// of pressures, and as accelerations the divided differences of second order, Newton's interpolation.
    pub fn end(&mut self, continues: bool, is_smooth: bool, state: &mut BodyState, step_s: f64) {
        self.last.clear();
        if continues {
            std::mem::swap(&mut self.last, &mut self.now);
        }
        self.steady += 1;
        // By what this step went on otherwise than the last.
        let bend = match continues && is_smooth && self.steady >= STEADY {
            true => self.share / (self.share + 1.0) / step_s,
            false => 0.0,
        };
        for (v, from) in self.from.positions.iter().enumerate() {
            let moved = (state.positions[v] - from) / step_s;
            state.accelerations[v] = bend * (moved - self.share * state.velocities[v]);
            state.velocities[v] = if continues { moved } else { Vector3::zeros() };
        }
        for (v, from) in self.from.pressures.iter().enumerate() {
            let changed = (state.body.pressure(v) - from) / step_s;
            state.pressure_bends[v] = bend * (changed - self.share * state.pressure_rates[v]);
            state.pressure_rates[v] = if continues { changed } else { 0.0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trend(last: [f64; 6], now: [f64; 6]) -> f64 {
        let one = |x: [f64; 6]| vec![(3, Vector6::from(x))];
        Predictor { last: one(last), now: one(now), ..Predictor::default() }.share()
    }

    fn way(x: f64, y: f64) -> [f64; 6] {
        [x, y, 0.0, 0.0, 0.0, 0.0]
    }

    fn turned(way: f64, turn: f64) -> [f64; 6] {
        [way, 0.0, 0.0, 0.0, turn, 0.0]
    }

    /// A vertex and its pressure that go with the square of the way of a tool, in steps of any lengths.
    #[test]
    fn a_body_that_bends_off_is_met_where_it_goes() {
        let mut state = BodyState::new(yawara_corot::Body::mixed(yawara_embed::P1P1::default()));
        let at = |way: f64| Vector3::new(way * way + 2.0 * way, -way, 0.5 * way * way);
        let zero = Vector3::zeros();
        state.add_vertex(yawara_mesh::VertexId(0), zero, zero, Hold::Free);
        state.body.set_pressure(0, 0.0);
        let mut predictor = Predictor::default();
        let (mut gone, step_s) = (0.0, 0.1);
        for (number, step) in [1.0, 1.5, 1.2, 0.9, 1.4].into_iter().enumerate() {
            predictor.begin(&state);
            let share = predictor.follow(vec![(0, way(step, 0.0).into())], &mut state, step_s);
            gone += step;
            let (missed, off) =
                (state.positions[0] - at(gone), state.body.pressure(0) - gone.powi(2));
            match number {
                0 => assert_eq!((share, state.positions[0]), (0.0, zero)),
                1 | 2 => assert!(missed.norm() > 0.1 && off.abs() > 0.1),
                _ => assert!(missed.norm() < 1e-12 && off.abs() < 1e-12, "{missed:?}, {off}"),
            }
            state.positions[0] = at(gone);
            state.body.set_pressure(0, gone.powi(2));
            predictor.end(true, true, &mut state, step_s);
        }
        // What changes the mesh moves the body as well: the next step starts as the last one went.
        predictor.jolt();
        predictor.begin(&state);
        predictor.follow(vec![(0, way(1.4, 0.0).into())], &mut state, step_s);
        let last = at(gone) - at(gone - 1.4);
        assert!((state.positions[0] - at(gone) - last).norm() < 1e-12);
    }

    #[test]
    fn a_tool_that_goes_on_takes_the_body_along() {
        assert_eq!(trend(way(2e-4, 0.0), way(1e-4, 0.0)), 0.5);
        assert_eq!(trend(way(2e-4, 0.0), way(2e-4, 1e-5)), 1.0);
        assert_eq!(trend(turned(0.0, 0.2), turned(0.0, 0.1)), 0.5);
        assert_eq!(trend(turned(1e-4, 0.2), turned(1e-4, 0.2)), 1.0);
    }

    #[test]
    fn one_that_turns_stops_or_leaps_does_not() {
        for now in [way(-1e-4, 0.0), way(1e-4, 1e-4), way(0.0, 0.0), way(1e-2, 0.0)] {
            assert_eq!(trend(way(1e-4, 0.0), now), 0.0, "{now:?}");
        }
        assert_eq!(trend(way(0.0, 0.0), way(1e-4, 0.0)), 0.0);
        assert_eq!(trend(turned(1e-4, 0.0), turned(1e-4, 0.2)), 0.0);
        assert_eq!(trend(turned(1e-4, 0.2), turned(1e-4, -0.2)), 0.0);
        assert_eq!(Predictor::default().share(), 0.0);
    }
}
