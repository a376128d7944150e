//! Cutting, and closing a cut.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::delta::{CutDelta, Doubled, Part, Recast};
use super::fine::{FineFace, FineTet};
use super::parts::Facing;
use super::record::{Severed, Sheet, Torn};
use super::stars::{Around, PartCorner};
use crate::bisection::BisectionError;
use crate::bisection::delta::{Change, Tet, TetId, VertexId};
use crate::bisection::diamond::{NONE, SLOTS, TetRecord, tet_number, tet_place};
use crate::bisection::forest::{BisectionForest, VertexRecord};
use crate::bisection::kuhn::Point;
use crate::bisection::label_tree::NodeRef;

/// The parts of a leaf that are to be.
struct Parting {
    leaf: u32,
    part_of: Vec<u16>,
    /// By new part the parts that it lies in, or that lie in it, ascending.
    was: Vec<BTreeSet<usize>>,
}

impl BisectionForest {
    /// Severs faces; what was severed before stays so.
    ///
    /// The parts that come apart are the same whatever the order of cuts. The largest around a vertex keeps it, and all
    /// around it that is nothing but void.
    ///
    /// Cost: O(leaves), and O(n log n) for n finest tetrahedra in the leaves around the faces; a copy of the label tree.
    ///
    /// # Errors
    /// [`BisectionError::TooManyNodes`] for contents beyond 2³¹; [`BisectionError::NotALeaf`] for a number that no leaf
    /// has. Then nothing has changed.
    pub fn sever(&mut self, faces: &[Severed]) -> Result<CutDelta, BisectionError> {
        let new = |severed: &&Severed| !self.cuts.severed.contains_key(&severed.face);
        let faces: Vec<Severed> = faces.iter().filter(new).copied().collect();
        let touched = self.are_leaves(faces.iter().flat_map(|severed| severed.leaves))?;
        for Severed { face, leaves } in faces {
            self.cuts.severed.insert(face, leaves.map(|leaf| leaf.0));
        }
        self.cuts.frozen.extend(&touched);
        self.come_apart(&touched)
    }

    /// Gives all that no longer hangs together in these leaves and around them sheets and vertices of its own.
    pub(super) fn come_apart(
        &mut self,
        leaves: &BTreeSet<u32>,
    ) -> Result<CutDelta, BisectionError> {
        let mut delta = CutDelta::empty(Change::Split);
        for &leaf in leaves {
            if let Some(parting) = self.parting(leaf) {
                self.take_apart(parting, &mut delta)?;
            }
        }
        let around = self.around(&self.corners_of(leaves));
        for Around { bodies, .. } in around.into_iter().filter(|around| around.is_cut) {
            self.double(bodies, &mut delta);
        }
        self.drop_contents();
        Ok(delta)
    }

    /// Joins severed faces again; what is not severed stays as it is. All closed, the mesh is what it was before.
    ///
    /// Cost: as [`sever`](Self::sever).
    ///
    /// # Errors
    /// As [`sever`](Self::sever).
    pub fn close(&mut self, faces: &[FineFace]) -> Result<CutDelta, BisectionError> {
        let mut touched = BTreeSet::new();
        for face in faces {
            touched.extend(self.cuts.severed.remove(face).into_iter().flatten());
        }
        let partings: Vec<Parting> =
            touched.iter().filter_map(|&leaf| self.parting(leaf)).collect();
        for &leaf in &touched {
            let tets = self.finest_in(&self.tet(TetId(leaf)));
            let mut faces = tets.iter().flat_map(|tet| tet.faces);
            if !faces.any(|face| self.cuts.severed.contains_key(&face)) {
                self.cuts.frozen.remove(&leaf);
            }
        }
        // From here on parts are those to be, while sheets still are as they were.
        let mut held: BTreeMap<u32, (Torn, Vec<BTreeSet<usize>>)> = BTreeMap::new();
        for Parting { leaf, part_of, was } in partings {
            let Some(torn) = self.cuts.torn.remove(&leaf) else { continue };
            let sheets = vec![NONE; was.len()];
            self.cuts.torn.insert(leaf, Torn { whole: torn.whole, sheets, part_of });
            held.insert(leaf, (torn, was));
        }
        let mut delta = CutDelta::empty(Change::Merge);
        for around in self.around(&self.corners_of(&touched)) {
            let groups = match around.is_cut {
                true => around.bodies,
                false => vec![around.bodies.into_iter().flatten().chain(around.void).collect()],
            };
            for group in groups {
                self.unite(around.point, &group, &held, &mut delta);
            }
        }
        for (leaf, (torn, was)) in held {
            self.put_together(leaf, torn, &was, &mut delta)?;
        }
        self.drop_contents();
        Ok(delta)
    }

