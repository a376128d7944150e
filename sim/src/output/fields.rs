//! Fields on the image's grid as NIfTI files.

use std::path::Path;

use crate::SimError;
use crate::report::Fields;

/// Their folder in a run directory.
pub(super) const FOLDER: &str = "fields";

/// The files in a run directory, in the order of the fields.
pub(super) const FILES: [&str; 3] =
    ["fields/displacement_mm.nii.gz", "fields/von_mises_pa.nii.gz", "fields/label.nii.gz"];

/// Writes the three fields into a run directory's folder; each appears under its name when it is
/// complete.
#[cfg(feature = "nifti")]
pub(super) fn write(directory: &Path, fields: &Fields) -> Result<(), SimError> {
    use yawara_mesh::image::{write_field, write_labels};
    let folder = directory.join(FOLDER);
    std::fs::create_dir_all(&folder).map_err(|source| SimError::Io(folder, source))?;
    let [displacement, stress, label] = FILES.map(|name| directory.join(name));
    write_field(&displacement, &fields.displacement_mm)?;
    write_field(&stress, &fields.von_mises_pa)?;
    Ok(write_labels(&label, &fields.label)?)
}

#[cfg(not(feature = "nifti"))]
pub(super) fn write(_: &Path, _: &Fields) -> Result<(), SimError> {
    Err(SimError::FeatureMissing("output.field".into(), "nifti"))
}
