//! NRRD images (.nrrd; .nhdr with its data file).
//!
//! Open `reader` first; `geometry` finds the axes of space and their place in the scanner.

mod geometry;
mod reader;

pub use reader::read_nrrd;
