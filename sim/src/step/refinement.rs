//! Splits and merges: which vertices come in and go out, and the repair of all later stages.

use std::mem::take;
use std::time::Instant;

use nalgebra::{Matrix3, Vector3};
use yawara_mesh::{Change, ClosureQueue, Lattice, MeshDelta, Point, Tet, TetId, VertexId};

use super::checkpoint::{KeptRefiner, Numbers};
use super::content::Content;
use super::indicator::{Indicator, Measured, RingMember, Sight};
use super::marking::{Limits, Wish};
use super::proximity::Proximity;
use crate::body::{BodyState, Hold};
use crate::error::SimError;
use crate::inverse::{Elements, InverseLink};
use crate::report::{StageTimes, milliseconds};
use crate::scene::{NearProbe, Refinement};
use crate::tools::{Regions, Tool};

/// Energy below this part of the largest so far is refined for as if it were that much.
const NOTHING: f64 = 1e-2;

/// A wish that comes after those of any indicator.
const LAST: f64 = 1e-300;

/// A strain that is rounding, or what a solver leaves of a body at rest.
const NO_STRAIN: f64 = 1e-9;

/// The least part that the error of a goal counts for of the sum of its shares.
const CANCELLED: f64 = 0.25;

/// Refines the mesh of a body and coarsens it again.
pub(crate) struct Refiner {
    pub content: Content,
    pub(super) rules: Rules,
    /// Where new vertices are held.
    pub(super) regions: Regions,
    /// Step in which each vertex came in.
    born: Vec<usize>,
    /// Last measured indicator of each tetrahedron's ring, by tetrahedron number.
    measured: Vec<f64>,
    /// Whether these are of elements, not of rings.
    measures_elements: bool,
    /// Of the last measurement.
    estimates: Estimates,
    /// The largest energy so far, J.
    most_energy: f64,
    /// The largest goal so far, in its unit.
    most_goal: f64,
    delta: MeshDelta,
    ring: Vec<Tet>,
    members: Vec<RingMember>,
    /// Splits that are wanted, as last measured.
    waiting: ClosureQueue,
    /// Vertices that are to go out, as last measured.
    leaving: Vec<VertexId>,
}

/// What a step does about the mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Turn {
    pub measures: bool,
    pub changes: bool,
}

impl Turn {
    /// That of `step`, where what is wanted is measured in one of so many steps and done, a part at a
    /// time, in those between, so that none takes as long as both.
    pub fn of(step: usize, every: usize) -> Self {
        let measures = step.is_multiple_of(every);
        Self { measures, changes: every == 1 || !measures }
    }
}

/// When the mesh is to be refined, and how far.
pub(crate) struct Rules {
    pub refinement: Refinement,
    pub max_vertices: usize,
    pub indicator: Box<dyn Indicator>,
    /// Over how many steps changes are felt. Above 0 all material stays where it is while vertices come in, loads
    /// keep it there at first, and what a vertex is worth shows only when they are gone.
    pub ease_steps: usize,
}

/// What splits and merges act on, and what they need to know besides.
pub(crate) struct Round<'a> {
    pub state: &'a mut BodyState,
    pub inverse: &'a mut InverseLink,
    pub tools: &'a [Box<dyn Tool>],
    /// Number of the step.
    pub step: usize,
    /// When the time for splits is over.
    pub deadline: Option<Instant>,
    /// Whether rotations go with positions.
    pub turns: bool,
    /// What has been done so far.
    pub done: Remeshed,
}

