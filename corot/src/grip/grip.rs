//! Weighted points of material, each in one element of a mesh that changes.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use nalgebra::{Isometry3, Matrix3, Matrix4, Point3, Vector3, Vector4};
use yawara_embed::LinearTet;
use yawara_mesh::{Change, MeshDelta, RingTet, TetId};

use super::loads::Loads;
use crate::element::{EDGES, Element, ElementPoint, elements_of};

/// The least radius of gyration of points that can feel a torque, as a part of the largest.
const FLAT: f64 = 1e-4;

/// A fine point of the body and what it counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeightedPoint {
    /// Where it rests, m.
    pub rest: Vector3<f64>,
    /// The volume (m³) or area (m²) that it stands for, times a profile of its own.
    pub weight: f64,
}

/// Material that is held: points f with weights w_f that do not know the mesh.
///
/// The interpolated position x_f = Σ λ_a x_a is linear in each element and the spaces of a mesh and
/// its refinement are nested, so that sums over the points are the same integrals on every mesh: a
/// split by itself changes no energy, force or mean. A grip has a pose that its points are to follow,
/// y_f = R X_f + t; with a stiffness κ it is elastic, an energy ½ Σ κ w_f |x_f − y_f|² of the body
/// ([`Body::add_grip`](crate::Body::add_grip)), without one it is for
/// [`Constraints`](super::Constraints) to hold its mean.
#[derive(Clone, Debug)]
pub struct Grip {
    points: Vec<WeightedPoint>,
    /// κ: N/m per unit of weight.
    stiffness: Option<f64>,
    pose: Isometry3<f64>,
    shares: BTreeMap<TetId, Share>,
    /// What every evaluation asks of them, until they change.
    sums: OnceLock<Sums>,
    weight: f64,
    centre: Vector3<f64>,
    /// Σ w (|r|² I − r rᵀ) / Σ w at rest, r arms about the centre, m².
    inertia: Matrix3<f64>,
    /// ρ, the radius of gyration, m; none where the points do not span a volume or an area.
    gyration: Option<f64>,
}

/// What an element has of a grip.
#[derive(Clone, Debug)]
struct Share {
    vertices: [usize; 4],
    /// Where these rest, m.
    corners: [Vector3<f64>; 4],
    /// Number and λ of each point, ascending numbers.
    points: Vec<(u32, Vector4<f64>)>,
    /// Σ w λ_a.
    first: Vector4<f64>,
    /// Σ w λ_a λ_b.
    second: Matrix4<f64>,
    /// Of the bump φ of each edge Σ w φ λ_a and Σ w φ².
    bumps: [(Vector4<f64>, f64); 6],
}

/// All that elements have of a grip.
#[derive(Clone, Debug)]
struct Sums {
    springs: Vec<Spring>,
    /// The largest Σ w λ_a².
    largest: f64,
    /// By ascending vertex number Σ w λ_a / Σ w and Σ w λ_a (X − c) / Σ w, 1 and m.
    moments: Vec<(usize, (f64, Vector3<f64>))>,
}

/// Of a [`Share`] what forces are made of.
#[derive(Clone, Debug)]
struct Spring {
    vertices: [usize; 4],
    corners: [Vector3<f64>; 4],
    second: Matrix4<f64>,
}

impl Share {
    fn new(
        vertices: [usize; 4],
        corners: [Vector3<f64>; 4],
        mut points: Vec<(u32, Vector4<f64>)>,
        all: &[WeightedPoint],
    ) -> Self {
        points.sort_by_key(|point| point.0);
        let (mut first, mut second) = (Vector4::zeros(), Matrix4::zeros());
        let mut bumps = [(Vector4::zeros(), 0.0); 6];
        for (number, lambda) in &points {
            let weight = all[*number as usize].weight;
            first += weight * lambda;
            second += weight * lambda * lambda.transpose();
            for ([a, b], (moment, square)) in EDGES.into_iter().zip(&mut bumps) {
                let height = 4.0 * lambda[a] * lambda[b];
                *moment += weight * height * lambda;
                *square += weight * height * height;
            }
        }
        Self { vertices, corners, points, first, second, bumps }
    }

    /// Σ w λ_a X_f = Σ w λ_a Σ λ_b X_b of a corner.
    fn rest(&self, corner: usize) -> Vector3<f64> {
        (0..4).map(|b| self.second[(corner, b)] * self.corners[b]).sum()
    }
}

