//! Where the energy of a body came from and where it went.

use serde::{Deserialize, Serialize};

/// What changes of one kind did to an energy; each sign by itself, since what one adds is no excuse for
/// what another takes away.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EnergyChange {
    /// Σ of those above zero, J.
    pub added_j: f64,
    /// −Σ of those below zero, J.
    pub removed_j: f64,
}

impl EnergyChange {
    /// Takes a change of `change` J into account.
    pub(crate) fn add(&mut self, change: f64) {
        self.added_j += change.max(0.0);
        self.removed_j += (-change).max(0.0);
    }

    /// Whether there was none.
    fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// What was added less what was removed, J.
    pub fn net_j(&self) -> f64 {
        self.added_j - self.removed_j
    }
}

/// The energy of a quasi-static body over a run:
///
/// tools + weight + splits + merges + holds + edits = stored + released − created.
///
/// Work is the trapezoidal rule of forces at the ends of steps times motion between them, torques times
/// turns too: its error is of second order in the step's length. Energies are those of the co-rotations
/// `element` and `none`, whose forces derive from one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EnergySummary {
    /// Work of all tools on the body, J.
    pub tools_work_j: f64,
    /// The least that it came to at the end of a step, J, 0 at the start: below zero, tools have had more
    /// out of the body than they had put in.
    pub tools_work_least_j: f64,
    /// Work of the body's weight on it, J.
    pub weight_work_j: f64,
    /// What the body stores at the end, J; at rest nothing.
    pub stored_j: f64,
    /// What materials have turned into heat by the end, J, a part of what is released; absent if their law keeps no
    /// count.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dissipated_j: Option<f64>,
    /// What splits by themselves, with all older vertices where they are, do to what is stored and
    /// to the potential of loads.
    pub splits: EnergyChange,
    /// The same of merges.
    pub merges: EnergyChange,
    /// Work of tools that stand still, in steps after splits and merges, as they bring material back that
    /// these have moved from where it is pressed or held: −½ (force before + force after) · move.
    pub holds: EnergyChange,
    /// What other labels do by themselves: material that goes takes what it stores along.
    #[serde(default, skip_serializing_if = "EnergyChange::is_none")]
    pub edits: EnergyChange,
    /// What equilibrium has given off, J: Σ over the times between two rounds of splits and merges.
    pub released_j: f64,
    /// What has come from nowhere, J, over the times in which more did than was given off: the error of
    /// the trapezoidal rule and of the solver's residual, or energy that is none.
    pub created_j: f64,
    /// The most that did so at a time, J.
    pub created_max_j: f64,
}

impl EnergySummary {
    /// Work and changes so far, J: what there is to store or to release.
    pub(crate) fn given_j(&self) -> f64 {
        let changes = [self.splits, self.merges, self.holds, self.edits].map(|one| one.net_j());
        let changes: f64 = changes.iter().sum();
        self.tools_work_j + self.weight_work_j + changes
    }

    /// Takes into account that between two measurements `given` J came to the body, which stores `more` J
    /// more than before.
    pub(crate) fn close(&mut self, given: f64, more: f64) {
        let left = given - more;
        self.released_j += left.max(0.0);
        self.created_j += (-left).max(0.0);
        self.created_max_j = self.created_max_j.max(-left);
    }
}
