//! What runs and why: the implementations of the stages, and the plan that explains them.
//!
//! `stages` is the file to open first. `element` chooses the element by the materials, `law` the law
//! by how far tools go, `plan` writes the rows of `yawara plan`.

mod element;
mod law;
pub(crate) mod plan;
mod stages;

pub use element::{MIXED_FROM, choose_element};
pub use stages::Stages;

pub(crate) use element::{empty_body, of_scene};
pub(crate) use law::of_scene as law_of_scene;
