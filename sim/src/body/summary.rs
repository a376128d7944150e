//! What a body was made of: the image, its parts and the refinement of the start mesh.

use serde::Serialize;

/// A label and how often it occurs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct LabelVoxels {
    /// The label.
    pub label: i64,
    /// Its voxels.
    pub voxels: u64,
}

/// What one entry of `[[materials]]` took.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct MaterialVoxels {
    /// The entry's name.
    pub name: String,
    /// True for the entry that takes the labels that no other names.
    pub other: bool,
    /// The labels it took, as in outputs.
    pub labels: Vec<LabelVoxels>,
    /// Their voxels.
    pub voxels: u64,
}

/// The image as it was read, after resampling and classification.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ImageSummary {
    /// The file, or which phantom.
    pub name: String,
    /// Its format, e.g. `NIfTI`; `procedural` for a phantom.
    pub format: String,
    /// `label map` or `intensities`.
    pub content: &'static str,
    /// Voxels in the file along right, anterior, superior.
    pub stored_dims: [usize; 3],
    /// Their edges, mm.
    pub stored_voxel_mm: [f64; 3],
    /// Whether other voxels were made of them.
    pub resampled: bool,
    /// Voxels used along the same axes.
    pub dims: [usize; 3],
    /// Their edge, mm.
    pub voxel_mm: f64,
    /// Standard deviation of the smoothing of intensities, mm; 0 for none.
    pub blur_mm: f64,
    /// SHA-256 of the file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
    /// Voxels that are void.
    pub void_voxels: u64,
    /// What each material took, in the order of the scene.
    pub materials: Vec<MaterialVoxels>,
    /// Labels that were made void.
    pub ignored_labels: Vec<LabelVoxels>,
}

impl ImageSummary {
    /// The materials whose range of intensities no voxel lies in.
    pub fn empty_ranges(&self) -> impl Iterator<Item = &MaterialVoxels> {
        let intensities = self.content == INTENSITIES;
        self.materials.iter().filter(move |material| intensities && material.voxels == 0)
    }

    /// What happened to the voxels before they were used, in words; empty if nothing.
    pub fn resampling(&self) -> String {
        if !self.resampled {
            return String::new();
        }
        let [nx, ny, nz] = self.stored_dims;
        // Headers hold f32.
        let [sx, sy, sz] = self.stored_voxel_mm.map(|mm| (mm * 1e4).round() * 1e-4);
        format!("resampled from {nx} x {ny} x {nz} voxels of {sx:.4} x {sy:.4} x {sz:.4} mm")
    }
}

/// The content of a label map.
pub(crate) const LABELS: &str = "label map";

/// The content of an image of intensities.
pub(crate) const INTENSITIES: &str = "intensities";

/// A group of base cells that hang together by faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Part {
    /// Its base cells.
    pub cells: usize,
    /// The voxels in them that are not void.
    pub voxels: u64,
    /// Whether it is simulated: a fixed region holds it.
    pub kept: bool,
}

/// The parts of the body, in the order of their first cells.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct DomainSummary {
    /// Number of parts.
    pub components: usize,
    /// How many of them are simulated.
    pub kept: usize,
    /// The parts.
    pub parts: Vec<Part>,
}

impl DomainSummary {
    /// Number, base cells and voxels of the parts that are simulated, or of those that are not.
    pub fn total(&self, kept: bool) -> (usize, usize, u64) {
        let parts = self.parts.iter().filter(|part| part.kept == kept);
        parts.fold((0, 0, 0), |(n, cells, voxels), part| {
            (n + 1, cells + part.cells, voxels + part.voxels)
        })
    }
}

/// The refinement of the start mesh towards boundaries of labels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct LabelRefinementSummary {
    /// The level asked for.
    pub level: u8,
    /// Vertices that came in; merging keeps them.
    pub vertices: usize,
    /// Tetrahedra above the level that still hold several labels: 0 unless `max_vertices` ended
    /// the refinement.
    pub tets_left: usize,
}

/// All that is known of a body before it moves.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BodySummary {
    /// The image.
    pub image: ImageSummary,
    /// The parts of the body.
    pub domain: DomainSummary,
    /// The refinement of the start mesh, if one was asked for.
    pub label_refinement: Option<LabelRefinementSummary>,
    /// What the start mesh has of material that no face of a voxel joins.
    pub topology: TopologySummary,
}

/// Material that shares tetrahedra or vertices of the start mesh with such as no face of a voxel joins it to near by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct TopologySummary {
    /// Vertices that came in where it is to be apart, before it was taken apart.
    pub refined: usize,
    /// Tetrahedra around the vertices that it shares.
    pub unjoined: usize,
    /// Of these, those that are there several times if it is apart.
    pub doubled: usize,
    /// Vertices that came in for that.
    pub vertices: usize,
    /// Pieces that nothing holds, held by weak springs.
    pub parked: usize,
}

impl BodySummary {
    /// What is not as the scene asked for.
    pub(crate) fn warnings(&self) -> Vec<String> {
        let empty = self.image.empty_ranges();
        let mut warnings: Vec<String> = empty
            .map(|range| format!("no voxel lies in the range of \"{}\"", range.name))
            .collect();
        let (parts, cells, voxels) = self.domain.total(false);
        if parts > 0 {
            warnings.push(format!(
                "{parts} part(s) with {cells} base cells and {voxels} voxels are left out: no fixed \
                 region holds them"
            ));
        }
        let refined = self.label_refinement.filter(|refined| refined.tets_left > 0);
        if let Some(refined) = refined {
            warnings.push(format!(
                "max_vertices ended the refinement towards labels: {} tetrahedra above level {} still \
                 hold several",
                refined.tets_left, refined.level
            ));
        }
        if self.topology.parked > 0 {
            let parked = self.topology.parked;
            warnings.push(format!(
                "{parked} piece(s) that no fixed region holds are held by weak springs where they are"
            ));
        }
        warnings
    }
}
