//! What one step has measured, for those after it in which nothing moves.

use nalgebra::Vector3;

use crate::body::{BodyState, Hold};
use crate::report::{GoalReport, ToolReport};

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
    pub found: Found,
}

#[derive(Clone)]
pub(super) struct Found {
    /// What the body stores, J, if what the mesh wants was asked for.
    pub stored_j: Option<f64>,
    pub error_estimate: Option<f64>,
    /// By tool.
    pub force_errors_n: Vec<Option<f64>>,
    pub goal: Option<GoalReport>,
}

impl Stood {
    fn has_not_moved(&self, state: &BodyState) -> bool {
        let both = || self.positions.iter().zip(&state.positions);
        let [moved, size] = both().fold([0.0_f64; 2], |[moved, size], (then, now)| {
            [moved.max((now - then).amax()), size.max(now.amax())]
        });
        moved <= NO_MOVE * size
    }

    /// What was `found` of a body in a step.
    pub fn new(state: &BodyState, felt: &[ToolReport], ranks: bool, found: Found) -> Self {
        Self {
            positions: state.positions.clone(),
            holds: state.holds.clone(),
            stamps: (0..state.elements().len()).map(|i| state.body.stamp(i)).collect(),
            felt: felt.to_vec(),
            ranks,
            found,
        }
    }

    /// Whether that would be found again.
    pub fn is(&self, state: &BodyState, felt: &[ToolReport], ranks: bool) -> bool {
        let goes_on = state.is_dynamic || state.body.law().state_len() > 0;
        let elements = state.elements().len();
        !goes_on
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
