//! What differs by the features that the crate is built with: what it refuses without them, what it says of devices, and what
//! the front page promises. Small, since it is built with all features and with none.

mod bad_input;
mod devices;
mod gpu;
mod readme;
mod workbench;
