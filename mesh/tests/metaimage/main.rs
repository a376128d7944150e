//! MetaImage files written line by line: what is read, what is refused and how.
#![cfg(feature = "metaimage")]

#[path = "../image_formats/scratch.rs"]
mod scratch;

use nalgebra::Vector3;
use yawara_mesh::ImageError;
use yawara_mesh::image::{read_intensities, read_labels};
use yawara_mesh::volume::LabelVolume;

use scratch::{assert_says, gzip, labels, read_files, zlib};

/// A header under construction, without its last field, and the data after it.
#[derive(Clone)]
struct File {
    fields: Vec<(String, String)>,
    data: Vec<u8>,
}

impl File {
    /// 2 × 2 × 1 voxels 0, 1, 300, 1 in RAS order as int16 in 2 mm cubes.
    fn small() -> Self {
        let data = [0i16, 1, 300, 1].iter().flat_map(|v| v.to_le_bytes()).collect();
        Self { fields: vec![], data }
            .set("ObjectType", "Image")
            .set("NDims", "3")
            .set("BinaryData", "True")
            .set("BinaryDataByteOrderMSB", "False")
            .set("CompressedData", "False")
            // From left, posterior: both axes backwards.
            .set("TransformMatrix", "-1 0 0 0 -1 0 0 0 1")
            .set("Offset", "0 0 0")
            .set("CenterOfRotation", "0 0 0")
            .set("AnatomicalOrientation", "LPS")
            .set("ElementSpacing", "2 2 2")
            .set("DimSize", "2 2 1")
            .set("ElementType", "MET_SHORT")
    }

    fn set(mut self, name: &str, value: &str) -> Self {
        match self.fields.iter_mut().find(|(other, _)| other == name) {
            Some((_, old)) => *old = value.into(),
            None => self.fields.push((name.into(), value.into())),
        }
        self
    }

    fn without(mut self, name: &str) -> Self {
        self.fields.retain(|(other, _)| other != name);
        self
    }

    fn data(mut self, data: Vec<u8>) -> Self {
        self.data = data;
        self
    }

    fn header(&self, data_file: &str) -> String {
        let lines = self.fields.iter().map(|(name, value)| format!("{name} = {value}\n"));
        format!("{}ElementDataFile = {data_file}\n", lines.collect::<String>())
    }

    fn bytes(&self) -> Vec<u8> {
        [self.header("LOCAL").as_bytes(), &self.data].concat()
    }

    fn labels(&self) -> Result<LabelVolume, ImageError> {
        labels("organ.mha", &self.bytes())
    }

    fn error(&self) -> ImageError {
        self.labels().unwrap_err()
    }

    fn detached(&self, name: &str, data: &[u8]) -> Result<LabelVolume, ImageError> {
        let header = self.header(name);
        read_files(&[("organ.mhd", header.as_bytes()), (name, data)], read_labels)
    }
}

fn assert_small(volume: &LabelVolume) {
    assert_eq!(volume.grid().dims, [2, 2, 1]);
    assert_eq!((volume.labels(), volume.values()), (&[0, 1, 2, 1][..], &[0, 1, 300][..]));
    assert_eq!(volume.grid().spacing_mm, 2.0);
    assert_eq!(volume.grid().origin_mm, Vector3::repeat(-1.0));
}

#[test]
fn local_and_detached_data_are_read() {
    let file = File::small();
    assert_small(&file.labels().unwrap());
    assert_small(&file.detached("organ.raw", &file.data).unwrap());
    let dos = file.header("LOCAL").replace('\n', "\r\n");
    assert_small(&labels("a.mha", &[dos.as_bytes(), &file.data].concat()).unwrap());
    // The content tells the format, whatever the name says; `ObjectType` may be missing.
    assert_small(&labels("organ.nii", &file.bytes()).unwrap());
    assert_small(&labels("organ", &file.clone().without("ObjectType").bytes()).unwrap());
    for (bad, word) in [
        ("LIST", "join"),
        ("slice%03d.raw 1 10 1", "pattern"),
        ("../organ.raw", "own folder"),
        ("/etc/hostname", "own folder"),
    ] {
        let error = labels("a.mhd", file.header(bad).as_bytes()).unwrap_err();
        assert_says(&error, &["ElementDataFile", word]);
    }
    assert_says(&labels("a.mhd", file.header("none.raw").as_bytes()).unwrap_err(), &["none.raw"]);
}

