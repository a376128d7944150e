//! What holds for all image formats alike: orientation, recognition, and that no bytes panic.
#![cfg(all(feature = "nifti", feature = "nrrd", feature = "metaimage"))]

mod fuzz;
#[path = "../nifti/file.rs"]
#[allow(dead_code)]
mod nifti;
mod scratch;

use nalgebra::{Matrix3, Rotation3, Vector3};
use yawara_mesh::ImageError;
use yawara_mesh::image::{read_intensities_with, read_labels_with};
use yawara_mesh::volume::LabelVolume;

use scratch::{assert_says, labels, read_files};

/// An image as it is stored: 24 voxels, first axis fastest.
struct Stored {
    dims: [usize; 3],
    voxels: Vec<i16>,
    /// Columns: steps along the file's axes in RAS, mm.
    steps: Matrix3<f64>,
    first: Vector3<f64>,
}

impl Stored {
    /// The volume of 2 × 3 × 4 voxels numbered in RAS order, with file axis a along RAS axis
    /// `order[a]`, backwards if `flip[a]`.
    fn new(
        order: [usize; 3],
        flip: [bool; 3],
        turn: &Matrix3<f64>,
        spacing: Vector3<f64>,
        corner: Vector3<f64>,
    ) -> Self {
        let ras = [2usize, 3, 4];
        let dims = order.map(|axis| ras[axis]);
        let (mut steps, mut first) = (Matrix3::zeros(), corner);
        for a in 0..3 {
            let step: Vector3<f64> = turn.column(order[a]) * spacing[order[a]];
            steps.set_column(a, &if flip[a] { -step } else { step });
            if flip[a] {
                first += step * (dims[a] - 1) as f64;
            }
        }
        let mut voxels = Vec::new();
        for index in 0..24 {
            let here = [index % dims[0], index / dims[0] % dims[1], index / (dims[0] * dims[1])];
            let mut at = [0; 3];
            for a in 0..3 {
                at[order[a]] = if flip[a] { dims[a] - 1 - here[a] } else { here[a] };
            }
            voxels.push((at[0] + 2 * (at[1] + 3 * at[2])) as i16);
        }
        Self { dims, voxels, steps, first }
    }

    fn nifti(&self) -> Vec<u8> {
        let mut file = nifti::File::new(self.dims.map(|d| d as i16), &self.voxels);
        file.sform(&self.steps, self.first);
        file.bytes()
    }

    /// In a space whose axes are RAS times `signs`.
    fn nrrd(&self, space: &str, signs: [f64; 3]) -> Vec<u8> {
        let vector =
            |v: Vector3<f64>| format!("({},{},{})", signs[0] * v.x, signs[1] * v.y, signs[2] * v.z);
        let [nx, ny, nz] = self.dims;
        let [a, b, c] = [0, 1, 2].map(|axis| vector(self.steps.column(axis).into()));
        let origin = vector(self.first);
        let header = format!(
            "NRRD0005\ntype: int16\ndimension: 3\nspace: {space}\nsizes: {nx} {ny} {nz}\n\
             space directions: {a} {b} {c}\nspace origin: {origin}\nencoding: raw\n\
             endian: little\n\n"
        );
        [header.as_bytes(), &self.data()].concat()
    }

    fn metaimage(&self) -> Vec<u8> {
        let lps = Vector3::new(-1.0, -1.0, 1.0);
        let numbers = |v: Vector3<f64>| format!("{} {} {} ", v.x, v.y, v.z);
        let [nx, ny, nz] = self.dims;
        let (mut spacing, mut matrix) = (Vector3::zeros(), String::new());
        for axis in 0..3 {
            let step: Vector3<f64> = self.steps.column(axis).into();
            spacing[axis] = step.norm();
            matrix += &numbers(step.normalize().component_mul(&lps));
        }
        let header = format!(
            "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n\
             TransformMatrix = {matrix}\nOffset = {}\nElementSpacing = {}\n\
             DimSize = {nx} {ny} {nz}\nElementType = MET_SHORT\nElementDataFile = LOCAL\n",
            numbers(self.first.component_mul(&lps)),
            numbers(spacing),
        );
        [header.as_bytes(), &self.data()].concat()
    }

    fn data(&self) -> Vec<u8> {
        self.voxels.iter().flat_map(|v| v.to_le_bytes()).collect()
    }

    fn everywhere(&self) -> [Vec<u8>; 5] {
        [
            self.nifti(),
            self.nrrd("RAS", [1.0, 1.0, 1.0]),
            self.nrrd("left-anterior-superior", [-1.0, 1.0, 1.0]),
            self.nrrd("left-posterior-superior", [-1.0, -1.0, 1.0]),
            self.metaimage(),
        ]
    }
}

