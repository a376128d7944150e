//! What does not hang together from the start.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use rayon::prelude::*;

use super::delta::CutDelta;
use super::fine::FineFace;
use super::parts::Facing;
use crate::bisection::BisectionError;
use crate::bisection::delta::{Tet, TetId};
use crate::bisection::forest::BisectionForest;
use crate::bisection::geometry::FACES;
use crate::bisection::kuhn::Point;
use crate::bisection::refine::Region;

/// Parts of leaves that hang together.
type Body = BTreeSet<Place>;

/// See [`Filled::border`].
type Border = [Vec<(FineFace, u16)>; 4];

/// A part of a leaf: both their numbers.
type Place = (usize, usize);

/// A leaf with material in it, as its neighbours meet it.
struct Filled {
    tet: Tet,
    points: [Point; 4],
    parts: usize,
    /// The place of its first part among all.
    first: usize,
    /// By the corner opposite, the faces of finest tetrahedra with material on its border, each with its part, ascending; none
    /// if all of it is material.
    border: Option<Border>,
}

impl BisectionForest {
    /// Takes apart what hangs together by tetrahedra alone and not by its material, around `unjoined` leaves, which are those
    /// that [`unjoined`](Self::unjoined) finds: parts of one tetrahedron each get
    /// a sheet, and bodies around one vertex each a vertex, as if a cut had been between them. Material hangs together where
    /// finest tetrahedra have a face in common. What hangs together near by stays as it is: bodies around a vertex that are joined
    /// in the tetrahedra around it or around these, unless the same two are at a vertex beside it and not joined near that.
    ///
    /// Leaves in several sheets are not split from then on, nor rings in which one vertex of the edge is several. Done again it
    /// does nothing.
    ///
    /// Cost: O(leaves), and O(n log n) for n finest tetrahedra in leaves with both void and material.
    /// # Source
    /// Nesme, Kry, Jeřábek, Faure, Preserving topology and elasticity for embedded deformable models, ACM TOG 28(3), 2009.
    ///
    /// # Errors
    /// As [`sever`](Self::sever).
    pub fn separate(&mut self, unjoined: &[TetId]) -> Result<CutDelta, BisectionError> {
        let touched = self.are_leaves(unjoined.iter().copied())?;
        self.cuts.apart.extend(&touched);
        self.come_apart(&touched)
    }

    /// The leaves around vertices at which bodies meet that are not joined near by, ascending: those that
    /// [`separate`](Self::separate) takes apart and lets be. Cost: as that.
    pub fn unjoined(&self) -> Vec<TetId> {
        let leaves = self.filled();
        let mut around: BTreeMap<Point, Vec<usize>> = BTreeMap::new();
        for (number, leaf) in leaves.iter().enumerate() {
            leaf.points.iter().for_each(|&p| around.entry(p).or_default().push(number));
        }
        let joined = contacts(&leaves);
        let beside = |p: &Point| around[p].iter().flat_map(|&leaf| leaves[leaf].points);
        // By the points at which several meet, and those points of these near which nothing joins them.
        let mut meeting: BTreeMap<Point, Vec<Body>> = BTreeMap::new();
        let mut loose: BTreeSet<Point> = BTreeSet::new();
        for (&p, here) in &around {
            let at = bodies(&leaves, &joined, here, &here.iter().copied().collect());
            if at.len() < 2 {
                continue;
            }
            meeting.insert(p, at);
            let near = beside(&p).flat_map(|p| around[&p].iter().copied()).collect();
            if bodies(&leaves, &joined, here, &near).len() > 1 {
                loose.insert(p);
            }
        }
        // What is between the same bodies goes on towards where they are joined.
        let ends: Vec<Point> = loose.iter().copied().collect();
        for p in ends {
            let goes_on = |q: &Point| meeting.get(q).is_some_and(|at| are_two(at, &meeting[&p]));
            loose.extend(beside(&p).filter(goes_on));
        }
        let leaves = loose.iter().flat_map(|p| &around[p]).map(|&leaf| leaves[leaf].tet.id);
        leaves.collect::<BTreeSet<TetId>>().into_iter().collect()
    }

    /// Bisects, with closure, the leaves that [`unjoined`](Self::unjoined) finds until they are at `level`, or the mesh would
    /// have more than `max_vertices`. Returns those that it finds then.
    ///
    /// Cost: of [`unjoined`](Self::unjoined) and [`refine_where`](Self::refine_where), as often as leaves are split.
    /// # Errors
    /// As [`refine_where`](Self::refine_where).
    pub fn refine_unjoined(
        &mut self,
        level: u8,
        max_vertices: usize,
    ) -> Result<Vec<TetId>, BisectionError> {
        loop {
            let unjoined = self.unjoined();
            let has = |_: &Self, tet: &Tet| unjoined.binary_search(&tet.id).is_ok();
            if self.refine_where(level, max_vertices, Region::Everywhere, &has)?.added == 0 {
                return Ok(unjoined);
            }
        }
    }