#[test]
fn compressed_data_are_read() {
    let file = File::small().set("CompressedData", "True");
    for packed in [zlib(&file.data), gzip(&file.data)] {
        let size = packed.len().to_string();
        assert_small(&file.clone().data(packed.clone()).labels().unwrap());
        let sized = file.clone().set("CompressedDataSize", &size).data(packed.clone());
        assert_small(&sized.labels().unwrap());
        assert_small(&sized.detached("organ.zraw", &packed).unwrap());
        for file in [&file, &sized] {
            let followed = file.clone().data([&packed[..], b"more"].concat());
            assert!(followed.labels().is_err());
        }
        for length in 1..packed.len() - 1 {
            let cut = file.clone().data(packed[..length].into());
            assert!(cut.labels().is_err(), "cut at {length}");
        }
        let mut damaged = packed.clone();
        let last = packed.len() - if packed[0] == 0x1f { 6 } else { 2 };
        damaged[last] ^= 1; // in the checksum
        let error = file.clone().data(damaged).error();
        assert!(matches!(error.problem(), ImageError::Inflate(_)), "{error}");
    }
    for bad in ["0", "-1", "x"] {
        let file = file.clone().set("CompressedDataSize", bad).data(zlib(&file.data));
        assert_says(&file.error(), &["CompressedDataSize", bad]);
    }
}

#[test]
fn byte_orders_text_and_header_sizes_are_read() {
    let file = File::small();
    let big: Vec<u8> = [0i16, 1, 300, 1].iter().flat_map(|v| v.to_be_bytes()).collect();
    let swapped = file.clone().set("BinaryDataByteOrderMSB", "True").data(big.clone());
    assert_small(&swapped.labels().unwrap());
    let element =
        file.clone().without("BinaryDataByteOrderMSB").set("ElementByteOrderMSB", "True").data(big);
    assert_small(&element.labels().unwrap());
    assert_small(&file.clone().without("BinaryDataByteOrderMSB").labels().unwrap());
    let text = file.clone().set("BinaryData", "False").data(b"0 1\n300 1\n".into());
    assert_small(&text.labels().unwrap());
    let error = text.data(b"0 1 40000 1".into()).error();
    assert!(matches!(error.problem(), ImageError::TextVoxel { index: 2, .. }), "{error}");
    let lead = [b"123", &file.data[..]].concat();
    for size in ["3", "-1"] {
        let sized = file.clone().set("HeaderSize", size);
        assert_small(&sized.detached("a.raw", &lead).unwrap());
    }
    for bad in ["-2", "x"] {
        assert_says(&file.clone().set("HeaderSize", bad).error(), &["HeaderSize", bad]);
    }
    assert!(matches!(file.set("HeaderSize", "9").error().problem(), ImageError::Length { .. }));
}

/// Stores a value in a type.
type Encoder = fn(u8) -> Vec<u8>;

