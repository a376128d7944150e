//! `homogenisation`: how far coarse tetrahedra answer from the fine body that they stand for.
//!
//! `study.rs` runs it; `mixture.rs` says what the unit cubes are made of, `cube_mesh.rs` solves
//! them, `tables.rs` prints.

mod cube_mesh;
mod mixture;
mod row;
mod study;
mod tables;

pub use row::Row;
pub use study::run;