    fn filled(&self) -> Vec<Filled> {
        let with_void = |tet: &Tet| {
            let node = self.cuts.torn(tet.id.0).map_or(tet.node, |torn| torn.whole);
            let labels = self.tree.labels(node);
            (labels.as_slice() != [0]).then(|| labels.as_slice().contains(&0))
        };
        let all: Vec<(Tet, bool)> =
            self.open_members().filter_map(|tet| Some((tet, with_void(&tet)?))).collect();
        let mut facing: BTreeMap<u8, Facing> = BTreeMap::new();
        for (tet, _) in all.iter().filter(|(_, with_void)| *with_void) {
            let of_level = || self.facing(tet.id.0, &self.finest_in(tet));
            facing.entry(tet.level).or_insert_with(of_level);
        }
        let filled = |&(tet, with_void): &(Tet, bool)| {
            let whole = (1, None);
            let facing = facing.get(&tet.level).filter(|_| with_void);
            let (parts, border) = facing.map_or(whole, |facing| self.border(&tet, facing));
            let points = tet.vertices.map(|v| self.point(v));
            Filled { tet, points, parts, first: 0, border }
        };
        let mut leaves: Vec<Filled> = all.par_iter().map(filled).collect();
        let mut first = 0;
        for leaf in &mut leaves {
            leaf.first = first;
            first += leaf.parts;
        }
        leaves
    }

    /// How many parts a leaf's material is in, and its [`Filled::border`].
    fn border(&self, leaf: &Tet, facing: &Facing) -> (usize, Option<Border>) {
        let fine = self.finest_in(leaf);
        let part_of = facing.solid_parts(&fine, |_| false);
        let border = facing.outer.each_ref().map(|side| {
            let face = |&(i, face): &(u32, usize)| {
                Some((fine[i as usize].faces[face], part_of[i as usize]?))
            };
            let mut faces: Vec<(FineFace, u16)> = side.iter().filter_map(face).collect();
            faces.sort_unstable();
            faces
        });
        let last = part_of.iter().flatten().max();
        (last.map_or(1, |&last| usize::from(last) + 1), Some(border))
    }
}

/// The parts that each part of each leaf has material in common with in a face, by [`Filled::first`].
fn contacts(leaves: &[Filled]) -> Vec<Vec<Place>> {
    let count = leaves.iter().map(|leaf| leaf.parts).sum();
    let mut found = vec![Vec::new(); count];
    let mut open: HashMap<[Point; 3], (usize, usize)> = HashMap::new();
    for (number, leaf) in leaves.iter().enumerate() {
        for (side, face) in FACES.into_iter().enumerate() {
            let mut face = face.map(|i| leaf.points[i]);
            face.sort_unstable();
            let Some((other, of_other)) = open.remove(&face) else {
                open.insert(face, (number, side));
                continue;
            };
            for [a, b] in joined([(&leaves[other], of_other), (leaf, side)]) {
                found[leaves[other].first + a].push((number, b));
                found[leaf.first + b].push((other, a));
            }
        }
    }
    found
}

/// The bodies that the material in leaves `of` is in, as far as contacts inside of leaves `within` join it.
fn bodies(
    leaves: &[Filled],
    contacts: &[Vec<Place>],
    of: &[usize],
    within: &BTreeSet<usize>,
) -> Vec<Body> {
    let mut reached: BTreeSet<Place> = BTreeSet::new();
    let mut found = Vec::new();
    for begin in of.iter().flat_map(|&leaf| (0..leaves[leaf].parts).map(move |part| (leaf, part))) {
        let (mut next, mut body) = (vec![begin], Body::new());
        while let Some((leaf, part)) = next.pop() {
            if reached.insert((leaf, part)) {
                body.insert((leaf, part));
                let beside = contacts[leaves[leaf].first + part].iter().copied();
                next.extend(beside.filter(|(leaf, _)| within.contains(leaf)));
            }
        }
        found.extend((!body.is_empty()).then_some(body));
    }
    found
}

/// Whether two of some bodies are two of others.
fn are_two(some: &[Body], others: &[Body]) -> bool {
    let same = |body: &Body| others.iter().position(|other| !other.is_disjoint(body));
    let all: BTreeSet<usize> = some.iter().filter_map(same).collect();
    all.len() > 1
}

/// The parts of two leaves that have material in common in the face that they share, given by its opposite corners.
fn joined([(a, of_a), (b, of_b)]: [(&Filled, usize); 2]) -> BTreeSet<[usize; 2]> {
    let part = |one: &(FineFace, u16)| usize::from(one.1);
    match (&a.border, &b.border) {
        (None, None) => BTreeSet::from([[0, 0]]),
        (Some(border), None) => border[of_a].iter().map(|one| [part(one), 0]).collect(),
        (None, Some(border)) => border[of_b].iter().map(|one| [0, part(one)]).collect(),
        (Some(first), Some(second)) => {
            let second = &second[of_b];
            let same = |one: &(FineFace, u16)| {
                let at = second.binary_search_by_key(&one.0, |other| other.0).ok()?;
                Some([part(one), part(&second[at])])
            };
            first[of_a].iter().filter_map(same).collect()
        }
    }
}
