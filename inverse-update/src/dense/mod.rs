//! The inverse kept as a dense matrix C.
//!
//! `woodbury.rs` is the default and the file to open first: factored low-rank updates over packed
//! tiles (`tiles/`). `delayed/` keeps the columns of many updates beside C, which is stored in a
//! [`DenseStore`](store::DenseStore): on the host (`host.rs`) or on a device (the crate `gpu`).
//! `paper.rs` follows Oishi et al., `lu.rs` is the reference; both store C in full
//! (`full_storage.rs`). `signed_root.rs` is the small algebra of an update, `from_stiffness.rs` the
//! inverse from K alone, `precision.rs` the stored scalar.

mod delayed;
mod from_stiffness;
mod full_storage;
mod host;
mod lu;
mod paper;
mod precision;
mod signed_root;
mod store;
mod tiles;
mod woodbury;

pub use delayed::{Delayed, MOST_DELAYED};
pub use host::HostStore;
pub use lu::Lu;
pub use paper::Paper;
pub use precision::Precision;
pub use store::{DenseStore, Staged};
pub use woodbury::{Woodbury, WoodburyF32};
