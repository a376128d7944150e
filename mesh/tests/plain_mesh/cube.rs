//! The unit cube in five tetrahedra, and a place for files.

use nalgebra::Vector3;
use yawara_mesh::PlainMesh;

/// Corner i of the unit cube has coordinates (bit 0, bit 1, bit 2) of i.
pub fn points() -> Vec<Vector3<f64>> {
    (0..8).map(|i| Vector3::new((i & 1).into(), (i >> 1 & 1).into(), (i >> 2).into())).collect()
}

/// One in the middle (1/3 m³) and one at each of four corners (1/6 m³), none mirrored.
pub const TETS: [[u32; 4]; 5] =
    [[1, 2, 4, 7], [0, 1, 2, 4], [3, 2, 1, 7], [5, 4, 7, 1], [6, 7, 4, 2]];

/// Tags 5 and 0, in runs, so that a format that sorts by tags would be caught.
pub const TAGS: [i64; 5] = [5, 0, 5, 5, 0];

pub fn cube() -> PlainMesh {
    PlainMesh::new(points(), TETS.to_vec(), TAGS.to_vec()).unwrap().0
}

/// Coordinates that end in no few digits; the shape stays.
#[cfg(any(feature = "gmsh", feature = "vtu"))]
pub fn irrational_cube() -> PlainMesh {
    let shifted =
        points().into_iter().map(|x| x * 2f64.sqrt() * 1e-2 + Vector3::repeat(-1.0 / 3.0));
    PlainMesh::new(shifted.collect(), TETS.to_vec(), TAGS.to_vec()).unwrap().0
}

#[cfg(any(feature = "gmsh", feature = "vtu"))]
pub fn data(name: &str) -> std::path::PathBuf {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/plain_mesh/data").join(name)
}

/// A file with `bytes` in a folder that lives as long as the first value.
#[cfg(any(feature = "gmsh", feature = "vtu"))]
pub fn file(name: &str, bytes: &[u8]) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

/// The two boxes that Gmsh meshed: [0, 1]³ with tag 7 and [1, 2] × [0, 1]² with tag 9.
#[cfg(any(feature = "gmsh", feature = "vtu"))]
pub fn assert_two_boxes(mesh: &PlainMesh, unit_m: f64) {
    assert_eq!((mesh.points().len(), mesh.tets().len()), (23, 48));
    let cube = unit_m.powi(3);
    assert!((mesh.volume() - 2.0 * cube).abs() < 1e-13 * cube);
    for (tet, &tag) in mesh.tags().iter().enumerate() {
        let x = mesh.corners(tet).iter().map(|c| c.x).sum::<f64>() / 4.0;
        assert_eq!(tag, if x < unit_m { 7 } else { 9 }, "tet {tet}");
    }
    assert_eq!(mesh.components().len(), 1);
    // 2 · 6 squares in 4 triangles each, less the common square from both sides.
    assert_eq!(mesh.boundary_faces().len(), 40);
}
