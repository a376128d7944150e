//! Numbers for the finest vertices of many root cubes that every process finds by itself.

use std::collections::HashMap;
use std::ops::Range;

use yawara_mesh::{Lattice, Point};

/// Not a cube of the body, or a vertex that an earlier cube has.
const NONE: u32 = u32::MAX;

/// The vertices of root cubes along a space-filling curve. A vertex belongs to the first cube on the curve that has it;
/// those of a cube are numbered one after the other. So a share of the curve has a range of the numbers, and the number
/// of any vertex follows from the curve alone, without a message.
pub(crate) struct Numbering {
    dims: [usize; 3],
    units: i32,
    /// Cubes along the curve.
    curve: Vec<[usize; 3]>,
    /// By linear cube number its place on the curve.
    place: Vec<u32>,
    /// By place the number of the first vertex, and all there are.
    first: Vec<u32>,
    /// By place which table tells the vertices of the cube apart.
    table_of: Vec<u32>,
    /// By local point, x fastest, its number among those of the cube, [`NONE`] if an earlier cube has it.
    tables: Vec<Vec<u32>>,
}

impl Numbering {
    /// Of these cubes, of `units` voxels along an edge, on a grid of `dims` cubes. Cost: O(cubes), and a table for each
    /// way in which a cube's neighbours may come before it.
    pub fn new(
        cubes: impl IntoIterator<Item = [usize; 3]>,
        dims: [usize; 3],
        units: usize,
    ) -> Self {
        let mut curve: Vec<[usize; 3]> = cubes.into_iter().collect();
        curve.sort_by_key(|cube| Lattice::key(cube.map(|c| c as i32)));
        let mut place = vec![NONE; dims.iter().product()];
        let linear = |[x, y, z]: [usize; 3]| x + dims[0] * (y + dims[1] * z);
        curve.iter().enumerate().for_each(|(at, &cube)| place[linear(cube)] = at as u32);
        let units = units as i32;
        let mut made = Self {
            dims,
            units,
            place,
            first: vec![0],
            table_of: Vec::new(),
            tables: Vec::new(),
            curve,
        };
        let mut known: HashMap<u32, u32> = HashMap::new();
        let mut owned: Vec<u32> = Vec::new();
        for at in 0..made.curve.len() {
            let before = made.earlier_neighbours(at);
            let table = *known.entry(before).or_insert_with(|| {
                let (table, count) = table(before, units);
                made.tables.push(table);
                owned.push(count);
                made.tables.len() as u32 - 1
            });
            made.table_of.push(table);
            made.first.push(made.first[at] + owned[table as usize]);
        }
        made
    }

    /// Cubes along the curve.
    pub fn curve(&self) -> &[[usize; 3]] {
        &self.curve
    }

    /// Vertices of all cubes.
    pub fn total(&self) -> usize {
        self.first[self.curve.len()] as usize
    }

    /// The numbers of the vertices that belong to a part of the curve.
    pub fn owned(&self, places: Range<usize>) -> Range<usize> {
        self.first[places.start] as usize..self.first[places.end] as usize
    }

    /// Number of a finest vertex of the body, by its voxel corner.
    pub fn number(&self, p: Point) -> u32 {
        let mut first = NONE;
        self.cubes_at(p, |_, place| first = first.min(place));
        let corner = self.curve[first as usize].map(|c| c as i32 * self.units);
        let local = [0, 1, 2].map(|axis| p[axis] - corner[axis]);
        let table = &self.tables[self.table_of[first as usize] as usize];
        self.first[first as usize] + table[index(local, self.units)]
    }

    /// Calls `each` with every cube of the body that has a voxel corner, and its place.
    pub fn cubes_at(&self, p: Point, mut each: impl FnMut([usize; 3], u32)) {
        let sides = [0, 1, 2].map(|axis| {
            let cube = p[axis].div_euclid(self.units);
            (cube - i32::from(p[axis].rem_euclid(self.units) == 0), cube)
        });
        for z in sides[2].0..=sides[2].1 {
            for y in sides[1].0..=sides[1].1 {
                for x in sides[0].0..=sides[0].1 {
                    if let Some((cube, place)) = self.at([x, y, z]) {
                        each(cube, place);
                    }
                }
            }
        }
    }

