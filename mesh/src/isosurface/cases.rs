//! The sixteen cases of a marching tetrahedron, and the cap on a face of the hull.
//!
//! All is combinatorial: which mesh edges the surface crosses and how its triangles turn.

use crate::bisection::VertexId;

/// A surface vertex by the mesh edge that it lies on: the smaller vertex number in the high
/// half. An edge from a vertex to itself is that vertex.
pub(super) type EdgeKey = u64;

/// The key of the edge between two vertices, in either order.
pub(super) fn edge_key(a: VertexId, b: VertexId) -> EdgeKey {
    u64::from(a.0.min(b.0)) << 32 | u64::from(a.0.max(b.0))
}

/// The ends of an edge, ascending.
pub(super) fn edge_of(key: EdgeKey) -> [VertexId; 2] {
    [VertexId((key >> 32) as u32), VertexId(key as u32)]
}

/// An even permutation of the corners for each corner to come first: what follows is the
/// opposite face, turned outwards in a tetrahedron of positive volume.
pub(super) const LED_BY: [[usize; 4]; 4] = [[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]];

/// How the surface cuts a tetrahedron; the permutation of the corners is even.
enum Case {
    /// All corners on one side.
    None,
    /// Only the first corner is inside: one triangle.
    OneInside([usize; 4]),
    /// The first two corners are inside: a quadrilateral.
    TwoInside([usize; 4]),
    /// Only the first corner is outside: one triangle.
    OneOutside([usize; 4]),
}

/// By the mask of the corners inside, corner 0 in the lowest bit.
const CASES: [Case; 16] = [
    Case::None,
    Case::OneInside(LED_BY[0]),
    Case::OneInside(LED_BY[1]),
    Case::TwoInside([0, 1, 2, 3]),
    Case::OneInside(LED_BY[2]),
    Case::TwoInside([0, 2, 3, 1]),
    Case::TwoInside([1, 2, 0, 3]),
    Case::OneOutside(LED_BY[3]),
    Case::OneInside(LED_BY[3]),
    Case::TwoInside([0, 3, 1, 2]),
    Case::TwoInside([1, 3, 2, 0]),
    Case::OneOutside(LED_BY[2]),
    Case::TwoInside([2, 3, 0, 1]),
    Case::OneOutside(LED_BY[1]),
    Case::OneOutside(LED_BY[0]),
    Case::None,
];

/// Appends the triangles inside a tetrahedron of positive volume; their normals point from the
/// corners inside to those outside.
pub(super) fn march(tet: &[VertexId; 4], inside: [bool; 4], triangles: &mut Vec<[EdgeKey; 3]>) {
    let mask = (0..4).fold(0, |mask, i| mask | usize::from(inside[i]) << i);
    let key = |i: usize, j: usize| edge_key(tet[i], tet[j]);
    match CASES[mask] {
        Case::None => {}
        Case::OneInside([i, j, k, l]) => triangles.push([key(i, j), key(i, k), key(i, l)]),
        Case::OneOutside([i, j, k, l]) => triangles.push([key(i, j), key(i, l), key(i, k)]),
        Case::TwoInside([i, j, k, l]) => {
            fan(&mut [key(i, k), key(i, l), key(j, l), key(j, k)], triangles);
        }
    }
}

/// Appends the part of a hull face that is inside: the corners inside and the crossings, as one
/// triangle or two that turn like the face.
pub(super) fn cap(face: &[VertexId; 3], inside: [bool; 3], triangles: &mut Vec<[EdgeKey; 3]>) {
    let mut polygon = [0; 4];
    let mut len = 0;
    let mut push = |key| {
        polygon[len] = key;
        len += 1;
    };
    for i in 0..3 {
        let next = (i + 1) % 3;
        if inside[i] {
            push(edge_key(face[i], face[i]));
        }
        if inside[i] != inside[next] {
            push(edge_key(face[i], face[next]));
        }
    }
    fan(&mut polygon[..len], triangles);
}

/// Splits a polygon into a fan from its smallest key: a choice of the diagonal that no order of
/// the corners changes.
fn fan(polygon: &mut [EdgeKey], triangles: &mut Vec<[EdgeKey; 3]>) {
    let smallest = (0..polygon.len()).min_by_key(|&i| polygon[i]).unwrap_or(0);
    polygon.rotate_left(smallest);
    triangles.extend((2..polygon.len()).map(|i| [polygon[0], polygon[i - 1], polygon[i]]));
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    /// Corners of a tetrahedron of positive volume, in any of its 24 orders that keep the sign.
    const CORNERS: [[f64; 3]; 4] = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]];

    fn midpoint(key: EdgeKey) -> Vector3<f64> {
        let [a, b] = edge_of(key).map(|v| Vector3::from(CORNERS[v.index()]));
        0.5 * (a + b)
    }

    #[test]
    fn every_case_separates_the_corners_and_points_outwards() {
        let tet = [0, 1, 2, 3].map(VertexId);
        for mask in 0..16usize {
            let inside: [bool; 4] = std::array::from_fn(|i| mask >> i & 1 == 1);
            let mut triangles = Vec::new();
            march(&tet, inside, &mut triangles);
            let expected = [0, 1, 2, 1, 0][mask.count_ones() as usize];
            assert_eq!(triangles.len(), expected, "{mask:04b}");
            for triangle in triangles {
                let p = triangle.map(midpoint);
                let normal = (p[1] - p[0]).cross(&(p[2] - p[0]));
                assert!(normal.norm() > 0.0);
                for corner in 0..4 {
                    let height = (Vector3::from(CORNERS[corner]) - p[0]).dot(&normal);
                    assert!(if inside[corner] { height < 0.0 } else { height > 0.0 }, "{mask:04b}");
                }
            }
        }
    }

    #[test]
    fn marched_tetrahedron_with_its_four_caps_is_closed() {
        let tet = [7, 3, 9, 4].map(VertexId);
        for mask in 0..16usize {
            let inside: [bool; 4] = std::array::from_fn(|i| mask >> i & 1 == 1);
            let mut triangles = Vec::new();
            march(&tet, inside, &mut triangles);
            for [_, a, b, c] in LED_BY {
                cap(&[a, b, c].map(|i| tet[i]), [a, b, c].map(|i| inside[i]), &mut triangles);
            }
            let directed: Vec<[EdgeKey; 2]> =
                triangles.iter().flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]).collect();
            assert_eq!(directed.is_empty(), mask == 0);
            for edge in &directed {
                let count = |e: [EdgeKey; 2]| directed.iter().filter(|&&d| d == e).count();
                assert_eq!((count(*edge), count([edge[1], edge[0]])), (1, 1), "{mask:04b}");
            }
        }
    }
}
