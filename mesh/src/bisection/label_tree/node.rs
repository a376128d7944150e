//! What one tetrahedron holds, in four bytes.

/// A tetrahedron's content: one label throughout, or a heterogeneous node of a [`LabelTree`](super::LabelTree).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct NodeRef(u32);

/// A [`NodeRef`], opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// The whole tetrahedron has this dense label.
    Label(u16),
    /// The node of this index has two children that differ, or is a finest tetrahedron whose
    /// material is its own ([`LabelTree::per_voxel`](super::LabelTree::per_voxel)).
    Node(usize),
}

/// Set where a tetrahedron has one label; nodes are numbered below it.
pub(super) const HOMOGENEOUS: u32 = 1 << 31;

impl NodeRef {
    /// A tetrahedron of background.
    pub(crate) const VOID: Self = Self(HOMOGENEOUS);

    /// A tetrahedron of one dense label.
    pub fn label(label: u16) -> Self {
        Self(HOMOGENEOUS | u32::from(label))
    }

    /// A heterogeneous tetrahedron, by the number of its node.
    pub fn node(index: usize) -> Self {
        Self(index as u32)
    }

    /// What it is.
    pub fn open(self) -> Content {
        if self.0 & HOMOGENEOUS != 0 {
            Content::Label((self.0 & 0xffff) as u16)
        } else {
            Content::Node(self.0 as usize)
        }
    }
}