    /// The voxel corners that belong to a cube, by its place, in the order of their numbers.
    pub fn points(&self, place: usize) -> impl Iterator<Item = Point> + '_ {
        let table = &self.tables[self.table_of[place] as usize];
        let (side, corner) = (self.units + 1, self.curve[place].map(|c| c as i32 * self.units));
        let owned = table.iter().enumerate().filter(|(_, number)| **number != NONE);
        owned.map(move |(at, _)| {
            let at = at as i32;
            [corner[0] + at % side, corner[1] + at / side % side, corner[2] + at / (side * side)]
        })
    }

    /// The voxel corners on the faces of a cube, by its place: all that others may have too.
    pub fn corners(&self, place: usize) -> impl Iterator<Item = Point> + '_ {
        let (units, corner) = (self.units, self.curve[place].map(|c| c as i32 * self.units));
        let on_face = move |p: &Point| p.iter().any(|c| *c == 0 || *c == units);
        let all = (0..=units).flat_map(move |z| (0..=units).map(move |y| (y, z)));
        let all = all.flat_map(move |(y, z)| (0..=units).map(move |x| [x, y, z]));
        all.filter(on_face).map(move |p| [0, 1, 2].map(|axis| corner[axis] + p[axis]))
    }

    /// A cube of the body and its place.
    fn at(&self, cube: [i32; 3]) -> Option<([usize; 3], u32)> {
        let cube = cube.map(|c| usize::try_from(c).unwrap_or(usize::MAX));
        let is_inside = (0..3).all(|axis| cube[axis] < self.dims[axis]);
        let place = is_inside
            .then(|| self.place[cube[0] + self.dims[0] * (cube[1] + self.dims[1] * cube[2])])?;
        (place != NONE).then_some((cube, place))
    }

    /// Which of the 27 cubes around come before it on the curve, a bit each.
    fn earlier_neighbours(&self, at: usize) -> u32 {
        let cube = self.curve[at].map(|c| c as i32);
        let is_earlier = |number: &u32| {
            let offset = offset(*number);
            let other = [0, 1, 2].map(|axis| cube[axis] + offset[axis]);
            self.at(other).is_some_and(|(_, place)| (place as usize) < at)
        };
        (0..27).filter(is_earlier).map(|number| 1 << number).sum()
    }
}

/// One of the 27 steps to a cube or a vertex around.
fn offset(number: u32) -> [i32; 3] {
    let number = number as i32;
    [number % 3 - 1, number / 3 % 3 - 1, number / 9 - 1]
}

/// The number of such a step.
pub(crate) fn step_number([x, y, z]: [i32; 3]) -> u32 {
    (x + 1 + 3 * (y + 1) + 9 * (z + 1)) as u32
}

fn index([x, y, z]: [i32; 3], units: i32) -> usize {
    (x + (units + 1) * (y + (units + 1) * z)) as usize
}

/// The numbers of a cube's vertices where those neighbours come before it, and how many there are.
fn table(earlier: u32, units: i32) -> (Vec<u32>, u32) {
    let mut count = 0;
    let side = 0..=units;
    let mut numbers = Vec::new();
    for z in side.clone() {
        for y in side.clone() {
            for x in side.clone() {
                let is_shared = |number: u32| {
                    let touches = |(&local, step): (&i32, i32)| match step {
                        -1 => local == 0,
                        1 => local == units,
                        _ => true,
                    };
                    earlier >> number & 1 == 1 && [x, y, z].iter().zip(offset(number)).all(touches)
                };
                if (0..27).any(is_shared) {
                    numbers.push(NONE);
                } else {
                    numbers.push(count);
                    count += 1;
                }
            }
        }
    }
    (numbers, count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::{BTreeMap, BTreeSet};

    #[test]
    fn every_vertex_has_one_number_and_every_share_a_range() {
        let dims = [3, 4, 2];
        // Some cubes are missing, two touch in an edge alone.
        let all = (0..24).map(|i| [i % 3, i / 3 % 4, i / 12]);
        let cubes: Vec<[usize; 3]> = all.filter(|c| (c[0] + 2 * c[1] + c[2]) % 5 != 1).collect();
        let numbering = Numbering::new(cubes.iter().copied(), dims, 4);
        assert_eq!(numbering.curve().len(), cubes.len());
        let mut numbers = BTreeMap::new();
        for cube in &cubes {
            for i in 0..125 {
                let local = [i % 5, i / 5 % 5, i / 25];
                let p = [0, 1, 2].map(|axis| 4 * cube[axis] as i32 + local[axis]);
                numbers.insert(p, numbering.number(p));
            }
        }
        let distinct: BTreeSet<u32> = numbers.values().copied().collect();
        assert_eq!(distinct.len(), numbers.len());
        assert_eq!(distinct, (0..numbering.total() as u32).collect());
        let mut next = 0;
        for place in 0..cubes.len() {
            assert_eq!(numbering.owned(place..place + 1).start, next);
            for p in numbering.points(place) {
                assert_eq!(numbers[&p] as usize, next);
                let mut least = u32::MAX;
                numbering.cubes_at(p, |_, place| least = least.min(place));
                assert_eq!(least as usize, place);
                next += 1;
            }
        }
        assert_eq!(next, numbering.total());
    }
}
