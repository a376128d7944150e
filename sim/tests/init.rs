//! `yawara init`: its scenes run and converge as they are, alike at any size of voxels.

#![cfg(feature = "nifti")]

use crate::workbench;

use serde_json::Value;
use workbench::{Nifti, Workbench};
use yawara_mesh::image::write_labels;
use yawara_mesh::phantom::{LiverPhantom, liver};

/// The summary of the scene that `init` makes for an image; every step must converge.
fn made_and_run(bench: &Workbench, image: &str) -> Value {
    let said = bench.succeed(&["init", image, "--force"]);
    assert!(said.contains("run it with: yawara run scene.toml"), "{said}");
    println!("{said}");
    let run = ["run", "scene.toml", "--out", "out", "--force", "--set", "output.frames_every=0"];
    bench.succeed(&run);
    serde_json::from_str(&bench.read("out/summary.json")).unwrap()
}

/// The largest force on the liver phantom in voxels of this size, N.
fn force_on_phantom(voxel_mm: f64) -> f64 {
    let bench = Workbench::new();
    let volume = liver(LiverPhantom { voxel_mm, ..LiverPhantom::default() }).unwrap();
    write_labels(&bench.path("liver.nii.gz"), &volume).unwrap();
    made_and_run(&bench, "liver.nii.gz")["force"]["max_n"].as_f64().unwrap()
}

#[test]
fn forces_do_not_depend_on_the_voxels() {
    let forces = [1.0, 2.0, 3.0].map(force_on_phantom);
    let [low, high] =
        [forces.into_iter().fold(f64::MAX, f64::min), forces.into_iter().fold(0.0, f64::max)];
    assert!(high <= 1.1 * low, "{forces:?}");
}

#[test]
fn a_block_is_held_and_pulled_without_a_warning() {
    let bench = Workbench::new();
    bench.write("block.nii", Nifti::cube(3).bytes());
    let summary = made_and_run(&bench, "block.nii");
    assert!(summary["warnings"].is_null(), "{}", summary["warnings"]);
    assert!(summary["force"]["max_n"].as_f64().unwrap() > 0.0);
}

#[test]
fn hounsfield_units_are_told_from_labels() {
    let bench = Workbench::new();
    let mut image = Nifti::cube(0);
    image.i16(70, 256);
    image.voxels = (0..512).map(|v| if v % 8 < 4 { 40 } else { 0x9c }).collect();
    bench.write("ct.nii", image.bytes());
    let said = bench.succeed(&["init", "ct.nii"]);
    assert!(said.contains("a CT, by Hounsfield units"), "{said}");
    let scene = bench.read("scene.toml");
    assert!(
        scene.contains("range = [-150.0, -30.0]") && scene.contains("name = \"fat\""),
        "{scene}"
    );
}

#[test]
fn a_scene_is_replaced_only_when_forced_and_nothing_is_refused_half_written() {
    let bench = Workbench::new();
    bench.write("block.nii", Nifti::cube(3).bytes()).write("empty.nii", Nifti::cube(0).bytes());
    bench.refused(&["init", "no.nii"], &["no.nii"]);
    bench.refused(&["init", "empty.nii"], &["empty.nii"]);
    bench.succeed(&["init", "block.nii"]);
    bench.refused(&["init", "block.nii"], &["--out is scene.toml", "--force"]);
    bench.succeed(&["init", "block.nii", "--force"]);
}

/// A kidney and an unknown thing, by the names of 3D Slicer's segments.
#[test]
#[cfg(feature = "nrrd")]
fn labels_with_the_name_of_a_tissue_get_its_material() {
    let bench = Workbench::new();
    let header = "NRRD0004\ntype: uchar\ndimension: 3\nspace: left-posterior-superior\n\
                  sizes: 8 8 8\nspace directions: (5,0,0) (0,5,0) (0,0,5)\n\
                  kinds: domain domain domain\nencoding: raw\nspace origin: (0,0,0)\n\
                  Segment0_LabelValue:=1\nSegment0_Name:=left kidney\n\
                  Segment1_LabelValue:=2\nSegment1_Name:=Segment_2\n\n";
    let voxels = [[1; 256], [2; 256]].concat();
    bench.write("organ.seg.nrrd", [header.as_bytes(), &voxels].concat());
    bench.succeed(&["init", "organ.seg.nrrd"]);
    let scene = bench.read("scene.toml");
    assert!(scene.contains("material = \"kidney cortex (Arda 2011)\""), "{scene}");
    assert_eq!(scene.matches("young_modulus_pa").count(), 1, "{scene}");
    bench.succeed(&["run", "scene.toml", "--steps", "2", "--out", "out"]);
    let ran = bench.read("out/scene.toml");
    assert!(ran.contains("young_modulus_pa = 5000.0\npoisson_ratio = 0.49"), "{ran}");
    // The scene that was written runs again, its numbers beside the name.
    bench.succeed(&["plan", "out/scene.toml"]);
}

/// As 3D Slicer writes its segments; quotes in a name stay in the name.
#[test]
#[cfg(feature = "nrrd")]
fn segments_give_materials_their_names() {
    let bench = Workbench::new();
    let header = "NRRD0004\ntype: uchar\ndimension: 3\nspace: left-posterior-superior\n\
                  sizes: 8 8 8\nspace directions: (5,0,0) (0,5,0) (0,0,5)\n\
                  kinds: domain domain domain\nencoding: raw\nspace origin: (0,0,0)\n\
                  Segment0_LabelValue:=1\nSegment0_Name:=left \"lobe\"\n\n";
    bench.write("organ.seg.nrrd", [header.as_bytes(), &[1; 512]].concat());
    bench.succeed(&["init", "organ.seg.nrrd"]);
    assert!(
        bench.read("scene.toml").contains("name = 'left \"lobe\"'"),
        "{}",
        bench.read("scene.toml")
    );
    let said = bench.succeed(&["labels", "organ.seg.nrrd"]);
    assert!(said.contains("label 1 (left \"lobe\"): 512 voxels"), "{said}");
    bench.succeed(&["run", "scene.toml", "--steps", "1"]);
}

/// A cube of 40 mm whose spacing is in metres though its header says mm.
#[test]
fn a_body_of_an_unlikely_size_needs_its_unit() {
    let bench = Workbench::new();
    let mut block = Nifti::cube(3);
    bench.write("mm.nii", block.bytes());
    for i in 0..3 {
        block.f32(80 + 4 * i, 5e-3).f32(280 + 20 * i, 5e-3);
    }
    bench.write("m.nii", block.bytes());
    bench.refused(&["init", "m.nii"], &["m.nii", "longest side is 0.", "1 mm to 5 m", "--unit m"]);
    bench.refused(&["init", "m.nii", "--unit", "inch"], &["inch", "um", "cm"]);
    assert!(!bench.path("scene.toml").exists());
    let force = |image: &str, more: &[&str]| {
        bench.succeed(&[&["init", image, "--force"], more].concat());
        bench.succeed(&["run", "scene.toml", "--out", "out", "--force"]);
        let summary: Value = serde_json::from_str(&bench.read("out/summary.json")).unwrap();
        summary["force"]["max_n"].as_f64().unwrap()
    };
    let (in_m, in_mm) = (force("m.nii", &["--unit", "m"]), force("mm.nii", &[]));
    assert!((in_m / in_mm - 1.0).abs() < 1e-3, "{in_m} N, {in_mm} N");
}
