//! Cuts that tools make while the body moves, and their closing.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use nalgebra::{Isometry3, Matrix3, Matrix4, Rotation3, Vector3};
use yawara_corot::rotation::polar_cold;
use yawara_corot::{Element, ElementPoint, Grip, WeightedPoint};
use yawara_mesh::geometry::FACES;
use yawara_mesh::{
    Change, CutDelta, Doubled, FineFace, FineTet, Lattice, NodeRef, Part, Severed, Tet, TetId,
    VertexId,
};

use super::content::Content;
use super::proximity::distance;
use crate::body::{BodyState, Hold, Piece, SheetHold, pieces};
use crate::error::SimError;
use crate::inverse::InverseLink;
use crate::tools::Blade;

/// How far outside of a triangle a point counts as in it, in barycentric coordinates.
const ROUNDING: f64 = 1e-9;

/// How far off a triangle's plane a point counts as in it, relative to the triangle's size.
const ON_PLANE: f64 = 1e-7;

/// How far towards the middle of a finest tetrahedron a point of its face is taken to be in it.
const INSIDE: f64 = 1e-3;

/// The stiffness of the springs that hold a piece which nothing supports, relative to that of the piece: E V^⅓.
const PARKED: f64 = 1e-3;

/// How far such a piece sinks at most under its weight, relative to V^⅓.
const SINKS: f64 = 0.05;

/// The points of a quadrature of four that is exact for squares are at this weight of one corner.
const NEAR: f64 = 0.585_410_196_624_968_5;

/// Faces that are to be severed, and what of them holds material on both sides.
#[derive(Default)]
pub(super) struct Crossed {
    pub faces: Vec<Severed>,
    /// Of the blade's surface where the body is, m².
    pub area_m2: f64,
}

/// A finest tetrahedron near a blade.
#[derive(Clone, Copy)]
struct Near {
    leaf: TetId,
    middle: Vector3<f64>,
    is_solid: bool,
}

impl Content {
    /// The faces of finest tetrahedra that a blade parts on its way, where the body is now. What a tool or an elastic
    /// support grips is not cut.
    ///
    /// Cost: O(tetrahedra), and the finest tetrahedra of those that the blade meets.
    pub fn crossed(&self, state: &BodyState, blade: &Blade) -> Crossed {
        let mut found = Crossed::default();
        let Some(normal) = blade.normal() else { return found };
        let [low, high] = blade.bounds();
        let mut leaves = BTreeSet::new();
        for element in state.elements().iter().filter(|e| !state.is_void(e.tet)) {
            let now = element.vertices.map(|v| state.positions[v]);
            let least = now.iter().fold(now[0], |least, x| least.inf(x));
            let most = now.iter().fold(now[0], |most, x| most.sup(x));
            // A face is crossed between the middles of two tetrahedra: one of them may be beside the blade's box.
            let reach = Vector3::repeat((most - least).norm());
            let apart = |i: usize| least[i] - reach[i] > high[i] || most[i] + reach[i] < low[i];
            if !(0..3).any(apart) && !state.body.is_gripped(element.tet) {
                leaves.insert(self.forest.leaf_of(element.tet));
            }
        }
        let mut open: HashMap<FineFace, Near> = HashMap::new();
        for leaf in leaves {
            for (number, fine) in self.forest.finest_in(&self.forest.tet(leaf)).iter().enumerate() {
                let Some(now) = self.moved(state, leaf, number, fine) else { continue };
                let middle = now.iter().sum::<Vector3<f64>>() * 0.25;
                let near = Near { leaf, middle, is_solid: fine.is_solid() };
                for (opposite, face) in fine.faces.into_iter().enumerate() {
                    let Some(other) = open.remove(&face) else {
                        open.insert(face, near);
                        continue;
                    };
                    if self.forest.is_severed(face) || !blade.parts(&other.middle, &middle) {
                        continue;
                    }
                    found.faces.push(Severed { face, leaves: [other.leaf, leaf] });
                    if near.is_solid && other.is_solid {
                        let mut corners = (0..4).filter(|&i| i != opposite).map(|i| now[i]);
                        let corners: [Vector3<f64>; 3] =
                            std::array::from_fn(|_| corners.next().unwrap_or_default());
                        let [a, b, c] = corners;
                        found.area_m2 += 0.5 * (b - a).cross(&(c - a)).dot(&normal).abs();
                    }
                }
            }
        }
        found
    }

