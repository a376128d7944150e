//! Charts and pictures: lists of shapes that become SVG or pixels.
//!
//! Start with `curves.rs`: curves over logarithmic axes (`axes.rs`), as SVG. A `Picture` of any
//! shapes is in `picture.rs`.

mod axes;
mod curves;
mod picture;

pub(crate) use axes::{Axes, FRAME, SIZE, key};
pub use curves::{Curve, log_log, slope};
pub(crate) use picture::{Anchor, Picture, Role, Shape, escape};
