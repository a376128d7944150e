//! What the maintained inverse is held against: direct methods, reference solutions, and the time
//! that memory alone takes.
//!
//! Start with `direct.rs`; `reference.rs` solves to the last digits, `accuracy.rs` measures an
//! inverse against another one, `stream.rs` is the bound of memory.

pub(crate) mod accuracy;
pub(crate) mod direct;
pub(crate) mod reference;
pub(crate) mod stream;
