//! The inverse stiffness that solvers precondition with.

/// C of the unrotated body, between vectors by vertex number.
///
/// A closure `|f, y|` that writes y = C f is one; what can reply within a solve for less than two
/// applications implements both methods.
pub trait Inverse {
    /// y = C f. N and m, and N m and 1 in the fourth entries of a mixed body.
    fn apply(&self, f: &[f64], y: &mut [f64]);

    /// y = C (f + e), where e acts on some `rows` of the vectors alone and `reply` chooses it by what
    /// C f is there, both in the order of `rows`. Cost: two applications unless there is a shorter way.
    fn apply_and_reply(
        &self,
        f: &[f64],
        rows: &[usize],
        reply: &mut dyn FnMut(&[f64]) -> Vec<f64>,
        y: &mut [f64],
    ) {
        reply_by_two(self, f, rows, reply, y);
    }

    /// G C Gᵀ by rows for some loads G, each of rows of the vectors and forces, where the vectors have
    /// `rows` entries. Cost: an application a load unless there is a shorter way.
    fn compliance(&self, rows: usize, loads: &[Vec<(usize, f64)>]) -> Vec<f64> {
        let mut block = Vec::with_capacity(loads.len() * loads.len());
        for load in loads {
            let (mut f, mut y) = (vec![0.0; rows], vec![0.0; rows]);
            load.iter().for_each(|&(row, force)| f[row] += force);
            self.apply(&f, &mut y);
            let gives = |load: &Vec<(usize, f64)>| load.iter().map(|&(row, f)| f * y[row]).sum();
            block.extend(loads.iter().map(gives).collect::<Vec<f64>>());
        }
        block
    }
}

/// [`Inverse::apply_and_reply`] by an application for each of the loads.
pub fn reply_by_two<I: Inverse + ?Sized>(
    inverse: &I,
    f: &[f64],
    rows: &[usize],
    reply: &mut dyn FnMut(&[f64]) -> Vec<f64>,
    y: &mut [f64],
) {
    inverse.apply(f, y);
    let there: Vec<f64> = rows.iter().map(|&row| y[row]).collect();
    let (mut load, mut more) = (vec![0.0; f.len()], vec![0.0; f.len()]);
    rows.iter().zip(reply(&there)).for_each(|(&row, force)| load[row] += force);
    inverse.apply(&load, &mut more);
    y.iter_mut().zip(&more).for_each(|(y, more)| *y += more);
}

impl<F: Fn(&[f64], &mut [f64])> Inverse for F {
    fn apply(&self, f: &[f64], y: &mut [f64]) {
        self(f, y);
    }
}
