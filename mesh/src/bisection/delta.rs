//! What one split or merge changed, as a value that later stages repair themselves from.

use super::label_tree::NodeRef;

/// A vertex of the active mesh; numbers are reused after a merge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct VertexId(pub u32);

impl VertexId {
    /// The number as an array index.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// A tetrahedron of the bisection forest; numbers are reused after a merge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TetId(pub u32);

impl TetId {
    /// The number as an array index.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// A tetrahedron, with all that later stages ask of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tet {
    /// Its number.
    pub id: TetId,
    /// Its corners in bisection order: the edge (v0, v_d), d = 3 − (level mod 3), is bisected.
    pub vertices: [VertexId; 4],
    /// Bisections since the root.
    pub level: u8,
    /// Its content.
    pub node: NodeRef,
}

/// A tetrahedron of a ring and the two halves its bisection makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RingTet {
    /// The coarse tetrahedron.
    pub parent: Tet,
    /// Its halves; child 0 holds the parent's corner v0, child 1 holds v_d.
    pub children: [Tet; 2],
}

/// Whether a vertex came in or went out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// The parents of the ring were replaced by their children.
    Split,
    /// The children of the ring were replaced by their parents.
    Merge,
}

/// One vertex in or out, with the ring of tetrahedra around the bisected edge.
///
/// Three kinds of change reach the inverse. A *split* bisects an edge, and its midpoint comes in as
/// a vertex. A *merge* is the reverse of a split, and the vertex goes. A change of *content* gives a
/// leaf another material; all vertices stay, so that it has no delta.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshDelta {
    /// In or out.
    pub change: Change,
    /// The vertex that came or went.
    pub vertex: VertexId,
    /// The ends of the bisected edge, ascending.
    pub edge: [VertexId; 2],
    /// All tetrahedra around that edge, in an order that does not depend on history.
    pub ring: Vec<RingTet>,
}

impl MeshDelta {
    /// An empty delta to fill again and again without allocating.
    pub fn empty() -> Self {
        Self {
            change: Change::Split,
            vertex: VertexId(u32::MAX),
            edge: [VertexId(u32::MAX); 2],
            ring: Vec::with_capacity(8),
        }
    }
}
