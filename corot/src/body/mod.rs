//! All elements of the current mesh with their rotations, pressures and states.
//!
//! `storage.rs` is the body with its elements coming and going, `evaluation.rs` the passes over all
//! of them, `frames.rs` vectors in the frames of vertices, `material.rs` its law with the states. Open `storage.rs` first.

mod evaluation;
mod frames;
mod held;
mod material;
mod storage;

pub use material::LawState;
pub use storage::Body;
