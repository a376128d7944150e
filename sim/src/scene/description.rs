//! What a scene file says: data only, checked by [`Scene::validate`].

use std::ops::RangeInclusive;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::law::LawEntry;
use super::region::Region;
use super::stage_names::StageNames;
use super::tool::ToolEntry;

/// A scene: body, loads, stages and budgets. Unknown keys are refused.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Name in summaries and file names.
    pub name: String,
    /// One line for `yawara scenes`.
    #[serde(default)]
    pub description: String,
    /// Seed of everything random (the phantom's vessels, the drift monitor's columns).
    #[serde(default = "default_seed")]
    pub seed: u64,
    /// Where the labels come from.
    #[serde(default)]
    pub image: Image,
    /// One entry per label that occurs in the image, or per range of its intensities.
    #[serde(default)]
    pub materials: Vec<MaterialEntry>,
    /// What stands for the void inside base cells.
    #[serde(default)]
    pub void: Void,
    /// Base cells and levels.
    pub mesh: MeshOptions,
    /// Regions that hold the body where it rests.
    #[serde(default)]
    pub fixed: Vec<Region>,
    /// How they hold it.
    #[serde(default)]
    pub support: Support,
    /// Gravity in scanner axes (right, anterior, superior), m/s².
    #[serde(default)]
    pub gravity_m_s2: [f64; 3],
    /// Tools that hold, move or load the body.
    #[serde(default)]
    pub tools: Vec<ToolEntry>,
    /// Steps and their length.
    pub time: Time,
    /// Motion with inertia; without it every step is an equilibrium.
    pub dynamics: Option<Dynamics>,
    /// Which implementation of each stage.
    #[serde(default)]
    pub stages: StageNames,
    /// When to split and merge.
    #[serde(default)]
    pub refinement: Refinement,
    /// How much time a step has for refinement.
    #[serde(default)]
    pub budget: Budget,
    /// When a step counts as solved.
    #[serde(default)]
    pub solver: Solver,
    /// What is written.
    #[serde(default)]
    pub output: Output,
}

/// A volume: a file if `path` is given, else a phantom. A file holds intensities if the materials
/// have ranges, else labels.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Image {
    /// Label map or intensity image (NIfTI, NRRD, MetaImage, VTK or DICOM); replaces the phantom.
    pub path: Option<PathBuf>,
    /// Procedural body.
    pub phantom: Option<Phantom>,
    /// Left-right length of the `liver` phantom, mm.
    pub length_mm: Option<f64>,
    /// Size of the `block` phantom, mm: a whole number of voxels each.
    pub size_mm: Option<[f64; 3]>,
    /// Voxel edge of a phantom, mm; or the voxel edge to which a file is resampled, by default
    /// its smallest one.
    pub voxel_mm: Option<f64>,
    /// The unit of a file's spacings where its header says mm, and is believed if this is absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<LengthUnit>,
    /// Standard deviation of a Gaussian that smooths intensities before they are classified, mm.
    pub blur_mm: Option<f64>,
    /// Labels of a label map that become void.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ignore_labels: Vec<i64>,
    /// Whether all labels of a label map that no entry of the materials names become void.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub ignore_others: bool,
}

impl Image {
    /// The longest side of a body whose unit of length is believed, mm: that of any animal's organ.
    pub const LIKELY_MM: RangeInclusive<f64> = 1.0..=5e3;

    /// By what lengths of the file are multiplied.
    pub(crate) fn unit_mm(&self) -> f64 {
        self.unit.map_or(1.0, LengthUnit::mm)
    }

    /// The spacing to resample to, in the file's unit.
    pub(crate) fn spacing(&self) -> Option<f64> {
        self.voxel_mm.map(|voxel_mm| voxel_mm / self.unit_mm())
    }
}

/// Units of length.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LengthUnit {
    /// Micrometres.
    Um,
    /// Millimetres.
    Mm,
    /// Centimetres.
    Cm,
    /// Metres.
    M,
}

impl LengthUnit {
    /// Its length, mm.
    #[must_use]
    pub fn mm(self) -> f64 {
        match self {
            Self::Um => 1e-3,
            Self::Mm => 1.0,
            Self::Cm => 10.0,
            Self::M => 1e3,
        }
    }
}

