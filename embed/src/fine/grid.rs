//! Numbers of the finest vertices of a group of cubes.

use yawara_mesh::kuhn::Point;

/// Not a vertex of the group.
const NONE: u32 = u32::MAX;

/// The voxel corners of some cubes, numbered x fastest, then y, then z.
pub(crate) struct FineGrid {
    low: Point,
    dims: [usize; 3],
    number: Vec<u32>,
    points: Vec<Point>,
}

impl FineGrid {
    /// The vertices of some cubes of edge `units`, given by their corners of smallest coordinates.
    pub fn new(cubes: &[Point], units: i32) -> Self {
        let (mut low, mut high) = ([i32::MAX; 3], [0; 3]);
        for p in cubes {
            for axis in 0..3 {
                low[axis] = low[axis].min(p[axis]);
                high[axis] = high[axis].max(p[axis] + units);
            }
        }
        let dims: [usize; 3] = std::array::from_fn(|i| (high[i] - low[i] + 1).max(0) as usize);
        let mut grid =
            Self { low, dims, number: vec![NONE; dims.iter().product()], points: Vec::new() };
        for p in cubes {
            for z in p[2]..=p[2] + units {
                for y in p[1]..=p[1] + units {
                    let first = grid.place([p[0], y, z]);
                    grid.number[first..=first + units as usize].fill(0);
                }
            }
        }
        grid.count();
        grid
    }

    fn count(&mut self) {
        let [nx, ny, _] = self.dims;
        for (place, number) in self.number.iter_mut().enumerate().filter(|(_, n)| **n != NONE) {
            *number = self.points.len() as u32;
            let local = [place % nx, place / nx % ny, place / (nx * ny)];
            self.points.push(std::array::from_fn(|i| self.low[i] + local[i] as i32));
        }
    }

    fn place(&self, p: Point) -> usize {
        let [x, y, z]: [usize; 3] = std::array::from_fn(|i| (p[i] - self.low[i]) as usize);
        x + self.dims[0] * (y + self.dims[1] * z)
    }

    /// Number of the vertex at a point of the group.
    pub fn vertex(&self, p: Point) -> usize {
        self.number[self.place(p)] as usize
    }

    pub fn point(&self, vertex: usize) -> Point {
        self.points[vertex]
    }

    /// All of them, by number.
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Vertices in an order of elimination with little fill-in: the halves of the box, each in
    /// such an order, then the plane between them, for voxels couple no further.
    pub fn elimination_order(&self) -> Vec<usize> {
        let mut order = Vec::with_capacity(self.len());
        dissect(&self.points, (0..self.len()).collect(), &mut order);
        order
    }
}

/// Groups of this many vertices are not worth cutting.
const LEAF: usize = 12;

fn dissect(points: &[Point], group: Vec<usize>, order: &mut Vec<usize>) {
    let extent = |axis: usize| {
        let along = group.iter().map(|&v| points[v][axis]);
        along.fold([i32::MAX, i32::MIN], |[a, b], c| [a.min(c), b.max(c)])
    };
    let extents = [0, 1, 2].map(extent);
    let axis = (0..3).max_by_key(|&i| i64::from(extents[i][1]) - i64::from(extents[i][0]));
    let (Some(axis), true) = (axis, group.len() > LEAF) else {
        return order.extend(group);
    };
    let plane = (extents[axis][0] + extents[axis][1]) / 2;
    let part = |keep: fn(i32, i32) -> bool| -> Vec<usize> {
        group.iter().copied().filter(|&v| keep(points[v][axis], plane)).collect()
    };
    let parts = [part(|c, plane| c < plane), part(|c, plane| c > plane)];
    let between = part(|c, plane| c == plane);
    for part in parts.into_iter().filter(|part| !part.is_empty()) {
        dissect(points, part, order);
    }
    order.extend(between);
}
