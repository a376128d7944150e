//! What is too fine to be simulated follows the active mesh: exact where theory is, never
//! computed in vain, and the same whether it followed or started afresh.

use nalgebra::{Matrix3, Matrix6, Rotation3, Vector3};
use proptest::prelude::*;
use proptest::sample::Index;
use yawara_corot::rotation::polar_warm;
use yawara_embed::{
    ChildPair, DetailMesh, EmbedError, Follower, LinearTet, isotropic, strain_from_gradient,
};
use yawara_mesh::kuhn::bisected_corner;
use yawara_mesh::{BisectionForest, MeshDelta, Placement, Tet, VertexId};
use yawara_tests::organ::{Organ, organs};

/// Level of one voxel of an [`Organ`].
const VOXEL_LEVEL: u8 = 6;

fn unturned(_: &Matrix3<f64>) -> Matrix3<f64> {
    Matrix3::identity()
}

fn turned(f: &Matrix3<f64>) -> Matrix3<f64> {
    polar_warm(f, &Matrix3::identity())
}

fn positions(
    forest: &BisectionForest,
    placement: &Placement,
    map: impl Fn(Vector3<f64>) -> Vector3<f64>,
) -> Vec<Vector3<f64>> {
    let mut x = vec![Vector3::zeros(); forest.vertex_capacity()];
    for v in forest.vertices() {
        x[v.index()] = map(placement.position(forest.point(v)));
    }
    x
}

fn detail(organ: &Organ, homogenisation: &str) -> DetailMesh {
    let embedding = organ.embedding(homogenisation);
    let unit = organ.placement(VOXEL_LEVEL).unit;
    DetailMesh::embedded(organ.forest(VOXEL_LEVEL, VOXEL_LEVEL), &embedding, unit).unwrap()
}

/// Layers of `thickness` voxels across z.
fn layered(cells: [usize; 3], thickness: usize, materials: [(f64, f64); 2]) -> Organ {
    let mut organ = Organ::homogeneous(cells, 1.0, 0.0);
    let [nx, ny, _] = cells.map(|n| 4 * n);
    for (i, label) in organ.labels.iter_mut().enumerate() {
        *label = 1 + (i / (nx * ny) / thickness % 2) as u16;
    }
    organ.materials = materials.to_vec();
    organ
}

/// Displacement gradient column ∂u/∂z of a layer under the traction `t` across z, with in-plane
/// strains (xx, yy, xy): stress continuity, layer by layer.
fn across(d: &Matrix6<f64>, in_plane: [f64; 3], t: Vector3<f64>) -> Vector3<f64> {
    // Voigt numbers of zz, yz, zx and of xx, yy, xy.
    let (n, p) = ([2, 4, 5], [0, 1, 3]);
    let nn = Matrix3::from_fn(|i, j| d[(n[i], n[j])]);
    let np = Matrix3::from_fn(|i, j| d[(n[i], p[j])]);
    let e = nn.try_inverse().unwrap() * (t - np * Vector3::from(in_plane));
    Vector3::new(e[2], e[1], e[0])
}

