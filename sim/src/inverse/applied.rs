//! The inverse as an equilibrium asks for it: timed, with errors kept for later.

use std::cell::RefCell;
use std::time::Instant;

use yawara_corot::{Inverse, reply_by_two};

use super::held::Constrained;
use crate::error::SimError;

/// Applications of an inverse during a solve.
pub(crate) struct Applied<'a> {
    constrained: &'a Constrained<'a>,
    /// What each took, ms.
    times: RefCell<Vec<f64>>,
    error: RefCell<Option<SimError>>,
}

impl<'a> Applied<'a> {
    pub fn new(constrained: &'a Constrained<'a>) -> Self {
        Self { constrained, times: RefCell::default(), error: RefCell::default() }
    }

    /// The times of all applications, ms, and the last error; what an application that failed gave is
    /// not a number.
    pub fn end(self) -> (Vec<f64>, Option<SimError>) {
        (self.times.into_inner(), self.error.into_inner())
    }

    fn time<T>(&self, apply: impl FnOnce() -> T) -> T {
        let begin = Instant::now();
        let result = apply();
        self.times.borrow_mut().push(begin.elapsed().as_secs_f64() * 1e3);
        result
    }

    fn note(&self, error: SimError, y: &mut [f64]) {
        y.fill(f64::NAN);
        *self.error.borrow_mut() = Some(error);
    }
}

impl Inverse for Applied<'_> {
    fn compliance(&self, _: usize, loads: &[Vec<(usize, f64)>]) -> Vec<f64> {
        let k = loads.len();
        match self.time(|| self.constrained.compliance(loads)) {
            Ok(block) => (0..k * k).map(|at| block[(at / k, at % k)]).collect(),
            Err(error) => {
                let mut block = vec![0.0; k * k];
                self.note(error, &mut block);
                block
            }
        }
    }

    fn apply(&self, f: &[f64], y: &mut [f64]) {
        if let Err(error) = self.time(|| self.constrained.precondition(f, y)) {
            self.note(error, y);
        }
    }

    fn apply_and_reply(
        &self,
        f: &[f64],
        rows: &[usize],
        reply: &mut dyn FnMut(&[f64]) -> Vec<f64>,
        y: &mut [f64],
    ) {
        if !self.constrained.can_reply() {
            return reply_by_two(self, f, rows, reply, y);
        }
        if let Err(error) = self.time(|| self.constrained.precondition_and_reply(f, rows, reply, y))
        {
            self.note(error, y);
        }
    }
}
