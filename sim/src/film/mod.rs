//! A run that is over as an animated picture.
//!
//! [`write_picture`] in `film` is where to start: it draws every frame and writes them all. `raster` draws
//! triangles as `camera` sees them.

mod camera;
mod film;
mod raster;

pub use film::write_picture;
