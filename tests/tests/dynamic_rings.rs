//! The hand-over of elements with mass against plain assembly, densities differing or not.

use proptest::prelude::*;
use proptest::sample::Index;
use yawara_embed::{Embedding, Mass, Material, StepWeights, dynamic_by_name};
use yawara_mesh::{BisectionForest, MeshDelta, Placement, VertexId};
use yawara_tests::organ::{Organ, organs};
use yawara_tests::stage_suites::element_formulation::check_ring;

const MAX_LEVEL: u8 = 8;

/// The embedding of an organ whose labels have these densities.
fn embedding(organ: &Organ, densities: &[f64]) -> Embedding {
    let solid = organ.materials.iter().zip(densities);
    let solid = solid.map(|(&(e, nu), &rho)| Material::new(e, nu, rho).unwrap());
    let void = Material::new(1.0, 0.0, 0.0).unwrap();
    let rule = yawara_embed::by_name("laminate").unwrap();
    Embedding::new(organ.tree(), std::iter::once(void).chain(solid).collect(), rule).unwrap()
}

/// Splits at random, each ring checked; the columns of either sign in the last of them.
fn split(
    element: &str,
    weights: StepWeights,
    organ: &Organ,
    densities: &[f64],
    picks: &[Index],
) -> Vec<[usize; 2]> {
    let element = dynamic_by_name(element, weights).unwrap();
    let embedding = embedding(organ, densities);
    let mut forest: BisectionForest = organ.forest(0, MAX_LEVEL);
    let placement: Placement = organ.placement(MAX_LEVEL);
    let mut delta = MeshDelta::empty();
    let mut columns = Vec::new();
    for pick in picks {
        let candidates = forest.candidates();
        forest.split(candidates[pick.index(candidates.len())], &mut delta).unwrap();
        let position = |v: VertexId| placement.position(forest.point(v));
        let ring = element.ring(&delta, &embedding, &position);
        check_ring(element.as_ref(), &ring, &delta, &embedding, &position);
        columns.push([ring.positive.ncols(), ring.negative.ncols()]);
    }
    columns
}

fn weights(mass: Mass, stiffness: f64) -> StepWeights {
    // Mass and stiffness of like size: ρ h² c against E.
    StepWeights { mass, mass_per_s2: 1e4, stiffness }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    #[test]
    fn rings_with_mass_are_what_assembly_gives(
        organ in organs([1, 1, 1], 3, 2.0..4.0, -0.3..0.45),
        densities in proptest::array::uniform3(0.0..3000.0f64),
        picks in proptest::collection::vec(any::<Index>(), 12),
        lumped in any::<bool>(),
    ) {
        let mass = if lumped { Mass::Lumped } else { Mass::Consistent };
        split("p1", weights(mass, 1.7), &organ, &densities, &picks);
        split("p1p1", weights(mass, 1.7), &organ, &densities, &picks);
    }

    #[test]
    fn mass_adds_the_rank_that_is_said(
        organ in organs([1, 1, 1], 2, 2.0..4.0, 0.1..0.3),
        picks in proptest::collection::vec(any::<Index>(), 20),
    ) {
        let columns = |mass, densities: &[f64]| split("p1", weights(mass, 1.0), &organ, densities, &picks);
        let bare = columns(Mass::Consistent, &[0.0; 2]);
        // Even density: the consistent mass adds nothing, the lumped one three columns.
        prop_assert_eq!(&columns(Mass::Consistent, &[900.0; 2]), &bare);
        for (with, without) in columns(Mass::Lumped, &[900.0; 2]).iter().zip(&bare) {
            prop_assert_eq!(*with, [without[0], without[1] + 3]);
        }
        // Uneven density: at most three of either sign.
        for mass in [Mass::Consistent, Mass::Lumped] {
            for (with, without) in columns(mass, &[900.0, 2000.0]).iter().zip(&bare) {
                prop_assert!(with[0] <= without[0] + 3 && with[1] <= without[1] + 3);
            }
        }
    }
}

#[test]
fn weights_that_are_none_are_refused() {
    for (mass_per_s2, stiffness) in
        [(f64::NAN, 1.0), (f64::INFINITY, 1.0), (-1.0, 1.0), (1.0, 0.0), (1.0, f64::INFINITY)]
    {
        assert!(StepWeights::new(Mass::Consistent, mass_per_s2, stiffness).is_err());
    }
    let weights = StepWeights::new(Mass::Lumped, 120.0, 4.0).unwrap();
    assert_eq!((weights.mass_per_s2, weights.stiffness), (120.0, 4.0));
    assert!(dynamic_by_name("p2", weights).is_err());
}
