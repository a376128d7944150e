//! Suites that every implementation of a stage has to pass: one line per implementation.
//!
//! A file per stage, named after its trait, holds the cases and the macro that instantiates them (the
//! inverses have `inverse_suite`); `block.rs` is the body that co-rotations and solvers deform,
//! `order.rs` fits slopes.

pub mod block;
pub mod constitutive_law;
pub mod element_formulation;
pub mod equilibrium;
pub mod homogenisation;
pub mod indicator;
pub mod internal_forces;
pub mod order;
pub mod time_integrator;
pub mod tool;

/// Instantiates the named cases of a suite for an implementation, as a module of tests.
#[macro_export]
macro_rules! conformance {
    ($suite:ident, $module:ident, $name:expr, $($case:ident)*) => {
        mod $module {
            // What the expression names; a name in quotes needs nothing.
            #[allow(unused_imports)]
            use super::*;

            $(#[test]
            fn $case() {
                $crate::stage_suites::$suite::$case($name);
            })*
        }
    };
}
