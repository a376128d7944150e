//! A run that is over as an animated picture.
//!
//! [`write_picture`] in `drawing` is where to start: it draws every frame and writes them all. `raster` draws
//! triangles as `camera` sees them.

mod camera;
mod drawing;
mod raster;

pub use drawing::write_picture;
