//! Material that no face of a voxel joins, in tetrahedra that hold it together or not.

use yawara::scene::{Image, Scene};
use yawara::{Simulation, scene_file};
use yawara_mesh::volume::{Grid, LabelVolume};

/// Voxels, of 4 mm, four of which are a base cell.
const DIMS: [usize; 3] = [24, 8, 16];

/// A block with void where `is_void` (by voxel), fixed at the bottom, whose left end at the top is pulled away.
fn pulled(is_void: impl Fn([usize; 3]) -> bool, mesh: &str, more: &[&str]) -> Simulation {
    let set = [
        "fixed=[{ shape = 'box', min = [0.0, 0.0, 0.0], max = [1.0, 1.0, 0.0] }]".into(),
        "tools=[{ kind = 'grab', region = { shape = 'box', min = [0.0, 0.0, 0.9], max = [0.2, 1.0, 1.0] }, \
         path = [{ time_s = 0.0 }, { time_s = 1.0, move_m = [-0.01, 0.0, 0.0] }] }]"
            .into(),
        "time={ steps = 2, step_s = 0.5 }".into(),
        "gravity_m_s2=[0.0, 0.0, 0.0]".into(),
        "materials.0.young_modulus_pa=5e3".into(),
        "materials.0.poisson_ratio=0.3".into(),
        format!("mesh={{ base_mm = 16.0, max_vertices = 100000, {mesh} }}"),
    ];
    let set: Vec<String> = set.into_iter().chain(more.iter().map(|s| (*s).into())).collect();
    let (scene, _): (Scene, _) = scene_file::load("homogeneous", &set).unwrap();
    let scene = Scene { image: Image::default(), ..scene };
    let [nx, ny, nz] = DIMS;
    let label = |i: usize| u16::from(!is_void([i % nx, i / nx % ny, i / nx / ny]));
    let labels = (0..nx * ny * nz).map(label).collect();
    let volume = LabelVolume::new(Grid::centred(DIMS, 4.0), labels, vec![0, 1]).unwrap();
    Simulation::builder(&scene).volume(volume).build().unwrap()
}

fn force(simulation: &mut Simulation) -> f64 {
    let mut norm = 0.0;
    while simulation.steps_left() > 0 {
        let report = simulation.step().unwrap();
        assert!(report.converged, "{report:?}");
        norm = report.tools[0].force_n.iter().map(|f| f * f).sum::<f64>().sqrt();
    }
    norm
}

/// Two lobes on a common ground, a voxel apart, the void between them inside of base cells.
fn between_lobes([x, _, z]: [usize; 3]) -> bool {
    x == 11 && z >= 4
}

fn mesh_row(simulation: &Simulation) -> &str {
    &simulation.plan().iter().find(|row| row.stage == "mesh").unwrap().why
}

#[test]
fn lobes_pull_at_each_other_only_where_tetrahedra_hold_them_together() {
    let with = |topology: &str, level: u8| {
        pulled(between_lobes, &format!("start_level = {level}, topology = '{topology}'"), &[])
    };
    let fine = force(&mut with("merged", 6));
    let mut apart = with("components", 6);
    assert!(mesh_row(&apart).contains("0 vertices came in for that"), "{}", mesh_row(&apart));
    assert!((force(&mut apart) / fine - 1.0).abs() < 1e-9);
    for level in [0, 3] {
        let (mut merged, mut apart) = (with("merged", level), with("components", level));
        assert!(mesh_row(&merged).contains("tetrahedra hold together"), "{}", mesh_row(&merged));
        let off = |simulation: &mut Simulation| force(simulation) / fine - 1.0;
        let (merged, apart) = (off(&mut merged), off(&mut apart));
        assert!(apart > 0.0 && apart < 0.25 * merged, "{level}: {apart}, {merged}");
    }
}

#[test]
fn a_mesh_refines_around_what_is_apart() {
    let mut simulation = pulled(
        between_lobes,
        "max_level = 5, topology = 'components'",
        &["refinement.target=0.02"],
    );
    let before = simulation.body().vertex_count();
    assert!(force(&mut simulation) > 0.0);
    assert!(simulation.body().vertex_count() > before);
}

#[test]
fn a_mesh_is_refined_where_it_is_taken_apart() {
    // Nothing is refined for later: no error is too large.
    let with = |level: u8| {
        let mesh = format!("max_level = 6, topology = 'components', apart_level = {level}");
        pulled(between_lobes, &mesh, &["refinement.target=0.99"])
    };
    let fine = force(&mut pulled(between_lobes, "start_level = 6, topology = 'components'", &[]));
    let mut last = f64::INFINITY;
    for level in [0, 3] {
        let mut simulation = with(level);
        let topology = simulation.summary().unwrap().body.unwrap().topology;
        assert_eq!(topology.refined > 0, level > 0, "{level}: {topology:?}");
        let off = force(&mut simulation) / fine - 1.0;
        assert!(off > 0.0 && off < last, "{level}: {off} after {last}");
        last = off;
    }
    let by_itself = pulled(between_lobes, "max_level = 6, topology = 'components'", &[]);
    let of_three = with(3).summary().unwrap().body.unwrap().topology;
    assert_eq!(by_itself.summary().unwrap().body.unwrap().topology, of_three);
}

#[test]
fn a_piece_that_nothing_joins_stays_where_it_is() {
    // A column on a ground that is as wide as both, so that regions are the same places.
    let is_column = |[x, _, z]: [usize; 3]| x < 8 || (x < 12 && z < 4);
    // Two voxels wide, one away from the column, with which it shares vertices of base cells.
    let is_piece = |[x, y, z]: [usize; 3]| {
        (9..11).contains(&x) && (2..4).contains(&y) && (12..14).contains(&z)
    };
    let gravity = ["gravity_m_s2=[0.0, 0.0, -9.81]"];
    let mesh = "start_level = 1, topology = 'components'";
    let mut alone = pulled(|voxel| !is_column(voxel), mesh, &gravity);
    let mut beside = pulled(|voxel| !is_column(voxel) && !is_piece(voxel), mesh, &gravity);
    let [without, with] = [&mut alone, &mut beside].map(force);
    assert!((with / without - 1.0).abs() < 2e-3, "{with} {without}");
    let summary = beside.summary().unwrap();
    let topology = summary.body.unwrap().topology;
    assert!(topology.parked == 1 && topology.vertices > 0, "{topology:?}");
    assert!(
        summary.warnings.iter().any(|one| one.contains("1 piece(s)")),
        "{:?}",
        summary.warnings
    );
}
