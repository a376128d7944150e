//! How a body moves on in time.

mod implicit_euler;

pub use implicit_euler::{EulerStep, ImplicitEuler};
