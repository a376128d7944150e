//! Cuts: what comes apart is what the severed faces part, in any order, and closing them undoes it.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;

use proptest::prelude::*;
use proptest::sample::Index;
use yawara_mesh::volume::{Grid, LabelVolume};
use yawara_mesh::{
    BisectionForest, CellGrid, Change, Domain, FineFace, FineTet, LabelTree, Lattice, MeshDelta,
    Point, Recast, Tet, TetId, VertexId,
};
use yawara_tests::cuts::{Cut, by_plane, cuts, parted};

/// Voxels along a root cube's edge: finest tetrahedra of level 6.
const VOXELS: usize = 4;

fn forest(cells: [usize; 3], labels: Vec<u16>, start: u8, max: u8) -> BisectionForest {
    let dims = cells.map(|n| n * VOXELS);
    let values = (0..=i64::from(labels.iter().copied().max().unwrap())).collect();
    let volume = LabelVolume::new(Grid::centred(dims, 1.0), labels, values).unwrap();
    let grid = CellGrid { cells, voxels_per_cell: VOXELS, first_voxel: [0; 3] };
    let tree = Arc::new(LabelTree::new(&volume, grid).unwrap());
    let domain = Domain::of_labels(Lattice::new(cells, max), &tree);
    BisectionForest::new(domain, tree, start, max).unwrap()
}

fn solid(cells: [usize; 3]) -> Vec<u16> {
    vec![1; cells.iter().map(|n| n * VOXELS).product()]
}

type Sheet = ([Point; 4], Vec<bool>);

/// Every sheet by what it holds, with its corners numbered in the order in which they come.
fn shape(forest: &BisectionForest) -> Vec<(Sheet, [usize; 4])> {
    let mut sheets: Vec<(Sheet, Tet)> = forest
        .leaves()
        .map(|tet| {
            let count = 1 << (forest.finest_level() - tet.level);
            let leaf = forest.leaf_of(tet.id);
            let holds = (0..count).map(|i| forest.sheet_with(leaf, i) == tet.id).collect();
            ((tet.vertices.map(|v| forest.point(v)), holds), tet)
        })
        .collect();
    sheets.sort_by(|a, b| a.0.cmp(&b.0));
    let mut numbers = HashMap::new();
    sheets
        .into_iter()
        .map(|(sheet, tet)| {
            let number = tet.vertices.map(|v| {
                let next = numbers.len();
                *numbers.entry(v).or_insert(next)
            });
            (sheet, number)
        })
        .collect()
}

fn is_void(forest: &BisectionForest, leaf: &Tet) -> bool {
    forest.finest_in(leaf).iter().all(|fine| !fine.is_solid())
}

