//! Files with flipped bits and cut ends: an answer or an error, never a panic.

use proptest::prelude::*;
use proptest::sample::Index;
use yawara_mesh::tet_file::read_msh;
use yawara_mesh::tet_file::read_vtu;

use crate::cube::{data, file};

const FILES: [&str; 8] = [
    "gmsh_22_text.msh",
    "gmsh_22_binary.msh",
    "gmsh_41_text.msh",
    "gmsh_41_binary.msh",
    "gmsh_41_parametric.msh",
    "meshio_text.vtu",
    "meshio_plain.vtu",
    "meshio_zlib.vtu",
];

fn read_damaged(name: &str, flips: &[(Index, u8)], keep: f64) {
    let mut bytes = std::fs::read(data(name)).unwrap();
    for (index, bit) in flips {
        let at = index.index(bytes.len());
        bytes[at] ^= 1 << bit;
    }
    bytes.truncate((bytes.len() as f64 * keep) as usize);
    let (_folder, path) = file(name, &bytes);
    let result = if name.ends_with(".msh") { read_msh(&path, 1e-3) } else { read_vtu(&path, 1e-3) };
    match result {
        Ok(loaded) => assert!(loaded.mesh.volume() > 0.0),
        Err(error) => assert!(error.to_string().len() < 1000, "{error}"),
    }
}

fn damage() -> impl Strategy<Value = (&'static str, Vec<(Index, u8)>, f64)> {
    let flips = prop::collection::vec((any::<Index>(), 0u8..8), 0..6);
    (prop::sample::select(&FILES[..]), flips, prop_oneof![3 => Just(1.0), 1 => 0.0..1.0])
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(1000) })]

    #[test]
    fn damaged_files_never_panic((name, flips, keep) in damage()) {
        read_damaged(name, &flips, keep);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(100_000) })]

    #[test]
    #[ignore = "takes minutes: the same with a hundred times the cases"]
    fn damaged_files_never_panic_at_length((name, flips, keep) in damage()) {
        read_damaged(name, &flips, keep);
    }
}
