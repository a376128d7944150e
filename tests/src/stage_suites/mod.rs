//! Suites that every implementation of a stage of `corot` has to pass: one line per implementation.
//!
//! `internal_forces.rs`, `constitutive_law.rs` and `time_integrator.rs` hold the cases of a stage and
//! the macro that instantiates them; `block.rs` is the body that they deform, `order.rs` fits
//! slopes.

pub mod block;
pub mod constitutive_law;
pub mod internal_forces;
pub mod order;
pub mod time_integrator;

/// Instantiates the named cases of a suite for an implementation, as a module of tests.
#[macro_export]
macro_rules! conformance {
    ($suite:ident, $module:ident, $name:expr, $($case:ident)*) => {
        mod $module {
            $(#[test]
            fn $case() {
                $crate::stage_suites::$suite::$case($name);
            })*
        }
    };
}
