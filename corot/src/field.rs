//! One vector per vertex.

use nalgebra::Vector3;

/// A vector of each vertex, by its number: positions or displacements (m), forces (N).
pub type Field = [Vector3<f64>];
