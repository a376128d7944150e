//! What can be wrong with materials and elements.

/// Why a material or an embedding was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EmbedError {
    /// A material constant outside its range.
    #[error("{what} is {value}, want {want}")]
    Material {
        /// Which constant.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The admissible range.
        want: &'static str,
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
    /// A coarse mesh that a detail mesh does not belong to.
    #[error(
        "the coarse mesh has {found:?} root cubes of {found_units} lattice units, the detail mesh \
         {want:?} of {want_units}: want the same cubes and at most its units"
    )]
    OtherLattice {
        /// Root cubes of the coarse mesh.
        found: [usize; 3],
        /// Its lattice units per cube.
        found_units: i32,
        /// Root cubes of the detail mesh.
        want: [usize; 3],
        /// Its lattice units per cube.
        want_units: i32,
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
    #[error("no homogenisation `{name}`; there are {}", choices.join(", "))]
    UnknownHomogenisation {
        /// What was asked for.
        name: String,
        /// What there is.
        choices: &'static [&'static str],
    },
    /// An unknown name of an element.
    #[error("no element `{name}`; there are {}", choices.join(", "))]
    UnknownFormulation {
        /// What was asked for.
        name: String,
        /// What there is.
        choices: &'static [&'static str],
    },
    /// A stabilisation of the mixed element outside its range.
    #[error("the stabilisation of p1p1 is {value}, want 0.5 to 2")]
    Stabilisation {
        /// α.
        value: f64,
    },
    /// An elasticity matrix that no stable material has.
    #[error(
        "an elasticity matrix is not symmetric positive definite (smallest eigenvalue \
         {eigenvalue:e} Pa, want above 0)"
    )]
    Elasticity {
        /// The smallest eigenvalue, Pa, or NaN.
        eigenvalue: f64,
    },
}
