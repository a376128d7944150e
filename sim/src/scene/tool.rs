//! What a scene file says of tools and of the places that they act on.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::region::{Region, Way, one};
use crate::SimError;

/// A tool by its `kind`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum ToolEntry {
    /// Takes hold of vertices and moves them.
    Grab(GrabEntry),
    /// A ball that pushes the surface.
    Probe(ProbeEntry),
    /// A pressure on a part of the surface.
    Pressure(PressureEntry),
    /// A dead load: a force and a torque on material, or a traction on a part of the surface.
    Load(LoadEntry),
    /// A ball that makes void of the material that it goes through.
    Resect(AblationEntry),
    /// A ball that makes another material of it.
    Coagulate(AblationEntry),
    /// A blade that cuts what it goes through.
    Scalpel(ScalpelEntry),
    /// A ball that joins cut faces again.
    Suture(AblationEntry),
}

/// Where a tool goes, and when it lets go.
pub(crate) struct Course<'a> {
    pub path: &'a mut Vec<Key>,
    pub path_csv: &'a mut Option<PathBuf>,
    pub release_s: &'a mut Option<f64>,
}

impl ToolEntry {
    /// Its `kind`.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Grab(_) => "grab",
            Self::Probe(_) => "probe",
            Self::Pressure(_) => "pressure",
            Self::Load(_) => "load",
            Self::Resect(_) => "resect",
            Self::Coagulate(_) => "coagulate",
            Self::Scalpel(_) => "scalpel",
            Self::Suture(_) => "suture",
        }
    }

    /// Its course, if it moves.
    pub(crate) fn course_mut(&mut self) -> Option<Course<'_>> {
        let (path, path_csv, release_s) = match self {
            Self::Grab(it) => (&mut it.path, &mut it.path_csv, &mut it.release_s),
            Self::Probe(it) => (&mut it.path, &mut it.path_csv, &mut it.release_s),
            Self::Resect(it) | Self::Coagulate(it) | Self::Suture(it) => {
                (&mut it.path, &mut it.path_csv, &mut it.release_s)
            }
            Self::Scalpel(it) => (&mut it.path, &mut it.path_csv, &mut it.release_s),
            Self::Pressure(_) | Self::Load(_) => return None,
        };
        Some(Course { path, path_csv, release_s })
    }

    /// Whether it cuts, or closes cuts.
    pub(crate) fn cuts(&self) -> bool {
        matches!(self, Self::Scalpel(_) | Self::Suture(_))
    }

    /// Whether it changes what the body is made of.
    pub(crate) fn edits(&self) -> bool {
        self.cuts() || self.ablation().is_some()
    }

    /// What changes labels.
    pub(crate) fn ablation(&self) -> Option<&AblationEntry> {
        match self {
            Self::Resect(it) | Self::Coagulate(it) => Some(it),
            _ => None,
        }
    }
}

/// Takes hold of the body in a region and moves it along a path.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GrabEntry {
    /// What it takes hold of, at rest.
    pub region: Region,
    /// How it holds that.
    #[serde(default)]
    pub hold: GrabHold,
    /// κ of a `pad`, N/m⁴; as that of a support if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stiffness_n_m4: Option<f64>,
    /// Positions over time, ascending times; linear in between, held at both ends.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub path: Vec<Key>,
    /// The same from a file with the columns time_s, x_m, y_m, z_m and, if there, turn_deg.
    pub path_csv: Option<PathBuf>,
    /// Axis of `turn_deg` in scanner axes, through the region's centre.
    #[serde(default = "default_axis")]
    pub turn_axis: [f64; 3],
    /// When it takes hold of the mean of its material, s; from the start if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub begin_s: Option<f64>,
    /// When it lets go, s; never if absent.
    pub release_s: Option<f64>,
}

/// What of the body a grab holds, and how.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum GrabHold {
    /// The weighted mean of the region's material, in place and turn: six constraints.
    #[default]
    Mean,
    /// The region's material, elastically: ½ ∫ κ w |x − y|².
    Pad,
    /// The mesh's vertices in the region, rigidly, and those that come in there.
    Vertices,
}

/// A ball without friction that pushes the body's surface along a path, and never pulls.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProbeEntry {
    /// Where its centre is before it moves, fractions of the organ's bounding box.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub centre: Option<[f64; 3]>,
    /// The same in scanner RAS, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub centre_mm: Option<[f64; 3]>,
    /// The same as voxel indices of the image file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub centre_voxel: Option<[f64; 3]>,
    /// Its radius, m.
    pub radius_m: f64,
    /// As for a grab; turns do nothing.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub path: Vec<Key>,
    /// As for a grab.
    pub path_csv: Option<PathBuf>,
    /// Distance between the surface points that may touch it, m; a quarter of the radius if absent.
    pub spacing_m: Option<f64>,
    /// When it comes, s; from the start if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub begin_s: Option<f64>,
    /// When it is taken away, s; never if absent.
    pub release_s: Option<f64>,
}

