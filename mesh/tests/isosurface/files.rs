//! Surface files are read back to the same bits by a reader that shares no code with the writers.

use std::fs;
use std::path::Path;

use nalgebra::Vector3;
use yawara_mesh::SurfaceError;
use yawara_mesh::isosurface::{PlyEncoding, SurfaceData, write_ply, write_vtp};

/// A tetrahedron with coordinates that short decimals don't hold.
fn points() -> Vec<Vector3<f64>> {
    let third = 1.0 / 3.0;
    [[third, -0.1, 1e-17], [1e6 + third, 0.0, -0.0], [0.0, 7.25, 2e-300], [-5.0, 1.0, 1e21]]
        .map(Vector3::from)
        .to_vec()
}

const TRIANGLES: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
const LABELS: [i64; 4] = [1, -2, 0, 2_000_000_000];

struct Read {
    columns: Vec<(String, Vec<f64>)>,
    triangles: Vec<[u32; 3]>,
}

impl Read {
    fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns.iter().find(|(n, _)| n == name).map(|(_, values)| values.as_slice())
    }
}

/// Takes `N` bytes off the front.
fn take<const N: usize>(bytes: &mut &[u8]) -> [u8; N] {
    let (front, rest) = bytes.split_at(N);
    *bytes = rest;
    front.try_into().unwrap()
}

fn read_ply(path: &Path) -> Read {
    let bytes = fs::read(path).unwrap();
    let end = b"end_header\n";
    let at = bytes.windows(end.len()).position(|w| w == end).unwrap() + end.len();
    let header = std::str::from_utf8(&bytes[..at]).unwrap();
    let lines: Vec<&str> = header.lines().collect();
    assert_eq!(lines[0], "ply");
    let is_text = lines[1] == "format ascii 1.0";
    assert!(is_text || lines[1] == "format binary_little_endian 1.0");
    let count = |element: &str| -> usize {
        let prefix = format!("element {element} ");
        lines.iter().find_map(|l| l.strip_prefix(&prefix)).unwrap().parse().unwrap()
    };
    let properties: Vec<(&str, &str)> = lines
        .iter()
        .filter_map(|l| l.strip_prefix("property "))
        .filter_map(|l| l.split_once(' '))
        .collect();
    let Some((("list", "uchar int vertex_indices"), properties)) = properties.split_last() else {
        panic!("{header}")
    };
    let mut columns: Vec<(String, Vec<f64>)> =
        properties.iter().map(|(_, name)| (name.to_string(), Vec::new())).collect();
    let mut triangles = Vec::new();
    let mut rest = &bytes[at..];
    let mut words = is_text
        .then(|| std::str::from_utf8(rest).unwrap().split_ascii_whitespace())
        .into_iter()
        .flatten();
    let mut number = |kind: &str| -> f64 {
        match (is_text, kind) {
            (true, _) => words.next().unwrap().parse().unwrap(),
            (_, "double") => f64::from_le_bytes(take(&mut rest)),
            (_, "int") => i32::from_le_bytes(take(&mut rest)).into(),
            (_, "uchar") => take::<1>(&mut rest)[0].into(),
            _ => panic!("{kind}"),
        }
    };
    for _ in 0..count("vertex") {
        for ((kind, _), (_, column)) in properties.iter().zip(&mut columns) {
            column.push(number(kind));
        }
    }
    for _ in 0..count("face") {
        assert_eq!(number("uchar"), 3.0);
        triangles.push([(); 3].map(|()| number("int") as u32));
    }
    assert!(words.next().is_none() && (is_text || rest.is_empty()));
    Read { columns, triangles }
}

fn attribute<'a>(tag: &'a str, name: &str) -> &'a str {
    tag.split_once(&format!(" {name}=\"")).unwrap().1.split_once('"').unwrap().0
}

fn read_vtp(path: &Path) -> Read {
    let bytes = fs::read(path).unwrap();
    let start = b"<AppendedData encoding=\"raw\">\n_";
    let at = bytes.windows(start.len()).position(|w| w == start).unwrap();
    let header = std::str::from_utf8(&bytes[..at]).unwrap();
    let appended = &bytes[at + start.len()..];
    assert!(bytes.ends_with(b"\n</AppendedData>\n</VTKFile>\n"));
    let file = header.split('<').find(|tag| tag.starts_with("VTKFile")).unwrap();
    assert_eq!(attribute(file, "header_type"), "UInt64");
    assert_eq!(attribute(file, "byte_order"), "LittleEndian");
    let mut columns = Vec::new();
    for tag in header.split('<').filter(|tag| tag.starts_with("DataArray")) {
        let mut data = &appended[attribute(tag, "offset").parse::<usize>().unwrap()..];
        let length = u64::from_le_bytes(take(&mut data)) as usize;
        let values: Vec<f64> = data[..length]
            .chunks_exact(8)
            .map(|word| match attribute(tag, "type") {
                "Float64" => f64::from_le_bytes(word.try_into().unwrap()),
                "Int64" => i64::from_le_bytes(word.try_into().unwrap()) as f64,
                other => panic!("{other}"),
            })
            .collect();
        columns.push((attribute(tag, "Name").to_string(), values));
    }
    let mut read = Read { columns, triangles: Vec::new() };
    let corners: Vec<u32> =
        read.column("connectivity").unwrap().iter().map(|&c| c as u32).collect();
    read.triangles = corners.chunks_exact(3).map(|c| c.try_into().unwrap()).collect();
    let ends: Vec<f64> = (1..=read.triangles.len()).map(|n| 3.0 * n as f64).collect();
    assert_eq!(read.column("offsets").unwrap(), ends);
    let piece = header.split('<').find(|tag| tag.starts_with("Piece")).unwrap();
    let points: usize = attribute(piece, "NumberOfPoints").parse().unwrap();
    assert_eq!(read.column("points").unwrap().len(), 3 * points);
    assert_eq!(attribute(piece, "NumberOfPolys").parse(), Ok(read.triangles.len()));
    read
}