impl Round<'_> {
    /// Has the inverse take what has been split and merged.
    fn flush(&mut self) -> Result<(), SimError> {
        let Self { state, inverse, .. } = self;
        inverse.flush(&Elements { body: &state.body, density: &|tet| state.density(tet) })
    }

    /// What tetrahedra store where the body is, J.
    fn energy<'b>(&self, tets: impl Iterator<Item = &'b Tet>) -> f64 {
        let BodyState { body, positions, .. } = &*self.state;
        tets.map(|tet| body.energy_of(tet.id, positions, self.turns)).sum()
    }

    /// Notes a split or merge: its vertex is, or was, `jump` off the middle of its edge, and the ring
    /// stored `before` J.
    fn note(&mut self, delta: &MeshDelta, jump: Vector3<f64>, before: f64) {
        let is_split = delta.change == Change::Split;
        let after = match is_split {
            true => self.energy(delta.ring.iter().flat_map(|tet| &tet.children)),
            false => self.energy(delta.ring.iter().map(|tet| &tet.parent)),
        };
        let Remeshed { splits, merges, exchanges, .. } = &mut self.done;
        *if is_split { splits } else { merges } += 1;
        exchanges.push(Exchange {
            is_split,
            vertex: delta.vertex.index(),
            edge: delta.edge.map(VertexId::index),
            jump,
            energy_j: after - before,
        });
    }

    /// How far a vertex is from the middle of its edge, m.
    fn off_middle(&self, delta: &MeshDelta) -> Vector3<f64> {
        let at = |v: VertexId| self.state.positions[v.index()];
        let [a, b] = delta.edge.map(at);
        at(delta.vertex) - 0.5 * (a + b)
    }
}

/// How far figures are from those on a mesh without end.
#[derive(Clone, Debug, Default)]
pub(crate) struct Estimates {
    /// Of the energy, relative; none where that is nothing beside what it was, or not known.
    pub energy: Option<f64>,
    /// Of the figure of each dual, in its unit; empty where it is not known.
    pub figures: Vec<f64>,
}

/// What one round of remeshing did.
#[derive(Clone, Debug, Default)]
pub(crate) struct Remeshed {
    pub splits: usize,
    pub merges: usize,
    /// What the body stored before, J, if that was measured.
    pub stored_j: Option<f64>,
    /// Merges, then splits, in the order in which they were made.
    pub exchanges: Vec<Exchange>,
}

/// What a split or a merge did by itself, while all other vertices stayed where they were.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Exchange {
    pub is_split: bool,
    /// The vertex that came or went, and the ends of its edge.
    pub vertex: usize,
    pub edge: [usize; 2],
    /// By how much the material at the middle of the edge has moved, m.
    pub jump: Vector3<f64>,
    /// By how much more is stored, J.
    pub energy_j: f64,
}

impl Refiner {
    /// For the start mesh of `content`.
    pub fn new(content: Content, rules: Rules, regions: Regions) -> Self {
        Self {
            born: vec![0; content.forest.vertex_capacity()],
            content,
            rules,
            regions,
            measured: Vec::new(),
            measures_elements: false,
            estimates: Estimates::default(),
            most_energy: 0.0,
            most_goal: 0.0,
            delta: MeshDelta::empty(),
            ring: Vec::new(),
            members: Vec::new(),
            waiting: ClosureQueue::new(),
            leaving: Vec::new(),
        }
    }

    /// What the mesh wants, and since when it has what it has: of its vertices `old`, in the order of the mesh made
    /// again, and of its tetrahedra `tets`.
    pub fn kept(&self, old: &[usize], tets: &[TetId], numbers: &Numbers) -> KeptRefiner {
        KeptRefiner {
            born: old.iter().map(|&v| self.born[v]).collect(),
            measured: tets.iter().map(|&tet| self.measured(tet)).collect(),
            most_energy: self.most_energy,
            most_goal: self.most_goal,
            waiting: self.waiting.requests().collect(),
            leaving: self.leaving.iter().filter_map(|v| numbers.of(v.index())).collect(),
        }
    }

    /// Goes on from what was kept, on the mesh made again that it has been given.
    ///
    /// # Errors
    /// [`SimError::Bisection`] for a priority that is not finite.
    pub fn resume(&mut self, kept: &KeptRefiner) -> Result<(), SimError> {
        let forest = &self.content.forest;
        self.born = vec![0; forest.vertex_capacity()];
        forest.vertices().zip(&kept.born).for_each(|(v, born)| self.born[v.index()] = *born);
        self.measured = vec![0.0; forest.tet_capacity()];
        let measured = forest.leaves().zip(&kept.measured);
        measured.for_each(|(tet, value)| self.measured[tet.id.index()] = *value);
        (self.most_energy, self.most_goal) = (kept.most_energy, kept.most_goal);
        self.waiting = ClosureQueue::new();
        for (point, priority) in &kept.waiting {
            self.waiting.push(*point, *priority)?;
        }
        self.leaving = kept.leaving.iter().map(|&v| VertexId(v as u32)).collect();
        Ok(())
    }