fn all_48() -> impl Iterator<Item = ([usize; 3], [bool; 3])> {
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    orders.into_iter().flat_map(|order| {
        (0..8).map(move |bits| (order, [bits & 1 != 0, bits & 2 != 0, bits & 4 != 0]))
    })
}

fn assert_same(found: &LabelVolume, want: &LabelVolume, tolerance: f64, what: &str) {
    let (a, b) = (found.grid(), want.grid());
    assert_eq!((a.dims, found.labels()), (b.dims, want.labels()), "{what}");
    assert!((a.spacing_mm - b.spacing_mm).abs() < tolerance, "{what}");
    assert!((a.rotation - b.rotation).norm() < tolerance, "{what}");
    assert!((a.origin_mm - b.origin_mm).norm() < tolerance, "{what}");
}

#[test]
fn all_formats_place_an_oblique_scan_alike_in_48_orientations() {
    let turn = *Rotation3::from_euler_angles(0.3, -0.2, 0.4).matrix();
    let corner = Vector3::new(-17.0, 31.0, 5.0);
    let expected: Vec<u16> = (0..24).collect();
    for (order, flip) in all_48() {
        let stored = Stored::new(order, flip, &turn, Vector3::repeat(2.0), corner);
        for (format, bytes) in stored.everywhere().iter().enumerate() {
            let volume = labels("organ", bytes).unwrap();
            let what = format!("format {format}, {order:?} {flip:?}");
            assert_eq!(volume.labels(), expected, "{what}");
            // NIfTI holds f32: 24 bits of numbers up to 32, summed four times.
            let tolerance = if format == 0 { 4.0 * 32.0 * 1.2e-7 } else { 1e-12 };
            let grid = volume.grid();
            assert!((grid.rotation - turn).norm() < tolerance, "{what}");
            let centre = grid.to_ras_mm(Vector3::repeat(0.001));
            assert!((centre - corner).norm() < tolerance, "{what}: {centre}");
        }
    }
}

#[test]
fn all_formats_resample_alike() {
    let corner = Vector3::new(-7.0, 11.0, 5.0);
    let spacing = Vector3::new(1.5, 2.0, 3.5);
    let straight = Matrix3::identity();
    let first = Stored::new([0, 1, 2], [false; 3], &straight, spacing, corner);
    let want = labels("organ", &first.nifti()).unwrap();
    assert_eq!((want.grid().dims, want.grid().spacing_mm), ([2, 4, 9], 1.5));
    for (order, flip) in all_48() {
        let stored = Stored::new(order, flip, &straight, spacing, corner);
        for bytes in stored.everywhere() {
            assert_same(&labels("organ", &bytes).unwrap(), &want, 1e-12, &format!("{order:?}"));
            let read = |path: &std::path::Path| read_intensities_with(path, None);
            let (image, report) = read_files(&[("organ", &bytes)], read).unwrap();
            assert_eq!(image.grid().dims, want.grid().dims);
            let from = Vector3::from(report.resampling.unwrap().from_mm);
            assert!((from - spacing).norm() < 1e-12, "{from}");
        }
    }
}

#[test]
fn the_report_names_the_format() {
    let stored = Stored::new(
        [0, 1, 2],
        [false; 3],
        &Matrix3::identity(),
        Vector3::repeat(2.0),
        Vector3::zeros(),
    );
    let names = ["NIfTI", "NRRD", "NRRD", "NRRD", "MetaImage"];
    for (bytes, name) in stored.everywhere().iter().zip(names) {
        let read = |path: &std::path::Path| read_labels_with(path, None);
        let (_, report) = read_files(&[("organ", bytes)], read).unwrap();
        assert_eq!((report.format, report.resampling), (name, None));
    }
}

#[test]
fn what_is_no_image_is_refused() {
    let error = labels("photo.png", b"\x89PNG\r\n\x1a\n").unwrap_err();
    assert!(matches!(error.problem(), ImageError::UnknownFormat(_)));
    assert_says(&error, &["PNG", "NRRD", "MetaImage"]);
    assert!(matches!(labels("a.nrrd", b"").unwrap_err().problem(), ImageError::EmptyFile));
    assert_says(&labels("a.nrrd", b"hello\n").unwrap_err(), &["NRRD0001", "hello"]);
    assert_says(&labels("a.mha", b"hello\n").unwrap_err(), &["hello"]);
}

#[test]
#[cfg(not(feature = "dicom"))]
fn what_only_dicom_reads_is_refused_without_it() {
    let folder = tempfile::TempDir::new().unwrap();
    let error = yawara_mesh::image::read_labels(folder.path()).unwrap_err();
    assert!(matches!(error.problem(), ImageError::NotAFile(_)));
    let dicom = [&[0; 128][..], b"DICM"].concat();
    let error = labels("slice", &dicom).unwrap_err();
    assert!(matches!(error.problem(), ImageError::FormatNotBuilt { feature: "dicom", .. }));
}