/// Two corners of solid sheets at a point are one vertex if and only if a chain of contacts around it joins them.
/// Written from the definition, pair by pair.
fn check_definition(forest: &BisectionForest) {
    let sheets: Vec<Tet> = forest.leaves().collect();
    let fine: BTreeMap<TetId, _> = sheets
        .iter()
        .map(|tet| {
            let leaf = forest.leaf_of(tet.id);
            let all = forest.finest_in(tet).into_iter().enumerate();
            let own = all.filter(|&(i, _)| forest.sheet_with(leaf, i) == tet.id);
            (tet.id, own.map(|(_, fine)| fine).collect::<Vec<_>>())
        })
        .collect();
    let points = |tet: &Tet| tet.vertices.map(|v| forest.point(v));
    let mut cut_points = BTreeSet::new();
    let mut joined: Vec<(usize, usize, Vec<Point>)> = Vec::new();
    for (i, a) in sheets.iter().enumerate() {
        if forest.sheet_with(forest.leaf_of(a.id), 0) != a.id || forest.leaf_of(a.id) != a.id {
            cut_points.extend(points(a));
        }
        for (j, b) in sheets.iter().enumerate().take(i) {
            let shared: Vec<Point> =
                points(a).into_iter().filter(|p| points(b).contains(p)).collect();
            if shared.len() != 3 || is_void(forest, a) || is_void(forest, b) {
                continue;
            }
            let of_b: BTreeMap<FineFace, bool> = fine[&b.id]
                .iter()
                .flat_map(|fine| fine.faces.map(|face| (face, fine.is_solid())))
                .collect();
            let both = fine[&a.id].iter().flat_map(|fine| {
                let of_b = &of_b;
                let face =
                    move |face| of_b.get(&face).map(|solid| (face, fine.is_solid() && *solid));
                fine.faces.into_iter().filter_map(face)
            });
            let both: Vec<(FineFace, bool)> = both.collect();
            let is_cut = both.iter().any(|(face, _)| forest.is_severed(*face));
            if is_cut {
                cut_points.extend(&shared);
            }
            let is_whole = [a, b]
                .iter()
                .all(|tet| fine[&tet.id].len() == 1 << (forest.finest_level() - tet.level));
            let holds = |&(face, solid): &(FineFace, bool)| solid && !forest.is_severed(face);
            if both.iter().any(holds) || (is_whole && !is_cut) {
                joined.push((i, j, shared));
            }
        }
    }
    for p in forest.vertices().map(|v| forest.point(v)).collect::<BTreeSet<_>>() {
        let here: Vec<usize> =
            (0..sheets.len()).filter(|&i| points(&sheets[i]).contains(&p)).collect();
        let vertex = |i: usize| {
            let corner = points(&sheets[i]).iter().position(|q| *q == p).unwrap();
            sheets[i].vertices[corner]
        };
        if !cut_points.contains(&p) {
            assert!(here.iter().all(|&i| vertex(i) == vertex(here[0])), "{p:?} needs no cut");
            continue;
        }
        let solid: Vec<usize> =
            here.into_iter().filter(|&i| !is_void(forest, &sheets[i])).collect();
        let mut group: BTreeMap<usize, usize> = solid.iter().map(|&i| (i, i)).collect();
        for _ in 0..solid.len() {
            for (i, j, shared) in joined.iter().filter(|(_, _, shared)| shared.contains(&p)) {
                let least = group[i].min(group[j]);
                assert!(shared.len() == 3);
                group.insert(*i, least);
                group.insert(*j, least);
            }
        }
        for (&i, &j) in solid.iter().flat_map(|i| solid.iter().map(move |j| (i, j))) {
            assert_eq!(vertex(i) == vertex(j), group[&i] == group[&j], "{p:?}: {i} and {j}");
        }
    }
    for tet in &sheets {
        let held: BTreeSet<u16> = fine[&tet.id].iter().map(|fine| fine.label).collect();
        let labels = forest.tree().labels(tet.node).as_slice().to_vec();
        assert_eq!(labels, held.into_iter().collect::<Vec<_>>(), "{:?}", tet.id);
    }
    assert_eq!(forest.vertices().count(), forest.vertex_count());
    assert_eq!(sheets.len(), forest.leaf_count());
    let used: BTreeSet<_> = sheets.iter().flat_map(|tet| tet.vertices).collect();
    assert!(forest.vertices().eq(used), "vertices without a tetrahedron");
}

/// What a delta says about the mesh before leads to the mesh after.
fn replay(before: BTreeMap<TetId, Tet>, delta: &yawara_mesh::CutDelta) -> BTreeMap<TetId, Tet> {
    let mut mesh = before;
    let recast = |mesh: &mut BTreeMap<TetId, Tet>| {
        for Recast { before, after } in &delta.recast {
            for tet in before {
                assert_eq!(mesh.remove(&tet.id), Some(*tet));
                assert_eq!(tet.vertices, after[0].vertices);
            }
            after.iter().for_each(|tet| assert!(mesh.insert(tet.id, *tet).is_none()));
        }
    };
    if delta.change == Change::Split {
        recast(&mut mesh);
    }
    for doubled in &delta.doubled {
        for tet in &doubled.tets {
            let other = tet.vertices.map(|v| if v == doubled.vertex { doubled.twin } else { v });
            let other = Tet { vertices: other, ..*tet };
            let [old, new] = match delta.change {
                Change::Split => [other, *tet],
                Change::Merge => [*tet, other],
            };
            assert_eq!(mesh.insert(tet.id, new), Some(old));
        }
    }
    if delta.change == Change::Merge {
        recast(&mut mesh);
    }
    mesh
}

