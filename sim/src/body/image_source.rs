//! From an image or a phantom to labels, one material for each.

use std::path::Path;

use yawara_embed::{EmbedError, Material};
use yawara_mesh::image::{
    ReadReport, ValueRange, classify, gaussian_blur, read_intensities_with, read_labels_with,
};
use yawara_mesh::phantom::{LiverPhantom, block, liver};
use yawara_mesh::volume::{Grid, IntensityVolume, LabelVolume};

use super::summary::{INTENSITIES, ImageSummary, LABELS, LabelVoxels, MaterialVoxels};
use crate::error::SimError;
use crate::scene::{Image, MaterialEntry, Phantom, Scene, sha256};

/// The most labels without a material that a label map may have: others hold intensities.
const MOST_LABELS: usize = 256;

/// The axes of a volume that is in RAS+ order.
const AS_STORED: [(usize, bool); 3] = [(0, false), (1, false), (2, false)];

/// Labels, what each is made of, and how they came about.
pub(crate) struct ImageSource {
    pub volume: LabelVolume,
    /// By dense label less 1 (void has none): the position in the scene's materials.
    material_of: Vec<usize>,
    /// Axis i runs along the file's axis `axes[i].0`, backwards if `axes[i].1`.
    pub axes: [(usize, bool); 3],
    pub summary: ImageSummary,
}

impl ImageSource {
    /// Reads the scene's image and gives each voxel a label with a material.
    pub fn read(scene: &Scene) -> Result<Self, SimError> {
        match &scene.image.path {
            Some(path) if scene.reads_intensities() => intensities(scene, path),
            Some(path) => {
                let unit = scene.image.unit_mm();
                let (volume, report) = read_labels_with(path, scene.image.spacing())?;
                let volume = volume.scaled(unit)?;
                let summary = summary_of_file(path, LABELS, volume.grid(), &report, unit)?;
                labels(scene, volume, summary, report.axes)
            }
            None => {
                let (volume, name) = phantom(scene)?;
                let summary = summary(name.into(), LABELS, volume.grid());
                labels(scene, volume, summary, AS_STORED)
            }
        }
    }

    /// Takes labels that are in memory.
    pub fn of_memory(scene: &Scene, volume: LabelVolume) -> Result<Self, SimError> {
        let summary = ImageSummary {
            format: "in memory".into(),
            ..summary("the volume in memory".into(), LABELS, volume.grid())
        };
        labels(scene, volume, summary, AS_STORED)
    }

    /// One material per dense label, void first.
    pub fn materials(&self, scene: &Scene) -> Result<Vec<Material>, SimError> {
        let mut softest = f64::INFINITY;
        let mut solid = Vec::new();
        for &position in &self.material_of {
            let entry = &scene.materials[position];
            softest = softest.min(entry.young_modulus_pa);
            solid.push(entry.material()?);
        }
        if solid.is_empty() {
            return Err(SimError::Empty(self.summary.name.clone()));
        }
        let void =
            Material::new(softest * scene.void.stiffness_ratio, scene.void.poisson_ratio, 0.0)?;
        Ok(std::iter::once(void).chain(solid).collect())
    }

    /// By dense label the position of its material; none of void.
    pub fn positions(&self) -> Vec<Option<usize>> {
        std::iter::once(None).chain(self.material_of.iter().copied().map(Some)).collect()
    }
}

impl MaterialEntry {
    pub(super) fn material(&self) -> Result<Material, EmbedError> {
        Material::new(self.young_modulus_pa, self.poisson_ratio, self.density_kg_m3)
    }
}

fn phantom(scene: &Scene) -> Result<(LabelVolume, &'static str), SimError> {
    let Image { phantom, length_mm, size_mm, voxel_mm, .. } = &scene.image;
    let voxel_mm = voxel_mm.unwrap_or(2.0);
    match phantom {
        Some(Phantom::Liver) => {
            let mut size = LiverPhantom { voxel_mm, seed: scene.seed, ..Default::default() };
            if let Some(length_mm) = length_mm {
                size.length_mm = *length_mm;
            }
            Ok((liver(size)?, "the liver phantom"))
        }
        Some(Phantom::Block) => {
            let size = size_mm.unwrap_or([voxel_mm; 3]);
            let cells = size.map(|s| (s / voxel_mm).round().max(1.0) as usize);
            Ok((block(cells, voxel_mm)?, "the block phantom"))
        }
        None => Err(SimError::NoImage(scene.name.clone())),
    }
}

/// What is known before the labels are.
fn summary(name: String, content: &'static str, grid: &Grid) -> ImageSummary {
    let (dims, voxel_mm) = (grid.dims, grid.spacing_mm);
    ImageSummary {
        name,
        format: "procedural".into(),
        content,
        stored_dims: dims,
        stored_voxel_mm: [voxel_mm; 3],
        dims,
        voxel_mm,
        ..ImageSummary::default()
    }
}

/// The same of a file, whose spacings are in units of `unit` mm.
fn summary_of_file(
    path: &Path,
    content: &'static str,
    grid: &Grid,
    report: &ReadReport,
    unit: f64,
) -> Result<ImageSummary, SimError> {
    let mut summary = summary(path.display().to_string(), content, grid);
    summary.format = report.format.into();
    if !path.is_dir() {
        summary.sha256 = Some(sha256(path).map_err(|source| SimError::Io(path.into(), source))?);
    }
    if let Some(made) = &report.resampling {
        (summary.stored_dims, summary.resampled) = (made.from_dims, true);
        summary.stored_voxel_mm = made.from_mm.map(|mm| mm * unit);
    }
    Ok(summary)
}

