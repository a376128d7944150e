//! A device in another program, reached by UDP.

use std::net::{SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

use nalgebra::Vector3;
use serde::Serialize;

use super::device::{Device, Felt};
use super::packet::{BadPacket, ForcePacket, PosePacket, other_version};
use crate::error::SimError;

/// A program that has said nothing for so long has let go: another may take the tool then.
const SILENCE: Duration = Duration::from_millis(500);

/// A hand does not go farther from one packet to the next, m: the device was put elsewhere.
const LEAP_M: f64 = 0.05;

/// Packets that are read in one tick, at most: a flood keeps no loop from its time.
const PACKETS_A_TICK: usize = 64;

/// Longer than any packet.
const LONGEST: usize = 128;

/// The hand of another program: it sends [`PosePacket`]s and gets a [`ForcePacket`] each tick.
///
/// The first program heard has the tool, until it is silent for half a second; what others send
/// counts for nothing. The tool stands still without one, and where the device is when a program begins, or
/// after a leap of more than 5 cm, is where the tool is then: it never jumps.
#[derive(Debug)]
pub struct UdpDevice {
    socket: UdpSocket,
    /// The largest force that is sent, N.
    most_force_n: f64,
    hand: Option<Hand>,
    /// Where the tool is at the start, as [`Device::position`] has it, m.
    start: Vector3<f64>,
    /// How far from there it is asked to be, m.
    moved: Vector3<f64>,
    sent: u64,
    summary: UdpSummary,
}

/// The program that has the tool.
#[derive(Clone, Copy, Debug)]
struct Hand {
    address: SocketAddr,
    sequence: u64,
    position: Vector3<f64>,
    heard: Instant,
}

/// What came in and went out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct UdpSummary {
    /// Programs that had the tool, one after the other.
    pub hands: usize,
    /// Poses that it followed.
    pub poses: usize,
    /// Poses that came after a later one.
    pub old: usize,
    /// Times that the device was suddenly elsewhere.
    pub leaps: usize,
    /// Packets of programs that did not have the tool.
    pub of_others: usize,
    /// Packets that are no pose of this version.
    pub refused: usize,
    /// Forces sent.
    pub forces: usize,
    /// Forces sent that were cut to the largest allowed.
    pub cut: usize,
}

impl UdpDevice {
    /// Listens at `address`; port 0 is any that is free. The tool begins at `start_m`
    /// ([`Simulation::tool_pose`](crate::Simulation::tool_pose) at time 0), and no force larger than
    /// `most_force_n` is sent.
    /// # Errors
    /// [`SimError::Io`]; [`SimError::Value`] for a force out of 0 to 1000 N.
    pub fn listen(
        address: SocketAddr,
        start_m: [f64; 3],
        most_force_n: f64,
    ) -> Result<Self, SimError> {
        if !(0.0..=1e3).contains(&most_force_n) {
            let key = "most_force_n";
            return Err(SimError::value("haptic device", key, most_force_n, "0 to 1000"));
        }
        let bound = UdpSocket::bind(address);
        let ready = bound.and_then(|socket| socket.set_nonblocking(true).map(|()| socket));
        let socket = ready.map_err(|error| SimError::Io(format!("udp {address}").into(), error))?;
        Ok(Self {
            socket,
            most_force_n,
            hand: None,
            start: start_m.into(),
            moved: Vector3::zeros(),
            sent: 0,
            summary: UdpSummary::default(),
        })
    }

    /// Where it listens.
    /// # Errors
    /// [`SimError::Io`].
    pub fn address(&self) -> Result<SocketAddr, SimError> {
        self.socket.local_addr().map_err(|error| SimError::Io("udp".into(), error))
    }

    /// What has come in and gone out so far.
    pub fn summary(&self) -> UdpSummary {
        self.summary
    }

    fn take(&mut self, from: SocketAddr, pose: PosePacket) {
        let PosePacket { sequence, position_m } = pose;
        let position = Vector3::from(position_m);
        let now = Instant::now();
        match &mut self.hand {
            None => {
                self.hand = Some(Hand { address: from, sequence, position, heard: now });
                self.summary.hands += 1;
                self.summary.poses += 1;
            }
            Some(hand) if hand.address != from => self.summary.of_others += 1,
            Some(hand) if sequence <= hand.sequence => self.summary.old += 1,
            Some(hand) => {
                let step = position - hand.position;
                match step.norm() <= LEAP_M {
                    true => self.moved += step,
                    false => self.summary.leaps += 1,
                }
                *hand = Hand { address: from, sequence, position, heard: now };
                self.summary.poses += 1;
            }
        }
    }
}

impl Device for UdpDevice {
    fn position(&mut self, _: f64) -> [f64; 3] {
        self.hand.take_if(|hand| hand.heard.elapsed() > SILENCE);
        let mut bytes = [0; LONGEST];
        for _ in 0..PACKETS_A_TICK {
            // Nothing more has come, or an answer of before found nobody: all the same to this tick.
            let Ok((size, from)) = self.socket.recv_from(&mut bytes) else { break };
            match PosePacket::read(&bytes[..size]) {
                Ok(pose) => self.take(from, pose),
                Err(bad) => {
                    self.summary.refused += 1;
                    if let BadPacket::Version(_) = bad {
                        // Shorter than what it answers. Whether it arrives is the other's affair.
                        _ = self.socket.send_to(&other_version(), from);
                    }
                }
            }
        }
        (self.start + self.moved).into()
    }

    fn feel(&mut self, felt: &Felt) {
        let Some(hand) = &self.hand else { return };
        let size = felt.force_n.norm();
        let is_cut = size > self.most_force_n;
        let share = if is_cut { self.most_force_n / size } else { 1.0 };
        self.sent += 1;
        let packet = ForcePacket {
            sequence: self.sent,
            answers: hand.sequence,
            force_n: (felt.force_n * share).into(),
            tool_m: (felt.tool_m - self.start).into(),
        };
        if self.socket.send_to(&packet.to_bytes(), hand.address).is_ok() {
            self.summary.forces += 1;
            self.summary.cut += usize::from(is_cut);
        }
    }
}