fn leaves(forest: &BisectionForest) -> BTreeMap<TetId, Tet> {
    forest.leaves().map(|tet| (tet.id, tet)).collect()
}

/// Each tetrahedron with the least vertex to which chains of tetrahedra by vertices lead.
fn by_vertices(tets: Vec<Tet>) -> Vec<(Tet, VertexId)> {
    let mut least: BTreeMap<VertexId, VertexId> =
        tets.iter().flat_map(|tet| tet.vertices).map(|v| (v, v)).collect();
    let mut before = BTreeMap::new();
    while before != least {
        before = least.clone();
        for tet in &tets {
            let first = tet.vertices.iter().map(|v| least[v]).min().unwrap();
            least.extend(tet.vertices.map(|v| (v, first)));
        }
    }
    tets.into_iter().map(|tet| (tet, least[&tet.vertices[0]])).collect()
}

/// For each voxel that is not void the first one to which chains of voxels by faces lead.
fn by_faces(dims: [usize; 3], labels: &[u16]) -> Vec<Option<usize>> {
    let mut first: Vec<Option<usize>> =
        labels.iter().enumerate().map(|(i, label)| (*label > 0).then_some(i)).collect();
    let steps = [1, dims[0], dims[0] * dims[1]];
    let mut before = Vec::new();
    while before != first {
        before.clone_from(&first);
        for i in 0..labels.len() {
            let at = [i % dims[0], i / dims[0] % dims[1], i / steps[2]];
            for axis in (0..3).filter(|&axis| at[axis] + 1 < dims[axis]) {
                let pair = [i, i + steps[axis]];
                if let [Some(a), Some(b)] = pair.map(|voxel| first[voxel]) {
                    pair.iter().for_each(|&voxel| first[voxel] = Some(a.min(b)));
                }
            }
        }
    }
    first
}

/// Chains of tetrahedra by vertices join just the voxels that `joined` gives one number.
fn check_bodies(
    forest: &BisectionForest,
    dims: [usize; 3],
    joined: &[Option<usize>],
) -> Result<(), TestCaseError> {
    let units = 1 << forest.finest_level().div_ceil(3);
    let voxel = |fine: FineTet| {
        let at: [usize; 3] = std::array::from_fn(|axis| {
            let sum: i32 = fine.corners.iter().map(|p| p[axis]).sum();
            (sum * VOXELS as i32 / (4 * units)) as usize
        });
        at[0] + dims[0] * (at[1] + dims[1] * at[2])
    };
    let solid_of = |tet: &Tet| -> Vec<usize> {
        let leaf = forest.leaf_of(tet.id);
        let all = forest.finest_in(tet).into_iter().enumerate();
        let own = all.filter(|(i, fine)| fine.is_solid() && forest.sheet_with(leaf, *i) == tet.id);
        own.map(|(_, fine)| voxel(fine)).collect()
    };
    let solid: Vec<Tet> = forest.leaves().filter(|tet| !solid_of(tet).is_empty()).collect();
    let mut body_of: BTreeMap<usize, VertexId> = BTreeMap::new();
    for (tet, body) in by_vertices(solid) {
        for voxel in solid_of(&tet) {
            let known = *body_of.entry(joined[voxel].unwrap()).or_insert(body);
            prop_assert_eq!(known, body, "material that is joined");
        }
    }
    let bodies: BTreeSet<VertexId> = body_of.values().copied().collect();
    prop_assert_eq!(bodies.len(), body_of.len(), "material that is apart");
    Ok(())
}

#[test]
fn a_block_cut_through_is_two_blocks() {
    for [n, d] in [[1, 32], [1, 27]] {
        for normal in [[n, 0, 0], [n, n, 0], [2, -1, 1]] {
            let mut forest = forest([4, 2, 2], solid([4, 2, 2]), 2, 6);
            let whole = shape(&forest);
            let faces = parted(&forest, by_plane(normal, d, ([0; 3], 1000)));
            assert!(!faces.is_empty());
            let before = leaves(&forest);
            let delta = forest.sever(&faces).unwrap();
            assert_eq!(replay(before, &delta), leaves(&forest));
            check_definition(&forest);
            // From tetrahedron to tetrahedron by vertices there are two bodies.
            let bodies: BTreeSet<VertexId> =
                by_vertices(forest.leaves().collect()).into_iter().map(|(_, body)| body).collect();
            assert_eq!(bodies.len(), 2, "{normal:?}");
            let all: Vec<FineFace> = faces.iter().map(|severed| severed.face).collect();
            let before = leaves(&forest);
            let delta = forest.close(&all).unwrap();
            assert_eq!(replay(before, &delta), leaves(&forest));
            assert_eq!(shape(&forest), whole);
        }
    }
}

