//! What can be wrong with a scene or a run.

use std::fmt::Display;
use std::path::PathBuf;

use yawara_corot::CorotError;
use yawara_embed::EmbedError;
use yawara_inverse_update::InverseError;
use yawara_mesh::{BisectionError, ImageError, SurfaceError, TetMeshError};

use crate::body::LabelVoxels;
use crate::output::ResumeError;

/// Why a scene was refused or a run ended.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimError {
    /// A file could not be read or written, and why.
    #[error("{path}: {1}", path = .0.display())]
    Io(PathBuf, #[source] std::io::Error),
    /// A value outside its range: of a scene, a file, an option or a frame.
    #[error("{place}: {key} is {value}, want {want}")]
    Value {
        /// The scene (a file or a built-in name), or what else holds the value.
        place: String,
        /// The key, e.g. `materials[2].poisson_ratio`.
        key: String,
        /// Its value.
        value: String,
        /// The admissible range.
        want: String,
    },
    /// A scene file that is no TOML, or an override that can't be applied.
    #[error("{place}: {reason}")]
    Syntax {
        /// The file (or built-in name) with line and column, or the override as given.
        place: String,
        /// What is wrong.
        reason: String,
    },
    /// A key that scenes do not have.
    #[error("{place}: unknown key `{key}`; {hint}")]
    UnknownKey {
        /// The scene and its line, or the override.
        place: String,
        /// The key, e.g. `materials[2].youngs_modulus`.
        key: String,
        /// The nearest valid key, or all of them.
        hint: String,
    },
    /// A key that scenes must have.
    #[error("{place}: {key} is missing, want {want}")]
    MissingKey {
        /// The scene.
        place: String,
        /// The key.
        key: String,
        /// What it should hold.
        want: String,
    },
    /// A scene name that is neither built in nor a file.
    #[error("scene \"{name}\" is neither a built-in scene ({choices}) nor a file")]
    UnknownScene {
        /// What was asked for.
        name: String,
        /// The built-in scenes.
        choices: String,
    },
    /// A run directory that holds something already.
    #[error(
        "{}: the directory is not empty; choose another with --out, or replace an earlier run \
         there with --force",
        .0.display()
    )]
    NotEmpty(PathBuf),
    /// Something else where a run directory should be.
    #[error("{}: not a directory; choose another place with --out", .0.display())]
    NotADirectory(PathBuf),
    /// A scene without an image.
    #[error("{0}: the scene names no image; give the label map with --set image.path=FILE.nii.gz")]
    NoImage(String),
    /// An image without any voxel of the body.
    #[error("{0}: nothing but background, want at least one voxel with a label other than 0")]
    Empty(String),
    /// An image of which no intensity lies in a material's range, and its smallest and largest value
    /// after smoothing.
    #[error("{0}: no voxel lies in a range of [[materials]]; its values go from {1} to {2}")]
    NothingInRange(String, f32, f32),
    /// Labels of the image that the scene says nothing about.
    #[error(
        "{image}: {} but [[materials]] has no entry for them; make them void with --set \
         'image.ignore_labels=[{}]' (image.ignore_others=true does that to whatever has none) or give \
         all others one material with --set \
         'materials.{entries}={{ other = true, young_modulus_pa = 8e3, poisson_ratio = 0.45 }}'",
        in_words(labels),
        numbers(labels)
    )]
    LabelsWithoutMaterial {
        /// The image.
        image: String,
        /// The labels as in the image.
        labels: Vec<LabelVoxels>,
        /// How many entries `[[materials]]` has.
        entries: usize,
    },
    /// An image of intensities, as it seems, that was read as a label map: the image, how many labels
    /// have no material, the smallest and the largest.
    #[error(
        "{0} does not look like a label map: {1} different values from {2} to {3} have no entry in \
         [[materials]]; if it is a CT, give the materials a range each (as the scene abdomen_ct \
         does) in place of a label"
    )]
    IntensitiesAsLabels(String, usize, i64, i64),
    /// A body of a size that is most likely a mistake of units: the image, and its edges, mm.
    #[error(
        "{image}: the body is {} x {} x {} mm across, want a longest side of 1 mm to 5 m; say with \
         --set image.unit=m (or cm, mm, um) in which unit the file's spacings are, mm to take them as \
         they stand", size_mm[0], size_mm[1], size_mm[2]
    )]
    BodySize {
        /// The image.
        image: String,
        /// Along right, anterior, superior.
        size_mm: [f64; 3],
    },
    /// Nothing holds the body: the image, and the edge of a base cell, mm.
    #[error(
        "nothing of {0} is fixed: no region in [[fixed]] holds three vertices off one line \
         that touch material, on a mesh of {1} mm base cells; enlarge a region (fractions \
         of the organ's box) or choose a smaller mesh.base_mm"
    )]
    NothingFixed(String, f64),
    /// A tag of a mesh file that the scene says nothing about: the tag, the file, how many tetrahedra
    /// have it.
    #[error("tag {0} occurs in {1} ({2} tetrahedra) but [[materials]] has no entry for it")]
    TagWithoutMaterial(i64, String, u64),
    /// Nothing holds a mesh from a file.
    #[error(
        "nothing of {0} is fixed: no region in [[fixed]] holds three vertices off one line; \
         enlarge a region (fractions of the mesh's bounding box)"
    )]
    MeshNotFixed(String),
    /// A start mesh beyond the budget.
    #[error("the start mesh has {count} vertices, want at most mesh.max_vertices = {limit}")]
    TooManyVertices {
        /// How many there are.
        count: usize,
        /// The limit.
        limit: usize,
    },
    /// An equilibrium whose tangent is singular: the step.
    #[error(
        "step {0}: the body answers to a small change of its materials without bound, or its tangent is not resolved; \
         take shorter steps, or measure where it is less deformed"
    )]
    NoResponse(usize),
    /// A tool that reaches nothing.
    #[error(
        "{key} lies outside the body of {image}: the nearest that can be held or loaded is \
         {distance_mm:.3} mm from its middle, want one inside it or within {limit_mm:.3} mm"
    )]
    ToolOutside {
        /// The key of the region or point.
        key: String,
        /// The image.
        image: String,
        /// Distance to the nearest vertex or point of the material, mm.
        distance_mm: f64,
        /// The limit, mm.
        limit_mm: f64,
    },
    /// A load on a region without material.
    #[error(
        "{key}: no material of {image} lies in the region, want one that holds the middle of a \
         voxel that is not void (or at_mm, a point, in its place)"
    )]
    NoMaterial {
        /// The key of the region.
        key: String,
        /// The image or mesh.
        image: String,
    },
    /// A patch without surface.
    #[error("{key}: no surface of {image} lies in the region, want one that reaches its outline")]
    PatchEmpty {
        /// The key of the region.
        key: String,
        /// The image or mesh.
        image: String,
    },
    /// A tool that the scene does not have, or that can't be led.
    #[error("tool {tool} {reason}; the scene has {count} tool(s), numbered from 0")]
    NoSuchTool {
        /// What was asked for.
        tool: usize,
        /// What is wrong with it.
        reason: &'static str,
        /// How many there are.
        count: usize,
    },
    /// A pose that no tool can take.
    #[error("tool {tool}: pose has {value}, want {want}")]
    Pose {
        /// The tool.
        tool: usize,
        /// The first value out of range.
        value: f64,
        /// The range.
        want: &'static str,
    },
    /// The compliance of held vertices is not positive definite: the inverse is damaged.
    #[error("the compliance of {0} held vertices is not positive definite")]
    ComplianceNotPositive(usize),
    /// A run that can't be gone on with.
    #[error(transparent)]
    Resume(#[from] ResumeError),
    /// A checkpoint of another scene: the scene that was to go on from it.
    #[error("{0}: the checkpoint is of another scene")]
    OtherCheckpoint(String),
    /// A checkpoint by other stages.
    #[error("{scene}: the checkpoint is by {stage} `{made}`, the simulation has `{has}`")]
    OtherStage {
        /// The scene that was to go on from it.
        scene: String,
        /// The first stage of the plan that differs.
        stage: String,
        /// What it was.
        made: String,
        /// What it is.
        has: String,
    },
    /// An unknown name, and the known ones.
    #[error("no indicator `{0}`; there are {names}", names = .1.join(", "))]
    UnknownIndicator(String, &'static [&'static str]),
    /// An element of one's own with unknowns that no body has.
    #[error(
        "the element `{element}` has {unknowns} unknowns per vertex, {negative} of them with \
         negative pivots, want 3 and 0 (as p1) or 4 and 1 (as p1p1)"
    )]
    ElementUnknowns {
        /// The element.
        element: &'static str,
        /// Unknowns per vertex.
        unknowns: usize,
        /// How many of them have negative pivots.
        negative: usize,
    },
    /// Something this build leaves out, and the cargo feature that it needs.
    #[error("{0} needs the feature `{1}`, which this build leaves out")]
    FeatureMissing(String, &'static str),
    /// The forest or its label tree refused.
    #[error(transparent)]
    Bisection(#[from] BisectionError),
    /// The image was refused.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// The surface was refused.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
    /// The mesh of another program was refused.
    #[error(transparent)]
    TetMesh(#[from] TetMeshError),
    /// The embedding refused.
    #[error(transparent)]
    Embed(#[from] EmbedError),
    /// A co-rotational stage refused.
    #[error(transparent)]
    Corot(#[from] CorotError),
    /// The inverse refused.
    #[error(transparent)]
    Inverse(#[from] InverseError),
    /// No graphics adapter, or several, that the scene could mean.
    #[cfg(feature = "gpu")]
    #[error("stages.gpu_adapter: {0}")]
    Adapter(#[source] yawara_gpu::GpuError),
    /// No graphics adapter.
    #[cfg(feature = "gpu")]
    #[error(transparent)]
    Gpu(#[from] yawara_gpu::GpuError),
}

/// Labels with their voxels.
fn in_words(labels: &[LabelVoxels]) -> String {
    let words: Vec<String> = labels
        .iter()
        .map(|LabelVoxels { label, voxels }| format!("label {label} ({voxels} voxels)"))
        .collect();
    format!("{} occur{}", words.join(", "), if labels.len() == 1 { "s" } else { "" })
}

fn numbers(labels: &[LabelVoxels]) -> String {
    labels.iter().map(|one| one.label.to_string()).collect::<Vec<_>>().join(", ")
}

impl SimError {
    /// The refusal of the value at `key` of `place`.
    pub fn value(place: &str, key: &str, value: impl Display, want: impl Into<String>) -> Self {
        let (place, key, value) = (place.into(), key.into(), value.to_string());
        Self::Value { place, key, value, want: want.into() }
    }
}
