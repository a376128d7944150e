//! Suites that every implementation of a stage has to pass: one line per implementation.
//!
//! A file per stage, named after its trait, holds the cases, [`conformance!`](crate::conformance)
//! lists and instantiates them (the inverses have `inverse_suite`); `block.rs` is the body that
//! co-rotations and solvers deform, `order.rs` fits slopes.

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

/// Instantiates the suite of a stage for an implementation, as a module of tests:
/// `conformance!(equilibrium, newton, "newton", a_large_load_is_borne);`.
///
/// The implementation is named as in a scene; an element and a tool are given as such, an
/// integrator with the order that it claims. Behind it stand the cases that not all promise.
#[macro_export]
macro_rules! conformance {
    (homogenisation, $($line:tt)*) => {
        $crate::conformance!(@ homogenisation, $($line)*;
            parents_are_symmetric_and_definite
            the_excess_is_what_the_voigt_mean_loses
            halves_may_change_places
            units_do_not_matter
            a_body_turned_has_its_parent_turned
        );
    };
    (element_formulation, $($line:tt)*) => {
        $crate::conformance!(@ element_formulation, $($line)*;
            matrices_are_symmetric
            pivots_have_the_signs_that_it_tells
            rigid_motions_cost_nothing
            a_linear_displacement_has_the_stress_of_its_strain
            the_assembly_of_its_tetrahedra_is_the_ring
            a_merge_hands_over_what_its_split_did
        );
    };
    (internal_forces, $($line:tt)*) => {
        $crate::conformance!(@ internal_forces, $($line)*;
            at_rest_there_is_no_force
            flat_and_inverted_elements_give_finite_forces
            the_tangent_is_the_derivative
        );
    };
    (constitutive_law, $($line:tt)*) => {
        $crate::conformance!(@ constitutive_law, $($line)*;
            rest_gives_no_stress
            the_tangent_is_the_derivative
            its_growth_begins_as_the_trace
            its_energy_gives_its_stress
            halves_of_a_split_have_the_parents_stress
            equal_halves_merge_to_their_state
            without_time_stress_is_elastic
        );
    };
    (equilibrium, $($line:tt)*) => {
        $crate::conformance!(@ equilibrium, $($line)*;
            a_body_at_rest_is_left_alone
            a_small_load_gives_the_linear_displacement
            what_is_reported_is_what_is_there
            pressures_are_solved_for_or_left_alone
            a_load_that_is_no_number_has_no_equilibrium
        );
    };
    (indicator, $($line:tt)*) => {
        $crate::conformance!(@ indicator, $($line)*;
            at_rest_nothing_is_asked_for
            a_deformed_ring_asks_for_its_vertex
            rigid_motion_changes_nothing
            order_does_not_matter
            flat_and_inverted_elements_give_a_number
        );
    };
    (tool, $($line:tt)*) => {
        $crate::conformance!(@ tool, $($line)*;
            it_is_felt_and_reported
            once_gone_it_leaves_nothing_behind
            where_it_leads_does_not_depend_on_the_steps
            the_mesh_may_refine_under_it
            the_same_run_gives_the_same_bytes
        );
    };
    (time_integrator, $($line:tt)*) => {
        $crate::conformance!(@ time_integrator, $($line)*;
            uniform_motion_stays_uniform
            constant_acceleration_is_followed
            a_damped_oscillator_is_followed
            inertia_and_damping_vanish_at_the_prediction
        );
    };
    (time_integrator_without_inertia, $($line:tt)*) => {
        $crate::conformance!(@ time_integrator, $($line)*; without_inertia_nothing_moves);
    };
    (@ $suite:ident, $module:ident, $subject:expr $(, $promise:ident)*; $($case:ident)*) => {
        $crate::conformance!(@ $suite, $module, $subject; [$($case)* $($promise)*]);
    };
    (@ $suite:ident, $module:ident, $subject:expr; [$($case:ident)*]) => {
        mod $module {
            // What the expression names; a name in quotes needs nothing.
            #[allow(unused_imports)]
            use super::*;

            $(#[test]
            fn $case() {
                $crate::stage_suites::$suite::$case($subject);
            })*
        }
    };
}
