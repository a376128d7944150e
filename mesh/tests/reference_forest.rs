//! The forest against its definition: a set of active vertices, from which the mesh is read off
//! by bisecting the roots wherever the midpoint is active, and nothing is kept up to date.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use proptest::prelude::*;
use proptest::sample::Index;
use yawara_mesh::kuhn::{ROOTS_PER_CELL, bisect, midpoint, root_corners};
use yawara_mesh::volume::{Grid, LabelVolume};
use yawara_mesh::{
    BisectionForest, CellGrid, Change, Domain, LabelTree, Lattice, MeshDelta, NodeRef, Point, Tet,
};

/// A tetrahedron by its corners in bisection order.
type Corners = [Point; 4];

/// Level and content.
type Inside = (u8, NodeRef);

/// Split tetrahedra, and leaves.
struct Tets {
    split: BTreeMap<Corners, Inside>,
    leaves: BTreeMap<Corners, Inside>,
}

struct Reference {
    domain: Domain,
    tree: Arc<LabelTree>,
    start_level: u8,
    max_level: u8,
    active: BTreeSet<Point>,
}

impl Reference {
    fn new(forest: &BisectionForest) -> Self {
        let mut reference = Self {
            domain: forest.domain().clone(),
            tree: Arc::clone(forest.tree()),
            start_level: forest.start_level(),
            max_level: forest.max_level(),
            active: BTreeSet::new(),
        };
        // Root vertices, and all of the body's lattice up to the start level's generation.
        let lattice = *reference.domain.lattice();
        let size = |axis: usize| 0..=lattice.cells[axis] as i32 * lattice.units;
        for z in size(2) {
            for y in size(1) {
                for x in size(0) {
                    let p = [x, y, z];
                    let old = lattice.generation(p) <= reference.start_level;
                    if old && reference.domain.contains(p) {
                        reference.active.insert(p);
                    }
                }
            }
        }
        reference
    }

    fn tets(&self) -> Tets {
        let mut tets = Tets { split: BTreeMap::new(), leaves: BTreeMap::new() };
        let lattice = *self.domain.lattice();
        for cell in self.domain.cells() {
            for order in 0..ROOTS_PER_CELL {
                let at = lattice.cell_coordinates(cell);
                let corners = root_corners(at, order, lattice.units);
                self.descend(corners, (0, self.tree.root(cell, order)), &mut tets);
            }
        }
        tets
    }

    fn descend(&self, corners: Corners, (level, node): Inside, tets: &mut Tets) {
        let z = midpoint(&corners, level);
        if level == self.max_level || !self.active.contains(&z) {
            tets.leaves.insert(corners, (level, node));
            return;
        }
        tets.split.insert(corners, (level, node));
        let nodes = self.tree.children(node);
        for (child, node) in bisect(&corners, level, z).into_iter().zip(nodes) {
            self.descend(child, (level + 1, node), tets);
        }
    }

    fn is_ready(&self, p: Point) -> bool {
        let lattice = self.domain.lattice();
        let older = lattice.dependencies(p);
        older.as_slice().iter().all(|q| self.active.contains(q) || !self.domain.contains(*q))
    }

    fn candidates(&self, tets: &Tets) -> Vec<Point> {
        let coarse = tets.leaves.iter().filter(|(_, inside)| inside.0 < self.max_level);
        let points: BTreeSet<Point> = coarse.map(|(c, inside)| midpoint(c, inside.0)).collect();
        let mut points: Vec<Point> = points.into_iter().filter(|&p| self.is_ready(p)).collect();
        points.sort_by_key(|&p| Lattice::key(p));
        points
    }

    fn is_mergeable(&self, p: Point) -> bool {
        let lattice = self.domain.lattice();
        lattice.generation(p) > self.start_level
            && !self.active.iter().any(|&q| lattice.dependencies(q).as_slice().contains(&p))
    }

    /// The tetrahedra that have `p` as their midpoint, among `tets`.
    fn ring(tets: &BTreeMap<Corners, Inside>, p: Point) -> BTreeMap<Corners, Inside> {
        let around = |(c, inside): &(&Corners, &Inside)| midpoint(c, inside.0) == p;
        tets.iter().filter(around).map(|(c, inside)| (*c, *inside)).collect()
    }
}

/// A box of cells of 2^k voxels with random labels, some cells void and so out of the domain.
fn forest(labels: &[u16], start_level: u8, max_level: u8) -> BisectionForest {
    let cells = [2, 2, 1];
    let grid = CellGrid { cells, voxels_per_cell: 2, first_voxel: [0; 3] };
    let volume =
        LabelVolume::new(Grid::centred([4, 4, 2], 1.0), labels.to_vec(), vec![0, 1, 2]).unwrap();
    let tree = LabelTree::new(&volume, grid).unwrap();
    let domain = Domain::of_labels(Lattice::new(cells, max_level), &tree);
    BisectionForest::new(domain, Arc::new(tree), start_level, max_level).unwrap()
}

fn corners(f: &BisectionForest, tet: &Tet) -> Corners {
    tet.vertices.map(|v| f.point(v))
}

fn by_corners(f: &BisectionForest, tets: impl Iterator<Item = Tet>) -> BTreeMap<Corners, Inside> {
    tets.map(|t| (corners(f, &t), (t.level, t.node))).collect()
}