/// A coarse mesh that moves by the layers' mean strain, whose next vertices lie on interfaces (the
/// cut between their halves is one) and have their true places, kink and all.
#[test]
fn matched_layers_under_uniform_stress_are_exact() {
    let materials = [(5e3, 0.3), (4e5, 0.45)];
    let (in_plane, traction) = ([1e-3, -2e-3, 0.5e-3], Vector3::new(30.0, -10.0, 20.0));
    // Edges of two layers: of two voxels, and of four.
    for (thickness, active_level) in [(1, 5), (2, 2)] {
        let organ = layered([2, 1, 2], thickness, materials);
        let detail = detail(&organ, "laminate");
        let layer_m = thickness as f64 * 2.5e-3;
        let columns = materials.map(|(e, nu)| across(&isotropic(e, nu), in_plane, traction));
        let origin = organ.placement(VOXEL_LEVEL).origin;
        let in_plane = |x: Vector3<f64>| {
            x + Vector3::new(in_plane[0] * x.x + in_plane[2] * x.y, in_plane[1] * x.y, 0.0)
        };
        let mean = |x: Vector3<f64>| in_plane(x) + 0.5 * (columns[0] + columns[1]) * (x - origin).z;
        let exact = |x: Vector3<f64>| {
            let z = (x - origin).z;
            let layer = (z / layer_m + 1e-9).floor();
            let below: Vector3<f64> = (0..layer as usize).map(|i| columns[i % 2] * layer_m).sum();
            in_plane(x) + below + columns[layer as usize % 2] * (z - layer * layer_m)
        };
        let active = organ.forest(active_level, active_level);
        let x = positions(&active, &organ.placement(active_level), mean);
        let got = detail.positions(&active, &x, &unturned).unwrap();
        let want = positions(detail.forest(), &organ.placement(VOXEL_LEVEL), exact);
        let middles = DetailMesh::new(organ.forest(VOXEL_LEVEL, VOXEL_LEVEL));
        let plain = middles.positions(&active, &x, &unturned).unwrap();
        let next = |v: &VertexId| detail.forest().generation(*v) == active_level + 1;
        let worst = |x: &[Vector3<f64>]| {
            let vertices = detail.forest().vertices().filter(next).map(|v| v.index());
            vertices.map(|v| (x[v] - want[v]).norm()).fold(0.0, f64::max)
        };
        // Displacements are of 10⁻⁴ m, rounding is that of positions of 10⁻² m.
        assert!(worst(&got) < 1e-12 * 1e-4, "{:e}", worst(&got));
        assert!(worst(&plain) > 1e-6, "{:e}", worst(&plain));
    }
}

#[test]
fn one_material_under_many_labels_stays_in_the_middle() {
    let organ = layered([1, 1, 1], 1, [(5e3, 0.4); 2]);
    let detail = detail(&organ, "laminate");
    let middles = DetailMesh::new(organ.forest(VOXEL_LEVEL, VOXEL_LEVEL));
    let active = organ.forest(0, 0);
    let bend = |x: Vector3<f64>| x + Vector3::new(x.y * x.z, 3.0 * x.x, x.z * x.z);
    let x = positions(&active, &organ.placement(0), bend);
    assert_eq!(
        detail.positions(&active, &x, &turned).unwrap(),
        middles.positions(&active, &x, &turned).unwrap(),
    );
}

