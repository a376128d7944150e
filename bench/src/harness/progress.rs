//! A bar with the time left, for studies that take minutes.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::ranks;

/// Steps that the bar counts to: work is in any unit.
const STEPS: f64 = 1e6;

/// How far a study is; drawn on a terminal, silent in a pipe and in all processes but the first.
pub struct Progress {
    bar: ProgressBar,
    done: f64,
    total: f64,
}

impl Progress {
    /// Of `total` units of work, which should take equally long.
    pub fn new(total: f64) -> Self {
        let hidden = ProgressDrawTarget::hidden();
        let target = if ranks::is_first() { ProgressDrawTarget::stderr_with_hz(5) } else { hidden };
        let style = "[{bar:24}] {percent:>3} %, {eta} left  {wide_msg}";
        let style = ProgressStyle::with_template(style)
            .unwrap_or_else(|_| unreachable!("{style:?} is a template"));
        let bar = ProgressBar::with_draw_target(Some(STEPS as u64), target).with_style(style);
        Self { bar, done: 0.0, total }
    }

    /// Says what is being done, and that `work` units more are done.
    pub fn advance(&mut self, what: &str, work: f64) {
        self.done += work;
        self.bar.set_message(what.to_owned());
        self.bar.set_position((STEPS * (self.done / self.total).clamp(0.0, 1.0)) as u64);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
