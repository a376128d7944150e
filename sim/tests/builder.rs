//! Simulations from a volume in memory and with tools of one's own.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use faer::Mat;
use nalgebra::{Matrix6, Vector3};
use yawara::scene::{GrabHold, Image, Scene, ToolEntry};
use yawara::{BodyAtRest, Simulation, Stages, Tool, scene_file};
use yawara_embed::{ElementFormulation, Halved, LinearTet, P1, RingPart};
use yawara_mesh::VertexId;
use yawara_mesh::phantom::block;
use yawara_mesh::volume::LabelVolume;

fn beam() -> Scene {
    let settings = ["mesh.max_level=3".into(), "time.steps=2".into()];
    scene_file::load("beam", &settings).unwrap().0
}

/// The beam's block as labels, and the scene without it.
fn in_memory() -> (Scene, LabelVolume) {
    (Scene { image: Image::default(), ..beam() }, block([32, 8, 8], 5.0).unwrap())
}

#[test]
fn a_volume_in_memory_moves_as_the_same_phantom_does() {
    let (scene, volume) = in_memory();
    let mut given = Simulation::builder(&scene).volume(volume).build().unwrap();
    let mut phantom = Simulation::builder(&beam()).build().unwrap();
    let image = given.plan().iter().find(|row| row.stage == "image").unwrap();
    assert!(image.choice.contains("in memory"), "{image:?}");
    while given.steps_left() > 0 {
        let (a, b) = (given.step().unwrap(), phantom.step().unwrap());
        assert!(a.converged);
        assert_eq!((a.force_n, a.vertices), (b.force_n, b.vertices));
    }
    assert_eq!(given.frame().unwrap().points_mm, phantom.frame().unwrap().points_mm);
}

#[test]
fn a_scene_with_a_body_of_its_own_contradicts_a_volume() {
    let (mut scene, volume) = in_memory();
    let refusal = |scene: &Scene| {
        let built = Simulation::builder(scene).volume(volume.clone()).build();
        built.err().unwrap().to_string()
    };
    assert!(refusal(&beam()).contains("image.phantom"), "{}", refusal(&beam()));
    scene.image.voxel_mm = Some(2.0);
    assert!(refusal(&scene).contains("image.voxel_mm is 2.0, want no such key beside"));
    scene.image = Image { path: Some("liver.nii.gz".into()), ..Image::default() };
    assert!(refusal(&scene).contains("image.path"));
    scene.image = Image::default();
    scene.mesh.path = Some("liver.msh".into());
    assert!(refusal(&scene).contains("mesh.path"));
    // Without the volume the scene has no body.
    assert!(Simulation::builder(&in_memory().0).build().is_err());
}

/// Holds the end of the beam and lifts it, as the scene's own grab does.
struct Lift {
    end_m: f64,
    rise_m_s: f64,
}

impl Tool for Lift {
    fn kind(&self) -> &'static str {
        "lift"
    }

    fn reference(&self, t: f64) -> Vector3<f64> {
        Vector3::new(self.end_m, 0.02, 0.02 + self.rise_m_s * t)
    }

    fn grasp(&self, body: &BodyAtRest<'_>) -> Result<Vec<VertexId>, yawara::SimError> {
        Ok(body.available().filter(|&v| self.takes(&body.position(v))).collect())
    }

    fn takes(&self, rest: &Vector3<f64>) -> bool {
        rest.x > self.end_m - 1e-9
    }

    fn target(&self, rest: &Vector3<f64>, t: f64) -> Vector3<f64> {
        rest + Vector3::new(0.0, 0.0, self.rise_m_s * t)
    }
}

