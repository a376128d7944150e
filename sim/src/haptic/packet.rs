//! The packets of a device that is reached by UDP, version 1. All numbers are little-endian.

/// The version that is spoken here.
pub const PROTOCOL_VERSION: u16 = 1;

/// What every packet begins with.
const MAGIC: [u8; 4] = *b"YWHP";

/// Bytes before what a packet is about: magic, version, kind.
const HEADER: usize = 8;

const POSE: u16 = 1;
const FORCE: u16 = 2;
const OTHER_VERSION: u16 = 3;

/// Where the device is: 40 bytes, from the device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosePacket {
    /// Grows from packet to packet; what does not is old and counts for nothing.
    pub sequence: u64,
    /// The device's own place, scanner axes, m.
    pub position_m: [f64; 3],
}

/// What the hand is to feel: 72 bytes, to the device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForcePacket {
    /// Grows by one from packet to packet.
    pub sequence: u64,
    /// The sequence number of the last pose that it follows from.
    pub answers: u64,
    /// Force on the hand, scanner axes, N.
    pub force_n: [f64; 3],
    /// Where the tool is, from its start, scanner axes, m.
    pub tool_m: [f64; 3],
}

/// Why a packet is not one of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadPacket {
    /// Neither begins as one nor has the size of one, or has numbers that no device has.
    Foreign,
    /// It speaks another version.
    Version(u16),
}

fn header(kind: u16) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend(PROTOCOL_VERSION.to_le_bytes());
    bytes.extend(kind.to_le_bytes());
    bytes
}

/// The bytes after the header of a packet of this kind and size.
fn body<const N: usize>(bytes: &[u8], kind: u16) -> Result<&[u8; N], BadPacket> {
    let Some((head, body)) = bytes.split_at_checked(HEADER) else { return Err(BadPacket::Foreign) };
    let word = |at: usize| u16::from_le_bytes([head[at], head[at + 1]]);
    if head[..4] != MAGIC {
        return Err(BadPacket::Foreign);
    }
    if word(4) != PROTOCOL_VERSION {
        return Err(BadPacket::Version(word(4)));
    }
    let body = body.try_into().map_err(|_| BadPacket::Foreign)?;
    if word(6) == kind { Ok(body) } else { Err(BadPacket::Foreign) }
}

fn word(body: &[u8], at: usize) -> [u8; 8] {
    std::array::from_fn(|i| body[8 * at + i])
}

fn vector(body: &[u8], first: usize) -> [f64; 3] {
    [0, 1, 2].map(|axis| f64::from_le_bytes(word(body, first + axis)))
}

impl PosePacket {
    /// The farthest that a device's place may be from its origin, m.
    pub const FARTHEST_M: f64 = 10.0;

    /// As it is sent.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = header(POSE);
        bytes.extend(self.sequence.to_le_bytes());
        bytes.extend(self.position_m.into_iter().flat_map(f64::to_le_bytes));
        bytes
    }

    /// Reads one.
    /// # Errors
    /// [`BadPacket`], also for a place that is not finite or farther than
    /// [`FARTHEST_M`](Self::FARTHEST_M).
    pub fn read(bytes: &[u8]) -> Result<Self, BadPacket> {
        let body = body::<32>(bytes, POSE)?;
        let position_m = vector(body, 1);
        let is_near = |x: &f64| x.abs() <= Self::FARTHEST_M;
        match position_m.iter().all(is_near) {
            true => Ok(Self { sequence: u64::from_le_bytes(word(body, 0)), position_m }),
            false => Err(BadPacket::Foreign),
        }
    }
}

impl ForcePacket {
    /// As it is sent.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = header(FORCE);
        bytes.extend(self.sequence.to_le_bytes());
        bytes.extend(self.answers.to_le_bytes());
        bytes.extend(self.force_n.into_iter().chain(self.tool_m).flat_map(f64::to_le_bytes));
        bytes
    }

    /// Reads one.
    /// # Errors
    /// [`BadPacket`].
    pub fn read(bytes: &[u8]) -> Result<Self, BadPacket> {
        let body = body::<64>(bytes, FORCE)?;
        let [sequence, answers] = [0, 1].map(|at| u64::from_le_bytes(word(body, at)));
        Ok(Self { sequence, answers, force_n: vector(body, 2), tool_m: vector(body, 5) })
    }
}

/// The answer to a packet of another version: a header, which names the one spoken here.
pub(super) fn other_version() -> Vec<u8> {
    header(OTHER_VERSION)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packets_are_read_as_they_were_sent_and_nothing_else_is() {
        let pose = PosePacket { sequence: 7, position_m: [0.1, -0.2, 1e-9] };
        let force = ForcePacket {
            sequence: u64::MAX,
            answers: 7,
            force_n: [1.5, 0.0, -2.0],
            tool_m: [0.0, 3.0, 4.0],
        };
        assert_eq!(PosePacket::read(&pose.to_bytes()), Ok(pose));
        assert_eq!(ForcePacket::read(&force.to_bytes()), Ok(force));
        assert_eq!((pose.to_bytes().len(), force.to_bytes().len()), (40, 72));
        let good = pose.to_bytes();
        for size in 0..good.len() {
            assert_eq!(PosePacket::read(&good[..size]), Err(BadPacket::Foreign));
        }
        let with = |at: usize, value: &[u8]| {
            let mut bytes = good.clone();
            bytes[at..at + value.len()].copy_from_slice(value);
            PosePacket::read(&bytes)
        };
        assert_eq!(with(0, b"X"), Err(BadPacket::Foreign));
        assert_eq!(with(4, &[2, 0]), Err(BadPacket::Version(2)));
        assert_eq!(with(6, &[2, 0]), Err(BadPacket::Foreign));
        for place in [f64::NAN, f64::INFINITY, -10.1] {
            assert_eq!(with(24, &place.to_le_bytes()), Err(BadPacket::Foreign));
        }
        assert_eq!(PosePacket::read(&force.to_bytes()), Err(BadPacket::Foreign));
        assert_eq!(PosePacket::read(&[&good[..], &[0]].concat()), Err(BadPacket::Foreign));
    }
}