fn assert_same(f: &BisectionForest, reference: &Reference) {
    let tets = reference.tets();
    assert_eq!((f.leaves().count(), f.leaf_count()), (tets.leaves.len(), tets.leaves.len()));
    assert_eq!(by_corners(f, f.leaves()), tets.leaves);
    let numbers: BTreeSet<_> = f.leaves().map(|t| t.id).collect();
    assert_eq!(numbers.len(), tets.leaves.len(), "leaves share a number");
    assert!(numbers.iter().all(|id| id.index() < f.tet_capacity()));
    for tet in f.leaves() {
        let above = tet.level < f.max_level();
        let p = above.then(|| midpoint(&corners(f, &tet), tet.level));
        assert_eq!(f.refinement_point(tet.id), p);
    }
    assert_eq!(f.vertices().map(|v| f.point(v)).collect::<BTreeSet<_>>(), reference.active);
    assert_eq!(f.vertex_count(), reference.active.len());
    let candidates = reference.candidates(&tets);
    assert_eq!(f.candidates(), candidates);
    let mut ring = Vec::new();
    for p in candidates {
        assert!(f.split_ring(p, &mut ring));
        assert_eq!(by_corners(f, ring.drain(..)), Reference::ring(&tets.leaves, p));
    }
    for v in f.vertices() {
        let p = f.point(v);
        assert_eq!(f.generation(v), f.domain().lattice().generation(p));
        assert_eq!(f.is_mergeable(v), reference.is_mergeable(p), "{p:?}");
        if f.merge_ring(v, &mut ring) {
            assert_eq!(by_corners(f, ring.drain(..)), Reference::ring(&tets.split, p));
        }
    }
}

/// The same set of vertices by the shortest way.
fn rebuilt(f: &BisectionForest) -> BisectionForest {
    let (domain, tree) = (f.domain().clone(), Arc::clone(f.tree()));
    let mut fresh = BisectionForest::new(domain, tree, f.start_level(), f.max_level()).unwrap();
    let mut points: Vec<Point> = f.vertices().map(|v| f.point(v)).collect();
    points.sort_by_key(|&p| (f.domain().lattice().generation(p), Lattice::key(p)));
    for p in points {
        if fresh.vertex_at(p).is_none() {
            fresh.split(p, &mut MeshDelta::empty()).unwrap();
        }
    }
    fresh
}

/// What a delta says, in corners and in its order.
fn told(f: &BisectionForest, delta: &MeshDelta) -> Vec<[(Corners, Inside); 3]> {
    let one = |t: &Tet| (corners(f, t), (t.level, t.node));
    let ring = delta.ring.iter();
    ring.map(|t| [one(&t.parent), one(&t.children[0]), one(&t.children[1])]).collect()
}

fn assert_ring_is_bisected(f: &BisectionForest, delta: &MeshDelta, p: Point) {
    let mut ends: Vec<Point> = Vec::new();
    for [(parent, (level, node)), first, second] in told(f, delta) {
        let halves = bisect(&parent, level, p);
        let nodes = f.tree().children(node);
        assert_eq!(first, (halves[0], (level + 1, nodes[0])));
        assert_eq!(second, (halves[1], (level + 1, nodes[1])));
        ends.extend([parent[0], parent[3 - usize::from(level % 3)]]);
    }
    ends.sort_unstable();
    ends.dedup();
    let mut edge = delta.edge.map(|v| f.point(v));
    edge.sort_unstable();
    assert_eq!(ends, edge);
    assert!(delta.edge[0] < delta.edge[1]);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn a_history_of_splits_and_merges_is_the_set_of_its_vertices(
        mut labels in proptest::collection::vec(0..3u16, 32),
        levels in prop_oneof![Just((0, 5)), Just((2, 6)), Just((3, 4)), Just((0, 1)), Just((2, 2))],
        void_cell in any::<bool>(),
        steps in proptest::collection::vec((any::<bool>(), any::<Index>()), 60),
    ) {
        labels[0] = 1;
        if void_cell {
            // The cell [1, 0, 0]: voxels 2 and 3 of the first two rows of both slices.
            for row in [0, 4, 16, 20] {
                labels[row + 2..row + 4].fill(0);
            }
        }
        let mut f = forest(&labels, levels.0, levels.1);
        let mut reference = Reference::new(&f);
        assert_same(&f, &reference);
        let mut delta = MeshDelta::empty();
        for (count, (out, index)) in steps.into_iter().enumerate() {
            let (all, young) = (
                f.candidates(),
                f.vertices().filter(|&v| f.is_mergeable(v)).collect::<Vec<_>>(),
            );
            if (out || all.is_empty()) && !young.is_empty() {
                let v = young[index.index(young.len())];
                let p = f.point(v);
                let before = f.clone();
                f.merge(v, &mut delta).unwrap();
                assert_eq!((delta.change, delta.vertex), (Change::Merge, v));
                assert_ring_is_bisected(&before, &delta, p);
                reference.active.remove(&p);
            } else if !all.is_empty() {
                let p = all[index.index(all.len())];
                let mut fresh = rebuilt(&f);
                let v = f.split(p, &mut delta).unwrap();
                assert_eq!((delta.change, f.point(v)), (Change::Split, p));
                assert_ring_is_bisected(&f, &delta, p);
                reference.active.insert(p);
                // The order of the ring knows no history.
                let mut again = MeshDelta::empty();
                fresh.split(p, &mut again).unwrap();
                assert_eq!(told(&f, &delta), told(&fresh, &again));
            }
            if count % 5 == 0 {
                assert_same(&f, &reference);
            }
        }
        assert_same(&f, &reference);
        f.merge_all().unwrap();
        let start = Reference::new(&f);
        assert_same(&f, &start);
    }
}
