//! The pieces that a body is in, by what its tetrahedra have in common.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use yawara_mesh::TetId;

use super::components::spans_a_plane;
use super::state::{BodyState, Hold};

/// Tetrahedra of material that hang together.
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
    let mut parents: Vec<usize> = (0..state.vertex_capacity()).collect();
    let solid: Vec<TetId> = state
        .elements_by_number()
        .into_iter()
        .map(|(_, element)| element.tet)
        .filter(|&tet| !state.is_void(tet))
        .collect();
    let corners = |tet: TetId| state.element(tet).map_or([0; 4], |element| element.vertices);
    for &tet in &solid {
        let roots = corners(tet).map(|v| root(&mut parents, v));
        let least = roots.into_iter().min().unwrap_or(0);
        roots.into_iter().for_each(|r| parents[r] = least);
    }
    let mut groups: BTreeMap<usize, Vec<TetId>> = BTreeMap::new();
    for &tet in &solid {
        groups.entry(root(&mut parents, corners(tet)[0])).or_default().push(tet);
    }
    let mut pieces: Vec<Piece> = groups.into_values().map(|tets| piece(tets, state)).collect();
    pieces.sort_by(|a, b| b.volume_m3.total_cmp(&a.volume_m3));
    pieces
}

fn piece(tets: Vec<TetId>, state: &BodyState) -> Piece {
    let elements = tets.iter().filter_map(|&tet| state.element(tet));
    let fixed = elements.clone().flat_map(|element| element.vertices);
    let fixed = fixed.filter(|&v| state.holds[v] == Hold::Fixed);
    let fixed: Vec<Vector3<f64>> = fixed.map(|v| state.rest[v]).collect();
    let is_gripped = || tets.iter().any(|&tet| state.body.grip_matrix(tet).is_some());
    let volume_m3 = elements.map(|e| e.geometry.volume * state.fraction(e.tet)).sum();
    Piece { volume_m3, is_supported: spans_a_plane(&fixed) || is_gripped(), tets }
}

/// The root of an entry's tree; halves the path to it.
fn root(parents: &mut [usize], mut entry: usize) -> usize {
    while parents[entry] != entry {
        parents[entry] = parents[parents[entry]];
        entry = parents[entry];
    }
    entry
}
