//! The deformable body as the solver and the output see it: vertices, elements, positions.

use nalgebra::Vector3;
use yawara_corot::{Body, Element};
use yawara_mesh::{TetId, VertexId};

/// What a vertex is held by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Hold {
    Free,
    Fixed,
    Grabbed(usize),
}

/// What is known of a tetrahedron besides its mechanics.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Cell {
    pub level: u8,
    /// Original label of most of its volume.
    pub label: i64,
    pub density_kg_m3: f64,
    /// Whether it holds void only.
    pub is_void: bool,
}

/// The current mesh: whatever changes it keeps this up to date.
#[derive(Default)]
pub(crate) struct BodyState {
    pub body: Body,
    /// Rest and current positions by vertex number, m.
    pub rest: Vec<Vector3<f64>>,
    pub positions: Vec<Vector3<f64>>,
    pub holds: Vec<Hold>,
    /// By vertex number, m/s; in a quasi-static body those of the last step, zero where nothing
    /// goes on.
    pub velocities: Vec<Vector3<f64>>,
    /// A quarter of the mass of each vertex's tetrahedra, kg.
    pub masses: Vec<f64>,
    /// Whether velocities mean anything.
    pub is_dynamic: bool,
    is_active: Vec<bool>,
    vertex_count: usize,
    /// By tetrahedron number.
    cells: Vec<Cell>,
}

/// Where the body stands, to come back to: positions, and pressures if it has any.
pub(crate) struct Standing {
    positions: Vec<Vector3<f64>>,
    pressures: Vec<f64>,
}

impl BodyState {
    /// Nothing yet, of the elements of an empty `body`.
    pub fn new(body: Body) -> Self {
        Self { body, ..Self::default() }
    }

    /// Where the body stands.
    pub fn standing(&self) -> Standing {
        Standing { positions: self.positions.clone(), pressures: self.body.pressures() }
    }

    /// Moves the body back to where it stood.
    pub fn return_to(&mut self, standing: Standing) {
        self.positions = standing.positions;
        self.body.set_pressures(&standing.pressures);
    }

    /// Moves the body to rest.
    pub fn rest(&mut self) {
        self.positions.clone_from(&self.rest);
        self.body.set_pressures(&[]);
    }

    /// Active vertices, ascending numbers.
    pub fn vertices(&self) -> impl Iterator<Item = VertexId> + '_ {
        (0..self.is_active.len()).filter(|&i| self.is_active[i]).map(|i| VertexId(i as u32))
    }

    pub fn vertex_count(&self) -> usize {
        self.vertex_count
    }

    pub fn tet_count(&self) -> usize {
        self.body.elements().len()
    }

    /// One more than the largest vertex number ever in use.
    pub fn vertex_capacity(&self) -> usize {
        self.is_active.len()
    }

    pub fn cell(&self, tet: TetId) -> &Cell {
        &self.cells[tet.index()]
    }

    /// `vertex` comes in (its number must not be in use).
    pub fn add_vertex(
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
            self.masses.resize(at + 1, 0.0);
        }
        self.is_active[at] = true;
        self.vertex_count += 1;
        (self.rest[at], self.positions[at], self.holds[at]) = (rest, position, hold);
        (self.velocities[at], self.masses[at]) = (Vector3::zeros(), 0.0);
    }

    /// `vertex` goes out.
    pub fn remove_vertex(&mut self, vertex: VertexId) {
        self.is_active[vertex.index()] = false;
        self.holds[vertex.index()] = Hold::Free;
        self.vertex_count -= 1;
    }

    /// A tetrahedron comes in.
    pub fn add_tet(&mut self, element: Element, cell: Cell) {
        let at = element.tet.index();
        if self.cells.len() <= at {
            self.cells.resize(at + 1, Cell::default());
        }
        self.cells[at] = cell;
        let quarter = 0.25 * element.geometry.volume * cell.density_kg_m3;
        element.vertices.iter().for_each(|&v| self.masses[v] += quarter);
        self.body.insert(element);
    }

    /// A tetrahedron goes out; its element, if it was there.
    pub fn remove_tet(&mut self, tet: TetId) -> Option<Element> {
        let element = self.body.remove(tet)?;
        let quarter = 0.25 * element.geometry.volume * self.cell(tet).density_kg_m3;
        element.vertices.iter().for_each(|&v| self.masses[v] -= quarter);
        Some(element)
    }
}
