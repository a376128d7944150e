//! Plain meshes: what is a mesh, and the files they come from and go to.

mod cube;
#[cfg(all(feature = "gmsh", feature = "vtu"))]
mod damaged;
mod mesh;
#[cfg(feature = "gmsh")]
mod msh;
#[cfg(feature = "vtu")]
mod vtu;