fn bits(values: impl IntoIterator<Item = f64>) -> Vec<u64> {
    values.into_iter().map(f64::to_bits).collect()
}

#[test]
fn ply_is_read_back_to_the_same_bits() {
    let dir = tempfile::tempdir().unwrap();
    let (points, displacement) = (points(), points().into_iter().rev().collect::<Vec<_>>());
    for encoding in [PlyEncoding::Ascii, PlyEncoding::BinaryLittleEndian] {
        for full in [true, false] {
            let data = SurfaceData {
                points_mm: &points,
                triangles: &TRIANGLES,
                displacement_mm: full.then_some(&displacement),
                label: full.then_some(&LABELS),
            };
            let path = dir.path().join("surface.ply");
            write_ply(&path, &data, encoding).unwrap();
            let read = read_ply(&path);
            assert_eq!(read.triangles, TRIANGLES);
            assert_eq!(read.columns.len(), if full { 7 } else { 3 });
            for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
                let column = |name: &str| bits(read.column(name).unwrap().iter().copied());
                assert_eq!(column(name), bits(points.iter().map(|p| p[axis])));
                if full {
                    let expected = bits(displacement.iter().map(|d| d[axis]));
                    assert_eq!(column(&format!("displacement_{name}")), expected);
                }
            }
            let labels = full.then(|| LABELS.map(|label| label as f64));
            assert_eq!(read.column("label"), labels.as_ref().map(<[f64; 4]>::as_slice));
        }
    }
}

#[test]
fn vtp_is_read_back_to_the_same_bits() {
    let dir = tempfile::tempdir().unwrap();
    let (points, displacement) = (points(), points().into_iter().rev().collect::<Vec<_>>());
    for full in [true, false] {
        let data = SurfaceData {
            points_mm: &points,
            triangles: &TRIANGLES,
            displacement_mm: full.then_some(&displacement),
            label: full.then_some(&LABELS),
        };
        let path = dir.path().join("surface.vtp");
        write_vtp(&path, &data).unwrap();
        let read = read_vtp(&path);
        assert_eq!(read.triangles, TRIANGLES);
        let flat = |vectors: &[Vector3<f64>]| bits(vectors.iter().flatten().copied());
        let column = |name: &str| bits(read.column(name).unwrap().iter().copied());
        assert_eq!(column("points"), flat(&points));
        assert_eq!(read.columns.len(), if full { 5 } else { 3 });
        if full {
            assert_eq!(column("displacement_mm"), flat(&displacement));
            assert_eq!(column("label"), bits(LABELS.map(|label| label as f64)));
        }
    }
}

#[test]
fn what_is_refused_leaves_the_old_file() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("surface");
    fs::write(&path, "old").unwrap();
    let points = points();
    let mut nan = points.clone();
    nan[2].z = f64::NAN;
    let good = SurfaceData {
        points_mm: &points,
        triangles: &TRIANGLES,
        displacement_mm: None,
        label: None,
    };
    let bad = [
        SurfaceData { points_mm: &nan, ..good },
        SurfaceData { displacement_mm: Some(&nan), ..good },
        SurfaceData { displacement_mm: Some(&points[1..]), ..good },
        SurfaceData { label: Some(&LABELS[1..]), ..good },
        SurfaceData { points_mm: &points[1..], ..good },
    ];
    for data in bad {
        for result in [
            write_vtp(&path, &data),
            write_ply(&path, &data, PlyEncoding::Ascii),
            write_ply(&path, &data, PlyEncoding::BinaryLittleEndian),
        ] {
            let error = result.unwrap_err();
            let expected = matches!(
                error,
                SurfaceError::EntryNotFinite { index: 2, .. }
                    | SurfaceError::EntryCount { found: 3, want: 4, .. }
                    | SurfaceError::TriangleCorner { triangle: 1, corner: 3, points: 3 }
            );
            assert!(expected, "{error}");
        }
    }
    let wide = SurfaceData { label: Some(&[0, 0, 0, 1 << 31]), ..good };
    assert!(write_ply(&path, &wide, PlyEncoding::Ascii).is_err());
    assert_eq!(fs::read_to_string(&path).unwrap(), "old");
    let nowhere = dir.path().join("missing").join("surface.vtp");
    let error = write_vtp(&nowhere, &good).unwrap_err();
    assert!(matches!(error, SurfaceError::Io { .. }), "{error}");
    assert!(error.to_string().contains("surface.vtp"), "{error}");
    write_vtp(&path, &good).unwrap();
    write_ply(&path, &good, PlyEncoding::Ascii).unwrap();
    let names: Vec<_> = fs::read_dir(dir.path()).unwrap().collect();
    assert_eq!(names.len(), 1, "no partial file stays: {names:?}");
}

#[test]
fn an_empty_surface_is_a_file_too() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("empty");
    let data = SurfaceData { points_mm: &[], triangles: &[], displacement_mm: None, label: None };
    write_vtp(&path, &data).unwrap();
    assert!(read_vtp(&path).triangles.is_empty());
    for encoding in [PlyEncoding::Ascii, PlyEncoding::BinaryLittleEndian] {
        write_ply(&path, &data, encoding).unwrap();
        assert!(read_ply(&path).triangles.is_empty());
    }
}
