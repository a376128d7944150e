//! The state of a simulation taken out, and the simulation made again from it.

use std::collections::HashMap;

use nalgebra::{Isometry3, Matrix3, Quaternion, Unit, Vector3};
use yawara_corot::LawState;
use yawara_embed::Strain;
use yawara_mesh::{BisectionForest, Lattice, MeshDelta, Point, TetId, VertexId};

use super::beginning::{Beginning, StartMesh};
use super::checkpoint::{Checkpoint, KeptTets, KeptVertices, Numbers};
use super::contact::ContactState;
use super::holding::hold_material;
use super::ledger::Ledger;
use super::simulation::{SimulatedBody, Simulation};
use crate::body::{BodyState, Hold};
use crate::error::SimError;
use crate::inverse::Elements;
use crate::report::Names;

/// How the numbers of a mesh are those of the same mesh made again from the start.
struct Again {
    splits: Vec<Point>,
    /// Numbers before, by vertex of the mesh made again.
    vertices: Vec<usize>,
    /// The same of its tetrahedra, in its order.
    tets: Vec<TetId>,
    numbers: Numbers,
}

impl Again {
    /// Of a mesh that was refined from `start`.
    fn of_forest(start: &BisectionForest, forest: &BisectionForest) -> Result<Self, SimError> {
        let is_new = |v: &VertexId| start.vertex_at(forest.point(*v)).is_none();
        let mut new: Vec<VertexId> = forest.vertices().filter(is_new).collect();
        new.sort_by_key(|&v| (forest.generation(v), forest.point(v)));
        let splits: Vec<Point> = new.into_iter().map(|v| forest.point(v)).collect();
        let again = refined(start, &splits)?;
        let mut numbers = vec![None; forest.vertex_capacity()];
        let mut vertices = Vec::with_capacity(again.vertex_count());
        for v in again.vertices() {
            if let Some(old) = forest.vertex_at(again.point(v)) {
                vertices.push(old.index());
                numbers[old.index()] = Some(v.index());
            }
        }
        let by_corners: HashMap<[Point; 4], TetId> =
            forest.leaves().map(|leaf| (corners(forest, leaf.vertices), leaf.id)).collect();
        let old = |vertices| by_corners.get(&corners(&again, vertices)).copied();
        let tets = again.leaves().filter_map(|leaf| old(leaf.vertices)).collect();
        Ok(Self { splits, vertices, tets, numbers: Numbers::new(numbers) })
    }

    /// Of a mesh that stays as it is.
    fn of_file(state: &BodyState) -> Self {
        let vertices: Vec<usize> = state.vertices().map(VertexId::index).collect();
        let numbers = Numbers::new(vertices.iter().map(|&v| Some(v)).collect());
        let tets = state.elements().iter().map(|element| element.tet).collect();
        Self { splits: Vec::new(), vertices, tets, numbers }
    }
}

/// The points of a tetrahedron's corners, ascending.
fn corners(forest: &BisectionForest, vertices: [VertexId; 4]) -> [Point; 4] {
    let mut points = vertices.map(|v| forest.point(v));
    points.sort_unstable();
    points
}

/// The start mesh after these splits.
fn refined(start: &BisectionForest, splits: &[Point]) -> Result<BisectionForest, SimError> {
    let (mut forest, mut delta) = (start.clone(), MeshDelta::empty());
    for &point in splits {
        forest.split(point, &mut delta)?;
    }
    Ok(forest)
}

impl Simulation {
    /// Takes out all that the next steps follow from, and makes the simulation again from it: meshes are numbered
    /// and inverses factored afresh, and what solvers had learned is forgotten. So its next steps are those of a
    /// simulation that [resumes](Self::resume) the checkpoint, to the last bit, and others, by rounding,
    /// than without.
    ///
    /// What a stage or tool of one's own remembers from step to step besides what its trait tells of is not in it:
    /// only one that remembers nothing can be gone on with.
    ///
    /// Cost: about that of assembling and inverting K, and of binding tools to the mesh.
    /// # Errors
    /// [`SimError::Value`] if the scene has no `output.checkpoint_steps`; those of an inverse, after which the
    /// simulation can't go on.
    pub fn checkpoint(&mut self) -> Result<Checkpoint, SimError> {
        let checkpoint = self.kept()?;
        self.make_again(&checkpoint)?;
        Ok(checkpoint)
    }

