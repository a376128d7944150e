//! An inverse that stops when its time is up: a case of hours ends as a row that says so.

use std::time::{Duration, Instant};

use faer::{Mat, MatRef};
use yawara::{InverseFactory, SimError};
use yawara_inverse_update::{
    Counts, Edit, InverseError, InverseMaintainer, RingChange, SparseStiffness, StiffnessChange,
    StorageError,
};

/// The time of a case is up.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("the time of this case is up")]
pub(crate) struct TimeIsUp;

/// Until when a case may run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Deadline(Instant);

impl Deadline {
    /// So many seconds from now.
    pub fn after(seconds: f64) -> Self {
        // More than a year is as good as for ever.
        Self(Instant::now() + Duration::from_secs_f64(seconds.clamp(0.0, 3e7)))
    }

    pub fn is_over(self) -> bool {
        Instant::now() >= self.0
    }

    /// Whether an error says that the time is up.
    pub fn ended(error: &SimError) -> bool {
        match error {
            SimError::Inverse(InverseError::Storage { cause, .. }) => cause.get().is::<TimeIsUp>(),
            _ => false,
        }
    }

    /// What `factory` makes, stopped in time.
    pub fn guard(self, factory: InverseFactory) -> InverseFactory {
        Box::new(move |k| Ok(Box::new(Guarded { inner: factory(k)?, deadline: self })))
    }
}

struct Guarded {
    inner: Box<dyn InverseMaintainer>,
    deadline: Deadline,
}

impl Guarded {
    fn check(&self) -> Result<(), InverseError> {
        if !self.deadline.is_over() {
            return Ok(());
        }
        let cause = StorageError::new(TimeIsUp);
        Err(InverseError::Storage { method: self.inner.name(), cause })
    }
}

impl InverseMaintainer for Guarded {
    fn name(&self) -> &'static str {
        self.inner.name()
    }

    fn place(&self) -> Option<String> {
        self.inner.place()
    }

    fn vertices(&self) -> usize {
        self.inner.vertices()
    }

    fn stiffness(&self) -> &SparseStiffness {
        self.inner.stiffness()
    }

    fn split(&mut self, change: &RingChange) -> Result<usize, InverseError> {
        self.check()?;
        self.inner.split(change)
    }

    fn split_batch(&mut self, changes: &[RingChange]) -> Result<Vec<usize>, InverseError> {
        self.check()?;
        self.inner.split_batch(changes)
    }

    fn edit_batch(&mut self, edits: &[Edit<'_>]) -> Result<(), InverseError> {
        self.check()?;
        self.inner.edit_batch(edits)
    }

    fn prefers_batches(&self) -> bool {
        self.inner.prefers_batches()
    }

    fn merge(&mut self, slot: usize, change: &RingChange) -> Result<Option<usize>, InverseError> {
        self.check()?;
        self.inner.merge(slot, change)
    }

    fn fix(&mut self, slot: usize) -> Result<Option<usize>, InverseError> {
        self.check()?;
        self.inner.fix(slot)
    }

    fn change(&mut self, change: &StiffnessChange) -> Result<(), InverseError> {
        self.check()?;
        self.inner.change(change)
    }

    fn solve(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError> {
        self.check()?;
        self.inner.solve(f, u)
    }

    fn solve_many(&self, loads: MatRef<'_, f64>) -> Result<Mat<f64>, InverseError> {
        self.check()?;
        self.inner.solve_many(loads)
    }

    fn columns(&self, slots: &[usize]) -> Result<Mat<f64>, InverseError> {
        self.check()?;
        self.inner.columns(slots)
    }

    fn compliance(&self, slots: &[usize]) -> Result<Mat<f64>, InverseError> {
        self.check()?;
        self.inner.compliance(slots)
    }

    fn holds_columns(&self) -> bool {
        self.inner.holds_columns()
    }

    fn rebuild(&mut self) -> Result<(), InverseError> {
        self.check()?;
        self.inner.rebuild()
    }

    fn watch(&mut self, seed: u64) -> Result<f64, InverseError> {
        self.inner.watch(seed)
    }

    fn counts(&self) -> Counts {
        self.inner.counts()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yawara::{Simulation, Stages, scene_file};

    fn run(seconds: f64) -> Result<Simulation, SimError> {
        let (scene, _) = scene_file::load("beam", &["mesh.max_level=0".into()]).unwrap();
        let mut stages = Stages::by_name(&scene.stages).unwrap();
        stages.inverse = Deadline::after(seconds).guard(stages.inverse);
        let mut simulation = Simulation::new(&scene, stages)?;
        simulation.step()?;
        Ok(simulation)
    }

    #[test]
    fn a_run_is_stopped_when_its_time_is_up_and_not_before() {
        let error = run(0.0).err().unwrap();
        assert!(Deadline::ended(&error), "{error}");
        assert!(run(600.0).is_ok());
        let other = InverseError::Slot { slot: 3, limit: 2 };
        assert!(!Deadline::ended(&SimError::Inverse(other)));
    }
}
