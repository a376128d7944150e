//! The maintainers that the suite is instantiated for, by name.

use yawara_inverse_update::{
    Delayed, HostStore, InverseError, InverseMaintainer, REFINED_RESIDUAL, SparseStiffness,
};

/// The scene name: what stands before the variant, `delayed` of `delayed@1`.
#[must_use]
pub fn method(name: &str) -> &str {
    name.split('@').next().unwrap_or(name)
}

/// Makes the maintainer of that name: `delayed@8` folds at 8 columns.
///
/// # Errors
/// As [`yawara_inverse_update::build`].
pub fn build(
    name: &str,
    stiffness: SparseStiffness,
) -> Result<Box<dyn InverseMaintainer>, InverseError> {
    match name.split_once('@') {
        Some(("delayed", most)) => {
            let most = most.parse().expect("a number of columns");
            let delayed = Delayed::new(stiffness, HostStore::new())?;
            Ok(Box::new(delayed.with_most_delayed(most)))
        }
        _ => yawara_inverse_update::build(name, stiffness),
    }
}

/// The scaled residual that a maintainer may leave on purpose, on top of rounding: 0 but where it
/// stores less than f64 and refines.
#[must_use]
pub fn residual(name: &str) -> f64 {
    match method(name) {
        "woodbury_f32" | "gpu_f32" => REFINED_RESIDUAL,
        _ => 0.0,
    }
}

/// Whether what a maintainer shows is a C that went through all updates, and not a solution with K
/// or with its factors.
#[must_use]
pub fn updates_inverse(name: &str) -> bool {
    matches!(method(name), "woodbury" | "delayed" | "gpu" | "paper")
}

/// Whether `solve` multiplies by what `columns` shows; not where C is a sum of parts, which may
/// cancel, or kept in factors.
#[must_use]
pub fn solves_by_columns(name: &str) -> bool {
    !matches!(method(name), "sparse" | "delayed" | "gpu")
}
