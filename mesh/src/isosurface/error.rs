//! What can be wrong with surfaces and their files.

use std::path::PathBuf;

use crate::bisection::BisectionError;

/// Why a surface was refused or not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // Of fields: messages and variants say what they are.
pub enum SurfaceError {
    /// A file could not be written.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    /// A parameter of an iso-surface out of its range.
    #[error("iso-surface: {field} is {value}, want {want}")]
    IsoSurface { field: &'static str, value: f64, want: &'static str },
    /// A list that does not have one entry for each vertex (or point) that is asked of it.
    #[error("{what}: {found} entries, want {want}")]
    EntryCount { what: &'static str, found: usize, want: usize },
    /// A value at a vertex (or point) that is NaN or infinite.
    #[error("{what}: entry {index} has the value {value}, want a finite number")]
    EntryNotFinite { what: &'static str, index: usize, value: f64 },
    /// A tetrahedron without a volume, which has no orientation.
    #[error("tet {tet} has signed volume {volume:.3e} m³, want a finite number other than 0")]
    FlatTet { tet: usize, volume: f64 },
    /// A triangle with a corner that is no point.
    #[error("triangle {triangle} has the corner {corner}, but there are only {points} points")]
    TriangleCorner { triangle: usize, corner: u32, points: usize },
    /// The forest that a surface is bound to.
    #[error(transparent)]
    Bisection(#[from] BisectionError),
}
