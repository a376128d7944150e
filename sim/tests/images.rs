//! From images to bodies: intensities, oblique and anisotropic voxels, many labels, parts, start
//! meshes refined to labels, and volumes written back.

#![cfg(feature = "nifti")]

use crate::workbench;

use std::path::Path;

use nalgebra::{Matrix3, Matrix4, Rotation3, Vector3, Vector4};
use serde_json::Value;
use vtkio::Vtk;
use vtkio::model::{Attribute, DataSet, IOBuffer, Piece, VertexNumbers};
use workbench::{BAR, Workbench};
use yawara_mesh::image::{read_intensities, read_labels, write_field, write_labels};
use yawara_mesh::volume::{Grid, IntensityVolume, LabelVolume};

/// Stored voxels of the CT below, and their edges in mm.
const DIMS: [usize; 3] = [12, 10, 8];
const EDGES_MM: [f64; 3] = [3.0, 3.0, 6.0];

/// Centre of the CT's first voxel, scanner RAS, mm.
const FIRST_MM: [f64; 3] = [-40.0, 25.0, 310.0];

fn axes() -> Matrix3<f64> {
    *Rotation3::from_euler_angles(0.2, -0.15, 0.3).matrix()
}

/// Scanner RAS of the centre of a stored voxel, mm.
fn centre_mm(at: [usize; 3]) -> Vector3<f64> {
    let along = Vector3::from_fn(|i, _| EDGES_MM[i] * at[i] as f64);
    Vector3::from(FIRST_MM) + axes() * along
}

/// Soft tissue (40 HU) beside bone (500 HU) in air.
fn hounsfield([i, j, k]: [usize; 3]) -> f32 {
    match (2..10).contains(&i) && (2..8).contains(&j) && (1..7).contains(&k) {
        true if i < 6 => 40.0,
        true => 500.0,
        false => -1000.0,
    }
}

fn voxels(dims: [usize; 3]) -> impl Iterator<Item = [usize; 3]> + Clone {
    let [nx, ny, nz] = dims;
    (0..nx * ny * nz).map(move |v| [v % nx, v / nx % ny, v / (nx * ny)])
}

/// Writes the CT as cubes and then makes them twice as long along the third axis.
fn write_ct(path: &Path) {
    let spacing_mm = EDGES_MM[0];
    let rotation = axes();
    let origin_mm = Vector3::from(FIRST_MM) - rotation * Vector3::repeat(0.5 * spacing_mm);
    let grid = Grid { dims: DIMS, spacing_mm, rotation, origin_mm };
    let image = IntensityVolume::new(grid, voxels(DIMS).map(hounsfield).collect()).unwrap();
    write_field(path, &image).unwrap();
    let mut bytes = std::fs::read(path).unwrap();
    // pixdim[3], then the third column of the sform.
    for at in [88, 288, 304, 320] {
        let old = f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        bytes[at..at + 4].copy_from_slice(&(2.0 * old).to_le_bytes());
    }
    std::fs::write(path, bytes).unwrap();
}

/// Tissue by Hounsfield units; fat has no voxel.
const CT_SCENE: &str = r#"
name = "ct"
[image]
path = "ct.nii"
[[materials]]
range = [-150, -30]
name = "fat"
young_modulus_pa = 2e3
poisson_ratio = 0.4
[[materials]]
range = [-30, 150]
name = "soft"
young_modulus_pa = 5e3
poisson_ratio = 0.4
[[materials]]
range = [150, inf]
label = 70
name = "bone"
young_modulus_pa = 1e6
poisson_ratio = 0.3
[mesh]
base_mm = 6
start_level = 3
max_level = 3
[[fixed]]
shape = "box"
min = [0, 0, 0]
max = [1, 1, 0.2]
[[tools]]
kind = "grab"
region = { shape = "box", min = [0, 0, 0.9], max = [1, 1, 1] }
path = [{ time_s = 0 }, { time_s = 0.1, move_m = [0.001, 0, 0] }]
[time]
steps = 1
step_s = 0.1
"#;

fn ct() -> Workbench {
    let bench = Workbench::new();
    write_ct(&bench.path("ct.nii"));
    bench.write("ct.toml", CT_SCENE);
    bench
}

