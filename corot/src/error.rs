//! What can be wrong with a co-rotational problem.

/// Why a stage could not be made.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
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
}
