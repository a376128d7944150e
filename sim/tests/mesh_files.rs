//! Scenes on tetrahedra from files, and states as files.
#![cfg(all(feature = "gmsh", feature = "vtu"))]

use crate::workbench;

use nalgebra::Vector3;
use workbench::{BAR, Workbench};
use yawara::report::Frame;
use yawara::scene::Scene;
use yawara::{Simulation, Stages, scene_file};

/// The bar's body and tools on a mesh from a file.
fn on_file(path: &str) -> String {
    let (_, rest) = BAR.split_once("[[materials]]").unwrap();
    let body = format!("name = \"bar\"\n[[materials]]{rest}");
    body.replace("base_mm = 10\nmax_level = 3", &format!("path = {path:?}"))
}

/// Two unit cubes' worth of tetrahedra, in metres: 5 tetrahedra of one cube, physical groups 3
/// and 4.
const CUBE: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n8\n1 0 0 0\n2 1 0 0\n3 1 1 0\n\
    4 0 1 0\n5 0 0 1\n6 1 0 1\n7 1 1 1\n8 0 1 1\n$EndNodes\n$Elements\n5\n1 4 2 3 1 1 2 3 6\n\
    2 4 2 3 1 1 3 4 8\n3 4 2 3 1 1 6 8 5\n4 4 2 4 1 3 6 7 8\n5 4 2 4 1 1 3 8 6\n$EndElements\n";

fn run(scene: &Scene) -> Frame {
    let mut simulation = Simulation::new(scene, Stages::by_name(&scene.stages).unwrap()).unwrap();
    while simulation.steps_left() > 0 {
        assert!(simulation.step().unwrap().converged);
    }
    simulation.frame().unwrap()
}

#[test]
fn a_mesh_written_as_msh_or_vtu_deforms_as_the_one_it_was_written_from() {
    let bench = Workbench::new();
    bench.write("bar.toml", BAR);
    // Voxels and tetrahedra do not stand for the same material.
    let by_vertices = ["support.hold=vertices", "tools.0.hold=vertices"].map(str::to_owned);
    let set = ["--set", "mesh.start_level=3", "--set", "output.msh=true"];
    bench.succeed(&[&["run", "bar.toml", "--out", "image"][..], &set].concat());
    let (image, _) =
        scene_file::load(bench.path("image/scene.toml").to_str().unwrap(), &by_vertices).unwrap();
    let want = run(&image);
    for file in ["step_000000.msh", "step_000000.vtu"] {
        let path = bench.path("image/frames").join(file);
        bench.write("file.toml", on_file(path.to_str().unwrap()));
        let (scene, _) =
            scene_file::load(bench.path("file.toml").to_str().unwrap(), &by_vertices).unwrap();
        let got = run(&scene);
        assert_eq!((got.tets.len(), &got.label), (want.tets.len(), &want.label));
        assert!(got.indicator.is_empty() && want.displacement_mm.len() > 100);
        for (got, want) in got.displacement_mm.iter().zip(&want.displacement_mm) {
            let difference = (Vector3::from(*got) - Vector3::from(*want)).norm();
            // Both runs stop at a residual of 1e-6.
            assert!(difference < 4e-6 * 5.0, "{got:?} {want:?}");
        }
    }
}

#[test]
fn groups_of_a_gmsh_file_are_the_labels_and_nothing_is_refined() {
    let bench = Workbench::new();
    let two = "[[materials]]\nlabel = 3\nyoung_modulus_pa = 5e3\npoisson_ratio = 0.3\n\
        [[materials]]\nlabel = 4\nyoung_modulus_pa = 5e4\npoisson_ratio = 0.3\n";
    let scene = on_file("cube.msh").replace("[[materials]]\nlabel = 1\n", &format!("{two}#"));
    let scene = scene.replace("#young_modulus_pa = 5e3\npoisson_ratio = 0.3\n", "");
    bench.write("cube.msh", CUBE).write("cube.toml", scene);
    let run = ["run", "cube.toml", "--out", "run", "--set", "mesh.unit_m=0.04"];
    let printed = bench.succeed(&run);
    for words in [
        "8 vertices, 5 tetrahedra, 0.04 m per unit",
        "every tetrahedron has one of 2 material(s)",
        "left out  refinement: a mesh from a file has no levels",
        "left out  homogenisation",
        "left out  image",
        "8 → 8 → 8 vertices",
    ] {
        assert!(printed.contains(words), "no {words:?} in {printed}");
    }
    let refine = [&run[..3], &["again", "--set", "mesh.max_level=6"]].concat();
    let words = ["cube.toml", "mesh.max_level", "a mesh from a file is not refined"];
    bench.refused(&refine, &[&words[..], &["--set mesh.max_level=6"]].concat()[1..]);
}

#[test]
fn turned_tetrahedra_are_repaired_and_bad_ones_named() {
    let bench = Workbench::new();
    let scene = on_file("cube.msh").replace("label = 1", "label = 3");
    let one = CUBE.replace("4 2 4 1", "4 2 3 1");
    bench.write("cube.toml", scene);
    bench.write("cube.msh", one.replace("1 4 2 3 1 1 2 3 6", "1 4 2 3 1 2 1 3 6"));
    let printed = bench.succeed(&["plan", "cube.toml"]);
    assert!(printed.contains("1 tetrahedra of negative volume rewound"), "{printed}");
    let cases: [(&str, &str, &[&str]); 4] = [
        ("6 1 0 1", "6 1 0 0", &["cube.msh", "tet"]),
        ("3 1 1 2 3 6", "9 1 1 2 3 6", &["tag 9 occurs in cube.msh (1 tetrahedra)"]),
        ("1 2 3 6\n", "1 2 3 600\n", &["cube.msh", "600"]),
        ("$Nodes\n8", "$Nodes\n800000000000", &["cube.msh", "800000000000"]),
    ];
    for (from, to, words) in cases {
        assert!(one.contains(from), "{from}");
        bench.write("cube.msh", one.replacen(from, to, 1));
        bench.refused(&["run", "cube.toml", "--out", "run"], words);
    }
    bench.write("cube.msh", &one);
    let run = |set| ["run", "cube.toml", "--out", "run", "--set", set];
    bench.refused(&run("fixed=[]"), &["nothing of cube.msh is fixed"]);
    bench.refused(&run("mesh.unit_m=-1"), &["mesh.unit_m is -1.0"]);
    bench.refused(&run("mesh.path=cube.stl"), &["cube.stl", ".msh (Gmsh) or .vtu (VTK)"]);
    bench.refused(&run("image.phantom=\"block\""), &["image.phantom", "one or the other"]);
    bench.refused(&run("mesh.max_vertices=7"), &["8 vertices", "mesh.max_vertices = 7"]);
}

