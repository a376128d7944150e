//! What tools make of the body while it moves: other labels, and cuts.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::Vector3;
use yawara_corot::Element;
use yawara_mesh::volume::LabelVolume;
use yawara_mesh::{Tet, VertexId};

use super::contact::ContactState;
use super::content::Content;
use super::cutting::Crossed;
use super::proximity::{Proximity, distance};
use super::simulation::{SimulatedBody, Simulation};
use super::span::Span;
use crate::body::BodyState;
use crate::error::SimError;
use crate::inverse::{Elements, InverseLink};
use crate::report::{BodyOutline, Edited, Surfaces};
use crate::scene::Scene;
use crate::tools::{Edit, SurfacePoints, Tool, points_of};

/// A voxel whose middle is this far outside of a tetrahedron, in barycentric coordinates, is in it.
const ROUNDING: f64 = 1e-9;

impl Simulation {
    /// Makes of the body what tools make of it on their way through `span`, and all that follows from it; which tool
    /// what, and how many vertices came in by splits before.
    ///
    /// Cost: for the root cubes with voxels that change the label tree and its homogenisation made anew, an update of
    /// the inverse for each tetrahedron whose material is another and for each vertex that a cut doubles; if there are
    /// probes, the outline of the whole body.
    ///
    /// # Errors
    /// [`SimError::Bisection`], [`SimError::Embed`] and [`SimError::Inverse`] where that can't be made or inverted;
    /// [`SimError::Value`] in a scene with checkpoints.
    pub(super) fn edit(&mut self, span: Span) -> Result<(Vec<Edited>, usize), SimError> {
        let asked: Vec<(usize, Edit)> = (0..)
            .zip(&self.tools)
            .filter_map(|(number, tool)| Some((number, tool.edit(span.from, span.to)?)))
            .collect();
        if !asked.is_empty() && self.beginning.is_some() {
            let steps = self.scene.output.checkpoint_steps;
            let want = "0 beside a tool that changes labels or cuts: checkpoints do not have that";
            return Err(SimError::value(&self.scene.name, "output.checkpoint_steps", steps, want));
        }
        let mut splits = 0;
        for (_, edit) in &asked {
            if let Edit::Cut { blade, level: Some(level), .. } = edit {
                splits += self.make_fine(&Proximity::of_blade(*level, *blade))?;
            }
        }
        let most = self.scene.mesh.max_vertices;
        let gravity = Vector3::from(self.scene.gravity_m_s2).norm();
        let SimulatedBody { state, inverse, refiner } = &mut self.body;
        let Some(refiner) = refiner.as_mut().filter(|_| !asked.is_empty()) else {
            return Ok((Vec::new(), splits));
        };
        let (mut before, mut all, mut has_relabelled) = (None, Vec::new(), false);
        for (tool, edit) in asked {
            let content = &mut refiner.content;
            let mut edited = Edited { tool, ..Edited::default() };
            match &edit {
                Edit::Labels { becomes, .. } => {
                    let voxels = content.swept(state, &edit);
                    if voxels.is_empty() {
                        continue;
                    }
                    before.get_or_insert_with(|| state.energy_j());
                    let (leaves, counts) = content.relabel(&voxels, *becomes)?;
                    content.renew(&leaves, state, inverse)?;
                    has_relabelled = true;
                    edited.labels_cm3 = counts;
                }
                Edit::Cut { blade, toughness_j_m2, .. } => {
                    let Crossed { faces, area_m2 } = content.crossed(state, blade);
                    if faces.is_empty() {
                        continue;
                    }
                    // Closing would not do: what was cut before might get other numbers and contents.
                    let uncut = content.forest.clone();
                    let delta = content.forest.sever(&faces)?;
                    if content.forest.vertex_count() > most {
                        content.forest = uncut;
                        edited.refused = faces.len();
                        all.push(edited);
                        continue;
                    }
                    before.get_or_insert_with(|| state.energy_j());
                    edited.parked = content.follow_cut(&delta, &faces, state, inverse, gravity)?;
                    (edited.cut_m2, edited.work_j) = (area_m2, toughness_j_m2 * area_m2);
                    let way = blade.way();
                    let force = edited.work_j / way.norm_squared() * way;
                    edited.force_n = self.recorder.axes.to_ras_direction(&force).into();
                    edited.doubled = delta.doubled.len();
                }
                Edit::Close { sweep, radius_m } => {
                    let faces = content.severed_near(state, sweep, *radius_m);
                    if faces.is_empty() {
                        continue;
                    }
                    before.get_or_insert_with(|| state.energy_j());
                    let delta = content.forest.close(&faces)?;
                    content.follow_cut(&delta, &[], state, inverse, gravity)?;
                    edited.closed = delta.doubled.len();
                }
            }
            refiner.grow(state);
            all.push(edited);
        }
        let Some(before) = before else { return Ok((all, splits)) };
        let elements = Elements { body: &state.body, density: &|tet| state.density(tet) };
        inverse.flush(&elements)?;
        inverse.watch(self.scene.seed, &elements)?;
        self.ledger.edited(state.energy_j() - before);
        self.follow_edits(has_relabelled)?;
        Ok((all, splits))
    }