    /// Goes on where a simulation of the same scene was when it made `checkpoint`.
    ///
    /// # Errors
    /// [`SimError::OtherStage`] if the plans differ, [`SimError::OtherCheckpoint`] for one of another scene, as far as
    /// that is seen; as [`checkpoint`](Self::checkpoint).
    pub fn resume(&mut self, checkpoint: &Checkpoint) -> Result<(), SimError> {
        self.beginning()?;
        let rows = self.recorder.plan.iter().zip(&checkpoint.plan);
        if let Some((row, (_, made))) =
            rows.into_iter().find(|(row, kept)| (&row.stage, &row.choice) != (&kept.0, &kept.1))
        {
            let [scene, stage, made, has] =
                [&self.scene.name, &row.stage, made, &row.choice].map(Clone::clone);
            return Err(SimError::OtherStage { scene, stage, made, has });
        }
        // Cut beside the start mesh, as it was for the first frame.
        if let (Some(outline), Some(refiner)) = (&self.recorder.outline, &self.body.refiner) {
            outline.cut(&refiner.content.forest)?;
        }
        self.make_again(checkpoint)?;
        let kinds: Vec<&'static str> = self.tools.iter().map(|tool| tool.kind()).collect();
        let names = Names { tools: &kinds, goal: self.goal.map(|goal| goal.name()) };
        self.recorder.statistics.resume(&checkpoint.statistics, &names);
        Ok(())
    }

    fn beginning(&self) -> Result<&Beginning, SimError> {
        let want = "at least 1 for a simulation to be kept";
        let none = || SimError::value(&self.scene.name, "output.checkpoint_steps", 0, want);
        self.beginning.as_ref().ok_or_else(none)
    }

    fn kept(&self) -> Result<Checkpoint, SimError> {
        let beginning = self.beginning()?;
        let SimulatedBody { state, inverse, refiner } = &self.body;
        let again = match (&beginning.mesh, refiner) {
            (StartMesh::Forest(start), Some(refiner)) => {
                Again::of_forest(start, &refiner.content.forest)?
            }
            _ => Again::of_file(state),
        };
        let Again { splits, vertices, tets, numbers } = again;
        let of = |field: &[Vector3<f64>]| vertices.iter().map(|&v| field[v].into()).collect();
        let rotations = tets.iter().filter_map(|tet| state.body.number(*tet));
        let rotations = rotations.map(|number| state.body.rotation(number).into());
        let law = tets.iter().filter_map(|tet| state.body.law_state(*tet));
        let law = law.filter(|handed| !handed.state.is_empty());
        let poses = state.body.grips().iter().map(|grip| {
            let turn = grip.pose().rotation.coords;
            (grip.pose().translation.vector.into(), turn.into())
        });
        Ok(Checkpoint {
            tools: self.tools.len(),
            plan: self
                .recorder
                .plan
                .iter()
                .map(|row| (row.stage.clone(), row.choice.clone()))
                .collect(),
            splits,
            came: beginning.came.clone(),
            vertices: KeptVertices {
                holds: vertices.iter().map(|&v| state.holds[v]).collect(),
                positions: of(&state.positions),
                velocities: of(&state.velocities),
                accelerations: of(&state.accelerations),
                pressures: vertices.iter().map(|&v| state.body.pressure(v)).collect(),
                pressure_rates: vertices.iter().map(|&v| state.pressure_rates[v]).collect(),
                pressure_bends: vertices.iter().map(|&v| state.pressure_bends[v]).collect(),
            },
            tets: KeptTets {
                rotations: rotations.collect(),
                law: law.map(|handed| (handed.state, handed.beyond.into())).collect(),
            },
            poses: poses.collect(),
            refiner: refiner.as_ref().map(|refiner| refiner.kept(&vertices, &tets, &numbers)),
            solver: self.solver.kept(&numbers),
            contact: self.contact.kept(),
            ledger: self.ledger.kept(),
            inverse: inverse.kept(),
            support: self.support.into(),
            statistics: self.recorder.statistics.kept(),
        })
    }

    /// Makes body, inverse and all that follows them from what was kept, whatever they are now.
    fn make_again(&mut self, kept: &Checkpoint) -> Result<(), SimError> {
        self.bring_tools(&kept.came)?;
        // Duals are found by an inverse that is another now.
        self.stood = None;
        let mut state = self.state_again(kept)?;
        self.solver.resume(&kept.solver, &mut state);
        let elements = state.elements().iter().map(|element| element.tet);
        let tets: Vec<TetId> = elements.collect();
        for (&tet, (law, beyond)) in tets.iter().zip(&kept.tets.law) {
            let handed = LawState { state: law.clone(), beyond: Strain::from(*beyond) };
            state.body.set_law_state(tet, &handed);
        }
        let Self { body, tools, coming, .. } = self;
        let organ = self.beginning.as_ref().map(|beginning| beginning.organ);
        let forest = body.refiner.as_ref().map(|refiner| &refiner.content.forest);
        let key = |v: VertexId| match (forest, &organ) {
            (Some(forest), _) => Lattice::key(forest.point(v)),
            (None, organ) => organ.map_or(0, |organ| organ.grid_key(&state.rest[v.index()])),
        };
        body.inverse.renew(
            &kept.inverse,
            &Elements { body: &state.body, density: &|tet| state.density(tet) },
            state.vertices(),
            |v| state.holds[v] == Hold::Fixed,
            key,
        )?;
        for (number, tool) in tools.iter_mut().enumerate() {
            if !coming.iter().any(|(of, _)| *of == number) {
                tool.unbind();
                tool.follow(&state)?;
            }
        }
        if let (Some(refiner), Some(kept)) = (&mut body.refiner, &kept.refiner) {
            refiner.resume(kept)?;
        }
        self.contact = ContactState::resumed(&kept.contact, tools);
        self.ledger = Ledger::resumed(&kept.ledger);
        self.support = kept.support.into();
        body.state = state;
        Ok(())
    }

