//! Gmsh's element types: how many nodes each has, and which are tetrahedra.

/// Nodes of types 1 to 31, 92 and 93.
const NODES: [usize; 31] = [
    2, 3, 4, 4, 8, 6, 5, 3, 6, 9, 10, 27, 18, 14, 1, 8, 20, 15, 13, 9, 10, 12, 15, 15, 21, 4, 5, 6,
    20, 35, 56,
];

const TETRAHEDRON: i64 = 4;

/// Tetrahedra whose edges have nodes of their own, with their order.
const CURVED: [(i64, &str); 4] = [(11, "second"), (29, "third"), (30, "fourth"), (31, "fifth")];

/// An element type of known length.
pub(super) struct Element {
    code: i64,
    /// Nodes per element.
    pub(super) nodes: usize,
}

impl Element {
    pub(super) fn of(code: i64) -> Option<Self> {
        let nodes = match code {
            92 => 64,
            93 => 125,
            _ => *NODES.get(usize::try_from(code).ok()?.checked_sub(1)?)?,
        };
        Some(Self { code, nodes })
    }

    pub(super) fn is_tetrahedron(&self) -> bool {
        self.code == TETRAHEDRON
    }

    /// The order of a tetrahedron above the first.
    pub(super) fn curved(&self) -> Option<&'static str> {
        CURVED.iter().find(|(code, _)| *code == self.code).map(|(_, order)| *order)
    }
}
