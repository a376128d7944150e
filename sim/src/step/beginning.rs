//! What the state of a simulation was made from, to make it again.

use yawara_mesh::BisectionForest;

use super::holding::Grips;
use crate::body::{FileMesh, Memory, OrganBox};
use crate::tools::MaterialHold;

/// What the state of a simulation was made from.
pub(super) struct Beginning {
    /// The start mesh of an image, or a mesh file with what its material remembers.
    pub mesh: StartMesh,
    pub organ: OrganBox,
    /// What is held of the material, in the order of the body's grips.
    pub grips: Grips,
    /// Tools that began later, in the order in which they came.
    pub came: Vec<usize>,
}

pub(super) enum StartMesh {
    Forest(Box<BisectionForest>),
    File(Box<FileMesh>, Option<Memory>),
}

impl Beginning {
    /// A tool has come that holds this.
    pub fn take(&mut self, tool: usize, hold: Option<&MaterialHold>) {
        self.came.push(tool);
        self.grips.extend(hold.map(|hold| (Some(tool), hold.clone())));
    }
}
