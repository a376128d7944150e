//! Tools that cut: what comes apart, what a cut costs in force, and what closes again.

use nalgebra::Vector3;
use yawara::scene::Scene;
use yawara::{Simulation, scene_file};

/// A bar of 160 × 40 × 40 mm held at its low x end and pulled at the other, from .5 s to 2 s; as even as a bar can be.
fn scene(settings: &[&str]) -> Scene {
    let own = [
        "gravity_m_s2=[0, 0, 0]",
        "mesh.start_level=3",
        "mesh.max_level=3",
        "time={steps=4, step_s=0.5}",
        "solver.residual=1e-9",
        "materials.0.poisson_ratio=0.0",
        "support.hold=vertices",
        "tools.0.hold=vertices",
        "tools.0.release_s=9.0",
        "tools.0.path=[{time_s=0.5, move_m=[0, 0, 0]}, {time_s=2, move_m=[0.02, 0, 0]}]",
        "output.frames_every=0",
    ];
    let all: Vec<String> = own.iter().chain(settings).map(|&one| one.to_owned()).collect();
    scene_file::load("beam", &all).unwrap().0
}

/// A blade upright along z at `x_mm` from the bar's middle, its tip at `z_mm`, that moves along y by so much (mm) from
/// outside in the step that ends at `end_s`.
fn scalpel(x_mm: f64, z_mm: f64, by_mm: f64, end_s: f64) -> String {
    let begin_s = end_s - 0.5;
    format!(
        "{{kind=\"scalpel\", centre_mm=[{x_mm:?}, -25, {z_mm:?}], edge_m=[0, 0, 0.1], toughness_j_m2=50, \
         begin_s={begin_s:?}, release_s={end_s:?}, \
         path=[{{time_s={begin_s:?}, move_m=[0, 0, 0]}}, {{time_s={end_s:?}, move_m=[0, {:?}, 0]}}]}}",
        by_mm * 1e-3
    )
}

fn run(scene: &Scene) -> Simulation {
    let mut simulation = Simulation::builder(scene).build().unwrap();
    while simulation.steps_left() > 0 {
        let report = simulation.step().unwrap();
        assert!(report.converged, "{report:?}");
    }
    simulation
}

fn force(simulation: &Simulation) -> f64 {
    simulation.summary().unwrap().tools[0].force_end_n
}

#[test]
fn a_bar_that_is_cut_through_is_two_that_do_not_pull_at_each_other() {
    let whole = force(&run(&scene(&[])));
    for element in ["p1", "p1p1"] {
        // Through the middles of voxels, and beside the faces of tetrahedra.
        let blade = format!("tools.1={}", scalpel(2.5, -25.0, 50.0, 0.5));
        let cut = run(&scene(&[&blade, &format!("stages.element={element}")]));
        let summary = cut.summary().unwrap();
        let [first, second] = summary.pieces_cm3[..] else { panic!("{:?}", summary.pieces_cm3) };
        assert!((first + second - 256.0).abs() < 1e-9, "{first} and {second} cm³");
        // To half a voxel either way.
        assert!((first - 132.0).abs() < 8.0, "{first} cm³");
        let tool = &summary.tools[1];
        assert_eq!(tool.parked, 1);
        assert!((tool.cut_cm2 - 16.0).abs() < 0.5, "{} cm²", tool.cut_cm2);
        assert!((tool.cut_j - 50.0 * 1e-4 * tool.cut_cm2).abs() < 1e-12);
        // In one step of 50 mm.
        assert!((tool.force_max_n - tool.cut_j / 0.05).abs() < 1e-9, "{} N", tool.force_max_n);
        assert!(force(&cut) < 0.01 * whole, "{} of {whole} N", force(&cut));
        assert!(summary.inverse.drift_max < 1e-8, "{:?}", summary.inverse);
    }
}

