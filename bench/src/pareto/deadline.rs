//! An inverse that stops when its time is up: a case of hours ends as a row that says so.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use delegate::delegate;
use faer::{Mat, MatRef};
use yawara::{InverseFactory, SimError};
use yawara_embed::EmbedError;
use yawara_inverse_update::{
    Counts, FreshRows, InverseError, InverseMaintainer, Load, RingChange, SparseStiffness,
    StiffnessChange, StorageError, Update,
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

    /// Ends work that asks whether to go on.
    pub fn watch(self) -> ControlFlow<()> {
        if self.is_over() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Whether an error says that the time is up.
    pub fn ended(error: &SimError) -> bool {
        match error {
            SimError::Inverse(InverseError::Storage { cause, .. }) => cause.get().is::<TimeIsUp>(),
            SimError::Embed(EmbedError::Stopped { .. }) => true,
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
    fn in_time(&self) -> Result<&dyn InverseMaintainer, InverseError> {
        if !self.deadline.is_over() {
            return Ok(self.inner.as_ref());
        }
        let cause = StorageError::new(TimeIsUp);
        Err(InverseError::Storage { method: self.inner.name(), cause })
    }

    fn in_time_mut(&mut self) -> Result<&mut dyn InverseMaintainer, InverseError> {
        self.in_time()?;
        Ok(self.inner.as_mut())
    }
}

impl InverseMaintainer for Guarded {
    delegate! {
        to self.inner {
            fn name(&self) -> &'static str;
            fn place(&self) -> Option<String>;
            fn vertices(&self) -> usize;
            fn stiffness(&self) -> &SparseStiffness;
            fn holds_columns(&self) -> bool;
            fn watch(&mut self, seed: u64) -> Result<f64, InverseError>;
            fn counts(&self) -> Counts;
        }
        to self.in_time()? {
            fn solve(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError>;
            fn solve_many(&self, loads: MatRef<'_, f64>) -> Result<Mat<f64>, InverseError>;
            fn columns(&self, slots: &[usize]) -> Result<Mat<f64>, InverseError>;
            fn compliance(&self, loads: &[Load]) -> Result<Mat<f64>, InverseError>;
            fn rough_compliance(&self, loads: &[Load]) -> Result<Mat<f64>, InverseError>;
            fn precondition(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError>;
            fn precondition_and_reply(
                &self,
                f: &[f64],
                rows: &[usize],
                reply: &mut dyn FnMut(&[f64]) -> Vec<f64>,
                u: &mut [f64],
            ) -> Result<(), InverseError>;
            fn apply(&self, f: &[f64], u: &mut [f64]) -> Result<(), InverseError>;
            fn apply_and_reply(
                &self,
                f: &[f64],
                rows: &[usize],
                reply: &mut dyn FnMut(&[f64]) -> Vec<f64>,
                u: &mut [f64],
            ) -> Result<(), InverseError>;
        }
        to self.in_time_mut()? {
            fn split(&mut self, ring: &RingChange) -> Result<usize, InverseError>;
            fn merge(
                &mut self,
                slot: usize,
                ring: &RingChange,
            ) -> Result<Option<usize>, InverseError>;
            fn fix(&mut self, slot: usize) -> Result<Option<usize>, InverseError>;
            fn change(&mut self, change: &StiffnessChange) -> Result<(), InverseError>;
            fn batch(&mut self, updates: &[Update]) -> Result<(), InverseError>;
            fn batch_to(&mut self, updates: &[Update], rows: &FreshRows) -> Result<(), InverseError>;
            fn refresh(&mut self, rows: &FreshRows) -> Result<(), InverseError>;
            fn rebuild(&mut self) -> Result<(), InverseError>;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::mat;
    use yawara::{Simulation, Stages, scene_file};
    use yawara_inverse_update::Sparse;

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
        // So is homogenising.
        assert!(Deadline::after(0.0).watch().is_break());
        assert!(Deadline::after(600.0).watch().is_continue());
        assert!(Deadline::ended(&SimError::Embed(EmbedError::Stopped { done: 0.5 })));
    }

    /// An inverse in a row of springs that is read in fewer digits where it may be.
    fn inverse() -> Box<dyn InverseMaintainer> {
        let mut k = SparseStiffness::zeros(40, 1).unwrap();
        for v in 0..40 {
            k.add(&[v], mat![[0.1 * (1 + v) as f64]].as_ref()).unwrap();
        }
        for v in 1..40 {
            k.add(&[v - 1, v], mat![[1.0, -1.0], [-1.0, 1.0]].as_ref()).unwrap();
        }
        Box::new(Sparse::new(k).unwrap())
    }

    #[test]
    fn a_guarded_inverse_has_the_shortcuts_of_the_one_that_it_guards() {
        let guarded = Deadline::after(600.0).guard(Box::new(|_| Ok(inverse())));
        let guarded = guarded(inverse().stiffness().clone()).unwrap();
        let load: Vec<f64> = (0..40).map(|i| (i as f64).sin()).collect();
        let rows = [3, 17];
        let loads: Vec<Load> = rows.map(|row| vec![(row, 1.0)]).to_vec();
        // What is read in fewer digits, and in all.
        let rough = |inverse: &dyn InverseMaintainer| {
            let mut reply = |u: &[f64]| u.iter().map(|u| -0.5 * u).collect();
            let [mut one, mut two] = [(); 2].map(|()| vec![0.0; 40]);
            inverse.precondition(&load, &mut one).unwrap();
            inverse.precondition_and_reply(&load, &rows, &mut reply, &mut two).unwrap();
            (one, two, inverse.rough_compliance(&loads).unwrap())
        };
        let exact = |inverse: &dyn InverseMaintainer| {
            let mut reply = |u: &[f64]| u.iter().map(|u| -0.5 * u).collect();
            let [mut one, mut two] = [(); 2].map(|()| vec![0.0; 40]);
            inverse.apply(&load, &mut one).unwrap();
            inverse.apply_and_reply(&load, &rows, &mut reply, &mut two).unwrap();
            (one, two, inverse.compliance(&loads).unwrap())
        };
        let (got, want) = (rough(guarded.as_ref()), rough(inverse().as_ref()));
        assert!(got == want);
        let all = exact(guarded.as_ref());
        assert!(all == exact(inverse().as_ref()));
        assert!(got.0 != all.0 && got.1 != all.1 && got.2 != all.2);
    }
}
