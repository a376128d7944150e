//! One frame as a VTK unstructured grid (XML, base64 binary) for ParaView and meshio.

use std::fmt::Display;
use std::path::Path;

use yawara_mesh::tet_file::{VtkArray, VtkValues, tetrahedra_xml};

use super::write_file;
use crate::SimError;
use crate::report::Frame;

/// Writes a frame to `path` (.vtu), replacing what stands there only once the file is whole.
///
/// Points in scanner RAS, mm; point data `displacement_mm`; cell data `level`, `label`,
/// `young_modulus_pa`, `von_mises_pa`, `plastic_strain`, `dissipated_j_m3`, `indicator`. A field of no values is left out. The same
/// frame gives the same bytes. Cost: O(points + tetrahedra).
/// # Errors
/// [`SimError::Value`] if the fields do not fit together, a number is not finite or a corner is
/// no point; [`SimError::Io`] if the file can't be written. Then no file is left that was not there
/// before.
pub fn write_vtu(path: &Path, frame: &Frame) -> Result<(), SimError> {
    check(frame)?;
    let displacement = VtkValues::Float64(frame.displacement_mm.as_flattened());
    let point = [VtkArray { name: "displacement_mm", components: 3, values: displacement }];
    let cell = [
        ("level", VtkValues::UInt8(&frame.level)),
        ("label", VtkValues::Int64(&frame.label)),
        ("young_modulus_pa", VtkValues::Float64(&frame.young_modulus_pa)),
        ("von_mises_pa", VtkValues::Float64(&frame.von_mises_pa)),
        ("plastic_strain", VtkValues::Float64(&frame.plastic_strain)),
        ("dissipated_j_m3", VtkValues::Float64(&frame.dissipated_j_m3)),
        ("indicator", VtkValues::Float64(&frame.indicator)),
    ]
    .map(|(name, values)| VtkArray { name, components: 1, values });
    let points = frame.points_mm.as_flattened();
    write_file(path, tetrahedra_xml(points, &frame.tets, &given(point), &given(cell)))
}

/// The arrays that hold something.
fn given<'a, const N: usize>(arrays: [VtkArray<'a>; N]) -> Vec<VtkArray<'a>> {
    arrays.into_iter().filter(|array| !array.values.is_empty()).collect()
}

fn check(frame: &Frame) -> Result<(), SimError> {
    let (points, tets) = (frame.points_mm.len(), frame.tets.len());
    let lengths = [
        ("displacement_mm", frame.displacement_mm.len(), points),
        ("level", frame.level.len(), tets),
        ("label", frame.label.len(), tets),
        ("young_modulus_pa", frame.young_modulus_pa.len(), tets),
        ("von_mises_pa", frame.von_mises_pa.len(), tets),
        ("plastic_strain", frame.plastic_strain.len(), tets),
        ("dissipated_j_m3", frame.dissipated_j_m3.len(), tets),
        ("indicator", frame.indicator.len(), tets),
    ];
    for (field, found, want) in lengths {
        if found != 0 && found != want {
            let want = format!("{want}, one each");
            return Err(refusal(field, found, "the length", want));
        }
    }
    let series: [(&str, &[f64]); 7] = [
        ("points_mm", frame.points_mm.as_flattened()),
        ("displacement_mm", frame.displacement_mm.as_flattened()),
        ("young_modulus_pa", &frame.young_modulus_pa),
        ("von_mises_pa", &frame.von_mises_pa),
        ("plastic_strain", &frame.plastic_strain),
        ("dissipated_j_m3", &frame.dissipated_j_m3),
        ("indicator", &frame.indicator),
    ];
    for (field, values) in series {
        if let Some(index) = values.iter().position(|v| !v.is_finite()) {
            return Err(refusal(field, index, values[index], "a finite number".into()));
        }
    }
    let corners = frame.tets.as_flattened();
    if let Some(index) = corners.iter().position(|&v| v as usize >= points) {
        return Err(refusal("tets", index, corners[index], format!("a point below {points}")));
    }
    Ok(())
}

fn refusal(field: &str, index: usize, value: impl Display, want: String) -> SimError {
    SimError::value("frame", &format!("{field}[{index}]"), value, want)
}

