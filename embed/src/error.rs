//! What can be wrong with materials and elements.

use yawara_mesh::Lattice;

/// Why a material or an embedding was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EmbedError {
    /// A constant of a material, an element or a time step outside its range.
    #[error("{what} is {value}, want {want}")]
    Range {
        /// Which constant.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The admissible range.
        want: &'static str,
    },
    /// An entry of an elasticity matrix (Pa) or of an element's (N/m) that is no number.
    #[error("entry ({row}, {column}) of {matrix} is {value}, want {want}")]
    NotFinite {
        /// Which matrix.
        matrix: &'static str,
        /// Row, from 0.
        row: usize,
        /// Column, from 0.
        column: usize,
        /// The value.
        value: f64,
        /// What it should be.
        want: &'static str,
    },
    /// An elasticity matrix that no stable material has.
    #[error(
        "an elasticity matrix has smallest eigenvalue {eigenvalue:e} Pa and mirrored entries that \
         differ by {asymmetry:e} of the largest, want > 0 and at most {limit:e}"
    )]
    Elasticity {
        /// Largest difference of mirrored entries over the largest entry.
        asymmetry: f64,
        /// The limit.
        limit: f64,
        /// The smallest eigenvalue of the symmetric part, Pa.
        eigenvalue: f64,
    },
    /// A label of the volume without a material.
    #[error("no material for dense label {label}: {given} materials were given")]
    MissingMaterial {
        /// The dense label.
        label: u16,
        /// How many materials there are.
        given: usize,
    },
    /// A homogenisation gave a matrix that no stable material has.
    #[error(
        "homogenisation `{name}` gave a parent elasticity matrix that is not symmetric positive \
         definite (smallest eigenvalue {eigenvalue:e} Pa) at level {level} of root cube {cell}"
    )]
    NotPositiveDefinite {
        /// The homogenisation.
        name: String,
        /// The smallest eigenvalue, Pa, or NaN.
        eigenvalue: f64,
        /// Level of the parent tetrahedron.
        level: u8,
        /// The root cube.
        cell: usize,
    },
    /// A system of the fine mesh that can't be factored.
    #[error(
        "the fine mesh's stiffness ({rows} rows, materials of {softest:e} to {stiffest:e} Pa) is \
         not positive definite to working precision, want a smaller ratio of materials"
    )]
    FineFactor {
        /// Rows of the stiffness.
        rows: usize,
        /// Smallest diagonal entry of any elasticity matrix, Pa.
        softest: f64,
        /// Largest.
        stiffest: f64,
    },
    /// A system of the fine mesh that conjugate gradients do not solve.
    #[error(
        "conjugate gradients stand at a relative residual of {residual:e} after {iterations} \
         iterations on the fine mesh ({rows} rows), want {want:e}: take a coarser image or a \
         smaller ratio of materials"
    )]
    FineSolve {
        /// Rows of the stiffness.
        rows: usize,
        /// Iterations made.
        iterations: usize,
        /// Largest residual of the six loads over the load.
        residual: f64,
        /// The residual asked for.
        want: f64,
    },
    /// A global homogenisation, which knows no part of a body by itself.
    #[error(
        "homogenisation `{name}` solves the whole body at once: labels can't change under it, take a local one such as \
         `laminate`"
    )]
    Edit {
        /// The homogenisation.
        name: String,
    },
    /// Whoever watches the work stopped it.
    #[error("homogenising was stopped, {:.0} % done", 100.0 * done)]
    Stopped {
        /// The fraction done.
        done: f64,
    },
    /// A global homogenisation gave no answer per node.
    #[error("homogenisation `{name}` gave {found} matrices for {want} heterogeneous tetrahedra")]
    NodeCount {
        /// The homogenisation.
        name: String,
        /// How many it gave.
        found: usize,
        /// How many there are.
        want: usize,
    },
    /// A coarse mesh that a detail mesh does not belong to.
    #[error(
        "the coarse mesh has {:?} root cubes of {} lattice units, the detail mesh {:?} of {}: want \
         the same cubes and at most its units",
        found.cells, found.units, want.cells, want.units
    )]
    OtherLattice {
        /// Of the coarse mesh.
        found: Lattice,
        /// Of the detail mesh.
        want: Lattice,
    },
    /// An embedding of other labels than a mesh's.
    #[error(
        "the embedding's label tree has {found} heterogeneous tetrahedra, the mesh's {want}: want \
         the same tree"
    )]
    OtherTree {
        /// Nodes of the embedding's tree.
        found: usize,
        /// Nodes of the mesh's tree.
        want: usize,
    },
    /// Fewer positions than vertex numbers.
    #[error("{found} positions for vertex numbers below {want}")]
    PositionCount {
        /// How many were given.
        found: usize,
        /// How many are needed.
        want: usize,
    },
    /// An unknown name.
    #[error("no {what} `{name}`; there are {}", choices.join(", "))]
    Unknown {
        /// Which stage.
        what: &'static str,
        /// What was asked for.
        name: String,
        /// What there is.
        choices: &'static [&'static str],
    },
    /// An elasticity matrix that κ, μ and D' can't be read off.
    #[error(
        "an elasticity matrix is not symmetric positive definite (smallest eigenvalue \
         {eigenvalue:e} Pa, want above 0)"
    )]
    MixedModuli {
        /// The smallest eigenvalue, Pa, or NaN.
        eigenvalue: f64,
    },
}
