//! DICOM image series: a directory of slices, or multi-frame files.
//!
//! Open `reader` first. `scan` finds the files of the series, `file`, `cursor` and `data_set` walk
//! over the elements of one, `image` checks what its header says, `stack` orders the slices, and
//! `frames` decodes their pixels by `rle`, `jpeg` or `jpeg2000`.

mod cursor;
mod data_set;
mod error;
mod file;
mod format;
mod frames;
mod image;
mod jpeg;
mod jpeg2000;
mod reader;
mod rle;
mod scan;
mod stack;
mod tag;

pub use error::DicomError;
pub use reader::read_dicom;
