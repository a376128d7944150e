//! Kuhn tetrahedra and their bisection: the geometry rules, on plain corner arrays.
//!
//! A tetrahedron is an ordered array of four corners. Roots are the six Kuhn tetrahedra of a
//! cube, reflected in neighbouring cubes so that faces match. At level L, with
//! d = 3 − (L mod 3), the edge (x0, x_d) is bisected at z:
//! child 0 = (x0..x_{d−1}, z, x_{d+1}..x3), child 1 = (x1..x_d, z, x_{d+1}..x3).
//! These are the tetrahedra of Kossaczký's rule (J. Comput. Appl. Math. 55, 1994); shapes
//! cycle through three similarity classes, TYPE0, TYPE1, TYPE2 (Oishi et al., section 3.1.2).

/// A point of the bisection lattice; see [`crate::Lattice`] for its unit.
pub type Point = [i32; 3];

/// The six orders in which a Kuhn tetrahedron walks along the axes.
const AXIS_ORDERS: [[usize; 3]; 6] =
    [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

/// Tetrahedra per root cube.
pub const ROOTS_PER_CELL: usize = 6;

/// The position d of the second end of the bisected edge (x0, x_d) at `level`.
pub fn bisected_corner(level: u8) -> usize {
    3 - usize::from(level % 3)
}

/// Corners of both children of a tetrahedron at `level`, whose bisected edge has midpoint `z`.
///
/// Works on any corner type: lattice points, vertex numbers, positions.
pub fn bisect<T: Copy>(corners: &[T; 4], level: u8, z: T) -> [[T; 4]; 2] {
    let [x0, x1, x2, x3] = *corners;
    match bisected_corner(level) {
        3 => [[x0, x1, x2, z], [x1, x2, x3, z]],
        2 => [[x0, x1, z, x3], [x1, x2, z, x3]],
        _ => [[x0, z, x2, x3], [x1, z, x2, x3]],
    }
}

/// Corners of the tetrahedron at `level` whose [bisection](bisect) made these two.
pub fn unite<T: Copy>([first, second]: &[[T; 4]; 2], level: u8) -> [T; 4] {
    let d = bisected_corner(level);
    std::array::from_fn(|i| if i == d { second[d - 1] } else { first[i] })
}

/// Which faces of the two children lie where a face of the parent lay that is marked in `hull`
/// (bit i: the face opposite corner i). The cut between the children is never marked.
pub fn bisect_hull(hull: u8, level: u8) -> [u8; 2] {
    let d = bisected_corner(level);
    let bit = |i: usize| hull >> i & 1;
    // Child 0 keeps corner i in place i, but z in place d: only its face opposite x0 is new.
    let first = hull & !1;
    // Child 1 has x_{i+1} in place i < d, z in place d: its face opposite x_d is new.
    let second = (0..4).map(|i| match i {
        i if i + 1 < d => bit(i + 1) << i,
        i if i + 1 == d => 0,
        i if i == d => bit(0) << i,
        i => bit(i) << i,
    });
    [first, second.sum()]
}

/// Midpoint of the bisected edge of a tetrahedron at `level`, in lattice coordinates.
///
/// Meaningful only where that edge has even components, i.e. above the lattice's finest level.
pub fn midpoint(corners: &[Point; 4], level: u8) -> Point {
    let (a, b) = (corners[0], corners[bisected_corner(level)]);
    std::array::from_fn(|i| (a[i] + b[i]) / 2)
}

/// Corners of root tetrahedron `order` (0..6) of the cube at `cell`, `units` lattice units wide.
///
/// x0 is the cube's corner with all-even cell coordinates, x3 the all-odd one, so that the
/// diagonals of neighbouring cubes are mirror images (the tiling J1).
pub fn root_corners(cell: [usize; 3], order: usize, units: i32) -> [Point; 4] {
    let mut corners = [[0i32; 3]; 4];
    for axis in 0..3 {
        corners[0][axis] = (cell[axis] + cell[axis] % 2) as i32 * units;
    }
    for (step, &axis) in AXIS_ORDERS[order].iter().enumerate() {
        corners[step + 1] = corners[step];
        corners[step + 1][axis] += if cell[axis].is_multiple_of(2) { units } else { -units };
    }
    corners
}

/// The two cube faces that root tetrahedron `order` lies on, as (axis, steps with the walk from
/// x0 to x3 or against it, corner opposite to the face).
pub fn root_faces(order: usize) -> [(usize, bool, usize); 2] {
    let [first, _, last] = AXIS_ORDERS[order];
    [(first, true, 0), (last, false, 3)]
}

/// Smallest and largest coordinate of a tetrahedron's corners.
pub(crate) fn extent(corners: &[Point; 4], axis: usize) -> [i32; 2] {
    let along = corners.map(|p| p[axis]);
    along.iter().fold([i32::MAX, i32::MIN], |[a, b], &c| [a.min(c), b.max(c)])
}

/// Six times the signed volume of a tetrahedron with lattice corners, in cubic lattice units.
pub fn signed_volume6(c: &[Point; 4]) -> i64 {
    let e = |i: usize, axis: usize| i64::from(c[i][axis]) - i64::from(c[0][axis]);
    e(1, 0) * (e(2, 1) * e(3, 2) - e(2, 2) * e(3, 1))
        - e(1, 1) * (e(2, 0) * e(3, 2) - e(2, 2) * e(3, 0))
        + e(1, 2) * (e(2, 0) * e(3, 1) - e(2, 1) * e(3, 0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn length2(a: Point, b: Point) -> i32 {
        (0..3).map(|i| (a[i] - b[i]).pow(2)).sum()
    }

    /// Calls `visit` on every descendant of the root tetrahedra of a few cells, mirrored ones too.
    fn visit_all(levels: u8, visit: &mut dyn FnMut(&[Point; 4], u8)) {
        fn descend(c: &[Point; 4], level: u8, max: u8, visit: &mut dyn FnMut(&[Point; 4], u8)) {
            visit(c, level);
            if level < max {
                for child in bisect(c, level, midpoint(c, level)) {
                    descend(&child, level + 1, max, visit);
                }
            }
        }
        for cell in [[0, 0, 0], [1, 0, 0], [1, 2, 1]] {
            for order in 0..ROOTS_PER_CELL {
                descend(&root_corners(cell, order, 8), 0, levels, visit);
            }
        }
    }

    #[test]
    fn bisected_edge_is_the_unique_longest() {
        visit_all(8, &mut |c, level| {
            let d = bisected_corner(level);
            let longest = length2(c[0], c[d]);
            for i in 0..4 {
                for j in i + 1..4 {
                    assert!((i, j) == (0, d) || length2(c[i], c[j]) < longest);
                }
            }
        });
    }

    #[test]
    fn volume_halves_exactly_and_orientation_follows_the_rule() {
        visit_all(8, &mut |c, level| {
            let v = signed_volume6(c);
            assert_eq!(v.abs() << level, 8 * 8 * 8);
            let [c0, c1] = bisect(c, level, midpoint(c, level));
            assert_eq!(unite(&[c0, c1], level), *c);
            let sign = if bisected_corner(level).is_multiple_of(2) { 1 } else { -1 };
            assert_eq!(2 * signed_volume6(&c0), v);
            assert_eq!(2 * signed_volume6(&c1), sign * v);
        });
    }
}
