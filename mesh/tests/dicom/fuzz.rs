//! Damaged files of every transfer syntax: an error or a valid volume, never a panic.

use proptest::prelude::*;
use proptest::sample::Index;
use yawara_mesh::ImageError;
use yawara_mesh::image::{read_intensities, read_labels};

use super::encoders::{jpeg_lossless, rle};
use super::syntaxes::RAMP;
use super::writer::*;

#[derive(Debug, Clone)]
struct Damage {
    flips: Vec<(Index, u8)>,
    bytes: Vec<(Index, u8)>,
    /// Changes near the end, where the pixels are.
    late: Vec<(Index, u8)>,
    keep: f64,
    repeat: Option<(Index, u8)>,
}

impl Damage {
    fn to(&self, mut bytes: Vec<u8>) -> Vec<u8> {
        for (index, bit) in &self.flips {
            let at = index.index(bytes.len());
            bytes[at] ^= 1 << bit;
        }
        // The preamble is nobody's; behind it stand tags, lengths, numbers.
        for (index, byte) in &self.bytes {
            let at = 132 + index.index(bytes.len() - 132);
            bytes[at] = *byte;
        }
        for (index, byte) in &self.late {
            let count = bytes.len();
            bytes[count - 1 - index.index(count.min(350))] = *byte;
        }
        if let Some((index, times)) = &self.repeat {
            let at = 132 + index.index(bytes.len() - 132);
            let byte = bytes[at];
            bytes.splice(at..at, std::iter::repeat_n(byte, usize::from(*times)));
        }
        bytes.truncate((bytes.len() as f64 * self.keep) as usize);
        bytes
    }
}

fn damage() -> impl Strategy<Value = Damage> {
    let byte = || prop_oneof![any::<u8>(), prop::sample::select(vec![0, 1, 0x7f, 0x80, 0xff])];
    let flips = prop::collection::vec((any::<Index>(), 0u8..8), 0..4);
    let bytes = prop::collection::vec((any::<Index>(), byte()), 0..3);
    let late = prop::collection::vec((any::<Index>(), byte()), 0..4);
    let keep = prop_oneof![6 => Just(1.0), 1 => 0.0..1.0];
    let repeat = prop::option::weighted(0.2, (any::<Index>(), 1u8..24));
    (flips, bytes, late, keep, repeat).prop_map(|(flips, bytes, late, keep, repeat)| Damage {
        flips,
        bytes,
        late,
        keep,
        repeat,
    })
}

/// Two slices of one series in each syntax.
fn series() -> Vec<[Vec<u8>; 2]> {
    let pixels: Vec<i16> = (0..1440).map(|i| 3 * i - 1000).collect();
    let words: Vec<u16> = pixels.iter().map(|&pixel| pixel as u16).collect();
    let cells: Vec<u32> = words.iter().map(|&word| word.into()).collect();
    let mut baseline = Vec::new();
    jpeg_encoder::Encoder::new(&mut baseline, 80)
        .encode(&[77; 1440], 40, 36, jpeg_encoder::ColorType::Luma)
        .unwrap();
    baseline.resize(baseline.len().next_multiple_of(2), 0);
    let plain = |z| File::slice(z, 4, 3, &pixels[..12]);
    let large = |z| File::slice(z, 40, 36, &pixels);
    let mut all = Vec::new();
    for syntax in [IMPLICIT, EXPLICIT, BIG_ENDIAN, DEFLATED] {
        all.push([0, 1].map(|z| plain(z).syntax(syntax).bytes()));
    }
    let compressed = [
        (RLE, rle(&cells, 2)),
        (JPEG_LOSSLESS, jpeg_lossless(&words, 40, 36, 16)),
        (JPEG_2000, RAMP.to_vec()),
    ];
    for (syntax, stream) in compressed {
        all.push([0, 1].map(|z| large(z).fragments(syntax, vec![stream.clone()]).bytes()));
    }
    all.push([0, 1].map(|z| {
        let file = large(z).bits(8, 8, 7, false);
        file.fragments(JPEG_BASELINE, vec![baseline.clone()]).bytes()
    }));
    all
}

fn run(cases: u32) {
    let series = series();
    // Undamaged files are read: the damage starts from something that works.
    for [a, b] in &series {
        let folder = Folder::new(&[("a.dcm", a.clone()), ("b.dcm", b.clone())]);
        assert!(read_labels(folder.path()).is_ok());
    }
    let folder = Folder::new(&[]);
    let config = ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(cases) };
    proptest!(config, |(which in any::<Index>(), damage in damage())| {
        let [whole, other] = &series[which.index(series.len())];
        let bytes = damage.to(other.clone());
        std::fs::write(folder.file("a.dcm"), whole).unwrap();
        std::fs::write(folder.file("b.dcm"), &bytes).unwrap();
        match read_labels(folder.path()) {
            Ok(volume) => {
                prop_assert_eq!(Some(volume.labels().len()), volume.grid().voxel_count());
                // Pixels are uncompressed, or one of the frames above; a voxel is made 256.
                prop_assert!(volume.labels().len() <= 256 * 2 * (1440 + bytes.len()));
            }
            Err(ImageError::TooManyLabels { .. }) => {}
            Err(error) => {
                let folder = folder.path().display().to_string();
                prop_assert!(error.to_string().contains(&folder), "names no file: {}", error);
            }
        }
        if let Ok(image) = read_intensities(folder.path()) {
            prop_assert!(image.values().iter().all(|value| value.is_finite()));
        }
    });
}

#[test]
fn damaged_files_never_panic() {
    run(1_000);
}

#[test]
#[ignore = "slow: 1e5 cases"]
fn many_damaged_files_never_panic() {
    run(100_000);
}
