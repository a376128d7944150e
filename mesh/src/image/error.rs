//! What can be wrong with images and volumes.

use std::path::{Path, PathBuf};

#[cfg(feature = "dicom")]
use super::dicom::DicomError;
use crate::tet_file::TetMeshError;

/// Why an image or what should be made of it was refused.
///
/// Whatever is wrong with a file is told by [`ImageError::InFile`]; [`ImageError::problem`] looks
/// inside.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // Of fields: messages and variants say what they are.
pub enum ImageError {
    /// A file or a directory, and what is wrong with it: no other `InFile`.
    #[error("{}: {source}", path.display())]
    InFile { path: PathBuf, source: Box<Self> },
    /// A file could not be read or written.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// A path names a directory, a device or a pipe.
    #[error("is {0}, want an image file (.nii, .nii.gz, .nrrd, .nhdr, .mha, .mhd or .vti)")]
    NotAFile(&'static str),
    /// A file of zero bytes.
    #[error("the file is empty, want an image")]
    EmptyFile,
    /// The first bytes are not those of a single-file NIfTI image.
    #[error("not a NIfTI image: {field} is {value}, want {want}")]
    NotNifti { field: &'static str, value: String, want: &'static str },
    /// A header of a .hdr/.img pair.
    #[error(
        "the magic is that of one half of a .hdr/.img pair; convert the pair to a single .nii file"
    )]
    HeaderPair,
    /// A gzip or zlib stream that does not inflate.
    #[error("damaged compressed stream: {0}")]
    Inflate(#[source] std::io::Error),
    /// Fewer bytes (inflated, where the file is compressed) than the header announces.
    #[error(
        "{part} takes {want} bytes by the header, the file holds {found}; it is cut short or its \
         header is damaged"
    )]
    Length { part: &'static str, found: u64, want: u64 },
    /// More bytes (inflated, where the file is compressed), or numbers as text, than the header
    /// announces.
    #[error(
        "the voxel data go on after {want} {unit}, which are all by the header; the file or its \
         header is damaged, or something was appended"
    )]
    TooLong { unit: &'static str, want: u64 },
    /// A file that looks like none of the image formats, by its first bytes.
    #[error(
        "starts with {0}: no NIfTI, NRRD, MetaImage, VTK or DICOM image, and the name ends in none \
         of their extensions"
    )]
    UnknownFormat(String),
    /// An image whose reader was left out when the program was built.
    #[error("is a {format} image; build with the feature {feature:?} to read it")]
    FormatNotBuilt { format: &'static str, feature: &'static str },
    /// A line of a text header (NRRD, MetaImage) that can't be followed, with at most 80 characters of
    /// its value. Lines count from 1.
    #[error("header line {line}: {field} is {value:?}, want {want}")]
    TextHeader { line: usize, field: String, value: String, want: &'static str },
    /// A field, or its alternatives, that a text header must have and has not.
    #[error("the header has no field {0}")]
    MissingField(&'static str),
    /// A text header that does not end within as many bytes as are read.
    #[error("the header does not end within {0} bytes")]
    HeaderTooLong(u64),
    /// A voxel written as text that is no number of the type the header announces; it is empty where
    /// the data ends. Voxels count from 0.
    #[error("voxel {index} of the text data is {value:?}, want {want}")]
    TextVoxel { index: usize, value: String, want: &'static str },
    /// Isotropic voxels so small that they would not fit in memory; `from_mm` are the stored spacings
    /// along right, anterior and superior.
    #[error(
        "voxels of {} × {} × {} mm resampled to {to_mm} mm make {voxels:.3e} of them, the limit \
         is {limit}; ask for a larger spacing or check the header's",
        from_mm[0], from_mm[1], from_mm[2]
    )]
    ResampledVoxels { from_mm: [f64; 3], to_mm: f64, voxels: f64, limit: u64 },
    /// An image that the format of the written file can't hold.
    #[error("can't write NIfTI-1: {field} is {value}, want {want}")]
    Unwritable { field: &'static str, value: String, want: &'static str },
    /// A header field out of its range.
    #[error("header field {field} is {value}, want {want}")]
    Header { field: &'static str, value: f64, want: &'static str },
    /// A voxel type that is no real number.
    #[error(
        "datatype {code} ({name}) is not supported; want a real integer or float type of 8 to 64 \
         bits"
    )]
    Datatype { code: i64, name: &'static str },
    /// A time series or a multi-channel image; `count` is the product of all dimensions but the three
    /// of space.
    #[error(
        "holds {count} volumes or channels ({rank} dimensions), want one; extract a single 3-D \
         volume first"
    )]
    NotThreeDimensional { rank: i64, count: u64 },
    /// More voxels than can be handled.
    #[error(
        "the header says {}×{}×{} = {voxels} voxels, the limit is {limit}",
        dims[0], dims[1], dims[2]
    )]
    TooManyVoxels { dims: [u64; 3], voxels: u64, limit: u64 },
    /// A voxel-to-scanner matrix, from the field `form`, that can't be inverted; the determinant is
    /// that of its columns brought to length 1.
    #[error("the {form} is singular: unit columns span {determinant:.3e}, want ±1")]
    SingularAffine { form: &'static str, determinant: f64 },
    /// A voxel-to-scanner matrix, from the field `form`, two of whose axes (0 to 2) are not at right
    /// angles.
    #[error(
        "the {form} is sheared: axes {} and {} have cosine {cosine:.3e}, limit {limit:.0e}; \
         resample to a rectangular grid",
        axes[0], axes[1]
    )]
    ShearedAffine { form: &'static str, axes: [usize; 2], cosine: f64, limit: f64 },
    /// A voxel of a label map whose value, scaled, is no label, or one of an image that is no finite
    /// f32; counted from 0 along the file's axes.
    #[error("voxel ({}, {}, {}) has the value {value}, {want}", voxel[0], voxel[1], voxel[2])]
    VoxelValue { voxel: [usize; 3], value: f64, want: &'static str },
    /// More labels than a dense u16 id can tell apart: those found before counting stopped, without
    /// the background.
    #[error("the volume has at least {found} different labels besides 0, the limit is {limit}")]
    TooManyLabels { found: usize, limit: usize },
    /// A list of voxels that does not fill its grid.
    #[error(
        "{found} voxel values for a grid of {}×{}×{}, want exactly one per voxel",
        dims[0], dims[1], dims[2]
    )]
    VoxelCount { found: usize, dims: [usize; 3] },
    /// A voxel, by position in the list, with a dense id that stands for no label.
    #[error("voxel {index} has dense id {id}, but only ids below {count} stand for a label")]
    UnknownId { index: usize, id: u16, count: usize },
    /// A table of labels that is not 0 followed by ascending others; a missing entry is at the
    /// table's length and 0.
    #[error(
        "label table entry {index} is {value}, want 0 first, then the others ascending, each once"
    )]
    LabelTable { index: usize, value: i64 },
    /// A voxel, by position in the list, whose value is NaN or infinite.
    #[error("voxel {index} has the value {value}, want a finite number")]
    NotFinite { index: usize, value: f32 },
    /// A number given by the caller, or its deviation, that is out of its range: of a grid, of a
    /// procedural organ, a length.
    #[error("{field} is {value}, want {want}")]
    Parameter { field: &'static str, value: f64, want: &'static str },
    /// A range of values that holds none, or stands for the background.
    #[error("range {index} for label {label} is [{low}, {high}): want {want}")]
    ValueRange { index: usize, label: i64, low: f64, high: f64, want: &'static str },
    /// Two ranges of values share some, or a label.
    #[error(
        "ranges {first} and {second} share {what}: want each value in one range at most, and each \
         label once"
    )]
    RangesMeet { first: usize, second: usize, what: &'static str },
    /// A DICOM file or series.
    #[cfg(feature = "dicom")]
    #[error(transparent)]
    Dicom(Box<DicomError>),
    /// A VTK XML file.
    #[error(transparent)]
    Vtk(Box<TetMeshError>),
}

impl ImageError {
    /// Names the file that an error is about, unless it names one already.
    pub(crate) fn in_file<E: Into<Self>>(path: &Path) -> impl Fn(E) -> Self {
        move |error| match error.into() {
            named @ Self::InFile { .. } => named,
            problem => Self::InFile { path: path.into(), source: Box::new(problem) },
        }
    }

    /// What is wrong, without the file that it is wrong with.
    pub fn problem(&self) -> &Self {
        match self {
            Self::InFile { source, .. } => source,
            _ => self,
        }
    }
}

impl From<TetMeshError> for ImageError {
    fn from(error: TetMeshError) -> Self {
        Self::Vtk(Box::new(error))
    }
}

#[cfg(feature = "dicom")]
impl From<DicomError> for ImageError {
    fn from(error: DicomError) -> Self {
        Self::Dicom(Box::new(error))
    }
}
