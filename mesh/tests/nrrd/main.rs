//! NRRD files written line by line: what is read, what is refused and how.
#![cfg(feature = "nrrd")]

#[path = "../image_formats/scratch.rs"]
mod scratch;

use nalgebra::Vector3;
use yawara_mesh::ImageError;
use yawara_mesh::image::{read_intensities, read_labels};
use yawara_mesh::volume::LabelVolume;

use scratch::{assert_says, gzip, labels, read_files};

/// A header under construction, and the data after it.
#[derive(Clone)]
struct File {
    magic: &'static str,
    fields: Vec<(String, String)>,
    data: Vec<u8>,
}

impl File {
    /// 2 × 2 × 1 voxels 0, 1, 300, 1 as int16 in 2 mm cubes.
    fn small() -> Self {
        let voxels = [0i16, 1, 300, 1];
        let data = voxels.iter().flat_map(|v| v.to_le_bytes()).collect();
        let file = Self { magic: "NRRD0004", fields: vec![], data };
        file.set("type", "short")
            .set("dimension", "3")
            .set("space", "right-anterior-superior")
            .set("sizes", "2 2 1")
            .set("space directions", "(2,0,0) (0,2,0) (0,0,2)")
            .set("endian", "little")
            .set("encoding", "raw")
            .set("space origin", "(0,0,0)")
    }

