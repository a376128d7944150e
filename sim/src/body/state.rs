//! The body while the simulation moves it: vertices, elements, positions.

use std::collections::HashMap;

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use yawara_corot::{Body, Element, ElementPoint, Grip, WeightedPoint};
use yawara_mesh::{TetId, VertexId, finest_at};

/// What a vertex is held by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Hold {
    Free,
    Fixed,
    Grabbed(usize),
}

/// What is known of a tetrahedron besides its mechanics.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Cell {
    pub level: u8,
    /// Original label of most of its volume.
    pub label: i64,
    pub density_kg_m3: f64,
    /// Whether it holds void only.
    pub is_void: bool,
}

/// The body as it is now: the current mesh, and where its vertices are.
///
/// Numbers of vertices and tetrahedra have gaps, because a mesh that changes keeps the numbers of
/// what stays; arrays are by number.
#[derive(Default)]
pub struct BodyState {
    pub(crate) body: Body,
    pub(crate) rest: Vec<Vector3<f64>>,
    pub(crate) positions: Vec<Vector3<f64>>,
    pub(crate) holds: Vec<Hold>,
    /// By vertex number, m/s. In a quasi-static body the velocities of the last step if the next
    /// one may continue it, else zero.
    pub(crate) velocities: Vec<Vector3<f64>>,
    /// By vertex number, m/s²; zero unless the time integrator uses them. In a quasi-static body half of what
    /// velocities would change by in a second, as the last steps went, if the next one may continue them, else zero.
    pub(crate) accelerations: Vec<Vector3<f64>>,
    /// By vertex number, how fast the pressures q of a quasi-static body changed in the last step if the next
    /// one may continue it, else zero, 1/s.
    pub(crate) pressure_rates: Vec<f64>,
    /// The same of those rates, 1/s².
    pub(crate) pressure_bends: Vec<f64>,
    /// A quarter of the mass of each vertex's tetrahedra, kg.
    pub(crate) masses: Vec<f64>,
    /// Of each of the body's grips the tool that it is of; none for a support.
    pub(crate) grip_tools: Vec<Option<usize>>,
    /// Whether the body has inertia.
    pub(crate) is_dynamic: bool,
    is_active: Vec<bool>,
    vertex_count: usize,
    /// By tetrahedron number.
    cells: Vec<Cell>,
    /// What the sheets of tetrahedra that are cut hold.
    sheets: HashMap<TetId, SheetHold>,
}

/// Which of the finest tetrahedra a sheet of a cut tetrahedron holds.
pub(crate) struct SheetHold {
    pub level: u8,
    pub finest_level: u8,
    pub holds: Vec<bool>,
}

/// Where the body stands, to come back to: positions, and pressures if it has any.
#[derive(Default)]
pub(crate) struct Standing {
    pub positions: Vec<Vector3<f64>>,
    pub pressures: Vec<f64>,
}

impl BodyState {
    /// Nothing yet; `body` is empty and says of which elements it will be.
    pub(crate) fn new(body: Body) -> Self {
        Self { body, ..Self::default() }
    }

    /// Where the body stands.
    pub(crate) fn standing(&self) -> Standing {
        Standing { positions: self.positions.clone(), pressures: self.body.pressures() }
    }

    /// Moves the body to where it stood, or is to stand.
    pub(crate) fn put(&mut self, standing: Standing) {
        self.positions = standing.positions;
        self.body.set_pressures(&standing.pressures);
    }

    /// Moves the body to rest.
    pub(crate) fn rest(&mut self) {
        self.positions.clone_from(&self.rest);
        self.body.set_pressures(&[]);
    }

    /// Rest positions by vertex number, solver axes, m.
    pub fn rest_positions(&self) -> &[Vector3<f64>] {
        &self.rest
    }

    /// Current positions by vertex number, solver axes, m.
    pub fn positions(&self) -> &[Vector3<f64>] {
        &self.positions
    }

    /// The tetrahedra with their rest geometry and elasticity, in no order.
    pub fn elements(&self) -> &[Element] {
        self.body.elements()
    }

    /// The rotation of one of them at the last evaluation of forces.
    ///
    /// # Panics
    /// If `number` is not below the number of [`elements`](Self::elements).
    pub fn rotation(&self, number: usize) -> Matrix3<f64> {
        self.body.rotation(number)
    }

    /// The same by ascending number, each with its place in [`elements`](Self::elements).
    pub(crate) fn elements_by_number(&self) -> Vec<(usize, &Element)> {
        let mut elements: Vec<(usize, &Element)> = self.elements().iter().enumerate().collect();
        elements.sort_unstable_by_key(|(_, element)| element.tet);
        elements
    }

    /// The tetrahedron of a number, if it is in the current mesh.
    pub fn element(&self, tet: TetId) -> Option<&Element> {
        self.body.element(tet)
    }

    /// The label, as in the image, of most of a tetrahedron's volume; 0 is void.
    pub fn label(&self, tet: TetId) -> i64 {
        self.cell(tet).label
    }

    /// Whether a tetrahedron of the current mesh holds nothing but void.
    pub fn is_void(&self, tet: TetId) -> bool {
        self.cell(tet).is_void
    }

    /// Whether nothing holds a vertex of that number.
    pub fn is_free(&self, vertex: usize) -> bool {
        self.holds[vertex] == Hold::Free
    }

    /// Σ ½ V σ : ε in the elements' frames and what elastic supports and pads store, J, where the body
    /// is now. Cost: O(elements).
    pub fn energy_j(&self) -> f64 {
        self.body.energy(&self.positions)
    }

