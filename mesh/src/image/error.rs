//! What can be wrong with images and volumes.

use std::path::{Path, PathBuf};

#[cfg(feature = "dicom")]
use super::dicom::DicomError;

/// Why an image or what should be made of it was refused.
///
/// Whatever is wrong with a file is told by [`ImageError::InFile`]; [`ImageError::problem`] looks
/// inside.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// A file or a directory, and what is wrong with it.
    #[error("{}: {source}", path.display())]
    InFile {
        /// The file.
        path: PathBuf,
        /// What is wrong, no other `InFile`.
        source: Box<Self>,
    },
    /// A file could not be read or written.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// A path names a directory, a device or a pipe.
    #[error("is {0}, want an image file (.nii, .nii.gz, .nrrd, .nhdr, .mha or .mhd)")]
    NotAFile(&'static str),
    /// A file of zero bytes.
    #[error("the file is empty, want an image")]
    EmptyFile,
    /// The first bytes are not those of a single-file NIfTI-1 image.
    #[error("not a NIfTI-1 image: {field} is {value}, want {want}")]
    NotNifti {
        /// The header field that says so.
        field: &'static str,
        /// What it holds.
        value: String,
        /// What it should hold.
        want: &'static str,
    },
    /// A header of a .hdr/.img pair.
    #[error(
        "magic \"ni1\" is one half of a .hdr/.img pair; convert the pair to a single .nii file"
    )]
    HeaderPair,
    /// A gzip or zlib stream that does not inflate.
    #[error("damaged compressed stream: {0}")]
    Inflate(#[source] std::io::Error),
    /// Fewer bytes than the header announces.
    #[error(
        "{part} takes {want} bytes by the header, the file holds {found}; it is cut short or its \
         header is damaged"
    )]
    Length {
        /// What is cut short: `header`, `voxel data` or what is skipped before it.
        part: &'static str,
        /// Bytes that are there (inflated, where the file is compressed).
        found: u64,
        /// Bytes that should be there.
        want: u64,
    },
    /// A file that looks like none of the image formats, by its first bytes.
    #[error(
        "starts with {0}: no NIfTI-1, NRRD, MetaImage or DICOM image, and the name ends in none \
         of their extensions"
    )]
    UnknownFormat(String),
    /// An image whose reader was left out when the program was built.
    #[error("is a {format} image; build with the feature {feature:?} to read it")]
    FormatNotBuilt {
        /// The format's name.
        format: &'static str,
        /// The cargo feature that brings its reader.
        feature: &'static str,
    },
    /// A line of a text header (NRRD, MetaImage) that can't be followed.
    #[error("header line {line}: {field} is {value:?}, want {want}")]
    TextHeader {
        /// The line, counted from 1.
        line: usize,
        /// The field as the file spells it.
        field: String,
        /// Its value, at most 80 characters of it.
        value: String,
        /// What would do.
        want: &'static str,
    },
    /// A field, or its alternatives, that a text header must have and has not.
    #[error("the header has no field {0}")]
    MissingField(&'static str),
    /// A text header that does not end within as many bytes as are read.
    #[error("the header does not end within {0} bytes")]
    HeaderTooLong(u64),
    /// A voxel written as text that is no number of the type the header announces.
    #[error("voxel {index} of the text data is {value:?}, want {want}")]
    TextVoxel {
        /// Position in the file, from 0.
        index: usize,
        /// The word, at most 80 characters of it; empty where the data ends.
        value: String,
        /// The type.
        want: &'static str,
    },
    /// Isotropic voxels so small that they would not fit in memory.
    #[error(
        "voxels of {} × {} × {} mm resampled to {to_mm} mm make {voxels:.3e} of them, the limit \
         is {limit}; ask for a larger spacing or check the header's",
        from_mm[0], from_mm[1], from_mm[2]
    )]
    ResampledVoxels {
        /// Stored spacings along right, anterior and superior, mm.
        from_mm: [f64; 3],
        /// The isotropic spacing, mm.
        to_mm: f64,
        /// Voxels that this would make.
        voxels: f64,
        /// The most that is accepted.
        limit: u64,
    },
    /// An image that the format of the written file can't hold.
    #[error("can't write NIfTI-1: {field} is {value}, want {want}")]
    Unwritable {
        /// What does not fit.
        field: &'static str,
        /// Its value.
        value: String,
        /// What would fit.
        want: &'static str,
    },
    /// A header field out of its range.
    #[error("header field {field} is {value}, want {want}")]
    Header {
        /// The field's name in the NIfTI-1 standard.
        field: &'static str,
        /// What it holds.
        value: f64,
        /// What it should hold.
        want: &'static str,
    },
    /// A voxel type that is no real number.
    #[error(
        "datatype {code} ({name}) is not supported; want a real integer or float type of 8 to 64 \
         bits"
    )]
    Datatype {
        /// The NIfTI code.
        code: i16,
        /// The standard's name of the code.
        name: &'static str,
    },
    /// A time series or a multi-channel image.
    #[error(
        "holds {count} volumes or channels ({rank} dimensions), want one; extract a single 3-D \
         volume first"
    )]
    NotThreeDimensional {
        /// Number of dimensions.
        rank: i16,
        /// Number of volumes: the product of all dimensions but the three of space.
        count: u64,
    },
    /// More voxels than can be handled.
    #[error(
        "the header says {}×{}×{} = {voxels} voxels, the limit is {limit}",
        dims[0], dims[1], dims[2]
    )]
    TooManyVoxels {
        /// Voxels along each axis.
        dims: [u64; 3],
        /// Their product.
        voxels: u64,
        /// The most that is accepted.
        limit: u64,
    },
    /// A voxel-to-scanner matrix that can't be inverted.
    #[error("the {form} is singular: unit columns span {determinant:.3e}, want ±1")]
    SingularAffine {
        /// The field that holds it, e.g. `sform` or `space directions`.
        form: &'static str,
        /// Determinant of the matrix with its columns normalised.
        determinant: f64,
    },
    /// A voxel-to-scanner matrix whose axes are not at right angles.
    #[error(
        "the {form} is sheared: axes {} and {} have cosine {cosine:.3e}, limit {limit:.0e}; \
         resample to a rectangular grid",
        axes[0], axes[1]
    )]
    ShearedAffine {
        /// The field that holds it, e.g. `sform` or `space directions`.
        form: &'static str,
        /// The two voxel axes, 0 to 2.
        axes: [usize; 2],
        /// Cosine of the angle between them.
        cosine: f64,
        /// Largest accepted absolute cosine.
        limit: f64,
    },
    /// A voxel of a label map whose value is no label, or one of an image that is no finite f32.
    #[error("voxel ({}, {}, {}) has the value {value}, {want}", voxel[0], voxel[1], voxel[2])]
    VoxelValue {
        /// The voxel, counted from 0 along the file's axes.
        voxel: [usize; 3],
        /// Its value, scaled.
        value: f64,
        /// What its value must be.
        want: &'static str,
    },
    /// More labels than a dense u16 id can tell apart.
    #[error("the volume has at least {found} different labels besides 0, the limit is {limit}")]
    TooManyLabels {
        /// Labels found before counting stopped, without the background.
        found: usize,
        /// The most that is accepted.
        limit: usize,
    },
    /// A list of voxels that does not fill its grid.
    #[error(
        "{found} voxel values for a grid of {}×{}×{}, want exactly one per voxel",
        dims[0], dims[1], dims[2]
    )]
    VoxelCount {
        /// Values given.
        found: usize,
        /// The grid.
        dims: [usize; 3],
    },
    /// A voxel with a dense id that stands for no label.
    #[error("voxel {index} has dense id {id}, but only ids below {count} stand for a label")]
    UnknownId {
        /// Position in the list, x fastest.
        index: usize,
        /// Its id.
        id: u16,
        /// Number of ids.
        count: usize,
    },
    /// A table of labels that is not 0 followed by ascending others.
    #[error(
        "label table entry {index} is {value}, want 0 first, then the others ascending, each once"
    )]
    LabelTable {
        /// Position in the table (its length if an entry is missing).
        index: usize,
        /// What stands there (0 if missing).
        value: i64,
    },
    /// A voxel value that is NaN or infinite.
    #[error("voxel {index} has the value {value}, want a finite number")]
    NotFinite {
        /// Position in the list, x fastest.
        index: usize,
        /// Its value.
        value: f32,
    },
    /// A number given by the caller that is out of its range: of a grid, of a procedural organ, a
    /// length.
    #[error("{field} is {value}, want {want}")]
    Parameter {
        /// What it is, e.g. `grid: spacing_mm`.
        field: &'static str,
        /// What was given, or its deviation.
        value: f64,
        /// What is accepted.
        want: &'static str,
    },
    /// A range of values that holds none, or stands for the background.
    #[error("range {index} for label {label} is [{low}, {high}): want {want}")]
    ValueRange {
        /// Its position in the list.
        index: usize,
        /// The label.
        label: i64,
        /// Its lower end.
        low: f64,
        /// Its upper end.
        high: f64,
        /// What it should be.
        want: &'static str,
    },
    /// Two ranges of values share some, or a label.
    #[error(
        "ranges {first} and {second} share {what}: want each value in one range at most, and each \
         label once"
    )]
    RangesMeet {
        /// The position of one in the list.
        first: usize,
        /// The position of the other.
        second: usize,
        /// What they share: values or the label.
        what: &'static str,
    },
    /// A DICOM file or series.
    #[cfg(feature = "dicom")]
    #[error(transparent)]
    Dicom(Box<DicomError>),
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

#[cfg(feature = "dicom")]
impl From<DicomError> for ImageError {
    fn from(error: DicomError) -> Self {
        Self::Dicom(Box::new(error))
    }
}
