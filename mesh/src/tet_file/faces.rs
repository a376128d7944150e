//! Faces of a plain mesh: its boundary, its connected parts, and that it is a manifold.

use rayon::prelude::*;

use super::error::TetMeshError;
use crate::union_find::groups;

/// Corners of the face opposite each corner, counter-clockwise as seen from outside.
const OUTWARD_FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// A face of one tetrahedron.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Face {
    /// Ascending.
    corners: [u32; 3],
    tet: u32,
    /// Whether the ascending order is clockwise as seen from outside the tetrahedron.
    flipped: bool,
}

impl Face {
    fn new(tet: u32, mut corners: [u32; 3]) -> Self {
        let mut flipped = false;
        for (i, j) in [(0, 1), (1, 2), (0, 1)] {
            if corners[i] > corners[j] {
                corners.swap(i, j);
                flipped = !flipped;
            }
        }
        Self { corners, tet, flipped }
    }

    /// Counter-clockwise as seen from outside, starting with the smallest corner.
    fn outward(&self) -> [u32; 3] {
        let [a, b, c] = self.corners;
        if self.flipped { [a, c, b] } else { [a, b, c] }
    }
}

fn sorted(tets: &[[u32; 4]]) -> Vec<Face> {
    let mut faces: Vec<Face> = tets
        .par_iter()
        .enumerate()
        .flat_map_iter(|(tet, corners)| {
            OUTWARD_FACES.map(|face| Face::new(tet as u32, face.map(|i| corners[i])))
        })
        .collect();
    faces.par_sort_unstable();
    faces
}

/// Whether each face has one tetrahedron or one on each side; volumes must be positive.
pub(super) fn check(tets: &[[u32; 4]]) -> Result<(), TetMeshError> {
    for same in sorted(tets).chunk_by(|a, b| a.corners == b.corners) {
        let (tet, face) = (same[0].tet as usize, same[0].corners);
        if same.len() > 2 {
            return Err(TetMeshError::NonManifoldFace { tet, face, count: same.len() });
        }
        if same.len() == 2 && same[0].flipped == same[1].flipped {
            return Err(TetMeshError::OverlappingTets { tets: [tet, same[1].tet as usize], face });
        }
    }
    Ok(())
}

/// The faces of one tetrahedron only, outwards, in ascending order of their sorted corners.
pub(super) fn boundary(tets: &[[u32; 4]]) -> Vec<[u32; 3]> {
    sorted(tets)
        .chunk_by(|a, b| a.corners == b.corners)
        .filter(|same| same.len() == 1)
        .map(|same| same[0].outward())
        .collect()
}

/// Groups of tetrahedra connected over faces, each ascending, in the order of their first.
pub(super) fn components(tets: &[[u32; 4]]) -> Vec<Vec<usize>> {
    let faces = sorted(tets);
    let pairs = faces.windows(2).filter(|pair| pair[0].corners == pair[1].corners);
    groups(tets.len(), pairs.map(|pair| [pair[0].tet, pair[1].tet]))
}