    /// Has all that depends on labels, if these have changed, and on the surface follow them.
    fn follow_edits(&mut self, has_relabelled: bool) -> Result<(), SimError> {
        let Self { scene, body, tools, contact, recorder, ledger, solver, .. } = self;
        solver.jolt();
        let SimulatedBody { state, refiner: Some(refiner), .. } = body else { return Ok(()) };
        let content = &refiner.content;
        let Some(volume) = &content.volume else { return Ok(()) };
        refiner.regions.relabel(volume);
        if let Some(of_fields) = &mut recorder.volume {
            *of_fields = Arc::clone(volume);
        }
        if has_relabelled {
            if let Some(outline) = &mut recorder.outline {
                *outline = BodyOutline::new(Arc::clone(volume));
            }
            self.are_surfaces_stale = recorder.surfaces.is_some();
        }
        let mut points = |spacing: f64| content.surface(scene, volume, spacing);
        for tool in tools.iter_mut().filter(|tool| tool.surface_points().is_some()) {
            tool.resurface(&mut points)?;
            tool.follow(state)?;
        }
        // Points have other numbers now.
        *contact = ContactState::default();
        ledger.forget_points();
        Ok(())
    }

    /// Gives a tool that has come the surface of the labels as they are.
    pub(super) fn resurface(&self, tool: &mut dyn Tool) -> Result<(), SimError> {
        let content = self.body.refiner.as_ref().map(|refiner| &refiner.content);
        let Some((content, volume)) = content.and_then(|of| Some((of, of.volume.as_ref()?))) else {
            return Ok(());
        };
        tool.resurface(&mut |spacing| content.surface(&self.scene, volume, spacing))
    }

    /// Cuts the surfaces of labels anew if these have changed since.
    pub(super) fn renew_surfaces(&mut self) -> Result<(), SimError> {
        if !std::mem::take(&mut self.are_surfaces_stale) {
            return Ok(());
        }
        let Some(refiner) = &self.body.refiner else { return Ok(()) };
        let Content { forest, embedding, volume: Some(volume), .. } = &refiner.content else {
            return Ok(());
        };
        self.recorder.surfaces = Surfaces::new(&self.scene, forest, volume, embedding)?;
        Ok(())
    }
}

impl Content {
    /// Points of the body's outline and of both sides of its cuts, so far apart, m.
    fn surface(
        &self,
        scene: &Scene,
        volume: &LabelVolume,
        spacing: f64,
    ) -> Result<SurfacePoints, SimError> {
        let mut points = points_of(scene, &self.forest, volume, spacing)?;
        self.cut_faces(spacing).into_iter().for_each(|(rest, area)| points.add(rest, area));
        Ok(points)
    }

