//! What can be wrong with lists of tetrahedra and their files.

use std::path::{Path, PathBuf};

/// Why a tetrahedral mesh or its file was refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TetMeshError {
    /// A file could not be read or written.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// A mesh of no tetrahedra.
    #[error("the mesh has no tetrahedra, want at least one")]
    NoTets,
    /// More points or tetrahedra than u32 numbers.
    #[error("{count} {what}, the limit is {limit}")]
    TooMany {
        /// `points` or `tets`.
        what: &'static str,
        /// How many there are.
        count: usize,
        /// The limit.
        limit: usize,
    },
    /// A list that does not hold one entry for each of another.
    #[error("{what} has {found} values, want {want}")]
    ListLength {
        /// The list.
        what: String,
        /// Its length.
        found: usize,
        /// The length it should have.
        want: usize,
    },
    /// A NaN or an infinity where a number is wanted.
    #[error("{what} {index} has the value {value}, want a finite number")]
    NotFinite {
        /// The list.
        what: String,
        /// Position in the list.
        index: usize,
        /// What stands there.
        value: f64,
    },
    /// A tetrahedron with a corner that is no point.
    #[error("tet {tet} has corner {corner}, want a point below {count}")]
    CornerOutOfRange {
        /// Position of the tetrahedron.
        tet: usize,
        /// The corner.
        corner: u32,
        /// Number of points.
        count: usize,
    },
    /// A tetrahedron that uses a point twice.
    #[error("tet {tet} uses point {corner} twice, want four different corners")]
    RepeatedCorner {
        /// Position of the tetrahedron.
        tet: usize,
        /// The point.
        corner: u32,
    },
    /// A flat tetrahedron.
    #[error(
        "tet {tet} is degenerate: volume {volume:.3e} m³, want a magnitude above {limit:.3e} m³ \
         (1e-12 of its longest edge cubed)"
    )]
    DegenerateTet {
        /// Position of the tetrahedron.
        tet: usize,
        /// Its signed volume, m³.
        volume: f64,
        /// The volume that it should exceed, m³.
        limit: f64,
    },
    /// A face of three tetrahedra or more.
    #[error("tet {tet}: its face {face:?} belongs to {count} tets, want at most 2")]
    NonManifoldFace {
        /// The first of the tetrahedra.
        tet: usize,
        /// Corners of the face, ascending.
        face: [u32; 3],
        /// Number of tetrahedra.
        count: usize,
    },
    /// Two tetrahedra on the same side of a face.
    #[error(
        "tets {} and {} lie on the same side of their common face {face:?}: they overlap, \
         or one is a copy of the other", tets[0], tets[1]
    )]
    OverlappingTets {
        /// The tetrahedra.
        tets: [usize; 2],
        /// Corners of the face, ascending.
        face: [u32; 3],
    },
    /// A length of a file unit, m, that is no length.
    #[error("unit is {0} m, want a finite length > 0")]
    LengthUnit(f64),
    /// A file, and what is wrong with it or with its mesh.
    #[error("{}: {source}", path.display())]
    InFile {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: Box<Self>,
    },
    /// A place of a mesh file that does not follow its format.
    #[error("{place}: found {found}, want {want}")]
    Syntax {
        /// Section and line or byte.
        place: String,
        /// What stands there.
        found: String,
        /// What should stand there.
        want: String,
    },
    /// A count of a mesh file for which the file is too short.
    #[error(
        "{place}: announces {claimed} {what}, but the bytes that are left hold {limit} at most"
    )]
    Claim {
        /// Section and line or byte.
        place: String,
        /// What is counted.
        what: &'static str,
        /// The count in the file.
        claimed: u64,
        /// The most that fits.
        limit: u64,
    },
    /// Content of a mesh file that is not handled.
    #[error("{place}: {found} is not supported; {advice}")]
    Unsupported {
        /// Section and line or byte.
        place: String,
        /// What is not supported.
        found: String,
        /// What would do.
        advice: &'static str,
    },
    /// A material tag or a name that a file format can't hold.
    #[error(
        "material tag {tag} with name {name:?}: want a tag of 0 to 2147483647, and a name of one line"
    )]
    Tag {
        /// The tag.
        tag: i64,
        /// Its name, if any.
        name: String,
    },
}

impl TetMeshError {
    /// Names the file that an error is about.
    pub(super) fn in_file<E: Into<Self>>(path: &Path) -> impl Fn(E) -> Self {
        move |error| Self::InFile { path: path.into(), source: Box::new(error.into()) }
    }

    pub(super) fn syntax(
        place: impl AsRef<str>,
        found: impl AsRef<str>,
        want: impl Into<String>,
    ) -> Self {
        let (place, found) = (shortened(place.as_ref()), shortened(found.as_ref()));
        Self::Syntax { place, found, want: want.into() }
    }

    pub(super) fn unsupported(place: &str, found: &str, advice: &'static str) -> Self {
        Self::Unsupported { place: shortened(place), found: shortened(found), advice }
    }
}

/// The start of a text from a file: damaged ones have words of megabytes.
fn shortened(text: &str) -> String {
    const LONGEST: usize = 80;
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.into(),
    }
}