    /// Last measured indicator of a leaf's ring; 0 if never measured.
    pub fn measured(&self, tet: TetId) -> f64 {
        self.measured.get(tet.index()).copied().unwrap_or(0.0)
    }

    /// Takes vertices into account that came in otherwise than by a split.
    pub fn grow(&mut self, state: &BodyState) {
        self.born.resize(state.vertex_capacity(), 0);
    }

    /// The estimates, once after each measurement of an indicator that has them.
    pub fn take_estimates(&mut self) -> Estimates {
        take(&mut self.estimates)
    }

    /// Whether the indicator says how far figures are off.
    pub fn estimates(&self) -> bool {
        self.rules.indicator.estimates()
    }

    /// How fine the mesh has to be where a probe is about to touch.
    pub fn near_probe(&self) -> Option<&NearProbe> {
        self.rules.refinement.near_probe.as_ref()
    }

    /// Splits that are wanted and have to wait.
    pub fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// Whether a vertex may go out later that may not yet at `step`, or is to.
    pub fn is_settling(&self, step: usize) -> bool {
        let young = |v: VertexId| step < self.born[v.index()] + self.dwell_steps();
        !self.leaving.is_empty() || self.content.forest.vertices().any(young)
    }

    fn dwell_steps(&self) -> usize {
        self.rules.refinement.dwell_steps.max(self.rules.ease_steps)
    }

    /// Whether a vertex is to come in or to go out.
    pub fn wants_changes(&self) -> bool {
        !(self.leaving.is_empty() && self.waiting.is_empty())
    }

    /// Measures what the mesh wants at a step: merges where the indicator has become small, splits where it is
    /// large or the mesh too coarse for what is `near`. Returns what the body stores, J.
    pub fn rank(
        &mut self,
        sight: &Sight<'_>,
        near: Option<&Proximity>,
        step: usize,
        times: &mut StageTimes,
    ) -> Result<f64, SimError> {
        let begin = Instant::now();
        let (limits, energy) = self.rank_splits(sight)?;
        self.leaving = self.wanted_merges(sight.body, near, step, limits.merge_below);
        if let Some(near) = near {
            self.want_fine(near, sight.body)?;
        }
        times.indicator_ms = milliseconds(begin);
        Ok(energy)
    }

    /// Merges, then splits, as they were ranked.
    pub fn remesh(
        &mut self,
        round: &mut Round<'_>,
        times: &mut StageTimes,
    ) -> Result<Remeshed, SimError> {
        let begin = Instant::now();
        let inverse_before = round.inverse.total_ms;
        round.done.stored_j.get_or_insert_with(|| round.state.energy_j());
        let most = self.rules.refinement.max_splits_per_step;
        // Half of them each, and what one does not need for the other.
        let leave = (most / 2).max(most.saturating_sub(self.waiting.len()));
        let others = self.leaving.split_off(leave.min(self.leaving.len()));
        for v in std::mem::replace(&mut self.leaving, others) {
            // What was ranked in a step before may be needed now, or held.
            self.merge_if_free(round, v)?;
        }
        self.split_waiting(round, most - round.done.merges)?;
        round.flush()?;
        times.inverse_ms = round.inverse.total_ms - inverse_before;
        times.remesh_ms = milliseconds(begin) - times.inverse_ms;
        Ok(take(&mut round.done))
    }

    /// The estimates on a mesh that stays as it is, if the indicator has any.
    pub fn measure(&mut self, sight: &Sight<'_>, times: &mut StageTimes) {
        let begin = Instant::now();
        if let Some(measured) = self.rules.indicator.elements(sight) {
            let energy = self.note_energy(sight.body, Some(&measured));
            self.estimate(&measured, energy);
            times.indicator_ms = milliseconds(begin);
        }
    }

