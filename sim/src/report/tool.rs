//! Forces on tools.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// A tool after a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToolReport {
    /// Its kind, as in the scene.
    pub kind: &'static str,
    /// Force of the tool on the body in scanner axes, N: Σ (f_int − f_ext) over what a grab holds,
    /// Σ λ n over what a probe pushes, the load of a pressure, a load. Of a scalpel what its cut takes by
    /// `toughness_j_m2`, which goes into the new surfaces: the body does not feel it.
    pub force_n: [f64; 3],
    /// How far the size of the force is from that on a mesh without end, N; none where it is not known.
    pub force_error_n: Option<f64>,
    /// Torque of the tool on the body about the tool's reference point, scanner axes, N m.
    pub torque_n_m: [f64; 3],
    /// Its work on the body in this step, J: ½ (force before + force after) · motion, and the same of
    /// torque and turn, with an error of third order in the step's length. A turn by more than half a turn in a
    /// step counts as the shorter one.
    pub work_j: f64,
    /// Where its reference point is, scanner RAS, mm: the centre of a grab's region as it has
    /// moved, of a probe, of a pressure's region at rest, the weighted mean at rest of what a load acts on.
    pub reference_mm: [f64; 3],
    /// Vertices or points of material held, points pushed, pieces of surface under a pressure,
    /// vertices under a load.
    pub contacts: usize,
    /// How deep the deepest point of the surface is in a probe, m.
    pub penetration_m: f64,
    /// Whether it stands in the surface's way, and so can push but not pull.
    pub is_unilateral: bool,
}

/// A tool over the run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ToolSummary {
    /// Its kind, as in the scene.
    #[serde(skip_deserializing)]
    pub kind: &'static str,
    /// Largest magnitude of its force, N.
    pub force_max_n: f64,
    /// How far that is from the force on a mesh without end, N, where it is known; by the share that it
    /// was when it was measured last.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_max_error_n: Option<f64>,
    /// Magnitude at the end, N.
    pub force_end_n: f64,
    /// Largest magnitude of its torque, N m.
    pub torque_max_n_m: f64,
    /// Magnitude at the end, N m.
    pub torque_end_n_m: f64,
    /// Its work on the body, J, to second order in the step's length.
    pub work_j: f64,
    /// The most vertices held, points pushed or pieces loaded at a time.
    pub contacts_max: usize,
    /// The deepest penetration, m.
    pub penetration_max_m: f64,
    /// How much of each label it has changed, by label before, cm³.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub changed_cm3: BTreeMap<i64, f64>,
    /// What it has cut, as the area of the blade's way through material, cm².
    #[serde(default, skip_serializing_if = "is_nothing")]
    pub cut_cm2: f64,
    /// The energy that this took, J.
    #[serde(default, skip_serializing_if = "is_nothing")]
    pub cut_j: f64,
    /// Vertices that it has doubled.
    #[serde(default, skip_serializing_if = "is_none")]
    pub doubled: usize,
    /// Doubled vertices that it has made one again.
    #[serde(default, skip_serializing_if = "is_none")]
    pub closed: usize,
    /// Faces between finest tetrahedra that were not cut, for there would have been more than `mesh.max_vertices`.
    #[serde(default, skip_serializing_if = "is_none")]
    pub refused: usize,
    /// Pieces that nothing supported any more and that springs hold since.
    #[serde(default, skip_serializing_if = "is_none")]
    pub parked: usize,
    /// The last estimate of a force's error over that force.
    #[serde(skip)]
    pub(crate) error_share: Option<f64>,
}

/// What a tool has made of the body in a step.
#[derive(Clone, Debug, Default)]
pub(crate) struct Edited {
    pub tool: usize,
    /// By label before.
    pub labels_cm3: BTreeMap<i64, f64>,
    pub cut_m2: f64,
    pub work_j: f64,
    /// Of the blade on the body, scanner axes, N: the work over the way of the middle of its edge, along that.
    pub force_n: [f64; 3],
    pub doubled: usize,
    pub closed: usize,
    pub refused: usize,
    pub parked: usize,
}

fn is_nothing(value: &f64) -> bool {
    *value == 0.0
}

fn is_none(value: &usize) -> bool {
    *value == 0
}

impl ToolSummary {
    /// Takes what it has made of the body into account.
    pub(crate) fn edit(&mut self, edited: &Edited) {
        for (label, cm3) in &edited.labels_cm3 {
            *self.changed_cm3.entry(*label).or_default() += cm3;
        }
        self.cut_cm2 += 1e4 * edited.cut_m2;
        self.cut_j += edited.work_j;
        self.doubled += edited.doubled;
        self.closed += edited.closed;
        self.refused += edited.refused;
        self.parked += edited.parked;
    }

    /// Takes a step into account.
    pub(crate) fn add(&mut self, report: &ToolReport) {
        let norm = |v: &[f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        (self.force_end_n, self.torque_end_n_m) = (norm(&report.force_n), norm(&report.torque_n_m));
        let share = report.force_error_n.map(|error| error / self.force_end_n);
        self.error_share = share.filter(|share| share.is_finite()).or(self.error_share);
        if self.force_end_n > self.force_max_n {
            self.force_max_n = self.force_end_n;
            self.force_max_error_n = self.error_share.map(|share| share * self.force_end_n);
        }
        self.torque_max_n_m = self.torque_max_n_m.max(self.torque_end_n_m);
        self.work_j += report.work_j;
        self.contacts_max = self.contacts_max.max(report.contacts);
        self.penetration_max_m = self.penetration_max_m.max(report.penetration_m);
    }
}
