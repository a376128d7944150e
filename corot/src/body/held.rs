//! What holds a body by its material.

use nalgebra::Matrix4;
use yawara_mesh::{MeshDelta, TetId};

use super::storage::Body;
use crate::grip::Grip;

impl Body {
    /// Adds a grip; an elastic one pulls from now on. Returns its number.
    pub fn add_grip(&mut self, grip: Grip) -> usize {
        self.grips.push(grip);
        self.grips.len() - 1
    }

    /// All grips, those that have let go too.
    pub fn grips(&self) -> &[Grip] {
        &self.grips
    }

    /// The same, to lead them or let them go.
    pub fn grips_mut(&mut self) -> &mut [Grip] {
        &mut self.grips
    }

    /// Takes all grips along through a split or merge of the mesh.
    pub fn grips_follow(&mut self, delta: &MeshDelta) {
        self.grips.iter_mut().for_each(|grip| grip.follow(delta));
    }

    /// Takes all grips along where an element has got other vertices at the same places.
    pub fn grips_move(&mut self, tet: TetId, vertices: [usize; 4]) {
        self.grips.iter_mut().for_each(|grip| grip.move_to(tet, vertices));
    }

    /// Whether a grip has points in an element.
    pub fn is_gripped(&self, tet: TetId) -> bool {
        self.grips.iter().any(|grip| grip.holds(tet))
    }

    /// A bound on the entries of what elastic grips add to the stiffness, N/m.
    pub(crate) fn grip_scale(&self) -> f64 {
        self.grips.iter().map(Grip::stiffest).fold(0.0, f64::max)
    }

    /// What elastic grips add to the stiffness of an element, on its corners and the same for each
    /// axis, N/m.
    pub fn grip_matrix(&self, tet: TetId) -> Option<Matrix4<f64>> {
        self.grips.iter().filter_map(|grip| grip.matrix(tet)).reduce(|a, b| a + b)
    }
}
