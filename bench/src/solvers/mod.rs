//! What the maintained inverse is held against: direct methods, reference solutions, and the time
//! that memory alone takes.
//!
//! Start with `direct.rs`; `reference.rs` solves to the last digits, `accuracy.rs` measures an
//! inverse against another one, `stream.rs` is the bound of memory; `by.rs` is the choice between ours and PETSc's.

pub(crate) mod accuracy;
pub(crate) mod by;
pub(crate) mod direct;
pub(crate) mod reference;
pub(crate) mod stream;

pub(crate) use accuracy::Trial;
pub use by::ReferenceBy;
pub(crate) use by::inverse_at_rest;
pub(crate) use direct::{Direct, Solver, in_one_thread};
pub(crate) use reference::Reference;
