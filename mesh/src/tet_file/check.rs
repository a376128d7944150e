//! What must hold for a list of tetrahedra to be a mesh, and the repairs that are safe.

use nalgebra::Vector3;

use super::error::TetMeshError;
use crate::bisection::geometry::{edge_lengths, signed_volume};

/// A tetrahedron is degenerate if |V| is at most this part of its longest edge cubed.
///
/// A regular one has √2/12 ≈ 0.118; round-off of V in f64 is some 1e-16.
pub const FLATNESS: f64 = 1e-12;

/// u32::MAX stays free as a mark.
const LIMIT: usize = u32::MAX as usize;

pub(super) fn lists(
    points: &[Vector3<f64>],
    tets: &[[u32; 4]],
    tags: &[i64],
) -> Result<(), TetMeshError> {
    if tets.is_empty() {
        return Err(TetMeshError::NoTets);
    }
    for (what, count) in [("points", points.len()), ("tets", tets.len())] {
        if count > LIMIT {
            return Err(TetMeshError::TooMany { what, count, limit: LIMIT });
        }
    }
    if tags.len() != tets.len() {
        let (found, want) = (tags.len(), tets.len());
        return Err(TetMeshError::ListLength { what: "tags".into(), found, want });
    }
    finite(points)?;
    for (tet, corners) in tets.iter().enumerate() {
        if let Some(&corner) = corners.iter().find(|&&c| c as usize >= points.len()) {
            return Err(TetMeshError::CornerOutOfRange { tet, corner, count: points.len() });
        }
        for i in 1..4 {
            if corners[..i].contains(&corners[i]) {
                return Err(TetMeshError::RepeatedCorner { tet, corner: corners[i] });
            }
        }
    }
    Ok(())
}

pub(super) fn finite(points: &[Vector3<f64>]) -> Result<(), TetMeshError> {
    for (index, point) in points.iter().enumerate() {
        if let Some(&value) = point.iter().find(|c| !c.is_finite()) {
            return Err(TetMeshError::NotFinite { what: "point".into(), index, value });
        }
    }
    Ok(())
}

/// Makes all volumes positive and says how many were not.
pub(super) fn rewind(
    points: &[Vector3<f64>],
    tets: &mut [[u32; 4]],
) -> Result<usize, TetMeshError> {
    let mut rewound = 0;
    for (tet, corners) in tets.iter_mut().enumerate() {
        let x = corners.map(|i| points[i as usize]);
        let volume = signed_volume(&x);
        let limit = FLATNESS * edge_lengths(&x).fold(0.0, f64::max).powi(3);
        // NaN, of coordinates so large that they overflow, is refused too.
        if !(volume.abs() > limit) {
            return Err(TetMeshError::DegenerateTet { tet, volume, limit });
        }
        if volume < 0.0 {
            corners.swap(2, 3);
            rewound += 1;
        }
    }
    Ok(rewound)
}

/// Takes out the points that no tetrahedron uses and renumbers the corners.
pub(super) fn drop_unused(points: Vec<Vector3<f64>>, tets: &mut [[u32; 4]]) -> Vec<Vector3<f64>> {
    let mut numbers = vec![u32::MAX; points.len()];
    for &corner in tets.as_flattened() {
        numbers[corner as usize] = 0;
    }
    let mut kept = Vec::with_capacity(points.len());
    for (number, point) in numbers.iter_mut().zip(points) {
        if *number == 0 {
            *number = kept.len() as u32;
            kept.push(point);
        }
    }
    for corner in tets.as_flattened_mut() {
        *corner = numbers[*corner as usize];
    }
    kept
}
