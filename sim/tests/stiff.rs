//! Parts a thousand million times as stiff as others, and elements a millionth as high as wide.

use std::fmt::Write;

use yawara::scene::Image;
use yawara::{Simulation, scene_file};

/// Steps of a scene that do not converge.
fn lost(simulation: &mut Simulation, steps: usize) -> Vec<usize> {
    (0..steps).filter(|_| !simulation.step().unwrap().converged).collect()
}

#[test]
fn a_modulus_ratio_of_1e9_is_borne_with_and_without_pressures() {
    for element in ["p1", "p1p1"] {
        let keys = [
            "image.voxel_mm=8",
            "mesh.max_level=3",
            "mesh.max_vertices=400",
            "materials.1.young_modulus_pa=5e12",
            &format!("stages.element={element}"),
        ];
        let (scene, _) = scene_file::load("stiff", &keys.map(str::to_owned)).unwrap();
        let mut simulation = Simulation::builder(&scene).build().unwrap();
        assert_eq!(lost(&mut simulation, scene.time.steps), [0; 0], "{element}");
    }
}

#[test]
fn slivers_of_a_millionth_are_borne_with_and_without_pressures() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("slivers.msh");
    std::fs::write(&path, slivers(1e-6)).unwrap();
    for element in ["p1", "p1p1"] {
        let keys = ["materials.0.poisson_ratio=0.45", &format!("stages.element={element}")];
        let (mut scene, _) =
            scene_file::load("near_incompressible", &keys.map(str::to_owned)).unwrap();
        scene.image = Image::default();
        (scene.mesh.base_mm, scene.mesh.max_level) = (None, None);
        (scene.mesh.path, scene.mesh.start_level) = (Some(path.clone()), 0);
        let mut simulation = Simulation::builder(&scene).build().unwrap();
        assert_eq!(lost(&mut simulation, scene.time.steps), [0; 0], "{element}");
    }
}

/// A Gmsh mesh of a bar of 80 × 40 × 40 mm in cubes of 10 mm, six tetrahedra each, but for a layer in its middle
/// of `flat` times that height.
fn slivers(flat: f64) -> String {
    let heights = [0.0, 10.0, 20.0, 20.0 + 10.0 * flat, 30.0, 40.0];
    let node = |[x, y, z]: [usize; 3]| 1 + x + 9 * (y + 5 * z);
    let (mut nodes, mut elements, mut count) = (String::new(), String::new(), 0);
    for (z, height) in heights.iter().enumerate() {
        for (x, y) in (0..5).flat_map(|y| (0..9).map(move |x| (x, y))) {
            writeln!(nodes, "{} {} {} {height}", node([x, y, z]), 10 * x, 10 * y).unwrap();
            if x == 8 || y == 4 || z == 5 {
                continue;
            }
            // From corner to opposite corner, along the axes in every order, every second one the other way round.
            for (axes, is_odd) in [
                ([0, 1, 2], false),
                ([1, 2, 0], false),
                ([2, 0, 1], false),
                ([0, 2, 1], true),
                ([2, 1, 0], true),
                ([1, 0, 2], true),
            ] {
                let mut corner = [x, y, z];
                let mut corners = [node(corner); 4];
                for (i, axis) in axes.into_iter().enumerate() {
                    corner[axis] += 1;
                    corners[i + 1] = node(corner);
                }
                if is_odd {
                    corners.swap(2, 3);
                }
                count += 1;
                let [p, q, r, s] = corners;
                writeln!(elements, "{count} 4 2 1 1 {p} {q} {r} {s}").unwrap();
            }
        }
    }
    format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n{nodes}$EndNodes\n$Elements\n{count}\n{elements}$EndElements\n",
        9 * 5 * heights.len()
    )
}
