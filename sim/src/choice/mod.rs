//! What runs and why: the implementations of the stages, and the plan that explains them.
//!
//! `stages` is the file to open first. `element` chooses the element by the materials, `plan` writes
//! the rows of `yawara plan`.

mod element;
pub(crate) mod plan;
mod stages;

pub use element::{MIXED_FROM, choose_element};
pub use stages::Stages;

pub(crate) use element::{empty_body, of_scene};
