//! What the program prints and writes, and how it ends.

use crate::workbench;

use std::fs;
use std::process::Stdio;
use std::time::{Duration, Instant};

use serde_json::Value;
use vtkio::Vtk;
use vtkio::model::{Attribute, DataSet, Piece, UnstructuredGridPiece};
use workbench::{BAR, Workbench};

fn bar() -> Workbench {
    let bench = Workbench::new();
    bench.write("bar.toml", BAR);
    bench
}

fn grid(bench: &Workbench, file: &str) -> UnstructuredGridPiece {
    let vtk = Vtk::import(bench.path(file)).unwrap();
    let DataSet::UnstructuredGrid { pieces, .. } = vtk.data else { panic!("{file}") };
    let Some(Piece::Inline(piece)) = pieces.into_iter().next() else { panic!("{file}") };
    *piece
}

fn names(attributes: &[Attribute]) -> Vec<&str> {
    let mut names: Vec<&str> = attributes
        .iter()
        .map(|attribute| match attribute {
            Attribute::DataArray(array) => &array.name[..],
            Attribute::Field { name, .. } => name,
        })
        .collect();
    names.sort_unstable();
    names
}

/// A table of steps without the columns that are times.
fn steps(bench: &Workbench, file: &str) -> Vec<Vec<String>> {
    let text = bench.read(file);
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    let kept: Vec<usize> = (0..rows[0].len()).filter(|&i| !rows[0][i].ends_with("_ms")).collect();
    rows.iter().map(|row| kept.iter().map(|&i| row[i].to_owned()).collect()).collect()
}

#[test]
fn scenes_are_listed_with_a_description() {
    let text = Workbench::new().succeed(&["scenes"]);
    let first: Vec<&str> = text.lines().map(|line| line.split_once(' ').unwrap().0).collect();
    let bodies = ["liver", "liver_ct", "beam", "twist"];
    let hard = ["drop", "stiff", "near_incompressible", "extreme", "homogeneous"];
    let touched = ["indent", "probe", "palpate", "liver_resection", "incision", "peel"];
    assert_eq!(first, [&bodies[..], &hard, &touched, &["abdomen_ct", "organs_ct"]].concat());
    assert!(text.lines().all(|line| line.len() > 20), "{text}");
}

#[test]
fn help_and_version_go_to_standard_output() {
    let bench = Workbench::new();
    for command in ["run", "plan", "mesh", "labels", "surface", "haptic", "scenes", "devices"] {
        assert!(bench.succeed(&["--help"]).contains(command));
    }
    assert!(bench.succeed(&["--version"]).starts_with("yawara "));
}

#[test]
fn plan_is_a_table_or_json() {
    let bench = bar();
    let json = bench.succeed(&["plan", "bar.toml", "--json"]);
    let rows: Vec<Value> = serde_json::from_str(&json).unwrap();
    let table = bench.succeed(&["plan", "bar.toml"]);
    assert_eq!(table.lines().count(), rows.len() + 1);
    for (row, line) in rows.iter().zip(table.lines().skip(1)) {
        let runs = if row["runs"].as_bool().unwrap() { "yes" } else { "no" };
        for text in [&row["stage"], &row["choice"], &row["why"]] {
            assert!(line.contains(text.as_str().unwrap()), "{line}");
        }
        assert!(line.contains(runs), "{line}");
    }
    assert_eq!(bench.files().len(), 1, "a plan writes nothing");
}

