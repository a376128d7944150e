//! VTU files: meshio's, hand-written and damaged ones, and those that we write.

use vtkio::model::{Attribute, CellType, DataSet, Piece};
use yawara_mesh::tet_file::read_vtu;
use yawara_mesh::tet_file::{LoadedMesh, MeshField, write_vtu_plain};
use yawara_mesh::{PlainMesh, Repairs, TetMeshError};

use crate::cube::{TAGS, TETS, assert_two_boxes, cube, data, file, irrational_cube, points};

#[test]
fn what_meshio_writes_is_read() {
    for name in ["text", "plain", "zlib"] {
        let loaded = read_vtu(&data(&format!("meshio_{name}.vtu")), 1e-3).unwrap();
        assert_two_boxes(&loaded.mesh, 1e-3);
        assert_eq!((loaded.ignored_elements, loaded.repairs), (5, Repairs::default()));
    }
    let error = read_vtu(&data("meshio_lzma.vtu"), 1e-3).unwrap_err().to_string();
    assert!(error.contains("vtkLZMADataCompressor is not supported; save"), "{error}");
}

/// Two tetrahedra, one mirrored, and a triangle; appended labels beside text and a second piece.
const VTU: &str = r#"<?xml version='1.0'?>
<!-- by hand -->
<VTKFile type="UnstructuredGrid" version="0.1" byte_order="BigEndian">
 <UnstructuredGrid>
  <Piece NumberOfPoints="4" NumberOfCells="2">
   <PointData><DataArray type="Float32" Name="label" format="ascii">1 2 3 4</DataArray></PointData>
   <CellData>
    <DataArray type="Float64" Name="material" format="ascii">9 9</DataArray>
    <DataArray type="Int16" Name="label" format="appended" offset="0"/>
   </CellData>
   <Points><DataArray type="Float32" NumberOfComponents="3" format="ascii">
     0 0 0 .5 0 0   0 .25 0   0 0 1</DataArray></Points>
   <Cells>
    <DataArray type="Int64" Name="connectivity" format="ascii">0 1 2 1 0 2 3</DataArray>
    <DataArray type="Int64" Name="offsets" format="ascii">3 7</DataArray>
    <DataArray type="UInt8" Name="types" format="ascii">5 10</DataArray>
   </Cells>
  </Piece>
  <Piece NumberOfPoints="5" NumberOfCells="1">
   <Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">
     9 9 9  5 0 0  6 0 0  5 1 0  5 0 1</DataArray></Points>
   <Cells>
    <DataArray type="UInt16" Name="connectivity" format="ascii">1 2 3 4</DataArray>
    <DataArray type="Int8" Name="offsets" format="ascii">4</DataArray>
    <DataArray type="Int64" Name="types" format="ascii">10</DataArray>
   </Cells>
  </Piece>
 </UnstructuredGrid>
 <AppendedData encoding="base64">_AAAABAAH//0=</AppendedData>
</VTKFile>
"#;

fn read(text: &str) -> Result<LoadedMesh, TetMeshError> {
    let (_folder, path) = file("mesh.vtu", text.as_bytes());
    read_vtu(&path, 1.0)
}

#[test]
fn tags_go_by_many_names() {
    for name in ["Materials", "MATERIAL_ID", "materialids", "Labels", "Tag"] {
        let text =
            VTU.replace("Name=\"label\" format=\"appended\"", "Name=\"other\" format=\"appended\"");
        let loaded = read(&text.replace("Name=\"material\"", &format!("Name=\"{name}\""))).unwrap();
        assert_eq!(loaded.mesh.tags(), [9, 0], "{name}");
    }
}

#[test]
fn a_hand_written_file_is_read() {
    let loaded = read(VTU).unwrap();
    // The bytes 00 07 ff fd: 7 for the triangle, −3 for the tetrahedron.
    assert_eq!(loaded.mesh.tags(), &[-3, 0]);
    assert_eq!(loaded.repairs, Repairs { rewound: 1, dropped_points: 1 });
    assert_eq!(loaded.ignored_elements, 1);
    assert!((loaded.mesh.volume() - (0.125 + 1.0) / 6.0).abs() < 1e-16);
    let without =
        VTU.replacen("Name=\"label\" format=\"appended\"", "Name=\"x\" format=\"appended\"", 1);
    assert_eq!(read(&without).unwrap().mesh.tags(), &[9, 0]);
}

#[test]
fn header_and_data_may_be_one_base64_stream_or_two() {
    let two = VTU.replacen("_AAAABAAH//0=", "_AAAA\n BA==AAf//Q==", 1);
    assert_eq!(read(&two).unwrap().mesh.tags(), &[-3, 0]);
}

