//! A simulation from a scene, its stages and what is given in memory.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use nalgebra::Vector3;
use yawara_embed::{ElementFormulation, Embedding, Materials, VoidRule};
use yawara_mesh::volume::LabelVolume;
use yawara_mesh::{Lattice, VertexId};

use super::beginning::{Beginning, StartMesh};
use super::contact::ContactState;
use super::content::{Content, EDITS, is_of_parts};
use super::cutting::park;
use super::dynamics::{self, Motion};
use super::easing::ease_steps;
use super::equilibrium::StepSolver;
use super::figures::Figure;
use super::holding::{Coming, Grips, hold_material};
use super::ledger::Ledger;
use super::refinement::{Refiner, Rules};
use super::simulation::{SimulatedBody, Simulation};
#[cfg(feature = "view")]
use crate::body::outline_inner;
use crate::body::{BodyState, Hold, ImageBody, Memory, OrganBox, Origin, Places, Start};
use crate::choice::{Stages, empty_body, law_of_scene, of_scene, plan};
use crate::error::SimError;
use crate::inverse::{Elements, InverseFactory, InverseLink};
use crate::report::{BodyOutline, Recorder, RunStatistics, Surfaces};
use crate::scene::{BesideTissue, GoalEntry, Scene, SupportHold, ToolEntry};
use crate::tools::{self, BodyAtRest, Holding, MaterialHold, Regions, Tool};

/// All tools, by number.
type Tools = Vec<Box<dyn Tool>>;

/// The tools of a body at rest.
struct Made {
    tools: Tools,
    /// What holds each vertex of the start mesh, by its number.
    holds: Vec<Hold>,
    grips: Grips,
    /// Tools that begin later, with what they hold then.
    coming: Coming,
    /// How much that is.
    held: Vec<Holding>,
}

/// Makes a tool for a body at rest.
type MakeTool<'a> = Box<dyn FnOnce(&mut BodyAtRest<'_>) -> Result<Box<dyn Tool>, SimError> + 'a>;

/// Called with a part of the work and the fraction of it that is done.
type Progress<'a> = Box<dyn FnMut(&'static str, f64) -> ControlFlow<()> + 'a>;

const HOMOGENISING: &str = "homogenising";

/// What a simulation is made from. [`Simulation::builder`] begins it.
pub struct SimulationBuilder<'a> {
    scene: &'a Scene,
    stages: Option<Stages>,
    volume: Option<LabelVolume>,
    tools: Vec<MakeTool<'a>>,
    progress: Progress<'a>,
    #[cfg(feature = "view")]
    outlines_all: bool,
}

impl Simulation {
    /// Begins a simulation of `scene`, with the stages that it names unless others are given.
    pub fn builder(scene: &Scene) -> SimulationBuilder<'_> {
        SimulationBuilder {
            scene,
            stages: None,
            volume: None,
            tools: Vec::new(),
            progress: Box::new(|_, _| ControlFlow::Continue(())),
            #[cfg(feature = "view")]
            outlines_all: false,
        }
    }

    /// Reads the image, homogenises its material, assembles and inverts the start mesh.
    /// # Errors
    /// As [`SimulationBuilder::build`].
    pub fn new(scene: &Scene, stages: Stages) -> Result<Self, SimError> {
        Self::builder(scene).stages(stages).build()
    }
}

impl<'a> SimulationBuilder<'a> {
    /// Takes these stages, whatever the scene names.
    pub fn stages(mut self, stages: Stages) -> Self {
        self.stages = Some(stages);
        self
    }

    /// Takes the labels of the body from memory. The scene then must not name an image, a phantom
    /// or a mesh file, nor a size of voxels.
    pub fn volume(mut self, labels: LabelVolume) -> Self {
        self.volume = Some(labels);
        self
    }

    /// Adds a tool, numbered after those of the scene. `make` sees the body at rest and the start
    /// mesh.
    pub fn tool<T: Tool + 'static>(
        mut self,
        make: impl FnOnce(&mut BodyAtRest<'_>) -> Result<T, SimError> + 'a,
    ) -> Self {
        self.tools.push(Box::new(|body| Ok(Box::new(make(body)?))));
        self
    }

