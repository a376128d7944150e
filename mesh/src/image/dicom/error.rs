//! What can be wrong with a DICOM series.

use std::path::PathBuf;

/// Why a DICOM file or series was refused; [`ImageError::InFile`](crate::ImageError::InFile) names
/// it, or the message where it is about slices.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DicomError {
    /// No DICOM file by its start, which is this.
    #[error("not a DICOM file: bytes 128 to 131 are {0}, want \"DICM\"")]
    NotDicom(String),
    /// A stored form that is not decoded here.
    #[error(
        "transfer syntax {uid} ({name}) is not read; decompress the series first (gdcmconv --raw \
         IN OUT)"
    )]
    TransferSyntax {
        /// The unique identifier of the transfer syntax.
        uid: String,
        /// Its name.
        name: &'static str,
    },
    /// Bytes that break the structure of a data set, or end too early.
    #[error("byte {offset}, {place}: {found}, want {want}")]
    Structure {
        /// Offset in the file, or in the inflated data set of a deflated file.
        offset: usize,
        /// The element.
        place: String,
        /// What stands there.
        found: String,
        /// What should stand there.
        want: &'static str,
    },
    /// A data set that does not inflate, or to too much.
    #[error("the deflated data set has {found}, want {want}")]
    Deflated {
        /// What is wrong.
        found: String,
        /// What would do.
        want: &'static str,
    },
    /// An element that the reader needs, by name and number, is not there.
    #[error("the image has no {0}")]
    MissingTag(String),
    /// An element with a value out of range.
    #[error("{tag} is {value}, want {want}")]
    Tag {
        /// Its name and number.
        tag: String,
        /// What it holds.
        value: String,
        /// What it should hold.
        want: &'static str,
    },
    /// Two images of a series that do not fit together.
    #[error(
        "{tag} is {value}, but {other_value} in {}; want one for the whole series",
        other.display()
    )]
    Differs {
        /// Name and number of the element that differs.
        tag: String,
        /// What this file holds.
        value: String,
        /// A file of the same series.
        other: PathBuf,
        /// What that file holds.
        other_value: String,
    },
    /// Uncompressed pixel data of another length than rows, columns, bits and frames make.
    #[error("PixelData (7FE0,0010) has {found} bytes, want {want}")]
    PixelLength {
        /// Bytes that are there.
        found: u64,
        /// Rows × columns × bytes of a voxel × frames.
        want: u64,
    },
    /// More pixels than so few compressed bytes make.
    #[error(
        "Rows × Columns (0028,0010), (0028,0011) announce {pixels} pixels in a frame of \
         {bytes} compressed bytes, the limit is {limit}"
    )]
    FrameClaim {
        /// Rows × columns.
        pixels: u64,
        /// Compressed bytes of the frame.
        bytes: u64,
        /// Pixels that are accepted for as many bytes.
        limit: u64,
    },
    /// A compressed frame that does not decode to the image that the header announces.
    #[error("frame {frame}, {codec}: {found}, want {want}")]
    Frame {
        /// Counted from 1.
        frame: usize,
        /// The compression.
        codec: &'static str,
        /// What the decoder found or said.
        found: String,
        /// What would do.
        want: String,
    },
    /// A directory without any image.
    #[error(
        "no DICOM image in this directory ({files} files, {other} of them DICOM but no image), \
         want the files of one series"
    )]
    NoImages {
        /// Files in it.
        files: usize,
        /// Files that are DICOM without being images.
        other: usize,
    },
    /// A directory with images of several series.
    #[error("{count} series in this directory: {list}; give one file of the wanted series instead")]
    SeveralSeries {
        /// How many.
        count: usize,
        /// Of each: SeriesInstanceUID, modality, description, files, one file's name.
        list: String,
    },
    /// A file that is another one than when its header was read.
    #[error("the file changed while the series was read")]
    Changed,
    /// A series of one slice, which has no third dimension.
    #[error("SeriesInstanceUID (0020,000E) {series} has {slices} slice, want at least 2")]
    TooFewSlices {
        /// The series.
        series: String,
        /// Slices found.
        slices: usize,
    },
    /// Two slices at one place.
    #[error(
        "{second} has the same ImagePositionPatient (0020,0032) along the normal as {first} to \
         {apart_mm:.4} mm, the limit is {limit_mm:.4} mm: copies, or several phases; keep one"
    )]
    SamePosition {
        /// File and frame.
        first: String,
        /// File and frame.
        second: String,
        /// Their distance along the normal.
        apart_mm: f64,
        /// Distance from which on they count as two.
        limit_mm: f64,
    },
    /// A gap in the series.
    #[error(
        "{missing} slices are missing between {first} and {second}: {gap_mm:.4} mm apart along \
         the normal by ImagePositionPatient (0020,0032), the others {spacing_mm:.4} mm"
    )]
    MissingSlices {
        /// File and frame before the gap.
        first: String,
        /// File and frame after it.
        second: String,
        /// How many fit in the gap.
        missing: u64,
        /// The gap.
        gap_mm: f64,
        /// The median distance of neighbours.
        spacing_mm: f64,
    },
    /// Slices whose distances differ.
    #[error(
        "{slice}: ImagePositionPatient (0020,0032) lies {off_mm:.4} mm along the normal from \
         where slices every {spacing_mm:.4} mm lie, the limit is {limit_mm:.4} mm"
    )]
    UnevenSlices {
        /// File and frame.
        slice: String,
        /// Distance from the place that even spacing gives.
        off_mm: f64,
        /// First to last, divided by the number of gaps.
        spacing_mm: f64,
        /// The limit.
        limit_mm: f64,
    },
    /// A slice shifted in its own plane.
    #[error(
        "{slice}: ImagePositionPatient (0020,0032) lies {off_mm:.4} mm beside the line of the \
         others, the limit is {limit_mm:.4} mm"
    )]
    ShiftedSlice {
        /// File and frame.
        slice: String,
        /// Distance within the plane.
        off_mm: f64,
        /// The limit.
        limit_mm: f64,
    },
    /// Slices stacked along a line that is not their normal.
    #[error(
        "the slices are stacked at {degrees:.3}° from their normal (gantry tilt), the limit \
         is {limit_degrees:.3}°: resample the series to a right-angled grid first"
    )]
    GantryTilt {
        /// Angle between the line of the positions and the normal.
        degrees: f64,
        /// The limit.
        limit_degrees: f64,
    },
}