    /// The vertices of the current mesh, ascending numbers.
    pub fn vertices(&self) -> impl Iterator<Item = VertexId> + '_ {
        (0..self.is_active.len()).filter(|&i| self.is_active[i]).map(|i| VertexId(i as u32))
    }

    /// How many vertices the current mesh has.
    pub fn vertex_count(&self) -> usize {
        self.vertex_count
    }

    /// How many tetrahedra the current mesh has.
    pub fn tet_count(&self) -> usize {
        self.body.elements().len()
    }

    /// One more than the largest vertex number ever in use.
    pub(crate) fn vertex_capacity(&self) -> usize {
        self.is_active.len()
    }

    /// Density of the material in a tetrahedron of the current mesh, kg/m³.
    pub(crate) fn density(&self, tet: TetId) -> f64 {
        self.cell(tet).density_kg_m3
    }

    /// Whether a tetrahedron carries the point with these barycentric weights in it: all of them, unless it is a sheet
    /// of one that is cut.
    pub(crate) fn carries(&self, tet: TetId, weights: [f64; 4]) -> bool {
        self.sheets
            .get(&tet)
            .is_none_or(|sheet| sheet.holds[finest_at(weights, sheet.level, sheet.finest_level)])
    }

    /// The stiffness with which a tool, or the support if that is none, holds material elastically, N/m⁴.
    pub(crate) fn grip_stiffness(&self, tool: Option<usize>) -> Option<f64> {
        let mut grips = self.body.grips().iter().zip(&self.grip_tools);
        grips.find(|(grip, of)| **of == tool && grip.stiffness().is_some())?.0.stiffness()
    }

    /// A grip of the material at `points`, with κ = `stiffness` (N/m per unit of weight) if it is elastic; none where there is
    /// no material.
    pub(crate) fn grip(&self, points: Vec<WeightedPoint>, stiffness: Option<f64>) -> Option<Grip> {
        let solid = self.body.elements().iter().filter(|element| !self.is_void(element.tet));
        let carries = |tet, at: &ElementPoint| self.carries(tet, at.weights);
        Grip::new(points, stiffness, solid, &self.rest, carries)
    }

    /// The part of a tetrahedron's volume that holds material of its own: 1, unless it is a sheet.
    pub(crate) fn fraction(&self, tet: TetId) -> f64 {
        self.sheets.get(&tet).map_or(1.0, |sheet| {
            sheet.holds.iter().filter(|holds| **holds).count() as f64 / sheet.holds.len() as f64
        })
    }

    /// Notes what a tetrahedron holds; none for all of it.
    pub(crate) fn set_sheet(&mut self, tet: TetId, sheet: Option<SheetHold>) {
        match sheet {
            Some(sheet) => drop(self.sheets.insert(tet, sheet)),
            None => drop(self.sheets.remove(&tet)),
        }
    }

    pub(crate) fn cell(&self, tet: TetId) -> &Cell {
        &self.cells[tet.index()]
    }

    /// `vertex` comes in (its number must not be in use).
    pub(crate) fn add_vertex(
        &mut self,
        vertex: VertexId,
        rest: Vector3<f64>,
        position: Vector3<f64>,
        hold: Hold,
    ) {
        let at = vertex.index();
        if self.is_active.len() <= at {
            self.is_active.resize(at + 1, false);
            self.rest.resize(at + 1, Vector3::zeros());
            self.positions.resize(at + 1, Vector3::zeros());
            self.holds.resize(at + 1, Hold::Free);
            self.velocities.resize(at + 1, Vector3::zeros());
            self.accelerations.resize(at + 1, Vector3::zeros());
            self.pressure_rates.resize(at + 1, 0.0);
            self.pressure_bends.resize(at + 1, 0.0);
            self.masses.resize(at + 1, 0.0);
        }
        self.is_active[at] = true;
        self.vertex_count += 1;
        (self.rest[at], self.positions[at], self.holds[at]) = (rest, position, hold);
        (self.velocities[at], self.masses[at]) = (Vector3::zeros(), 0.0);
        (self.accelerations[at], self.pressure_rates[at]) = (Vector3::zeros(), 0.0);
        self.pressure_bends[at] = 0.0;
    }

    /// `vertex` goes out.
    pub(crate) fn remove_vertex(&mut self, vertex: VertexId) {
        self.is_active[vertex.index()] = false;
        self.holds[vertex.index()] = Hold::Free;
        self.vertex_count -= 1;
    }

    /// A tetrahedron comes in, made of what its law has to know besides its elasticity.
    pub(crate) fn add_tet(
        &mut self,
        element: Element,
        rotation: &Matrix3<f64>,
        cell: Cell,
        made_of: &[f64],
    ) {
        let at = element.tet.index();
        if self.cells.len() <= at {
            self.cells.resize(at + 1, Cell::default());
        }
        self.cells[at] = cell;
        let quarter = 0.25 * element.geometry.volume * cell.density_kg_m3;
        element.vertices.iter().for_each(|&v| self.masses[v] += quarter);
        self.body.insert_made_of(element, rotation, made_of);
    }

    /// A tetrahedron goes out; its element with its rotation, if it was there.
    pub(crate) fn remove_tet(&mut self, tet: TetId) -> Option<(Element, Matrix3<f64>)> {
        let rotation = self.body.rotation(self.body.number(tet)?);
        let element = self.body.remove(tet)?;
        let quarter = 0.25 * element.geometry.volume * self.cell(tet).density_kg_m3;
        element.vertices.iter().for_each(|&v| self.masses[v] -= quarter);
        Some((element, rotation))
    }
}
