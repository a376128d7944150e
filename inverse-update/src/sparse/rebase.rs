//! A factor with a fresh elimination order, made while the old one is in use.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};

use rayon::ThreadPoolBuilder;

use super::bennett::Scratch;
use super::dissection;
use super::edit::Edit;
use super::factor::{Factor, NONE};
use super::inherit::inherited_order;
use super::pattern::Pattern;
use super::pivot::BadPivot;
use super::symbolic::Symbolic;

/// A factor as it was made, its base, and as it is after some edits.
#[derive(Default)]
pub(crate) struct Based {
    /// A copy of the factor as it was made; `None` before the first edit.
    base: Option<Factor>,
    pub factor: Factor,
    /// Blocks of the base, and the operations that it took.
    pub blocks: usize,
    pub operations: f64,
    /// Positions of the base: higher ones came with edits.
    ordered: usize,
    /// Operations per square of the vertices, as they were when the order was found.
    usual: f64,
}

fn squared(pattern: &Pattern) -> f64 {
    (pattern.vertices() as f64).powi(2)
}

impl Based {
    /// Orders and factors a matrix.
    /// # Errors
    /// [`BadPivot`] with the slot of the vertex for its position.
    pub(crate) fn new(pattern: &Pattern) -> Result<Self, BadPivot> {
        let symbolic = Symbolic::new(pattern, dissection::order(pattern));
        let mut based = Self::of(pattern, &symbolic)?;
        based.usual = based.operations / squared(pattern);
        Ok(based)
    }

    /// Factors another matrix in the order of this one, if that takes no more than `growth` times the operations that a
    /// new order took per square of the vertices; else as [`new`](Self::new). `ranks` are those of
    /// [`ranks`](Self::ranks), brought up to date.
    /// # Errors
    /// As [`new`](Self::new).
    pub(crate) fn renewed(
        &self,
        pattern: &Pattern,
        ranks: &[u32],
        growth: f64,
    ) -> Result<Self, BadPivot> {
        let symbolic = Symbolic::new(pattern, inherited_order(pattern, ranks));
        if symbolic.operations(pattern.block) > growth * self.usual * squared(pattern) {
            return Self::new(pattern);
        }
        let mut based = Self::of(pattern, &symbolic)?;
        based.usual = self.usual;
        Ok(based)
    }

    fn of(pattern: &Pattern, symbolic: &Symbolic) -> Result<Self, BadPivot> {
        let last = symbolic.order.len();
        let mut factor = Factor::new(pattern, symbolic)
            .map_err(|bad| BadPivot { position: symbolic.order[last - 1 - bad.position], ..bad })?;
        factor.try_rounding(pattern);
        let (blocks, operations) = (factor.blocks, symbolic.operations(pattern.block));
        Ok(Self { base: None, factor, blocks, operations, ordered: last, usual: 0.0 })
    }

    /// When each slot's vertex is eliminated; [`NONE`] for those that edits brought.
    pub(crate) fn ranks(&self) -> Vec<u32> {
        let rank = |&position: &u32| match self.ordered.checked_sub(position as usize + 1) {
            Some(rank) => rank as u32,
            None => NONE,
        };
        self.factor.position_of.iter().map(rank).collect()
    }

    /// Makes an edit.
    /// # Errors
    /// [`BadPivot`]; the factor is damaged then.
    pub(crate) fn apply(&mut self, edit: &Edit, scratch: &mut Scratch) -> Result<(), BadPivot> {
        self.base.get_or_insert_with(|| self.factor.clone());
        self.factor.apply(edit, scratch)
    }

    /// Reproduces the factor as it was after these edits, to the last bit.
    pub(crate) fn restore(&mut self, edits: &[Arc<Edit>], scratch: &mut Scratch) {
        let Some(base) = &self.base else { return };
        self.factor = base.clone();
        for edit in edits {
            let again = self.factor.apply(edit, scratch);
            debug_assert!(again.is_ok(), "the same edits went well before");
        }
    }

    /// The factor after `edits`; none if one of them fails.
    pub(crate) fn replay(mut self, edits: impl IntoIterator<Item = Arc<Edit>>) -> Option<Self> {
        let mut scratch = Scratch::default();
        for edit in edits {
            self.apply(&edit, &mut scratch).ok()?;
        }
        Some(self)
    }
}

/// A factor with a fresh order, being made. The result does not depend on which thread does the
/// work, or when.
pub(crate) enum Rebase {
    /// A thread makes the factor and follows the edits that are sent to it.
    Thread { edits: Sender<Arc<Edit>>, made: Receiver<Option<Based>> },
    /// All work is done at the end.
    Later { pattern: Arc<Pattern>, edits: Vec<Arc<Edit>> },
}

impl Rebase {
    /// Starts from a snapshot. If no thread is wanted, or none can be started, the work is done at
    /// the end. The thread also frees the old factor, which takes time too.
    ///
    /// It is a pool of its own: products of matrices that it shared with the pool of whoever waits for it in
    /// [`finish`](Self::finish) would wait for that one.
    pub(crate) fn start(pattern: Pattern, background: bool, old: Option<Based>) -> Self {
        let pattern = Arc::new(pattern);
        if background {
            let (edits, received) = channel();
            let snapshot = Arc::clone(&pattern);
            let (make, made) = channel();
            let pool = ThreadPoolBuilder::new().num_threads(1);
            let pool = pool.thread_name(|_| "yawara-rebase".to_owned());
            // Who waits for it sees that it is gone.
            let pool = pool.panic_handler(|_| {});
            #[cfg(test)]
            let slow = SLOW_MS.with(std::cell::Cell::get);
            let work = move || {
                drop(old);
                #[cfg(test)]
                std::thread::sleep(std::time::Duration::from_millis(slow));
                let based = Based::new(&snapshot).ok().and_then(|based| based.replay(received));
                // Nobody may want it any more.
                let _ = make.send(based);
            };
            if let Ok(pool) = pool.build() {
                pool.spawn(work);
                return Self::Thread { edits, made };
            }
        }
        Self::Later { pattern, edits: Vec::new() }
    }

    /// An edit that the snapshot does not have yet.
    pub(crate) fn push(&mut self, edit: &Arc<Edit>) {
        match self {
            // If the worker is gone, `finish` says so.
            Self::Thread { edits, .. } => _ = edits.send(Arc::clone(edit)),
            Self::Later { edits, .. } => edits.push(Arc::clone(edit)),
        }
    }

    /// Waits for the work; none if the matrix or an edit can't be factored.
    pub(crate) fn finish(self) -> Option<Based> {
        match self {
            Self::Thread { edits, made } => {
                drop(edits);
                made.recv().ok().flatten()
            }
            Self::Later { pattern, edits } => Based::new(&pattern).ok()?.replay(edits),
        }
    }
}

#[cfg(test)]
thread_local! {
    /// How long the workers that this thread starts sleep first.
    static SLOW_MS: std::cell::Cell<u64> = const { std::cell::Cell::new(0) };
}

/// Lets them sleep so long from now on.
#[cfg(test)]
pub(crate) fn slow_rebases(ms: u64) {
    SLOW_MS.with(|slow| slow.set(ms));
}
