//! What a maintainer is told about a change of K, as plain data in slots. There are three kinds:
//!
//! - *split*: an edge is bisected, and its midpoint comes in as a vertex. A
//!   [`RingChange`](ring_change::RingChange) holds the ring's stiffness before and after. A vertex
//!   that is no longer fixed is a split of no elements (`RingChange::freed`).
//! - *merge*: the reverse of a split with the same `RingChange`, and the vertex goes. A vertex that
//!   becomes fixed is a merge of no elements (`RingChange::fixed`).
//! - *content*: a leaf gets another material, and all vertices stay. A
//!   [`StiffnessChange`](stiffness_change::StiffnessChange) says so; it also serves an element that
//!   is removed, a split or merge whose midpoint is fixed, and the elements that pass to the copy
//!   when a cut doubles a vertex (which itself comes in by `RingChange::freed`).
//!
//! `batch.rs` is the file to open first: [`Update`](batch::Update) is one of the three. `apply.rs`
//! checks an update and applies it to K. `net_change.rs` brings an update into the form U Λ Uᵀ of
//! `low_rank.rs`, from which the maintainers update their inverse; `capacitance.rs` factors the
//! small matrices on the way.

mod apply;
mod batch;
mod capacitance;
mod low_rank;
mod net_change;
mod ring_change;
mod stiffness_change;

pub use batch::Update;
pub(crate) use batch::UpdateRef;
pub(crate) use capacitance::{Capacitance, PIVOT_FLOOR};
pub(crate) use low_rank::{beside, eigenvectors};
pub(crate) use net_change::NetChange;
pub use ring_change::{CONSISTENCY_LIMIT, RingChange};
pub use stiffness_change::StiffnessChange;
