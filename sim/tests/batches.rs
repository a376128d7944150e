//! A maintainer gets the splits and merges of a step together, and everything comes out as with one
//! after the other.

use std::sync::{Arc, Mutex};

use faer::Mat;
use yawara::{SimError, Simulation, Stages, scene_file};
use yawara_inverse_update::{
    Counts, FreshRows, InverseError, InverseMaintainer, RingChange, SparseStiffness,
    StiffnessChange, Update,
};

/// The lengths of the batches that a maintainer got.
type Lengths = Arc<Mutex<Vec<usize>>>;

/// `woodbury`, which makes batches as such or one update after the other; it refuses splits beyond
/// so many vertices.
struct Batched {
    inner: Box<dyn InverseMaintainer>,
    at_once: bool,
    most: usize,
    lengths: Lengths,
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
        self.inner.split(change)
    }

    fn batch(&mut self, updates: &[Update]) -> Result<(), InverseError> {
        self.lengths.lock().unwrap().push(updates.len());
        if self.at_once {
            return self.inner.batch(updates);
        }
        for (done, update) in updates.iter().enumerate() {
            if matches!(update, Update::Split(_)) && self.inner.vertices() == self.most {
                let source = Box::new(InverseError::EmptyBlock);
                return Err(InverseError::Batch { done, source });
            }
            update.make(self.inner.as_mut())?;
        }
        Ok(())
    }

    fn merge(&mut self, slot: usize, change: &RingChange) -> Result<Option<usize>, InverseError> {
        self.inner.merge(slot, change)
    }

    fn change(&mut self, change: &StiffnessChange) -> Result<(), InverseError> {
        self.inner.change(change)
    }

    fn solve(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError> {
        self.inner.solve(f, u)
    }

    fn columns(&self, slots: &[usize]) -> Result<Mat<f64>, InverseError> {
        self.inner.columns(slots)
    }

    fn refresh(&mut self, rows: &FreshRows) -> Result<(), InverseError> {
        self.inner.refresh(rows)
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

/// Vertices of the beam at its start, 9 × 3 × 3.
const START: usize = 81;

/// The beam with these settings, and the batches that its maintainer will have got.
fn beam(set: &[&str], at_once: bool, most: usize) -> (Simulation, Lengths) {
    let overrides: Vec<String> = set.iter().map(|s| (*s).into()).collect();
    let (scene, _) = scene_file::load("beam", &overrides).unwrap();
    let mut stages = Stages::by_name(&scene.stages).unwrap();
    let lengths = Lengths::default();
    let kept = Arc::clone(&lengths);
    stages.inverse = Box::new(move |k| {
        let inner = yawara_inverse_update::build("woodbury", k)?;
        Ok(Box::new(Batched { inner, at_once, most, lengths: Arc::clone(&kept) }))
    });
    (Simulation::new(&scene, stages).unwrap(), lengths)
}

#[test]
fn the_updates_of_a_step_come_together_and_end_as_one_by_one() {
    // Askew, so that no two indicators are equal but for rounding.
    let askew = "tools.0.path.1.move_m=[0.003, 0.007, 0.02]";
    let set = ["time.steps=16", "solver.residual=1e-9", askew];
    let (mut one, _) = beam(&set, false, usize::MAX);
    let (mut other, lengths) = beam(&set, true, usize::MAX);
    let (mut merges, mut longest) = (0, 0);
    while one.steps_left() > 0 {
        let (first, second) = (one.step().unwrap(), other.step().unwrap());
        assert_eq!((first.splits, first.merges), (second.splits, second.merges));
        let lengths = std::mem::take(&mut *lengths.lock().unwrap());
        let count = first.splits + first.merges;
        // What leaves K as it is, within what is fixed, is not handed over.
        assert_eq!(lengths.len(), usize::from(count > 0));
        assert!(lengths.iter().all(|&length| length <= count));
        longest = longest.max(lengths.first().copied().unwrap_or(0));
        merges += first.merges;
        let (want, got) = (one.frame().unwrap(), other.frame().unwrap());
        let pairs =
            || want.displacement_mm.iter().flatten().zip(got.displacement_mm.iter().flatten());
        let size = pairs().map(|(w, _)| w * w).sum::<f64>().sqrt();
        let error = pairs().map(|(w, g)| (w - g).powi(2)).sum::<f64>().sqrt();
        // Both are solved to the same residual, a thousandth of what one more step would take.
        assert!(error <= 1e-6 * size, "step {}: {error:e} of {size:e}", first.step);
    }
    assert!(merges > 0 && longest > 20, "{merges} merges, {longest} updates at most");
    let (one, other) = (one.summary().unwrap().inverse, other.summary().unwrap().inverse);
    assert_eq!((one.updates, one.batches), (other.updates, other.batches));
    assert!(other.batches <= 16);
}

#[test]
fn in_real_time_every_split_is_made_before_the_clock_is_read() {
    let set = ["time.steps=3", "budget={ step_ms = 1e9, realtime = true }"];
    let (mut simulation, lengths) = beam(&set, true, usize::MAX);
    let mut splits = 0;
    while simulation.steps_left() > 0 {
        splits += simulation.step().unwrap().splits;
    }
    let lengths = lengths.lock().unwrap();
    assert!(splits > 20 && lengths.len() == splits, "{splits} splits: {lengths:?}");
    assert!(lengths.iter().all(|&length| length <= 1));
}

#[test]
fn after_a_refused_update_a_run_goes_on_from_its_elements() {
    let set = ["time.steps=6", "solver.residual=1e-9"];
    let (mut refusing, lengths) = beam(&set, false, START + 2);
    let (mut other, _) = beam(&set, false, usize::MAX);
    while other.steps_left() > 0 {
        let (first, second) = (refusing.step().unwrap(), other.step().unwrap());
        assert_eq!((first.splits, first.vertices), (second.splits, second.vertices));
        assert!(first.converged && second.converged);
        for (got, want) in first.force_n.iter().zip(second.force_n) {
            assert!((got - want).abs() <= 1e-6 * want.abs().max(1e-3), "{got} instead of {want}");
        }
    }
    assert!(lengths.lock().unwrap().iter().any(|&length| length > 2));
    assert_eq!(refusing.summary().unwrap().inverse.reassemblies, 1);
    assert_eq!(other.summary().unwrap().inverse.reassemblies, 0);
}

#[test]
fn a_stiffness_that_can_not_be_inverted_afresh_ends_the_step() {
    let (scene, _) = scene_file::load("beam", &["time.steps=6".into()]).unwrap();
    let mut stages = Stages::by_name(&scene.stages).unwrap();
    stages.inverse = Box::new(|k| match k.vertices() {
        START => {
            let inner = yawara_inverse_update::build("woodbury", k)?;
            let most = START + 2;
            Ok(Box::new(Batched { inner, at_once: false, most, lengths: Lengths::default() }))
        }
        limit => Err(InverseError::Slot { slot: 0, limit }),
    });
    let mut simulation = Simulation::new(&scene, stages).unwrap();
    let error = loop {
        if let Err(error) = simulation.step() {
            break error;
        }
    };
    assert!(matches!(error, SimError::Inverse(InverseError::Slot { .. })), "{error}");
    simulation.frame().unwrap();
    simulation.summary().unwrap();
}