#[test]
fn a_tool_of_ones_own_holds_vertices_as_a_built_in_one_does() {
    let mut scene = beam();
    let ToolEntry::Grab(grab) = &mut scene.tools[0] else { panic!() };
    grab.hold = GrabHold::Vertices;
    let mut built_in = Simulation::builder(&scene).build().unwrap();
    scene.tools.clear();
    let lift = |body: &mut BodyAtRest<'_>| Ok(Lift { end_m: body.at([1.0; 3]).x, rise_m_s: 0.02 });
    let mut own = Simulation::builder(&scene).tool(lift).build().unwrap();
    while own.steps_left() > 0 {
        let (a, b) = (own.step().unwrap(), built_in.step().unwrap());
        assert_eq!(a.tools[0].kind, "lift");
        assert_eq!((a.vertices, a.splits), (b.vertices, b.splits));
        let off = (Vector3::from(a.force_n) - Vector3::from(b.force_n)).norm();
        assert!(off <= 1e-5 * Vector3::from(b.force_n).norm(), "{off}");
    }
    assert!(own.set_tool_pose(0, yawara::Pose::default()).is_err(), "it has no path");
}

/// `p1` with unknowns as told, counting its matrices and shares of rings.
struct Counting {
    unknowns: usize,
    matrices: Arc<AtomicUsize>,
    shares: Arc<AtomicUsize>,
}

impl ElementFormulation for Counting {
    fn name(&self) -> &'static str {
        "counting"
    }

    fn unknowns(&self) -> usize {
        self.unknowns
    }

    fn negative(&self) -> usize {
        0
    }

    fn stiffness(&self, geometry: &LinearTet, elasticity: &Matrix6<f64>) -> Mat<f64> {
        self.matrices.fetch_add(1, Ordering::Relaxed);
        P1.stiffness(geometry, elasticity)
    }

    fn part(&self, halved: &Halved) -> RingPart {
        self.shares.fetch_add(1, Ordering::Relaxed);
        P1.part(halved)
    }
}

#[test]
fn an_element_of_ones_own_makes_the_matrix_and_its_changes() {
    let mut scene = beam();
    scene.stages.element = "p1".into();
    let counters = || (Arc::new(AtomicUsize::new(0)), Arc::new(AtomicUsize::new(0)));
    let with = |unknowns, (matrices, shares): &(Arc<AtomicUsize>, Arc<AtomicUsize>)| {
        let mut stages = Stages::by_name(&scene.stages).unwrap();
        let (matrices, shares) = (Arc::clone(matrices), Arc::clone(shares));
        stages.element = Some(Box::new(Counting { unknowns, matrices, shares }));
        Simulation::new(&scene, stages)
    };
    let counts = counters();
    let mut own = with(3, &counts).unwrap();
    let mut built_in = Simulation::builder(&scene).build().unwrap();
    let row = own.plan().iter().find(|row| row.stage == "element").unwrap();
    assert!(row.choice == "counting" && row.why.contains("p1"), "{row:?}");
    let mut changes = 0;
    while own.steps_left() > 0 {
        let (a, b) = (own.step().unwrap(), built_in.step().unwrap());
        assert_eq!((a.force_n, a.vertices), (b.force_n, b.vertices));
        changes += a.splits;
    }
    assert!(counts.0.load(Ordering::Relaxed) > 0);
    assert!(changes > 0 && counts.1.load(Ordering::Relaxed) >= changes);
    let refusal = with(5, &counters()).err().unwrap().to_string();
    assert!(refusal.contains("`counting` has 5 unknowns"), "{refusal}");
}

#[test]
fn parts_of_the_set_up_are_told_as_they_begin() {
    let (scene, mut parts) = (beam(), Vec::<&str>::new());
    let watched = Simulation::builder(&scene).progress(|part, done| {
        assert!((0.0..=1.0).contains(&done), "{part}: {done}");
        if parts.last() != Some(&part) {
            parts.push(part);
        }
        ControlFlow::Continue(())
    });
    drop(watched.build().unwrap());
    let order = ["reading and meshing", "placing tools", "homogenising", "outlining", "factoring"];
    assert_eq!(parts, order);
}