fn json(bench: &Workbench, file: &str) -> Value {
    serde_json::from_str(&bench.read(file)).unwrap()
}

/// A frame as arrays.
struct VtuMesh {
    points: Vec<Vector3<f64>>,
    displacement: Vec<Vector3<f64>>,
    tets: Vec<[usize; 4]>,
    label: Vec<i64>,
    von_mises: Vec<f64>,
}

impl VtuMesh {
    fn read(path: &Path) -> Self {
        let DataSet::UnstructuredGrid { pieces, .. } = Vtk::import(path).unwrap().data else {
            panic!()
        };
        let Some(Piece::Inline(piece)) = pieces.into_iter().next() else { panic!() };
        let VertexNumbers::XML { connectivity, .. } = piece.cells.cell_verts else { panic!() };
        let arrays = piece.data.point.into_iter().chain(piece.data.cell);
        let mut arrays: Vec<(String, IOBuffer)> = arrays
            .map(|attribute| match attribute {
                Attribute::DataArray(array) => (array.name, array.data),
                Attribute::Field { name, .. } => panic!("{name}"),
            })
            .collect();
        let mut take = |name: &str| {
            let at = arrays.iter().position(|(known, _)| known == name).unwrap();
            arrays.swap_remove(at).1
        };
        let vectors =
            |flat: Vec<f64>| flat.chunks_exact(3).map(Vector3::from_column_slice).collect();
        Self {
            points: vectors(piece.points.into_vec().unwrap()),
            displacement: vectors(take("displacement_mm").into_vec().unwrap()),
            tets: connectivity
                .chunks_exact(4)
                .map(|tet| [tet[0], tet[1], tet[2], tet[3]].map(|v| v as usize))
                .collect(),
            label: take("label").into_vec().unwrap(),
            von_mises: take("von_mises_pa").into_vec().unwrap(),
        }
    }

    /// The tetrahedra that held `x` at rest, with its barycentric coordinates.
    fn at_rest(&self, x: &Vector3<f64>) -> Vec<(usize, Vector4<f64>)> {
        let corner = |v: usize| (self.points[v] - self.displacement[v]).push(1.0);
        let numbered = self.tets.iter().enumerate();
        let weights = numbered.map(|(tet, corners)| {
            let all = Matrix4::from_columns(&corners.map(corner));
            (tet, all.try_inverse().unwrap() * x.push(1.0))
        });
        weights.filter(|(_, w)| w.iter().all(|&w| w > -1e-9)).collect()
    }
}

#[test]
fn an_oblique_anisotropic_ct_lies_in_scanner_coordinates() {
    let bench = ct();
    bench.succeed(&["run", "ct.toml"]);
    let mesh = VtuMesh::read(&bench.path("runs/ct/frames/step_000000.vtu"));
    let mut checked = 0;
    for at in voxels(DIMS) {
        let found = mesh.at_rest(&centre_mm(at));
        // Where voxels above and below differ, the cubes made between them are of neither.
        let [i, j, k] = at;
        let alike = |k: usize| hounsfield([i, j, k]) == hounsfield(at);
        let inside = k > 0 && k + 1 < DIMS[2] && alike(k - 1) && alike(k + 1);
        let want = match hounsfield(at) {
            40.0 => 2,
            500.0 => 70,
            _ => 0,
        };
        if !inside {
            continue;
        }
        for (tet, _) in &found {
            assert_eq!(mesh.label[*tet], want, "{at:?}");
        }
        assert!(want == 0 || !found.is_empty(), "{at:?} lies in no tetrahedron");
        checked += usize::from(want != 0);
    }
    assert_eq!(checked, 8 * 6 * 4);
    // Faces to a tenth of a millimetre: bone begins half a voxel after the last soft one, air
    // half a voxel after that; along the third axis the body ends in the middle of a stored voxel.
    for (at, axis, face_mm, labels) in
        [([5, 4, 4], 0, 1.5, [2, 70]), ([3, 7, 4], 1, 1.5, [2, 0]), ([3, 4, 6], 2, 0.0, [2, 0])]
    {
        for (side, want) in [(-0.1, labels[0]), (0.1, labels[1])] {
            let mut off = Vector3::repeat(0.1);
            off[axis] = face_mm + side;
            let found = mesh.at_rest(&(centre_mm(at) + axes() * off));
            assert!(want == 0 || !found.is_empty(), "{at:?}");
            assert!(found.iter().all(|(tet, _)| mesh.label[*tet] == want), "{at:?}, axis {axis}");
        }
    }
}