    /// Where the corners of a finest tetrahedron of a leaf are now, m.
    fn moved(
        &self,
        state: &BodyState,
        leaf: TetId,
        number: usize,
        fine: &FineTet,
    ) -> Option<[Vector3<f64>; 4]> {
        let element = state.element(self.forest.sheet_with(leaf, number))?;
        let unit = self.placement.unit / f64::from(self.forest.finest_units());
        let at = |p: [i32; 3]| self.placement.origin + unit * Vector3::from(p.map(f64::from));
        Some(
            fine.corners.map(|p| {
                ElementPoint::new(element, &state.rest, &at(p)).position(&state.positions)
            }),
        )
    }

    /// The severed faces of which one side or the other is in a ball along its way, from what they are at rest.
    pub fn severed_near(
        &self,
        state: &BodyState,
        sweep: &[Vector3<f64>; 2],
        radius_m: f64,
    ) -> Vec<FineFace> {
        let severed: BTreeMap<FineFace, [TetId; 2]> =
            self.forest.severed().map(|severed| (severed.face, severed.leaves)).collect();
        let leaves: BTreeSet<TetId> = severed.values().flatten().copied().collect();
        let mut found = BTreeSet::new();
        for leaf in leaves {
            for (number, fine) in self.forest.finest_in(&self.forest.tet(leaf)).iter().enumerate() {
                let faces = fine.faces.iter().filter(|face| severed.contains_key(face));
                let faces: Vec<FineFace> = faces.copied().collect();
                let Some(now) = self.moved(state, leaf, number, fine).filter(|_| !faces.is_empty())
                else {
                    continue;
                };
                let middle = now.iter().sum::<Vector3<f64>>() * 0.25;
                if distance(&middle, &sweep[0], &sweep[1]) <= radius_m {
                    found.extend(faces);
                }
            }
        }
        found.into_iter().collect()
    }

    /// Points of both sides of all cuts at rest, each a little inside of its own side, m, with its area vector,
    /// outward, m²: of each side one in a cube of `spacing` m.
    pub fn cut_faces(&self, spacing: f64) -> Vec<(Vector3<f64>, Vector3<f64>)> {
        let leaves: BTreeSet<TetId> =
            self.forest.severed().flat_map(|severed| severed.leaves).collect();
        let unit = self.placement.unit / f64::from(self.forest.finest_units());
        let (mut open, mut taken) = (HashMap::new(), BTreeSet::new());
        let mut found = Vec::new();
        let sides =
            leaves.into_iter().flat_map(|leaf| self.forest.finest_in(&self.forest.tet(leaf)));
        for fine in sides.filter(FineTet::is_solid) {
            let corners = fine.corners.map(|p| Vector3::from(p.map(f64::from)) * unit);
            let middle = corners.iter().sum::<Vector3<f64>>() * 0.25;
            for (opposite, face) in fine.faces.into_iter().enumerate() {
                if !self.forest.is_severed(face) {
                    continue;
                }
                let Some(other) = open.insert(face, middle) else { continue };
                let [a, b, c] = FACES[opposite].map(|i| corners[i]);
                let (centre, area) = ((a + b + c) / 3.0, 0.5 * (b - a).cross(&(c - a)));
                for own in [middle, other] {
                    let area = area * area.dot(&(centre - own)).signum();
                    let cube = centre.map(|x| (x / spacing).floor() as i64);
                    let side: [bool; 3] = area.map(|x| x > 0.0).into();
                    if taken.insert((<[i64; 3]>::from(cube), side)) {
                        let inside = centre + INSIDE * (own - centre);
                        found.push((self.placement.origin + inside, area));
                    }
                }
            }
        }
        found
    }