#[test]
fn parts_that_nothing_holds_are_left_out() {
    let bench = Workbench::new();
    let scene = on_file("two.msh").replace("label = 1", "label = 3");
    // A tetrahedron of its own beside the cube's four.
    let nodes = "$Nodes\n12\n9 3 0 0\n10 4 0 0\n11 3 1 0\n12 3 0 1\n";
    let two = CUBE
        .replace("$Nodes\n8\n", nodes)
        .replace("$Elements\n5\n", "$Elements\n6\n6 4 2 3 1 9 10 11 12\n")
        .replace("4 2 4 1", "4 2 3 1");
    let tool = "region = { shape = \"box\", min = [1, 0, 0], max = [1, 1, 1] }";
    let near = "region = { shape = \"box\", min = [0.2, 0, 1], max = [0.3, 1, 1] }";
    bench.write("two.msh", two).write("two.toml", scene.replace(tool, near));
    let printed = bench.succeed(&["plan", "two.toml"]);
    assert!(printed.contains("1 part(s) with 1 tetrahedra are not held"), "{printed}");
}

#[test]
fn the_undeformed_mesh_of_an_image_is_written_as_msh_too() {
    let bench = Workbench::new();
    bench.succeed(&["mesh", "phantom", "--base-mm", "32", "--level", "1", "--out", "liver.msh"]);
    let text = bench.read("liver.msh");
    assert!(text.starts_with("$MeshFormat\n4.1 0 8\n"), "{}", &text[..40]);
    bench.refused(&["mesh", "phantom", "--out", "liver.stl"], &["liver.stl", ".vtu or .msh"]);
}

#[test]
fn a_load_acts_on_a_mesh_from_a_file_too() {
    let bench = Workbench::new();
    let scene = on_file("cube.msh").replace("label = 1", "label = 3");
    bench.write("cube.msh", CUBE.replace("4 2 4 1", "4 2 3 1")).write("cube.toml", scene);
    let (force, torque, traction) =
        ("force_n = [0, 1e-6, 2e-6]", "torque_n_m = [0, 1e-9, 0]", "traction_pa = [0, 0, 2]");
    let high = "region = { shape = \"box\", min = [0, 0, 0.9], max = [1, 1, 1] }";
    let all = "region = { shape = \"box\", min = [0, 0, 0], max = [1, 1, 1] }";
    for (place, load) in [
        (all, format!("{force}, {torque}")),
        (high, traction.into()),
        ("at_mm = [0.9, 0.5, 1]", force.into()),
    ] {
        let set =
            format!("tools=[{{ kind = \"load\", {place}, load = [{{ time_s = 0, {load} }}] }}]");
        let path = bench.path("cube.toml");
        let mesh = format!("mesh.path={}", bench.path("cube.msh").display());
        let (scene, _) = scene_file::load(path.to_str().unwrap(), &[set, mesh]).unwrap();
        let mut simulation =
            Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap();
        let report = simulation.step().unwrap();
        let [x, y, z] = report.tools[0].force_n;
        assert!(report.converged && x.abs() < 1e-18, "{report:?}");
        // A cube of 1 mm: its face of 1 mm² under 2 Pa.
        assert!((z - 2e-6).abs() < 1e-18 && (y == 0.0 || (y - 1e-6).abs() < 1e-18), "{y} {z} N");
    }
    let load = format!("load = [{{ time_s = 0, {force} }}]");
    let set = format!("tools=[{{ kind = \"load\", at_mm = [1.2, 1, 1], {load} }}]");
    let run = ["run", "cube.toml", "--out", "run", "--set", &set];
    bench.refused(&run, &["tools[0].at_mm lies outside", "cube.msh", "0.200 mm"]);
}

#[test]
fn a_mesh_file_has_millimetres_but_no_voxels() {
    let bench = Workbench::new();
    bench.write("cube.msh", CUBE);
    let cube = on_file("cube.msh").replace("label = 1", "other = true");
    let cube = cube.replace("path = \"cube.msh\"", "path = \"cube.msh\"\nunit_m = 1.0");
    bench.write("bar.toml", cube);
    let fixed = |ends: &str| format!("fixed=[{{ shape = 'box', {ends} }}]");
    let by_mm = fixed("min_mm = [0, 0, 0], max_mm = [0, 1000, 1000]");
    bench.succeed(&["plan", "bar.toml", "--set", &by_mm]);
    bench.succeed(&["preview", "bar.toml", "--set", &by_mm, "--out", "cube.png"]);
    let by_voxels = fixed("min_voxel = [0, 0, 0], max_voxel = [0, 1, 1]");
    let words = ["fixed[0].min_voxel", "a mesh file has no voxels"];
    bench.refused(&["plan", "bar.toml", "--set", &by_voxels], &words);
}