    /// The body's energy, J.
    fn note_energy(&mut self, state: &BodyState, measured: Option<&Measured>) -> f64 {
        let seen = measured.and_then(|measured| measured.stored_j);
        let energy = seen.unwrap_or_else(|| state.energy_j());
        // The energy of no strain: a body at rest asks for nothing.
        let stiffness = state.elements().iter().map(|e| e.geometry.volume * e.elasticity.m11);
        let none = 0.5 * stiffness.sum::<f64>() * NO_STRAIN * NO_STRAIN;
        self.most_energy = self.most_energy.max(energy).max(none / NOTHING);
        energy
    }

    fn estimate(&mut self, measured: &Measured, energy: f64) {
        let is_much = energy > NOTHING * self.most_energy;
        let relative = measured.energy_error.filter(|_| is_much).map(|error| error / energy);
        self.estimates = Estimates { energy: relative, figures: measured.errors.clone() };
    }

    /// Queues all splits that are wanted now, the largest indicator first. What waited before is
    /// measured again with all others: a split is wanted only while its cause lasts, and it keeps
    /// its place. Also returns what the body stores, J.
    fn rank_splits(&mut self, sight: &Sight<'_>) -> Result<(Limits, f64), SimError> {
        self.measured.clear();
        self.measured.resize(self.content.forest.tet_capacity(), 0.0);
        self.waiting.clear();
        let mut scale = self.rules.indicator.error_over_sum();
        let measured = self.rules.indicator.elements(sight);
        let energy = self.note_energy(sight.body, measured.as_ref());
        self.measures_elements = measured.is_some();
        let wishes = match measured {
            Some(measured) => {
                self.estimate(&measured, energy);
                if let (true, Some(error)) =
                    (self.rules.indicator.is_of_goal(), measured.errors.first())
                {
                    // Shares of either sign have cancelled each other.
                    let whole: f64 = measured.values.iter().sum();
                    scale = scale.map(|scale| (error / whole).clamp(CANCELLED * scale, scale));
                }
                self.element_wishes(sight.body, &measured.values)
            }
            None => self.ring_wishes(sight.body),
        };
        // What is nothing beside what was asks for nothing.
        let figure = match (self.rules.indicator.is_of_goal(), sight.duals.first()) {
            (true, Some(goal)) => {
                self.most_goal = self.most_goal.max(goal.value.abs());
                goal.value.abs().max(NOTHING * self.most_goal)
            }
            _ => energy.max(NOTHING * self.most_energy),
        };
        let limits = self.rules.refinement.limits(&wishes, scale.map(|scale| figure / scale));
        for Wish { point, value } in wishes {
            if value > limits.split_above {
                // An infinite indicator has to be ranked like any other.
                self.waiting.push(point, value.min(f64::MAX))?;
            }
        }
        Ok((limits, energy))
    }

    /// Has all that is near be fine enough, whatever it takes: for a body at rest that nothing touches.
    pub fn make_fine(&mut self, near: &Proximity, round: &mut Round<'_>) -> Result<(), SimError> {
        loop {
            self.want_fine(near, round.state)?;
            if self.waiting.is_empty() || !self.split_waiting(round, usize::MAX)? {
                break;
            }
        }
        self.waiting.clear();
        round.flush()
    }

    /// Splits these tetrahedra, whatever is asked for.
    pub fn split_now(&mut self, tets: &[TetId], round: &mut Round<'_>) -> Result<(), SimError> {
        let others = take(&mut self.waiting);
        for point in tets.iter().filter_map(|&tet| self.content.forest.refinement_point(tet)) {
            self.waiting.push(point, 1.0)?;
        }
        self.split_waiting(round, usize::MAX)?;
        self.waiting = others;
        round.flush()
    }