    /// Has the body and the inverse follow what a `cut` or a closing has made of the forest. Returns how many pieces
    /// that nothing supports any more are held by springs from now on; in a body with inertia they fly.
    ///
    /// # Errors
    /// [`SimError::Embed`] for a homogenisation of the whole body or a matrix that is not finite.
    pub fn follow_cut(
        &mut self,
        delta: &CutDelta,
        cut: &[Severed],
        state: &mut BodyState,
        inverse: &mut InverseLink,
        gravity_m_s2: f64,
    ) -> Result<usize, SimError> {
        self.embedding.adopt(self.forest.tree().clone(), &delta.parts)?;
        let is_cut = delta.change == Change::Split;
        if is_cut {
            delta.doubled.iter().for_each(|doubled| double(state, doubled));
        }
        self.exchange(delta, state);
        let mut parked = 0;
        if is_cut && !state.is_dynamic {
            let twins: HashMap<usize, usize> =
                delta.doubled.iter().map(|d| (d.vertex.index(), d.twin.index())).collect();
            let before = |v: usize| VertexId(twins.get(&v).copied().unwrap_or(v) as u32);
            let leaves: BTreeSet<TetId> = cut.iter().flat_map(|severed| severed.leaves).collect();
            let is_near = |tet: TetId| leaves.contains(&self.forest.leaf_of(tet));
            for springs in park(state, gravity_m_s2, &is_near) {
                parked += 1;
                for (corners, matrix) in springs {
                    inverse.add_springs(corners.map(before), &matrix)?;
                }
            }
        }
        let made_of = |tet: &Tet| {
            let corners = tet.vertices.map(|v| state.rest[v.index()]);
            let geometry = yawara_embed::LinearTet::new(&corners);
            (geometry, self.embedding.elasticity(tet.node), self.embedding.density(tet.node))
        };
        let springs = |tet: TetId| state.body.grip_matrix(tet);
        let is_fixed = |v: VertexId| state.holds[v.index()] == Hold::Fixed;
        let key = |v: VertexId| Lattice::key(self.forest.point(v));
        inverse.cut(delta, &made_of, &springs, &is_fixed, &key)?;
        if !is_cut {
            for Doubled { vertex, .. } in &delta.doubled {
                state.remove_vertex(*vertex);
            }
        }
        Ok(parked)
    }

    /// What a sheet holds.
    fn sheet(&self, part: &Part) -> SheetHold {
        let finest_level = self.forest.finest_level();
        SheetHold { level: part.level, finest_level, holds: part.holds.clone() }
    }

    /// Notes what the sheets of a body at rest hold that is apart from the start.
    pub fn note_sheets(&self, parts: &[Part], state: &mut BodyState) {
        let by_node: HashMap<NodeRef, &Part> = parts.iter().map(|part| (part.node, part)).collect();
        for tet in self.forest.leaves() {
            if let Some(part) = by_node.get(&tet.node) {
                state.set_sheet(tet.id, Some(self.sheet(part)));
            }
        }
    }