#[test]
fn a_run_writes_its_directory() {
    let bench = bar();
    let text = bench.succeed(&["run", "bar.toml", "--set", "refinement.split_above=1e-7"]);
    assert!(text.starts_with("stage"), "the plan comes first: {text}");
    assert!(text.ends_with("written to runs/bar\n"), "{text}");
    let files: Vec<String> =
        bench.files().iter().map(|path| path.to_str().unwrap().to_owned()).collect();
    let in_run = |name: &str| format!("runs/bar/{name}");
    let mut expected = vec!["bar.toml".to_owned(), "runs".into(), "runs/bar".into()];
    let frames = ["frames/step_000000.vtu", "frames/step_000002.vtu", "frames/step_000003.vtu"];
    let lists = ["frames.pvd", "outline.pvd"];
    expected.extend(["frames", "scene.toml", "steps.csv", "summary.json"].map(in_run));
    expected.extend(lists.map(in_run));
    expected.extend(frames.map(in_run));
    expected.extend(frames.map(|name| in_run(&name.replace(".vtu", "_outline.vtp"))));
    expected.sort();
    let mut files = files;
    files.sort();
    assert_eq!(files, expected);

    let table = steps(&bench, "runs/bar/steps.csv");
    let summary: Value = serde_json::from_str(&bench.read("runs/bar/summary.json")).unwrap();
    assert_eq!(table.len(), 1 + 3);
    assert_eq!(summary["steps"]["count"], 3);
    assert_eq!(summary["scene"], "bar");
    let column = table[0].iter().position(|name| name == "vertices").unwrap();
    let end: u64 = table[3][column].parse().unwrap();
    assert_eq!(summary["mesh"]["vertices"]["end"], end);
    for key in ["schema", "seed", "plan", "inverse", "force", "wall_s"] {
        assert!(!summary[key].is_null(), "{key}");
    }
    let seconds = |key: &str| summary[key].as_f64().unwrap();
    assert!(seconds("setup_s") > 0.0 && seconds("setup_s") < seconds("wall_s"));

    let made_by = &summary["made_by"];
    assert_eq!(made_by["version"], env!("CARGO_PKG_VERSION"));
    assert!(["debug", "release"].contains(&made_by["profile"].as_str().unwrap()));
    assert!(made_by["threads"].as_u64().unwrap() > 0);
    assert!(made_by["features"].is_array() && made_by["host"].is_string());
    assert_eq!(made_by["command"][1], "run");
    let times = &summary["steps"]["time_ms"];
    let (mean, worst) = (times["mean"].as_f64().unwrap(), times["max"].as_f64().unwrap());
    assert!(mean > 0.0 && mean <= worst);
    assert!(text.contains("on average, median"), "{text}");

    let last = grid(&bench, "runs/bar/frames/step_000003.vtu");
    assert_eq!(last.points.len() as u64, 3 * end);
    assert_eq!(names(&last.data.point), ["displacement_mm"]);
    let cell = ["indicator", "label", "level", "von_mises_pa", "young_modulus_pa"];
    assert_eq!(names(&last.data.cell), cell);
    let collection = bench.read("runs/bar/frames.pvd");
    assert!(frames.iter().all(|file| collection.contains(file)), "{collection}");
}

#[test]
fn the_resolved_scene_runs_to_the_same_bytes() {
    let bench = bar();
    bench.succeed(&["run", "bar.toml", "--out", "a", "--set", "materials.0.poisson_ratio=0.4"]);
    bench.succeed(&["run", "a/scene.toml", "--out", "b"]);
    assert_eq!(steps(&bench, "a/steps.csv"), steps(&bench, "b/steps.csv"));
    for file in ["scene.toml", "frames.pvd", "frames/step_000000.vtu", "frames/step_000003.vtu"] {
        assert!(bench.read(&format!("a/{file}")) == bench.read(&format!("b/{file}")), "{file}");
    }
}

#[test]
fn results_are_replaced_only_when_forced() {
    let bench = bar();
    bench.succeed(&["run", "bar.toml", "--out", "out"]);
    bench.write("out/notes.txt", "mine");
    let again = ["run", "bar.toml", "--out", "out", "--steps", "1"];
    bench.refused(&again, &["out", "not empty", "--force"]);
    assert_eq!(steps(&bench, "out/steps.csv").len(), 1 + 3);
    bench.succeed(&[&again[..], &["--force"]].concat());
    assert_eq!(steps(&bench, "out/steps.csv").len(), 1 + 1);
    assert_eq!(bench.read("out/notes.txt"), "mine");
    assert!(!bench.path("out/frames/step_000003.vtu").exists(), "of the run before");
    assert!(bench.path("out/frames/step_000001.vtu").exists());
}

#[test]
fn steps_that_do_not_converge_are_written_and_exit_with_1() {
    let bench = bar();
    let tight = ["solver.residual=1e-300", "solver.max_iterations=1", "solver.max_halvings=0"];
    let mut arguments = vec!["run", "bar.toml"];
    arguments.extend(tight.iter().flat_map(|set| ["--set", set]));
    let output = bench.run(&arguments);
    assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("3 of 3 steps did not converge"), "{text}");
    let summary: Value = serde_json::from_str(&bench.read("runs/bar/summary.json")).unwrap();
    assert_eq!(summary["steps"]["converged"], 0);
    let first = &summary["steps"]["first_failure"];
    assert_eq!((&first["step"], &first["label"]), (&1.into(), &1.into()), "{first}");
    let place = first["place_mm"].as_array().unwrap();
    assert!(place.iter().all(|x| x.as_f64().unwrap().abs() < 100.0), "{first}");
    for words in ["want 1.0e-300", "mm in label 1", "try       [dynamics]"] {
        assert!(text.contains(words), "{words}: {text}");
    }
}