#[test]
fn the_deeper_a_cut_the_weaker_the_bar() {
    let depths = [0.0, 10.0, 20.0, 30.0];
    let forces = depths.map(|depth| {
        let blade = format!("tools.1={}", scalpel(2.5, 20.0 - depth, 50.0, 0.5));
        let cut = run(&scene(&[&blade]));
        let found = cut.summary().unwrap().tools[1].cut_cm2;
        assert!((found - 0.4 * depth).abs() <= 0.03 * depth, "{found} cm² at {depth} mm");
        assert_eq!(cut.summary().unwrap().pieces_cm3.len(), 1);
        force(&cut)
    });
    assert!(forces.windows(2).all(|pair| pair[1] < 0.98 * pair[0]), "{forces:?} N");
    assert_eq!(forces[0], force(&run(&scene(&[]))));
}

#[test]
fn a_blade_cuts_where_the_body_is_now() {
    // At the end of step 2 the bar is stretched evenly by 1/24: a place that rests at 8.2 mm right of its middle, 88.2
    // from its fixed end, is then at 91.875.
    let at_rest = run(&scene(&[&format!("tools.1={}", scalpel(8.2, -5.0, 50.0, 0.5))]));
    let stretched = 88.2 * (1.0 + 1.0 / 24.0) - 80.0;
    let later = run(&scene(&[&format!("tools.1={}", scalpel(stretched, -5.0, 50.0, 1.0))]));
    let [one, other] = [&at_rest, &later].map(force);
    assert!((one / other - 1.0).abs() < 1e-7, "{one} and {other} N");
    let [one, other] =
        [&at_rest, &later].map(|simulation| simulation.summary().unwrap().tools[1].doubled);
    assert_eq!(one, other);
    assert!(force(&later) < 0.9 * force(&run(&scene(&[]))));
    let energy = later.summary().unwrap().energy.unwrap();
    assert!(energy.edits.net_j().abs() < 1e-9, "a cut by itself moves nothing: {energy:?}");
}

#[test]
fn what_is_sewn_is_what_it_was() {
    let blade = scalpel(2.5, -5.0, 50.0, 0.5);
    let suture = "tools.2={kind=\"suture\", centre_mm=[0, 0, 0], radius_m=0.06, begin_s=0.6, release_s=1.0, \
                  path=[{time_s=0, move_m=[0, 0, 0]}]}";
    for element in ["p1", "p1p1"] {
        let element = format!("stages.element={element}");
        // Nothing pulls before it is sewn.
        let later = "tools.0.path=[{time_s=1, move_m=[0, 0, 0]}, {time_s=2, move_m=[0.02, 0, 0]}]";
        let sewn = run(&scene(&[&element, later, &format!("tools.1={blade}"), suture]));
        let whole = run(&scene(&[&element, later]));
        let tools = sewn.summary().unwrap().tools;
        assert!(tools[1].doubled > 0 && tools[2].closed == tools[1].doubled, "{tools:?}");
        assert_eq!(sewn.body().vertex_count(), whole.body().vertex_count());
        let [one, other] = [&sewn, &whole].map(force);
        assert!((one / other - 1.0).abs() < 1e-9, "{one} and {other} N");
        for v in whole.body().vertices().map(|v| v.index()) {
            let off = sewn.body().positions()[v] - whole.body().positions()[v];
            assert!(off.norm() < 1e-9, "{v}: {off}");
        }
    }
}

#[test]
fn what_is_cut_off_falls_if_it_has_inertia() {
    let settings = [
        "gravity_m_s2=[0, 0, -9.81]",
        "dynamics={}",
        "time={steps=40, step_s=0.005}",
        "solver.residual=1e-6",
        "tools=[]",
    ];
    let blade = "{kind=\"scalpel\", centre_mm=[2.5, -25, -25], edge_m=[0, 0, 0.1], release_s=0.005, \
                 path=[{time_s=0, move_m=[0, 0, 0]}, {time_s=0.005, move_m=[0, 0.05, 0]}]}";
    let mut with = scene(&settings);
    with.tools = scene_file::load("beam", &[format!("tools=[{blade}]")]).unwrap().0.tools;
    let cut = run(&with);
    let body = cut.body();
    assert_eq!(cut.summary().unwrap().pieces_cm3.len(), 2);
    assert_eq!(cut.summary().unwrap().tools[0].parked, 0);
    let end: Vec<usize> =
        body.vertices().map(|v| v.index()).filter(|&v| body.rest_positions()[v].x > 0.11).collect();
    let drop: Vector3<f64> =
        end.iter().map(|&v| body.positions()[v] - body.rest_positions()[v]).sum();
    let want = -0.5 * 9.81 * 0.2 * 0.2;
    let drop = drop.z / end.len() as f64;
    // Backward Euler falls a little farther: half a step's way.
    assert!((drop / want - 1.0).abs() < 0.06, "{drop} of {want} m");
}