    fn set(mut self, name: &str, value: &str) -> Self {
        self.fields.retain(|(other, _)| other != name);
        self.fields.push((name.into(), value.into()));
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

    fn header(&self) -> String {
        let lines = self.fields.iter().map(|(name, value)| format!("{name}: {value}\n"));
        format!("{}\n# a comment\n{}", self.magic, lines.collect::<String>())
    }

    fn bytes(&self) -> Vec<u8> {
        [self.header().as_bytes(), b"\n", &self.data].concat()
    }

    fn labels(&self) -> Result<LabelVolume, ImageError> {
        labels("organ.nrrd", &self.bytes())
    }

    fn error(&self) -> ImageError {
        self.labels().unwrap_err()
    }

    fn detached(&self, name: &str, data: &[u8]) -> Result<LabelVolume, ImageError> {
        let header = self.clone().set("data file", name).header();
        let name = name.trim_start_matches("./");
        read_files(&[("organ.nhdr", header.as_bytes()), (name, data)], read_labels)
    }
}

fn assert_small(volume: &LabelVolume) {
    assert_eq!(volume.grid().dims, [2, 2, 1]);
    assert_eq!((volume.labels(), volume.values()), (&[0, 1, 2, 1][..], &[0, 1, 300][..]));
    assert_eq!(volume.grid().spacing_mm, 2.0);
    assert_eq!(volume.grid().origin_mm, Vector3::repeat(-1.0));
}

#[test]
fn versions_endings_and_spellings_are_read() {
    for magic in ["NRRD0001", "NRRD0002", "NRRD0003", "NRRD0004", "NRRD0005"] {
        assert_small(&File { magic, ..File::small() }.labels().unwrap());
    }
    for magic in ["NRRD0000", "NRRD0006", "NRRD00041", "NRRD000"] {
        let error = File { magic, ..File::small() }.error();
        assert_says(&error, &["line 1", magic, "NRRD0001"]);
    }
    let dos = File::small().header().replace('\n', "\r\n");
    assert_small(
        &labels("a.nrrd", &[dos.as_bytes(), b"\r\n", &File::small().data].concat()).unwrap(),
    );
    let odd = File::small().set("Space Units", "\"mm\" \"\" \"mm\"").set("key:=any", "x");
    assert_small(&odd.without("space").set("SPACE", "RAS").labels().unwrap());
    // The content tells the format, whatever the name says.
    assert_small(&labels("organ.nii", &File::small().bytes()).unwrap());
}

#[test]
fn encodings_are_read() {
    let small = File::small();
    let zipped = small.clone().data(gzip(&small.data));
    for encoding in ["gzip", "gz", "GZIP"] {
        assert_small(&zipped.clone().set("encoding", encoding).labels().unwrap());
    }
    for (encoding, text) in
        [("text", "0 1\n300 1\n"), ("ascii", "0, 1, 300, 1"), ("txt", "0\t1 300 1")]
    {
        let file = small.clone().set("encoding", encoding).data(text.into()).without("endian");
        assert_small(&file.labels().unwrap());
    }
    let big: Vec<u8> = [0i16, 1, 300, 1].iter().flat_map(|v| v.to_be_bytes()).collect();
    assert_small(&small.clone().set("endian", "big").data(big).labels().unwrap());
    for bad in ["hex", "bzip2", "bz2", "zip"] {
        assert_says(&small.clone().set("encoding", bad).error(), &["encoding", bad, "gzip"]);
    }
    assert_says(&small.clone().set("endian", "middle").error(), &["endian", "middle", "big"]);
    assert_says(&small.without("endian").error(), &["endian"]);
}

/// Stores a value in a type.
type Encoder = fn(u8) -> Vec<u8>;

#[test]
fn every_real_type_is_read_by_all_its_names() {
    let cases: [(&str, Encoder); 10] = [
        ("signed char,int8,int8_t", |v| vec![v]),
        ("uchar,unsigned char,uint8,uint8_t", |v| vec![v]),
        ("short,short int,signed short,signed short int,int16,int16_t", |v| {
            i16::from(v).to_le_bytes().into()
        }),
        ("ushort,unsigned short,unsigned short int,uint16,uint16_t", |v| {
            u16::from(v).to_le_bytes().into()
        }),
        ("int,signed int,int32,int32_t", |v| i32::from(v).to_le_bytes().into()),
        ("uint,unsigned int,uint32,uint32_t", |v| u32::from(v).to_le_bytes().into()),
        ("longlong,long long,long long int,signed long long,int64,int64_t", |v| {
            i64::from(v).to_le_bytes().into()
        }),
        ("ulonglong,unsigned long long,unsigned long long int,uint64,uint64_t", |v| {
            u64::from(v).to_le_bytes().into()
        }),
        ("float", |v| f32::from(v).to_le_bytes().into()),
        ("double", |v| f64::from(v).to_le_bytes().into()),
    ];
    for (names, encode) in cases {
        for name in names.split(',') {
            let data: Vec<u8> = [0u8, 1, 120, 7].into_iter().flat_map(encode).collect();
            let file = File::small().set("type", name).data(data);
            assert_eq!(file.labels().unwrap().labels(), [0, 1, 3, 2], "{name}");
            let image = read_files(&[("a.nrrd", &file.bytes())], read_intensities).unwrap();
            assert_eq!(image.values(), [0.0, 1.0, 120.0, 7.0], "{name}");
        }
    }
    for bad in ["block", "half", ""] {
        assert_says(&File::small().set("type", bad).error(), &["type", bad, "double"]);
    }
}

#[test]
fn detached_data_are_read_from_the_same_folder_only() {
    let file = File::small();
    let data = &file.data[..];
    assert_small(&file.detached("organ.raw", data).unwrap());
    assert_small(&file.detached("./organ with blanks.raw", data).unwrap());
    let zipped = file.clone().set("encoding", "gzip").detached("organ.raw.gz", &gzip(data));
    assert_small(&zipped.unwrap());
    let lone = file.clone().without("encoding").set("datafile", "none.raw").set("encoding", "raw");
    assert_says(&lone.error(), &["none.raw"]);
    for (bad, word) in [
        ("LIST", "join"),
        ("LIST 2", "join"),
        ("slice%03d.raw 1 10 1", "pattern"),
        ("../organ.raw", "own folder"),
        ("/etc/hostname", "own folder"),
        ("..", "own folder"),
        ("a\\b.raw", "own folder"),
        ("./", "own folder"),
    ] {
        let error = file.clone().set("data file", bad).error();
        assert_says(&error, &["data file", word]);
    }
}

#[test]
fn lines_and_bytes_are_skipped() {
    let file = File::small();
    let data = &file.data[..];
    let lead = [b"one\ntwo\nxyz", data].concat();
    let skipping = file.clone().set("line skip", "2").set("byte skip", "3");
    assert_small(&skipping.detached("a.raw", &lead).unwrap());
    // Lines before, bytes after inflating.
    let inner = gzip(&[b"xyz", data].concat());
    let zipped = skipping.clone().set("encoding", "gzip");
    assert_small(&zipped.detached("a.gz", &[b"one\ntwo\n", &inner[..]].concat()).unwrap());
    let last = file.clone().set("byteskip", "-1");
    assert_small(&last.detached("a.raw", &lead).unwrap());
    assert!(matches!(
        last.detached("a.raw", b"1234567").unwrap_err().problem(),
        ImageError::Length { .. }
    ));
    let text = file.clone().set("encoding", "text").set("lineskip", "1");
    assert_small(&text.clone().data(b"# 9 9\n0 1 300 1".into()).labels().unwrap());
    for (field, bad) in [("line skip", "-1"), ("line skip", "x"), ("byte skip", "-2")] {
        assert_says(&file.clone().set(field, bad).error(), &[field, bad]);
    }
    assert_says(&file.clone().set("line skip", "9").error(), &["line skip", "no more lines"]);
    assert!(matches!(
        file.clone().set("byte skip", "99").error().problem(),
        ImageError::Length { .. }
    ));
    assert_says(&zipped.without("line skip").set("byte skip", "-1").error(), &["byte skip", "raw"]);
}

#[test]
fn spaces_units_and_spacings_place_the_voxels() {
    let at = |file: File| {
        let volume = file.labels().unwrap();
        (volume.grid().origin_mm, volume.labels().to_vec())
    };
    let moved = File::small().set("space origin", "(10,20, 30)");
    assert_eq!(at(moved.clone()).0, Vector3::new(9.0, 19.0, 29.0));
    // Steps of +2 along left are steps of −2 along right: the row is turned round.
    for (names, signs, order) in [
        (["left-anterior-superior", "LAS"], [-1.0, 1.0], [1, 0, 1, 2]),
        (["left-posterior-superior", "LPS"], [-1.0, -1.0], [1, 2, 1, 0]),
        (["right-anterior-superior", "RAS"], [1.0, 1.0], [0, 1, 2, 1]),
    ] {
        for name in names {
            let (origin, voxels) = at(moved.clone().set("space", name));
            let low = |sign: f64, first: f64| (sign * first).min(sign * (first + 2.0)) - 1.0;
            let want = Vector3::new(low(signs[0], 10.0), low(signs[1], 20.0), 29.0);
            assert_eq!((origin, &voxels[..]), (want, &order[..]), "{name}");
        }
    }
    let centimetres = File::small()
        .set("space directions", "(.2,0,0) (0,.2,0) (0,0,.2)")
        .set("space units", "\"cm\" \"cm\" \"cm\"");
    assert!((centimetres.labels().unwrap().grid().spacing_mm - 2.0).abs() < 1e-12);
    let metres = centimetres.set("space units", "\"m\" \"m\" \"microns\"");
    assert!(matches!(metres.error().problem(), ImageError::ResampledVoxels { .. }));
    let plain = File::small().without("space").without("space directions").without("space origin");
    assert_small(&plain.clone().set("spacings", "2 2 2").labels().unwrap());
    let units = plain.clone().set("spacings", ".002 2000 .2").set("units", "\"m\" \"um\" \"cm\"");
    assert!((units.labels().unwrap().grid().spacing_mm - 2.0).abs() < 1e-12);
    for bad in ["0 2 2", "2 nan 2", "2 -2 2", "inf 2 2", "2 2", "2 2 2 2", "a b c"] {
        assert_says(&plain.clone().set("spacings", bad).error(), &["spacings", bad]);
    }
    assert_says(&plain.error(), &["spacings", "space directions"]);
}

#[test]
fn axes_of_size_one_go_others_not() {
    let file = File::small().set("dimension", "4");
    let none = "(2,0,0) (0,2,0) (0,0,2) none";
    let trailing = file.clone().set("sizes", "2 2 1 1").set("space directions", none);
    assert_small(&trailing.labels().unwrap());
    let leading = file
        .clone()
        .set("sizes", "1 2 2 1")
        .set("space directions", "none (2,0,0) (0,2,0) (0,0,2)");
    assert_small(&leading.labels().unwrap());
    let series = trailing.clone().set("sizes", "2 2 1 5");
    assert!(matches!(
        series.error().problem(),
        ImageError::NotThreeDimensional { rank: 4, count: 5, .. }
    ));
    let spaced = |sizes, spacings| {
        file.clone().without("space directions").set("sizes", sizes).set("spacings", spacings)
    };
    assert_small(&spaced("2 2 1 1", "2 2 2 nan").labels().unwrap());
    assert!(matches!(
        spaced("2 2 3 5", "2 2 2 nan").error().problem(),
        ImageError::NotThreeDimensional { rank: 4, count: 5, .. }
    ));
    for bad in ["0", "2", "17", "-3", "x", "3.0"] {
        assert_says(&File::small().set("dimension", bad).error(), &["dimension", bad]);
    }
}

#[test]
fn bad_headers_are_refused_by_line_and_field() {
    let cases = [
        ("sizes", "2 2", "per dimension"),
        ("sizes", "2 0 1", "≥ 1"),
        ("sizes", "2 -2 1", "≥ 1"),
        ("space", "scanner-xyz", "right-anterior"),
        ("space", "3D-right-handed", "right-anterior"),
        ("space", "left-posterior-superior-time", "time"),
        ("space directions", "(2,0,0) (0,2,0)", "per axis"),
        ("space directions", "(2,0,0) (0,2,0) none", "three axes"),
        ("space directions", "(2,0,0) (0,2,0) (0,0,nan)", "finite"),
        ("space directions", "(2,0,0) (0,2,0) (0,0,2", "finite"),
        ("space directions", "(2,0,0,0) (0,2,0) (0,0,2)", "finite"),
        ("space origin", "(0,0)", "finite"),
        ("space origin", "(0,0,inf)", "finite"),
        ("space units", "\"mm\" \"mm\"", "quotes"),
        ("space units", "\"mm\" \"mm\" \"inch\"", "cm"),
        ("space units", "mm mm mm", "quotes"),
    ];
    for (field, value, word) in cases {
        assert_says(&File::small().set(field, value).error(), &["line", field, word]);
    }
    for field in ["type", "dimension", "sizes", "encoding", "space"] {
        let error = File::small().without(field).error();
        assert!(matches!(error.problem(), ImageError::MissingField(_)), "{error}");
        assert_says(&error, &[field]);
    }
    let dimension = File::small().without("space").set("space dimension", "3");
    assert_says(&dimension.error(), &["space dimension", "named"]);
    assert_says(&File::small().set("Sizes", "2 2 1").error(), &["Sizes", "once"]);
    assert_says(&File::small().set("a\nb", "c").error(), &["line", "field: value"]);
    let flat = File::small().set("space directions", "(2,0,0) (2,0,0) (0,0,2)");
    assert!(matches!(
        flat.error().problem(),
        ImageError::SingularAffine { form: "space directions", .. }
    ));
    let sheared = File::small().set("space directions", "(2,0,0) (1,2,0) (0,0,2)");
    assert!(matches!(sheared.error().problem(), ImageError::ShearedAffine { axes: [0, 1], .. }));
}

#[test]
fn forged_sizes_take_no_memory() {
    let huge = File::small().set("sizes", "100000 100000 100");
    assert!(matches!(huge.error().problem(), ImageError::TooManyVoxels { .. }));
    let overflow = File::small().set("sizes", "18446744073709551615 9 9");
    assert!(matches!(overflow.error().problem(), ImageError::TooManyVoxels { .. }));
    // Within the limit but not there, in every encoding.
    let absent = File::small().set("sizes", "2000 1000 1000").set("type", "double");
    assert!(matches!(absent.error().problem(), ImageError::Length { want: 16_000_000_000, .. }));
    let zipped = absent.clone().set("encoding", "gzip").data(gzip(&[0; 64]));
    assert!(matches!(zipped.error().problem(), ImageError::Length { found: 64, .. }));
    let text = absent.set("encoding", "text").data(b"1 2 3".into());
    assert!(matches!(text.error().problem(), ImageError::TextVoxel { index: 3, .. }));
    let endless = [b"NRRD0004\n", &vec![b'#'; 2 << 20][..]].concat();
    assert!(matches!(
        labels("a.nrrd", &endless).unwrap_err().problem(),
        ImageError::HeaderTooLong(_)
    ));
}

#[test]
fn data_of_the_wrong_length_or_kind_are_refused() {
    let file = File::small();
    let cut = file.clone().data(file.data[..7].into());
    assert!(matches!(cut.error().problem(), ImageError::Length { found: 7, want: 8, .. }));
    let long = file.clone().data([&file.data[..], b"\n"].concat());
    assert!(matches!(long.error().problem(), ImageError::TooLong { want: 8, .. }));
    let zipped = gzip(&file.data);
    for length in 1..zipped.len() {
        let cut = file.clone().set("encoding", "gzip").data(zipped[..length].into());
        assert!(cut.labels().is_err(), "cut at {length}");
    }
    let mut damaged = zipped.clone();
    damaged[zipped.len() - 6] ^= 1; // in the checksum
    let error = file.clone().set("encoding", "gzip").data(damaged).error();
    assert!(matches!(error.problem(), ImageError::Inflate(_)), "{error}");
    let text = file.set("encoding", "text");
    let long = text.clone().data(b"0 1 300 1 0".into());
    assert!(matches!(long.error().problem(), ImageError::TooLong { want: 4, .. }));
    for (words, index) in [("0 1 40000 1", 2), ("0 1 3.5 1", 2), ("x", 0), ("0 1 2", 3)] {
        let error = text.clone().data(words.into()).error();
        assert!(
            matches!(error.problem(), ImageError::TextVoxel { index: i, .. } if *i == index),
            "{error}"
        );
        assert_says(&error, &["i16"]);
    }
}

/// As 3D Slicer writes them; segments without a label or a name have none.
#[test]
fn segments_of_slicer_name_labels() {
    let segments = "Segment0_Name:=left lobe\nSegment0_LabelValue:=300\nSegment0_Color:=0 1 0\n\
                    Segment1_LabelValue:=1\nSegment1_Name:= \nSegment2_Name:=gone\n\
                    Segment3_LabelValue:=x\nSegment3_Name:=odd\n";
    let whole = File::small().bytes();
    let bytes = [b"NRRD0004\n", segments.as_bytes(), &whole[b"NRRD0004\n".len()..]].concat();
    let folder = tempfile::TempDir::new().unwrap();
    let path = folder.path().join("organ.seg.nrrd");
    std::fs::write(&path, bytes).unwrap();
    let (volume, report) = yawara_mesh::image::read_labels_with(&path, None).unwrap();
    assert_eq!(volume.values(), [0, 1, 300]);
    assert_eq!(report.label_names.into_iter().collect::<Vec<_>>(), [(300, "left lobe".into())]);
}
