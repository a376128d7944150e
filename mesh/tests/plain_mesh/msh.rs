//! MSH files: Gmsh's own, hand-written ones, damaged ones, and those that we write.

use std::collections::BTreeMap;

use yawara_mesh::tet_file::{read_msh, write_msh22, write_msh41};
use yawara_mesh::{PlainMesh, Repairs, TetMeshError};

use crate::cube::{TAGS, TETS, assert_two_boxes, cube, data, file, irrational_cube};

#[test]
fn what_gmsh_writes_is_read() {
    for name in ["22_text", "22_binary", "41_text", "41_binary", "41_parametric"] {
        let loaded = read_msh(&data(&format!("gmsh_{name}.msh")), 1e-3).unwrap();
        assert_two_boxes(&loaded.mesh, 1e-3);
        let names = [(7, "soft part".to_string()), (9, "stiff \"x\"".to_string())];
        assert_eq!(loaded.names, BTreeMap::from(names), "{name}");
        // The file saved with all entities also has its 12 corners, 20 edges, 44 triangles.
        let ignored = if name == "41_parametric" { 12 + 20 + 44 } else { 0 };
        assert_eq!((loaded.ignored_elements, loaded.repairs), (ignored, Repairs::default()));
    }
}

#[test]
fn curved_tets_are_refused_by_name() {
    let error = read_msh(&data("gmsh_41_second_order.msh"), 1e-3).unwrap_err().to_string();
    assert!(error.contains("a 10-node tetrahedron (second order) is not supported"), "{error}");
    assert!(error.contains("$Elements, line "), "{error}");
}

/// Sparse, unordered nodes; a comment, a field, a triangle, an unused node, a mirrored tet.
const MSH22: &str = "$Comments\nby hand\n$EndComments\n$MeshFormat\n2.2 0 8\n$EndMeshFormat\n\
    $PhysicalNames\n2\n2 4 \"skin\"\n3 -3 \"a \"b\" c\"\n$EndPhysicalNames\n\
    a remark\n\
    $Nodes\n6\n900 0 0 1e0\n10 0 0 0\n30 0 2.5e-1 0\n20 5e-1 0. 0\n7 8 8 8\n40 -1 0 0\n$EndNodes\n\
    $Unknown\nanything $ at all\n$EndUnknown\n\
    $Elements\n4\n1 2 2 4 1 10 20 30\n5 4 2 -3 1 10 20 30 900\n6 4 0 10 40 30 900\n9 15 1 4 10\n\
    $EndElements\n";

const MSH41: &str = "$MeshFormat\r\n4.1 0 8\r\n$EndMeshFormat\n\
    $Entities\n1 0 1 2\n1 0 0 0 0\n7 0 0 0 1 1 1 1 4 0\n\
    11 0 0 0 1 1 1 2 -3 8 1 7\n12 0 0 0 1 1 1 0 1 7\n$EndEntities\n\
    $Nodes\n3 6 7 900\n0 1 0 1\n10\n0 0 0\n2 7 1 2\n30 20\n0 .25 0 .1 .2\n.5 0 0 .3 .4\n\
    3 11 0 3\n900 7 40\n0 0 1\n8 8 8\n-1 0 0\n$EndNodes\n\
    $Elements\n3 3 1 9\n2 7 2 1\n1 10 20 30\n3 11 4 1\n5 10 20 30 900\n3 12 4 1\n6 10 40 30 900\n\
    $EndElements\n";

fn read(text: &str) -> Result<yawara_mesh::tet_file::LoadedMesh, TetMeshError> {
    let (_folder, path) = file("mesh.msh", text.as_bytes());
    read_msh(&path, 1.0)
}

#[test]
fn hand_written_files_of_both_versions_agree() {
    let (two, four) = (read(MSH22).unwrap(), read(MSH41).unwrap());
    for loaded in [&two, &four] {
        assert_eq!(loaded.mesh.tags(), &[-3, 0]);
        // 1/6 · (½ · ¼ · 1) + 1/6 · (1 · ¼ · 1)
        assert!((loaded.mesh.volume() - (0.125 + 0.25) / 6.0).abs() < 1e-17);
        assert_eq!(loaded.repairs, Repairs { rewound: 1, dropped_points: 1 });
    }
    assert_eq!((two.ignored_elements, four.ignored_elements), (2, 1));
    assert_eq!(two.names, BTreeMap::from([(-3, "a \"b\" c".to_string())]));
}

