//! What hangs together around a vertex.

use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet, HashMap};

use super::fine::{FineFace, FineTet};
use crate::bisection::delta::Tet;
use crate::bisection::forest::BisectionForest;
use crate::bisection::geometry::FACES;
use crate::bisection::kuhn::Point;
use crate::union_find::groups;

/// A corner of one part of a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PartCorner {
    pub leaf: u32,
    pub part: usize,
    pub corner: usize,
    /// Finest tetrahedra in the part.
    pub volume: usize,
}

/// Around one point, the corners that have to be one vertex.
#[derive(Clone, Debug)]
pub(super) struct Around {
    pub point: Point,
    /// Each hangs together and has material, in an order that does not depend on history.
    pub bodies: Vec<Vec<PartCorner>>,
    /// The corners of leaves that hold nothing but void: these hold nothing together.
    pub void: Vec<PartCorner>,
    /// Whether a cut comes near: if not, all is one vertex, however it hangs together.
    pub is_cut: bool,
}

/// A leaf around the points.
struct StarLeaf {
    tet: Tet,
    points: [Point; 4],
    parts: usize,
    is_void: bool,
    /// The place of its first part's first corner among all.
    first: usize,
    finest: OnceCell<Finest>,
}

struct Finest {
    tets: Vec<FineTet>,
    by_face: HashMap<FineFace, usize>,
}

impl BisectionForest {
    /// The leaves that have one of the points as a corner, each once. Cost: O(leaves).
    fn star(&self, points: &BTreeSet<Point>) -> Vec<StarLeaf> {
        let mut star: Vec<StarLeaf> = Vec::new();
        for tet in self.open_members() {
            let corners = tet.vertices.map(|v| self.point(v));
            if corners.iter().any(|p| points.contains(p)) {
                let torn = self.cuts.torn(tet.id.0);
                let node = torn.map_or(tet.node, |torn| torn.whole);
                star.push(StarLeaf {
                    tet,
                    points: corners,
                    parts: torn.map_or(1, |torn| torn.sheets.len()),
                    is_void: self.tree.labels(node).as_slice() == [0],
                    first: 0,
                    finest: OnceCell::new(),
                });
            }
        }
        // Whatever their numbers.
        star.sort_unstable_by_key(|leaf| sorted(leaf.points));
        let mut first = 0;
        for leaf in &mut star {
            leaf.first = first;
            first += 4 * leaf.parts;
        }
        star
    }

    /// What hangs together around each of `points`.
    ///
    /// Cost: O(leaves), and O(finest tetrahedra) of those around the points that a cut touches.
    pub(super) fn around(&self, points: &BTreeSet<Point>) -> Vec<Around> {
        let star = self.star(points);
        let (mut pairs, mut cut) = (Vec::new(), BTreeSet::new());
        let mut open: HashMap<[Point; 3], usize> = HashMap::new();
        for (number, leaf) in star.iter().enumerate() {
            if leaf.parts > 1 {
                cut.extend(leaf.points);
            }
            for face in FACES {
                let face = sorted(face.map(|i| leaf.points[i]));
                if !face.iter().any(|p| points.contains(p)) {
                    continue;
                }
                let Some(other) = open.remove(&face) else {
                    open.insert(face, number);
                    continue;
                };
                let (joined, is_severed) = self.contact(&star[other], leaf);
                if is_severed {
                    cut.extend(face);
                }
                for [a, b] in joined {
                    pairs.extend(
                        face.iter()
                            .map(|p| [star[other].place(a, p) as u32, leaf.place(b, p) as u32]),
                    );
                }
            }
        }
        // What has nothing on its other side can be apart from the rest around a point without a face between them.
        let lone = open.iter().filter(|&(_, &number)| self.is_apart(&star[number]));
        cut.extend(lone.flat_map(|(face, _)| *face));
        let mut found: BTreeMap<Point, Around> = points
            .iter()
            .map(|&point| {
                let is_cut = cut.contains(&point);
                (point, Around { point, bodies: Vec::new(), void: Vec::new(), is_cut })
            })
            .collect();
        let owners: Vec<usize> = (0..star.len()).flat_map(|i| vec![i; 4 * star[i].parts]).collect();
        for group in groups(owners.len(), pairs.into_iter()) {
            let leaf = &star[owners[group[0]]];
            let point = leaf.points[(group[0] - leaf.first) % 4];
            let Some(around) = found.get_mut(&point) else { continue };
            let corners = group.iter().map(|&place| self.part_corner(&star[owners[place]], place));
            match leaf.is_void {
                true => around.void.extend(corners),
                false => around.bodies.push(corners.collect()),
            }
        }
        found.into_values().collect()
    }