    /// Exchanges the elements that a cut or its closing touches.
    fn exchange(&self, delta: &CutDelta, state: &mut BodyState) {
        if delta.change == Change::Merge {
            delta.doubled.iter().for_each(|doubled| unite(state, doubled));
        }
        let parts: HashMap<NodeRef, &Part> =
            delta.parts.iter().map(|part| (part.node, part)).collect();
        let mut rotations: BTreeMap<TetId, Matrix3<f64>> = BTreeMap::new();
        let moved = delta.doubled.iter().flat_map(|doubled| &doubled.tets);
        let before = delta.recast.iter().flat_map(|recast| &recast.before);
        for tet in moved.chain(before) {
            if let Some((_, rotation)) = state.remove_tet(tet.id) {
                rotations.insert(tet.id, rotation);
            }
        }
        for recast in &delta.recast {
            let first = rotations.get(&recast.before[0].id).copied();
            let rotation = first.unwrap_or_else(Matrix3::identity);
            recast.before.iter().for_each(|tet| {
                rotations.remove(&tet.id);
                state.set_sheet(tet.id, None);
            });
            for tet in &recast.after {
                rotations.insert(tet.id, rotation);
                state.set_sheet(tet.id, parts.get(&tet.node).map(|part| self.sheet(part)));
            }
        }
        for (tet, rotation) in rotations {
            let tet = self.forest.tet(tet);
            self.add_tet(state, &tet, &rotation);
            state.body.grips_move(tet.id, tet.vertices.map(VertexId::index));
        }
    }
}

/// Brings the vertex of a cut into the body, where its twin is and as that moves.
fn double(state: &mut BodyState, Doubled { vertex, twin, .. }: &Doubled) {
    let (v, t) = (vertex.index(), twin.index());
    state.add_vertex(*vertex, state.rest[t], state.positions[t], state.holds[t]);
    state.velocities[v] = state.velocities[t];
    state.accelerations[v] = state.accelerations[t];
    state.pressure_rates[v] = state.pressure_rates[t];
    let pressure = state.body.pressure(t);
    state.body.set_pressure(v, pressure);
}

/// Moves a vertex that takes another in to the middle of both, unless something holds it.
fn unite(state: &mut BodyState, Doubled { vertex, twin, .. }: &Doubled) {
    let (v, t) = (vertex.index(), twin.index());
    if state.holds[t] == Hold::Free {
        state.positions[t] = 0.5 * (state.positions[t] + state.positions[v]);
    }
    state.velocities[t] = 0.5 * (state.velocities[t] + state.velocities[v]);
    state.accelerations[t] = 0.5 * (state.accelerations[t] + state.accelerations[v]);
}

/// The springs of each tetrahedron of a piece, by its corners.
pub(super) type Springs = Vec<([usize; 4], Matrix4<f64>)>;

/// Holds each piece near a cut that nothing else does by weak springs where it is; their matrices, by piece.
pub(super) fn park(
    state: &mut BodyState,
    gravity_m_s2: f64,
    is_near: &dyn Fn(TetId) -> bool,
) -> Vec<Springs> {
    let mut all = Vec::new();
    // What no cut came near is held as before: by what it is joined to in an edge, and by void.
    let is_loose =
        |piece: &Piece| !piece.is_supported && piece.tets.iter().any(|&tet| is_near(tet));
    for piece in pieces(state).into_iter().filter(is_loose) {
        let elements: Vec<Element> =
            piece.tets.iter().filter_map(|&tet| state.element(tet)).copied().collect();
        let (mut volume, mut stiffness, mut mass) = (0.0, 0.0, 0.0);
        let (mut points, mut arms) = (Vec::new(), Matrix3::zeros());
        let centre = |at: &[Vector3<f64>]| {
            let middles =
                elements.iter().map(|e| e.vertices.map(|v| at[v]).iter().sum::<Vector3<f64>>());
            middles.sum::<Vector3<f64>>() / (4 * elements.len()) as f64
        };
        let [rest, now] = [&state.rest, &state.positions].map(|at| centre(at));
        for element in &elements {
            let share = element.geometry.volume * state.fraction(element.tet);
            volume += share;
            mass += element.geometry.volume * state.density(element.tet);
            // Three shear moduli are E within a tenth.
            stiffness += element.geometry.volume * 3.0 * element.elasticity[(3, 3)];
            let far = (1.0 - NEAR) / 3.0;
            for corner in 0..4 {
                let weights = std::array::from_fn(|i| if i == corner { NEAR } else { far });
                let point = ElementPoint { vertices: element.vertices, weights };
                let place = point.position(&state.rest);
                points.push(WeightedPoint { rest: place, weight: 0.25 * share });
                arms +=
                    share * (point.position(&state.positions) - now) * (place - rest).transpose();
            }
        }
        let size = f64::cbrt(volume);
        let whole = PARKED * stiffness / volume * size;
        let kappa = whole.max(mass * gravity_m_s2 / (SINKS * size)) / volume;
        let all_of_it = |_, _: &ElementPoint| true;
        let elements = elements.iter();
        let Some(mut grip) =
            Grip::new(points, Some(kappa), elements.clone(), &state.rest, all_of_it)
        else {
            continue;
        };
        let turn = Rotation3::from_matrix_unchecked(polar_cold(&arms));
        grip.set_pose(Isometry3::from_parts((now - turn * rest).into(), turn.into()));
        let of = |e: &Element| Some((e.vertices, grip.matrix(e.tet)?));
        all.push(elements.filter_map(of).collect());
        state.body.add_grip(grip);
        state.grip_tools.push(None);
    }
    all
}

