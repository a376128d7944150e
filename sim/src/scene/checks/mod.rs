//! Which values of a scene are in range: `scene` goes through all of them.

mod check;
mod materials;
mod scene;
mod tools;

pub(crate) use tools::FARTHEST_M;
