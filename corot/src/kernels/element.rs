//! Forces and rotated stiffness of co-rotated elements, a packet at a time.

use nalgebra::{Matrix3, Vector3};
use pulp::{Simd, WithSimd};

use super::accumulators::Accumulators;
use super::packets::Packet;
use super::polar::{axial, renew_rotations, turning};
use super::simd::{
    LANES, M3, Row, Rows, V, V3, dot, load3, load33, matrix, product, store33, transposed_product,
};
use crate::element::Element;
use crate::element::pressures::Pressures;
use crate::element::turning::LEAST;
use crate::field::Field;
use crate::law::PointPacket;
use crate::law::states::PacketRun;

/// R K Rᵀ of the eight elements of a packet: entry (i, j) of the 12×12 matrix of lane l is
/// `[12 i + j][l]`, N/m.
pub type StiffnessPacket = [[f64; LANES]; 144];

/// What a pass over a run of elements reads and writes.
pub(crate) struct Pass<'a> {
    /// Their rotations are renewed.
    pub packets: &'a mut [Packet],
    pub positions: &'a Field,
    /// The elements of these packets, and the number of the first.
    pub elements: &'a [Element],
    pub first: usize,
    /// What elements give their corners is added to it.
    pub sums: &'a mut Accumulators,
    /// One per packet, or none.
    pub stiffness: &'a mut [StiffnessPacket],
    /// Of mixed elements.
    pub pressures: Option<&'a Pressures>,
    /// What takes the place of D ε.
    pub law: Option<PacketRun<'a>>,
}

/// What passes between the steps of one packet.
#[derive(Default)]
struct Buffers {
    /// Edges from corner 0, then the forces of corners 1 to 3.
    edges: Rows,
    /// F.
    gradient: Rows,
    squares: Row,
    /// V μ q̄, which pressures add to the scaled normal stresses; 0 without, and where a law has it in its own.
    pull: Row,
    /// tr(RᵀF) − 3, or the growth that a law has in its place.
    growth: Row,
    /// ε, and V D ε or V σ by a law, J.
    strain: [Row; 6],
    stress: [Row; 6],
    /// What a law derived from D.
    moduli: Vec<Row>,
}

impl WithSimd for &mut Pass<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Pass { packets, positions, elements, first, sums, stiffness, pressures, law } = self;
        let mut buffers = Buffers::default();
        if let Some(law) = law {
            buffers.moduli.resize(law.length, Row::default());
        }
        for number in 0..packets.len() {
            let lanes = LANES.min(elements.len() - LANES * number);
            let packet = &mut packets[number];
            gather(packet, positions, &mut buffers.edges);
            for part in 0..LANES / S::F64_LANES {
                deformation_gradients(simd, packet, &mut buffers, part);
            }
            renew_rotations(simd, &buffers.gradient, &mut packet.rotation);
            let first = *first + number * LANES;
            if let Some(pressures) = pressures {
                for lane in 0..lanes {
                    buffers.pull[lane] = pressures.pull(first + lane, corners(packet, lane));
                }
            }
            for part in 0..LANES / S::F64_LANES {
                elastic_stress(simd, packet, &mut buffers, part);
            }
            if let Some(law) = law {
                law_stress(packet, &mut buffers, law, number, lanes, pressures.is_some());
            }
            for part in 0..LANES / S::F64_LANES {
                element_forces(simd, packet, &mut buffers, part);
                if let Some(blocks) = stiffness.get_mut(number) {
                    rotated_stiffness(simd, packet, blocks, part);
                }
            }
            for lane in 0..lanes {
                sums.squares += buffers.squares[lane];
                scatter(packet, &buffers.edges, lane, &mut sums.forces);
                if let Some(pressures) = pressures {
                    let (corners, growth) = (corners(packet, lane), buffers.growth[lane]);
                    let residuals = &mut sums.pressure_residuals;
                    pressures.add_residual(first + lane, corners, growth, residuals);
                }
                add_gradient(packet, &buffers.gradient, lane, &mut sums.gradients);
            }
        }
    }
}

/// Adds V F and V to the sums of the corners.
#[inline(always)]
fn add_gradient(packet: &Packet, gradient: &Rows, lane: usize, sums: &mut [(Matrix3<f64>, f64)]) {
    let volume = packet.volume[lane];
    let weighted = matrix(gradient, lane) * volume;
    for corner in 0..4 {
        let (sum, total) = &mut sums[packet.vertices[corner][lane] as usize];
        *sum += weighted;
        *total += volume;
    }
}

#[inline(always)]
fn corners(packet: &Packet, lane: usize) -> [usize; 4] {
    let [a, b, c, d] = &packet.vertices;
    [a[lane] as usize, b[lane] as usize, c[lane] as usize, d[lane] as usize]
}

