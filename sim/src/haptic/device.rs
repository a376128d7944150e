//! What is in the hand.

use nalgebra::Vector3;

/// A device: it says where the hand is and lets it feel a force, each once a tick.
///
/// A function of the time is one that feels nothing.
pub trait Device: Send {
    /// Where the hand has the tool at a time, s: moved from its place in the scene, scanner axes, m. It must
    /// not wait.
    fn position(&mut self, seconds: f64) -> [f64; 3];

    /// What the hand feels at that tick.
    fn feel(&mut self, _felt: &Felt) {}
}

/// What a hand feels, scanner axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Felt {
    /// Force on the hand, N.
    pub force_n: Vector3<f64>,
    /// Where the tool is, as [`Device::position`] has it, m.
    pub tool_m: Vector3<f64>,
}

impl<F: FnMut(f64) -> [f64; 3] + Send> Device for F {
    fn position(&mut self, seconds: f64) -> [f64; 3] {
        self(seconds)
    }
}