/// A solver without pressures takes them from the element.
#[test]
fn another_element_because_of_the_equilibrium_is_a_warning() {
    let bench = bar();
    let mut run = vec!["run", "bar.toml", "--set", "materials.0.poisson_ratio=0.45"];
    assert!(!bench.succeed(&run).contains("WARNING"));
    run.extend(["--force", "--set", "stages.equilibrium=lbfgs"]);
    let output = bench.run(&run);
    let text = String::from_utf8(output.stdout).unwrap();
    let warning = text.lines().find(|line| line.starts_with("warning")).unwrap();
    assert!(warning.contains("element: it locks") && warning.contains("p1p1"), "{warning}");
}

/// Of an image the hash is kept.
#[test]
#[cfg(feature = "nifti")]
fn the_summary_has_the_hash_of_the_image() {
    let bench = bar();
    let image = workbench::Nifti::cube(1).bytes();
    bench.write("a.nii", &image);
    bench.succeed(&["run", "bar.toml", "--set", "image.path=a.nii"]);
    let summary: Value = serde_json::from_str(&bench.read("runs/bar/summary.json")).unwrap();
    let hash = summary["image"]["sha256"].as_str().unwrap().to_owned();
    assert!(hash.len() == 64 && hash.bytes().all(|b| b.is_ascii_hexdigit()), "{hash}");
    bench.write("a.nii", [&image[..image.len() - 1], &[0]].concat());
    bench.succeed(&["run", "bar.toml", "--set", "image.path=a.nii", "--force"]);
    let summary: Value = serde_json::from_str(&bench.read("runs/bar/summary.json")).unwrap();
    assert_ne!(summary["image"]["sha256"], hash);
}

