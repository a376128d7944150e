//! MPI in a thread of its own: the first process answers others while it runs a case itself.
//!
//! Nothing waits within MPI but its start and its end, where all come at once: a wait there takes a
//! whole core. What ends early is left unfinished, so that the launcher ends the others too.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use mpi::Threading;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, Destination, Source};

use super::hand_out::HandOut;
use crate::error::{BenchError, Result};

/// Between two looks for messages; a case takes much longer.
const PAUSE: Duration = Duration::from_millis(10);

/// A process is free.
const ASK: i32 = 1;

/// The number of a case, or [`NONE`].
const CASE: i32 = 2;

/// The first process has done what the others wait for.
const ANNOUNCED: i32 = 3;

/// No case is left.
const NONE: i64 = -1;

/// What a process asks of its thread.
enum Order {
    Announce,
    GiveOut(Vec<usize>),
    Ask,
    Abort(u8),
}

/// What the thread says.
enum Reply {
    Joined { rank: usize, size: usize },
    Announced,
    Case(Option<usize>),
}

/// The line of a process to its thread.
pub(crate) struct Messenger {
    rank: usize,
    orders: Sender<Order>,
    replies: Mutex<Receiver<Reply>>,
}

impl Messenger {
    /// Starts MPI, which is to find as many processes as the launcher says.
    pub fn join(processes: usize) -> Result<Self> {
        let (orders, taken) = channel();
        let (said, replies) = channel();
        std::thread::spawn(move || serve(&taken, said));
        match replies.recv() {
            Ok(Reply::Joined { rank, size }) if size == processes => {
                Ok(Self { rank, orders, replies: Mutex::new(replies) })
            }
            Ok(Reply::Joined { size, .. }) => Err(BenchError::OtherMpi(processes, size)),
            _ => Err(BenchError::MpiOver),
        }
    }

    /// Number of this process, from 0.
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Lets all others pass [`Self::wait_for_first`] once.
    pub fn announce(&self) -> Result<()> {
        self.order(Order::Announce)
    }

    /// Waits until the first process announces something.
    pub fn wait_for_first(&self) -> Result<()> {
        match self.reply()? {
            Reply::Announced => Ok(()),
            _ => Err(BenchError::OutOfStep),
        }
    }

    /// Starts giving out these cases; for the first process.
    pub fn give_out(&self, waiting: Vec<usize>) -> Result<()> {
        self.order(Order::GiveOut(waiting))
    }

    /// The next case of this process; `None` when all are finished, and MPI with them.
    pub fn ask(&self) -> Result<Option<usize>> {
        self.order(Order::Ask)?;
        match self.reply()? {
            Reply::Case(case) => Ok(case),
            _ => Err(BenchError::OutOfStep),
        }
    }

    /// Ends all processes, this one too; returns only if MPI is over.
    pub fn abort(&self, code: u8) {
        if self.order(Order::Abort(code)).is_ok() {
            // Whatever else was on its way.
            while self.reply().is_ok() {}
        }
    }

    fn order(&self, order: Order) -> Result<()> {
        self.orders.send(order).map_err(|_| BenchError::MpiOver)
    }

    fn reply(&self) -> Result<Reply> {
        let replies = self.replies.lock().unwrap_or_else(PoisonError::into_inner);
        replies.recv().map_err(|_| BenchError::MpiOver)
    }
}

/// The thread: all of MPI, from its start to its end.
fn serve(orders: &Receiver<Order>, replies: Sender<Reply>) {
    let start = mpi::initialize_with_threading(Threading::Funneled);
    let Some((universe, _)) = start else { return };
    let world = universe.world();
    let (rank, size) = (world.rank() as usize, world.size() as usize);
    let hand_out = (rank == 0).then(|| HandOut::new(size));
    // After the universe, and so dropped before it: a process whose thread has failed knows at once.
    let mut post = Post { world, hand_out, replies };
    post.reply(Reply::Joined { rank, size });
    if post.run(orders) {
        let replies = post.replies;
        drop(universe);
        // Only now may the process end.
        let _ = replies.send(Reply::Case(None));
    } else {
        // The end waits for all others, and these for what this process will not do.
        std::mem::forget(universe);
    }
}

struct Post {
    world: SimpleCommunicator,
    /// Of the first process.
    hand_out: Option<HandOut>,
    replies: Sender<Reply>,
}

impl Post {
    /// Carries messages until no case is left; false if the process has gone before.
    fn run(&mut self, orders: &Receiver<Order>) -> bool {
        loop {
            match orders.recv_timeout(PAUSE) {
                Ok(order) => self.obey(order),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return false,
            }
            if self.receive() || self.answer() {
                return true;
            }
        }
    }

    fn obey(&mut self, order: Order) {
        match (order, &mut self.hand_out) {
            (Order::Announce, _) => {
                (1..self.world.size()).for_each(|rank| self.send(rank, ANNOUNCED, 0));
            }
            (Order::GiveOut(waiting), Some(hand_out)) => hand_out.begin(waiting),
            (Order::GiveOut(_), None) => {}
            (Order::Ask, Some(hand_out)) => hand_out.ask(0),
            (Order::Ask, None) => self.send(0, ASK, 0),
            (Order::Abort(code), _) => self.world.abort(code.into()),
        }
    }

    /// Takes all messages that are there; whether one says that no case is left.
    fn receive(&mut self) -> bool {
        while let Some(status) = self.world.any_process().immediate_probe() {
            let source = self.world.process_at_rank(status.source_rank());
            let (value, _) = source.receive_with_tag::<i64>(status.tag());
            match (status.tag(), &mut self.hand_out) {
                (ASK, Some(hand_out)) => hand_out.ask(status.source_rank() as usize),
                (ANNOUNCED, _) => self.reply(Reply::Announced),
                (CASE, _) if value == NONE => return true,
                (CASE, _) => self.reply(Reply::Case(Some(value as usize))),
                // Nobody sends anything else.
                _ => {}
            }
        }
        false
    }

    /// Gives out what can be given; whether that was the end.
    fn answer(&mut self) -> bool {
        let Some(hand_out) = &mut self.hand_out else { return false };
        let mut over = false;
        for (rank, case) in hand_out.answers() {
            match (rank, case) {
                (0, Some(case)) => self.reply(Reply::Case(Some(case))),
                (0, None) => over = true,
                (_, case) => self.send(rank as i32, CASE, case.map_or(NONE, |case| case as i64)),
            }
        }
        over
    }

    fn send(&self, rank: i32, tag: i32, value: i64) {
        self.world.process_at_rank(rank).send_with_tag(&value, tag);
    }

    fn reply(&self, reply: Reply) {
        // A process that does not listen any more is about to end.
        let _ = self.replies.send(reply);
    }
}
