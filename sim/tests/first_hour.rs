//! What a first run with one's own image meets: labels without a material, a scene without a size of cells.

#![cfg(feature = "nifti")]

use crate::workbench;

use serde_json::{Value, json};
use workbench::{BAR, Nifti, Workbench};
use yawara_mesh::image::write_labels;
use yawara_mesh::volume::{Grid, LabelVolume};

/// A cube of 40 mm of label 1 in its lower half and of labels 5 and 9 above.
fn layers() -> Nifti {
    let mut image = Nifti::cube(1);
    image.voxels[256..448].fill(5);
    image.voxels[448..].fill(9);
    image
}

/// The bar's scene on that image, without its tool.
fn bench(without: &str) -> Workbench {
    let bench = Workbench::new();
    bench.write("layers.nii", layers().bytes()).write("bar.toml", BAR.replace(without, ""));
    bench
}

const ON_LAYERS: [&str; 4] = ["--set", "image.path=layers.nii", "--set", "tools=[]"];

fn summary(bench: &Workbench) -> Value {
    serde_json::from_str(&bench.read("runs/bar/summary.json")).unwrap()
}

#[test]
fn other_labels_are_left_out_and_counted() {
    let bench = bench("");
    let plain = [&["run", "bar.toml"][..], &ON_LAYERS].concat();
    bench.refused(&plain, &["label 5", "image.ignore_others=true"]);
    let said = bench.succeed(&[&plain[..], &["--set", "image.ignore_others=true"]].concat());
    assert!(said.contains("2 label(s) ignored, 256 voxels"), "{said}");
    let image = &summary(&bench)["image"];
    let ignored = json!([{ "label": 5, "voxels": 192 }, { "label": 9, "voxels": 64 }]);
    assert_eq!(image["ignored_labels"], ignored);
    assert_eq!(
        (&image["materials"][0]["voxels"], &image["void_voxels"]),
        (&256.into(), &256.into())
    );
    // The scene that was written says so too.
    assert!(bench.read("runs/bar/scene.toml").contains("ignore_others = true"));
}

#[test]
fn others_are_left_out_or_have_a_material_not_both() {
    let bench = bench("");
    let other = "materials.1={ other = true, young_modulus_pa = 1e4, poisson_ratio = 0.3 }";
    let both = ["--set", "image.ignore_others=true", "--set", other];
    let all = [&["run", "bar.toml"][..], &ON_LAYERS, &both].concat();
    bench.refused(&all, &["image.ignore_others is true", "materials[1]"]);
    // An image of intensities is no label map with many labels to be left out.
    let mut ct = Nifti::cube(0);
    ct.i16(70, 256);
    ct.voxels = (0..512).map(|v| if v % 8 < 4 { 40 } else { 0x9c }).collect();
    bench.write("layers.nii", ct.bytes());
    let all = [&["run", "bar.toml"][..], &ON_LAYERS, &both[..2]].concat();
    bench.refused(&all, &["does not look like a label map"]);
}

#[test]
fn base_cells_follow_the_body_unless_the_scene_gives_them() {
    let bench = bench("base_mm = 10\n");
    let said = bench.succeed(&[&["plan", "bar.toml"][..], &["--set", "tools=[]"]].concat());
    // A tenth of 40 mm is nearest to one voxel of 5 mm.
    assert!(said.contains("128 base cells of 5 mm"), "{said}");
    assert!(said.contains("no base_mm is given: a tenth of the body's longest side"), "{said}");
    let given = ["plan", "bar.toml", "--set", "tools=[]", "--set", "mesh.base_mm=10.0"];
    assert!(!bench.succeed(&given).contains("no base_mm is given"));
}

/// An ellipsoid of a brain's size, in as many regions as an atlas has.
fn brain() -> LabelVolume {
    const HALF: [f64; 3] = [35.0, 45.0, 32.0];
    let grid = Grid::centred(HALF.map(|half| 2 * half as usize), 2.0);
    let [nx, ny, _] = grid.dims;
    let label = |i: usize| {
        let at = [i % nx, i / nx % ny, i / (nx * ny)];
        let inside = (0..3).map(|a| ((at[a] as f64 + 0.5) / HALF[a] - 1.0).powi(2)).sum::<f64>();
        let region = at[0] / 15 + 5 * (at[1] / 15 + 6 * (at[2] / 15));
        if inside < 1.0 { region as i64 + 1 } else { 0 }
    };
    let count = grid.voxel_count().unwrap();
    LabelVolume::from_original(grid, (0..count).map(label)).unwrap()
}

/// As soft and as incompressible as brains are, all of the weight from the first step on.
#[test]
fn a_brain_bears_its_weight_at_once() {
    const SCENE: &str = r#"
name = "brain"
gravity_m_s2 = [0.0, 0.0, -9.81]
[image]
path = "brain.nii.gz"
[[materials]]
other = true
young_modulus_pa = 3e3
poisson_ratio = 0.49
density_kg_m3 = 1040.0
[mesh]
max_level = 6
[[fixed]]
shape = "box"
min = [0.0, 0.0, 0.0]
max = [1.0, 1.0, 0.2]
[time]
steps = 20
step_s = 0.05
"#;
    let bench = Workbench::new();
    write_labels(&bench.path("brain.nii.gz"), &brain()).unwrap();
    bench.write("brain.toml", SCENE);
    bench.succeed(&["run", "brain.toml", "--set", "output.frames_every=0"]);
}