/// Procedural bodies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Phantom {
    /// Liver (1) with vessels (2), gallbladder (3) and a tumour (4).
    Liver,
    /// A box of label 1.
    Block,
}

/// Material of a label, of a range of intensities, or of all labels that no other entry names.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MaterialEntry {
    /// The label as it stands in the image; with `range`, the label in outputs (by default the
    /// entry's position counted from 1).
    pub label: Option<i64>,
    /// Intensities from the first number on and below the second, in the image's unit.
    pub range: Option<[f64; 2]>,
    /// Takes all labels that neither another entry nor `ignore_labels` names.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub other: bool,
    /// What it is, for people.
    #[serde(default)]
    pub name: String,
    /// A material of the [library](super::library()), whose numbers stand for those that are absent;
    /// a scene that is read from a file has them below.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
    /// E > 0, Pa.
    pub young_modulus_pa: f64,
    /// −1 < ν < 0.5.
    pub poisson_ratio: f64,
    /// ≥ 0, kg/m³.
    #[serde(default = "default_density")]
    pub density_kg_m3: f64,
    /// What it remembers; linear elasticity if no material has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub law: Option<LawEntry>,
}

/// The ersatz material of void.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Void {
    /// Its Young's modulus as a fraction of the softest material's, 0 < … ≤ 1.
    pub stiffness_ratio: f64,
    /// Its Poisson's ratio.
    pub poisson_ratio: f64,
    /// What a local homogenisation makes of it where it meets tissue.
    pub beside_tissue: BesideTissue,
}

/// What becomes of tetrahedra that are part void.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BesideTissue {
    /// Void is homogenised as a soft material.
    Material,
    /// Void takes away stiffness by its volume.
    #[default]
    Volume,
}

/// How fixed regions hold the body.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Support {
    /// By the material in them, or by the vertices.
    pub hold: SupportHold,
    /// κ of the energy ½ ∫ κ |u|² over the material, N/m⁴; if absent 100 E/h², E of the softest
    /// material and h the edge of a voxel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stiffness_n_m4: Option<f64>,
}

/// What of the body a fixed region holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SupportHold {
    /// The material in it, elastically: the same on every mesh.
    #[default]
    Elastic,
    /// The mesh's vertices in it, rigidly: more of them on a finer mesh.
    Vertices,
}

/// Base cells and levels, or a mesh from a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeshOptions {
    /// Tetrahedra from a Gmsh (.msh) or VTK (.vtu) file in place of an image; never refined.
    pub path: Option<PathBuf>,
    /// Length of a unit of that file, m.
    #[serde(default = "default_unit")]
    pub unit_m: f64,
    /// Edge of a base cell, mm; rounded to a power of two times the voxel edge. A tenth of the body's
    /// longest side if absent.
    pub base_mm: Option<f64>,
    /// Level of the uniform mesh at the start, the floor of merging.
    #[serde(default)]
    pub start_level: u8,
    /// Finest level the simulation may refine to; not beyond `start_level` if absent.
    pub max_level: Option<u8>,
    /// Most vertices the mesh may have.
    #[serde(default = "default_max_vertices")]
    pub max_vertices: usize,
    /// Level down to which the start mesh is refined where tetrahedra hold several labels, which
    /// merging keeps; `start_level` if absent.
    pub label_level: Option<u8>,
    /// Where `label_level` applies; everywhere if absent.
    pub label_region: Option<Region>,
    /// Whether material that only shares tetrahedra of the start mesh hangs together.
    #[serde(default, skip_serializing_if = "Topology::is_merged")]
    pub topology: Topology,
    /// Level down to which tetrahedra around what nothing joins are bisected before it is taken apart, in the topology
    /// `components`, which merging keeps; three beyond `start_level` if absent, or the finest if that is less.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub apart_level: Option<u8>,
}

/// By so many levels the mesh is finer where parts of it are taken apart, unless a scene says otherwise: half the edges.
const APART_LEVELS: u8 = 3;

