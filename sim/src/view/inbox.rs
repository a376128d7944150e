//! What pages ask for on its way to the thread that works, and what they are told.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use nalgebra::Vector3;
use serde_json::json;
use tokio::sync::{broadcast, watch};

use super::protocol::Request;

/// The most requests that wait; what is more is refused.
const MOST_WAITING: usize = 64;

/// How long a thread that has nothing to do sleeps until it looks again.
const NAP: Duration = Duration::from_millis(200);

/// For one page, or for all.
pub(super) type Notice = (Option<u64>, Arc<str>);

/// Requests on their way to the session; bounded.
#[derive(Default)]
pub(super) struct Inbox {
    waiting: Mutex<Waiting>,
    changed: Condvar,
}

#[derive(Default)]
struct Waiting {
    requests: VecDeque<(u64, Request)>,
    /// The last move of each hand that has not been made.
    moves: BTreeMap<(u64, u8), (Vector3<f64>, u32)>,
    left: Vec<u64>,
    pages: usize,
    wants_picture: bool,
    ended: bool,
}

/// What has come since it was asked last.
pub(super) struct News {
    pub requests: VecDeque<(u64, Request)>,
    /// The last move of each hand.
    pub moves: BTreeMap<(u64, u8), (Vector3<f64>, u32)>,
    /// Pages that have gone.
    pub left: Vec<u64>,
    pub has_page: bool,
    /// Whether a page is new.
    pub wants_picture: bool,
    pub ended: bool,
}

impl Inbox {
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a request of a page.
    ///
    /// # Errors
    /// In words, if too many wait.
    pub fn send(&self, page: u64, request: Request) -> Result<(), String> {
        let mut waiting = self.lock();
        match request {
            Request::Move { hand, move_mm, stamp } => {
                waiting.moves.insert((page, hand), (Vector3::from(move_mm) * 1e-3, stamp));
            }
            _ if waiting.requests.len() >= MOST_WAITING => {
                return Err(format!("busy: {MOST_WAITING} requests wait already"));
            }
            request => waiting.requests.push_back((page, request)),
        }
        self.changed.notify_one();
        Ok(())
    }

    pub fn enter(&self) {
        let mut waiting = self.lock();
        waiting.pages += 1;
        waiting.wants_picture = true;
        self.changed.notify_one();
    }

    pub fn leave(&self, page: u64) {
        let mut waiting = self.lock();
        waiting.pages -= 1;
        waiting.left.push(page);
        waiting.moves.retain(|(of, _), _| *of != page);
        self.changed.notify_one();
    }

    /// Empties it.
    pub fn take(&self) -> News {
        let mut waiting = self.lock();
        News {
            requests: std::mem::take(&mut waiting.requests),
            moves: std::mem::take(&mut waiting.moves),
            left: std::mem::take(&mut waiting.left),
            has_page: waiting.pages > 0,
            wants_picture: std::mem::take(&mut waiting.wants_picture),
            ended: waiting.ended,
        }
    }

    /// Sleeps until something comes, or for a while.
    pub fn nap(&self) {
        let waiting = self.lock();
        let is_news = !waiting.requests.is_empty()
            || !waiting.moves.is_empty()
            || !waiting.left.is_empty()
            || waiting.wants_picture
            || waiting.ended;
        if !is_news {
            drop(self.changed.wait_timeout(waiting, NAP));
        }
    }

    pub fn end(&self) {
        self.lock().ended = true;
        self.changed.notify_one();
    }
}

/// What all pages are told.
pub(super) struct Voices {
    pub state: watch::Sender<Arc<str>>,
    pub notices: broadcast::Sender<Notice>,
}

impl Voices {
    pub fn say(&self, page: Option<u64>, level: &str, text: &str) {
        let notice = json!({ "kind": "notice", "level": level, "text": text }).to_string();
        // Without a page nobody listens.
        let _ = self.notices.send((page, notice.into()));
    }
}