    /// Has the outlines of the body and of all labels in it, whichever the scene asks for.
    #[cfg(feature = "view")]
    pub(crate) fn outlines_all(mut self) -> Self {
        self.outlines_all = true;
        self
    }

    /// Calls `progress` with the name of each part of the work as it begins and the fraction of it that is done, 0
    /// then: more often by a homogenisation that solves for the whole fine body. Breaking stops that.
    pub fn progress(
        mut self,
        progress: impl FnMut(&'static str, f64) -> ControlFlow<()> + 'a,
    ) -> Self {
        self.progress = Box::new(progress);
        self
    }

    /// Reads the image, homogenises its material, assembles and inverts the start mesh.
    /// # Errors
    /// [`SimError`] for a scene that can't be simulated, or that contradicts what was given in
    /// memory; [`EmbedError::Stopped`](yawara_embed::EmbedError::Stopped) by
    /// [`progress`](Self::progress). Nothing is written.
    pub fn build(mut self) -> Result<Simulation, SimError> {
        let begin = Instant::now();
        let scene = self.scene;
        scene.validate_for(&scene.name, self.volume.is_some())?;
        let mut stages = self.stages.take().map_or_else(|| Stages::by_name(&scene.stages), Ok)?;
        let element = of_scene(scene, &stages)?;
        self.begin("reading and meshing");
        let start = Start::new(scene, self.volume.take())?;
        self.begin("placing tools");
        // Who brings tools of their own may have them change labels.
        let are_own = !self.tools.is_empty();
        let Made { mut tools, holds, grips, coming, held } = self.make_tools(&start)?;
        let (law, why_law) = law_of_scene(scene, &stages, &start);
        let mut plan = plan::rows(scene, &start, &stages, element, (&law, &why_law), &held);
        let first = GoalEntry::Force { tool: 0 };
        let asked = scene.refinement.goal.as_ref();
        let goal = asked.or_else(|| stages.indicator.is_of_goal().then_some(&first));
        let goal_points = goal.and_then(GoalEntry::region).map(|region| {
            let zone = start.places.zone(region, "refinement.goal.region")?;
            Ok::<_, SimError>(start.material_points(&zone))
        });
        let goal_points = goal_points.transpose()?;
        let memory = if stages.law.is_none() { Memory::of(scene)? } else { None };
        let is_changed =
            scene.tools.iter().any(ToolEntry::edits) || !scene.mesh.topology.is_merged();
        if memory.is_some() && is_changed {
            let want = "no law that remembers beside a tool that changes labels or cuts, or beside \
                        mesh.topology = \"components\"";
            return Err(SimError::value(&scene.name, "materials", "with a law", want));
        }
        let law = match &memory {
            Some(memory) => Box::new(memory.law()),
            None => stages.take_law(&law, scene)?,
        };
        let empty = empty_body(element)?.with_law(law);
        let integrator = stages.take_integrator(scene)?;
        let Stages {
            homogenisation, element: own, forces, equilibrium, indicator, inverse, ..
        } = stages;
        let Start { places: Places { name, axes, organ, .. }, fixed, origin, .. } = start;
        let (mut body_summary, mut volume, mut surfaces, mut outline) = (None, None, None, None);
        let is_kept = scene.output.checkpoint_steps > 0;
        let mut held_grips = if is_kept { grips.clone() } else { Grips::new() };
        let (mut state, refiner, start_mesh) = match origin {
            Origin::MeshFile(mesh) => {
                let state = mesh.state(&holds, empty, memory.as_ref());
                (state, None, is_kept.then_some(StartMesh::File(mesh, memory)))
            }
            Origin::Image(mut setup) => {
                let rule = match scene.void.beside_tissue {
                    BesideTissue::Material => VoidRule::Material,
                    BesideTissue::Volume => VoidRule::Volume,
                };
                let by_label = std::mem::take(&mut setup.materials);
                let positions = std::mem::take(&mut setup.positions);
                let materials = match &memory {
                    Some(memory) => memory.in_a_step(&by_label, &positions)?,
                    None => Materials::from(by_label.clone()),
                };
                let materials = materials.with_void(rule);
                let tree = Arc::clone(&setup.tree);
                self.begin(HOMOGENISING);
                let mut progress = |done| (self.progress)(HOMOGENISING, done);
                let mut embedding =
                    Embedding::with_materials(tree, materials, homogenisation, &mut progress)?;
                let memory = memory.map(|memory| {
                    memory.embedded(&by_label, &positions, &embedding, &mut progress)
                });
                let memory = memory.transpose()?;
                plan::homogenised(&mut plan, &embedding);
                #[cfg(feature = "view")]
                let drawn = &mut scene.clone();
                #[cfg(feature = "view")]
                if self.outlines_all {
                    outline_inner(&mut drawn.output, &setup.volume);
                }
                #[cfg(not(feature = "view"))]
                let drawn = scene;
                self.begin("outlining");
                let whole = setup.apart.as_ref().map_or(&setup.forest, |(whole, _)| whole);
                surfaces = Surfaces::new(drawn, whole, &setup.volume, &embedding)?;
                let ImageBody { forest, apart, placement, summary, volume: labels, .. } = *setup;
                body_summary = Some(summary);
                let label_values = labels.values().to_vec();
                let labels = Arc::new(labels);
                volume = scene.output.field.then(|| Arc::clone(&labels));
                let has_outline = scene.output.outline && scene.output.frames_every > 0;
                #[cfg(feature = "view")]
                let has_outline = has_outline || self.outlines_all;
                outline = has_outline.then(|| BodyOutline::new(Arc::clone(&labels)));
                let edits = scene.tools.iter().any(ToolEntry::edits);
                if edits {
                    is_of_parts(&embedding, &scene.name, EDITS)?;
                }
                if apart.is_some() {
                    let beside = ", beside mesh.topology = \"components\"";
                    is_of_parts(&embedding, &scene.name, beside)?;
                }
                if let Some((_, parts)) = &apart {
                    embedding.adopt(Arc::clone(forest.tree()), parts)?;
                }
                let volume = (edits || are_own).then(|| Arc::clone(&labels));
                let content = Content {
                    forest,
                    embedding,
                    placement,
                    memory,
                    volume,
                    label_values,
                    material_of: positions,
                };
                let is_asked = scene.refinement.split_above.is_some() || !scene.mesh.refines();
                if !is_asked && indicator.error_over_sum().is_none() {
                    let want =
                        format!("a number, for the indicator {} is no energy", indicator.name());
                    let key = "refinement.split_above";
                    return Err(SimError::value(&scene.name, key, "missing", want));
                }
                let rules = Rules {
                    refinement: scene.refinement.clone(),
                    max_vertices: scene.mesh.max_vertices,
                    indicator,
                    ease_steps: ease_steps(scene),
                };
                let mut state = content.state(&holds, empty);
                if let Some((_, parts)) = &apart {
                    content.note_sheets(parts, &mut state);
                }
                let fixed = match scene.support.hold {
                    SupportHold::Vertices => &fixed[..],
                    SupportHold::Elastic => &[],
                };
                let regions = Regions::new(fixed, organ, labels, &holds);
                let forest = is_kept.then(|| StartMesh::Forest(Box::new(content.forest.clone())));
                (state, Some(Refiner::new(content, rules, regions)), forest)
            }
        };
        hold_material(grips, &name, &mut state)?;
        if let Some(summary) = body_summary.as_mut()
            && !scene.mesh.topology.is_merged()
            && scene.dynamics.is_none()
        {
            let gravity = Vector3::from(scene.gravity_m_s2).norm();
            summary.topology.parked = park(&mut state, gravity, &|_| true).len();
        }
        let goal = goal.map(|goal| {
            let points = goal_points.unwrap_or_default();
            if goal.region().is_some() && is_kept {
                held_grips.push((None, MaterialHold { points: points.clone(), stiffness: None }));
            }
            Figure::new(goal, points, scene, &axes, &mut state, &tools)
        });
        let goal = goal.transpose()?;
        let motion = Motion::new(scene, integrator, &axes, &mut state);
        let built_in = || dynamics::formulation(scene, element, state.body.law(), motion.as_ref());
        let formulation = own.map_or_else(built_in, Ok)?;
        self.begin("factoring");
        let link = invert(formulation, &state, refiner.as_ref(), &organ, inverse)?;
        plan.push(plan::inverse(scene, &link));
        let is_there = |(number, _): &(usize, _)| !coming.iter().any(|(of, _)| of == number);
        let mut there = tools.iter_mut().enumerate().filter(is_there);
        there.try_for_each(|(_, tool)| tool.follow(&state))?;
        let gravity = axes.to_solver_direction(&Vector3::from(scene.gravity_m_s2));
        let statistics = RunStatistics::new(begin, &state);
        let beginning = start_mesh.map(|mesh| {
            let came = Vec::new();
            Beginning { mesh, organ, grips: held_grips, came }
        });
        Ok(Simulation {
            scene: scene.clone(),
            ledger: Ledger::new(tools.len()),
            tools,
            contact: ContactState::default(),
            solver: StepSolver::new(forces, equilibrium, scene, gravity, motion),
            body: SimulatedBody { state, inverse: link, refiner },
            goal,
            coming,
            beginning,
            rest: None,
            recorder: Recorder {
                axes,
                plan,
                body: body_summary,
                volume,
                surfaces,
                outline,
                statistics,
            },
            support: Vector3::zeros(),
            are_surfaces_stale: false,
            stood: None,
        })
    }

    fn begin(&mut self, part: &'static str) {
        // Only homogenisations are long enough to be stopped.
        let _ = (self.progress)(part, 0.0);
    }

    /// All tools with what they and supports hold.
    fn make_tools(&mut self, start: &Start) -> Result<Made, SimError> {
        let mut grips = supports(self.scene, start);
        let mut body = BodyAtRest::new(self.scene, start);
        let entries = self.scene.tools.iter().enumerate().map(|(i, entry)| -> MakeTool<'_> {
            Box::new(move |body| tools::by_name(entry, &format!("tools[{i}]"), body))
        });
        let (mut made, mut coming) = (Vec::new(), Coming::new());
        for (number, make) in entries.chain(self.tools.drain(..)).enumerate() {
            let tool = make(&mut body)?;
            body.hold(&tool.grasp(&body)?, number);
            let hold = tool.grip(&body)?;
            match tool.begin_s() {
                Some(_) => coming.push((number, hold)),
                None => grips.extend(hold.map(|hold| (Some(number), hold))),
            }
            made.push(tool);
        }
        let held = tools::holdings(self.scene, &mut body)?;
        Ok(Made { tools: made, holds: body.into_holds(), grips, coming, held })
    }
}