/// What hangs together in the start mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Topology {
    /// Whatever lies in one tetrahedron, or in two with a common vertex.
    #[default]
    Merged,
    /// What the faces of voxels join. Tetrahedra that hold more than that are there several times, and are not split.
    Components,
}

impl Topology {
    /// Whether it is the one by tetrahedra.
    #[must_use]
    pub fn is_merged(&self) -> bool {
        *self == Self::Merged
    }
}

impl MeshOptions {
    /// Finest level the simulation may refine to.
    pub fn finest_level(&self) -> u8 {
        self.max_level.unwrap_or(self.start_level)
    }

    /// Level down to which it is refined around what is to be apart.
    pub(crate) fn apart_level(&self) -> u8 {
        let absent = || self.finest_level().min(self.start_level.saturating_add(APART_LEVELS));
        self.apart_level.unwrap_or_else(absent)
    }

    /// Whether the simulation may refine at all.
    pub fn refines(&self) -> bool {
        self.finest_level() > self.start_level
    }
}

/// Steps and their length.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Time {
    /// How many steps.
    pub steps: usize,
    /// Length of a step, s.
    pub step_s: f64,
    /// Whether a step that does not converge whole is made in parts, each as long as converges: tools
    /// and loads then go there little by little.
    #[serde(default = "default_adaptive", skip_serializing_if = "Clone::clone")]
    pub adaptive: bool,
}

/// When to split and merge.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Refinement {
    /// Relative error of energy to refine to, with indicators that are energies.
    pub target: f64,
    /// In place of `target` the indicator above which a vertex comes in: J for `energy` and
    /// `residual`, relative volume for `volume`, m for `rotation`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub split_above: Option<f64>,
    /// A vertex goes out when the indicator is below this fraction of `split_above`, or of its share
    /// of `target`.
    pub merge_fraction: f64,
    /// Steps a new vertex stays at least.
    pub dwell_steps: usize,
    /// Splits and merges in one step at most, half of them each unless fewer are wanted: splits of the largest
    /// indicator first, merges of the smallest.
    pub max_splits_per_step: usize,
    /// Every how many steps what is wanted is measured, ≥ 1; above 1 the mesh changes in the steps between. As many as
    /// there are in a fiftieth of a second if absent, and each one of a body with inertia.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub every_steps: Option<usize>,
    /// Over which time a body without inertia comes to feel a change of its mesh, s; in the next step where that is
    /// less than one and a half.
    pub ease_s: f64,
    /// How fine the mesh is where a probe is about to touch, whatever the indicator says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub near_probe: Option<NearProbe>,
    /// A figure whose error is estimated too, and to which the indicator `goal` refines; for that the
    /// force of the first tool if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub goal: Option<GoalEntry>,
}

/// A mesh that is fine before it is touched.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NearProbe {
    /// The least level of tetrahedra there, at most `mesh.max_level`.
    pub level: u8,
    /// How far off the surface of a probe that is, m.
    pub within_m: f64,
}

/// A figure of a run by its `kind`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum GoalEntry {
    /// The size of the force of a tool that holds material or probes, N.
    Force {
        /// Its number, in the order of the scene.
        tool: usize,
    },
    /// How far the material in a region has moved, m.
    Displacement {
        /// Where, at rest.
        region: Region,
        /// Along which direction, in scanner axes.
        direction: [f64; 3],
    },
    /// The volume of the material in a region, m³.
    Volume {
        /// Where, at rest.
        region: Region,
    },
}

impl GoalEntry {
    /// The material that it is of, unless it is of a tool.
    pub fn region(&self) -> Option<&Region> {
        match self {
            Self::Force { .. } => None,
            Self::Displacement { region, .. } | Self::Volume { region } => Some(region),
        }
    }
}

/// Motion with inertia, by implicit Euler.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Dynamics {
    /// How mass lies on vertices.
    pub mass: MassModel,
    /// α of the damping α M v + β K v, 1/s: slows down all motion.
    pub damping_mass_per_s: f64,
    /// β, s: slows down changes of strain.
    pub damping_stiffness_s: f64,
    /// Velocity of all free vertices at the start in scanner axes, m/s.
    pub velocity_m_s: [f64; 3],
    /// Angular velocity at the start, about the centre of mass, in scanner axes, rad/s.
    pub spin_rad_s: [f64; 3],
}