    /// Takes out those of these vertices that can go.
    pub fn merge_now(
        &mut self,
        vertices: &[VertexId],
        round: &mut Round<'_>,
    ) -> Result<(), SimError> {
        for &v in vertices {
            self.merge_if_free(round, v)?;
        }
        round.flush()
    }

    fn merge_if_free(&mut self, round: &mut Round<'_>, v: VertexId) -> Result<(), SimError> {
        let is_held = matches!(round.state.holds[v.index()], Hold::Grabbed(_));
        match !is_held && self.content.forest.merge_ring(v, &mut self.ring) {
            true => self.merge(round, v),
            false => Ok(()),
        }
    }

    /// Splits as ranked, `most` at most; returns whether there was one.
    fn split_waiting(&mut self, round: &mut Round<'_>, most: usize) -> Result<bool, SimError> {
        let before = round.done.splits;
        for _ in 0..most {
            let is_full = self.content.forest.vertex_count() >= self.rules.max_vertices;
            let is_late = round.deadline.is_some_and(|deadline| Instant::now() >= deadline);
            if is_full || is_late {
                break;
            }
            // What is wanted, or an older vertex that it needs.
            let Some(p) = self.waiting.next(&self.content.forest) else { break };
            self.content.forest.split_ring(p, &mut self.ring);
            self.split(round, p)?;
            self.waiting.remove(p);
            // A clock has to see what each split costs.
            if round.deadline.is_some() {
                round.flush()?;
            }
        }
        Ok(round.done.splits > before)
    }

    /// Queues what is near and not fine enough after all that the indicator asks for, the coarsest before others.
    fn want_fine(&mut self, near: &Proximity, state: &BodyState) -> Result<(), SimError> {
        let forest = &self.content.forest;
        for leaf in forest.leaves().filter(|leaf| state.body.element(leaf.id).is_some()) {
            if !state.is_void(leaf.id)
                && near.wants_finer(&leaf, state)
                && let Some(point) = forest.refinement_point(leaf.id)
            {
                self.waiting.push(point, LAST / f64::from(1 + leaf.level))?;
            }
        }
        Ok(())
    }

    /// The indicators of all complete rings.
    fn ring_wishes(&mut self, state: &BodyState) -> Vec<Wish> {
        let mut wishes = Vec::new();
        for point in self.content.forest.candidates() {
            if self.content.forest.split_ring(point, &mut self.ring) {
                let value = self.measure_ring(state);
                for tet in &self.ring {
                    self.measured[tet.id.index()] = value;
                }
                wishes.push(Wish { point, value });
            }
        }
        wishes
    }

    /// The sums of `values`, by element, over those that each vertex would bisect.
    fn element_wishes(&mut self, state: &BodyState, values: &[f64]) -> Vec<Wish> {
        for (element, &value) in state.elements().iter().zip(values) {
            self.measured[element.tet.index()] = value;
        }
        let forest = &self.content.forest;
        let mut wishes: Vec<Wish> = Vec::new();
        // Those of one vertex stand together.
        for leaf in forest.leaves() {
            let Some(point) = forest.refinement_point(leaf.id) else { continue };
            let value = self.measured[leaf.id.index()];
            match wishes.last_mut() {
                Some(wish) if wish.point == point => wish.value += value,
                _ => wishes.push(Wish { point, value }),
            }
        }
        wishes
    }

    /// The vertices that are to go out; where these are more than may go at a time, those first that are
    /// worth least.
    fn wanted_merges(
        &mut self,
        state: &BodyState,
        near: Option<&Proximity>,
        step: usize,
        limit: f64,
    ) -> Vec<VertexId> {
        let dwell_steps = self.dwell_steps();
        let settled: Vec<VertexId> = self
            .content
            .forest
            .vertices()
            .filter(|v| step >= self.born[v.index()] + dwell_steps)
            // A tool keeps what it holds until it lets go.
            .filter(|v| !matches!(state.holds[v.index()], Hold::Grabbed(_)))
            .collect();
        let made = self.measures_elements.then(|| self.sums_by_newest());
        let mut leaving: Vec<(VertexId, f64)> = Vec::new();
        for v in settled {
            if !self.content.forest.merge_ring(v, &mut self.ring) {
                continue;
            }
            let is_needed =
                |near: &Proximity| self.ring.iter().any(|tet| near.wants_finer(tet, state));
            if near.is_some_and(is_needed) {
                continue;
            }
            let left = made.as_ref().map_or(0.0, |made| made[v.index()]);
            if left <= limit {
                leaving.push((v, left + self.measure_vertex(v, state)));
            }
        }
        leaving.retain(|(_, worth)| *worth <= limit);
        if leaving.len() > self.rules.refinement.max_splits_per_step {
            leaving.sort_by(|a, b| a.1.total_cmp(&b.1));
        }
        leaving.into_iter().map(|(v, _)| v).collect()
    }

