//! Refinement of a start mesh by a closure, and the floor of merging that it leaves.

use std::sync::Arc;

use yawara_mesh::{
    BisectionError, BisectionForest, Domain, LabelTree, Lattice, MeshDelta, Point, Region, Tet,
};

/// 2 × 2 × 2 cells of one label, 8 lattice units each.
fn forest() -> BisectionForest {
    let cells = [2; 3];
    let domain = Domain::full(Lattice::new(cells, 9));
    BisectionForest::new(domain, Arc::new(LabelTree::homogeneous(cells, 1)), 0, 9).unwrap()
}

/// The active vertices, whatever their numbers.
fn points(f: &BisectionForest) -> Vec<Point> {
    let mut points: Vec<Point> = f.vertices().map(|v| f.point(v)).collect();
    points.sort_unstable();
    points
}

/// Whether a lattice point lies in the closed tetrahedron.
fn holds(f: &BisectionForest, tet: &Tet, p: Point) -> bool {
    let corners = tet.vertices.map(|v| f.point(v));
    let volume6 = yawara_mesh::kuhn::signed_volume6;
    let whole = volume6(&corners);
    (0..4).all(|i| {
        let mut with = corners;
        with[i] = p;
        volume6(&with) * whole.signum() >= 0
    })
}

#[test]
fn leaves_that_hold_a_point_are_refined_to_the_level() {
    let here = [5, 9, 3];
    let mut f = forest();
    let before = f.vertex_count();
    let done =
        f.refine_where(7, usize::MAX, Region::Everywhere, &|f, tet| holds(f, tet, here)).unwrap();
    assert_eq!((done.added, done.left), (f.vertex_count() - before, 0));
    let (at, away): (Vec<Tet>, Vec<Tet>) = f.leaves().partition(|tet| holds(&f, tet, here));
    assert!(!at.is_empty() && at.iter().all(|tet| tet.level == 7), "{at:?}");
    assert!(away.iter().any(|tet| tet.level < 4), "far away stays coarse");
    let error = f.refine_where(10, usize::MAX, Region::Everywhere, &|_, _| true).unwrap_err();
    assert!(matches!(error, BisectionError::Level { level: 10, limit: 9, .. }), "{error}");
}

#[test]
fn a_question_that_is_always_no_changes_nothing() {
    let mut f = forest();
    let done = f.refine_where(9, usize::MAX, Region::Everywhere, &|_, _| false).unwrap();
    assert_eq!((done.added, done.left, points(&f)), (0, 0, points(&forest())));
}

#[test]
fn the_limit_counts_what_is_left() {
    let mut f = forest();
    let limit = f.vertex_count() + 20;
    let done = f.refine_where(6, limit, Region::Everywhere, &|_, _| true).unwrap();
    assert!(f.vertex_count() <= limit && done.added > 0);
    assert_eq!(done.left, f.leaves().filter(|tet| tet.level < 6).count());
}

#[test]
fn a_ball_reaches_what_its_closest_point_of_the_box_is_within() {
    // The boxes of all level-3 tetrahedra are cubes of 4 units.
    let reached = |centre: [f64; 3], radius: f64| {
        let mut f = forest();
        f.refine_uniformly(3).unwrap();
        let before = f.leaf_count();
        f.refine_where(4, usize::MAX, Region::Ball(centre, radius), &|_, _| true).unwrap();
        f.leaf_count() > before
    };
    // Corner (0, 0, 0) is 5 away from (-3, -4, 0), the face x = 16 is 2 away from (18, 7, 7).
    assert!(reached([-3.0, -4.0, 0.0], 5.0));
    assert!(!reached([-3.0, -4.0, 0.0], 4.999));
    assert!(reached([18.0, 7.0, 7.0], 2.0));
    assert!(!reached([18.0, 7.0, 7.0], 1.999));
    assert!(reached([9.0, 9.0, 9.0], 0.0), "inside of a tetrahedron's box");
}

#[test]
fn merging_ends_at_the_floor() {
    let mut f = forest();
    f.refine_where(6, usize::MAX, Region::Everywhere, &|f, tet| holds(f, tet, [5, 9, 3])).unwrap();
    f.make_floor();
    let floor = points(&f);
    assert!(f.vertices().all(|v| !f.is_mergeable(v)));
    f.refine_uniformly(7).unwrap();
    assert!(f.vertex_count() > floor.len());
    let mut delta = MeshDelta::empty();
    loop {
        let mergeable = f.vertices().find(|&v| f.is_mergeable(v));
        let Some(v) = mergeable else { break };
        f.merge(v, &mut delta).unwrap();
    }
    assert_eq!(points(&f), floor);
    // A number that is used again does not inherit the floor.
    let p = f.candidates()[0];
    let v = f.split(p, &mut delta).unwrap();
    assert!(f.is_mergeable(v));
    let held = f.vertices().find(|&w| w != v).unwrap();
    assert!(matches!(f.merge(held, &mut delta), Err(BisectionError::NotMergeable { .. })));
}