#[test]
fn resampling_and_classification_are_said() {
    let bench = ct();
    let output = bench.run(&["run", "ct.toml"]);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{stderr}");
    assert!(stderr.contains("no voxel lies in the range of material \"fat\""), "{stderr}");
    let text = String::from_utf8(output.stdout).unwrap();
    let said = "NIfTI intensities; resampled from 12 x 10 x 8 voxels of 3.0000 x 3.0000 x 6.0000";
    assert!(text.contains(said), "{text}");
    assert!(text.contains("warning   no voxel lies in the range of \"fat\""), "{text}");

    let summary = json(&bench, "runs/ct/summary.json");
    let image = &summary["image"];
    assert_eq!(image["name"], "ct.nii");
    assert_eq!((&image["format"], &image["content"]), (&"NIfTI".into(), &"intensities".into()));
    assert_eq!(image["resampled"], true);
    assert_eq!(image["stored_dims"], serde_json::json!([12, 10, 8]));
    assert_eq!(image["dims"], serde_json::json!([12, 10, 16]));
    assert!((image["voxel_mm"].as_f64().unwrap() - 3.0).abs() < 1e-6);
    assert!((image["stored_voxel_mm"][2].as_f64().unwrap() - 6.0).abs() < 1e-6);
    // Cubes lie a quarter of a stored voxel off its centre. At the ends of the body three
    // quarters of 500 and a quarter of -1000 HU are 125, soft; those of 40 and -1000 are air.
    let [soft, bone] = [4 * 6 * 10 + 4 * 6 * 2, 4 * 6 * 10];
    let voxels: Vec<u64> = image["materials"]
        .as_array()
        .unwrap()
        .iter()
        .map(|material| material["voxels"].as_u64().unwrap())
        .collect();
    assert_eq!(voxels, [0, soft, bone]);
    assert_eq!(image["void_voxels"], 12 * 10 * 16 - soft - bone);
    let bone = serde_json::json!([{ "label": 70, "voxels": bone }]);
    assert_eq!(image["materials"][2]["labels"], bone);
    assert_eq!(summary["domain"]["components"], 1);
    assert_eq!(summary["label_refinement"], Value::Null);
}

#[test]
fn the_voxel_edge_and_the_blur_can_be_chosen() {
    let bench = ct();
    let rows = |set: &[&str]| {
        let mut arguments = vec!["plan", "ct.toml"];
        arguments.extend(set.iter().flat_map(|set| ["--set", set]));
        bench.succeed(&arguments)
    };
    assert!(rows(&["image.voxel_mm=6"]).contains("; 6 x 5 x 8 voxels of 6 mm"));
    assert!(rows(&["image.blur_mm=1.5"]).contains("smoothed by 1.5 mm"));
    // So smooth that all is air.
    let everywhere = ["run", "ct.toml", "--set", "image.blur_mm=1e3"];
    bench.refused(&everywhere, &["ct.nii: no voxel lies in a range", "go from -"]);
}

/// Two blocks of 8 voxels along x, 4 × 4 thick, of 5 mm: label 3, then 9 with 12 at two corners;
/// four layers of void between them.
fn two_blocks() -> LabelVolume {
    let dims = [20, 4, 4];
    let label = |[i, j, k]: [usize; 3]| match i {
        0..8 => 3,
        8..12 => 0,
        _ if [[12, 0, 0], [19, 3, 3]].contains(&[i, j, k]) => 12,
        _ => 9,
    };
    LabelVolume::from_original(Grid::centred(dims, 5.0), voxels(dims).map(label)).unwrap()
}

