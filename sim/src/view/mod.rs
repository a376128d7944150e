//! `yawara view`: a page in the browser that shows a simulation and has hands on it, or plays a run that is over.
//!
//! [`serve`] in `server` is where to start: it answers on loopback, and every page has a WebSocket.
//! `session` is the thread that makes steps, paced by the clock, of one simulation or of two beside each other (`side`);
//! a `hand` couples a pointer to a tool. What is seen
//! goes to the `painter`, a thread that carries the outlines along, and from there as a `picture` to every page, as
//! fast as that page takes them: what is overtaken is dropped, nothing queues. `protocol` has what a page may say,
//! `state` what it is told besides pictures, `voxels` what it shows on a cut, `access` who is let in, `recording` what is kept of a hand. Of a
//! run that is over the `player` has the place of the session, and `alone` writes the page with a run in it.
//! The page itself is in `page/`.

mod access;
mod alone;
mod hand;
mod inbox;
mod page_files;
mod painter;
mod picture;
mod player;
mod protocol;
mod recording;
mod server;
mod session;
mod side;
mod state;
mod voxels;

pub use alone::write_html;
pub use server::{Listening, ViewOptions, serve};
