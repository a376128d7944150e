//! NIfTI images (.nii, .nii.gz): versions 1 and 2 are read, version 1 is written.
//!
//! Open `reader` first. `header` checks the header field by field.

mod header;
mod reader;
mod writer;

pub use reader::read_nifti;
pub use writer::{write_field, write_labels};
