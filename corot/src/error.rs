//! What can be wrong with a co-rotational problem.

/// Why a stage could not be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CorotError {
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
    /// A parameter out of its range.
    #[error("{what} is {value}, want {want}")]
    Range {
        /// Which parameter.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The admissible range.
        want: &'static str,
    },
    /// A solver that needs a tangent and a co-rotation without one.
    #[error(
        "`{equilibrium}` needs the tangent of the forces, which co-rotation `{corotation}` does not \
         have; want co-rotation element or none, or another equilibrium solver"
    )]
    NoTangent {
        /// Scene name of the co-rotation.
        corotation: &'static str,
        /// Scene name of the solver.
        equilibrium: &'static str,
    },
    /// A stage that knows displacements alone, and elements with pressures.
    #[error(
        "{stage} `{name}` can't be used with element `p1p1`, which has pressures; \
         want {stage} {choices}, or element p1"
    )]
    NoPressures {
        /// Which stage.
        stage: &'static str,
        /// Scene name of its implementation.
        name: &'static str,
        /// What would do.
        choices: &'static str,
    },
}