impl Blade {
    /// The unit normal of the surface that its edge sweeps over; none where that has no area.
    pub(super) fn normal(&self) -> Option<Vector3<f64>> {
        let [[a, b], [c, d]] = self.edges;
        (d - a).cross(&(c - b)).try_normalize(0.0)
    }

    /// How far the middle of its edge goes.
    pub(super) fn way(&self) -> Vector3<f64> {
        let [[a, b], [c, d]] = self.edges;
        0.5 * (c + d - a - b)
    }

    /// The box around that surface.
    pub(super) fn bounds(&self) -> [Vector3<f64>; 2] {
        let all = self.edges.as_flattened();
        let first = all[0];
        all.iter().fold([first; 2], |[low, high], x| [low.inf(x), high.sup(x)])
    }

    /// Whether a tetrahedron, in the box from `low` to `high`, may meet that surface: it meets its box and its plane.
    pub(super) fn meets(
        &self,
        corners: &[Vector3<f64>; 4],
        [low, high]: [&Vector3<f64>; 2],
    ) -> bool {
        let [least, most] = self.bounds();
        let Some(normal) = self.normal() else { return false };
        let sides = corners.map(|x| normal.dot(&(x - self.edges[0][0])) > 0.0);
        (0..3).all(|i| low[i] <= most[i] && high[i] >= least[i])
            && sides.contains(&true)
            && sides.contains(&false)
    }

    /// Whether that surface parts two points.
    fn parts(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> bool {
        let [[a, b], [c, d]] = self.edges;
        crosses([a, b, d], from, to) || crosses([a, d, c], from, to)
    }
}

/// Whether a segment passes through a triangle (Möller and Trumbore 1997).
///
/// Points in the triangle's plane are on one side of it, by much more than rounding: middles of a lattice often are in
/// a blade's plane, and one that were on both sides would be cut off from all around it.
fn crosses([a, b, c]: [Vector3<f64>; 3], from: &Vector3<f64>, to: &Vector3<f64>) -> bool {
    let (u, v, along) = (b - a, c - a, to - from);
    let normal = u.cross(&v);
    let level = ON_PLANE * normal.norm() * (u.norm() + v.norm());
    let [first, second] = [from, to].map(|x| normal.dot(&(x - a)));
    if (first > level) == (second > level) {
        return false;
    }
    let at = from + along * (first / (first - second)).clamp(0.0, 1.0) - a;
    let scale = normal.norm_squared().recip();
    let weights = [at.cross(&v).dot(&normal) * scale, u.cross(&at).dot(&normal) * scale];
    weights.iter().all(|weight| *weight >= -ROUNDING) && weights[0] + weights[1] <= 1.0 + ROUNDING
}