#[test]
fn every_real_type_is_read() {
    let cases: [(&str, Encoder); 12] = [
        ("MET_CHAR", |v| vec![v]),
        ("MET_UCHAR", |v| vec![v]),
        ("MET_SHORT", |v| i16::from(v).to_le_bytes().into()),
        ("MET_USHORT", |v| u16::from(v).to_le_bytes().into()),
        ("MET_INT", |v| i32::from(v).to_le_bytes().into()),
        ("MET_UINT", |v| u32::from(v).to_le_bytes().into()),
        ("MET_LONG", |v| i32::from(v).to_le_bytes().into()),
        ("MET_ULONG", |v| u32::from(v).to_le_bytes().into()),
        ("MET_LONG_LONG", |v| i64::from(v).to_le_bytes().into()),
        ("MET_ULONG_LONG", |v| u64::from(v).to_le_bytes().into()),
        ("MET_FLOAT", |v| f32::from(v).to_le_bytes().into()),
        ("MET_DOUBLE", |v| f64::from(v).to_le_bytes().into()),
    ];
    for (name, encode) in cases {
        let data: Vec<u8> = [0u8, 1, 120, 7].into_iter().flat_map(encode).collect();
        let file = File::small().set("ElementType", name).data(data);
        assert_eq!(file.labels().unwrap().labels(), [0, 1, 3, 2], "{name}");
    }
    for bad in ["MET_UCHAR_ARRAY", "MET_STRING", "short"] {
        assert_says(&File::small().set("ElementType", bad).error(), &["ElementType", bad]);
    }
}

#[test]
fn positions_are_turned_to_ras() {
    // Directions of an axis stand together: the first file axis runs to posterior here, the
    // second to left, with steps of 2 mm.
    let file = File::small().set("TransformMatrix", "0 1 0 1 0 0 0 0 1").set("Offset", "10 20 30");
    let volume = file.labels().unwrap();
    // Left 10 and 12, posterior 20 and 22: right −12 and −10, anterior −22 and −20, centres.
    assert_eq!(volume.grid().origin_mm, Vector3::new(-13.0, -23.0, 29.0));
    // Stored [p20 l10, p22 l10, p20 l12, p22 l12] = 0, 1, 300, 1.
    assert_eq!(volume.labels(), [1, 1, 2, 0]);
    for name in ["Position", "Origin"] {
        let same = file.clone().without("Offset").set(name, "10 20 30").labels().unwrap();
        assert_eq!(same, volume);
    }
    for name in ["Orientation", "Rotation"] {
        let matrix = "0 1 0 1 0 0 0 0 1";
        let same = file.clone().without("TransformMatrix").set(name, matrix).labels().unwrap();
        assert_eq!(same, volume);
    }
    // Not the transpose: an axis by 30° in one plane only.
    let turned = File::small().set("TransformMatrix", "-0.8 -0.6 0 0.6 -0.8 0 0 0 1");
    let rotation = turned.labels().unwrap().grid().rotation;
    assert!((rotation.column(0) - Vector3::new(0.8, 0.6, 0.0)).norm() < 1e-12);
    let size = File::small().without("ElementSpacing").set("ElementSize", "2 2 2");
    assert_small(&size.labels().unwrap());
    let cm = File::small().set("DistanceUnits", "cm").set("ElementSpacing", ".2 .2 .2");
    assert!((cm.labels().unwrap().grid().spacing_mm - 2.0).abs() < 1e-12);
}

#[test]
fn intensities_are_scaled() {
    let file = File::small()
        .set("ElementToIntensityFunctionSlope", "0.5")
        .set("ElementToIntensityFunctionOffset", "-10");
    let image = read_files(&[("a.mha", &file.bytes())], read_intensities).unwrap();
    assert_eq!(image.values(), [-10.0, -9.5, 140.0, -9.5]);
    assert!(matches!(file.error().problem(), ImageError::VoxelValue { voxel: [1, 0, 0], .. }));
    let bad = file.set("ElementToIntensityFunctionSlope", "nan");
    assert_says(&bad.error(), &["Slope", "nan", "finite"]);
}