/// Replaces the first `from`, which must be there, and returns the error's message.
fn message(base: &str, from: &str, to: &str) -> String {
    assert!(base.contains(from), "{from:?}");
    match read(&base.replacen(from, to, 1)) {
        Ok(_) => panic!("{from:?} → {to:?} is read"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn errors_of_version_2_name_their_place() {
    for (from, to, want) in [
        ("2.2 0 8", "2.2 0", "found \"2.2 0\", want version, file type, data size"),
        ("2.2 0 8", "4.0 0 8", "MSH version \"4.0\" is not supported; save"),
        ("2.2 0 8", "2.2 0 4", "found data size \"4\", want 8"),
        ("2.2 0 8", "2.2 2 8", "found file type \"2\", want 0 (text) or 1 (binary)"),
        ("2.2 0 8", "2.2 1 8", "want the integer 1 in either byte order"),
        ("$EndMeshFormat", "$End", "found \"$End\", want $EndMeshFormat"),
        ("$MeshFormat", "$Nodes", "found $Nodes, want $MeshFormat first"),
        ("$Nodes\n6", "$Nodes\nsix", "$Nodes, line 15: found \"six\", want a count"),
        ("$Nodes\n6", "$Nodes\n7", "found \"$EndNodes\", want a node number"),
        ("$Nodes\n6", "$Nodes\n5", "found \"40\", want $EndNodes"),
        ("$Nodes\n6", "$Nodes\n999999999999999", "announces 999999999999999 nodes"),
        ("8 8 8", "8 nan 8", "found NaN, want a finite coordinate"),
        ("8 8 8", "8 1e999 8", "found inf, want a finite coordinate"),
        ("7 8 8 8", "-7 8 8 8", "found -7, want a node number"),
        ("7 8 8 8", "10 8 8 8", "found node 10 a second time, want each node once"),
        ("$Elements\n4", "$Elements\n88888888", "announces 88888888 elements"),
        ("$Elements\n4", "$Elements\n5", "found \"$EndElements\", want an element number"),
        ("$Elements\n4", "$Elements\n3", "found \"9\", want $EndElements"),
        ("9 15 1", "9 11 1", "a 10-node tetrahedron (second order)"),
        ("9 15 1", "9 31 1", "a 56-node tetrahedron (fifth order)"),
        ("9 15 1", "9 77 1", "element type 77 is not supported"),
        ("30 900\n6", "30 901\n6", "$Elements, element 5: found node 901, want a node of $Nodes"),
        ("10 20 30 900", "10 20 20 900", "tet 0 uses point 3 twice"),
        ("10 20 30 900", "10 20 40 900", "tet 0 is degenerate: volume 0.000e0 m³"),
        ("$EndUnknown", "$EndUnknwon", "found no end of the section, want $EndUnknown"),
        ("3 -3 \"a", "3 x \"a", "want dimension, tag, \"name\""),
        ("$PhysicalNames\n2", "$PhysicalNames\n3", "want dimension, tag, \"name\""),
        ("$PhysicalNames\n2", "$PhysicalNames\n3000", "announces 3000 names"),
    ] {
        let message = message(MSH22, from, to);
        assert!(message.contains(want), "{from:?} → {to:?}: {message}");
        assert!(message.contains("mesh.msh: "), "{message}");
    }
    let message = read("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n").unwrap_err().to_string();
    assert!(message.ends_with("the mesh has no tetrahedra, want at least one"), "{message}");
    for text in ["", "\n", "no mesh", "\u{fffd}\n"] {
        let message = read(text).unwrap_err().to_string();
        assert!(message.contains("want $MeshFormat, as in a Gmsh mesh"), "{message}");
    }
}

#[test]
fn errors_of_version_4_name_their_place() {
    for (from, to, want) in [
        ("$Entities\n1 0 1 2", "$Entities\n1 0 1 99999999999", "announces 99999999999 entities"),
        ("2 -3 8", "2000000 -3 8", "announces 2000000 physical tags"),
        ("$Nodes\n3 6", "$Nodes\n3 60000", "announces 60000 nodes"),
        ("$Nodes\n3 6", "$Nodes\n30000 6", "announces 30000 blocks"),
        ("$Nodes\n3 6", "$Nodes\n3 7", "found 1 nodes fewer in the blocks"),
        ("$Nodes\n3 6", "$Nodes\n3 5", "found 3 in a block, want 2 at most"),
        ("$Nodes\n3 6", "$Nodes\n2 6", "found 3 nodes fewer in the blocks"),
        ("3 11 0 3", "4 11 0 3", "found dimension 4, want 0 to 3"),
        ("3 11 0 3", "3 11 2 3", "found parametric 2, want 0 or 1"),
        ("900 7 40", "900 7 900", "found node 900 a second time"),
        (".3 .4", ".3 inf", "want a finite parameter"),
        ("3 11 4 1", "3 11 11 1", "$Elements, line 30: a 10-node tetrahedron (second order)"),
        ("$Elements\n3 3", "$Elements\n3 4", "found 1 elements fewer in the blocks"),
        ("$Elements\n3 3", "$Elements\n3 2", "found 1 in a block, want 0 at most"),
        ("10 40 30 900", "10 40 30 901", "$Elements, element 6: found node 901"),
        ("$Entities", "$PartitionedEntities", "a partitioned mesh is not supported"),
    ] {
        let message = message(MSH41, from, to);
        assert!(message.contains(want), "{from:?} → {to:?}: {message}");
    }
}

#[test]
fn big_endian_files_are_read() {
    let mut bytes = b"$MeshFormat\n2.2 1 8\n".to_vec();
    let ints = |bytes: &mut Vec<u8>, values: &[i32]| {
        bytes.extend(values.iter().flat_map(|v| v.to_be_bytes()));
    };
    ints(&mut bytes, &[1]);
    bytes.extend(b"\n$EndMeshFormat\n$Nodes\n8\n");
    for (i, point) in crate::cube::points().iter().enumerate() {
        ints(&mut bytes, &[100 - i as i32]);
        bytes.extend(point.iter().flat_map(|c| c.to_be_bytes()));
    }
    bytes.extend(b"\n$EndNodes\n$Elements\n6\n");
    ints(&mut bytes, &[15, 1, 2, 1, 3, 3, 100, 4, 5, 1]);
    for (tet, tag) in TETS.iter().zip(TAGS) {
        ints(&mut bytes, &[50, tag as i32]);
        ints(&mut bytes, &tet.map(|i| 100 - i as i32));
    }
    bytes.extend(b"\n$EndElements\n");
    let (_folder, path) = file("mesh.msh", &bytes);
    let loaded = read_msh(&path, 1.0).unwrap();
    assert_eq!((loaded.mesh, loaded.ignored_elements), (cube(), 1));
}

type Writer =
    fn(&std::path::Path, &PlainMesh, &BTreeMap<i64, String>, f64) -> Result<(), TetMeshError>;
const WRITERS: [Writer; 2] = [write_msh22, write_msh41];

#[test]
fn written_files_read_back_bit_for_bit() {
    let names = BTreeMap::from([(5, "portal \"vein\"".to_string()), (8, "unused".to_string())]);
    for write in WRITERS {
        for mesh in [cube(), irrational_cube()] {
            let (folder, path) = file("mesh.msh", b"what stood there");
            write(&path, &mesh, &names, 1.0).unwrap();
            let loaded = read_msh(&path, 1.0).unwrap();
            assert_eq!((&loaded.mesh, loaded.repairs), (&mesh, Repairs::default()));
            assert_eq!(loaded.names, names);
            assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1, "only the mesh stays");
            write(&path, &mesh, &names, 1e-3).unwrap();
            let loaded = read_msh(&path, 1e-3).unwrap().mesh;
            for (x, y) in loaded.points().iter().zip(mesh.points()) {
                assert!((x - y).amax() <= 2.0 * f64::EPSILON * y.amax());
            }
            assert_eq!((loaded.tets(), loaded.tags()), (mesh.tets(), mesh.tags()));
        }
    }
}

#[test]
fn what_the_format_can_not_hold_is_not_written() {
    let tagged =
        |tag| PlainMesh::new(crate::cube::points(), TETS.to_vec(), vec![tag; 5]).unwrap().0;
    for write in WRITERS {
        let (_folder, path) = file("mesh.msh", b"before");
        for tag in [-1, 1 << 31, i64::MIN] {
            let error = write(&path, &tagged(tag), &BTreeMap::new(), 1.0).unwrap_err();
            assert!(matches!(error, TetMeshError::Tag { .. }), "{error}");
        }
        let names = BTreeMap::from([(5, "two\nlines".to_string())]);
        assert!(matches!(write(&path, &cube(), &names, 1.0), Err(TetMeshError::Tag { .. })));
        for unit in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let error = write(&path, &cube(), &BTreeMap::new(), unit).unwrap_err();
            assert!(matches!(error, TetMeshError::LengthUnit { .. }), "{error}");
            assert!(matches!(read_msh(&path, unit), Err(TetMeshError::LengthUnit { .. })));
        }
        let error = write(&path, &cube(), &BTreeMap::new(), 1e-310).unwrap_err();
        assert!(matches!(error, TetMeshError::NotFinite { index: 1, .. }), "{error}");
        let nowhere = path.join("below a file.msh");
        assert_io(&write(&nowhere, &cube(), &BTreeMap::new(), 1.0).unwrap_err());
        assert_eq!(std::fs::read(&path).unwrap(), b"before");
    }
    assert_io(&read_msh(std::path::Path::new("/"), 1.0).unwrap_err());
}

fn assert_io(error: &TetMeshError) {
    let TetMeshError::InFile { source, .. } = error else { panic!("{error}") };
    assert!(matches!(**source, TetMeshError::Io(_)), "{error}");
}
