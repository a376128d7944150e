//! Every command of the front page and of the book's first pages, in order, in one folder; the errors
//! that the book explains.

#![cfg(all(feature = "nifti", feature = "view"))]

use crate::workbench;

use workbench::Workbench;
use yawara_mesh::image::write_labels;
use yawara_mesh::phantom::{LiverPhantom, liver};
use yawara_mesh::volume::{Grid, LabelVolume};

const README: &str = include_str!("../../README.md");
const START_HERE: &str = include_str!("../../docs/start-here.md");
const OWN_ORGAN: &str = include_str!("../../docs/own-organ.md");
const ERRORS: &str = include_str!("../../docs/faq.md");

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

/// A folder with the images that the pages name.
fn with_images() -> Workbench {
    let bench = Workbench::new();
    let labels = liver(LiverPhantom { voxel_mm: 4.0, ..LiverPhantom::default() }).unwrap();
    for name in ["IMAGE.nii.gz", "LABELS.nii.gz"] {
        write_labels(&bench.path(name), &labels).unwrap();
    }
    write_labels(&bench.path("CT.nii.gz"), &ct()).unwrap();
    let in_metres = LabelVolume::from_original(
        Grid::centred([50, 20, 20], 0.004),
        std::iter::repeat_n(1, 20_000),
    );
    write_labels(&bench.path("METRES.nii.gz"), &in_metres.unwrap()).unwrap();
    bench
}

/// Runs all lines that are the program, or begin with it and the separator; those with other features of
/// it have other tests.
fn every_command_works(page: &str, program: &str, separator: &str, least: usize) {
    let bench = with_images();
    let mut run = 0;
    for line in page.lines().filter_map(|line| line.strip_prefix(program)) {
        let Some(arguments) = line.strip_prefix(separator).or(line.is_empty().then_some("")) else {
            continue;
        };
        let arguments = words(arguments);
        bench.succeed(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
        run += 1;
    }
    assert!(run >= least, "{run} commands are few");
}

#[test]
fn every_command_of_the_front_page_works_in_order() {
    every_command_works(README, "cargo run --release", " -- ", 14);
}

#[test]
fn every_command_of_the_books_first_pages_works_in_order() {
    every_command_works(START_HERE, "yawara", " ", 4);
    every_command_works(OWN_ORGAN, "yawara", " ", 7);
}

#[test]
fn the_errors_in_the_book_are_what_the_program_says() {
    let bench = with_images();
    let plain = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let blocks = ERRORS.split("```text\n$ yawara ").skip(1);
    let mut compared = 0;
    for (command, said) in blocks.filter_map(|block| block.split("```").next()?.split_once('\n')) {
        // What a build leaves out, one with more features has.
        if cfg!(feature = "gpu") && said.contains("needs the feature `gpu`") {
            continue;
        }
        let arguments = words(command);
        let output = bench.run(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
        assert_ne!(output.status.code(), Some(0), "{command}");
        assert_eq!(plain(&String::from_utf8_lossy(&output.stderr)), plain(said), "{command}");
        compared += 1;
    }
    assert!(compared >= 12, "{compared} errors are few");
}