    /// Has those tools come that had come.
    fn bring_tools(&mut self, came: &[usize]) -> Result<(), SimError> {
        let place = self.scene.name.clone();
        self.beginning()?;
        let Self { beginning: Some(beginning), coming, .. } = self else { return Ok(()) };
        for &tool in came {
            if beginning.came.contains(&tool) {
                continue;
            }
            let at = coming.iter().position(|(of, _)| *of == tool);
            let (_, hold) = coming.remove(at.ok_or(SimError::OtherCheckpoint(place.clone()))?);
            beginning.take(tool, hold.as_ref());
        }
        Ok(())
    }

    /// The body as it was kept, on the mesh made again.
    fn state_again(&mut self, kept: &Checkpoint) -> Result<BodyState, SimError> {
        let Self { body, beginning: Some(beginning), scene, tools, .. } = self else {
            return Err(SimError::OtherCheckpoint(self.scene.name.clone()));
        };
        let other = || SimError::OtherCheckpoint(scene.name.clone());
        let empty = body.state.body.emptied();
        let of = &kept.vertices;
        let holds = &of.holds;
        let mut state = match (&beginning.mesh, &mut body.refiner) {
            (StartMesh::Forest(start), Some(refiner)) => {
                let forest = refined(start, &kept.splits)?;
                let mut by_number = vec![Hold::Free; forest.vertex_capacity()];
                forest.vertices().zip(holds).for_each(|(v, hold)| by_number[v.index()] = *hold);
                refiner.content.forest = forest;
                refiner.content.state(&by_number, empty)
            }
            (StartMesh::File(mesh, memory), _) if mesh.mesh.points().len() == holds.len() => {
                mesh.state(holds, empty, memory.as_ref())
            }
            _ => return Err(other()),
        };
        hold_material(beginning.grips.clone(), &scene.name, &mut state)?;
        let [vertices, tets] = [state.vertex_count(), state.tet_count()];
        let counts = [vertices, state.positions.len(), tets, state.body.grips().len()];
        if kept.tools != tools.len() || !kept.is_of(counts) {
            return Err(other());
        }
        state.is_dynamic = body.state.is_dynamic;
        for (grip, (place, turn)) in state.body.grips_mut().iter_mut().zip(&kept.poses) {
            let turn = Unit::new_unchecked(Quaternion::from(*turn));
            grip.set_pose(Isometry3::from_parts(Vector3::from(*place).into(), turn));
        }
        let vertices: Vec<usize> = state.vertices().map(VertexId::index).collect();
        for (i, &v) in vertices.iter().enumerate() {
            state.positions[v] = of.positions[i].into();
            state.velocities[v] = of.velocities[i].into();
            state.accelerations[v] = of.accelerations[i].into();
            state.body.set_pressure(v, of.pressures[i]);
            state.pressure_rates[v] = of.pressure_rates[i];
            state.pressure_bends[v] = of.pressure_bends[i];
        }
        self.solver_turns(&mut state, &kept.tets.rotations);
        Ok(state)
    }

    /// Gives elements the rotations that they had, from which those of their positions are found.
    fn solver_turns(&self, state: &mut BodyState, rotations: &[[[f64; 3]; 3]]) {
        let elements = state.elements().iter().map(|element| element.tet);
        let by_tet: HashMap<TetId, Matrix3<f64>> =
            elements.zip(rotations).map(|(tet, columns)| (tet, Matrix3::from(*columns))).collect();
        let turned = |tet: TetId| by_tet.get(&tet).copied().unwrap_or_else(Matrix3::identity);
        let mut scratch = vec![Vector3::zeros(); state.positions.len()];
        let BodyState { body, positions, .. } = state;
        body.begin_step(self.solver.step_s());
        body.forces_with_rotations(|element| turned(element.tet), positions, &mut scratch);
    }
}
