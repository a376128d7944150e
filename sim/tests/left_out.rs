//! What a scene does not need is not computed: calls are counted.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use faer::Mat;
use yawara::indicator::{Energy, Indicator, RingMember};
use yawara::{Simulation, Stages, scene_file};
use yawara_embed::{ChildPair, Homogenisation, Laminate, ParentMaterial};
use yawara_inverse_update::{
    Counts, FreshRows, InverseError, InverseMaintainer, RingChange, SparseStiffness,
    StiffnessChange, Update,
};

/// How often each stage was asked.
#[derive(Default)]
struct Calls {
    homogenisation: AtomicUsize,
    indicator: AtomicUsize,
    update: AtomicUsize,
    solve: AtomicUsize,
    column: AtomicUsize,
}

impl Calls {
    fn add(counter: &AtomicUsize, n: usize) {
        counter.fetch_add(n, Ordering::Relaxed);
    }

    fn of(counter: &AtomicUsize) -> usize {
        counter.load(Ordering::Relaxed)
    }
}

struct CountedHomogenisation(Arc<Calls>);

impl Homogenisation for CountedHomogenisation {
    fn name(&self) -> &str {
        "counted"
    }

    fn combine(&self, pair: &ChildPair) -> ParentMaterial {
        Calls::add(&self.0.homogenisation, 1);
        Laminate.combine(pair)
    }
}

struct CountedIndicator(Arc<Calls>);

impl Indicator for CountedIndicator {
    fn name(&self) -> &'static str {
        "counted"
    }

    fn unit(&self) -> &'static str {
        "J"
    }

    fn measure(&self, ring: &[RingMember]) -> f64 {
        Calls::add(&self.0.indicator, 1);
        Energy.measure(ring)
    }

    fn error_over_sum(&self) -> Option<f64> {
        Energy.error_over_sum()
    }
}

struct CountedInverse(Arc<Calls>, Box<dyn InverseMaintainer>);

impl InverseMaintainer for CountedInverse {
    fn name(&self) -> &'static str {
        "counted"
    }

    fn vertices(&self) -> usize {
        self.1.vertices()
    }

    fn stiffness(&self) -> &SparseStiffness {
        self.1.stiffness()
    }

    fn split(&mut self, change: &RingChange) -> Result<usize, InverseError> {
        Calls::add(&self.0.update, 1);
        self.1.split(change)
    }

    fn merge(&mut self, slot: usize, change: &RingChange) -> Result<Option<usize>, InverseError> {
        Calls::add(&self.0.update, 1);
        self.1.merge(slot, change)
    }

    fn change(&mut self, change: &StiffnessChange) -> Result<(), InverseError> {
        Calls::add(&self.0.update, 1);
        self.1.change(change)
    }

    fn solve(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError> {
        Calls::add(&self.0.solve, 1);
        self.1.solve(f, u)
    }

    fn columns(&self, slots: &[usize]) -> Result<Mat<f64>, InverseError> {
        Calls::add(&self.0.column, slots.len());
        self.1.columns(slots)
    }

    fn refresh(&mut self, rows: &FreshRows) -> Result<(), InverseError> {
        self.1.refresh(rows)
    }

    fn rebuild(&mut self) -> Result<(), InverseError> {
        self.1.rebuild()
    }

    fn watch(&mut self, seed: u64) -> Result<f64, InverseError> {
        self.1.watch(seed)
    }

    fn batch(&mut self, updates: &[Update]) -> Result<(), InverseError> {
        Calls::add(&self.0.update, updates.len());
        self.1.batch(updates)
    }

    fn counts(&self) -> Counts {
        self.1.counts()
    }
}

/// Runs three steps of the beam with these settings; returns the calls and which stages the plan
/// said would run.
fn run(set: &[&str]) -> (Arc<Calls>, Vec<(String, bool)>) {
    let mut overrides: Vec<String> = set.iter().map(|s| (*s).into()).collect();
    overrides.push("time.steps=3".into());
    let (scene, _) = scene_file::load("beam", &overrides).unwrap();
    let calls = Arc::new(Calls::default());
    let mut stages = Stages::by_name(&scene.stages).unwrap();
    stages.homogenisation = Box::new(CountedHomogenisation(calls.clone()));
    stages.indicator = Box::new(CountedIndicator(calls.clone()));
    let for_factory = calls.clone();
    stages.inverse = Box::new(move |k| {
        let inner = yawara_inverse_update::build("woodbury", k)?;
        Ok(Box::new(CountedInverse(for_factory.clone(), inner)))
    });
    let mut simulation = Simulation::new(&scene, stages).unwrap();
    while simulation.steps_left() > 0 {
        assert!(simulation.step().unwrap().converged);
    }
    let plan = simulation.plan().iter().map(|row| (row.stage.clone(), row.runs)).collect();
    (calls, plan)
}

fn runs(plan: &[(String, bool)], stage: &str) -> bool {
    plan.iter().find(|(name, _)| name == stage).unwrap().1
}

#[test]
fn a_scene_that_needs_everything_calls_everything() {
    let (calls, plan) = run(&[
        "image={ phantom = 'liver', length_mm = 200.0, voxel_mm = 10.0 }",
        "mesh.base_mm=40.0",
        "materials.1={ label = 2, young_modulus_pa = 5e5, poisson_ratio = 0.3 }",
        "materials.2={ label = 3, young_modulus_pa = 5e5, poisson_ratio = 0.3 }",
        "materials.3={ label = 4, young_modulus_pa = 5e5, poisson_ratio = 0.3 }",
        "fixed=[{ shape = 'box', min = [0.6, 0.0, 0.0], max = [1.0, 1.0, 1.0] }]",
        "tools.0.region={ shape = 'sphere', centre = [0.1, 0.7, 0.7], radius_m = 0.03 }",
        "refinement.split_above=1e-9",
        "tools.0.hold=vertices",
    ]);
    for stage in ["homogenisation", "refinement", "inverse update", "compliance columns"] {
        assert!(runs(&plan, stage), "{stage}");
    }
    for counter in
        [&calls.homogenisation, &calls.indicator, &calls.update, &calls.solve, &calls.column]
    {
        assert!(Calls::of(counter) > 0);
    }
}

#[test]
fn one_material_is_never_homogenised() {
    let (calls, plan) = run(&[]);
    assert!(!runs(&plan, "homogenisation"));
    assert_eq!(Calls::of(&calls.homogenisation), 0);
    assert!(Calls::of(&calls.update) > 0, "though it refines");
}

#[test]
fn a_fixed_mesh_measures_and_updates_nothing() {
    let (calls, plan) = run(&["mesh.max_level=0"]);
    assert!(!runs(&plan, "refinement") && !runs(&plan, "inverse update"));
    assert_eq!((Calls::of(&calls.indicator), Calls::of(&calls.update)), (0, 0));
    assert!(Calls::of(&calls.solve) > 0);
}

#[test]
fn without_a_tool_no_column_is_read() {
    let (calls, plan) = run(&["tools=[]", "mesh.max_level=0"]);
    assert!(!runs(&plan, "compliance columns"));
    assert_eq!(Calls::of(&calls.column), 0);
}
