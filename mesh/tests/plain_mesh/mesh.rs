//! What is a mesh and what is not, whatever file it came from.

use std::sync::Arc;

use nalgebra::Vector3;
use yawara_mesh::tet_file::FLATNESS;
use yawara_mesh::{
    BisectionForest, Domain, LabelTree, Lattice, MeshDelta, Placement, PlainMesh, Repairs,
    TetMeshError,
};

use crate::cube::{TAGS, TETS, cube, points};

#[test]
fn a_cube_has_its_volume_and_a_closed_boundary() {
    let mesh = cube();
    assert!((mesh.volume() - 1.0).abs() <= 4.0 * f64::EPSILON);
    assert_eq!((mesh.tags(), mesh.tets()), (&TAGS[..], &TETS[..]));
    let faces = mesh.boundary_faces();
    assert_eq!(faces.len(), 12);
    // Outward normals of a closed surface: they sum to 0, and ∮ x · n dA = 3 V.
    let (mut sum, mut flux) = (Vector3::zeros(), 0.0);
    for face in &faces {
        let [a, b, c] = face.map(|i| mesh.points()[i as usize]);
        let area = (b - a).cross(&(c - a)) / 2.0;
        sum += area;
        flux += area.dot(&(a + b + c)) / 3.0;
    }
    assert_eq!(sum, Vector3::zeros());
    assert!((flux - 3.0).abs() < 1e-14);
}

#[test]
fn quality_is_that_of_the_worst() {
    // The corner tetrahedron: r = 1 / (3 + √3), R = √3/2, shortest edge 1; the regular one in
    // the middle is better.
    let quality = cube().quality();
    let sqrt3 = 3f64.sqrt();
    assert!((quality.radius_ratio - 3.0 / (3.0 + sqrt3) / (sqrt3 / 2.0)).abs() < 1e-14);
    assert!((quality.circumradius_over_shortest_edge - sqrt3 / 2.0).abs() < 1e-14);
}

#[test]
fn parts_joined_by_an_edge_are_two_components() {
    let mut points = points();
    points.push(Vector3::new(-1.0, 0.0, 0.0));
    points.push(Vector3::new(-1.0, 0.0, -1.0));
    // Shares the edge 0–2 with the first; the last shares a face with it.
    let tets = vec![[0, 1, 2, 4], [0, 2, 8, 9], [1, 2, 4, 7]];
    let (mesh, _) = PlainMesh::new(points, tets, vec![0; 3]).unwrap();
    assert_eq!(mesh.components(), vec![vec![0, 2], vec![1]]);
    assert_eq!(cube().components(), vec![vec![0, 1, 2, 3, 4]]);
}

#[test]
fn winding_is_repaired_and_counted() {
    let mut tets = TETS.to_vec();
    for tet in [0, 3] {
        tets[tet].swap(0, 1);
    }
    let (mesh, repairs) = PlainMesh::new(points(), tets, TAGS.to_vec()).unwrap();
    assert_eq!(repairs, Repairs { rewound: 2, dropped_points: 0 });
    assert!((mesh.volume() - 1.0).abs() <= 4.0 * f64::EPSILON);
    assert_eq!(mesh.tets()[0], [2, 1, 7, 4]);
}

#[test]
fn points_of_no_tet_are_dropped() {
    let mut all = vec![Vector3::repeat(9.0)];
    all.extend(points());
    let tets: Vec<[u32; 4]> = TETS[1..2].iter().map(|tet| tet.map(|i| i + 1)).collect();
    let (mesh, repairs) = PlainMesh::new(all, tets, vec![3]).unwrap();
    assert_eq!(repairs, Repairs { rewound: 0, dropped_points: 5 });
    assert_eq!(mesh.tets(), &[[0, 1, 2, 3]]);
    let kept = [0, 1, 2, 4].map(|i| points()[i]);
    assert_eq!(mesh.points(), &kept[..]);
}

fn refused(points: Vec<Vector3<f64>>, tets: Vec<[u32; 4]>) -> TetMeshError {
    let tags = vec![0; tets.len()];
    PlainMesh::new(points, tets, tags).unwrap_err()
}

