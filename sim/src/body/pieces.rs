//! The pieces that a body is in, by the faces that its tetrahedra have in common.

use std::collections::{BTreeMap, HashMap};

use nalgebra::{Matrix3, Vector3};
use yawara_mesh::TetId;
use yawara_mesh::geometry::FACES;

use super::state::{BodyState, Hold};

/// The least extent across their longest of points that hold a piece, relative to it: on one line they would let it turn.
const LEAST_ACROSS: f64 = 1e-3;

/// Tetrahedra of material that hang together by faces. What has no more than an edge in common could turn about it.
pub(crate) struct Piece {
    /// Ascending.
    pub tets: Vec<TetId>,
    /// Of its material at rest, m³.
    pub volume_m3: f64,
    /// Whether fixed vertices or elastic supports hold it in place and turn.
    pub is_supported: bool,
}

/// The pieces of a body without its void, the largest first. Cost: O(n log n) for n tetrahedra.
pub(crate) fn pieces(state: &BodyState) -> Vec<Piece> {
    let solid: Vec<TetId> = state
        .elements_by_number()
        .into_iter()
        .map(|(_, element)| element.tet)
        .filter(|&tet| !state.is_void(tet))
        .collect();
    let mut parents: Vec<usize> = (0..solid.len()).collect();
    let mut first: HashMap<[usize; 3], usize> = HashMap::with_capacity(2 * solid.len());
    for (number, &tet) in solid.iter().enumerate() {
        let Some(element) = state.element(tet) else { continue };
        for face in FACES {
            let mut face = face.map(|i| element.vertices[i]);
            face.sort_unstable();
            let other = *first.entry(face).or_insert(number);
            let [a, b] = [number, other].map(|entry| root(&mut parents, entry));
            parents[a.max(b)] = a.min(b);
        }
    }
    let mut groups: BTreeMap<usize, Vec<TetId>> = BTreeMap::new();
    for (number, &tet) in solid.iter().enumerate() {
        groups.entry(root(&mut parents, number)).or_default().push(tet);
    }
    let mut pieces: Vec<Piece> = groups.into_values().map(|tets| piece(tets, state)).collect();
    pieces.sort_by(|a, b| b.volume_m3.total_cmp(&a.volume_m3));
    pieces
}

fn piece(tets: Vec<TetId>, state: &BodyState) -> Piece {
    let elements = || tets.iter().filter_map(|&tet| state.element(tet));
    let mut held = Moments::default();
    for v in elements().flat_map(|element| element.vertices) {
        if state.holds[v] == Hold::Fixed {
            held.add(1.0, &state.rest[v]);
        }
    }
    // Those of the points that springs hold, from their sums Σ w λλᵀ.
    for element in elements() {
        let Some(springs) = state.body.grip_matrix(element.tet) else { continue };
        let scale = springs.sum().recip();
        for (i, j) in (0..4).flat_map(|i| (0..4).map(move |j| (i, j))) {
            let [a, b] = [i, j].map(|corner| &state.rest[element.vertices[corner]]);
            held.add_product(scale * springs[(i, j)], a, b);
        }
    }
    let volume_m3 = elements().map(|e| e.geometry.volume * state.fraction(e.tet)).sum();
    Piece { volume_m3, is_supported: held.span_a_plane(), tets }
}

/// Moments of weighted points.
#[derive(Default)]
struct Moments {
    weight: f64,
    first: Vector3<f64>,
    second: Matrix3<f64>,
}

impl Moments {
    fn add(&mut self, weight: f64, x: &Vector3<f64>) {
        self.add_product(weight, x, x);
    }

    /// A part Σ w a bᵀ of the second moment, whose parts all together are symmetric.
    fn add_product(&mut self, weight: f64, a: &Vector3<f64>, b: &Vector3<f64>) {
        self.weight += weight;
        self.first += 0.5 * weight * (a + b);
        self.second += weight * a * b.transpose();
    }

    /// Whether the points do not all lie on a line, by far.
    fn span_a_plane(&self) -> bool {
        let mean = self.first / self.weight;
        let spread = self.second / self.weight - mean * mean.transpose();
        let mut values = spread.symmetric_eigenvalues();
        values.as_mut_slice().sort_by(f64::total_cmp);
        // Rounding is that of where the points are.
        let rounding = 16.0 * f64::EPSILON * mean.norm_squared();
        self.weight > 0.0
            && values[1] > rounding
            && values[1] > LEAST_ACROSS * LEAST_ACROSS * values[2]
    }
}

/// The root of an entry's tree; halves the path to it.
fn root(parents: &mut [usize], mut entry: usize) -> usize {
    while parents[entry] != entry {
        parents[entry] = parents[parents[entry]];
        entry = parents[entry];
    }
    entry
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_on_a_line_hold_nothing_in_turn() {
        let held = |points: &[[f64; 3]]| {
            let mut moments = Moments::default();
            points.iter().for_each(|&x| moments.add(2.0, &Vector3::from(x)));
            moments.span_a_plane()
        };
        assert!(!held(&[]) && !held(&[[0.1, 0.2, 0.3]; 3]));
        assert!(!held(&[[0.1, 0.2, 0.3], [0.3, 0.2, 0.3], [0.2, 0.2, 0.3]]));
        assert!(held(&[[0.1, 0.2, 0.3], [0.3, 0.2, 0.3], [0.2, 0.201, 0.3]]));
    }
}
