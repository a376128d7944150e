//! Iso-surfaces are closed, oriented and converge; refinement leaves no cracks in them; their
//! files hold what was written.

mod binding;
mod checks;
mod cracks;
mod files;
mod labels;
mod shapes;