/// Hours of steps are not lost with the process: its hidden folder opens in ParaView.
#[test]
fn what_a_killed_run_leaves_is_whole_up_to_its_last_frame() {
    let bench = bar();
    let mut run = bench.command(&["run", "bar.toml", "--steps", "1000000"]);
    let mut child = run.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let left = format!("runs/.bar.{}.partial", child.id());
    let list = bench.path(&left).join("frames.pvd");
    let listed = || fs::read_to_string(&list).unwrap_or_default();
    let begin = Instant::now();
    while !listed().contains("step_000006.vtu") && begin.elapsed() < Duration::from_secs(100) {
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    for list in ["frames.pvd", "outline.pvd"] {
        let list = bench.read(&format!("{left}/{list}"));
        let files: Vec<&str> =
            list.split("file=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
        assert!(files.len() >= 3 && list.ends_with("</VTKFile>\n"), "{list}");
        assert!(files.iter().all(|file| bench.path(&left).join(file).exists()), "{list}");
    }
    // A line of names, and one for each step up to that frame.
    let table = bench.read(&format!("{left}/steps.csv"));
    assert!(table.lines().filter(|line| line.matches(',').count() > 20).count() >= 7, "{table}");
    assert!(bench.read(&format!("{left}/scene.toml")).contains("steps = 1000000"));
    assert!(bench.succeed(&["clean"]).contains(&left));
    assert!(!bench.path(&left).exists());
}

#[test]
fn no_frames_if_none_are_asked_for() {
    let bench = bar();
    bench.succeed(&["run", "bar.toml", "--set", "output.frames_every=0"]);
    assert_eq!(fs::read_dir(bench.path("runs/bar/frames")).unwrap().count(), 0);
}

#[test]
fn a_closed_pipe_is_no_failure() {
    let bench = bar();
    for arguments in [&["plan", "bar.toml"][..], &["run", "bar.toml"], &["scenes"], &["--help"]] {
        let mut child =
            bench.command(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!((output.status.code(), &stderr[..]), (Some(0), ""), "{arguments:?}");
    }
    assert!(bench.path("runs/bar/summary.json").exists());
}

/// A cube of 4³ voxels of 5 mm in the far corner of 8³ voxels, the first of which has its
/// centre at (10, 20, 30).
#[cfg(feature = "nifti")]
#[test]
fn mesh_writes_a_label_map_in_scanner_coordinates() {
    use nalgebra::Vector3;
    use vtkio::model::{IOBuffer, VertexNumbers};
    use workbench::Nifti;

    let bench = Workbench::new();
    let mut image = Nifti::cube(7);
    for (i, voxel) in image.voxels.iter_mut().enumerate() {
        if [i % 8, i / 8 % 8, i / 64].into_iter().any(|coordinate| coordinate < 4) {
            *voxel = 0;
        }
    }
    bench.write("labels.nii", image.bytes());
    let arguments = ["mesh", "labels.nii", "--base-mm", "25", "--level", "3", "--out", "a.vtu"];
    let text = bench.succeed(&arguments);
    assert!(text.contains("27 vertices, 48 tetrahedra in 1 parts"), "{text}");
    assert!(text.contains("base cells of 20 mm (4 voxels of 5 mm), labels 7"), "{text}");
    let piece = grid(&bench, "a.vtu");
    let points: Vec<f64> = piece.points.into_vec().unwrap();
    for axis in 0..3 {
        let along = || points.iter().skip(axis).step_by(3).copied();
        let low = 10.0 * (axis + 1) as f64 + 4.0 * 5.0 - 2.5;
        assert!((along().fold(f64::MAX, f64::min) - low).abs() < 1e-9);
        assert!((along().fold(f64::MIN, f64::max) - low - 20.0).abs() < 1e-9);
    }
    let VertexNumbers::XML { connectivity, .. } = piece.cells.cell_verts else { panic!() };
    let corner = |v: u64| Vector3::from_column_slice(&points[3 * v as usize..][..3]);
    for tet in connectivity.chunks_exact(4) {
        let [a, b, c] = [1, 2, 3].map(|i| corner(tet[i]) - corner(tet[0]));
        // Six times 20³ mm³ over 48 tetrahedra, positively oriented.
        assert!((a.cross(&b).dot(&c) - 1000.0).abs() < 1e-6);
    }
    for attribute in piece.data.cell {
        let Attribute::DataArray(array) = attribute else { panic!() };
        match &array.name[..] {
            "label" => assert_eq!(array.data, IOBuffer::I64(vec![7; 48])),
            "level" => assert_eq!(array.data, IOBuffer::U8(vec![3; 48])),
            other => panic!("{other} has no meaning before a simulation"),
        }
    }
}

#[test]
fn mesh_takes_the_phantom() {
    let bench = Workbench::new();
    let text = bench.succeed(&["mesh", "phantom", "--level", "0", "--out", "a.vtu"]);
    assert!(text.contains("labels 1, 2, 3, 4"), "{text}");
    assert_eq!(bench.files().len(), 1);
}

#[test]
fn a_simulated_hand_leaves_a_summary() {
    let bench = bar();
    let text = bench.succeed(&["haptic", "bar.toml", "--seconds", "0.2", "--out", "hand.json"]);
    for word in ["ticks", "late", "steps", "force", "stable for a device"] {
        assert!(text.contains(word), "no {word:?} in {text}");
    }
    let summary: Value = serde_json::from_str(&bench.read("hand.json")).unwrap();
    assert!(summary["ticks"].as_u64().unwrap() > 10 && summary["is_realtime"].is_boolean());
    assert!(summary["converged"].as_u64().unwrap() > 0, "{summary}");
    assert!(summary["force_max_n"].as_f64().unwrap() > 0.0, "{summary}");
    let files = [bench.path("bar.toml"), bench.path("hand.json")].map(|path| path.exists());
    assert_eq!((files, bench.files().len()), ([true; 2], 2), "nothing else is left behind");

    bench.refused(&["haptic", "bar.toml", "--tool", "4"], &["tool 4", "1"]);
    bench.refused(&["haptic", "bar.toml", "--seconds", "0"], &["seconds", "0"]);
    bench.refused(
        &["haptic", "bar.toml", "--seconds", "0.1", "--out", "no/such.json"],
        &["no/such"],
    );
}

#[test]
fn built_in_scenes_begin_to_run() {
    let bench = Workbench::new();
    for name in ["beam", "twist"] {
        bench.succeed(&["run", name, "--steps", "2"]);
        assert!(bench.path(&format!("runs/{name}/summary.json")).exists());
    }
}