#[test]
fn the_mesh_is_as_fine_as_asked_where_it_is_cut() {
    let blade = scalpel(2.5, -5.0, 50.0, 0.5);
    let finer = format!("tools.1={}", blade.replacen("edge_m", "level=6, edge_m", 1));
    let cut = run(&scene(&[&finer, "mesh.max_level=6"]));
    let plain = run(&scene(&[&format!("tools.1={blade}")]));
    let summary = cut.summary().unwrap();
    assert!(summary.mesh.splits > 50, "{:?}", summary.mesh);
    // More room to open in: no stiffer.
    assert!(force(&cut) < force(&plain), "{} and {} N", force(&cut), force(&plain));
}

#[test]
fn blades_that_meet_nothing_do_nothing() {
    let whole = run(&scene(&[]));
    let still = "{kind=\"scalpel\", centre_mm=[2.5, 0, -25], edge_m=[0, 0, 0.1], \
                 path=[{time_s=0, move_m=[0, 0, 0]}]}";
    let beside = scalpel(2.5, -25.0, 1.0, 0.5);
    for blade in [still.to_owned(), beside] {
        let cut = run(&scene(&[&format!("tools.1={blade}")]));
        assert_eq!(cut.summary().unwrap().tools[1].doubled, 0);
        assert_eq!(cut.body().positions(), whole.body().positions());
    }
}

#[test]
fn more_than_there_is_room_for_is_not_cut_and_said() {
    let blade = format!("tools.1={}", scalpel(2.5, -25.0, 50.0, 0.5));
    let vertices = run(&scene(&[])).body().vertex_count();
    let limit = format!("mesh.max_vertices={}", vertices + 3);
    let cut = run(&scene(&[&blade, &limit]));
    let tool = &cut.summary().unwrap().tools[1];
    assert!(tool.refused > 100 && tool.doubled == 0, "{tool:?}");
    assert_eq!(cut.body().vertex_count(), vertices);
    assert_eq!(force(&cut), force(&run(&scene(&[]))));
}

/// A cut that there is no room for leaves what was cut before as it was.
#[test]
fn what_is_refused_beside_an_earlier_cut_leaves_that_alone() {
    let first = format!("tools.1={}", scalpel(-30.0, -5.0, 50.0, 0.5));
    let second = format!("tools.2={}", scalpel(32.5, -5.0, 50.0, 1.0));
    let before = run(&scene(&[&first]));
    let limit = format!("mesh.max_vertices={}", before.body().vertex_count() + 3);
    let after = run(&scene(&[&first, &second, &limit]));
    let tools = after.summary().unwrap().tools;
    assert!(tools[1].doubled > 0 && tools[1].refused == 0, "{:?}", tools[1]);
    assert!(tools[2].doubled == 0 && tools[2].refused > 0, "{:?}", tools[2]);
    assert_eq!(after.body().positions(), before.body().positions());
    assert_eq!(after.body().elements(), before.body().elements());
}

