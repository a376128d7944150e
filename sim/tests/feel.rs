//! How stiff a skin feels, against pokes by a factor of the whole matrix.

use nalgebra::{DMatrix, DVector, Vector3};
use yawara::feel::{Options, feel};
use yawara::scene::Scene;
use yawara::{Simulation, scene_file};

fn scene(name: &str, settings: &[&str]) -> Scene {
    let settings: Vec<String> = settings.iter().map(|&setting| setting.to_owned()).collect();
    scene_file::load(name, &settings).unwrap().0
}

/// A fingertip smaller than a triangle presses on one point: its move under a unit force by a dense solve.
fn assert_is_of_pokes(settings: &[&str], points: usize) {
    let scene = scene("beam", settings);
    let options = Options { points, radius_mm: 1e-3, ..Options::default() };
    let skin = feel(&scene, None, &options).unwrap();
    let bare = Scene { tools: Vec::new(), ..scene };
    let simulation = Simulation::builder(&bare).build().unwrap();
    let (body, inverse) = (simulation.body(), simulation.inverse());
    let k = inverse.maintainer().stiffness();
    let m = k.block();
    let n = m * k.vertices();
    let mut dense = DMatrix::zeros(n, n);
    for column in 0..n {
        let (mut unit, mut product) = (vec![0.0; n], vec![0.0; n]);
        unit[column] = 1.0;
        k.apply(&unit, &mut product).unwrap();
        dense.set_column(column, &DVector::from_vec(product));
    }
    let factor = dense.lu();
    assert!(skin.points.len() > 20 && skin.vertices == body.vertex_count());
    for point in skin.points.iter().step_by(skin.points.len() / 20) {
        let rest = simulation.axes().to_solver(&Vector3::from(point.rest_mm));
        let normal = simulation.axes().to_solver_direction(&Vector3::from(point.normal));
        let found = yawara_corot::locate(
            &[rest],
            body.elements().iter(),
            body.rest_positions(),
            3e-3,
            |_, _| true,
        );
        let carried = found[0].unwrap().1;
        let mut load = DVector::zeros(n);
        for (&v, share) in carried.vertices.iter().zip(carried.weights) {
            let Some(slot) = inverse.slot(v).filter(|_| body.is_free(v)) else { continue };
            (0..3).for_each(|axis| load[m * slot + axis] += share * normal[axis]);
        }
        let brute = 1.0 / load.dot(&factor.solve(&load).unwrap());
        let off = (point.stiffness_n_m / brute - 1.0).abs();
        assert!(off < 1e-6, "{settings:?}: {} for {brute}, {off:.1e}", point.stiffness_n_m);
    }
}

#[test]
fn what_a_fingertip_feels_is_what_a_poke_meets() {
    // Few points batch by batch, many by the block of all rows.
    for points in [40, 10_000] {
        assert_is_of_pokes(&["mesh.max_level=0"], points);
        assert_is_of_pokes(&["mesh.max_level=0", "stages.element=p1p1"], points);
        assert_is_of_pokes(&["mesh.max_level=0", "stages.inverse=woodbury"], points);
    }
}

#[test]
fn a_nodule_is_felt_where_it_is_near_and_a_wider_fingertip_feels_more_stiffness() {
    let scene = scene("liver", &["image.voxel_mm=4.0"]);
    let few = Options { points: 600, radius_mm: 8.0, ..Options::default() };
    let tumour = scene.materials.iter().position(|one| one.name == "tumour").unwrap();
    let with = Options { nodule: Some([tumour, 0]), threshold_n: 1e-3, ..few.clone() };
    let skin = feel(&scene, None, &with).unwrap();
    let share = skin.felt_share.unwrap();
    assert!(share > 0.0 && share < 0.3, "{share}");
    let most = skin
        .points
        .iter()
        .max_by(|a, b| a.difference_n(&with).unwrap().total_cmp(&b.difference_n(&with).unwrap()));
    // The tumour's middle lies in the right lobe, behind.
    let most = most.unwrap();
    assert!(most.difference_n(&with).unwrap() > 1e-3 && most.rest_mm[0] > 0.0, "{most:?}");
    let wide = feel(&scene, None, &Options { radius_mm: 16.0, ..few.clone() }).unwrap();
    let narrow = feel(&scene, None, &few).unwrap();
    assert!(narrow.felt_share.is_none() && narrow.points[0].without_n_m.is_none());
    let stiffer = wide.points.iter().zip(&narrow.points);
    let stiffer = stiffer.filter(|(wide, narrow)| wide.stiffness_n_m > narrow.stiffness_n_m);
    assert!(stiffer.count() > 500);
    let picture = skin.picture(&with);
    assert!(picture.rgb.chunks_exact(3).any(|pixel| pixel == [253, 231, 37]));
}

/// What only steps need is left out: tools, and goals that name them.
#[test]
fn a_scene_whose_goal_is_a_tool_is_felt_too() {
    let few = Options { points: 100, ..Options::default() };
    let plain = feel(&scene("liver", &["image.voxel_mm=4.0"]), None, &few).unwrap();
    let goal = scene("liver", &["image.voxel_mm=4.0", "stages.indicator=goal"]);
    assert_eq!(feel(&goal, None, &few).unwrap().points, plain.points);
}

/// The softest material is a nodule, by which the stiffness of supports goes otherwise.
#[test]
fn the_support_is_the_same_without_a_nodule() {
    let scene = scene("liver", &["image.voxel_mm=4.0", "materials.3.young_modulus_pa=50.0"]);
    let tips = Options { points: 300, nodule: Some([3, 1]), ..Options::default() };
    let skin = feel(&scene, None, &tips).unwrap();
    let gain =
        |point: &yawara::feel::Felt| (point.without_n_m.unwrap() / point.stiffness_n_m - 1.0).abs();
    // Half of the skin is far from it.
    let far = skin.points.iter().filter(|point| gain(point) < 1e-2).count();
    assert!(2 * far > skin.points.len(), "{far} of {}", skin.points.len());
}

#[test]
fn options_out_of_range_are_refused() {
    let scene = scene("beam", &[]);
    let refused = |options: Options, want: &str| {
        let message = feel(&scene, None, &options).unwrap_err().to_string();
        assert!(message.contains(want), "{message}\nwant {want}");
    };
    let usual = Options::default();
    refused(Options { points: 0, ..usual.clone() }, "the number of points is 0, want 1 to");
    refused(
        Options { radius_mm: f64::NAN, ..usual.clone() },
        "the radius (mm) is NaN, want above 0",
    );
    refused(Options { depth_mm: -1.0, ..usual.clone() }, "the depth (mm) is -1, want above 0");
    refused(Options { threshold_n: -1.0, ..usual.clone() }, "the threshold (N) is -1, want 0 or");
    refused(Options { nodule: Some([0, 9]), ..usual }, "a material is 9, want an entry");
}
