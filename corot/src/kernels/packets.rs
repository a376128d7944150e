//! The elements of a body, eight to a packet, as the vector kernels read them.

use nalgebra::Matrix3;

use super::simd::{LANES, Row, Rows, matrix, set_matrix};
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
    /// At the last evaluation of forces.
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
    pub fn push(&mut self, element: &Element, rotation: &Matrix3<f64>) {
        let (packet, lane) = (self.count / LANES, self.count % LANES);
        self.count += 1;
        if lane > 0 {
            return self.packets[packet].set(lane, element, rotation);
        }
        let mut new = Packet::default();
        (0..LANES).for_each(|lane| new.set(lane, element, rotation));
        self.packets.push(new);
    }

    /// The last element takes the place of element `at`. Cost: O(1).
    pub fn swap_remove(&mut self, at: usize) {
        self.count -= 1;
        let (packet, lane) = (self.count / LANES, self.count % LANES);
        let last = self.packets[packet];
        self.packets[at / LANES].copy_lane(at % LANES, &last, lane);
        if lane == 0 {
            self.packets.pop();
        } else {
            let first = self.packets[packet];
            self.packets[packet].copy_lane(lane, &first, 0);
        }
    }
}

/// The rotation of an element among packets.
#[inline(always)]
pub(crate) fn rotation_of(packets: &[Packet], number: usize) -> Matrix3<f64> {
    matrix(&packets[number / LANES].rotation, number % LANES)
}

/// Elements, each with its rotation in their packets.
pub(crate) fn with_rotations<'a>(
    elements: &'a [Element],
    packets: &'a [Packet],
) -> impl Iterator<Item = (&'a Element, Matrix3<f64>)> {
    elements.iter().enumerate().map(|(number, element)| (element, rotation_of(packets, number)))
}

impl Packet {
    fn set(&mut self, lane: usize, element: &Element, rotation: &Matrix3<f64>) {
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
        set_matrix(&mut self.rotation, lane, rotation);
    }

    fn copy_lane(&mut self, to: usize, other: &Self, from: usize) {
        let vertices = self.vertices.iter_mut().zip(&other.vertices);
        vertices.for_each(|(row, other)| row[to] = other[from]);
        let gradients = self.gradients.as_flattened_mut().iter_mut();
        let rotation = self.rotation.as_flattened_mut().iter_mut();
        let rows = gradients.zip(other.gradients.as_flattened());
        let rows = rows.chain(rotation.zip(other.rotation.as_flattened()));
        let rows = rows.chain(self.elasticity.iter_mut().zip(&other.elasticity));
        rows.for_each(|(row, other)| row[to] = other[from]);
        self.volume[to] = other.volume[from];
    }
}
