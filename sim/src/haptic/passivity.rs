//! A force that never gives a hand more energy than the hand has put in.

use nalgebra::Vector3;
use serde::Serialize;

/// Observes the energy W that a hand has put into a tool and all that is behind it,
///
/// W ← W + f·Δx at every tick,
///
/// f the force that the hand exerts and Δx how far the device has moved since the last tick; and, where W
/// would fall below zero, has the device brake as a damper does: f ← f − (W + f·Δx) Δx/|Δx|², so that W
/// is zero. Forces never grow by that: what is taken from f lies along Δx and is smaller than its part there.
///
/// Whatever is behind the tool (a body whose mesh splits and merges, contacts that begin and end, forces
/// that are late) then takes part as a body that can only store energy or lose it. What it has lost
/// counts as put in: energy that comes from nowhere passes up to that amount. What the device holds
/// a force for until the next tick is for its own damping to take
/// ([`VirtualCoupling::damping_limit`](super::VirtualCoupling::damping_limit)).
/// # Source
/// Hannaford, Ryu, Time-domain passivity control of haptic interfaces, IEEE Trans. Robotics and
/// Automation 18(1), 2002: its observer, and its controller of an impedance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Passivity {
    controls: bool,
    energy: f64,
    seen: PassivitySummary,
}

/// What a [`Passivity`] has seen and done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PassivitySummary {
    /// Ticks in which it made the device brake.
    pub controlled_ticks: usize,
    /// The least energy W that was observed, J; 0 at the start.
    pub least_energy_j: f64,
}

impl Passivity {
    /// Before the first tick. One that does not control only observes.
    pub fn new(controls: bool) -> Self {
        Self { controls, ..Self::default() }
    }

    /// The force that the hand is to exert, N, in a tick in which the device has moved by `motion`, m,
    /// and it would be `force`. What is not finite becomes no force. Cost: O(1).
    pub fn tick(&mut self, motion: &Vector3<f64>, force: &Vector3<f64>) -> Vector3<f64> {
        let flow = force.dot(motion);
        if !flow.is_finite() {
            return Vector3::zeros();
        }
        let mut force = *force;
        let lack = self.energy + flow;
        let square = motion.norm_squared();
        // Of a motion whose square is nothing the energy is too.
        if self.controls && lack < 0.0 && square >= f64::MIN_POSITIVE {
            force -= motion * (lack / square);
            self.seen.controlled_ticks += 1;
        }
        self.energy += force.dot(motion);
        self.seen.least_energy_j = self.seen.least_energy_j.min(self.energy);
        force
    }

    /// W, J.
    pub fn energy_j(&self) -> f64 {
        self.energy
    }

    /// What it has seen and done so far.
    pub fn summary(&self) -> PassivitySummary {
        self.seen
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sequence of numbers in [0, 1) that looks random (splitmix64).
    struct Draws(u64);

    impl Draws {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = self.0;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            (z ^ (z >> 31)) as f64 / 2f64.powi(64)
        }

        fn vector(&mut self) -> Vector3<f64> {
            Vector3::from_fn(|_, _| 2.0 * self.next() - 1.0)
        }
    }

    /// A spring that is another every few ticks, as if a mesh changed under the tool at will. Returns what
    /// was seen, the energy summed anew with its rounding, J, and by how much forces grew at most.
    fn jumping_spring(controls: bool) -> (Passivity, f64, f64) {
        let (mut draws, mut passivity) = (Draws(7), Passivity::new(controls));
        let (mut at, mut stiffness, mut rest) = (Vector3::zeros(), 100.0, Vector3::zeros());
        let (mut sum, mut least, mut growth) = (0.0, 0.0_f64, f64::NEG_INFINITY);
        for _ in 0..100_000 {
            if draws.next() < 0.01 {
                rest = 2e-3 * draws.vector();
            }
            let motion: Vector3<f64> = 1e-4 * draws.vector() - 0.01 * at;
            at += motion;
            // Mostly soft on the way out and stiff on the way back.
            let most = if motion.dot(&(at - rest)) > 0.0 { 200.0 } else { 2000.0 };
            if draws.next() < 0.5 {
                stiffness = most * draws.next();
            }
            let force = stiffness * (at - rest);
            let given = passivity.tick(&motion, &force);
            sum += given.dot(&motion);
            least = least.min(sum);
            growth = growth.max(given.norm() - force.norm());
        }
        (passivity, least, growth)
    }

    #[test]
    fn springs_that_jump_give_a_hand_nothing() {
        let (passivity, least, growth) = jumping_spring(true);
        let seen = passivity.summary();
        // A tick rounds W by ε times the largest of W and |f||Δx|, and makes up for the last one: W is
        // below 1 J, as is 2000 N/m · 0.02 m · 1e-3 m.
        assert!(
            least >= -1e5 * f64::EPSILON && seen.least_energy_j >= -4.0 * f64::EPSILON,
            "{seen:?}"
        );
        assert!(seen.controlled_ticks > 1000, "{seen:?}");
        assert!(growth <= 1e-12, "a force has grown by {growth} N");
    }

    #[test]
    fn without_control_they_do_and_that_is_seen() {
        let (passivity, least, _) = jumping_spring(false);
        let seen = passivity.summary();
        assert!(least < -1e-3 && seen.least_energy_j == least, "{least} {seen:?}");
        assert_eq!(seen.controlled_ticks, 0);
    }

    #[test]
    fn a_spring_is_left_alone() {
        let mut passivity = Passivity::new(true);
        let mut before = 0.0;
        for tick in 1..=2000 {
            let x = 5e-3 * (0.01 * f64::from(tick)).sin();
            let force = Vector3::new(800.0 * x, 0.0, 0.0);
            // Its force at the end of a motion: never less than what it stores.
            assert_eq!(passivity.tick(&Vector3::new(x - before, 0.0, 0.0), &force), force);
            before = x;
        }
        assert_eq!(passivity.summary().controlled_ticks, 0);
        assert!(passivity.energy_j() >= 400.0 * before * before);
    }

    #[test]
    fn what_is_not_finite_is_no_force() {
        let mut passivity = Passivity::new(true);
        for bad in [f64::NAN, f64::INFINITY] {
            let motion = Vector3::new(1e-3, 0.0, 0.0);
            assert_eq!(passivity.tick(&motion, &Vector3::new(bad, 0.0, 0.0)), Vector3::zeros());
        }
        let tiny = Vector3::new(1e-200, 0.0, 0.0);
        let force = Vector3::new(-1.0, 0.0, 0.0);
        assert_eq!(passivity.tick(&tiny, &force), force);
        assert!(passivity.energy_j().is_finite());
    }
}
