//! NIfTI files written byte by byte: what is read, what is refused and how.
#![cfg(feature = "nifti")]

mod file;
mod orientation;
mod refused;
mod values;

use proptest::prelude::*;
use yawara_mesh::image::{read_intensities, read_labels};

use file::{File, gzip, scratch};

fn fuzz_base() -> File {
    let voxels: Vec<i16> = (0..60).map(|v| v % 5).collect();
    File::new([3, 4, 5], &voxels)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(256) })]

    #[test]
    fn damaged_files_never_panic(
        flips in prop::collection::vec((any::<prop::sample::Index>(), 0u8..8), 0..12),
        keep in prop_oneof![Just(1.0), 0.0..1.0],
        second in any::<bool>(),
        zipped in any::<bool>(),
        flip_after_zip in any::<bool>(),
    ) {
        let flip = |bytes: &mut Vec<u8>| {
            for (index, bit) in &flips {
                let at = index.index(bytes.len());
                bytes[at] ^= 1 << bit;
            }
            let length = (bytes.len() as f64 * keep) as usize;
            bytes.truncate(length);
        };
        let base = fuzz_base();
        let mut bytes = if second { base.second() } else { base.bytes() };
        if !(zipped && flip_after_zip) {
            flip(&mut bytes);
        }
        if zipped {
            bytes = gzip(&bytes);
            if flip_after_zip {
                flip(&mut bytes);
            }
        }
        // Whatever comes back is a valid volume or an error that names the file.
        if let Ok(volume) = scratch(&bytes, read_labels) {
            prop_assert_eq!(volume.labels().len(), volume.grid().voxel_count().unwrap());
        }
        if let Ok(image) = scratch(&bytes, read_intensities) {
            prop_assert!(image.values().iter().all(|v| v.is_finite()));
        }
    }
}
