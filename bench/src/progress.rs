//! A bar with the time left, for studies that take minutes.

use std::io::{IsTerminal, Write, stderr};
use std::time::{Duration, Instant};

use crate::ranks;

/// Between two drawings of the bar.
const PAUSE: Duration = Duration::from_millis(200);

/// Characters between the brackets.
const WIDTH: usize = 24;

/// How far a study is; drawn on a terminal, silent in a pipe and in all processes but the first.
pub(crate) struct Progress {
    begin: Instant,
    drawn: Option<Instant>,
    done: f64,
    total: f64,
    shown: bool,
}

impl Progress {
    /// Of `total` units of work, whatever they are: they should take equally long.
    pub fn new(total: f64) -> Self {
        let shown = stderr().is_terminal() && ranks::is_first();
        Self { begin: Instant::now(), drawn: None, done: 0.0, total, shown }
    }

    /// Says what is being done, and that `work` units more are done.
    pub fn advance(&mut self, what: &str, work: f64) {
        self.done += work;
        if !self.shown || self.drawn.is_some_and(|drawn| drawn.elapsed() < PAUSE) {
            return;
        }
        self.drawn = Some(Instant::now());
        let line = line(what, self.done / self.total, self.begin.elapsed());
        // A terminal that is gone is no reason to stop measuring.
        let _ = write!(stderr(), "\r\x1b[K{line}");
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if self.drawn.is_some() {
            let _ = write!(stderr(), "\r\x1b[K");
        }
    }
}

fn line(what: &str, fraction: f64, elapsed: Duration) -> String {
    let fraction = fraction.clamp(0.0, 1.0);
    let filled = (fraction * WIDTH as f64) as usize;
    let bar = "#".repeat(filled) + &" ".repeat(WIDTH - filled);
    let left = if fraction > 0.0 {
        let seconds = (elapsed.as_secs_f64() * (1.0 / fraction - 1.0)).round() as u64;
        format!("{}:{:02} left", seconds / 60, seconds % 60)
    } else {
        "time left unknown".to_owned()
    };
    format!("[{bar}] {:3.0} %, {left}  {what}", 100.0 * fraction)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_follows_from_the_time_taken() {
        let line = line("728 vertices", 0.25, Duration::from_secs(50));
        assert_eq!(line, "[######                  ]  25 %, 2:30 left  728 vertices");
    }

    #[test]
    fn nothing_is_divided_by_nothing_and_the_bar_ends() {
        assert!(line("", 0.0, Duration::ZERO).contains("unknown"));
        assert!(line("", 1.5, Duration::from_secs(9)).contains("100 %, 0:00 left"));
    }
}
