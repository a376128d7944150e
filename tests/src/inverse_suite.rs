//! The suite that every inverse maintainer has to pass: one line per implementation.

mod by_hand;
mod choice;
mod fixing;
mod history;
mod model;
mod refusals;
mod scaled;
mod springs;

pub use by_hand::*;
pub use choice::{
    build, comes_close, device, is_available, method, residual, solves_by_columns, updates_inverse,
};
pub use fixing::*;
pub use history::{Op, Replay, ops, random_history};
pub use refusals::*;

/// Instantiates the suite for the maintainer of a scene name.
///
/// `inverse_suite!(woodbury, "woodbury");` makes a module `woodbury` of tests; a number after the name is how many
/// random histories of each kind it goes through in place of 48.
#[macro_export]
macro_rules! inverse_suite {
    ($module:ident, $name:expr) => {
        $crate::inverse_suite!($module, $name, 48);
    };
    ($module:ident, $name:expr, $histories:expr) => {
        mod $module {
            $crate::inverse_suite!(@case $name,
                a_vertex_alone_is_a_division
                no_vertices_at_the_start
                a_vertex_whose_ring_is_fixed
                a_halved_spring_by_hand
                the_only_vertex_can_go
                a_batch_may_stand_on_itself
                a_batch_is_its_updates_in_turn
                a_long_batch_is_its_splits
                a_refused_batch_says_how_far_it_came
                a_quasi_definite_pair_by_hand
                a_quasi_definite_vertex_by_hand
                wrong_signs_are_refused
                free_and_indefinite_bodies_are_refused
                a_change_to_singular_is_refused
                a_split_to_indefinite_is_refused
                a_merge_to_singular_is_refused
                wrong_shapes_are_refused
                nan_and_infinity_are_refused
                wrong_slots_are_refused
                contradictions_are_refused
                a_merge_of_the_wrong_vertex_is_refused
                solve_checks_its_vectors
                rebuild_removes_the_drift
                a_nearly_singular_change_stays_accurate
                a_stiff_spring_comes_and_goes
                a_stiff_spring_comes_and_goes_in_a_batch
                a_wide_quasi_definite_change_is_one_change
                all_vertices_can_be_fixed_one_by_one
                a_quasi_definite_vertex_can_be_fixed_and_freed
                freeing_what_nothing_holds_is_refused
                a_part_cut_loose_is_refused_until_it_is_fixed
                wrong_fixings_are_refused
            );

            proptest::proptest! {
                #![proptest_config(proptest::test_runner::Config {
                    cases: $histories,
                    max_shrink_iters: 2000,
                    ..Default::default()
                })]

                #[test]
                fn random_histories_agree_with_dense_lu(
                    block in proptest::sample::select(vec![(1_usize, 0_usize), (3, 0), (4, 0), (4, 1)]),
                    start in 0_usize..5,
                    ops in $crate::inverse_suite::ops(1..40),
                ) {
                    $crate::inverse_suite::random_history($name, block, start, &ops);
                }

                #[test]
                fn random_quasi_definite_histories_agree_with_dense_lu(
                    block in proptest::sample::select(vec![(2_usize, 1_usize), (4, 1)]),
                    start in 0_usize..5,
                    ops in $crate::inverse_suite::ops(1..40),
                ) {
                    $crate::inverse_suite::random_history($name, block, start, &ops);
                }
            }
        }
    };
    (@case $name:expr, $($case:ident)*) => {
        $(#[test]
        fn $case() {
            if $crate::inverse_suite::is_available($name) {
                $crate::inverse_suite::$case($name);
            }
        })*
    };
}
