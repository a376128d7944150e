//! `scalpel`: a blade that cuts what it sweeps over.

use nalgebra::Vector3;

use super::at_rest::BodyAtRest;
use super::path::{ToolPath, acts, way};
use super::tool::{Blade, Edit, Tool};
use crate::error::SimError;
use crate::scene::ScalpelEntry;

/// A blade with its tip at c + d(t) and the other end of its edge at c + d(t) + e.
pub(super) struct Scalpel {
    tip: Vector3<f64>,
    edge: Vector3<f64>,
    level: Option<u8>,
    toughness_j_m2: f64,
    path: ToolPath,
    begin_s: Option<f64>,
    release_s: Option<f64>,
}

impl Scalpel {
    pub fn new(
        entry: &ScalpelEntry,
        key: &str,
        body: &mut BodyAtRest<'_>,
    ) -> Result<Self, SimError> {
        Ok(Self {
            tip: body.places().start_of(entry.start(body.name(), key)?, key)?,
            edge: body.axes().to_solver_direction(&Vector3::from(entry.edge_m)),
            level: entry.level,
            toughness_j_m2: entry.toughness_j_m2.unwrap_or(0.0),
            path: ToolPath::read(&entry.path, entry.path_csv.as_deref(), body.axes())?,
            begin_s: entry.begin_s,
            release_s: entry.release_s,
        })
    }
}

impl Tool for Scalpel {
    fn kind(&self) -> &'static str {
        "scalpel"
    }

    fn acts_at(&self, t: f64) -> bool {
        acts(self.begin_s, self.release_s, t)
    }

    fn begin_s(&self) -> Option<f64> {
        self.begin_s
    }

    fn release(&mut self, at_s: f64) {
        self.release_s = Some(at_s);
    }

    fn reference(&self, t: f64) -> Vector3<f64> {
        self.tip + self.path.motion(t).0
    }

    fn path(&self) -> Option<&ToolPath> {
        Some(&self.path)
    }

    fn path_mut(&mut self) -> Option<&mut ToolPath> {
        Some(&mut self.path)
    }

    fn edit(&self, from: f64, to: f64) -> Option<Edit> {
        let edge = |t: f64| [self.reference(t), self.reference(t) + self.edge];
        let way = way(self.begin_s, self.release_s, from, to)?;
        let (level, toughness_j_m2) = (self.level, self.toughness_j_m2);
        Some(Edit::Cut { blade: Blade { edges: way.map(edge) }, level, toughness_j_m2 })
    }
}
