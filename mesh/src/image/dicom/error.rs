//! What can be wrong with a DICOM series.

use std::path::PathBuf;

/// Why a DICOM file or series was refused; [`ImageError::InFile`](crate::ImageError::InFile) names
/// it, or the message where it is about slices.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // Of fields: messages and variants say what they are.
pub enum DicomError {
    /// No DICOM file by its start, which is this.
    #[error("not a DICOM file: bytes 128 to 131 are {0}, want \"DICM\"")]
    NotDicom(String),
    /// A stored form that is not decoded here.
    #[error(
        "transfer syntax {uid} ({name}) is not read; decompress the series first (gdcmconv --raw \
         IN OUT)"
    )]
    TransferSyntax { uid: String, name: &'static str },
    /// Bytes that break the structure of a data set, or end too early; the offset is in the file, or
    /// in the inflated data set of a deflated one.
    #[error("byte {offset}, {place}: {found}, want {want}")]
    Structure { offset: usize, place: String, found: String, want: &'static str },
    /// A data set that does not inflate, or to too much.
    #[error("the deflated data set has {found}, want {want}")]
    Deflated { found: String, want: &'static str },
    /// An element that the reader needs, by name and number, is not there.
    #[error("the image has no {0}")]
    MissingTag(String),
    /// An element with a value out of range.
    #[error("{tag} is {value}, want {want}")]
    Tag { tag: String, value: String, want: &'static str },
    /// Two images of a series that do not fit together.
    #[error(
        "{tag} is {value}, but {other_value} in {}; want one for the whole series",
        other.display()
    )]
    Differs { tag: String, value: String, other: PathBuf, other_value: String },
    /// Uncompressed pixel data of another length than rows, columns, bits and frames make.
    #[error("PixelData (7FE0,0010) has {found} bytes, want {want}")]
    PixelLength { found: u64, want: u64 },
    /// More pixels than so few compressed bytes make.
    #[error(
        "Rows × Columns (0028,0010), (0028,0011) announce {pixels} pixels in a frame of \
         {bytes} compressed bytes, the limit is {limit}"
    )]
    FrameClaim { pixels: u64, bytes: u64, limit: u64 },
    /// A compressed frame, counted from 1, that does not decode to the image that the header
    /// announces.
    #[error("frame {frame}, {codec}: {found}, want {want}")]
    Frame { frame: usize, codec: &'static str, found: String, want: String },
    /// A directory without any image.
    #[error(
        "no DICOM image in this directory ({files} files, {other} of them DICOM but no image), \
         want the files of one series"
    )]
    NoImages { files: usize, other: usize },
    /// A directory with images of several series.
    #[error("{count} series in this directory: {list}; give one file of the wanted series instead")]
    SeveralSeries { count: usize, list: String },
    /// A file that is another one than when its header was read.
    #[error("the file changed while the series was read")]
    Changed,
    /// A series of one slice, which has no third dimension.
    #[error("SeriesInstanceUID (0020,000E) {series} has {slices} slice, want at least 2")]
    TooFewSlices { series: String, slices: usize },
    /// Two slices at one place.
    #[error(
        "{second} has the same ImagePositionPatient (0020,0032) along the normal as {first} to \
         {apart_mm:.4} mm, the limit is {limit_mm:.4} mm: copies, or several phases; keep one"
    )]
    SamePosition { first: String, second: String, apart_mm: f64, limit_mm: f64 },
    /// A gap in the series; the spacing is the median distance of neighbours.
    #[error(
        "{missing} slices are missing between {first} and {second}: {gap_mm:.4} mm apart along \
         the normal by ImagePositionPatient (0020,0032), the others {spacing_mm:.4} mm"
    )]
    MissingSlices { first: String, second: String, missing: u64, gap_mm: f64, spacing_mm: f64 },
    /// Slices whose distances differ; the spacing is the first slice's distance from the last one
    /// divided by the number of gaps.
    #[error(
        "{slice}: ImagePositionPatient (0020,0032) lies {off_mm:.4} mm along the normal from \
         where slices every {spacing_mm:.4} mm lie, the limit is {limit_mm:.4} mm"
    )]
    UnevenSlices { slice: String, off_mm: f64, spacing_mm: f64, limit_mm: f64 },
    /// A slice shifted in its own plane.
    #[error(
        "{slice}: ImagePositionPatient (0020,0032) lies {off_mm:.4} mm beside the line of the \
         others, the limit is {limit_mm:.4} mm"
    )]
    ShiftedSlice { slice: String, off_mm: f64, limit_mm: f64 },
    /// Slices stacked along a line that is not their normal.
    #[error(
        "the slices are stacked at {degrees:.3}° from their normal (gantry tilt), the limit \
         is {limit_degrees:.3}°: resample the series to a right-angled grid first"
    )]
    GantryTilt { degrees: f64, limit_degrees: f64 },
}
