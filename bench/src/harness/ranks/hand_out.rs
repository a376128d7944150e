//! Who gets which case: the next to whoever asks first.

use std::collections::VecDeque;

/// Cases to give out, and processes that have asked for one.
#[derive(Debug)]
pub(super) struct HandOut {
    processes: usize,
    /// `None` until they are known: others may ask before.
    waiting: Option<VecDeque<usize>>,
    /// Have asked and have no answer yet.
    idle: Vec<usize>,
}

impl HandOut {
    /// Among so many processes.
    pub fn new(processes: usize) -> Self {
        Self { processes, waiting: None, idle: Vec::new() }
    }

    /// The cases, in the order in which they are to be given.
    pub fn begin(&mut self, waiting: Vec<usize>) {
        self.waiting = Some(waiting.into());
    }

    /// A process asks for a case: the one that it had is finished.
    pub fn ask(&mut self, rank: usize) {
        self.idle.push(rank);
    }

    /// What can be answered now, to whom. That there is no case left is said to all at once, when
    /// the last one is finished: from then on nothing more is written.
    pub fn answers(&mut self) -> Vec<(usize, Option<usize>)> {
        let Some(waiting) = &mut self.waiting else { return Vec::new() };
        if waiting.is_empty() && self.idle.len() == self.processes {
            return self.idle.drain(..).map(|rank| (rank, None)).collect();
        }
        let count = self.idle.len().min(waiting.len());
        self.idle.drain(..count).zip(waiting.drain(..count).map(Some)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whoever_is_free_gets_the_next_and_the_end_is_said_when_all_is_finished() {
        let mut hand_out = HandOut::new(3);
        hand_out.ask(2);
        assert_eq!(hand_out.answers(), [], "the cases are not known yet");
        hand_out.begin(vec![4, 5, 7, 8]);
        assert_eq!(hand_out.answers(), [(2, Some(4))]);
        hand_out.ask(0);
        hand_out.ask(1);
        assert_eq!(hand_out.answers(), [(0, Some(5)), (1, Some(7))]);
        hand_out.ask(2);
        hand_out.ask(0);
        assert_eq!(hand_out.answers(), [(2, Some(8))], "two asked and one case was left");
        hand_out.ask(2);
        assert_eq!(hand_out.answers(), [], "1 still has a case");
        hand_out.ask(1);
        assert_eq!(hand_out.answers(), [(0, None), (2, None), (1, None)]);
        // A finished study ends at once.
        let mut hand_out = HandOut::new(2);
        hand_out.begin(Vec::new());
        hand_out.ask(1);
        assert_eq!(hand_out.answers(), []);
        hand_out.ask(0);
        assert_eq!(hand_out.answers(), [(1, None), (0, None)]);
    }
}
