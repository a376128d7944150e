//! A maintainer that prefers batches gets the splits of a step together, and everything comes out as
//! with one after the other.

use std::sync::{Arc, Mutex};

use faer::Mat;
use yawara::{SimError, Simulation, Stages, scene_file};
use yawara_inverse_update::{
    Counts, Edit, InverseError, InverseMaintainer, RingChange, SparseStiffness, StiffnessChange,
};

/// What a maintainer was asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Call {
    Split,
    Change,
    Batch(usize),
    Merge,
}

/// `woodbury`, asked for batches or not; it refuses splits beyond so many vertices.
struct Batched {
    inner: Box<dyn InverseMaintainer>,
    prefers_batches: bool,
    most: usize,
    calls: Arc<Mutex<Vec<Call>>>,
}

impl Batched {
    fn note(&self, call: Call) {
        self.calls.lock().unwrap().push(call);
    }
}

impl InverseMaintainer for Batched {
    fn name(&self) -> &'static str {
        "batched"
    }

    fn vertices(&self) -> usize {
        self.inner.vertices()
    }

    fn stiffness(&self) -> &SparseStiffness {
        self.inner.stiffness()
    }

    fn split(&mut self, change: &RingChange) -> Result<usize, InverseError> {
        self.note(Call::Split);
        self.inner.split(change)
    }

    fn edit_batch(&mut self, edits: &[Edit<'_>]) -> Result<(), InverseError> {
        self.note(Call::Batch(edits.len()));
        for (done, edit) in edits.iter().enumerate() {
            if matches!(edit, Edit::Split(_)) && self.inner.vertices() == self.most {
                let source = Box::new(InverseError::EmptyBlock);
                return Err(InverseError::Batch { done, source });
            }
            edit.make(self.inner.as_mut())?;
        }
        Ok(())
    }

    fn prefers_batches(&self) -> bool {
        self.prefers_batches
    }

    fn merge(&mut self, slot: usize, change: &RingChange) -> Result<Option<usize>, InverseError> {
        self.note(Call::Merge);
        self.inner.merge(slot, change)
    }

    fn change(&mut self, change: &StiffnessChange) -> Result<(), InverseError> {
        self.note(Call::Change);
        self.inner.change(change)
    }

    fn solve(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError> {
        self.inner.solve(f, u)
    }

    fn columns(&self, slots: &[usize]) -> Result<Mat<f64>, InverseError> {
        self.inner.columns(slots)
    }

    fn rebuild(&mut self) -> Result<(), InverseError> {
        self.inner.rebuild()
    }

    fn watch(&mut self, seed: u64) -> Result<f64, InverseError> {
        self.inner.watch(seed)
    }

    fn counts(&self) -> Counts {
        self.inner.counts()
    }
}

/// Vertices of the beam at its start, 9 × 3 × 3, but for the fixed ones.
const START: usize = 72;

/// The beam with these settings, and the calls that its maintainer will have got.
fn beam(set: &[&str], prefers_batches: bool, most: usize) -> (Simulation, Arc<Mutex<Vec<Call>>>) {
    let overrides: Vec<String> = set.iter().map(|s| (*s).into()).collect();
    let (scene, _) = scene_file::load("beam", &overrides).unwrap();
    let mut stages = Stages::by_name(&scene.stages).unwrap();
    let calls = Arc::new(Mutex::new(Vec::new()));
    let kept = Arc::clone(&calls);
    stages.inverse = Box::new(move |k| {
        let inner = yawara_inverse_update::build("woodbury", k)?;
        let calls = Arc::clone(&kept);
        Ok(Box::new(Batched { inner, prefers_batches, most, calls }))
    });
    (Simulation::new(&scene, stages).unwrap(), calls)
}

#[test]
fn the_splits_of_a_step_come_together_and_end_as_one_by_one() {
    let set = ["time.steps=16", "solver.residual=1e-9"];
    let (mut one, single) = beam(&set, false, usize::MAX);
    let (mut other, batched) = beam(&set, true, usize::MAX);
    let (mut merges, mut longest) = (0, 0);
    while one.steps_left() > 0 {
        let (first, second) = (one.step().unwrap(), other.step().unwrap());
        assert_eq!((first.splits, first.merges), (second.splits, second.merges));
        let alone = std::mem::take(&mut *single.lock().unwrap());
        let calls = std::mem::take(&mut *batched.lock().unwrap());
        assert!(alone.iter().all(|call| !matches!(call, Call::Batch(_))));
        // Merges come first; all that comes after the last of them is one batch.
        let after = alone.iter().rposition(|call| *call == Call::Merge).map_or(0, |at| at + 1);
        let count = alone.len() - after;
        assert_eq!(calls.last() == Some(&Call::Batch(count)), count > 1, "{alone:?}: {calls:?}");
        assert!(calls.len() <= after + 1, "{alone:?}: {calls:?}");
        longest = longest.max(count);
        merges += first.merges;
        let (want, got) = (one.frame().unwrap(), other.frame().unwrap());
        let pairs =
            || want.displacement_mm.iter().flatten().zip(got.displacement_mm.iter().flatten());
        let size = pairs().map(|(w, _)| w * w).sum::<f64>().sqrt();
        let error = pairs().map(|(w, g)| (w - g).powi(2)).sum::<f64>().sqrt();
        // Both are solved to the same residual, a thousandth of what one more step would take.
        assert!(error <= 1e-6 * size, "step {}: {error:e} of {size:e}", first.step);
    }
    assert!(merges > 0 && longest > 20, "{merges} merges, {longest} edits at most");
    let (one, other) = (one.summary().unwrap().inverse, other.summary().unwrap().inverse);
    assert_eq!(one.updates, other.updates);
}

#[test]
fn in_real_time_every_split_is_made_before_the_clock_is_read() {
    let set = ["time.steps=3", "budget={ step_ms = 1e9, realtime = true }"];
    let (mut simulation, calls) = beam(&set, true, usize::MAX);
    let mut splits = 0;
    while simulation.steps_left() > 0 {
        splits += simulation.step().unwrap().splits;
    }
    // Some of them between fixed vertices, and of these some whose ring is fixed as well.
    let calls = calls.lock().unwrap();
    assert!(calls.len() <= splits && !calls.iter().any(|call| matches!(call, Call::Batch(_))));
    assert!(calls.contains(&Call::Split) && calls.contains(&Call::Change), "{calls:?}");
}

#[test]
fn a_batch_that_is_refused_on_the_way_ends_the_step_with_its_cause() {
    let (mut simulation, calls) = beam(&["time.steps=6"], true, START + 2);
    let error = loop {
        match simulation.step() {
            Ok(report) => assert!(report.vertices <= START + 9 + 2),
            Err(error) => break error,
        }
    };
    assert!(matches!(error, SimError::Inverse(InverseError::EmptyBlock)), "{error}");
    let calls = calls.lock().unwrap();
    assert!(matches!(calls.last(), Some(Call::Batch(count)) if *count > 2), "{calls:?}");
    simulation.frame().unwrap();
    simulation.summary().unwrap();
}