fn blocks(more: &str) -> Workbench {
    let bench = Workbench::new();
    write_labels(&bench.path("blocks.nii.gz"), &two_blocks()).unwrap();
    let scene = BAR
        .replace(
            "phantom = \"block\"\nsize_mm = [40, 20, 20]\nvoxel_mm = 5",
            "path = \"blocks.nii.gz\"",
        )
        .replace("label = 1", "label = 3");
    assert!(scene.contains("blocks.nii.gz"));
    bench.write("bar.toml", scene + more);
    bench
}

const OTHERS: &str = "[[materials]]\nother = true\nname = \"rest\"\nyoung_modulus_pa = 1e4\n\
                      poisson_ratio = 0.3\n";

const WHOLE_FIXED: &str = "fixed.0={shape=\"box\", min=[0, 0, 0], max=[1, 1, 0]}";

#[test]
fn labels_without_a_name_are_taken_or_ignored() {
    let bench = blocks("");
    bench
        .refused(&["run", "bar.toml"], &["label 9", "126 voxels", "other = true", "ignore_labels"]);
    let bench = blocks(OTHERS);
    bench.succeed(&["run", "bar.toml", "--set", WHOLE_FIXED]);
    let image = &json(&bench, "runs/bar/summary.json")["image"];
    let rest = serde_json::json!([{ "label": 9, "voxels": 126 }, { "label": 12, "voxels": 2 }]);
    assert_eq!(image["materials"][1]["labels"], rest);
    assert_eq!(image["materials"][1]["other"], true);
    assert_eq!(
        (&image["materials"][0]["voxels"], &image["void_voxels"]),
        (&128.into(), &64.into())
    );
    assert_eq!(image["resampled"], false);
    // Outputs keep the labels.
    let mesh = VtuMesh::read(&bench.path("runs/bar/frames/step_000000.vtu"));
    assert!(mesh.label.contains(&9) && mesh.label.contains(&3));

    let ignore = ["--set", WHOLE_FIXED, "--set", "image.ignore_labels=[12, 77]"];
    bench.succeed(&[&["run", "bar.toml", "--out", "b"][..], &ignore].concat());
    let image = &json(&bench, "b/summary.json")["image"];
    assert_eq!(image["ignored_labels"], serde_json::json!([{ "label": 12, "voxels": 2 }]));
    assert_eq!(
        (&image["materials"][1]["voxels"], &image["void_voxels"]),
        (&126.into(), &66.into())
    );
}

#[test]
fn parts_are_counted_and_those_that_nothing_holds_left_out() {
    let bench = blocks(OTHERS);
    let tool = "tools=[]";
    let output = bench.run(&["run", "bar.toml", "--set", tool]);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{stderr}");
    assert!(stderr.contains("1 part(s) of blocks.nii.gz (16 base cells, 128 voxels)"), "{stderr}");
    let domain = &json(&bench, "runs/bar/summary.json")["domain"];
    assert_eq!((&domain["components"], &domain["kept"]), (&2.into(), &1.into()));
    let parts = serde_json::json!([
        { "cells": 16, "voxels": 128, "kept": true },
        { "cells": 16, "voxels": 128, "kept": false },
    ]);
    assert_eq!(domain["parts"], parts);
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("1 of 2 part(s) joined by faces, with 16 base cells and 128"), "{text}");
    assert!(text.contains("warning   1 part(s) with 16 base cells and 128 voxels"), "{text}");
}

