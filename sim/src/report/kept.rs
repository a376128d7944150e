//! The sums of a run as they are kept on disk, to be gone on with.

use serde::{Deserialize, Serialize};

use super::records::{EstimateSummary, ForceSummary, GoalReport, MeshSummary, StepSummary};
use super::tool::ToolSummary;

/// Sums, extremes and times over the steps of a run so far.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct KeptStatistics {
    pub mesh: MeshSummary,
    /// 3 r/R and circumradius over shortest edge.
    pub worst: [f64; 2],
    pub steps: StepSummary,
    pub step_ms: Vec<f64>,
    pub solve_ms: Vec<f64>,
    pub estimate: EstimateSummary,
    pub force: ForceSummary,
    pub tools: Vec<ToolSummary>,
    /// Of each tool the last estimate of its force's error over that force.
    pub error_shares: Vec<Option<f64>>,
    pub wall_s: f64,
}

impl KeptStatistics {
    pub fn steps(&self) -> usize {
        self.steps.count
    }
}

/// What things are called in a program, which a file does not say.
pub(crate) struct Names<'a> {
    pub tools: &'a [&'static str],
    pub goal: Option<&'static str>,
}

impl Names<'_> {
    pub fn estimate(&self, kept: EstimateSummary) -> EstimateSummary {
        let named = |goal| GoalReport { name: self.goal.unwrap_or_default(), ..goal };
        EstimateSummary { goal_end: kept.goal_end.map(named), ..kept }
    }

    pub fn tools(&self, kept: &[ToolSummary], shares: &[Option<f64>]) -> Vec<ToolSummary> {
        let all = kept.iter().zip(shares).zip(self.tools);
        let named = |((tool, share), kind): ((&ToolSummary, &Option<f64>), &&'static str)| {
            ToolSummary { kind, error_share: *share, ..tool.clone() }
        };
        all.map(named).collect()
    }
}