#[inline(always)]
fn gather(packet: &Packet, positions: &Field, edges: &mut Rows) {
    for lane in 0..LANES {
        let origin = positions[packet.vertices[0][lane] as usize];
        for corner in 0..3 {
            let edge = positions[packet.vertices[corner + 1][lane] as usize] - origin;
            for axis in 0..3 {
                edges[corner][axis][lane] = edge[axis];
            }
        }
    }
}

/// F = Σ (x_i − x_0) ∇λ_iᵀ.
#[inline(always)]
fn deformation_gradients<S: Simd>(simd: S, packet: &Packet, buffers: &mut Buffers, part: usize) {
    let edges = load33(simd, &buffers.edges, part);
    let f: M3<S> = transposed_product(&edges, &load33(simd, &packet.gradients, part));
    store33(&f, &mut buffers.gradient, part);
}

/// S = RᵀF.
#[inline(always)]
fn stretch<S: Simd>(simd: S, packet: &Packet, buffers: &Buffers, part: usize) -> M3<S> {
    let f = load33(simd, &buffers.gradient, part);
    transposed_product(&load33(simd, &packet.rotation, part), &f)
}

/// ε, tr ε and V D ε.
#[inline(always)]
fn elastic_stress<S: Simd>(simd: S, packet: &Packet, buffers: &mut Buffers, part: usize) {
    let s = stretch(simd, packet, buffers, part);
    let one = V::splat(simd, 1.0);
    let strain = [
        s[0][0] - one,
        s[1][1] - one,
        s[2][2] - one,
        s[0][1] + s[1][0],
        s[1][2] + s[2][1],
        s[0][2] + s[2][0],
    ];
    (strain[0] + strain[1] + strain[2]).store(&mut buffers.growth, part);
    let volume = V::load(simd, &packet.volume, part);
    let stress = stress_of(simd, packet, &strain, volume, part);
    for i in 0..6 {
        strain[i].store(&mut buffers.strain[i], part);
        stress[i].store(&mut buffers.stress[i], part);
    }
}

/// V σ and the growth by a law in the place of those of linear elasticity; keeps what σ has beyond D ε̃.
#[inline(always)]
fn law_stress(
    packet: &Packet,
    buffers: &mut Buffers,
    run: &mut PacketRun<'_>,
    number: usize,
    lanes: usize,
    is_mixed: bool,
) {
    let Buffers { strain, stress, growth, pull, moduli, .. } = buffers;
    for i in 0..6 {
        for lane in 0..LANES {
            stress[i][lane] /= packet.volume[lane];
        }
    }
    for lane in 0..LANES {
        pull[lane] /= packet.volume[lane];
        // Lanes behind the last element have its moduli.
        let at = run.length * (LANES * number + lane.min(lanes - 1));
        for k in 0..run.length {
            moduli[k][lane] = run.moduli[at + k];
        }
    }
    let (elastic, pressure) = (*stress, *pull);
    let points =
        PointPacket { strain, elastic: &elastic, moduli, pressure: is_mixed.then_some(&pressure) };
    run.law.stress(&points, stress, growth);
    for lane in 0..lanes {
        let beyond = &mut run.beyond[LANES * number + lane];
        for i in 0..6 {
            let more = if i < 3 { pressure[lane] } else { 0.0 };
            beyond[i] = stress[i][lane] - elastic[i][lane] - more;
        }
    }
    for i in 0..6 {
        for lane in 0..LANES {
            stress[i][lane] *= packet.volume[lane];
        }
    }
    *pull = Row::default();
}

/// R (V σ − b× + V μ q̄ I) ∇λ_i of corners 1 to 3 into the place of the edges; minus their sum is that of corner 0.
#[inline(always)]
fn element_forces<S: Simd>(simd: S, packet: &Packet, buffers: &mut Buffers, part: usize) {
    let s = stretch(simd, packet, buffers, part);
    let r = load33(simd, &packet.rotation, part);
    let mut stress = [V::splat(simd, 0.0); 6];
    for i in 0..6 {
        stress[i] = V::load(simd, &buffers.stress[i], part);
    }
    let [x, y, z] = turning_stress(simd, &stress, &s);
    let [xx, yy, zz, xy, yz, zx] = stress;
    let pull = V::load(simd, &buffers.pull, part);
    let (xx, yy, zz) = (xx + pull, yy + pull, zz + pull);
    let scaled = product(&r, &[[xx, xy + z, zx - y], [xy - z, yy, yz + x], [zx + y, yz - x, zz]]);
    let mut sum = [V::splat(simd, 0.0); 3];
    let mut squares = V::splat(simd, 0.0);
    for corner in 0..3 {
        let gradient = load3(simd, &packet.gradients[corner], part);
        let force =
            [dot(&scaled[0], &gradient), dot(&scaled[1], &gradient), dot(&scaled[2], &gradient)];
        squares = squares + dot(&force, &force);
        for axis in 0..3 {
            sum[axis] = sum[axis] + force[axis];
            force[axis].store(&mut buffers.edges[corner][axis], part);
        }
    }
    (squares + dot(&sum, &sum)).store(&mut buffers.squares, part);
}

