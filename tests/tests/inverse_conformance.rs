//! Every inverse maintainer passes the same suite; a new one gets it with one line.

use proptest::prelude::*;
use yawara_inverse_update::{CHOICES, InverseError, SparseStiffness, build};
use yawara_tests::inverse_suite;
use yawara_tests::inverse_suite::{Op, Replay, ops};

inverse_suite!(lu, "lu");
inverse_suite!(paper, "paper");
inverse_suite!(woodbury, "woodbury");
inverse_suite!(woodbury_f32, "woodbury_f32");
inverse_suite!(delayed, "delayed");
inverse_suite!(delayed_by_8, "delayed@8");
inverse_suite!(delayed_not_at_all, "delayed@0");
inverse_suite!(sparse, "sparse");
inverse_suite!(two_level, "two_level");
inverse_suite!(two_level_by_patches, "two_level@1");

#[test]
fn every_choice_can_be_built_and_others_are_named() {
    for name in CHOICES {
        let maintainer = build(name, SparseStiffness::zeros(0, 3).unwrap()).unwrap();
        assert_eq!(maintainer.name(), *name);
    }
    let error = build("inverse", SparseStiffness::zeros(0, 3).unwrap()).err().unwrap();
    let want = InverseError::Unknown { name: "inverse".into(), choices: CHOICES };
    assert_eq!(error, want);
    assert!(error.to_string().contains("woodbury"));
    assert_eq!(SparseStiffness::zeros(1, 0).err(), Some(InverseError::EmptyBlock));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2, max_shrink_iters: 64, ..Default::default() })]

    #[test]
    fn a_thousand_updates_stay_close_to_lu(ops in ops(1000..1001)) {
        let [woodbury, paper] = ["woodbury", "paper"].map(|name| {
            let mut replay = Replay::new(name, (3, 0), 4, 100);
            replay.run(&ops);
            replay.worst()
        });
        println!("relative error after 1000 updates: woodbury {woodbury:e}, paper {paper:e}");
        prop_assert!(woodbury <= 1e-9, "woodbury is off by {woodbury:e}");
    }
}

/// Fresh starts in many short histories, by maintainer.
fn fresh_starts(name: &'static str, block: (usize, usize), ops: &[Op]) -> usize {
    let starts = ops.chunks(40).map(|history| {
        let mut replay = Replay::new(name, block, 4, 10);
        replay.run(history);
        replay.counts().rebuilds
    });
    starts.sum()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2, max_shrink_iters: 16, ..Default::default() })]

    /// With moduli up to 1e3 apart an update softens C by more than 1e3, where half of the digits
    /// of f32 are lost, in far less than one step of fifty; none loses half of f64's.
    #[test]
    fn fresh_starts_are_rare(ops in ops(1200..1201)) {
        for (name, block, most) in [
            ("woodbury_f32", (3, 0), ops.len() / 50),
            ("woodbury_f32", (4, 1), ops.len() / 50),
            ("delayed", (3, 0), 0),
            ("delayed", (4, 1), 0),
            ("woodbury", (4, 1), 0),
            ("woodbury", (3, 0), 0),
            ("sparse", (3, 0), 0),
        ] {
            let starts = fresh_starts(name, block, &ops);
            println!("{name} {block:?}: {starts} fresh starts in {} steps", ops.len());
            prop_assert!(starts <= most, "{name} {block:?}: {starts} fresh starts, want ≤ {most}");
        }
    }
}
