//! The elements of a body, eight to a packet, as the vector kernels read them.

use super::simd::{LANES, Row, Rows, set_matrix};
use crate::element::Element;

/// Eight elements, a number of each side by side.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Packet {
    /// Vertex numbers by corner.
    pub vertices: [[u32; LANES]; 4],
    /// ∇λ of corners 1 to 3; that of corner 0 is minus their sum.
    pub gradients: Rows,
    pub volume: Row,
    /// The lower half of D by rows.
    pub elasticity: [Row; 21],
    pub rotation: Rows,
}

/// Packets without a gap: element i is lane i % 8 of packet i / 8. Lanes behind the last element
/// repeat one of the same packet.
#[derive(Clone, Debug, Default)]
pub(crate) struct Packets {
    pub packets: Vec<Packet>,
    pub count: usize,
}

impl Packets {
    /// Appends an element. Cost: O(1).
    pub fn push(&mut self, element: &Element) {
        let (packet, lane) = (self.count / LANES, self.count % LANES);
        self.count += 1;
        if lane > 0 {
            return self.packets[packet].set(lane, element);
        }
        let mut new = Packet::default();
        (0..LANES).for_each(|lane| new.set(lane, element));
        self.packets.push(new);
    }

    /// The last element takes the place of element `at`. Cost: O(1).
    ///
    /// `moved` is that last element, unless it is the one that goes.
    pub fn swap_remove(&mut self, at: usize, moved: Option<&Element>) {
        self.count -= 1;
        let (packet, lane) = (self.count / LANES, self.count % LANES);
        if let Some(moved) = moved {
            self.packets[at / LANES].set(at % LANES, moved);
        }
        if lane == 0 {
            self.packets.pop();
        } else {
            self.packets[packet].copy_lane(0, lane);
        }
    }
}

impl Packet {
    fn set(&mut self, lane: usize, element: &Element) {
        for (row, &v) in self.vertices.iter_mut().zip(&element.vertices) {
            row[lane] = v as u32;
        }
        for (rows, gradient) in self.gradients.iter_mut().zip(&element.geometry.gradients[1..]) {
            (0..3).for_each(|axis| rows[axis][lane] = gradient[axis]);
        }
        self.volume[lane] = element.geometry.volume;
        let lower = (0..6).flat_map(|i| (0..=i).map(move |j| (i, j)));
        for (row, (i, j)) in self.elasticity.iter_mut().zip(lower) {
            row[lane] = 0.5 * (element.elasticity[(i, j)] + element.elasticity[(j, i)]);
        }
        set_matrix(&mut self.rotation, lane, &element.rotation);
    }

    fn copy_lane(&mut self, from: usize, to: usize) {
        self.vertices.iter_mut().for_each(|row| row[to] = row[from]);
        self.gradients.as_flattened_mut().iter_mut().for_each(|row| row[to] = row[from]);
        self.volume[to] = self.volume[from];
        self.elasticity.iter_mut().for_each(|row| row[to] = row[from]);
        self.rotation.as_flattened_mut().iter_mut().for_each(|row| row[to] = row[from]);
    }
}