#[test]
fn another_tree_or_unit_is_refused() {
    let organ = layered([1, 1, 1], 1, [(5e3, 0.4), (1e3, 0.4)]);
    let other = layered([1, 1, 1], 2, organ.materials.clone().try_into().unwrap());
    let forest = || organ.forest(VOXEL_LEVEL, VOXEL_LEVEL);
    let error = DetailMesh::embedded(forest(), &other.embedding("linear"), 1.0).err().unwrap();
    assert!(matches!(error, EmbedError::OtherTree { .. }), "{error}");
    for unit in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = DetailMesh::embedded(forest(), &organ.embedding("linear"), unit).err().unwrap();
        assert!(matches!(error, EmbedError::Range { .. }), "{error}");
    }
    let detail = detail(&organ, "laminate");
    let small = DetailMesh::new(organ.forest(3, 3));
    let mut follower = Follower::new(&small, small.forest().vertices());
    let error = follower.follow(&detail, &organ.forest(0, 0), &[], &unturned).unwrap_err();
    assert!(matches!(error, EmbedError::PositionCount { .. }), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, ..ProptestConfig::default() })]

    /// Splits, merges and moves in any order.
    #[test]
    fn following_equals_a_fresh_start_bit_for_bit(
        organ in organs([2, 1, 1], 3, 2.0..6.0, 0.0..0.49),
        picks in proptest::collection::vec((any::<Index>(), 0..4u8), 30),
        asked in proptest::collection::vec(any::<Index>(), 20),
    ) {
        let detail = detail(&organ, "laminate");
        let all: Vec<VertexId> = detail.forest().vertices().collect();
        let asked: Vec<VertexId> = asked.iter().map(|i| all[i.index(all.len())]).collect();
        let mut everything = Follower::new(&detail, all.iter().copied());
        let mut few = Follower::new(&detail, asked.iter().copied());
        let mut active = organ.forest(1, 5);
        let placement = organ.placement(5);
        let mut delta = MeshDelta::empty();
        let mut x = positions(&active, &placement, |x| x);
        for (pick, what) in picks {
            match what {
                0 => {
                    let candidates = active.candidates();
                    active.split(candidates[pick.index(candidates.len())], &mut delta).unwrap();
                    x.resize(active.vertex_capacity(), Vector3::zeros());
                    let rest = placement.position(active.point(delta.vertex));
                    x[delta.vertex.index()] = rest + Vector3::new(1e-4, -2e-4, 0.0);
                }
                1 => {
                    let loose: Vec<VertexId> =
                        active.vertices().filter(|&v| active.is_mergeable(v)).collect();
                    if !loose.is_empty() {
                        active.merge(loose[pick.index(loose.len())], &mut delta).unwrap();
                    }
                }
                _ => {
                    let vertices: Vec<VertexId> = active.vertices().collect();
                    x[vertices[pick.index(vertices.len())].index()].y += 1e-3;
                }
            }
            let fresh = detail.positions(&active, &x, &turned).unwrap();
            let followed = everything.follow(&detail, &active, &x, &turned).unwrap();
            prop_assert_eq!(&fresh[..], followed);
            few.follow(&detail, &active, &x, &turned).unwrap();
            for v in &asked {
                prop_assert_eq!(few.positions()[v.index()], fresh[v.index()]);
            }
        }
        // Nothing has moved: nothing is computed.
        everything.follow(&detail, &active, &x, &turned).unwrap();
        prop_assert_eq!(everything.evaluated(), 0);
        few.follow(&detail, &active, &x, &turned).unwrap();
        prop_assert_eq!(few.evaluated(), 0);
    }

    /// Strains of the halves around an edge differ from the means of their tetrahedra by ±N d, with the
    /// one d of all for which their energy is least.
    #[test]
    fn the_halves_around_an_edge_have_the_least_energy_together(
        organ in organs([1, 1, 1], 3, 2.0..6.0, 0.0..0.49),
        strain in proptest::array::uniform9(-1e-4..1e-4f64),
    ) {
        // So small that no half comes near to losing half of its volume.
        let gradient = Matrix3::from_row_slice(&strain);
        let active = organ.forest(1, 1);
        let bend = |x: Vector3<f64>| x + gradient * x + 3e-3 * x.x * Vector3::new(x.y, x.z, x.x);
        let x = positions(&active, &organ.placement(1), bend);
        let detail = detail(&organ, "laminate");
        let x = detail.positions(&active, &x, &unturned).unwrap();
        let (forest, placement) = (detail.forest(), organ.placement(VOXEL_LEVEL));
        let (means, mut ring) = (organ.embedding("linear"), Vec::new());
        for v in forest.vertices().filter(|&v| forest.generation(v) > 1) {
            forest.ring_of(v, &mut ring);
            let ends = forest.domain().lattice().edge_ends(forest.point(v)).unwrap();
            let [a, b] = ends.map(|p| x[forest.vertex_at(p).unwrap().index()]);
            let d = x[v.index()] - 0.5 * (a + b);
            let energy = |d: Vector3<f64>| -> f64 {
                let of_tet = |tet: &Tet| -> f64 {
                    let rest = tet.vertices.map(|v| placement.position(forest.point(v)));
                    let geometry = LinearTet::new(&rest);
                    let f = geometry.gradient(&tet.vertices.map(|v| x[v.index()]));
                    let mean = strain_from_gradient(&(f - Matrix3::identity()));
                    let halves = means.tree().children(tet.node).map(|half| means.elasticity(half));
                    let pair = ChildPair::new(&geometry, 0, bisected_corner(tet.level), halves);
                    let [g1, g2] = pair.strain_operators();
                    let off = 0.5 * (g1 - g2) * d;
                    [mean + off, mean - off].iter().zip(&halves).map(|(e, d)| e.dot(&(d * e))).sum()
                };
                ring.iter().map(of_tet).sum()
            };
            // Strains of 1e-4 from places of 1e-2 m over edges of 2.5e-3 m are known to 1e-11.
            let least = energy(d);
            for (factor, aside) in [(0.0, 0.0), (0.9, 0.0), (1.1, 0.0), (1.0, 1e-8), (1.0, -1e-8)] {
                let other = energy(factor * d + Vector3::repeat(aside));
                prop_assert!(other >= least * (1.0 - 1e-9), "{factor}, {aside}: {other:e}, {least:e}");
            }
        }
    }

    /// Compressed to half its height, which takes laminates far beyond small strains.
    #[test]
    fn no_tetrahedron_of_the_detail_turns_over(
        organ in organs([1, 1, 1], 3, 2.0..6.0, 0.0..0.49),
        strain in proptest::array::uniform9(-0.1..0.1f64),
    ) {
        let detail = detail(&organ, "laminate");
        let squeeze = Matrix3::from_diagonal(&Vector3::new(1.2, 1.2, 0.5));
        let map = squeeze + Matrix3::from_row_slice(&strain);
        let active = organ.forest(1, 1);
        let x = positions(&active, &organ.placement(1), |x| map * x);
        let x = detail.positions(&active, &x, &turned).unwrap();
        let (forest, placement) = (detail.forest(), organ.placement(VOXEL_LEVEL));
        for tet in forest.leaves() {
            let rest = tet.vertices.map(|v| placement.position(forest.point(v)));
            let f = LinearTet::new(&rest).gradient(&tet.vertices.map(|v| x[v.index()]));
            // Each of five bisections may halve what is left; rounding takes some of that.
            let least = 0.5f64.powi(5) * map.determinant() * (1.0 - 1e-9);
            prop_assert!(f.determinant() >= least, "{} {least}", f.determinant());
        }
    }

    #[test]
    fn a_turned_body_has_turned_detail(
        organ in organs([1, 1, 1], 3, 2.0..6.0, 0.0..0.49),
        axis in proptest::array::uniform3(-2.0..2.0f64),
        strain in proptest::array::uniform9(-0.1..0.1f64),
    ) {
        // In one material no vertex strays.
        prop_assume!(organ.labels.iter().any(|label| *label != organ.labels[0]));
        let detail = detail(&organ, "laminate");
        let active = organ.forest(1, 1);
        let rotation = Rotation3::new(Vector3::from(axis)).into_inner();
        let stretch = Matrix3::identity() + Matrix3::from_row_slice(&strain);
        let x = positions(&active, &organ.placement(1), |x| stretch * x);
        let spun: Vec<_> = x.iter().map(|x| rotation * x + Vector3::new(0.1, 0.2, 0.3)).collect();
        let got = detail.positions(&active, &spun, &turned).unwrap();
        let want = detail.positions(&active, &x, &turned).unwrap();
        let rest = positions(detail.forest(), &organ.placement(VOXEL_LEVEL), |x| x);
        let mut strayed = 0.0f64;
        for ((got, want), rest) in got.iter().zip(&want).zip(&rest) {
            let back = rotation.transpose() * (got - Vector3::new(0.1, 0.2, 0.3));
            // Rounding of rotations (1e-9 at worst, where Newton stops) times lengths of 1e-2 m.
            prop_assert!((back - want).norm() < 1e-11, "{}", (back - want).norm());
            strayed = strayed.max((want - stretch * rest).norm());
        }
        prop_assert!(strayed > 1e-7, "no vertex strays: nothing was tested");
    }
}

