//! `yawara init`: a scene for an image, to run as it is and to be edited.
//!
//! `places` finds where the body is held and pulled, `text` writes the scene.

mod places;
mod text;

use std::path::Path;

use crate::scene::{Image, LengthUnit};
use crate::{SimError, scene_file};
use yawara_mesh::atomic_file;
use yawara_mesh::image::{
    ReadReport, ValueRange, classify, gaussian_blur, read_intensities_with, read_labels_with,
};
use yawara_mesh::volume::LabelVolume;

use super::arguments::InitArguments;
use super::printer::Printer;
use places::Places;
use text::{Content, Proposal, short};

/// The scene whose materials and smoothing a CT gets.
const OF_INTENSITIES: &str = "abdomen_ct";

/// Label maps have no negative labels and no more than these.
const MOST_LABELS: usize = 256;

/// The most voxels along the longest side of a body; beyond that they are resampled.
const MOST_VOXELS: f64 = 128.0;

/// Writes the scene and says what it holds.
pub fn run(arguments: &InitArguments, out: &mut Printer) -> Result<(), SimError> {
    let InitArguments { image, out: file, unit, force } = arguments;
    if file.exists() && !force {
        let want = "a file that is not there yet, or --force to replace it";
        return Err(SimError::value("yawara init", "--out", file.display(), want));
    }
    let (volume, content) = read(image, unit.map_or(1.0, LengthUnit::mm))?;
    let places = Places::new(&volume).ok_or(SimError::Empty(image.display().to_string()))?;
    let longest = places.size_mm.into_iter().fold(0.0, f64::max);
    if unit.is_none() && !Image::LIKELY_MM.contains(&longest) {
        let (place, found) = (image.display().to_string(), format!("{} mm", short(longest)));
        let want = "1 mm to 5 m; say with --unit m (or cm, mm, um) in which unit the file's spacings are, \
                    mm to take them as they stand";
        return Err(SimError::value(&place, "the body's longest side", found, want));
    }
    let proposal = Proposal { image, unit: *unit, volume: &volume, content, places };
    let io = |source| SimError::Io(file.clone(), source);
    atomic_file::write(file, proposal.toml()).map_err(io)?;
    out.print(&proposal.in_words())?;
    out.print(&format!("written to {0}; run it with: yawara run {0}\n", file.display()))
}

/// The labels of a label map or of the intensities of a CT, whose spacings are in `unit` (mm).
fn read(image: &Path, unit: f64) -> Result<(LabelVolume, Content), SimError> {
    match read_labels_with(image, None) {
        Ok((volume, ReadReport { label_names: names, .. })) if is_label_map(&volume) => {
            let volume = volume.scaled(unit)?;
            let longest = places::longest_mm(&volume);
            let voxel_mm = coarser_mm(longest, volume.grid().spacing_mm);
            let volume = match voxel_mm {
                None => volume,
                Some(voxel_mm) => read_labels_with(image, Some(voxel_mm / unit))?.0.scaled(unit)?,
            };
            Ok((volume, Content::Labels { voxel_mm, names }))
        }
        // Hounsfield units: many values, negative ones, or none that are whole.
        _ => intensities(image, unit),
    }
}

fn is_label_map(volume: &LabelVolume) -> bool {
    let values = volume.values();
    values.len() <= MOST_LABELS && values.iter().all(|label| *label >= 0)
}

/// A voxel of a whole number of half millimetres with which a body is no longer than `MOST_VOXELS`.
fn coarser_mm(longest_mm: f64, spacing_mm: f64) -> Option<f64> {
    (longest_mm > MOST_VOXELS * spacing_mm).then(|| (2.0 * longest_mm / MOST_VOXELS).ceil() / 2.0)
}

fn intensities(image: &Path, unit: f64) -> Result<(LabelVolume, Content), SimError> {
    let (scene, _) = scene_file::load(OF_INTENSITIES, &["image.path=-".into()])?;
    let ranges: Vec<ValueRange> = (1..)
        .zip(&scene.materials)
        .filter_map(|(label, material)| {
            material.range.map(|[low, high]| ValueRange { label, low, high })
        })
        .collect();
    let values = read_intensities_with(image, None)?.0.scaled(unit)?;
    let grid = values.grid();
    let longest = grid.dims.into_iter().max().unwrap_or(1) as f64 * grid.spacing_mm;
    let voxel_mm = coarser_mm(longest, grid.spacing_mm).unwrap_or(grid.spacing_mm);
    let blur_mm = scene.image.blur_mm.unwrap_or(0.0);
    let values = read_intensities_with(image, Some(voxel_mm / unit))?.0.scaled(unit)?;
    let volume = classify(&gaussian_blur(&values, blur_mm)?, &ranges)?;
    Ok((volume, Content::Intensities { voxel_mm, blur_mm, materials: scene.materials }))
}
