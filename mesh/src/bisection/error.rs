//! What can be wrong with a bisection forest and its label tree.

/// Why a forest, a label tree or a change of one was refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // Of fields: messages and variants say what they are.
pub enum BisectionError {
    /// The volume has no voxel that belongs to the body.
    #[error("nothing but background: the body has no voxel")]
    NothingInside,
    /// A level beyond what the lattice or the scene allows.
    #[error("{what} is {level}, want at most {limit}")]
    Level { what: &'static str, level: u8, limit: u8 },
    /// A vertex that can't come in now.
    #[error(
        "no split at lattice point {point:?}: not the midpoint of a leaf's bisected edge, \
         or an older vertex is missing"
    )]
    NotSplittable { point: [i32; 3] },
    /// A priority of a split request that orders nothing.
    #[error("split request at lattice point {point:?} has priority {value}, want a finite number")]
    PriorityNotFinite { point: [i32; 3], value: f64 },
    /// A vertex that can't go out now.
    #[error(
        "no merge of vertex {vertex}: not active, part of the start mesh, \
         or a younger vertex depends on it"
    )]
    NotMergeable { vertex: u32 },
    /// A tetrahedron that is not in the mesh, or is a sheet beside a leaf's own.
    #[error("no cut in tetrahedron {tet}: not the number of a leaf of the mesh")]
    NotALeaf { tet: u32 },
    /// More heterogeneous tetrahedra than numbers for them.
    #[error("{count} heterogeneous tetrahedra, want fewer than {limit}: choose larger voxels")]
    TooManyNodes { count: usize, limit: usize },
}
