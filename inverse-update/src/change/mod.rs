//! What a maintainer is told about a change of K, as plain data in slots. There are three kinds:
//!
//! - *split*: an edge is bisected, and its midpoint comes in as a vertex. A
//!   [`RingChange`](ring_change::RingChange) holds the ring's stiffness before and after. A vertex
//!   that is no longer fixed is a split of no elements.
//! - *merge*: the reverse of a split with the same `RingChange`, and the vertex goes. A vertex that
//!   becomes fixed is a merge of no elements.
//! - *content*: all vertices stay. A [`StiffnessChange`](batch::StiffnessChange) says how K changes.
//!
//! `batch.rs` is the file to open first: [`Update`](batch::Update) is one of the three. `apply.rs`
//! checks an update and applies it to K. `net_change.rs` brings it into the form U Λ Uᵀ, from which
//! the maintainers update their inverse, with the algebra of `low_rank.rs` and `capacitance.rs`.

mod apply;
mod batch;
mod capacitance;
mod low_rank;
mod net_change;
mod ring_change;

pub use batch::{StiffnessChange, Update, UpdateRef};
pub(crate) use capacitance::{Capacitance, PIVOT_FLOOR};
pub(crate) use low_rank::{beside, pivoted};
pub(crate) use net_change::NetChange;
pub use ring_change::{CONSISTENCY_LIMIT, RingChange};