/// The material that fixed regions hold, each point by the first of them.
fn supports(scene: &Scene, start: &Start) -> Grips {
    if scene.support.hold == SupportHold::Vertices {
        return Vec::new();
    }
    let given = scene.support.stiffness_n_m4;
    let stiffness = Some(given.unwrap_or_else(|| start.holding_stiffness(scene)));
    let held = |i: usize| (None, MaterialHold { points: start.held_by(i), stiffness });
    (0..start.fixed.len()).map(held).collect()
}

/// The inverse of the stiffness of `state` with its fixed vertices held.
fn invert(
    formulation: Box<dyn ElementFormulation>,
    state: &BodyState,
    refiner: Option<&Refiner>,
    organ: &OrganBox,
    factory: InverseFactory,
) -> Result<InverseLink, SimError> {
    let key = |v: VertexId| match refiner {
        Some(refiner) => Lattice::key(refiner.content.forest.point(v)),
        None => organ.grid_key(&state.rest[v.index()]),
    };
    let at_once = refiner.map_or(0, |refiner| refiner.rules.refinement.max_splits_per_step);
    InverseLink::new(
        &Elements { body: &state.body, density: &|tet| state.density(tet) },
        formulation,
        state.vertices(),
        |v| state.holds[v] == Hold::Fixed,
        key,
        Box::new(move |mut k| {
            k.expect_updates(at_once);
            factory(k)
        }),
    )
}
