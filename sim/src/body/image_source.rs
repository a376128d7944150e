//! From an image or a phantom to labels, one material for each.

use std::path::Path;

use yawara_embed::{EmbedError, Material};
use yawara_mesh::image::{
    ReadReport, ValueRange, classify, gaussian_blur, read_intensities_with, read_labels_with,
};
use yawara_mesh::phantom::{LiverPhantom, block, liver};
use yawara_mesh::volume::{IntensityVolume, LabelVolume};

use super::summary::{INTENSITIES, ImageSummary, LABELS, LabelVoxels, MaterialVoxels};
use crate::error::SimError;
use crate::scene::{Image, MaterialEntry, Phantom, Scene};

/// Labels, what each is made of, and how they came about.
pub(crate) struct ImageSource {
    pub volume: LabelVolume,
    /// By dense label less 1 (void has none): the position in the scene's materials.
    material_of: Vec<usize>,
    pub summary: ImageSummary,
}

impl ImageSource {
    /// Reads the scene's image and gives each voxel a label with a material.
    pub fn read(scene: &Scene) -> Result<Self, SimError> {
        let Image { path, voxel_mm, .. } = &scene.image;
        match path {
            Some(path) if scene.reads_intensities() => intensities(scene, path),
            Some(path) => {
                let (volume, report) = read_labels_with(path, *voxel_mm)?;
                let summary = summary(path.display().to_string(), LABELS, &volume, Some(&report));
                labels(scene, volume, summary)
            }
            None => {
                let (volume, name) = phantom(scene)?;
                let summary = summary(name.into(), LABELS, &volume, None);
                labels(scene, volume, summary)
            }
        }
    }

    /// Takes labels that are in memory.
    pub fn of_memory(scene: &Scene, volume: LabelVolume) -> Result<Self, SimError> {
        let summary = ImageSummary {
            format: "in memory".into(),
            ..summary("the volume in memory".into(), LABELS, &volume, None)
        };
        labels(scene, volume, summary)
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
fn summary(
    name: String,
    content: &'static str,
    volume: &LabelVolume,
    report: Option<&ReadReport>,
) -> ImageSummary {
    let (dims, voxel_mm) = (volume.grid().dims, volume.grid().spacing_mm);
    let resampling = report.and_then(|report| report.resampling.as_ref());
    let (stored_dims, stored_voxel_mm) =
        resampling.map_or((dims, [voxel_mm; 3]), |made| (made.from_dims, made.from_mm));
    ImageSummary {
        name,
        format: report.map_or("procedural", |report| report.format).into(),
        content,
        stored_dims,
        stored_voxel_mm,
        resampled: resampling.is_some(),
        dims,
        voxel_mm,
        ..ImageSummary::default()
    }
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
) -> Result<ImageSource, SimError> {
    let ignored = |label: &i64| scene.image.ignore_labels.contains(label);
    let counts = volume.counts();
    for (&label, &voxels) in volume.values().iter().zip(&counts).skip(1) {
        if ignored(&label) {
            summary.ignored_labels.push(LabelVoxels { label, voxels });
        } else if scene.material_of(label).is_none() {
            return Err(SimError::LabelWithoutMaterial(label, summary.name, voxels));
        }
    }
    let volume = if summary.ignored_labels.is_empty() {
        volume
    } else {
        let kept = volume.values().iter().map(|label| if ignored(label) { 0 } else { *label });
        let kept: Vec<i64> = kept.collect();
        let voxels = volume.labels().iter().map(|&id| kept[usize::from(id)]);
        LabelVolume::from_original(volume.grid().clone(), voxels)?
    };
    let of_label = |label| scene.material_of(label).unwrap_or_default();
    let material_of = count(scene, &volume, &mut summary, of_label);
    Ok(ImageSource { volume, material_of, summary })
}

/// Labels from the intensities of a file, by the materials' ranges.
fn intensities(scene: &Scene, path: &Path) -> Result<ImageSource, SimError> {
    let (image, report) = read_intensities_with(path, scene.image.voxel_mm)?;
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
    let mut summary = summary(name, INTENSITIES, &volume, Some(&report));
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
    Ok(ImageSource { volume, material_of, summary })
}

fn nothing_in_range(image: String, values: &IntensityVolume) -> SimError {
    let span = [f32::INFINITY, f32::NEG_INFINITY];
    let values = values.values().iter();
    let [low, high] = values.fold(span, |[low, high], &v| [low.min(v), high.max(v)]);
    SimError::NothingInRange(image, low, high)
}
