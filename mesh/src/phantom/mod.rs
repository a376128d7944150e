//! Procedural organs: label volumes without a scanner.
//!
//! Only additions, products, quotients and square roots enter, each rounded by IEEE 754: the
//! same parameters give the same voxels on every machine.
//!
//! Open `liver` first; `shape` is its outline, `vessels` its portal tree, `size` what may be chosen.

mod block;
mod liver;
mod random;
mod shape;
mod size;
mod vessels;

pub use block::block;
pub use liver::liver;
pub use size::{GALLBLADDER_LABEL, LiverPhantom, PARENCHYMA, TUMOUR, VESSELS};
pub use vessels::{VesselSegment, vessel_tree};
