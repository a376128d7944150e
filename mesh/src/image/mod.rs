//! Volume images: read from files, brought to cubic voxels in RAS+ orientation, smoothed and
//! classified.
//!
//! Open `volume` first: the label and intensity volumes that all else works on. `read` recognises
//! the format of a file; `nifti`, `nrrd`, `metaimage`, `vti` and `dicom` read one format each and
//! give a `raw` image in the file's own axes, spacings and voxel type (`voxels`), which `placement` turns
//! and `resample` brings to cubes. `bytes` and `header` are what the file formats share.

pub use blur::gaussian_blur;
pub use classify::{ValueRange, classify};
#[cfg(feature = "dicom")]
pub use dicom::{DicomError, read_dicom};
pub use error::ImageError;
#[cfg(feature = "metaimage")]
pub use metaimage::read_metaimage;
#[cfg(feature = "nifti")]
pub use nifti::{read_nifti, write_field, write_labels};
#[cfg(feature = "nrrd")]
pub use nrrd::read_nrrd;
pub use placement::VoxelAffine;
pub use raw::RawVolume;
pub use read::{
    ReadReport, read_intensities, read_intensities_with, read_labels, read_labels_with,
};
pub use resample::{Interpolation, Resampling};
pub use voxels::{VoxelType, Voxels};
#[cfg(feature = "vtu")]
pub use vti::read_vti;

mod blur;
#[cfg(any(feature = "nifti", feature = "nrrd", feature = "metaimage", feature = "vtu"))]
mod bytes;
mod classify;
#[cfg(feature = "dicom")]
mod dicom;
mod error;
#[cfg(any(feature = "nrrd", feature = "metaimage"))]
mod header;
#[cfg(feature = "metaimage")]
mod metaimage;
#[cfg(feature = "nifti")]
mod nifti;
#[cfg(feature = "nrrd")]
mod nrrd;
mod placement;
mod raw;
mod read;
mod resample;
pub mod volume;
pub(crate) mod voxels;
#[cfg(feature = "vtu")]
mod vti;