#[test]
fn further_axes_have_size_one() {
    let file = File::small()
        .set("NDims", "4")
        .set("DimSize", "2 2 1 1")
        .set("ElementSpacing", "2 2 2 1")
        .set("Offset", "0 0 0 0")
        .set("TransformMatrix", "-1 0 0 0 0 -1 0 0 0 0 1 0 0 0 0 1");
    assert_small(&file.labels().unwrap());
    let series = file.set("DimSize", "2 2 1 6");
    assert!(matches!(
        series.error().problem(),
        ImageError::NotThreeDimensional { rank: 4, count: 6, .. }
    ));
}

#[test]
fn bad_headers_are_refused_by_line_and_field() {
    let cases = [
        ("ObjectType", "Tube", "Image"),
        ("NDims", "2", "3"),
        ("NDims", "11", "3"),
        ("NDims", "three", "3"),
        ("DimSize", "2 2", "per dimension"),
        ("DimSize", "2 0 1", "≥ 1"),
        ("DimSize", "2 -1 1", "≥ 1"),
        ("ElementSpacing", "2 2 0", "> 0"),
        ("ElementSpacing", "2 nan 2", "> 0"),
        ("ElementSpacing", "2 2", "> 0"),
        ("Offset", "0 0 inf", "finite"),
        ("Offset", "0 0", "finite"),
        ("TransformMatrix", "1 0 0 0 1 0 0 0", "finite"),
        ("TransformMatrix", "1 0 0 0 1 0 0 0 nan", "finite"),
        ("BinaryData", "maybe", "True"),
        ("CompressedData", "maybe", "True"),
        ("BinaryDataByteOrderMSB", "maybe", "True"),
        ("ElementNumberOfChannels", "3", "channel"),
        ("DistanceUnits", "inch", "cm"),
    ];
    for (field, value, word) in cases {
        assert_says(&File::small().set(field, value).error(), &["line", field, value, word]);
    }
    for field in ["NDims", "DimSize", "ElementSpacing", "ElementType", "BinaryData"] {
        let error = File::small().without(field).error();
        assert!(matches!(error.problem(), ImageError::MissingField(_)), "{error}");
        assert_says(&error, &[field]);
    }
    let error = labels("a.mha", b"NDims = 3\n").unwrap_err();
    assert_says(&error, &["ElementDataFile"]);
    let error = labels("a.mha", b"NDims = 3\nnothing\n").unwrap_err();
    assert_says(&error, &["line 2", "nothing"]);
    assert_says(&File::small().set("dimsize", "2 2 1").error(), &["once"]);
    let flat = File::small().set("TransformMatrix", "1 0 0 1 0 0 0 0 1");
    assert!(matches!(flat.error().problem(), ImageError::SingularAffine { .. }));
}

#[test]
fn forged_sizes_take_no_memory() {
    let huge = File::small().set("DimSize", "100000 100000 100");
    assert!(matches!(huge.error().problem(), ImageError::TooManyVoxels { .. }));
    let absent = File::small().set("DimSize", "2000 1000 1000").set("ElementType", "MET_DOUBLE");
    assert!(matches!(absent.error().problem(), ImageError::Length { want: 16_000_000_000, .. }));
    let zipped = absent.clone().set("CompressedData", "True").data(zlib(&[0; 64]));
    assert!(matches!(zipped.error().problem(), ImageError::Length { found: 64, .. }));
    let text = absent.set("BinaryData", "False").data(b"1 2 3".into());
    assert!(matches!(text.error().problem(), ImageError::TextVoxel { index: 3, .. }));
    let endless = [b"NDims = ", &vec![b'3'; 2 << 20][..]].concat();
    assert!(matches!(
        labels("a.mha", &endless).unwrap_err().problem(),
        ImageError::HeaderTooLong(_)
    ));
    let file = File::small();
    let cut = file.clone().data(file.data[..7].into());
    assert!(matches!(cut.error().problem(), ImageError::Length { found: 7, want: 8, .. }));
    let long = file.clone().data([&file.data[..], b"\n"].concat());
    assert!(matches!(long.error().problem(), ImageError::TooLong { want: 8, .. }));
}