    /// The voxels that an edit changes where the body is, by their position in the volume, ascending.
    ///
    /// Cost: O(tetrahedra), and the voxels of those that the ball meets.
    fn swept(&self, state: &BodyState, edit: &Edit) -> Vec<usize> {
        let (Some(volume), Edit::Labels { sweep: [from, to], radius_m, labels, becomes }) =
            (&self.volume, edit)
        else {
            return Vec::new();
        };
        let changes: Vec<bool> = self
            .label_values
            .iter()
            .map(|label| match labels.is_empty() {
                true => *label != 0 && label != becomes,
                false => label != becomes && labels.contains(label),
            })
            .collect();
        let reach = Vector3::repeat(*radius_m);
        let ball = [from.inf(to) - reach, from.sup(to) + reach];
        let mut found = Vec::new();
        for element in state.elements().iter().filter(|element| !state.is_void(element.tet)) {
            let now = element.vertices.map(|v| state.positions[v]);
            let [low, high] = box_of(&now);
            if (0..3).any(|i| high[i] < ball[0][i] || low[i] > ball[1][i]) {
                continue;
            }
            let rest = element.vertices.map(|v| state.rest[v]);
            let gradients = &element.geometry.gradients;
            each_voxel(volume, &rest, |index, x| {
                let mut weights = gradients.map(|g| g.dot(&(x - rest[0])));
                weights[0] += 1.0;
                if !changes[usize::from(volume.labels()[index])]
                    || weights.iter().any(|&weight| weight < -ROUNDING)
                {
                    return;
                }
                let at: Vector3<f64> = now.iter().zip(weights).map(|(x, w)| x * w).sum();
                if distance(&at, from, to) <= *radius_m {
                    found.push(index);
                }
            });
        }
        // A middle on a face lies in two tetrahedra.
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Gives voxels a label; returns the leaves around them, and how many cubic centimetres there were of each label
    /// before.
    fn relabel(
        &mut self,
        voxels: &[usize],
        becomes: i64,
    ) -> Result<(Vec<Tet>, BTreeMap<i64, f64>), SimError> {
        let mut counts = BTreeMap::new();
        let Some(volume) = &mut self.volume else { return Ok((Vec::new(), counts)) };
        let volume = Arc::make_mut(volume);
        let id = self.label_values.iter().position(|&label| label == becomes).unwrap_or(0) as u16;
        let voxel_cm3 = (0.1 * volume.grid().spacing_mm).powi(3);
        let [nx, ny, _] = volume.grid().dims;
        let grid = *self.embedding.tree().grid();
        let mut cells = Vec::new();
        for &index in voxels {
            let before = volume.set(index, id)?;
            *counts.entry(self.label_values[usize::from(before)]).or_insert(0.0) += voxel_cm3;
            let voxel = [index % nx, index / nx % ny, index / (nx * ny)];
            cells.push(grid.cell_of(voxel.map(|i| i as i64)));
        }
        cells.sort_unstable();
        cells.dedup();
        let tree = Arc::new(self.embedding.tree().edited(volume, &cells, &|_| false)?);
        self.embedding.relabel(Arc::clone(&tree), &cells)?;
        Ok((self.forest.relabel(tree, &cells), counts))
    }

    /// Brings what has become of leaves into the body and, where that is another stiffness or mass, to the inverse.
    fn renew(
        &self,
        leaves: &[Tet],
        state: &mut BodyState,
        inverse: &mut InverseLink,
    ) -> Result<(), SimError> {
        for tet in leaves {
            let (elasticity, cell) = (self.embedding.elasticity(tet.node), self.cell(tet));
            let old = *state.cell(tet.id);
            let same = |element: &&Element| element.elasticity == elasticity && old == cell;
            if state.element(tet.id).filter(same).is_some() {
                continue;
            }
            let Some((before, rotation)) = state.remove_tet(tet.id) else { continue };
            self.add_tet(state, tet, &rotation);
            let densities = [old.density_kg_m3, cell.density_kg_m3];
            if elasticity != before.elasticity || densities[0] != densities[1] {
                let matrix = |elasticity, density| {
                    inverse.element().matrix(&before.geometry, elasticity, density)
                };
                let matrices =
                    [matrix(&before.elasticity, densities[0]), matrix(&elasticity, densities[1])];
                inverse.change(before.vertices.map(|v| VertexId(v as u32)), matrices)?;
            }
        }
        Ok(())
    }
}

/// The least box around some points.
fn box_of(points: &[Vector3<f64>; 4]) -> [Vector3<f64>; 2] {
    let [first, ..] = points;
    points.iter().fold([*first; 2], |[low, high], x| [low.inf(x), high.sup(x)])
}

/// Calls `visit` with the position in the volume and the middle, m, of each voxel whose middle lies in the box of a
/// tetrahedron with these corners at rest, m.
fn each_voxel(
    volume: &LabelVolume,
    corners: &[Vector3<f64>; 4],
    mut visit: impl FnMut(usize, Vector3<f64>),
) {
    let voxel_m = volume.grid().spacing_mm * 1e-3;
    let dims = volume.grid().dims;
    let [low, high] = box_of(corners).map(|end| end / voxel_m - Vector3::repeat(0.5));
    let range = |i: usize| {
        let first = (low[i] - ROUNDING).ceil().max(0.0) as usize;
        let last = (high[i] + ROUNDING).floor();
        first..(last + 1.0).clamp(0.0, dims[i] as f64) as usize
    };
    for z in range(2) {
        for y in range(1) {
            for x in range(0) {
                let middle = Vector3::new(x, y, z).map(|i| (i as f64 + 0.5) * voxel_m);
                visit(x + dims[0] * (y + dims[1] * z), middle);
            }
        }
    }
}
