//! A part of the fine body, made of cubes: the whole of a component, or a patch of voxels.

use nalgebra::Matrix6;
use yawara_mesh::NodeRef;
use yawara_mesh::kuhn::{Point, ROOTS_PER_CELL, root_corners};

use super::body::FineBody;
use crate::error::EmbedError;

/// Calls its argument with the corners and the elasticity of every finest tetrahedron, in a fixed
/// order.
type Visit<'a> = dyn Fn(&mut dyn FnMut(&[Point; 4], &Matrix6<f64>)) -> Result<(), EmbedError> + 'a;

/// Cubes and what is in them.
pub(super) struct Region<'a> {
    /// The corner of each cube with the smallest coordinates.
    pub cubes: Vec<Point>,
    /// Their edge, in voxels.
    pub units: i32,
    pub visit: &'a Visit<'a>,
}

/// What each voxel of a body's root cubes holds.
pub(crate) struct FineVoxels {
    dims: [i32; 3],
    contents: Vec<Option<NodeRef>>,
}

impl FineVoxels {
    /// # Errors
    /// None of its own.
    pub fn new(body: &FineBody<'_>, cells: &[usize]) -> Result<Self, EmbedError> {
        let grid = body.tree().grid();
        let dims = grid.cells.map(|n| (n * grid.voxels_per_cell) as i32);
        let size = dims.iter().map(|&n| n as usize).product();
        let mut voxels = Self { dims, contents: vec![None; size] };
        for (&cell, root) in cells.iter().flat_map(|c| (0..ROOTS_PER_CELL).map(move |r| (c, r))) {
            body.fold(cell, root, &mut |of, corners, _, halves: Option<[(); 2]>| {
                if let (None, Some(place)) = (halves, voxels.place(low_corner(corners))) {
                    voxels.contents[place] = Some(of);
                }
                Ok(())
            })?;
        }
        Ok(voxels)
    }

    fn place(&self, p: Point) -> Option<usize> {
        let is_inside = (0..3).all(|axis| (0..self.dims[axis]).contains(&p[axis]));
        is_inside.then(|| {
            let [x, y, z] = p.map(|c| c as usize);
            x + self.dims[0] as usize * (y + self.dims[1] as usize * z)
        })
    }

    fn content(&self, p: Point) -> Option<NodeRef> {
        self.contents[self.place(p)?]
    }

    /// The voxels of a cube and of one layer around it, as far as the body goes and they hang
    /// together with the cube by faces.
    fn around(&self, low: Point, size: i32) -> Vec<Point> {
        let reach: Vec<[i32; 2]> =
            (0..3).map(|axis| [low[axis] - 1, low[axis] + size + 1]).collect();
        let width = size as usize + 2;
        let place = |p: Point| {
            let [x, y, z]: [usize; 3] = std::array::from_fn(|i| (p[i] - reach[i][0]) as usize);
            x + width * (y + width * z)
        };
        let mut seen = vec![false; width.pow(3)];
        seen[place(low)] = true;
        let mut found = vec![low];
        let mut next = 0;
        while next < found.len() {
            let p = found[next];
            next += 1;
            for (axis, step) in (0..3).flat_map(|axis| [(axis, -1), (axis, 1)]) {
                let mut q = p;
                q[axis] += step;
                let is_near = (reach[axis][0]..reach[axis][1]).contains(&q[axis]);
                if is_near && !seen[place(q)] && self.content(q).is_some() {
                    seen[place(q)] = true;
                    found.push(q);
                }
            }
        }
        found.sort_unstable();
        found
    }

    /// Calls `solve` with the patch around a cube of `size` voxels.
    pub(super) fn patch<T>(
        &self,
        body: &FineBody<'_>,
        low: Point,
        size: i32,
        solve: impl FnOnce(&Region<'_>) -> Result<T, EmbedError>,
    ) -> Result<T, EmbedError> {
        let cubes = self.around(low, size);
        let voxels = cubes.clone();
        let visit = |visit: &mut dyn FnMut(&[Point; 4], &Matrix6<f64>)| {
            for &voxel in &voxels {
                let Some(content) = self.content(voxel) else { continue };
                // The finest level repeats the pattern of the root cubes.
                let tets = |order| root_corners(voxel.map(|c| c as usize), order, 1);
                let elasticity = body.elasticity(content, &tets(0))?;
                (0..ROOTS_PER_CELL).for_each(|order| visit(&tets(order), &elasticity));
            }
            Ok(())
        };
        solve(&Region { cubes, units: 1, visit: &visit })
    }
}

/// The corner of a tetrahedron's box with the smallest coordinates.
fn low_corner(corners: &[Point; 4]) -> Point {
    std::array::from_fn(|axis| corners.iter().map(|p| p[axis]).min().unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear_tet::Strain;
    use crate::{Material, Materials};
    use yawara_mesh::volume::{Grid, LabelVolume};
    use yawara_mesh::{CellGrid, LabelTree};

    /// The patch of a root cube that is the body holds the tetrahedra that bisection makes.
    #[test]
    fn patches_are_of_the_finest_tetrahedra() {
        let size = 4;
        let labels = (0..64).map(|i| 1 + i % 2).collect();
        let volume = LabelVolume::new(Grid::centred([4; 3], 1.0), labels, vec![0, 1, 2]).unwrap();
        let grid = CellGrid { cells: [1; 3], voxels_per_cell: 4, first_voxel: [0; 3] };
        let tree = LabelTree::new(&volume, grid).unwrap();
        let materials: Materials = vec![Material::new(1.0, 0.3, 0.0).unwrap(); 3].into();
        let body = FineBody::new(&tree, &materials);
        let key = |corners: &[Point; 4]| {
            let mut corners = *corners;
            corners.sort_unstable();
            corners
        };
        let mut want = Vec::new();
        body.visit(0, &mut |corners, _| want.push(key(corners))).unwrap();
        let mut got = Vec::new();
        let voxels = FineVoxels::new(&body, &[0]).unwrap();
        let count = |region: &Region<'_>| {
            (region.visit)(&mut |corners, d| {
                assert!((d * Strain::x())[0] > 1.0);
                got.push(key(corners));
            })
            .map(|()| region.cubes.len())
        };
        let cubes = voxels.patch(&body, [0; 3], size, count).unwrap();
        assert_eq!(cubes, size.pow(3) as usize);
        want.sort_unstable();
        got.sort_unstable();
        assert_eq!(got, want);
    }
}