#[test]
fn raw_appended_data_are_read() {
    for (version, header) in [("", &[0, 0, 0, 4][..]), ("UInt64", &[0, 0, 0, 0, 0, 0, 0, 4])] {
        let mut text = VTU.replacen("\"base64\"", "\"raw\"", 1);
        if !version.is_empty() {
            text = text.replacen("version=\"0.1\"", &format!("header_type=\"{version}\""), 1);
        }
        let (head, tail) = text.split_once("AAAABAAH//0=").unwrap();
        let bytes = [head.as_bytes(), header, &[0, 7, 0xff, 0xfd], tail.as_bytes()].concat();
        let (_folder, path) = file("mesh.vtu", &bytes);
        assert_eq!(read_vtu(&path, 1.0).unwrap().mesh.tags(), &[-3, 0]);
    }
}

#[test]
fn errors_name_their_array() {
    for (from, to, want) in [
        ("type=\"UnstructuredGrid\"", "type=\"PolyData\"", "found type \"PolyData\""),
        ("BigEndian", "Middle", "found byte_order \"Middle\""),
        ("version=\"0.1\"", "header_type=\"Int8\"", "want UInt32 or UInt64"),
        ("<VTKFile", "<NoVTK", "found <NoVTK>, want <VTKFile>"),
        ("</UnstructuredGrid>", "</Unstructured>", "want XML"),
        ("</AppendedData>", "", "found the end of the file, want </AppendedData>"),
        ("\"base64\"", "\"octal\"", "found octal, want encoding"),
        (">_AAAA", ">AAAA", "found no underscore"),
        ("_AAAABAAH//0=", "_AAAABAAH//", "found too few bytes"),
        ("_AAAABAAH//0=", "_AAAABAAH/,0=", "want base64"),
        ("_AAAABA", "_AAAABQ", "found 5 bytes, want 4, by what the piece announces"),
        ("offset=\"0\"", "offset=\"99\"", "found offset 99, want at most 12"),
        ("offset=\"0\"", "offset=\"-1\"", "found offset \"-1\""),
        ("NumberOfPoints=\"4\"", "NumberOfPoints=\"5\"", "found 12 numbers, want 15"),
        ("NumberOfPoints=\"4\"", "NumberOfPoints=\"x\"", "found NumberOfPoints \"x\""),
        ("NumberOfPoints=\"4\"", "NumberOfPoints=\"9999999999999999999\"", "found 12 numbers"),
        ("NumberOfCells=\"2\"", "NumberOfCells=\"3\"", "array \"types\": found 2 numbers, want 3"),
        ("NumberOfComponents=\"3\"", "", "found 1 components, want 3 per point"),
        (".5 0 0", ".5 0 nan", "found NaN, want finite coordinates"),
        (".5 0 0", ".5 0 O", "found \"O\", want numbers"),
        ("<Points>", "<Dots>", "want XML"),
        ("Name=\"types\"", "Name=\"kinds\"", "found no array \"types\""),
        ("5 10", "24 10", "cell 0: VTK_QUADRATIC_TETRA is not supported"),
        ("5 10", "5 71", "cell 1: VTK_LAGRANGE_TETRAHEDRON is not supported"),
        ("5 10", "10 10", "cell 0, a VTK_TETRA: found 3 corners, want 4"),
        ("3 7<", "8 7<", "offset of cell 0: found 8, want 0 to 7, ascending"),
        ("3 7<", "-1 7<", "offset of cell 0: found -1, want 0 to 7, ascending"),
        ("0 1 2 1 0 2 3", "0 1 2 1 0 2 4", "cell 1: found corner 4, want a point below 4"),
        ("0 1 2 1 0 2 3", "0 1 2 1 0 2 -1", "cell 1: found corner -1"),
        ("0 1 2 1 0 2 3", "0 1 2 1 0 2 2", "tet 0 uses point 2 twice"),
        ("\"Int16\" Name=\"label\"", "\"String\" Name=\"label\"", "its type is not supported"),
        ("9 9<", "9 9.5<", ""),
    ] {
        assert!(VTU.contains(from), "{from:?}");
        let text = VTU.replacen(from, to, 1);
        if want.is_empty() {
            let text = text.replacen("\"label\" format=\"app", "\"other\" format=\"app", 1);
            let message = read(&text).unwrap_err().to_string();
            assert!(message.contains("found 9.5, want integers"), "{message}");
            continue;
        }
        let message = read(&text).map(|_| from).unwrap_err().to_string();
        assert!(message.contains(want), "{from:?} → {to:?}: {message}");
        assert!(message.contains("mesh.vtu: "), "{message}");
    }
    for before in [" <AppendedData", " <UnstructuredGrid", "<?xml"] {
        let text =
            VTU[..VTU.find(before).unwrap()].replacen("format=\"appended\" offset=\"0\"", "", 1);
        let message = read(&text).unwrap_err().to_string();
        assert!(message.contains("found the end of the file, want </VTKFile>"), "{message}");
    }
}

