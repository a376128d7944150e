//! What a run keeps for its output.

use std::sync::Arc;

use yawara_mesh::volume::LabelVolume;
use yawara_mesh::{BisectionForest, TetId};

use super::capture::capture;
use super::fields::Fields;
use super::records::{Frame, PlanRow, Summary};
use super::run_statistics::RunStatistics;
use super::surfaces::Surfaces;
use crate::body::{BodyState, BodySummary, ScannerAxes};
use crate::error::SimError;
use crate::inverse::InverseLink;
use crate::scene::Scene;

/// Takes frames, fields and the summary of a body.
pub(crate) struct Recorder {
    pub axes: ScannerAxes,
    pub plan: Vec<PlanRow>,
    /// None for a mesh from a file.
    pub body: Option<BodySummary>,
    /// The labels, if fields are to be written on their grid.
    pub volume: Option<Arc<LabelVolume>>,
    pub surfaces: Option<Surfaces>,
    pub statistics: RunStatistics,
}

impl Recorder {
    /// The current mesh with its fields and surfaces at `time_s`. `forest` and `indicator`, the last
    /// measurement by tetrahedron, are those of a mesh that can be refined.
    pub fn frame(
        &self,
        state: &BodyState,
        forest: Option<&BisectionForest>,
        indicator: Option<&dyn Fn(TetId) -> f64>,
        time_s: f64,
    ) -> Result<Frame, SimError> {
        let mut frame = capture(state, &self.axes, indicator, time_s);
        if let (Some(surfaces), Some(forest)) = (&self.surfaces, forest) {
            frame.surfaces = surfaces.frames(forest, &state.positions, &self.axes)?;
        }
        Ok(frame)
    }

    /// The current state on the image's grid, if the scene asks for that.
    pub fn fields(&self, state: &BodyState) -> Result<Option<Fields>, SimError> {
        self.volume.as_ref().map(|volume| Fields::of(state, volume)).transpose()
    }

    /// Everything that happened so far.
    pub fn summary(
        &self,
        scene: &Scene,
        state: &BodyState,
        forest: Option<&BisectionForest>,
        inverse: &InverseLink,
    ) -> Result<Summary, SimError> {
        let surfaces = match (&self.surfaces, forest) {
            (Some(surfaces), Some(forest)) => surfaces.summary(forest, &state.positions)?,
            _ => Vec::new(),
        };
        let body = self.body.as_ref();
        Ok(self.statistics.summary(scene, &self.plan, body, inverse, surfaces))
    }
}
