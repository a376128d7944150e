//! What can be wrong with a scene or a run.

use std::path::PathBuf;

use yawara_corot::CorotError;
use yawara_embed::EmbedError;
use yawara_inverse_update::InverseError;
use yawara_mesh::{BisectionError, ImageError, SurfaceError, TetMeshError};

/// Why a scene was refused or a run ended.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimError {
    /// A file could not be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A value of a scene outside its range.
    #[error("{place}: {key} is {value}, want {want}")]
    Value {
        /// The scene (a file or a built-in name).
        place: String,
        /// The key, e.g. `materials[2].poisson_ratio`.
        key: String,
        /// Its value.
        value: String,
        /// The admissible range.
        want: String,
    },
    /// A scene file that is no TOML.
    #[error("{place}: {reason}")]
    Syntax {
        /// The file (or built-in name), line and column.
        place: String,
        /// What the parser wants.
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
    /// An override that can't be applied.
    #[error("--set {argument}: {reason}")]
    Override {
        /// The override as given.
        argument: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A run directory that holds something already.
    #[error(
        "{}: the directory is not empty; choose another with --out, or replace an earlier run \
         there with --force",
        path.display()
    )]
    NotEmpty {
        /// The directory.
        path: PathBuf,
    },
    /// Something else where a run directory should be.
    #[error("{}: not a directory; choose another place with --out", path.display())]
    NotADirectory {
        /// The path.
        path: PathBuf,
    },
    /// A frame whose fields do not fit together.
    #[error("frame: {field}[{index}] is {value}, want {want}")]
    Frame {
        /// The field.
        field: &'static str,
        /// Position in it (its length if that is wrong).
        index: usize,
        /// What stands there.
        value: String,
        /// What should.
        want: String,
    },
    /// A scene without an image.
    #[error(
        "{scene}: the scene names no image; give the label map with --set image.path=FILE.nii.gz"
    )]
    NoImage {
        /// The scene.
        scene: String,
    },
    /// An image without any voxel of the body.
    #[error("{image}: nothing but background, want at least one voxel with a label other than 0")]
    Empty {
        /// The image.
        image: String,
    },
    /// An image of which no intensity lies in a material's range.
    #[error(
        "{image}: no voxel lies in a range of [[materials]]; its values go from {low} to {high}"
    )]
    NothingInRange {
        /// The image.
        image: String,
        /// Its smallest value, after smoothing.
        low: f32,
        /// Its largest.
        high: f32,
    },
    /// A label of the image that the scene says nothing about.
    #[error(
        "label {label} occurs in {image} ({voxels} voxels) but [[materials]] has no entry for it \
         (nor one with other = true, and image.ignore_labels does not name it)"
    )]
    LabelWithoutMaterial {
        /// The label as in the image.
        label: i64,
        /// The image.
        image: String,
        /// How many voxels have it.
        voxels: u64,
    },
    /// Nothing holds the body.
    #[error(
        "nothing of {image} is fixed: no region in [[fixed]] holds three vertices off one line \
         that touch material, on a mesh of {base_mm} mm base cells; enlarge a region (fractions \
         of the organ's box) or choose a smaller mesh.base_mm"
    )]
    NothingFixed {
        /// The image.
        image: String,
        /// Edge of a base cell, mm.
        base_mm: f64,
    },
    /// A tag of a mesh file that the scene says nothing about.
    #[error("tag {tag} occurs in {mesh} ({tets} tetrahedra) but [[materials]] has no entry for it")]
    TagWithoutMaterial {
        /// The tag as in the file.
        tag: i64,
        /// The file.
        mesh: String,
        /// How many tetrahedra have it.
        tets: u64,
    },
    /// Nothing holds a mesh from a file.
    #[error(
        "nothing of {mesh} is fixed: no region in [[fixed]] holds three vertices off one line; \
         enlarge a region (fractions of the mesh's bounding box)"
    )]
    MeshNotFixed {
        /// The file.
        mesh: String,
    },
    /// A start mesh beyond the budget.
    #[error("the start mesh has {count} vertices, want at most mesh.max_vertices = {limit}")]
    TooManyVertices {
        /// How many there are.
        count: usize,
        /// The limit.
        limit: usize,
    },
    /// A tool that reaches nothing.
    #[error(
        "{key} lies outside the body of {image}: the nearest vertex that can be held is \
         {distance_mm:.1} mm from its centre, want one inside it or within {limit_mm:.1} mm"
    )]
    ToolOutside {
        /// The key of the region.
        key: String,
        /// The image.
        image: String,
        /// Distance to the nearest vertex in the organ, mm.
        distance_mm: f64,
        /// The limit, mm.
        limit_mm: f64,
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
    /// An option of a haptic loop out of its range.
    #[error("haptic loop: {key} is {value}, want {low} to {high}")]
    Haptic {
        /// Which one.
        key: &'static str,
        /// Its value.
        value: f64,
        /// The least.
        low: f64,
        /// The most.
        high: f64,
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
    #[error("the compliance of {vertices} held vertices is not positive definite")]
    ComplianceNotPositive {
        /// How many are held.
        vertices: usize,
    },
    /// An unknown name.
    #[error("no indicator `{name}`; there are {}", choices.join(", "))]
    UnknownIndicator {
        /// What was asked for.
        name: String,
        /// What there is.
        choices: &'static [&'static str],
    },
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
    /// Something this build leaves out.
    #[error("{what} needs the feature `{feature}`, which this build leaves out")]
    FeatureMissing {
        /// What was asked for.
        what: String,
        /// The cargo feature.
        feature: &'static str,
    },
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