#[test]
fn what_can_not_be_beside_a_cut_is_refused() {
    let blade = format!("tools.1={}", scalpel(2.5, -25.0, 50.0, 0.5));
    let refusal = |settings: &[&str]| {
        let all: Vec<String> =
            [&blade[..]].iter().chain(settings).map(|&one| one.to_owned()).collect();
        scene_file::load("beam", &all).unwrap_err().to_string()
    };
    for (settings, words) in [
        ("output.checkpoint_steps=2", "output.checkpoint_steps is 2"),
        (
            "tools.2={kind=\"resect\", centre_mm=[0, 0, 0], radius_m=0.01, path=[{time_s=0, move_m=[0, 0, 0]}]}",
            "tools[2].kind",
        ),
        (
            "tools.2={kind=\"suture\", centre_mm=[0, 0, 0], radius_m=0.01, becomes=1, path=[{time_s=0, move_m=[0, 0, 0]}]}",
            "tools[2].becomes",
        ),
        ("tools.1.level=7", "tools[1].level is 7"),
        ("tools.1.edge_m=[0, 0, 0]", "tools[1].edge_m"),
        ("tools.1.toughness_j_m2=-1", "tools[1].toughness_j_m2"),
        (
            "tools.2={kind=\"pressure\", region={shape=\"box\", min=[0, 0, 1], max=[1, 1, 1]}, pressure=[{time_s=0, pressure_pa=1}]}",
            "tools[2].kind",
        ),
    ] {
        let found = refusal(&[settings]);
        assert!(found.contains(words), "{settings}: {found}");
    }
}

/// Two arms of a double cantilever, Kanninen 1973: what they store comes closer to it from below on finer meshes.
#[test]
fn a_slit_strip_is_peeled_as_beams_are() {
    let (p, young, a, b, h): (f64, f64, f64, f64, f64) = (2e-3, 5e4, 0.0975, 5e-3, 0.02);
    let bending = (a + 0.64 * h).powi(3) / (3.0 * young * b * h.powi(3) / 12.0);
    let want = p * p * (bending + 1.2 * a / (0.5 * young * b * h));
    let off = [0, 3].map(|level| {
        let levels = ["start", "max"].map(|end| format!("mesh.{end}_level={level}"));
        let peeled = run(&scene_file::load("peel", &levels).unwrap().0);
        assert!((peeled.summary().unwrap().tools[0].cut_cm2 - 5.0).abs() < 1e-9);
        1.0 - peeled.summary().unwrap().energy.unwrap().stored_j / want
    });
    assert!(off[0] > 0.3 && off[1] > 0.0 && off[1] < 0.6 * off[0], "{off:?} of {want:e} J");
}

/// Same scene, same bytes: two runs of the scene that is shown.
#[test]
fn an_incision_is_the_same_twice() {
    let (scene, _) = scene_file::load("incision", &[]).unwrap();
    let runs = [run(&scene), run(&scene)];
    let [one, other] = runs.each_ref().map(|simulation| simulation.body().positions());
    assert_eq!(one, other);
    let tools = runs[0].summary().unwrap().tools;
    assert!((tools[0].cut_cm2 - 7.68).abs() < 0.1, "{:?}", tools[0]);
    assert!(runs[0].summary().unwrap().energy.unwrap().created_j < 1e-9);
}

/// Points, m, and tetrahedra of a file of MSH 4.1 in mm, as codes read it that ask for no neighbours: where a cut ends, two
/// sheets and what is not cut share a face.
#[cfg(feature = "gmsh")]
fn msh(text: &str) -> (Vec<Vector3<f64>>, Vec<[usize; 4]>) {
    let rows = |section: &str| {
        let from = text.find(section).unwrap();
        let lines = text[from..].lines().skip(2).take_while(|line| !line.starts_with('$'));
        lines.map(|line| line.split_whitespace().map(|word| word.parse().unwrap()).collect())
    };
    let nodes: Vec<Vec<f64>> = rows("$Nodes").collect();
    let (mut points, mut tags) = (Vec::new(), Vec::new());
    let mut rest = &nodes[..];
    while let [head, block @ ..] = rest {
        let (block, others) = block.split_at(2 * head[3] as usize);
        let (own_tags, own) = block.split_at(head[3] as usize);
        tags.extend(own_tags.iter().map(|tag| tag[0] as usize));
        points.extend(own.iter().map(|x| Vector3::new(x[0], x[1], x[2]) * 1e-3));
        rest = others;
    }
    let at = |tag: f64| tags.iter().position(|&t| t == tag as usize).unwrap();
    let of_element = |row: Vec<f64>| (row.len() == 5).then(|| [1, 2, 3, 4].map(|i| at(row[i])));
    (points, rows("$Elements").filter_map(of_element).collect())
}

