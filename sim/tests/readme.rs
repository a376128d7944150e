//! Every command of the front page, in order, in one folder.

#![cfg(all(feature = "nifti", feature = "view"))]

mod workbench;

use workbench::Workbench;
use yawara_mesh::image::write_labels;
use yawara_mesh::phantom::{LiverPhantom, liver};
use yawara_mesh::volume::{Grid, LabelVolume};

const README: &str = include_str!("../../README.md");

/// What runs the program; a build with more features has other tests.
const PROGRAM: &str = "cargo run --release";

/// The arguments of a command line: words, some in single quotation marks, up to a comment.
fn words(line: &str) -> Vec<String> {
    let (mut words, mut word, mut quoted) = (Vec::new(), String::new(), false);
    for c in line.chars() {
        match c {
            '\'' => quoted = !quoted,
            '#' if !quoted => break,
            ' ' if !quoted => words.extend((!word.is_empty()).then(|| std::mem::take(&mut word))),
            c => word.push(c),
        }
    }
    words.extend((!word.is_empty()).then_some(word));
    words
}

/// Soft tissue in a layer of fat, in Hounsfield units.
fn ct() -> LabelVolume {
    let grid = Grid::centred([32, 20, 20], 8.0);
    let dims = grid.dims;
    let value = |i: usize| {
        let at = [i % dims[0], i / dims[0] % dims[1], i / (dims[0] * dims[1])];
        let inner = (0..3).all(|axis| (2..dims[axis] - 2).contains(&at[axis]));
        if inner { 40 } else { -100 }
    };
    LabelVolume::from_original(grid, (0..32 * 20 * 20).map(value)).unwrap()
}

#[test]
fn every_command_of_the_front_page_works_in_order() {
    let bench = Workbench::new();
    let labels = liver(LiverPhantom { voxel_mm: 4.0, ..LiverPhantom::default() }).unwrap();
    for name in ["IMAGE.nii.gz", "LABELS.nii.gz"] {
        write_labels(&bench.path(name), &labels).unwrap();
    }
    write_labels(&bench.path("CT.nii.gz"), &ct()).unwrap();
    let mut run = 0;
    for line in README.lines().filter_map(|line| line.strip_prefix(PROGRAM)) {
        let Some(arguments) = line.strip_prefix(" -- ").or(line.is_empty().then_some("")) else {
            continue;
        };
        let arguments = words(arguments);
        bench.succeed(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
        run += 1;
    }
    assert!(run >= 14, "{run} commands are few");
}
