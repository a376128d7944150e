//! Outlines of labels in the run directory: whole, carried along, and free when nobody asks.

mod workbench;

use std::fs;

use workbench::{BAR, Workbench};
use yawara::report::SurfaceFrame;
use yawara::scene::{GrabHold, Scene, SupportHold, SurfaceEntry, ToolEntry};
use yawara::{Simulation, Stages};

fn bar_with_surface() -> Scene {
    let mut scene: Scene = toml::from_str(BAR).unwrap();
    scene.image.voxel_mm = Some(1.25);
    scene.support.hold = SupportHold::Vertices;
    let ToolEntry::Grab(grab) = &mut scene.tools[0] else { panic!() };
    grab.hold = GrabHold::Vertices;
    scene.refinement.target = 1e-3;
    scene.output.surfaces = vec![SurfaceEntry { label: 1, sigma_voxels: 0.0 }];
    scene
}

/// Edges of one triangle only, or of more than two.
fn open_edges(surface: &SurfaceFrame) -> usize {
    let mut edges: Vec<[u32; 2]> = surface
        .triangles
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
        .map(|[a, b]| [a.min(b), a.max(b)])
        .collect();
    edges.sort_unstable();
    edges.chunk_by(|a, b| a == b).filter(|same| same.len() != 2).count()
}

#[test]
fn the_outline_of_a_pulled_bar_is_closed_and_follows_the_tool() {
    let scene = bar_with_surface();
    let stages = Stages::by_name(&scene.stages).unwrap();
    let mut simulation = Simulation::new(&scene, stages).unwrap();
    let rest = simulation.frame().unwrap().surfaces;
    assert_eq!(open_edges(&rest[0]), 0);
    while simulation.steps_left() > 0 {
        assert!(simulation.step().unwrap().converged);
    }
    let summary = simulation.summary().unwrap();
    assert!(summary.mesh.splits > 0, "a mesh that never changes proves little");
    let moved = &simulation.frame().unwrap().surfaces[0];
    assert_eq!((moved.label, open_edges(moved)), (1, 0));
    assert_eq!(moved.triangles, rest[0].triangles);
    // The grabbed face moves by the tool's 4 mm along x and z, the fixed one not at all.
    for (x, u) in rest[0].points_mm.iter().zip(&moved.displacement_mm) {
        let at_rest_x = x.x + 20.0;
        if at_rest_x > 40.0 - 1e-9 {
            assert!((u.x - 4.0).abs() < 1e-9 && (u.z - 4.0).abs() < 1e-9, "{u}");
        }
        if at_rest_x < 1e-9 {
            assert!(u.norm() < 1e-9, "{u}");
        }
    }
    let surface = &summary.surfaces[0];
    // All 40 × 20 × 20 mm are label 1. Void fills three of the four quarters around a vertex on
    // an edge of the block: the edges are bevelled by at most a voxel on either side, the faces
    // are exact.
    let (voxel, edges) = (1.25e-3, 4.0 * (40e-3 + 20e-3 + 20e-3));
    let volume = 16e-6 - 0.5 * voxel * voxel * edges..16e-6 - 0.2 * voxel * voxel * edges;
    assert!(volume.contains(&surface.volume_rest_m3), "{surface:?}, {volume:?}");
    let area = 4e-3 - (2.0 - 2f64.sqrt()) * voxel * edges..4e-3;
    assert!(area.contains(&surface.area_rest_m2), "{surface:?}, {area:?}");
    // ν = 0.3: pulled by a tenth of its length it grows by some 4 %.
    let growth = surface.volume_end_m3 / surface.volume_rest_m3 - 1.0;
    assert!((0.02..0.07).contains(&growth), "{growth}");
}

#[test]
fn surfaces_are_written_listed_and_the_same_each_time() {
    let bench = Workbench::new();
    bench.write("bar.toml", BAR);
    let set = "output.surfaces=[{label=1, sigma_voxels=0.5}]";
    for out in ["one", "two"] {
        bench.succeed(&["run", "bar.toml", "--out", out, "--set", set, "--set", "output.msh=true"]);
    }
    for name in ["step_000000_label_1.vtp", "step_000003_label_1.vtp", "step_000003.msh"] {
        let read = |run: &str| fs::read(bench.path(run).join("frames").join(name)).unwrap();
        assert_eq!(read("one"), read("two"), "{name}");
    }
    let list = bench.read("one/frames.pvd");
    assert!(list.contains("part=\"1\" file=\"frames/step_000002_label_1.vtp\""), "{list}");
    let summary = bench.read("one/summary.json");
    assert!(summary.contains("\"volume_rest_m3\""), "{summary}");
}

#[test]
fn without_a_request_there_is_no_surface() {
    let bench = Workbench::new();
    bench.write("bar.toml", BAR);
    let printed = bench.succeed(&["run", "bar.toml", "--out", "run"]);
    assert!(printed.contains("left out  surface: output.surfaces names no label"), "{printed}");
    assert!(bench.files().iter().all(|path| path.extension().is_none_or(|e| e != "vtp")));
    assert!(!bench.read("run/summary.json").contains("volume_rest_m3"));
}

#[test]
fn labels_that_are_not_there_and_blurs_out_of_range_are_refused() {
    let bench = Workbench::new();
    bench.write("bar.toml", BAR);
    let cases = [
        ("[{label=7}]", "output.surfaces[0].label is 7, want a label that occurs in"),
        ("[{label=1},{label=1}]", "output.surfaces[1].label is 1, want each label once"),
        ("[{label=1,sigma_voxels=17}]", "sigma_voxels is 17.0, want 0 to 16"),
        ("[{label=1,sigma_voxels=nan}]", "sigma_voxels is NaN, want 0 to 16"),
        ("[{lable=1}]", "unknown key `output.surfaces[0].lable`; did you mean `label`?"),
    ];
    for (value, words) in cases {
        let set = format!("output.surfaces={value}");
        bench.refused(&["run", "bar.toml", "--out", "run", "--set", &set], &[words]);
    }
}

#[test]
fn outlines_of_a_label_map_are_written_as_ply_and_vtp() {
    let bench = Workbench::new();
    let printed = bench.succeed(&["surface", "phantom", "--out", "all.vtp"]);
    assert_eq!(printed.matches("label ").count(), 4, "{printed}");
    bench.succeed(&["surface", "phantom", "--label", "4", "--out", "tumour.ply"]);
    let head =
        String::from_utf8_lossy(&fs::read(bench.path("tumour.ply")).unwrap()[..60]).into_owned();
    assert!(head.starts_with("ply\nformat binary_little_endian 1.0\n"), "{head}");
    let cases = [
        (vec!["--out", "x.stl"], "x.stl, want a file name that ends in .ply or .vtp"),
        (vec!["--out", "x.ply", "--label", "9"], "--label is 9, want one of 1, 2, 3, 4"),
        (vec!["--out", "x.ply", "--sigma-voxels", "-1"], "--sigma-voxels is -1, want 0 to 16"),
    ];
    for (arguments, words) in cases {
        bench.refused(&[&["surface", "phantom"][..], &arguments].concat(), &[words]);
    }
}