#[test]
fn lists_that_are_no_mesh_are_refused_by_index() {
    assert!(matches!(refused(points(), vec![]), TetMeshError::NoTets));
    let error = PlainMesh::new(points(), TETS.to_vec(), vec![0; 4]).unwrap_err();
    assert_eq!(error.to_string(), "tags has 4 values, want 5");
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut points = points();
        points[3].y = bad;
        let error = refused(points, TETS.to_vec());
        assert!(matches!(error, TetMeshError::NotFinite { index: 3, .. }), "{error}");
    }
    let error = refused(points(), vec![TETS[0], [0, 1, 2, 8]]);
    assert_eq!(error.to_string(), "tet 1 has corner 8, want a point below 8");
    let error = refused(points(), vec![TETS[0], [0, 1, 4, 1]]);
    assert_eq!(error.to_string(), "tet 1 uses point 1 twice, want four different corners");
}

#[test]
fn flat_tets_are_refused_at_the_limit() {
    let with_height = |height: f64| {
        let mut points = points();
        points[4].z = height;
        PlainMesh::new(points, vec![[0, 1, 2, 4]], vec![0])
    };
    // V = height / 6, the longest edge is √2.
    let limit = 6.0 * FLATNESS * 2f64.sqrt().powi(3);
    assert!(with_height(limit * 1.01).is_ok());
    for height in [limit * 0.99, 0.0, -limit * 0.99, 1e-200] {
        let error = with_height(height).unwrap_err();
        assert!(matches!(error, TetMeshError::DegenerateTet { tet: 0, .. }), "{error}");
    }
    assert_eq!(with_height(-1.0).unwrap().1.rewound, 1);
    // Lengths whose cubes overflow or vanish can't be judged.
    for scale in [1e200, 1e-200] {
        let error = refused(points().into_iter().map(|x| x * scale).collect(), TETS.to_vec());
        assert!(matches!(error, TetMeshError::DegenerateTet { tet: 0, .. }), "{error}");
    }
}

#[test]
fn faces_of_three_tets_and_overlaps_are_refused() {
    let mut three = points();
    three.push(Vector3::new(0.1, 0.2, 5.0));
    let error = refused(three, vec![[0, 1, 2, 4], [0, 2, 1, 7], [1, 0, 2, 8]]);
    let message = "tet 0: its face [0, 1, 2] belongs to 3 tets, want at most 2";
    assert_eq!(error.to_string(), message);
    let error = refused(points(), vec![[0, 1, 2, 4], [0, 1, 2, 7]]);
    assert!(matches!(error, TetMeshError::OverlappingTets { tets: [0, 1], face: [0, 1, 2] }));
    let error = refused(points(), vec![TETS[0], TETS[1], TETS[1]]);
    assert!(matches!(error, TetMeshError::OverlappingTets { tets: [1, 2], .. }), "{error}");
}

#[test]
fn a_forest_comes_out_in_its_own_order() {
    let lattice = Lattice::new([2, 1, 1], 9);
    let tree = Arc::new(LabelTree::homogeneous([2, 1, 1], 1));
    let mut forest = BisectionForest::new(Domain::full(lattice), tree, 2, 9).unwrap();
    let point = forest.candidates()[5];
    forest.split_with_closure(point, &mut MeshDelta::empty(), |_, _| ()).unwrap();
    let unit = 0.01 / f64::from(lattice.units);
    let placement = Placement { origin: Vector3::new(0.3, -0.2, 0.1), unit };
    let mesh = PlainMesh::from_forest(&forest, &placement, |tet| tet.level.into()).unwrap();
    assert_eq!(mesh.points().len(), forest.vertex_count());
    for (vertex, &x) in forest.vertices().zip(mesh.points()) {
        assert_eq!(placement.position(forest.point(vertex)), x);
    }
    let levels: Vec<i64> = forest.leaves().map(|tet| tet.level.into()).collect();
    assert_eq!(mesh.tags(), levels);
    assert!((mesh.volume() - 2e-6).abs() < 1e-18);
    assert_eq!(mesh.boundary_faces().len(), forest.boundary_faces().len());
    let nowhere = Placement { origin: Vector3::repeat(f64::NAN), unit };
    assert!(PlainMesh::from_forest(&forest, &nowhere, |_| 0).is_err());
}
