//! The suite that every inverse maintainer has to pass: one line per implementation.

mod cases;
mod history;
mod model;

pub use cases::*;
pub use history::{Op, Replay, ops, replay};
pub use model::Model;

/// Instantiates the suite for the maintainer of a scene name.
///
/// `inverse_suite!(woodbury, "woodbury");` makes a module `woodbury` of tests;
/// `inverse_suite!(sparse, "sparse", quasi_definite);` adds those of quasi-definite matrices, for
/// maintainers that take them.
#[macro_export]
macro_rules! inverse_suite {
    ($module:ident, $name:expr $(, $more:ident)?) => {
        mod $module {
            $($crate::inverse_suite!(@$more $name);)?

            $crate::inverse_suite!(@case $name,
                a_vertex_alone_is_a_division
                no_vertices_at_the_start
                a_vertex_whose_ring_is_fixed
                a_halved_spring_by_hand
                the_only_vertex_can_go
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
            );

            proptest::proptest! {
                #![proptest_config(proptest::test_runner::Config {
                    cases: 48,
                    max_shrink_iters: 2000,
                    ..Default::default()
                })]

                #[test]
                fn random_histories_agree_with_dense_lu(
                    block in proptest::sample::select(vec![1_usize, 3, 4]),
                    start in 0_usize..5,
                    ops in $crate::inverse_suite::ops(1..40),
                ) {
                    let mut replay = $crate::inverse_suite::Replay::new($name, block, start, 1);
                    for op in &ops {
                        replay.step(op);
                        replay.check();
                    }
                    replay.undo_all();
                    replay.check();
                }
            }
        }
    };
    (@quasi_definite $name:expr) => {
        proptest::proptest! {
            #![proptest_config(proptest::test_runner::Config {
                cases: 48,
                max_shrink_iters: 2000,
                ..Default::default()
            })]

            #[test]
            fn random_quasi_definite_histories_agree_with_dense_lu(
                block in proptest::sample::select(vec![2_usize, 4]),
                start in 0_usize..5,
                ops in $crate::inverse_suite::ops(1..40),
            ) {
                use $crate::inverse_suite::Replay;
                let mut replay = Replay::quasi_definite($name, block, start, 1);
                for op in &ops {
                    replay.step(op);
                    replay.check();
                }
                replay.undo_all();
                replay.check();
            }
        }

        $crate::inverse_suite!(@case $name,
            a_quasi_definite_vertex_by_hand
            wrong_signs_are_refused
        );
    };
    (@case $name:expr, $($case:ident)*) => {
        $(#[test] fn $case() { $crate::inverse_suite::$case($name); })*
    };
}