#[test]
fn the_start_mesh_refined_to_labels_stays() {
    let bench = blocks(OTHERS);
    // Base cells of 20 mm, the last two with two labels.
    let set = |more: &[&'static str]| {
        let held = "support.hold=vertices";
        let asked = "refinement.split_above=1e-6";
        let all = [WHOLE_FIXED, held, asked, "tools=[]", "mesh.base_mm=20", "mesh.max_level=6"];
        let mut arguments = vec!["run", "bar.toml"];
        arguments.extend(all.iter().chain(more).flat_map(|set| ["--set", *set]));
        arguments
    };
    let vertices = |dir: &str, key: &str| {
        json(&bench, &format!("{dir}/summary.json"))["mesh"]["vertices"][key].as_u64().unwrap()
    };
    bench.succeed(&[&set(&[])[..], &["--out", "a"]].concat());
    bench.succeed(&[&set(&["mesh.label_level=4"])[..], &["--out", "b"]].concat());
    let refined = &json(&bench, "b/summary.json")["label_refinement"];
    let added = vertices("b", "start") - vertices("a", "start");
    assert!(added > 0);
    assert_eq!((&refined["level"], &refined["tets_left"]), (&4.into(), &0.into()));
    assert_eq!(refined["vertices"], added);
    // Nothing moves, so all else would merge.
    assert_eq!(vertices("b", "end"), vertices("b", "start"));
    let mesh = VtuMesh::read(&bench.path("b/frames/step_000003.vtu"));
    assert_eq!(mesh.points.len() as u64, vertices("b", "start"));

    // Only at the far end, by a box and by a ball.
    for region in [
        "mesh.label_region={shape=\"box\", min=[0.9, 0, 0], max=[1, 1, 1]}",
        "mesh.label_region={shape=\"sphere\", centre=[1, 1, 1], radius_m=0.003}",
    ] {
        let some = set(&["mesh.label_level=4", region]);
        bench.succeed(&[&some[..], &["--out", "c", "--force"]].concat());
        assert!(vertices("c", "start") > vertices("a", "start"));
        assert!(vertices("c", "start") < vertices("b", "start"));
        let mesh = VtuMesh::read(&bench.path("c/frames/step_000000.vtu"));
        let coarse = VtuMesh::read(&bench.path("a/frames/step_000000.vtu"));
        // The last cell begins 30 mm right of the middle.
        let left = |mesh: &VtuMesh| mesh.points.iter().filter(|x| x[0] < 29.0).count();
        assert_eq!(left(&mesh), left(&coarse));
    }

    // The budget ends it, and that is said.
    let limit = format!("mesh.max_vertices={}", vertices("a", "start") + 3);
    let tight = set(&["mesh.label_level=4"]);
    let text = bench.succeed(&[&tight[..], &["--set", &limit, "--out", "d"]].concat());
    assert!(text.contains("WARNING: max_vertices"), "{text}");
    assert!(text.contains("warning   max_vertices ended the refinement"), "{text}");
    let refined = &json(&bench, "d/summary.json")["label_refinement"];
    assert!(refined["tets_left"].as_u64().unwrap() > 0);
    assert!(refined["vertices"].as_u64().unwrap() <= 3);
}

#[test]
fn labels_are_exported_as_a_scene_uses_them() {
    let bench = ct();
    let ranges = ["--range", "2:-30:150", "--range", "70:150:4000", "--range", "5:4000:inf"];
    let command = ["labels", "ct.nii", "--out", "labels.nii.gz"];
    let text = bench.succeed(&[&command[..], &ranges].concat());
    for line in ["label 2: 288 voxels", "label 70: 240 voxels", "label 5: no voxel", "resampled"] {
        assert!(text.contains(line), "{text}");
    }
    assert_eq!(bench.files().len(), 3, "no other files");
    let volume = read_labels(&bench.path("labels.nii.gz")).unwrap();
    assert_eq!((volume.values(), volume.grid().dims), (&[0, 2, 70][..], [12, 10, 16]));
    // The voxel that holds a stored voxel's upper half lies where that half lay.
    let local = Vector3::new(3.5, 4.5, 4.0 * 2.0 + 1.5) * volume.grid().spacing_mm * 1e-3;
    let upper_half = centre_mm([3, 4, 4]) + axes() * Vector3::new(0.0, 0.0, 1.5);
    assert!((volume.grid().to_ras_mm(local) - upper_half).norm() < 1e-3);
    // Cubes already and a coarser voxel; a label map stays one.
    let text = bench.succeed(&["labels", "labels.nii.gz", "--out", "same.nii"]);
    assert!(!text.contains("resampled"), "{text}");
    let same = read_labels(&bench.path("same.nii")).unwrap();
    assert_eq!(same.labels(), volume.labels());
    bench.succeed(&["labels", "labels.nii.gz", "--out", "coarse.nii", "--voxel-mm", "6"]);
    assert_eq!(read_labels(&bench.path("coarse.nii")).unwrap().grid().dims, [6, 5, 8]);
    let smooth =
        ["labels", "ct.nii", "--out", "smooth.nii", "--blur-mm", "1e3", "--range", "1:-2e3:-600"];
    let text = bench.succeed(&smooth);
    assert!(text.contains("label 1: 1920 voxels"), "{text}");
}

