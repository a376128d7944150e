//! What can be wrong with surfaces and their files.

use std::path::PathBuf;

use crate::bisection::BisectionError;

/// Why a surface was refused or not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SurfaceError {
    /// A file could not be written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A parameter of an iso-surface out of its range.
    #[error("iso-surface: {field} is {value}, want {want}")]
    IsoSurface {
        /// The parameter.
        field: &'static str,
        /// What was given.
        value: f64,
        /// What is accepted.
        want: &'static str,
    },
    /// A list that does not have one entry for each vertex (or point) that is asked of it.
    #[error("{what}: {found} entries, want {want}")]
    EntryCount {
        /// Which list.
        what: &'static str,
        /// Its length.
        found: usize,
        /// How many entries it needs.
        want: usize,
    },
    /// A value at a vertex (or point) that is NaN or infinite.
    #[error("{what}: entry {index} has the value {value}, want a finite number")]
    EntryNotFinite {
        /// Which list.
        what: &'static str,
        /// Position in it.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// A tetrahedron without a volume, which has no orientation.
    #[error("tet {tet} has signed volume {volume:.3e} m³, want a finite number other than 0")]
    FlatTet {
        /// Position in the list.
        tet: usize,
        /// Its volume.
        volume: f64,
    },
    /// A triangle with a corner that is no point.
    #[error("triangle {triangle} has the corner {corner}, but there are only {points} points")]
    TriangleCorner {
        /// Position in the list.
        triangle: usize,
        /// Its corner.
        corner: u32,
        /// Number of points.
        points: usize,
    },
    /// The forest that a surface is bound to.
    #[error(transparent)]
    Bisection(#[from] BisectionError),
}