/// How mass lies on vertices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MassModel {
    /// That of velocities linear in every tetrahedron.
    #[default]
    Consistent,
    /// A quarter of a tetrahedron's mass on each corner.
    Lumped,
}

/// How much time a step has for refinement.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Budget {
    /// How long after its beginning a step may look for equilibrium, and vertices come in, ms; acts with
    /// `realtime` alone. A step that has none by then stays where it is, and the next goes on from there.
    pub step_ms: Option<f64>,
    /// Whether the clock may decide: the same scene then no longer gives the same bytes.
    pub realtime: bool,
}

/// When a step counts as solved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Solver {
    /// Relative residual at which a step has converged.
    pub residual: f64,
    /// Iterations per attempt, of each method.
    pub max_iterations: usize,
    /// Iterations per step: no attempt begins after them.
    pub step_iterations: usize,
    /// How often a step that does not converge may be halved.
    pub max_halvings: u32,
}

/// What is written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Output {
    /// A frame every so many steps (and at the start and the end); 0 for none.
    pub frames_every: usize,
    /// Tetrahedra of a frame that are void for the most part, too.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub void: bool,
    /// The smooth outline of all that is not void in every frame, as a file of its own.
    #[serde(skip_serializing_if = "Clone::clone")]
    pub outline: bool,
    /// Every frame as a Gmsh mesh (.msh) too.
    pub msh: bool,
    /// Fields on the image's grid at the end, as NIfTI.
    pub field: bool,
    /// Finest level of the mesh that carries the surfaces; that of one voxel if absent.
    pub surface_level: Option<u8>,
    /// Labels whose outlines every frame has.
    pub surfaces: Vec<SurfaceEntry>,
    /// A checkpoint every so many steps, from which an interrupted run goes on; 0 for none.
    #[serde(skip_serializing_if = "is_none")]
    pub checkpoint_steps: usize,
}

/// The outline of a label.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SurfaceEntry {
    /// The label as it stands in the image.
    pub label: i64,
    /// Width of the blur that rounds off the voxels' stairs; thin tubes (r < 1.18 σ) vanish.
    #[serde(default = "default_sigma")]
    pub sigma_voxels: f64,
}

fn is_none(count: &usize) -> bool {
    *count == 0
}

fn default_seed() -> u64 {
    1
}

fn default_adaptive() -> bool {
    true
}

fn default_density() -> f64 {
    1000.0
}

fn default_sigma() -> f64 {
    1.0
}

fn default_unit() -> f64 {
    1e-3
}

fn default_max_vertices() -> usize {
    3456
}

impl Default for Void {
    fn default() -> Self {
        let beside_tissue = BesideTissue::default();
        Self { stiffness_ratio: 1e-3, poisson_ratio: 0.0, beside_tissue }
    }
}

/// What the mesh should be need not be known more often than a hand feels or an eye sees, s.
const MEASURED_S: f64 = 0.02;

impl Scene {
    /// Every how many steps what the mesh should be is measured.
    pub(crate) fn measured_every(&self) -> usize {
        let of_hand = || match self.dynamics {
            // What moves by itself may be as fast as its steps.
            Some(_) => 1,
            // Not one less for a rounding.
            None => ((MEASURED_S / self.time.step_s + 1e-6) as usize).max(1),
        };
        self.refinement.every_steps.unwrap_or_else(of_hand)
    }
}

impl Default for Refinement {
    fn default() -> Self {
        Self {
            target: 0.1,
            split_above: None,
            merge_fraction: 0.02,
            dwell_steps: 2,
            max_splits_per_step: 200,
            every_steps: None,
            ease_s: 0.03,
            near_probe: None,
            goal: None,
        }
    }
}

impl Default for Solver {
    fn default() -> Self {
        Self { residual: 1e-6, max_iterations: 60, step_iterations: 500, max_halvings: 8 }
    }
}

impl Default for Output {
    fn default() -> Self {
        Self {
            frames_every: 5,
            void: false,
            outline: true,
            msh: false,
            field: false,
            surface_level: None,
            surfaces: Vec::new(),
            checkpoint_steps: 0,
        }
    }
}
