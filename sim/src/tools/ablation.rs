//! `resect`, `coagulate` and `suture`: a ball that changes the labels of what it goes through, or joins what is cut there.

use nalgebra::Vector3;

use super::at_rest::BodyAtRest;
use super::path::{ToolPath, acts, way};
use super::tool::{Edit, Tool};
use crate::error::SimError;
use crate::scene::AblationEntry;

/// A ball of radius R at c + d(t) that makes one label of others, or closes cuts.
pub(super) struct Ablation {
    kind: &'static str,
    centre: Vector3<f64>,
    radius_m: f64,
    labels: Vec<i64>,
    becomes: i64,
    path: ToolPath,
    begin_s: Option<f64>,
    release_s: Option<f64>,
}

impl Ablation {
    pub fn new(
        entry: &AblationEntry,
        kind: &'static str,
        key: &str,
        body: &mut BodyAtRest<'_>,
    ) -> Result<Self, SimError> {
        let becomes = entry.becomes.unwrap_or(0);
        for (key, label) in entry
            .labels
            .iter()
            .map(|label| (format!("{key}.labels"), *label))
            .chain([(format!("{key}.becomes"), becomes)])
        {
            if !body.has_label(label) {
                let want = "a label of the image, or of a material of the scene";
                return Err(SimError::value(body.name(), &key, label, want));
            }
        }
        Ok(Self {
            kind,
            centre: body.places().start_of(entry.start(body.name(), key)?, key)?,
            radius_m: entry.radius_m,
            labels: entry.labels.clone(),
            becomes,
            path: ToolPath::read(&entry.path, entry.path_csv.as_deref(), body.axes())?,
            begin_s: entry.begin_s,
            release_s: entry.release_s,
        })
    }
}

impl Tool for Ablation {
    fn kind(&self) -> &'static str {
        self.kind
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
        self.centre + self.path.motion(t).0
    }

    fn path(&self) -> Option<&ToolPath> {
        Some(&self.path)
    }

    fn path_mut(&mut self) -> Option<&mut ToolPath> {
        Some(&mut self.path)
    }

    fn edit(&self, from: f64, to: f64) -> Option<Edit> {
        let sweep = way(self.begin_s, self.release_s, from, to)?.map(|t| self.reference(t));
        let radius_m = self.radius_m;
        Some(match self.kind {
            "suture" => Edit::Close { sweep, radius_m },
            _ => {
                Edit::Labels { sweep, radius_m, labels: self.labels.clone(), becomes: self.becomes }
            }
        })
    }
}