/// What each material took of the final labels; returns the material of each.
fn count(
    scene: &Scene,
    volume: &LabelVolume,
    summary: &mut ImageSummary,
    material_of: impl Fn(i64) -> usize,
) -> Vec<usize> {
    let counts = volume.counts();
    summary.void_voxels = counts[0];
    let entries = scene.materials.iter();
    summary.materials = entries
        .map(|entry| MaterialVoxels {
            name: entry.name.clone(),
            other: entry.other,
            labels: Vec::new(),
            voxels: 0,
        })
        .collect();
    let solid = volume.values().iter().zip(counts).skip(1);
    solid
        .map(|(&label, voxels)| {
            let position = material_of(label);
            let material = &mut summary.materials[position];
            material.labels.push(LabelVoxels { label, voxels });
            material.voxels += voxels;
            position
        })
        .collect()
}

/// The labels of a label map, those to be ignored made void.
fn labels(
    scene: &Scene,
    volume: LabelVolume,
    mut summary: ImageSummary,
    axes: [(usize, bool); 3],
) -> Result<ImageSource, SimError> {
    let image = &scene.image;
    let named = |label: &i64| image.ignore_labels.contains(label);
    let ignored = |label: &i64| {
        named(label) || (*label != 0 && image.ignore_others && scene.material_of(*label).is_none())
    };
    let (counts, mut without) = (volume.counts(), Vec::new());
    for (&label, &voxels) in volume.values().iter().zip(&counts).skip(1) {
        if ignored(&label) {
            summary.ignored_labels.push(LabelVoxels { label, voxels });
        }
        if !named(&label) && scene.material_of(label).is_none() {
            without.push(LabelVoxels { label, voxels });
        }
    }
    // What looks like a CT is none of labels to be left out either.
    if !without.is_empty() && (!image.ignore_others || looks_like_intensities(&without)) {
        return Err(without_material(scene, summary.name, without));
    }
    let volume = if summary.ignored_labels.is_empty() {
        volume
    } else {
        let kept = volume.values().iter().map(|label| if ignored(label) { 0 } else { *label });
        let kept: Vec<i64> = kept.collect();
        let voxels = volume.labels().iter().map(|&id| kept[usize::from(id)]);
        LabelVolume::from_original(volume.grid().clone(), voxels)?
    };
    let made = scene.tools.iter().filter_map(|tool| tool.ablation()?.becomes);
    let volume = made.into_iter().try_fold(volume, LabelVolume::with_label)?;
    let of_label = |label| scene.material_of(label).unwrap_or_default();
    let material_of = count(scene, &volume, &mut summary, of_label);
    Ok(ImageSource { volume, material_of, axes, summary })
}

/// Why labels without a material are refused; in ascending order.
fn without_material(scene: &Scene, image: String, labels: Vec<LabelVoxels>) -> SimError {
    let low = labels.iter().map(|one| one.label).min().unwrap_or_default();
    let high = labels.iter().map(|one| one.label).max().unwrap_or_default();
    if looks_like_intensities(&labels) {
        return SimError::IntensitiesAsLabels(image, labels.len(), low, high);
    }
    SimError::LabelsWithoutMaterial { image, labels, entries: scene.materials.len() }
}

/// Label maps have no negative labels, and not so many.
fn looks_like_intensities(labels: &[LabelVoxels]) -> bool {
    labels.len() > MOST_LABELS || labels.iter().any(|one| one.label < 0)
}

/// Labels from the intensities of a file, by the materials' ranges.
fn intensities(scene: &Scene, path: &Path) -> Result<ImageSource, SimError> {
    let unit = scene.image.unit_mm();
    let (image, report) = read_intensities_with(path, scene.image.spacing())?;
    let image = image.scaled(unit)?;
    let blur_mm = scene.image.blur_mm.unwrap_or(0.0);
    let image = if blur_mm > 0.0 { gaussian_blur(&image, blur_mm)? } else { image };
    let ranges: Vec<ValueRange> = (0..)
        .zip(&scene.materials)
        .filter_map(|(position, material)| {
            let [low, high] = material.range?;
            Some(ValueRange { label: material.number(position), low, high })
        })
        .collect();
    let volume = classify(&image, &ranges)?;
    let name = path.display().to_string();
    if volume.values().len() == 1 {
        return Err(nothing_in_range(name, &image));
    }
    let mut summary = summary_of_file(path, INTENSITIES, volume.grid(), &report, unit)?;
    summary.blur_mm = blur_mm;
    let material_of = count(scene, &volume, &mut summary, |label| {
        ranges.iter().position(|range| range.label == label).unwrap_or_default()
    });
    for material in summary.empty_ranges() {
        tracing::warn!(
            "{}: no voxel lies in the range of material \"{}\"",
            summary.name,
            material.name
        );
    }
    Ok(ImageSource { volume, material_of, axes: report.axes, summary })
}

fn nothing_in_range(image: String, values: &IntensityVolume) -> SimError {
    let span = [f32::INFINITY, f32::NEG_INFINITY];
    let values = values.values().iter();
    let [low, high] = values.fold(span, |[low, high], &v| [low.min(v), high.max(v)]);
    SimError::NothingInRange(image, low, high)
}