/// The mesh of a cut body in a file, and the stiffness that goes with it, are a problem that other codes can solve.
#[cfg(feature = "gmsh")]
#[test]
fn the_file_of_a_cut_mesh_gives_the_same_force_to_other_codes() {
    use nalgebra::{DMatrix, DVector, Matrix3};

    let blade = format!("tools.1={}", scalpel(2.5, -5.0, 50.0, 0.5));
    let scene =
        scene(&[&blade, "stages.corotation=none", "mesh.start_level=2", "mesh.max_level=2"]);
    let mut simulation = Simulation::builder(&scene).build().unwrap();
    // Cut, and not pulled yet.
    simulation.step().unwrap();
    let at_rest = simulation.frame().unwrap();
    let pulled = {
        while simulation.steps_left() > 0 {
            assert!(simulation.step().unwrap().converged);
        }
        simulation.frame().unwrap()
    };
    assert!(simulation.summary().unwrap().tools[1].doubled > 0);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.msh");
    yawara::output::write_msh(&path, &at_rest).unwrap();
    let (points, tets) = msh(&std::fs::read_to_string(&path).unwrap());
    assert_eq!([points.len(), tets.len()], [at_rest.points_mm.len(), at_rest.tets.len()]);
    let n = 3 * points.len();
    let mut k = DMatrix::<f64>::zeros(n, n);
    for (corners, young_modulus_pa) in tets.iter().zip(&at_rest.young_modulus_pa) {
        let x = corners.map(|v| points[v]);
        let edges = Matrix3::from_columns(&[x[1] - x[0], x[2] - x[0], x[3] - x[0]]);
        let inverse = edges.try_inverse().unwrap();
        let last = [0, 1, 2].map(|i| inverse.row(i).transpose());
        let gradients = [-(last[0] + last[1] + last[2]), last[0], last[1], last[2]];
        let scale = young_modulus_pa * edges.determinant().abs() / 6.0;
        // Without a Poisson ratio σ = E ε.
        for (v, a) in corners.iter().zip(&gradients) {
            for (w, b) in corners.iter().zip(&gradients) {
                let block = 0.5 * scale * (Matrix3::identity() * a.dot(b) + b * a.transpose());
                let mut at = k.fixed_view_mut::<3, 3>(3 * v, 3 * w);
                at += block;
            }
        }
    }
    let moved = |v: usize, by: f64| {
        let [x, y, z] = pulled.displacement_mm[v];
        (x.abs() - by).abs().max(y.abs()).max(z.abs()) < 1e-9
    };
    let along = pulled.displacement_mm.iter().map(|u| u[0]).find(|x| (x.abs() - 20.0).abs() < 1e-9);
    let along = along.unwrap().signum();
    let mut u = DVector::zeros(n);
    let (mut free, mut grabbed) = (Vec::new(), Vec::new());
    for v in 0..points.len() {
        if moved(v, 20.0) {
            u[3 * v] = 0.02 * along;
            grabbed.push(3 * v);
        } else if !moved(v, 0.0) {
            free.extend(3 * v..3 * v + 3);
        }
    }
    assert!(
        grabbed.len() > 3 && 3 * grabbed.len() + free.len() < n,
        "{grabbed:?}, {} of {n}",
        free.len()
    );
    let f = &k * &u;
    let inner = k.select_rows(&free).select_columns(&free);
    let answer = inner.lu().solve(&-f.select_rows(&free)).unwrap();
    free.iter().zip(&answer).for_each(|(&row, x)| u[row] = *x);
    let f = &k * &u;
    let want: Vector3<f64> =
        grabbed.iter().map(|&row| Vector3::new(f[row], f[row + 1], f[row + 2])).sum();
    let want = want.norm();
    let found = force(&simulation);
    assert!((found / want - 1.0).abs() < 1e-8, "{found} and {want} N");
    let apart = |v: usize, axis: usize| u[3 * v + axis] - 1e-3 * pulled.displacement_mm[v][axis];
    let off = (0..points.len()).flat_map(|v| (0..3).map(move |axis| (v, axis)));
    let off = off.map(|(v, axis)| apart(v, axis).abs()).fold(0.0, f64::max);
    assert!(off < 1e-8 * 0.02, "{off} m");
}
