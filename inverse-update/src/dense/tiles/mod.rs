//! A dense symmetric matrix in packed tiles, and long columns in the matching layout.
//!
//! `packed.rs` is the file to open first: [`Tiles`](packed::Tiles), the lower half, which grows by
//! appending. `panel.rs` holds a few long columns; `pass.rs` adds a signed sum of their squares in
//! one read and write of all tiles; `product.rs` multiplies; `kernel.rs` has the inner loops;
//! `deferred.rs` is the matrix together with columns that no pass has added yet.

mod deferred;
mod kernel;
mod packed;
mod panel;
mod pass;
mod product;
mod tile;

pub(super) use deferred::Deferred;
pub(super) use panel::Panel;
pub(super) use pass::SignedPanel;
