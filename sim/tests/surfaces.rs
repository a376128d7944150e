//! Outlines of labels in the run directory: whole, carried along without folds, and free when nobody
//! asks.

use crate::workbench;

use std::collections::HashMap;
use std::fs;

use nalgebra::{Matrix3, Vector3};
use workbench::{BAR, Workbench};
use yawara::report::{Frame, SurfaceFrame};
use yawara::scene::{GrabHold, Scene, SupportHold, SurfaceEntry, ToolEntry};
use yawara::{Simulation, Stages, scene_file};

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
    let without = ["--set", "output.outline=false"];
    let printed = bench.succeed(&[&["run", "bar.toml", "--out", "run"][..], &without].concat());
    assert!(printed.contains("left out  surface: output.surfaces names no label"), "{printed}");
    assert!(bench.files().iter().all(|path| path.extension().is_none_or(|e| e != "vtp")));
    assert!(!bench.path("run/outline.pvd").exists());
    assert!(!bench.read("run/summary.json").contains("volume_rest_m3"));
}

/// Of the bar and of void beside it, closed, and where the mesh is.
#[test]
fn the_outline_of_the_body_is_in_every_frame() {
    let bench = Workbench::new();
    bench.write("bar.toml", BAR);
    bench.succeed(&["run", "bar.toml", "--out", "run"]);
    let list = bench.read("run/outline.pvd");
    for step in [0, 2, 3] {
        let file = format!("frames/step_{step:06}_outline.vtp");
        assert!(list.contains(&format!("part=\"0\" file=\"{file}\"")), "{list}");
        assert!(bench.path("run").join(&file).exists());
    }
    assert!(!bench.read("run/frames.pvd").contains("outline"), "a list of their own");
    let scene: Scene = toml::from_str(BAR).unwrap();
    let stages = Stages::by_name(&scene.stages).unwrap();
    let mut simulation = Simulation::new(&scene, stages).unwrap();
    while simulation.steps_left() > 0 {
        simulation.step().unwrap();
    }
    let frame = simulation.frame().unwrap();
    let outline = frame.outline.as_ref().unwrap();
    assert_eq!((outline.label, open_edges(outline)), (0, 0));
    let most = |moved: &mut dyn Iterator<Item = f64>| moved.fold(0.0, f64::max);
    let of_mesh = most(&mut frame.displacement_mm.iter().map(|&u| Vector3::from(u).norm()));
    let of_outline = most(&mut outline.displacement_mm.iter().map(|u| u.norm()));
    assert!((of_outline / of_mesh - 1.0).abs() < 0.1, "{of_outline}, {of_mesh}");
    let span = |axis: usize| {
        let rest = outline.points_mm.iter().zip(&outline.displacement_mm).map(|(x, u)| x - u);
        let [low, high] =
            rest.fold([f64::MAX, f64::MIN], |[low, high], x| [low.min(x[axis]), high.max(x[axis])]);
        high - low
    };
    for (axis, length) in [40.0, 20.0, 20.0].into_iter().enumerate() {
        assert!((span(axis) - length).abs() < 2.5, "{}", span(axis));
    }
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

/// The tetrahedra of a frame by the cubes of 8 mm that they reach into at rest: a corner, the inverse
/// of the edges from it, and the cofactors of their deformation gradient.
struct Coarse {
    tets: Vec<(Vector3<f64>, Matrix3<f64>, Matrix3<f64>)>,
    by_cube: HashMap<[i64; 3], Vec<usize>>,
}

fn cube(x: &Vector3<f64>) -> [i64; 3] {
    [0, 1, 2].map(|axis| (x[axis] / 8.0).floor() as i64)
}

impl Coarse {
    fn new(frame: &Frame) -> Self {
        let mut coarse = Self { tets: Vec::new(), by_cube: HashMap::new() };
        for tet in &frame.tets {
            let now = tet.map(|v| Vector3::from(frame.points_mm[v as usize]));
            let moved = tet.map(|v| Vector3::from(frame.displacement_mm[v as usize]));
            let rest = [0, 1, 2, 3].map(|i| now[i] - moved[i]);
            let edges = |x: &[Vector3<f64>; 4]| {
                Matrix3::from_columns(&[x[1] - x[0], x[2] - x[0], x[3] - x[0]])
            };
            let inverse = edges(&rest).try_inverse().unwrap();
            let f = edges(&now) * inverse;
            let cofactors = f.try_inverse().unwrap().transpose() * f.determinant();
            let low = cube(&rest.iter().fold(rest[0], |low, x| low.inf(x)).add_scalar(-1e-3));
            let high = cube(&rest.iter().fold(rest[0], |high, x| high.sup(x)).add_scalar(1e-3));
            for z in low[2]..=high[2] {
                for y in low[1]..=high[1] {
                    for x in low[0]..=high[0] {
                        coarse.by_cube.entry([x, y, z]).or_default().push(coarse.tets.len());
                    }
                }
            }
            coarse.tets.push((rest[0], inverse, cofactors));
        }
        coarse
    }

    /// The cofactors of the tetrahedron around `x`.
    fn cofactors(&self, x: &Vector3<f64>) -> &Matrix3<f64> {
        let inside = |&at: &usize| {
            let (corner, inverse, _) = &self.tets[at];
            let weights = inverse * (x - corner);
            weights.min().min(1.0 - weights.sum())
        };
        let around = self.by_cube[&cube(x)].iter();
        let best = around.max_by(|a, b| inside(a).total_cmp(&inside(b))).unwrap();
        assert!(inside(best) > -1e-6, "{x} is in no tetrahedron");
        &self.tets[*best].2
    }
}

/// How many triangles there are, and the cosine of the largest angle between one's normal and where
/// its coarse tetrahedron turns the normal that it has at rest.
fn worst_turn(frame: &Frame) -> (usize, f64) {
    let coarse = Coarse::new(frame);
    let normal = |[a, b, c]: [Vector3<f64>; 3]| (b - a).cross(&(c - a));
    let (mut count, mut worst) = (0, 1.0_f64);
    for surface in &frame.surfaces {
        for triangle in &surface.triangles {
            let now = triangle.map(|v| surface.points_mm[v as usize]);
            let moved = triangle.map(|v| surface.displacement_mm[v as usize]);
            let rest = [0, 1, 2].map(|i| now[i] - moved[i]);
            let centre = rest.iter().sum::<Vector3<f64>>() / 3.0;
            let want = coarse.cofactors(&centre) * normal(rest);
            count += 1;
            worst = worst.min(normal(now).normalize().dot(&want.normalize()));
        }
    }
    (count, worst)
}

/// At the largest pull, turn or push. What is displaced is displaced by other tetrahedra than the
/// coarse ones, so that angles are not 0.
#[test]
fn no_triangle_turns_over_against_its_coarse_tetrahedron() {
    let all = "[{label=1}, {label=2, sigma_voxels=0.5}, {label=3}, {label=4}]";
    let cases = [
        ("liver", all, "time.steps=10", "void.beside_tissue=volume", 170_000),
        ("liver", all, "time.steps=10", "void.beside_tissue=material", 170_000),
        ("probe", all, "time.steps=10", "time.step_s=0.06", 170_000),
        ("twist", "[{label=1}]", "time.steps=20", "time.step_s=0.1", 7_000),
        ("beam", "[{label=1}]", "time.steps=10", "time.step_s=0.1", 7_000),
        ("indent", "[{label=1}]", "time.steps=5", "time.step_s=0.2", 100_000),
    ];
    for (name, surfaces, steps, other, least) in cases {
        let surfaces = format!("output.surfaces={surfaces}");
        let set = [&surfaces, steps, other].map(String::from);
        let (scene, _) = scene_file::load(name, &set).unwrap();
        let stages = Stages::by_name(&scene.stages).unwrap();
        let mut simulation = Simulation::new(&scene, stages).unwrap();
        while simulation.steps_left() > 0 {
            simulation.step().unwrap();
        }
        let (count, worst) = worst_turn(&simulation.frame().unwrap());
        println!("{name}, {other}: {count} triangles, cosine of the largest angle {worst:.2}");
        assert!(count > least, "{name}: {count}");
        assert!(worst > 0.0, "{name}, {other}: {worst}");
    }
}