    fn part_corner(&self, leaf: &StarLeaf, place: usize) -> PartCorner {
        let (part, corner) = ((place - leaf.first) / 4, (place - leaf.first) % 4);
        let number = leaf.tet.id.0;
        let volume = match self.cuts.torn(number) {
            Some(torn) => torn.part_of.iter().filter(|&&p| usize::from(p) == part).count(),
            None => 1 << (self.finest_level() - leaf.tet.level),
        };
        PartCorner { leaf: number, part, corner, volume }
    }

    /// Which parts of two leaves hold together through the face that they share, and whether it is severed somewhere.
    fn contact(&self, a: &StarLeaf, b: &StarLeaf) -> (BTreeSet<[usize; 2]>, bool) {
        if a.is_void || b.is_void {
            return (BTreeSet::new(), self.is_apart(a) || self.is_apart(b));
        }
        let is_whole = a.parts == 1 && b.parts == 1;
        let marks = |leaf: &StarLeaf| self.cuts.marks(leaf.tet.id.0);
        if is_whole && !(marks(a) && marks(b)) {
            return (BTreeSet::from([[0, 0]]), false);
        }
        let (fine_a, fine_b) = (self.finest(a), self.finest(b));
        let (mut joined, mut is_severed) = (BTreeSet::new(), false);
        for (face, &i) in &fine_a.by_face {
            let Some(&j) = fine_b.by_face.get(face) else { continue };
            if self.cuts.severed.contains_key(face) {
                is_severed = true;
            } else if fine_a.tets[i].is_solid() && fine_b.tets[j].is_solid() {
                joined.insert([self.part(a, i), self.part(b, j)]);
            }
        }
        let are_apart = joined.is_empty() && self.is_apart(a) && self.is_apart(b);
        if is_whole && !is_severed && !are_apart {
            joined.insert([0, 0]);
        }
        (joined, is_severed || are_apart)
    }

    /// Whether a leaf joins nothing but by material.
    fn is_apart(&self, leaf: &StarLeaf) -> bool {
        self.cuts.apart.contains(&leaf.tet.id.0)
    }

    fn finest<'a>(&self, leaf: &'a StarLeaf) -> &'a Finest {
        leaf.finest.get_or_init(|| {
            let tets = self.finest_in(&leaf.tet);
            let faces = tets.iter().enumerate();
            let by_face = faces.flat_map(|(i, tet)| tet.faces.map(|face| (face, i))).collect();
            Finest { tets, by_face }
        })
    }

    fn part(&self, leaf: &StarLeaf, finest: usize) -> usize {
        self.cuts.torn(leaf.tet.id.0).map_or(0, |torn| usize::from(torn.part_of[finest]))
    }
}

impl StarLeaf {
    /// The place of the corner of a part at a point.
    fn place(&self, part: usize, at: &Point) -> usize {
        let corner = self.points.iter().position(|p| p == at).unwrap_or_default();
        self.first + 4 * part + corner
    }
}

fn sorted<const N: usize>(mut points: [Point; N]) -> [Point; N] {
    points.sort_unstable();
    points
}