#[test]
fn a_forged_count_is_refused_before_allocation() {
    let zlib = std::fs::read_to_string(data("meshio_zlib.vtu")).unwrap();
    let forged = zlib.replacen("NumberOfPoints=\"23\"", "NumberOfPoints=\"1000000000000\"", 1);
    let message = read(&forged).unwrap_err().to_string();
    assert!(message.contains("announces 3000000000000 numbers, but"), "{message}");
}

#[test]
fn written_files_read_back_bit_for_bit() {
    let tags = vec![i64::MIN, -1, 0, 7, i64::MAX];
    let extreme = PlainMesh::new(points(), TETS.to_vec(), tags).unwrap().0;
    for mesh in [cube(), irrational_cube(), extreme] {
        let (folder, path) = file("mesh.vtu", b"what stood there");
        write_vtu_plain(&path, &mesh, 1.0, &[], &[]).unwrap();
        let loaded = read_vtu(&path, 1.0).unwrap();
        assert_eq!((&loaded.mesh, loaded.repairs), (&mesh, Repairs::default()));
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1, "only the mesh stays");
    }
}

#[test]
fn an_independent_reader_sees_mesh_and_fields() {
    let (_folder, path) = file("mesh.vtu", b"");
    let displacement: Vec<f64> = (0..24).map(|i| f64::from(i) / 7.0).collect();
    let stress = [1e-300, 2.5, -3.0, 4e300, 0.1];
    let vector = MeshField { name: "displacement", components: 3, values: &displacement };
    let scalar = MeshField { name: "σ < \"max\"", components: 1, values: &stress };
    write_vtu_plain(&path, &cube(), 1e-3, &[vector], &[scalar]).unwrap();
    let vtk = vtkio::Vtk::import(&path).unwrap();
    let DataSet::UnstructuredGrid { pieces, .. } = vtk.data else { panic!("no grid") };
    let [Piece::Inline(piece)] = &pieces[..] else { panic!("no piece") };
    let mm: Vec<f64> = points().iter().flat_map(|x| [x[0] * 1e3, x[1] * 1e3, x[2] * 1e3]).collect();
    assert_eq!(piece.points.clone().into_vec::<f64>().unwrap(), mm);
    assert_eq!(piece.cells.types, vec![CellType::Tetra; 5]);
    let (connectivity, offsets) = piece.cells.cell_verts.clone().into_xml();
    assert_eq!(connectivity, TETS.as_flattened().iter().map(|&i| i.into()).collect::<Vec<u64>>());
    assert_eq!(offsets, [4, 8, 12, 16, 20]);
    let array = |attribute: &Attribute| match attribute {
        Attribute::DataArray(array) => array.clone(),
        Attribute::Field { .. } => panic!("a field"),
    };
    let point = array(&piece.data.point[0]);
    assert_eq!(
        (point.name.as_str(), point.data.into_vec().unwrap()),
        ("displacement", displacement)
    );
    let (label, sigma) = (array(&piece.data.cell[0]), array(&piece.data.cell[1]));
    assert_eq!((label.name.as_str(), label.data.into_vec().unwrap()), ("label", TAGS.to_vec()));
    assert_eq!(sigma.data.into_vec::<f64>().unwrap(), stress);
}

#[test]
fn fields_that_do_not_fit_are_not_written() {
    let (_folder, path) = file("mesh.vtu", b"before");
    let write = |components: usize, values: &[f64]| {
        let field = MeshField { name: "u", components, values };
        write_vtu_plain(&path, &cube(), 1.0, &[], &[field]).unwrap_err().to_string()
    };
    assert_eq!(write(1, &[0.0; 6]), "field \"u\" has 6 values, want 5");
    assert_eq!(write(3, &[0.0; 5]), "field \"u\" has 5 values, want 15");
    assert_eq!(write(0, &[]), "field \"u\" has 0 values, want 0");
    let want = "field \"u\" 2 has the value NaN, want a finite number";
    assert_eq!(write(1, &[0.0, 0.0, f64::NAN, 0.0, 0.0]), want);
    assert_eq!(std::fs::read(&path).unwrap(), b"before");
}
