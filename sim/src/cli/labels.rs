//! `yawara labels`: an image's labels, resampled and classified as a scene does it.

use std::path::Path;

use crate::SimError;
use yawara_mesh::image::{
    ReadReport, ValueRange, classify, gaussian_blur, read_intensities_with, read_labels_with,
};
use yawara_mesh::volume::LabelVolume;

use super::arguments::LabelsArguments;
use super::printer::Printer;

pub fn run(arguments: &LabelsArguments, out: &mut Printer) -> Result<(), SimError> {
    let LabelsArguments { image, out: file, voxel_mm, blur_mm, range } = arguments;
    let ranges: Vec<ValueRange> = range.iter().map(|text| parse(text)).collect::<Result<_, _>>()?;
    if let Some(blur) = blur_mm.filter(|_| ranges.is_empty()) {
        let want = "no such option without --range: only intensities can be smoothed";
        return Err(SimError::value("yawara labels", "--blur-mm", blur, want));
    }
    let (volume, report) = if ranges.is_empty() {
        read_labels_with(image, *voxel_mm)?
    } else {
        let (intensities, report) = read_intensities_with(image, *voxel_mm)?;
        let smooth = gaussian_blur(&intensities, blur_mm.unwrap_or(0.0))?;
        (classify(&smooth, &ranges)?, report)
    };
    if let Some(file) = file {
        write(file, &volume)?;
    }
    out.print(&describe(&volume, &report, &ranges))?;
    file.iter().try_for_each(|file| out.print(&format!("written to {}\n", file.display())))
}

/// LABEL:LOW:HIGH; whether low is below high, [`classify`] checks.
fn parse(text: &str) -> Result<ValueRange, SimError> {
    let parts: Vec<&str> = text.split(':').collect();
    if let [label, low, high] = parts[..]
        && let (Ok(label), Ok(low), Ok(high)) = (label.parse(), low.parse(), high.parse())
    {
        return Ok(ValueRange { label, low, high });
    }
    let want = "LABEL:LOW:HIGH with a whole number and two numbers, e.g. 3:150:inf";
    Err(SimError::value("yawara labels", "--range", text, want))
}

#[cfg(feature = "nifti")]
fn write(file: &Path, volume: &LabelVolume) -> Result<(), SimError> {
    Ok(yawara_mesh::image::write_labels(file, volume)?)
}

#[cfg(not(feature = "nifti"))]
fn write(_: &Path, _: &LabelVolume) -> Result<(), SimError> {
    Err(SimError::FeatureMissing("yawara labels".into(), "nifti"))
}

/// The grid, what was done, and the voxels of each label.
fn describe(volume: &LabelVolume, report: &ReadReport, ranges: &[ValueRange]) -> String {
    let [nx, ny, nz] = volume.grid().dims;
    let content = if ranges.is_empty() { "label map" } else { "intensities" };
    let mut text = format!("{} {content}", report.format);
    if let Some(resampling) = &report.resampling {
        text += &format!(", {resampling}");
    }
    text += &format!("\n{nx} x {ny} x {nz} voxels of {} mm\n", volume.grid().spacing_mm);
    let counts = volume.counts();
    for (label, voxels) in volume.values().iter().zip(&counts) {
        let name = match report.label_names.get(label) {
            Some(name) => format!(" ({name})"),
            None if *label == 0 => " (void)".into(),
            None => String::new(),
        };
        text += &format!("label {label}{name}: {voxels} voxels\n");
    }
    for range in ranges.iter().filter(|range| !volume.values().contains(&range.label)) {
        text += &format!("label {}: no voxel in its range\n", range.label);
    }
    text
}
