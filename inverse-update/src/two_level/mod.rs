//! `two_level`: a factor of K as it was, and an exact factor of what has changed since.

mod inverse;
mod krylov;
mod patch;
mod since;

pub use inverse::{TwoLevel, TwoLevelOptions};
