//! What a cut or its closing changed, as a value that later stages repair themselves from.

use crate::bisection::delta::{Change, Tet, VertexId};
use crate::bisection::kuhn::Point;
use crate::bisection::label_tree::NodeRef;

/// What cutting or closing has changed.
///
/// A cut first takes tetrahedra apart into sheets that keep all corners (`recast`), then gives sheets corners of their
/// own, one vertex at a time (`doubled`). Closing a cut is the reverse: vertices become one again, then sheets do.
#[derive(Clone, Debug)]
pub struct CutDelta {
    /// [`Change::Split`] of a cut, [`Change::Merge`] of its closing.
    pub change: Change,
    /// Tetrahedra that have other sheets.
    pub recast: Vec<Recast>,
    /// Vertices that came or went, in this order.
    pub doubled: Vec<Doubled>,
    /// Contents that are new in the [tree](crate::BisectionForest::tree).
    pub parts: Vec<Part>,
}

/// A tetrahedron whose material is taken apart or put together, all sheets with the same corners.
#[derive(Clone, Debug, PartialEq)]
pub struct Recast {
    /// The sheets before.
    pub before: Vec<Tet>,
    /// The sheets after.
    pub after: Vec<Tet>,
}

/// A vertex that came in at the place of another, or went out into it.
#[derive(Clone, Debug, PartialEq)]
pub struct Doubled {
    /// The vertex that came or went.
    pub vertex: VertexId,
    /// The one at the same place.
    pub twin: VertexId,
    /// The tetrahedra that have `vertex` as a corner where they have `twin` otherwise; all other corners are those of
    /// this moment.
    pub tets: Vec<Tet>,
}

/// A share of the material in a tetrahedron.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// The content that stands for it.
    pub node: NodeRef,
    /// The content of the whole tetrahedron.
    pub whole: NodeRef,
    /// Corners and level of the tetrahedron, in units of the finest level's lattice.
    pub corners: [Point; 4],
    /// Its level.
    pub level: u8,
    /// Which of the [finest tetrahedra](crate::BisectionForest::finest_in) it holds.
    pub holds: Vec<bool>,
}
