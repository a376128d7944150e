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
    /// An unknown name.
    #[error("no homogenisation `{name}`; there are {}", choices.join(", "))]
    UnknownHomogenisation {
        /// What was asked for.
        name: String,
        /// What there is.
        choices: &'static [&'static str],
    },
}