    /// What a vertex is worth whose parents' tetrahedra are in `self.ring`; nothing beside what the
    /// elements that it made count for, where an indicator measures a goal by these.
    fn measure_vertex(&mut self, v: VertexId, state: &BodyState) -> f64 {
        if self.rules.indicator.is_of_goal() {
            return 0.0;
        }
        let surplus =
            state.positions[v.index()] - self.content.embedded_midpoint(state, &self.ring);
        self.members.clear();
        self.members.extend(self.ring.iter().map(|tet| self.content.member(state, tet)));
        self.rules.indicator.measure_vertex(&self.members, &surplus)
    }

    /// By vertex number the sum of the last measurement over the leaves whose newest vertex it is: once it
    /// can go out, those that it made.
    fn sums_by_newest(&self) -> Vec<f64> {
        let forest = &self.content.forest;
        let mut sums = vec![0.0; forest.vertex_capacity()];
        for leaf in forest.leaves() {
            let [mut newest, others @ ..] = leaf.vertices;
            for v in others {
                newest = if forest.generation(v) > forest.generation(newest) { v } else { newest };
            }
            sums[newest.index()] += self.measured[leaf.id.index()];
        }
        sums
    }

    /// The indicator of the coarse tetrahedra now in `self.ring`.
    fn measure_ring(&mut self, state: &BodyState) -> f64 {
        self.members.clear();
        for tet in &self.ring {
            self.members.push(self.content.member(state, tet));
        }
        self.rules.indicator.measure(&self.members)
    }

    /// Splits at `p`, whose ring is in `self.ring`.
    fn split(&mut self, round: &mut Round<'_>, p: Point) -> Result<(), SimError> {
        let before = round.energy(self.ring.iter());
        let Round { state, tools, step, .. } = round;
        let midpoint = self.content.embedded_midpoint(state, &self.ring);
        let mut around = old_vertices(&self.ring);
        let momentum = state.momentum_of(&around);
        let mut delta = std::mem::replace(&mut self.delta, MeshDelta::empty());
        let vertex = self.content.forest.split(p, &mut delta)?;
        let rest = self.content.placement.position(p);
        let hold = self.regions.hold(&rest, around.iter().map(|&v| state.holds[v]), tools);
        let is_gripped = self.ring.iter().any(|tet| state.body.is_gripped(tet.id));
        let position = match hold {
            // The strain around a fixed vertex would put it elsewhere.
            Hold::Fixed => rest,
            // Held material stays where it is, and feels the same force.
            _ if is_gripped || self.rules.ease_steps > 0 => {
                let [a, b] = delta.edge.map(|v| state.positions[v.index()]);
                0.5 * (a + b)
            }
            _ => midpoint,
        };
        state.add_vertex(vertex, rest, position, hold);
        let [a, b] = delta.edge.map(|v| state.body.pressure(v.index()));
        state.body.set_pressure(vertex.index(), 0.5 * (a + b));
        let [a, b] = delta.edge.map(|v| state.pressure_rates[v.index()]);
        state.pressure_rates[vertex.index()] = 0.5 * (a + b);
        for motion in [&mut state.velocities, &mut state.accelerations] {
            let [a, b] = delta.edge.map(|v| motion[v.index()]);
            motion[vertex.index()] = 0.5 * (a + b);
        }
        self.born.resize(state.vertex_capacity(), 0);
        self.born[vertex.index()] = *step;
        for ring_tet in &delta.ring {
            let law_state = state.body.law_state(ring_tet.parent.id);
            let parent = state.remove_tet(ring_tet.parent.id);
            let rotation = parent.map_or_else(Matrix3::identity, |(_, rotation)| rotation);
            for child in &ring_tet.children {
                self.content.add_tet(state, child, &rotation);
                if let Some(law_state) = &law_state {
                    state.body.split_law_state(child.id, law_state);
                }
            }
        }
        state.body.grips_follow(&delta);
        if state.is_dynamic {
            around.push(vertex.index());
            state.pass_on(&around, momentum);
        }
        self.update_inverse(&delta, round);
        let jump = round.off_middle(&delta);
        round.note(&delta, jump, before);
        self.delta = delta;
        Ok(())
    }