/// One corner moves: what hangs on it is computed, no more.
#[test]
fn a_small_move_costs_little() {
    let organ = layered([4, 1, 1], 1, [(5e3, 0.3), (4e5, 0.3)]);
    let detail = detail(&organ, "laminate");
    let mut follower = Follower::new(&detail, detail.forest().vertices());
    let active = organ.forest(0, 0);
    let mut x = positions(&active, &organ.placement(0), |x| x);
    follower.follow(&detail, &active, &x, &turned).unwrap();
    let all = follower.evaluated();
    assert_eq!(all, detail.forest().vertex_count() - active.vertex_count());
    let corner = active.vertex_at([0, 0, 0]).unwrap();
    x[corner.index()].x -= 1e-3;
    follower.follow(&detail, &active, &x, &turned).unwrap();
    let some = follower.evaluated();
    // The cube of that corner is a quarter of the body; a part of the next hangs on their face.
    assert!(0 < some && some <= all / 2, "{some} of {all}");
    // A single vertex asks for its ancestors alone.
    let one = detail.forest().vertices().last().unwrap();
    let mut follower = Follower::new(&detail, [one]);
    follower.follow(&detail, &active, &x, &turned).unwrap();
    assert!((1..60).contains(&follower.evaluated()), "{}", follower.evaluated());
}
