//! Volume images, the tetrahedral bisection forest with online split and merge, and label trees.
//!
//! This crate knows geometry and labels, no materials and no forces.
#![forbid(unsafe_code)]

pub mod blur;
#[cfg(any(feature = "nifti", feature = "nrrd", feature = "metaimage"))]
mod byte_stream;
pub mod classify;
mod closure;
mod closure_queue;
mod delta;
mod diamond;
#[cfg(feature = "dicom")]
pub mod dicom_reader;
mod domain;
mod error;
mod forest;
pub mod geometry;
#[cfg(feature = "gmsh")]
pub mod gmsh;
mod image_reader;
pub mod isosurface;
pub mod kuhn;
mod label_tree;
pub mod lattice;
mod locality;
#[cfg(feature = "metaimage")]
pub mod metaimage_reader;
#[cfg(feature = "nifti")]
pub mod nifti_reader;
#[cfg(feature = "nifti")]
mod nifti_writer;
#[cfg(feature = "nrrd")]
pub mod nrrd_reader;
pub mod phantom;
pub mod plain_mesh;
mod queries;
pub mod raw_volume;
mod refine;
pub mod resample;
mod ring_shape;
#[cfg(any(feature = "nrrd", feature = "metaimage"))]
mod text_header;
mod update;
pub mod volume;
mod voxels;
#[cfg(feature = "vtu")]
pub mod vtu_reader;

pub use closure_queue::ClosureQueue;
pub use delta::{Change, MeshDelta, RingTet, Tet, TetId, VertexId};
pub use domain::Domain;
pub use error::MeshError;
pub use forest::BisectionForest;
pub use geometry::{Placement, Quality};
pub use kuhn::Point;
pub use label_tree::{CellGrid, Content, LabelTree, LabelsIn, NodeRef};
pub use lattice::Lattice;
pub use plain_mesh::{PlainMesh, Repairs};
pub use refine::{LabelRefinement, Region, Wants};
