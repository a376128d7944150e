//! The body: what a scene makes it of, and how it stands while it moves.
//!
//! [`start`] is the file to open first: it turns a scene into a mesh at rest, either from an image
//! (`image_source` reads labels, `image_body` builds the start mesh, `components` leaves out what
//! nothing holds, `label_refinement` refines towards boundaries of labels) or from a mesh file
//! (`mesh_file`). `memory` says what elements that remember are made of. `places` finds the places that a scene gives. `state` is that mesh while the simulation changes it, `pieces` says in how many it is.

mod axes;
mod components;
mod image_body;
mod image_source;
mod label_refinement;
mod material_points;
mod memory;
mod mesh_file;
mod organ_box;
mod outline;
mod pieces;
mod places;
mod start;
mod state;
mod summary;

pub use axes::ScannerAxes;
pub use state::BodyState;
pub use summary::{
    BodySummary, DomainSummary, ImageSummary, LabelRefinementSummary, LabelVoxels, MaterialVoxels,
    Part, TopologySummary,
};

pub(crate) use image_body::{ImageBody, touches_solid};
pub(crate) use memory::{EmbeddedMemory, Memory};
pub(crate) use mesh_file::FileMesh;
pub(crate) use organ_box::{OrganBox, Zone};
#[cfg(feature = "view")]
pub(crate) use outline::outline_inner;
pub(crate) use outline::{cut, cut_for_the_eye, same_cells, solid, surface_level};
pub(crate) use pieces::{Piece, pieces};
pub(crate) use places::Places;
pub(crate) use start::{Origin, Start};
pub(crate) use state::{Cell, Hold, SheetHold, Standing};