    /// The severed faces, in a fixed order.
    pub fn severed(&self) -> impl Iterator<Item = Severed> + '_ {
        let faces = self.cuts.severed.iter();
        faces.map(|(&face, leaves)| Severed { face, leaves: leaves.map(TetId) })
    }

    /// Whether a face is severed.
    pub fn is_severed(&self, face: FineFace) -> bool {
        self.cuts.severed.contains_key(&face)
    }

    /// The leaf whose sheet a tetrahedron is: itself, unless a cut has made it.
    pub fn leaf_of(&self, tet: TetId) -> TetId {
        self.cuts.sheet(tet.0).map_or(tet, |sheet| TetId(sheet.leaf))
    }

    /// Whether a leaf has severed faces in it or on it, or is in several sheets, and so can't be split, nor merged with others.
    pub fn is_frozen(&self, leaf: TetId) -> bool {
        self.cuts.freezes(leaf.0)
    }

    /// The sheet of `leaf` that holds its finest tetrahedron of a number, by the order of
    /// [`finest_in`](Self::finest_in).
    pub fn sheet_with(&self, leaf: TetId, finest: usize) -> TetId {
        let torn = self.cuts.torn(leaf.0);
        torn.map_or(leaf, |torn| TetId(torn.sheets[usize::from(torn.part_of[finest])]))
    }

    /// The numbers of tetrahedra that are to be leaves.
    pub(super) fn are_leaves(
        &self,
        leaves: impl Iterator<Item = TetId>,
    ) -> Result<BTreeSet<u32>, BisectionError> {
        let touched: BTreeSet<u32> = leaves.map(|leaf| leaf.0).collect();
        let is_leaf = |leaf: &u32| {
            let (diamond, slot) = tet_place(*leaf);
            let known = self.diamonds.get(diamond);
            known.is_some_and(|d| d.open_at != NONE && d.members >> slot & 1 != 0)
        };
        match touched.iter().find(|leaf| !is_leaf(leaf)) {
            Some(&tet) => Err(BisectionError::NotALeaf { tet }),
            None => Ok(touched),
        }
    }

    fn corners_of(&self, leaves: &BTreeSet<u32>) -> BTreeSet<Point> {
        leaves
            .iter()
            .flat_map(|&leaf| self.tet(TetId(leaf)).vertices)
            .map(|v| self.point(v))
            .collect()
    }

    /// How the parts of a leaf differ from what its sheets are; none where they don't.
    fn parting(&self, leaf: u32) -> Option<Parting> {
        let fine = self.finest_in(&self.tet(TetId(leaf)));
        // What hangs together in other tetrahedra only is one as long as no cut comes near, unless it is to be apart.
        let is_cut = self.cuts.apart.contains(&leaf)
            || fine.iter().any(|tet| tet.faces.iter().any(|&face| self.is_severed(face)));
        let part_of = match is_cut {
            true => self.facing(leaf, &fine).parts(&fine, |face| self.is_severed(face)),
            false => vec![0; fine.len()],
        };
        let before = self.cuts.torn(leaf).map(|torn| torn.part_of.as_slice());
        if before.map_or(part_of.iter().all(|&part| part == 0), |before| before == part_of) {
            return None;
        }
        let mut was = Vec::new();
        // Void may go with another part without a body's coming apart.
        let bodies = part_of.iter().enumerate().filter(|&(i, _)| fine[i].is_solid());
        for (i, &part) in bodies {
            was.resize(was.len().max(usize::from(part) + 1), BTreeSet::new());
            was[usize::from(part)].insert(before.map_or(0, |before| usize::from(before[i])));
        }
        Some(Parting { leaf, part_of, was })
    }

    /// How the finest tetrahedra in a leaf lie to each other.
    pub(super) fn facing(&self, leaf: u32, fine: &[FineTet]) -> Facing {
        let units = self.finest_units();
        let corners = self.tet(TetId(leaf)).vertices;
        Facing::new(fine, &corners.map(|v| self.point(v).map(|c| c * units)))
    }

    /// Gives each part of a leaf a sheet with the corners of the one that it was in.
    fn take_apart(
        &mut self,
        Parting { leaf, part_of, was }: Parting,
        delta: &mut CutDelta,
    ) -> Result<(), BisectionError> {
        let before = match self.cuts.torn.remove(&leaf) {
            Some(torn) => torn,
            None => {
                let (whole, sheets) = (self.tet(TetId(leaf)).node, vec![leaf]);
                Torn { whole, sheets, part_of: Vec::new() }
            }
        };
        let contents = self.contents(leaf, before.whole, &part_of, was.len(), delta)?;
        self.leave(&before);
        let mut sheets = vec![NONE; was.len()];
        for (old, &number) in before.sheets.iter().enumerate() {
            let whole = self.tet(TetId(number));
            let inside: Vec<usize> =
                (0..was.len()).filter(|&new| was[new].contains(&old)).collect();
            let mut recast = Recast { before: vec![whole], after: Vec::new() };
            for (i, &part) in inside.iter().enumerate() {
                let record = TetRecord { node: contents[part], ..*self.record(TetId(number)) };
                sheets[part] = match i {
                    0 => number,
                    _ => self.new_number(),
                };
                self.put_sheet(leaf, sheets[part], record);
                recast.after.push(record.tet(sheets[part]));
            }
            delta.recast.push(recast);
        }
        self.cuts.torn.insert(leaf, Torn { whole: before.whole, sheets, part_of });
        Ok(())
    }

    /// Has sheets whose parts have become one be one, all corners of which are the same already.
    fn put_together(
        &mut self,
        leaf: u32,
        torn: Torn,
        was: &[BTreeSet<usize>],
        delta: &mut CutDelta,
    ) -> Result<(), BisectionError> {
        let now = self.cuts.torn.get(&leaf);
        let part_of = now.map_or_else(Vec::new, |now| now.part_of.clone());
        let contents = if was.len() > 1 {
            self.contents(leaf, torn.whole, &part_of, was.len(), delta)?
        } else {
            self.cuts.torn.remove(&leaf);
            vec![torn.whole]
        };
        self.leave(&torn);
        for (new, olds) in was.iter().enumerate() {
            let numbers: Vec<u32> = olds.iter().map(|&old| torn.sheets[old]).collect();
            let before: Vec<Tet> = numbers.iter().map(|&number| self.tet(TetId(number))).collect();
            let kept = if numbers.contains(&leaf) { leaf } else { numbers[0] };
            let record = TetRecord { node: contents[new], ..*self.record(TetId(kept)) };
            for number in numbers.into_iter().filter(|&number| number != kept) {
                self.cuts.sheets.remove(&number);
                self.cuts.free_numbers.push(number);
                self.leaf_count -= 1;
            }
            self.put_sheet(leaf, kept, record);
            if let Some(now) = self.cuts.torn.get_mut(&leaf) {
                now.sheets[new] = kept;
            }
            delta.recast.push(Recast { before, after: vec![record.tet(kept)] });
        }
        Ok(())
    }

    /// Notes that a leaf's parts, if it had several, are what they were no longer.
    fn leave(&mut self, torn: &Torn) {
        if torn.sheets.len() > 1 {
            let nodes = torn.sheets.iter().map(|&number| self.tet(TetId(number)).node);
            let nodes: Vec<NodeRef> = nodes.collect();
            self.cuts.left.extend(nodes);
        }
    }

    /// Takes contents that no sheet has any more out of use, once all is done: until then a delta's reader may ask for
    /// them.
    fn drop_contents(&mut self) {
        let tree = Arc::make_mut(&mut self.tree);
        self.cuts.left.drain(..).for_each(|node| tree.drop_part(node));
    }

    /// The contents of the parts of a leaf.
    fn contents(
        &mut self,
        leaf: u32,
        whole: NodeRef,
        part_of: &[u16],
        count: usize,
        delta: &mut CutDelta,
    ) -> Result<Vec<NodeRef>, BisectionError> {
        let tet = self.tet(TetId(leaf));
        let fine = self.finest_of(&tet, whole);
        let units = self.finest_units();
        let corners = tet.vertices.map(|v| self.point(v).map(|c| c * units));
        let tree = Arc::make_mut(&mut self.tree);
        (0..count)
            .map(|part| {
                let holds: Vec<bool> = part_of.iter().map(|&p| usize::from(p) == part).collect();
                let held = fine.iter().zip(&holds).filter(|(_, holds)| **holds);
                let node = tree.add_part(held.map(|(tet, _)| tet.label))?;
                delta.parts.push(Part { node, whole, corners, level: tet.level, holds });
                Ok(node)
            })
            .collect()
    }

    /// Gives all bodies around a point that share a vertex but the largest a vertex of their own.
    fn double(&mut self, bodies: Vec<Vec<PartCorner>>, delta: &mut CutDelta) {
        let mut by_vertex: BTreeMap<VertexId, Vec<Vec<PartCorner>>> = BTreeMap::new();
        for body in bodies {
            by_vertex.entry(self.vertex_of(&body[0])).or_default().push(body);
        }
        for (twin, mut bodies) in by_vertex {
            let volume = |body: &Vec<PartCorner>| body.iter().map(|c| c.volume).sum::<usize>();
            let most = bodies.iter().map(volume).max().unwrap_or(0);
            let largest = bodies.iter().position(|body| volume(body) == most).unwrap_or(0);
            bodies.remove(largest);
            for body in bodies {
                let vertex = self.new_twin(twin);
                let corners = body.iter().map(|c| (self.number_of(c), c.corner)).collect();
                self.hand(corners, [vertex, twin], vertex, delta);
            }
        }
    }

    /// Makes all vertices of a group of corners at a point one.
    fn unite(
        &mut self,
        point: Point,
        group: &[PartCorner],
        held: &BTreeMap<u32, (Torn, Vec<BTreeSet<usize>>)>,
        delta: &mut CutDelta,
    ) {
        let mut corners: Vec<(u32, usize)> = Vec::new();
        for part in group {
            let numbers: Vec<u32> = match held.get(&part.leaf) {
                Some((torn, was)) => was[part.part].iter().map(|&old| torn.sheets[old]).collect(),
                None => vec![self.number_of(part)],
            };
            corners.extend(numbers.into_iter().map(|number| (number, part.corner)));
        }
        let vertex_at =
            |(number, corner): (u32, usize)| self.record(TetId(number)).vertices[corner];
        let vertices: BTreeSet<VertexId> = corners.iter().map(|&c| vertex_at(c)).collect();
        let first = self.vertex_at(point).filter(|v| vertices.contains(v));
        let Some(kept) = first.or(vertices.first().copied()) else { return };
        for gone in vertices.into_iter().filter(|&v| v != kept) {
            let vertex_at =
                |(number, corner): (u32, usize)| self.record(TetId(number)).vertices[corner];
            let own = corners.iter().copied().filter(|&c| vertex_at(c) == gone).collect();
            self.hand(own, [gone, kept], kept, delta);
            self.vertices[gone.index()].alive = false;
            self.free_vertices.push(gone.0);
            self.vertex_count -= 1;
        }
    }

    /// Hands corners to another vertex: one of the two between which they go.
    fn hand(
        &mut self,
        corners: Vec<(u32, usize)>,
        [vertex, twin]: [VertexId; 2],
        to: VertexId,
        delta: &mut CutDelta,
    ) {
        let mut tets = Vec::with_capacity(corners.len());
        for &(number, corner) in &corners {
            let record = self.record_mut(number);
            record.vertices[corner] = vertex;
            tets.push(record.tet(number));
            record.vertices[corner] = to;
        }
        tets.sort_unstable_by_key(|tet| tet.id);
        delta.doubled.push(Doubled { vertex, twin, tets });
    }

    fn number_of(&self, part: &PartCorner) -> u32 {
        self.cuts.torn(part.leaf).map_or(part.leaf, |torn| torn.sheets[part.part])
    }

    fn vertex_of(&self, part: &PartCorner) -> VertexId {
        self.record(TetId(self.number_of(part))).vertices[part.corner]
    }

    fn new_twin(&mut self, of: VertexId) -> VertexId {
        // Of the floor, so that it is never merged by itself.
        let record = VertexRecord { floor: true, ..self.vertices[of.index()] };
        self.vertex_count += 1;
        match self.free_vertices.pop() {
            Some(id) => {
                self.vertices[id as usize] = record;
                VertexId(id)
            }
            None => {
                self.vertices.push(record);
                VertexId(self.vertices.len() as u32 - 1)
            }
        }
    }

    /// A number for a sheet.
    fn new_number(&mut self) -> u32 {
        self.leaf_count += 1;
        if self.cuts.free_numbers.is_empty() {
            let diamond = self.take_diamond([0; 3], 0, self.max_level);
            let numbers = (0..SLOTS).rev().map(|slot| tet_number(diamond, slot));
            self.cuts.free_numbers.extend(numbers);
        }
        self.cuts.free_numbers.pop().unwrap_or(NONE)
    }

    fn put_sheet(&mut self, leaf: u32, number: u32, record: TetRecord) {
        if number == leaf {
            *self.record_mut(leaf) = record;
        } else {
            self.cuts.sheets.insert(number, Sheet { leaf, record });
        }
    }

    fn record_mut(&mut self, number: u32) -> &mut TetRecord {
        if let Some(sheet) = self.cuts.sheets.get_mut(&number) {
            return &mut sheet.record;
        }
        let (diamond, slot) = tet_place(number);
        &mut self.diamonds[diamond].tets[slot]
    }
}

impl CutDelta {
    fn empty(change: Change) -> Self {
        Self { change, recast: Vec::new(), doubled: Vec::new(), parts: Vec::new() }
    }
}
