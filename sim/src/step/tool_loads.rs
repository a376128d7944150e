//! Loads of tools on vertices while a step is solved.

use nalgebra::Vector3;
use yawara_corot::Following;

use crate::body::BodyState;
use crate::tools::Tool;

/// What tools load the body with at the end of a step: what follows it within a solve, and what lags behind, to be
/// renewed after one.
pub(super) struct ToolLoads<'a> {
    /// What follows.
    pub following: Vec<Following>,
    lagging: Vec<&'a dyn Tool>,
    t: f64,
}

impl<'a> ToolLoads<'a> {
    /// Those of tools that act at time `t`; all of them lag unless the solver `follows`.
    pub fn new(state: &BodyState, tools: &'a [Box<dyn Tool>], t: f64, follows: bool) -> Self {
        let (mut following, mut lagging) = (Vec::new(), Vec::new());
        for tool in tools.iter().filter(|tool| tool.acts_at(t)) {
            let own = if follows { tool.following(state, t) } else { Vec::new() };
            if own.is_empty() {
                lagging.push(&**tool);
            }
            following.extend(own);
        }
        Self { following, lagging, t }
    }

    /// What lags as it is where the body is now, by vertex number, N.
    pub fn lagging(&self, state: &BodyState) -> Vec<Vector3<f64>> {
        let mut loads = vec![Vector3::zeros(); state.positions.len()];
        self.lagging.iter().for_each(|tool| tool.add_loads(state, self.t, &mut loads));
        loads
    }

    /// Adds what follows as it is at `positions` to `loads`, N by vertex number.
    pub fn add_following(&self, positions: &[Vector3<f64>], loads: &mut [Vector3<f64>]) {
        self.following.iter().for_each(|one| one.add_forces(positions, loads));
    }
}
