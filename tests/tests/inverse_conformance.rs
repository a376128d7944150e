//! Every inverse maintainer passes the same suite; a new one gets it with one line.

use proptest::prelude::*;
use yawara_inverse_update::{CHOICES, InverseError, SparseStiffness, build};
use yawara_tests::inverse_suite;
use yawara_tests::inverse_suite::{ops, replay};

inverse_suite!(lu, "lu");
inverse_suite!(paper, "paper");
inverse_suite!(woodbury, "woodbury");
inverse_suite!(woodbury_f32, "woodbury_f32");
inverse_suite!(sparse, "sparse");

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
        let woodbury = replay("woodbury", 3, 4, &ops, 100);
        let paper = replay("paper", 3, 4, &ops, 100);
        println!("relative error after 1000 updates: woodbury {woodbury:e}, paper {paper:e}");
        prop_assert!(woodbury <= 1e-9, "woodbury is off by {woodbury:e}");
    }
}