/// b of [`conjugate`](crate::element::turning::conjugate).
#[inline(always)]
fn turning_stress<S: Simd>(simd: S, stress: &[V<S>; 6], s: &M3<S>) -> V3<S> {
    let [xx, yy, zz, xy, yz, zx] = *stress;
    let product = product(&[[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]], s);
    let (cofactors, determinant, trace) = turning(simd, s);
    let least = V::splat(simd, LEAST) * trace * trace * trace;
    let skew = axial(&product);
    let b = [dot(&cofactors[0], &skew), dot(&cofactors[1], &skew), dot(&cofactors[2], &skew)];
    let determinant = determinant.or_more(least).or_more(V::splat(simd, f64::MIN_POSITIVE));
    [b[0].over(determinant), b[1].over(determinant), b[2].over(determinant)]
}

/// V D ε.
#[inline(always)]
fn stress_of<S: Simd>(
    simd: S,
    packet: &Packet,
    strain: &[V<S>; 6],
    volume: V<S>,
    part: usize,
) -> [V<S>; 6] {
    let mut stress = *strain;
    for i in 0..6 {
        let mut sum = V::load(simd, &packet.elasticity[packed(i, 0)], part) * strain[0];
        for j in 1..6 {
            sum = sum.plus(V::load(simd, &packet.elasticity[packed(i, j)], part), strain[j]);
        }
        stress[i] = sum * volume;
    }
    stress
}

#[inline(always)]
fn scatter(packet: &Packet, corner_forces: &Rows, lane: usize, forces: &mut Field) {
    let mut first = Vector3::zeros();
    for corner in 0..3 {
        let [x, y, z] = &corner_forces[corner];
        let force = Vector3::new(x[lane], y[lane], z[lane]);
        forces[packet.vertices[corner + 1][lane] as usize] += force;
        first -= force;
    }
    forces[packet.vertices[0][lane] as usize] += first;
}

/// Place of D_ij in the lower half by rows.
#[inline(always)]
const fn packed(i: usize, j: usize) -> usize {
    if i >= j { i * (i + 1) / 2 + j } else { j * (j + 1) / 2 + i }
}

/// R K_ab Rᵀ = V C_aᵀ D C_b with C_b = B_b Rᵀ for corners 1 to 3; rows and columns of corner 0 are
/// minus the sums of the others, because a translation costs no force.
#[inline(always)]
fn rotated_stiffness<S: Simd>(simd: S, packet: &Packet, blocks: &mut StiffnessPacket, part: usize) {
    let r = load33(simd, &packet.rotation, part);
    let volume = V::load(simd, &packet.volume, part);
    let zero = V::splat(simd, 0.0);
    let mut strain_of = [[[zero; 6]; 3]; 3];
    for corner in 0..3 {
        let g = load3(simd, &packet.gradients[corner], part);
        // Row of B times Rᵀ: column k of C is the strain of moving along world axis k.
        for k in 0..3 {
            let e = r[k];
            strain_of[corner][k] = [
                g[0] * e[0],
                g[1] * e[1],
                g[2] * e[2],
                (g[1] * e[0]).plus(g[0], e[1]),
                (g[2] * e[1]).plus(g[1], e[2]),
                (g[2] * e[0]).plus(g[0], e[2]),
            ];
        }
    }
    let mut first = [[zero; 3]; 3];
    for b in 0..3 {
        for k in 0..3 {
            let stress = stress_of(simd, packet, &strain_of[b][k], volume, part);
            let mut sums = [zero; 3];
            for a in 0..3 {
                for axis in 0..3 {
                    let c = &strain_of[a][axis];
                    let mut sum = c[0] * stress[0];
                    for i in 1..6 {
                        sum = sum.plus(c[i], stress[i]);
                    }
                    sums[axis] = sums[axis] + sum;
                    sum.store(&mut blocks[12 * (3 * a + 3 + axis) + 3 * b + 3 + k], part);
                }
            }
            for axis in 0..3 {
                // Row of corner 0, and by symmetry the column of corner 0.
                (-sums[axis]).store(&mut blocks[12 * axis + 3 * b + 3 + k], part);
                (-sums[axis]).store(&mut blocks[12 * (3 * b + 3 + k) + axis], part);
                first[k][axis] = first[k][axis] + sums[axis];
            }
        }
    }
    for i in 0..3 {
        for j in 0..3 {
            first[j][i].store(&mut blocks[12 * i + j], part);
        }
    }
}
