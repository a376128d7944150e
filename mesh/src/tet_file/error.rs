//! What can be wrong with lists of tetrahedra and their files.

use std::path::PathBuf;

/// Why a tetrahedral mesh or its file was refused.
///
/// Tetrahedra and points go by their position in the list; corners of faces are ascending. Places
/// in a file are a section and a line or a byte, or an element.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // Of fields: messages and variants say what they are.
pub enum TetMeshError {
    /// A file could not be read or written.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// A mesh of no tetrahedra.
    #[error("the mesh has no tetrahedra, want at least one")]
    NoTets,
    /// More points or tetrahedra than u32 numbers.
    #[error("{count} {what}, the limit is {limit}")]
    TooMany { what: &'static str, count: usize, limit: usize },
    /// A list that does not hold one entry for each of another.
    #[error("{what} has {found} values, want {want}")]
    ListLength { what: String, found: usize, want: usize },
    /// A NaN or an infinity where a number is wanted.
    #[error("{what} {index} has the value {value}, want a finite number")]
    NotFinite { what: String, index: usize, value: f64 },
    /// A tetrahedron with a corner that is no point.
    #[error("tet {tet} has corner {corner}, want a point below {count}")]
    CornerOutOfRange { tet: usize, corner: u32, count: usize },
    /// A tetrahedron that uses a point twice.
    #[error("tet {tet} uses point {corner} twice, want four different corners")]
    RepeatedCorner { tet: usize, corner: u32 },
    /// A flat tetrahedron.
    #[error(
        "tet {tet} is degenerate: volume {volume:.3e} m³, want a magnitude above {limit:.3e} m³ \
         (1e-12 of its longest edge cubed)"
    )]
    DegenerateTet { tet: usize, volume: f64, limit: f64 },
    /// A face of three tetrahedra or more.
    #[error("tet {tet}: its face {face:?} belongs to {count} tets, want at most 2")]
    NonManifoldFace { tet: usize, face: [u32; 3], count: usize },
    /// Two tetrahedra on the same side of a face.
    #[error(
        "tets {} and {} lie on the same side of their common face {face:?}: they overlap, \
         or one is a copy of the other", tets[0], tets[1]
    )]
    OverlappingTets { tets: [usize; 2], face: [u32; 3] },
    /// A length of a file unit, m, that is no length.
    #[error("unit is {0} m, want a finite length > 0")]
    LengthUnit(f64),
    /// A file, and what is wrong with it or with its mesh.
    #[error("{}: {source}", path.display())]
    InFile { path: PathBuf, source: Box<Self> },
    /// A place of a mesh file that does not follow its format.
    #[error("{place}: found {found}, want {want}")]
    Syntax { place: String, found: String, want: String },
    /// A count of a mesh file for which the file is too short.
    #[error(
        "{place}: announces {claimed} {what}, but the bytes that are left hold {limit} at most"
    )]
    Claim { place: String, what: &'static str, claimed: u64, limit: u64 },
    /// Content of a mesh file that is not handled.
    #[error("{place}: {found} is not supported; {advice}")]
    Unsupported { place: String, found: String, advice: &'static str },
    /// A material tag or a name that a file format can't hold.
    #[error(
        "material tag {tag} with name {name:?}: want a tag of 0 to 2147483647, and a name of one line"
    )]
    Tag { tag: i64, name: String },
}