#[test]
fn fields_lie_on_the_grid_of_the_image_at_rest() {
    let bench = ct();
    let set = ["output.field=true", "output.void=true", "mesh.start_level=0"];
    let set: Vec<&str> = set.iter().flat_map(|set| ["--set", set]).collect();
    bench.succeed(&[&["run", "ct.toml"][..], &set].concat());
    let mesh = VtuMesh::read(&bench.path("runs/ct/frames/step_000001.vtu"));
    let field =
        |name: &str| read_intensities(&bench.path(&format!("runs/ct/fields/{name}"))).unwrap();
    let (moved, stress) = (field("displacement_mm.nii.gz"), field("von_mises_pa.nii.gz"));
    let labels = read_labels(&bench.path("runs/ct/fields/label.nii.gz")).unwrap();
    assert_eq!(labels.counts(), [12 * 10 * 16 - 288 - 240, 288, 240]);
    let mut largest: f32 = 0.0;
    for [i, j, k] in voxels(labels.grid().dims) {
        let (u, s) = (moved.get(i, j, k).unwrap(), stress.get(i, j, k).unwrap());
        if labels.get(i, j, k) == 0 {
            assert_eq!((u, s), (0.0, 0.0), "void");
            continue;
        }
        let centre = Vector3::new(i as f64, j as f64, k as f64).add_scalar(0.5);
        let x = labels.grid().to_ras_mm(centre * labels.grid().spacing_mm * 1e-3);
        // The files' grid is rounded to f32: the voxel's neighbourhood decides.
        let near = mesh.at_rest(&x);
        assert!(!near.is_empty());
        let want: Vec<f64> = near
            .iter()
            .map(|(tet, w)| {
                let corners = mesh.tets[*tet];
                (0..4).map(|c| mesh.displacement[corners[c]] * w[c]).sum::<Vector3<f64>>().norm()
            })
            .collect();
        // 1 mm over 30 mm is a strain of 1/30, and places are good to 1e-4 mm.
        assert!(want.iter().any(|want| (want - f64::from(u)).abs() < 1e-4), "{u} of {want:?}");
        largest = largest.max(u);
        // Stress jumps from tetrahedron to tetrahedron; rounding may have left the right one.
        let around = |tet: usize, slack: f64| {
            let corner = |v: usize| (mesh.points[v] - mesh.displacement[v]).push(1.0);
            let all = Matrix4::from_columns(&mesh.tets[tet].map(corner));
            (all.try_inverse().unwrap() * x.push(1.0)).iter().all(|&w| w > -slack)
        };
        let mut stresses =
            (0..mesh.tets.len()).filter(|&t| around(t, 1e-3)).map(|t| mesh.von_mises[t]);
        assert!(stresses.any(|want| (want - f64::from(s)).abs() <= 1e-6 * want), "{s}");
    }
    assert!(largest > 0.5 && largest < 1.2, "{largest}: the tool moves a mean by 1 mm");

    // Without fields an earlier run's go, and nothing else.
    bench.write("runs/ct/fields/mine.nii.gz", "");
    bench.succeed(&["run", "ct.toml", "--force"]);
    let left: Vec<_> = std::fs::read_dir(bench.path("runs/ct/fields")).unwrap().collect();
    assert_eq!(left.len(), 1, "{left:?}");
    std::fs::remove_file(bench.path("runs/ct/fields/mine.nii.gz")).unwrap();
    bench.succeed(&["run", "ct.toml", "--force"]);
    assert!(!bench.path("runs/ct/fields").exists());
    bench.succeed(&["run", "ct.toml", "--force", "--set", "output.field=true"]);
    assert_eq!(std::fs::read_dir(bench.path("runs/ct/fields")).unwrap().count(), 3);
}
