//! NIfTI-1 images (.nii, .nii.gz), read and written.
//!
//! Open `reader` first. `header` checks the 348 bytes of the header field by field.

mod header;
mod reader;
mod writer;

pub use reader::read_nifti;
pub use writer::{write_field, write_labels};