/// κ Σ w λ_a (x_f − y_f) of corners that are `off` from where their material is to be, N, by `second`,
/// Σ w λ_a λ_b: what the body's internal forces have of it, the opposite of its force on the body.
fn spring_forces(
    second: &Matrix4<f64>,
    stiffness: f64,
    off: &[Vector3<f64>; 4],
) -> [Vector3<f64>; 4] {
    [0, 1, 2, 3].map(|a| {
        let sum: Vector3<f64> = (0..4).map(|b| second[(a, b)] * off[b]).sum();
        stiffness * sum
    })
}

impl Grip {
    /// Points in `elements`, whose vertices rest at `rest` (by vertex number, m), at their pose of
    /// rest. `stiffness` κ in N/m per unit of weight.
    ///
    /// Points outside of all these elements, or in none that `carries` them (an element of a body that is cut holds a part of
    /// its material), count for nothing; `None` if no point is left.
    pub fn new<'a>(
        points: Vec<WeightedPoint>,
        stiffness: Option<f64>,
        elements: impl Iterator<Item = &'a Element>,
        rest: &[Vector3<f64>],
        carries: impl Fn(TetId, &ElementPoint) -> bool,
    ) -> Option<Self> {
        let places: Vec<Vector3<f64>> = points.iter().map(|point| point.rest).collect();
        let elements: Vec<&Element> = elements.collect();
        let found = elements_of(&places, &elements, rest, 0.0, carries);
        let mut bound: Vec<Vec<(u32, Vector4<f64>)>> = vec![Vec::new(); elements.len()];
        for (number, (place, found)) in places.iter().zip(found).enumerate() {
            let Some(at) = found.map(|at| at as usize) else { continue };
            let ElementPoint { weights, .. } = ElementPoint::new(elements[at], rest, place);
            bound[at].push((number as u32, weights.into()));
        }
        let shares: BTreeMap<TetId, Share> = elements
            .iter()
            .zip(bound)
            .filter(|(_, bound)| !bound.is_empty())
            .map(|(element, bound)| {
                let corners = element.vertices.map(|v| rest[v]);
                (element.tet, Share::new(element.vertices, corners, bound, &points))
            })
            .collect();
        let weight: f64 = shares.values().map(|share| share.first.sum()).sum();
        let rests = shares.values().flat_map(|share| [0, 1, 2, 3].map(|a| share.rest(a)));
        let sum: Vector3<f64> = rests.sum();
        if !(weight > 0.0) {
            return None;
        }
        let centre = sum / weight;
        let mut spread = Matrix3::zeros();
        for (number, _) in shares.values().flat_map(|share| &share.points) {
            let WeightedPoint { rest, weight: w } = &points[*number as usize];
            let arm = rest - centre;
            spread += *w / weight * arm * arm.transpose();
        }
        let inertia = Matrix3::identity() * spread.trace() - spread;
        let axes = inertia.symmetric_eigenvalues();
        let can_turn = axes.min() > FLAT * FLAT * axes.max();
        let gyration = can_turn.then(|| spread.trace().sqrt());
        let pose = Isometry3::identity();
        Some(Self {
            points,
            stiffness,
            pose,
            shares,
            sums: OnceLock::new(),
            weight,
            centre,
            inertia,
            gyration,
        })
    }

    /// κ, N/m per unit of weight, of an elastic grip that has not let go.
    pub fn stiffness(&self) -> Option<f64> {
        self.stiffness
    }

    /// Σ w, m³ or m².
    pub fn weight(&self) -> f64 {
        self.weight
    }

    /// How many points it has, those outside of all elements too.
    pub fn point_count(&self) -> usize {
        self.points.len()
    }

    /// The weighted mean of the points at rest, m.
    pub fn centre(&self) -> Vector3<f64> {
        self.centre
    }

    /// True if it can hold against a turn: its points do not lie on a line.
    pub fn can_turn(&self) -> bool {
        self.gyration.is_some()
    }

    /// Whether it has points in an element.
    pub(crate) fn holds(&self, tet: TetId) -> bool {
        self.shares.contains_key(&tet)
    }

    /// The largest diagonal entry of the elements' [matrices](Self::matrix), N/m.
    pub(crate) fn stiffest(&self) -> f64 {
        self.stiffness.unwrap_or(0.0) * self.sums().largest
    }

    /// Where its points are to be, from rest.
    pub fn pose(&self) -> &Isometry3<f64> {
        &self.pose
    }

    /// Leads its points.
    pub fn set_pose(&mut self, pose: Isometry3<f64>) {
        self.pose = pose;
    }

    /// κ Σ w λ_a λ_b of an element's corners, the same for each axis, N/m.
    pub fn matrix(&self, tet: TetId) -> Option<Matrix4<f64>> {
        Some(self.shares.get(&tet)?.second * self.stiffness?)
    }

    /// Lets go: returns the [matrices](Self::matrix) that the stiffness loses, with their corners.
    pub fn release(&mut self) -> Vec<([usize; 4], Matrix4<f64>)> {
        let Some(stiffness) = self.stiffness.take() else { return Vec::new() };
        self.shares.values().map(|share| (share.vertices, share.second * stiffness)).collect()
    }

    /// How far an element's corners are from where their material is to be, m: nothing but zero at rest.
    fn offsets(
        &self,
        vertices: &[usize; 4],
        corners: &[Vector3<f64>; 4],
        positions: &[Vector3<f64>],
    ) -> [Vector3<f64>; 4] {
        let target = |b: usize| (self.pose * Point3::from(corners[b])).coords;
        std::array::from_fn(|b| positions[vertices[b]] - target(b))
    }

    /// Calls `visit` with vertex numbers and the forces of an elastic grip on the body there, N.
    pub fn each_force(
        &self,
        positions: &[Vector3<f64>],
        mut visit: impl FnMut(usize, Vector3<f64>),
    ) {
        let Some(stiffness) = self.stiffness else { return };
        for Spring { vertices, corners, second } in &self.sums().springs {
            let off = self.offsets(vertices, corners, positions);
            let forces = spring_forces(second, stiffness, &off);
            vertices.iter().copied().zip(forces).for_each(|(v, force)| visit(v, -force));
        }
    }

    /// Adds the internal forces of an elastic grip to `forces`; returns Σ ‖·‖² of the elements'
    /// shares.
    pub(crate) fn add_to(&self, positions: &[Vector3<f64>], forces: &mut [Vector3<f64>]) -> f64 {
        let mut squares = 0.0;
        self.each_force(positions, |v, force| {
            squares += force.norm_squared();
            forces[v] -= force;
        });
        squares
    }

    /// ½ Σ κ w |x_f − y_f|² of an elastic grip, J.
    pub fn energy(&self, positions: &[Vector3<f64>]) -> f64 {
        let squares = self.shares.values().map(|share| self.squares(share, positions));
        0.5 * self.stiffness.unwrap_or(0.0) * squares.sum::<f64>()
    }

    /// The same of its points in one element, J.
    pub(crate) fn energy_of(&self, tet: TetId, positions: &[Vector3<f64>]) -> f64 {
        let squares = self.shares.get(&tet).map_or(0.0, |share| self.squares(share, positions));
        0.5 * self.stiffness.unwrap_or(0.0) * squares
    }

    /// Σ w |x_f − y_f|² of the points in an element.
    fn squares(&self, share: &Share, positions: &[Vector3<f64>]) -> f64 {
        let off = self.offsets(&share.vertices, &share.corners, positions);
        let product = |(a, b): (usize, usize)| share.second[(a, b)] * off[a].dot(&off[b]);
        (0..16).map(|i| product((i / 4, i % 4))).sum()
    }

    /// Adds to `loads` what an elastic grip does to the body.
    pub fn add_loads(&self, positions: &[Vector3<f64>], loads: &mut Loads) {
        self.add_pull(|share| self.offsets(&share.vertices, &share.corners, positions), loads);
    }

    /// Adds to `loads` by how much that changes where the body moves by `moves` (by vertex number) and
    /// the grip by `lead`, m.
    pub fn add_change(&self, moves: &[Vector3<f64>], lead: &Vector3<f64>, loads: &mut Loads) {
        self.add_pull(|share| share.vertices.map(|v| moves[v] - lead), loads);
    }

    /// Of corners that are off by `off`, m.
    fn add_pull(&self, off: impl Fn(&Share) -> [Vector3<f64>; 4], loads: &mut Loads) {
        let Some(stiffness) = self.stiffness else { return };
        for share in self.shares.values() {
            let off = off(share);
            let forces = spring_forces(&share.second, stiffness, &off);
            for (v, force) in share.vertices.into_iter().zip(forces) {
                loads.add_vertex(v, -force);
            }
            for (edge, (moment, square)) in EDGES.into_iter().zip(&share.bumps) {
                let sum: Vector3<f64> = (0..4).map(|a| moment[a] * off[a]).sum();
                loads.add_edge(&share.vertices, edge, -stiffness * sum, stiffness * square);
            }
        }
    }

    /// Adds a force (N) and a torque about the mean (N m) shared among the points to `loads`:
    /// w/Σw (F + (J⁻¹τ) × R r), J the inertia of the points at their pose, r their arms at rest. A torque
    /// that they can't feel is left out.
    pub fn add_shares(&self, force: &Vector3<f64>, torque: &Vector3<f64>, loads: &mut Loads) {
        let turn = self.pose.rotation;
        let local = turn.inverse() * torque;
        let inverse = self.gyration.and_then(|_| self.inertia.try_inverse());
        let spin = inverse.map_or_else(Vector3::zeros, |inverse| turn * (inverse * local));
        for share in self.shares.values() {
            // Linear in an element: what acts on a unit of weight at each corner.
            let at = share.corners.map(|x| force + spin.cross(&(turn * (x - self.centre))));
            for (a, &v) in share.vertices.iter().enumerate() {
                let sum: Vector3<f64> = (0..4).map(|b| share.second[(a, b)] * at[b]).sum();
                loads.add_vertex(v, sum / self.weight);
            }
            for (edge, (moment, _)) in EDGES.into_iter().zip(&share.bumps) {
                let sum: Vector3<f64> = (0..4).map(|a| moment[a] * at[a]).sum();
                loads.add_edge(&share.vertices, edge, sum / self.weight, 0.0);
            }
        }
    }

    /// Σ w J at `positions` (by vertex number, m), J the determinant of the deformation gradient: the
    /// volume that points with volumes for weights stand for, m³. Adds its gradient to `loads`, as if it
    /// were a force: Σ w J F⁻ᵀ∇λ, and of the bumps the same, m².
    pub fn add_volume(&self, positions: &[Vector3<f64>], loads: &mut Loads) -> f64 {
        let mut volume = 0.0;
        for share in self.shares.values() {
            let rest = LinearTet::new(&share.corners);
            let now = LinearTet::new(&share.vertices.map(|v| positions[v]));
            let ratio = now.volume / rest.volume;
            volume += ratio * share.first.sum();
            for (a, &v) in share.vertices.iter().enumerate() {
                loads.add_vertex(v, ratio * share.first.sum() * now.gradients[a]);
            }
            for [a, b] in EDGES {
                let slope = share.first[a] * now.gradients[b] + share.first[b] * now.gradients[a];
                loads.add_edge(&share.vertices, [a, b], 4.0 * ratio * slope, 0.0);
            }
        }
        volume
    }

    /// The weighted mean of the points at `positions` (by vertex number, m), m.
    pub fn mean(&self, positions: &[Vector3<f64>]) -> Vector3<f64> {
        self.mean_weights().into_iter().map(|(v, weight)| weight * positions[v]).sum()
    }

    /// Where the points are as a whole at `positions` (by vertex number, m): their weighted mean, m, and the
    /// turn J⁻¹ Σ w (R r) × x / Σ w, rad, J their inertia at their pose and r their arms at rest. Of small
    /// moves the latter's change is the turn on which a torque does work; zero where they can't feel one.
    pub fn placement(&self, positions: &[Vector3<f64>]) -> (Vector3<f64>, Vector3<f64>) {
        let turn = self.pose.rotation;
        let (mut mean, mut sum) = (Vector3::zeros(), Vector3::zeros());
        for (v, (first, arm)) in self.moments() {
            mean += *first * positions[*v];
            sum += (turn * arm).cross(&positions[*v]);
        }
        let inverse = self.gyration.and_then(|_| self.inertia.try_inverse()).unwrap_or_default();
        (mean, turn * (inverse * (turn.inverse() * sum)))
    }

    /// By ascending vertex number Σ w λ_a / Σ w and Σ w λ_a (X − c) / Σ w, 1 and m, c the
    /// [centre](Self::centre): the mean of the body's points is Σ of the first times x_a.
    pub(super) fn moments(&self) -> &[(usize, (f64, Vector3<f64>))] {
        &self.sums().moments
    }

    fn sums(&self) -> &Sums {
        self.sums.get_or_init(|| {
            let mut springs = Vec::with_capacity(self.shares.len());
            let (mut largest, mut moments) = (0.0f64, BTreeMap::new());
            for share in self.shares.values() {
                let Share { vertices, corners, second, .. } = *share;
                largest = largest.max(second.diagonal().max());
                springs.push(Spring { vertices, corners, second });
                for (a, v) in vertices.into_iter().enumerate() {
                    let (first, arm) = moments.entry(v).or_insert((0.0, Vector3::zeros()));
                    *first += share.first[a] / self.weight;
                    *arm += (share.rest(a) - share.first[a] * self.centre) / self.weight;
                }
            }
            Sums { springs, largest, moments: moments.into_iter().collect() }
        })
    }

    /// Σ w λ_a / Σ w by vertex number: what each weighs in the mean of the points.
    pub fn mean_weights(&self) -> Vec<(usize, f64)> {
        self.moments().iter().map(|(v, (first, _))| (*v, *first)).collect()
    }

    /// ρ of [`can_turn`](Self::can_turn), m.
    pub(super) fn gyration(&self) -> Option<f64> {
        self.gyration
    }

    /// Goes along where an element has got other vertices at the same places.
    pub(crate) fn move_to(&mut self, tet: TetId, vertices: [usize; 4]) {
        if let Some(share) = self.shares.get_mut(&tet) {
            self.sums.take();
            share.vertices = vertices;
        }
    }

    /// Hands the points of the ring's elements on to those that took their place, exactly.
    pub fn follow(&mut self, delta: &MeshDelta) {
        self.sums.take();
        for RingTet { parent, children } in &delta.ring {
            let corners = parent.vertices.map(|v| v.index());
            let new = delta.vertex.index();
            let ends = delta.edge.map(|v| v.index());
            let at = |v: usize| corners.iter().position(|&corner| corner == v).unwrap_or_default();
            let [a, b] = ends.map(at);
            match delta.change {
                Change::Split => {
                    let Some(share) = self.shares.remove(&parent.id) else { continue };
                    // A point lies in the half that keeps the end it is nearer to.
                    let is_first = |lambda: &Vector4<f64>| lambda[a] >= lambda[b];
                    let (first, second) =
                        share.points.iter().copied().partition::<Vec<_>, _>(|p| is_first(&p.1));
                    for child in children {
                        let vertices = child.vertices.map(|v| v.index());
                        let keeps_a = vertices.contains(&ends[0]);
                        let (points, lost) = if keeps_a { (&first, b) } else { (&second, a) };
                        if points.is_empty() {
                            continue;
                        }
                        let moved = points.iter().map(|(number, lambda)| {
                            let of = |v: usize| match v {
                                v if v == new => 2.0 * lambda[lost],
                                v if ends.contains(&v) => lambda[at(v)] - lambda[lost],
                                v => lambda[at(v)],
                            };
                            (*number, Vector4::from(vertices.map(of)))
                        });
                        let middle = 0.5 * (share.corners[a] + share.corners[b]);
                        let rest = |v: usize| if v == new { middle } else { share.corners[at(v)] };
                        let corners = vertices.map(rest);
                        let half = Share::new(vertices, corners, moved.collect(), &self.points);
                        self.shares.insert(child.id, half);
                    }
                }
                Change::Merge => {
                    let (mut points, mut rest) = (Vec::new(), [None; 4]);
                    for child in children {
                        let Some(share) = self.shares.remove(&child.id) else { continue };
                        let (mut kept, mut middle) = (None, Vector3::zeros());
                        for (v, x) in share.vertices.into_iter().zip(share.corners) {
                            match v {
                                v if v == new => middle = x,
                                v => rest[at(v)] = Some(x),
                            }
                            kept = if ends.contains(&v) { Some((at(v), x)) } else { kept };
                        }
                        if let Some((end, x)) = kept {
                            // The other half may hold nothing.
                            rest[a + b - end].get_or_insert(2.0 * middle - x);
                        }
                        for (number, lambda) in share.points {
                            let mut whole = Vector4::zeros();
                            for (i, v) in share.vertices.into_iter().enumerate() {
                                let to = if v == new { vec![a, b] } else { vec![at(v)] };
                                let part = lambda[i] / to.len() as f64;
                                to.into_iter().for_each(|corner| whole[corner] += part);
                            }
                            points.push((number, whole));
                        }
                    }
                    if !points.is_empty() {
                        let rest = rest.map(Option::unwrap_or_default);
                        let share = Share::new(corners, rest, points, &self.points);
                        self.shares.insert(parent.id, share);
                    }
                }
            }
        }
    }
}