#[test]
fn what_is_no_leaf_is_refused_and_nothing_changes() {
    let mut forest = forest([2, 2, 2], solid([2, 2, 2]), 2, 6);
    let mut faces = parted(&forest, by_plane([1, 0, 0], 16, ([0; 3], 1000)));
    let before = leaves(&forest);
    faces[3].leaves[1] = TetId(1 << 20);
    let refused = forest.sever(&faces).unwrap_err();
    assert!(refused.to_string().contains("1048576"), "{refused}");
    assert_eq!(leaves(&forest), before);
    assert_eq!(forest.severed().count(), 0);
}

fn bodies() -> impl Strategy<Value = BisectionForest> {
    let cells = [2, 2, 1];
    let count = solid(cells).len();
    let labels = prop_oneof![
        Just(solid(cells)),
        prop::collection::vec(prop_oneof![3 => Just(1u16), 1 => Just(0), 1 => Just(2)], count),
    ];
    (labels, 0u8..=3, 5u8..=7).prop_map(move |(mut labels, start, max)| {
        labels[0] = 1;
        forest(cells, labels, start, max)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Splits, merges, cuts and closings in any order leave what the definition says; all closed, the mesh is the one
    /// that splits and merges alone make.
    #[test]
    fn histories_leave_what_the_definition_says(
        forest in bodies(),
        steps in prop::collection::vec((0..4u8, cuts(), any::<Index>()), 1..7),
    ) {
        let (mut forest, mut delta) = (forest, MeshDelta::empty());
        let mut plain = forest.clone();
        for (what, (normal, d, ball), pick) in steps {
            let before = leaves(&forest);
            match what {
                0 => {
                    let units = forest.finest_level() / 3 * 4;
                    let cut = by_plane(normal, d * i32::from(units) / 8, ball);
                    let faces = parted(&forest, cut);
                    let delta = forest.sever(&faces).unwrap();
                    prop_assert!(replay(before, &delta) == leaves(&forest), "a delta of another cut");
                }
                1 => {
                    let open: Vec<FineFace> = forest.severed().map(|severed| severed.face).collect();
                    let closed: Vec<FineFace> = open
                        .into_iter()
                        .enumerate()
                        .filter(|(i, _)| (i * 7919 + pick.index(100)) % 3 > 0)
                        .map(|(_, face)| face)
                        .collect();
                    let delta = forest.close(&closed).unwrap();
                    prop_assert!(replay(before, &delta) == leaves(&forest), "a delta of another cut");
                }
                2 => {
                    let candidates = forest.candidates();
                    if !candidates.is_empty() {
                        let p = candidates[pick.index(candidates.len())];
                        forest.split(p, &mut delta).unwrap();
                        plain.split(p, &mut delta).unwrap();
                    }
                }
                _ => {
                    let young: Vec<_> =
                        forest.vertices().filter(|&v| forest.is_mergeable(v)).collect();
                    if !young.is_empty() {
                        let v = young[pick.index(young.len())];
                        let p = forest.point(v);
                        forest.merge(v, &mut delta).unwrap();
                        plain.merge(plain.vertex_at(p).unwrap(), &mut delta).unwrap();
                    }
                }
            }
            check_definition(&forest);
            for leaf in forest.leaves().filter(|leaf| forest.is_frozen(leaf.id)) {
                prop_assert!(forest.refinement_point(leaf.id).is_none());
            }
        }
        let open: Vec<FineFace> = forest.severed().map(|severed| severed.face).collect();
        forest.close(&open).unwrap();
        prop_assert!(shape(&forest) == shape(&plain), "another mesh");
        let contents = |forest: &BisectionForest| {
            let all = forest.leaves().map(|tet| (tet.vertices.map(|v| forest.point(v)), tet.node));
            all.collect::<std::collections::HashSet<_>>()
        };
        prop_assert!(contents(&forest) == contents(&plain), "other contents");
    }

    /// Chains of tetrahedra by vertices join just that material which chains of voxels by faces join, at any level; cuts come
    /// and go on top of that.
    #[test]
    fn what_no_face_joins_is_apart(
        labels in prop::collection::vec(0..2u16, solid([2, 1, 1]).len()),
        start in 0u8..=5,
        max in 5u8..=7,
        picks in prop::collection::vec(any::<Index>(), 0..4),
        later in prop::collection::vec(any::<Index>(), 0..8),
        (normal, d, ball) in cuts(),
    ) {
        prop_assume!(labels.contains(&1));
        let dims = [2 * VOXELS, VOXELS, VOXELS];
        let mut forest = forest([2, 1, 1], labels.clone(), start, max);
        for pick in picks {
            let candidates = forest.candidates();
            if !candidates.is_empty() {
                let p = candidates[pick.index(candidates.len())];
                forest.split(p, &mut MeshDelta::empty()).unwrap();
            }
        }
        let before = leaves(&forest);
        let unjoined = forest.unjoined();
        let delta = forest.separate(&unjoined).unwrap();
        prop_assert!(replay(before, &delta) == leaves(&forest), "a delta of another mesh");
        prop_assert_eq!(&forest.unjoined(), &unjoined);
        let again = forest.separate(&unjoined).unwrap();
        prop_assert!(again.recast.is_empty() && again.doubled.is_empty() && again.parts.is_empty());
        let joined = by_faces(dims, &labels);
        check_bodies(&forest, dims, &joined)?;
        let apart = shape(&forest);
        let faces = parted(&forest, by_plane(normal, d, ball));
        forest.sever(&faces).unwrap();
        let cut: Vec<FineFace> = faces.iter().map(|severed| severed.face).collect();
        forest.close(&cut).unwrap();
        prop_assert!(shape(&forest) == apart, "another mesh");
        let mut came = Vec::new();
        for pick in later {
            let candidates = forest.candidates();
            if !candidates.is_empty() {
                let p = candidates[pick.index(candidates.len())];
                came.push(forest.split(p, &mut MeshDelta::empty()).unwrap());
            }
        }
        check_bodies(&forest, dims, &joined)?;
        for v in came.into_iter().rev() {
            prop_assert!(forest.is_mergeable(v));
            forest.merge(v, &mut MeshDelta::empty()).unwrap();
        }
        prop_assert!(shape(&forest) == apart, "another mesh after all");
    }

    /// What comes apart does not depend on the order of cuts.
    #[test]
    fn cuts_commute(forest in bodies(), list in prop::collection::vec(cuts(), 2..5)) {
        let cut = |list: &mut dyn Iterator<Item = &Cut>| {
            let mut forest = forest.clone();
            for &(normal, d, ball) in list {
                let faces = parted(&forest, by_plane(normal, d, ball));
                forest.sever(&faces).unwrap();
            }
            shape(&forest)
        };
        let (one, other) = (cut(&mut list.iter()), cut(&mut list.iter().rev()));
        // Void stays with what is largest at the time.
        let is_solid = |sheet: &Sheet| {
            let leaf = forest.leaves().find(|tet| tet.vertices.map(|v| forest.point(v)) == sheet.0);
            leaf.is_some_and(|leaf| !is_void(&forest, &leaf))
        };
        let renumber = |shape: Vec<(Sheet, [usize; 4])>| {
            let mut numbers = HashMap::new();
            let solid = shape.into_iter().filter(|(sheet, _)| is_solid(sheet));
            solid
                .map(|(sheet, corners)| {
                    let corners = corners.map(|v| {
                        let next = numbers.len();
                        *numbers.entry(v).or_insert(next)
                    });
                    (sheet, corners)
                })
                .collect::<Vec<_>>()
        };
        prop_assert!(renumber(one) == renumber(other), "another mesh");
    }
}