    fn merge(&mut self, round: &mut Round<'_>, vertex: VertexId) -> Result<(), SimError> {
        let mut delta = std::mem::replace(&mut self.delta, MeshDelta::empty());
        self.content.forest.merge(vertex, &mut delta)?;
        let before = round.energy(delta.ring.iter().flat_map(|tet| &tet.children));
        let jump = -round.off_middle(&delta);
        let state = &mut *round.state;
        let parents: Vec<Tet> = delta.ring.iter().map(|ring_tet| ring_tet.parent).collect();
        let mut around = old_vertices(&parents);
        around.push(vertex.index());
        let momentum = state.momentum_of(&around);
        for ring_tet in &delta.ring {
            let halves = ring_tet.children.map(|child| {
                let law_state = state.body.law_state(child.id);
                Some((state.remove_tet(child.id)?, law_state?))
            });
            let rotation = halves.iter().flatten().last().map(|((_, rotation), _)| *rotation);
            let rotation = rotation.unwrap_or_else(Matrix3::identity);
            self.content.add_tet(state, &ring_tet.parent, &rotation);
            if let [Some(((first, _), a)), Some(((second, _), b))] = &halves {
                state.body.merge_law_states(ring_tet.parent.id, [(first, a), (second, b)]);
            }
        }
        if state.is_dynamic {
            around.pop();
            state.pass_on(&around, momentum);
        }
        self.update_inverse(&delta, round);
        round.state.body.grips_follow(&delta);
        round.state.remove_vertex(vertex);
        round.note(&delta, jump, before);
        self.delta = delta;
        Ok(())
    }

    fn update_inverse(&self, delta: &MeshDelta, round: &mut Round<'_>) {
        let (state, inverse) = (&*round.state, &mut *round.inverse);
        let embedding = &self.content.embedding;
        let mut ring = inverse.element().ring(delta, embedding, &|v| state.rest[v.index()]);
        if !state.body.grips().is_empty() {
            ring = ring.with_springs(delta, &|tet| state.body.grip_matrix(tet));
        }
        let is_fixed = state.holds[delta.vertex.index()] == Hold::Fixed;
        let key = Lattice::key(self.content.forest.point(delta.vertex));
        inverse.push(delta.change, delta.vertex, is_fixed, key, ring);
    }
}

/// Each vertex of the parents of a ring once.
fn old_vertices(ring: &[Tet]) -> Vec<usize> {
    let mut vertices: Vec<usize> =
        ring.iter().flat_map(|tet| tet.vertices).map(VertexId::index).collect();
    vertices.sort_unstable();
    vertices.dedup();
    vertices
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wanted_is_done_in_the_steps_until_it_is_measured_again() {
        let turns = |every: usize| -> String {
            let letter = |step| match Turn::of(step, every) {
                Turn { measures: true, changes: true } => 'b',
                Turn { measures: true, .. } => 'm',
                Turn { changes: true, .. } => 'c',
                Turn { .. } => '-',
            };
            (1..=6).map(letter).collect()
        };
        assert_eq!([1, 2, 3].map(turns), ["bbbbbb", "cmcmcm", "ccmccm"]);
    }
}