impl ProbeEntry {
    /// Where its centre is before it moves; `place` and `key` (the entry's) begin messages.
    ///
    /// # Errors
    /// [`SimError::MissingKey`] or [`SimError::Value`] unless that is given in one way.
    pub(crate) fn start(&self, place: &str, key: &str) -> Result<(Way, [f64; 3]), SimError> {
        let ways = [self.centre, self.centre_mm, self.centre_voxel];
        one(place, &format!("{key}.centre"), ways)
    }
}

/// A ball that changes the labels of the material that it goes through, voxel by voxel, where the body is then. It
/// is in nobody's way and feels nothing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AblationEntry {
    /// Where its centre is before it moves, fractions of the organ's bounding box.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub centre: Option<[f64; 3]>,
    /// The same in scanner RAS, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub centre_mm: Option<[f64; 3]>,
    /// The same as voxel indices of the image file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub centre_voxel: Option<[f64; 3]>,
    /// Its radius, m.
    pub radius_m: f64,
    /// The labels that it changes; all but void if empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub labels: Vec<i64>,
    /// The label that they become under `coagulate`, of a material of the scene.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub becomes: Option<i64>,
    /// As for a grab; turns do nothing.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub path: Vec<Key>,
    /// As for a grab.
    pub path_csv: Option<PathBuf>,
    /// When it begins to act, s; from the start if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub begin_s: Option<f64>,
    /// When it ends, s; never if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub release_s: Option<f64>,
}

impl AblationEntry {
    /// As [`ProbeEntry::start`].
    pub(crate) fn start(&self, place: &str, key: &str) -> Result<(Way, [f64; 3]), SimError> {
        let ways = [self.centre, self.centre_mm, self.centre_voxel];
        one(place, &format!("{key}.centre"), ways)
    }
}

/// A blade: what its edge sweeps over is cut, where the body is then. It is in nobody's way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ScalpelEntry {
    /// Where its tip is before it moves, fractions of the organ's bounding box.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub centre: Option<[f64; 3]>,
    /// The same in scanner RAS, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub centre_mm: Option<[f64; 3]>,
    /// The same as voxel indices of the image file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub centre_voxel: Option<[f64; 3]>,
    /// From its tip to the other end of its edge in scanner axes, m.
    pub edge_m: [f64; 3],
    /// The least level of the tetrahedra that it cuts: coarser ones are bisected before. As they are if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub level: Option<u8>,
    /// Energy that a new cut of one square metre takes, J/m²; what it takes in all is reported.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub toughness_j_m2: Option<f64>,
    /// As for a grab; turns do nothing.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub path: Vec<Key>,
    /// As for a grab.
    pub path_csv: Option<PathBuf>,
    /// When it begins to cut, s; from the start if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub begin_s: Option<f64>,
    /// When it ends, s; never if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub release_s: Option<f64>,
}

impl ScalpelEntry {
    /// As [`ProbeEntry::start`].
    pub(crate) fn start(&self, place: &str, key: &str) -> Result<(Way, [f64; 3]), SimError> {
        let ways = [self.centre, self.centre_mm, self.centre_voxel];
        one(place, &format!("{key}.centre"), ways)
    }
}

/// A pressure on the part of the surface that lies in a region at rest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PressureEntry {
    /// Where.
    pub region: Region,
    /// How much over time, ascending times; linear in between, held at both ends.
    pub pressure: Vec<PressureKey>,
    /// Which way it acts while the surface turns.
    #[serde(default)]
    pub normal: Normal,
}

/// Which way a pressure acts on a surface that has moved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Normal {
    /// Along the normal and on the area as they are now, as a fluid does.
    #[default]
    Following,
    /// Along the normal and on the area at rest: a force that keeps its direction.
    Dead,
}

/// A pressure at a time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PressureKey {
    /// When, s.
    pub time_s: f64,
    /// Against the outward normal, Pa; negative is suction.
    pub pressure_pa: f64,
}

/// A load that keeps its direction and size however the body moves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LoadEntry {
    /// The material, or for a traction the part of the surface, that it acts on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub region: Option<Region>,
    /// In its place the point of the material that a force acts on, scanner RAS, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_mm: Option<[f64; 3]>,
    /// How much over time, ascending times; linear in between, held at both ends.
    pub load: Vec<LoadKey>,
}

/// A load at a time, in scanner axes; what is absent is zero.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LoadKey {
    /// When, s.
    pub time_s: f64,
    /// Total force, spread evenly over the material's volume, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_n: Option<[f64; 3]>,
    /// Total torque at rest beside the force, N m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque_n_m: Option<[f64; 3]>,
    /// Force by area at rest on the surface, in place of both, Pa.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub traction_pa: Option<[f64; 3]>,
}

/// A point of a tool's path.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Key {
    /// When, s.
    pub time_s: f64,
    /// Displacement from rest in scanner axes, m.
    #[serde(default)]
    pub move_m: [f64; 3],
    /// Turn from rest about `turn_axis`, degrees.
    #[serde(default)]
    pub turn_deg: f64,
}

fn default_axis() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}