#[cfg(test)]
mod tests {
    use vtkio::model::{Attribute, CellType, DataSet, Piece, VertexNumbers};
    use vtkio::{IOBuffer, Vtk};

    use super::*;
    use std::fs;

    fn frame() -> Frame {
        Frame {
            time_s: 0.5,
            points_mm: vec![
                [0.1, 0., 0.],
                [1., 0., 0.],
                [0., 1., 0.],
                [0., 0., 1e-7],
                [0., 0., -1.],
            ],
            displacement_mm: vec![[0.1, -0.25, 3.0]; 5],
            tets: vec![[0, 1, 2, 3], [0, 2, 1, 4]],
            level: vec![3, 30],
            label: vec![-7, 1 << 40],
            young_modulus_pa: vec![5e3, 1.0 / 3.0],
            von_mises_pa: vec![0.0, 1e-300],
            plastic_strain: vec![0.0, 0.25],
            dissipated_j_m3: vec![3.0, 0.5],
            indicator: vec![1e-9, 2.0],
            surfaces: Vec::new(),
            outline: None,
        }
    }

    #[test]
    fn what_was_written_is_read_back() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("frame.vtu");
        write_vtu(&path, &frame()).unwrap();
        assert!(!fs::read_to_string(&path).unwrap().contains("UInt64\" Name"));
        let DataSet::UnstructuredGrid { pieces, .. } = Vtk::import(&path).unwrap().data else {
            panic!("no unstructured grid");
        };
        let Some(Piece::Inline(piece)) = pieces.into_iter().next() else { panic!("no piece") };
        let (want, cells) = (frame(), &piece.cells);
        assert_eq!(piece.points, IOBuffer::F64(want.points_mm.as_flattened().to_vec()));
        assert_eq!(cells.types, [CellType::Tetra; 2]);
        let VertexNumbers::XML { connectivity, offsets } = &cells.cell_verts else { panic!() };
        assert_eq!((&connectivity[..], &offsets[..]), (&[0, 1, 2, 3, 0, 2, 1, 4][..], &[4, 8][..]));
        let named: Vec<(String, IOBuffer)> = piece
            .data
            .point
            .into_iter()
            .chain(piece.data.cell)
            .map(|attribute| match attribute {
                Attribute::DataArray(array) => (array.name, array.data),
                Attribute::Field { name, .. } => panic!("{name} is no array"),
            })
            .collect();
        let expected = [
            ("displacement_mm", IOBuffer::F64(want.displacement_mm.as_flattened().to_vec())),
            ("level", IOBuffer::U8(want.level)),
            ("label", IOBuffer::I64(want.label)),
            ("young_modulus_pa", IOBuffer::F64(want.young_modulus_pa)),
            ("von_mises_pa", IOBuffer::F64(want.von_mises_pa)),
            ("plastic_strain", IOBuffer::F64(want.plastic_strain)),
            ("dissipated_j_m3", IOBuffer::F64(want.dissipated_j_m3)),
            ("indicator", IOBuffer::F64(want.indicator)),
        ];
        assert_eq!(named, expected.map(|(name, values)| (name.to_owned(), values)));
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1, "nothing stays beside it");
    }

    #[test]
    fn frames_that_do_not_fit_together_leave_no_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("frame.vtu");
        let bad: [fn(&mut Frame); 5] = [
            |f| f.level.truncate(1),
            |f| f.displacement_mm[2][1] = f64::NAN,
            |f| f.points_mm[4][2] = f64::INFINITY,
            |f| f.tets[1][3] = 5,
            |f| f.indicator[0] = f64::NEG_INFINITY,
        ];
        for spoil in bad {
            let mut spoiled = frame();
            spoil(&mut spoiled);
            let error = write_vtu(&path, &spoiled).unwrap_err();
            assert!(matches!(error, SimError::Value { .. }), "{error}");
            assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
        }
        // A directory can't be replaced by a file.
        fs::create_dir(&path).unwrap();
        assert!(matches!(write_vtu(&path, &frame()).unwrap_err(), SimError::Io(..)));
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
        let nowhere = dir.path().join("no such folder/frame.vtu");
        assert!(matches!(write_vtu(&nowhere, &frame()).unwrap_err(), SimError::Io(..)));
    }
}
