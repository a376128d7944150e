//! Processes that mpirun has started together, and how they share one study.
//!
//! The first of them (rank 0) opens the folder and makes what all need before the others look for
//! it, gives out the cases, and writes the tables; it runs cases like all others. Whoever is free
//! gets the next case. What is found goes through the folder; messages carry numbers of cases alone,
//! so that an end at any moment loses no finished case.
//!
//! MPI is started once a process has more than itself to talk to, and ends with the last case: a
//! process shares one study.

#[cfg(not(feature = "mpi"))]
mod absent;
#[cfg(any(feature = "mpi", test))]
mod hand_out;
#[cfg(feature = "mpi")]
mod messenger;

use std::sync::OnceLock;

use crate::error::{BenchError, Result};
#[cfg(not(feature = "mpi"))]
use absent::Messenger;
#[cfg(feature = "mpi")]
use messenger::Messenger;

/// Where a launcher says how many processes it has started: Open MPI's, and those that speak PMI.
const SIZES: [&str; 2] = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE"];

/// This process's end of the line: MPI starts once in a process.
static MESSENGER: OnceLock<Messenger> = OnceLock::new();

/// How many processes the launcher of this one has started, this one included; 1 without one.
pub fn started() -> usize {
    let number = |name| std::env::var(name).ok()?.parse().ok();
    SIZES.into_iter().find_map(number).unwrap_or(1)
}

/// Refuses several processes that would all do the same: where the study does not share its cases,
/// and where this program has no MPI to share them by.
/// # Errors
/// [`BenchError::OneProcess`]; [`BenchError::NoMpi`] without the feature `mpi`.
pub fn check(shares_cases: bool) -> Result<()> {
    match started() {
        0 | 1 => Ok(()),
        processes if !shares_cases => Err(BenchError::OneProcess(processes)),
        processes if cfg!(not(feature = "mpi")) => Err(BenchError::NoMpi(processes)),
        _ => Ok(()),
    }
}

/// The number of this process, from 0, once it shares a study with others.
pub fn rank() -> Option<usize> {
    MESSENGER.get().map(Messenger::rank)
}

/// Ends all processes that share a study with this one, which then exit with `code`; does nothing
/// where there are none, or none any more. To be called once an error has been told.
pub fn abort(code: u8) {
    if let Some(messenger) = MESSENGER.get() {
        messenger.abort(code);
    }
}

/// Ends what a study has started under mpirun beside the cases that are shared: PETSc, where it runs.
/// # Errors
/// `BenchError::Petsc`.
pub fn finish() -> Result<()> {
    #[cfg(feature = "petsc")]
    yawara_petsc::Petsc::finish()?;
    Ok(())
}

/// Whether this process is the one that speaks for all.
pub(crate) fn is_first() -> bool {
    rank().is_none_or(|rank| rank == 0)
}

/// Does `work` in the first process, and once that is done in all others; `work` is told whether
/// it is in the first.
pub(crate) fn in_turn<T>(work: impl FnOnce(bool) -> Result<T>) -> Result<T> {
    let Some(messenger) = messenger()? else { return work(true) };
    if messenger.rank() == 0 {
        let done = work(true)?;
        messenger.announce()?;
        return Ok(done);
    }
    messenger.wait_for_first()?;
    work(false)
}

/// The cases that this process is to run, one by one.
pub(crate) enum Turns {
    /// All of them.
    Alone(std::vec::IntoIter<usize>),
    /// Those that the first process gives to this one.
    Shared(&'static Messenger),
}

/// Gives out the cases `waiting`, in order; what others than the first process give is not asked for.
pub(crate) fn give_out(waiting: Vec<usize>) -> Result<Turns> {
    let Some(messenger) = messenger()? else { return Ok(Turns::Alone(waiting.into_iter())) };
    if messenger.rank() == 0 {
        messenger.give_out(waiting)?;
    }
    Ok(Turns::Shared(messenger))
}

impl Turns {
    /// The next case, to be asked for when the one before is kept; `None` when all cases of all
    /// processes are.
    pub fn next_case(&mut self) -> Result<Option<usize>> {
        match self {
            Self::Alone(waiting) => Ok(waiting.next()),
            Self::Shared(messenger) => messenger.ask(),
        }
    }
}

/// The line to the other processes, set up at the first call; `None` without others.
fn messenger() -> Result<Option<&'static Messenger>> {
    let processes = started();
    if processes < 2 {
        return Ok(None);
    }
    if MESSENGER.get().is_none() {
        // Of two threads that come here at once MPI refuses one.
        let _ = MESSENGER.set(Messenger::join(processes)?);
    }
    Ok(MESSENGER.get())
}
