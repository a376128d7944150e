//! A body as its finest tetrahedra, one process's part of it, and where it comes to rest under its weight.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3};
use yawara_corot::rotation::polar_cold;
use yawara_embed::{LinearTet, Material};
use yawara_mesh::kuhn::{ROOTS_PER_CELL, bisect, midpoint, root_corners};
use yawara_mesh::{Content, LabelTree, NodeRef, Point};
use yawara_petsc::{Matrix, Petsc, Solver, Vector};

use super::numbering::{Numbering, step_number};
use crate::error::{BenchError, Result};

/// Steps of the outer iteration at most.
const OUTER: usize = 60;

/// What an inner solution leaves of the residual where an outer one follows.
const INNER: f64 = 1e-4;

/// Iterations of conjugate gradients at most.
const ITERATIONS: usize = 5000;

/// Rows and columns of an element.
const ROWS: usize = 12;

/// Whether the vertex at a place is fixed, m.
type Holds = dyn Fn(&Vector3<f64>) -> bool;

/// What is to be solved: the finest tetrahedra of labels under their weight.
pub(crate) struct Problem {
    pub tree: Arc<LabelTree>,
    /// By dense label.
    pub materials: Vec<Material>,
    /// Cubes that belong to the body, by linear number.
    pub cubes: Vec<usize>,
    /// Where the corner of the first cube lies, and the edge of a voxel, m.
    pub origin: Vector3<f64>,
    pub voxel_m: f64,
    pub is_held: Box<Holds>,
    /// Whether that fixes the same on every mesh of the same cubes.
    pub is_held_alike: bool,
    /// m/s².
    pub gravity: Vector3<f64>,
}

/// Finest tetrahedra of one shape and one label.
struct Kind {
    geometry: LinearTet,
    /// N/m, rows by corner and axis.
    stiffness: SMatrix<f64, ROWS, ROWS>,
    /// A quarter of its weight, N.
    weight: Vector3<f64>,
}

/// One process's part: its cubes' tetrahedra, and the vertices that they have.
pub(crate) struct Body<'a> {
    petsc: &'a Petsc,
    numbering: Numbering,
    owned: Range<usize>,
    /// Numbers of vertices that others own, ascending.
    ghosts: Vec<i32>,
    /// Owned vertices, then ghosts: where they lie (m) and whether they are fixed.
    rest: Vec<Vector3<f64>>,
    held: Vec<bool>,
    kinds: Vec<Kind>,
    /// Corners as places in these lists, and kind.
    tets: Vec<([u32; 4], u32)>,
    /// Blocks that a row of each owned vertex may have, in columns owned here and in others.
    room: [Vec<i32>; 2],
}

/// Where a body has come to rest.
pub(crate) struct Rest {
    /// Displacements of the owned vertices, in the order of their numbers, m.
    pub displacements: Vec<Vector3<f64>>,
    /// Work of the load on the way, twice the energy of a linear body, J.
    pub work_j: f64,
    /// The largest displacement, m.
    pub largest_m: f64,
    /// Outer iterations, and those of conjugate gradients in all.
    pub outer: usize,
    pub inner: usize,
    /// Relative to the load, and what of it the rounding of displacements may make.
    pub residual: f64,
    pub rounding: f64,
}

impl Problem {
    fn at(&self, p: Point) -> Vector3<f64> {
        self.origin + Vector3::new(p[0].into(), p[1].into(), p[2].into()) * self.voxel_m
    }

    fn elasticity(&self, label: u16) -> Matrix6<f64> {
        self.materials[usize::from(label)].elasticity()
    }

    /// Calls `visit` with the corners and the label of every finest tetrahedron of a root cube.
    fn visit(&self, cube: [usize; 3], visit: &mut dyn FnMut(&[Point; 4], u16)) {
        let grid = self.tree.grid();
        let [nx, ny, _] = grid.cells;
        let cell = cube[0] + nx * (cube[1] + ny * cube[2]);
        for order in 0..ROOTS_PER_CELL {
            let corners = root_corners(cube, order, grid.voxels_per_cell as i32);
            self.descend(self.tree.root(cell, order), &corners, 0, visit);
        }
    }

    fn descend(
        &self,
        of: NodeRef,
        corners: &[Point; 4],
        level: u8,
        visit: &mut dyn FnMut(&[Point; 4], u16),
    ) {
        if level == self.tree.grid().embed_level() {
            let label = match of.open() {
                Content::Label(label) => label,
                Content::Node(_) => self.tree.majority(of),
            };
            return visit(corners, label);
        }
        let halves = bisect(corners, level, midpoint(corners, level));
        for (of, corners) in self.tree.children(of).into_iter().zip(&halves) {
            self.descend(of, corners, level + 1, visit);
        }
    }
}

impl<'a> Body<'a> {
    /// This process's part of `problem`. Cost: O(voxels of its cubes), and O(cubes) for the others'.
    ///
    /// # Errors
    /// [`BenchError::Petsc`] if there are more unknowns than PETSc counts.
    pub fn new(petsc: &'a Petsc, problem: &Problem) -> Result<Self> {
        let grid = problem.tree.grid();
        let [nx, ny, _] = grid.cells;
        let cubes = problem.cubes.iter().map(|cell| [cell % nx, cell / nx % ny, cell / (nx * ny)]);
        let numbering = Numbering::new(cubes, grid.cells, grid.voxels_per_cell);
        let rows = 3 * numbering.total();
        i32::try_from(rows).map_err(|_| yawara_petsc::PetscError::TooLarge(rows))?;
        let count = numbering.curve().len();
        let share = |rank: usize| count * rank / petsc.size();
        let places = share(petsc.rank())..share(petsc.rank() + 1);
        let owned = numbering.owned(places.clone());
        let mut points: Vec<Point> = places.clone().flat_map(|p| numbering.points(p)).collect();
        let (ghosts, of_ghosts) = foreign(&numbering, places.clone());
        points.extend(of_ghosts);
        let rest: Vec<Vector3<f64>> = points.iter().map(|&p| problem.at(p)).collect();
        let held = rest.iter().map(|x| (problem.is_held)(x)).collect();
        let mut body = Self {
            petsc,
            owned,
            ghosts,
            rest,
            held,
            kinds: Vec::new(),
            tets: Vec::new(),
            room: [Vec::new(), Vec::new()],
            numbering,
        };
        body.fill(problem, places.clone());
        body.make_room(&points, places);
        Ok(body)
    }

    /// Vertices of the whole body.
    pub fn vertices(&self) -> usize {
        self.numbering.total()
    }

    /// Number of a vertex.
    pub fn number(&self, p: Point) -> usize {
        self.numbering.number(p) as usize
    }

    fn fill(&mut self, problem: &Problem, places: Range<usize>) {
        let mut known: HashMap<([[i32; 3]; 3], u16), u32> = HashMap::new();
        for place in places {
            let cube = self.numbering.curve()[place];
            problem.visit(cube, &mut |corners, label| {
                let step = |i: usize| [0, 1, 2].map(|axis| corners[i][axis] - corners[0][axis]);
                let kind =
                    *known.entry(([step(1), step(2), step(3)], label)).or_insert_with(|| {
                        self.kinds.push(Kind::new(problem, corners, label));
                        self.kinds.len() as u32 - 1
                    });
                self.tets.push((corners.map(|p| self.local(self.numbering.number(p))), kind));
            });
        }
    }

    /// The place here of a vertex, by its number.
    fn local(&self, number: u32) -> u32 {
        let at = number as usize;
        if self.owned.contains(&at) {
            return (at - self.owned.start) as u32;
        }
        let ghost = self.ghosts.partition_point(|&ghost| (ghost as u32) < number);
        (self.owned.len() + ghost) as u32
    }

    /// The number of a vertex, by its place here.
    fn global(&self, local: u32) -> i32 {
        let at = local as usize;
        match at < self.owned.len() {
            true => (self.owned.start + at) as i32,
            false => self.ghosts[at - self.owned.len()],
        }
    }

    /// Counts the blocks of the owned rows, a bit for each step to a neighbour; where other processes' tetrahedra
    /// add to a row, all 27 that there can be.
    fn make_room(&mut self, points: &[Point], places: Range<usize>) {
        let count = self.owned.len();
        let mut bits = [vec![0u32; count], vec![0u32; count]];
        for (corners, _) in &self.tets {
            for &row in corners.iter().filter(|row| (**row as usize) < count) {
                for &column in corners {
                    let [from, to] = [row, column].map(|v| points[v as usize]);
                    let step = step_number([0, 1, 2].map(|axis| to[axis] - from[axis]));
                    bits[usize::from(column as usize >= count)][row as usize] |= 1 << step;
                }
            }
        }
        let is_foreign = |place: u32| !places.contains(&(place as usize));
        for (row, &p) in points[..count].iter().enumerate() {
            let mut is_shared = false;
            self.numbering.cubes_at(p, |_, place| is_shared |= is_foreign(place));
            if is_shared {
                (bits[0][row], bits[1][row]) = (!0 >> 5, !0 >> 5);
            }
        }
        self.room = bits.map(|bits| bits.iter().map(|bits| bits.count_ones() as i32).collect());
    }

    /// Finds where the body comes to rest: the linear one by conjugate gradients with residuals that are true, the
    /// co-rotated one by an outer iteration, each step of which solves with the stiffness turned as the elements are now.
    /// (A step turns what is stiff along its tangent, so that the residual may grow before it falls; the next turns it back.)
    ///
    /// `tolerance` is the residual relative to the load; what rounding alone may leave is allowed beside it, since a stiff
    /// element makes large forces of the last digits of its displacements. Forces are those of `element` co-rotation for isotropic materials.
    ///
    /// # Errors
    /// [`BenchError::NotConverged`] if that is not reached; [`BenchError::Petsc`].
    pub fn come_to_rest(&self, is_corotated: bool, tolerance: f64) -> Result<Rest> {
        let mut load = self.vector()?;
        load.with(|f| {
            for (corners, kind) in &self.tets {
                let weight = self.kinds[*kind as usize].weight;
                corners.iter().for_each(|&v| add(f, v, &weight));
            }
        })?;
        load.add_ghosts()?;
        self.clear_held(&mut load)?;
        let (mut u, mut residual) = (self.vector()?, self.vector()?);
        let (mut matrix, mut step) = (self.matrix()?, self.vector()?);
        let reference = load.norm()?;
        let mut left = self.measure(&u, &load, &mut residual, is_corotated)? / reference;
        let mut rounding = 0.0;
        let (mut outer, mut inner, mut fresh, mut is_kept) = (0, 0, 0, false);
        let mut solver: Option<Solver> = None;
        // A residual that is no number is not one that is small.
        while !(left <= tolerance.max(rounding)) {
            if outer == OUTER {
                let (case, method) = ("resolution", "gamg");
                return Err(BenchError::NotConverged {
                    case,
                    method,
                    reached: left,
                    limit: tolerance,
                });
            }
            outer += 1;
            if is_corotated || outer == 1 {
                self.assemble(&mut matrix, &u, is_corotated)?;
            }
            let relative = if is_corotated { INNER } else { (0.5 * tolerance / left).max(1e-12) };
            if solver.is_none() {
                solver = Some(Solver::multigrid(self.petsc, &matrix, relative, ITERATIONS)?);
            }
            let Some(solver) = &mut solver else { continue };
            solver.set_tolerance(relative, ITERATIONS)?;
            let solved = solver.solve(&residual, &mut step)?;
            inner += solved.iterations;
            if !is_kept {
                fresh = solved.iterations;
            }
            // What was made for another turn of the elements goes on as long as it helps all but as much.
            is_kept = solved.iterations <= 2 * fresh.max(1);
            solver.keep_preconditioner(is_kept)?;
            step.update_ghosts()?;
            advance(&mut u, &step)?;
            left = self.measure(&u, &load, &mut residual, is_corotated)? / reference;
            rounding = self.rounding(&u)? / reference;
        }
        let work_j = load.dot(&u)?;
        let (displacements, largest) = u.with(|u| {
            let vectors = u.chunks_exact(3).take(self.owned.len());
            let vectors: Vec<Vector3<f64>> = vectors.map(Vector3::from_column_slice).collect();
            let largest = vectors.iter().map(Vector3::norm).fold(0.0, f64::max);
            (vectors, largest)
        })?;
        let largest_m = largest_of(self.petsc, largest)?;
        Ok(Rest { displacements, work_j, largest_m, outer, inner, residual: left, rounding })
    }

    fn vector(&self) -> Result<Vector> {
        Ok(Vector::new(self.petsc, 3, self.owned.len(), &self.ghosts)?)
    }

    fn matrix(&self) -> Result<Matrix> {
        let [own, others] = &self.room;
        let mut matrix = Matrix::definite(self.petsc, 3, own, others)?;
        let mut positions = self.vector()?;
        positions.with(|x| {
            for (x, rest) in x.chunks_exact_mut(3).zip(&self.rest) {
                x.copy_from_slice(rest.as_slice());
            }
        })?;
        matrix.set_positions(&positions)?;
        Ok(matrix)
    }

    fn clear_held(&self, vector: &mut Vector) -> Result<()> {
        Ok(vector.with(|x| {
            let held = x.chunks_exact_mut(3).zip(&self.held).filter(|(_, held)| **held);
            held.for_each(|(x, _)| x.fill(0.0));
        })?)
    }

    /// The residual of displacements, zero where they are fixed, and its norm, N.
    fn measure(
        &self,
        u: &Vector,
        load: &Vector,
        residual: &mut Vector,
        is_corotated: bool,
    ) -> Result<f64> {
        let (u, load) = (u.values()?, load.values()?);
        residual.with(|f| {
            f.fill(0.0);
            for (corners, kind) in &self.tets {
                let kind = &self.kinds[*kind as usize];
                let at = self.state(corners, kind, &u, is_corotated);
                for (i, &v) in corners.iter().enumerate() {
                    let force: Vector3<f64> = at.force.fixed_rows::<3>(3 * i).into();
                    add(f, v, &-(at.rotation * force));
                }
            }
        })?;
        residual.add_ghosts()?;
        let own = 3 * self.owned.len();
        residual.with(|f| f[..own].iter_mut().zip(&load).for_each(|(f, load)| *f += load))?;
        self.clear_held(residual)?;
        Ok(residual.norm()?)
    }

    /// What rounding may make of forces, N: two units in the last place of each displacement, times the stiffness
    /// of its vertex.
    fn rounding(&self, u: &Vector) -> Result<f64> {
        let u = u.values()?;
        let mut bound = self.vector()?;
        bound.with(|f| {
            for (corners, kind) in &self.tets {
                let stiffness = self.kinds[*kind as usize].stiffness.diagonal().max();
                for &v in corners {
                    let u = Vector3::from_column_slice(&u[3 * v as usize..][..3]);
                    add(f, v, &(u.abs() * (2.0 * f64::EPSILON * stiffness)));
                }
            }
        })?;
        bound.add_ghosts()?;
        self.clear_held(&mut bound)?;
        Ok(bound.norm()?)
    }

    /// How an element is turned, and its forces before it is.
    fn state(&self, corners: &[u32; 4], kind: &Kind, u: &[f64], is_corotated: bool) -> State {
        let u = corners.map(|v| Vector3::from_column_slice(&u[3 * v as usize..][..3]));
        let rotation = match is_corotated {
            true => polar_cold(&(Matrix3::identity() + kind.geometry.gradient(&u))),
            false => Matrix3::identity(),
        };
        let rest = corners.map(|v| self.rest[v as usize]);
        let mut moved = SMatrix::<f64, ROWS, 1>::zeros();
        for i in 1..4 {
            // Relative to the first corner, so that far from the origin nothing cancels.
            let edge = rest[i] - rest[0];
            let now = rotation.transpose() * (edge + u[i] - u[0]) - edge;
            moved.fixed_rows_mut::<3>(3 * i).copy_from(&now);
        }
        State { rotation, force: kind.stiffness * moved }
    }

    /// Σ R K Rᵀ, with ones of the largest stiffness where displacements are fixed.
    fn assemble(&self, matrix: &mut Matrix, u: &Vector, is_corotated: bool) -> Result<()> {
        matrix.clear()?;
        let u = u.values()?;
        let mut values = [0.0; ROWS * ROWS];
        for (corners, kind) in &self.tets {
            let kind = &self.kinds[*kind as usize];
            let r = self.state(corners, kind, &u, is_corotated).rotation;
            let free = corners.map(|v| !self.held[v as usize]);
            for (i, j) in (0..4).flat_map(|i| (0..4).map(move |j| (i, j))) {
                let block = match free[i] && free[j] {
                    true => r * kind.stiffness.fixed_view::<3, 3>(3 * i, 3 * j) * r.transpose(),
                    false => Matrix3::zeros(),
                };
                for (a, b) in (0..3).flat_map(|a| (0..3).map(move |b| (a, b))) {
                    values[ROWS * (3 * i + a) + 3 * j + b] = block[(a, b)];
                }
            }
            matrix.add(&corners.map(|v| self.global(v)), &values)?;
        }
        let scale =
            self.kinds.iter().map(|kind| kind.stiffness.diagonal().max()).fold(0.0, f64::max);
        let scale = largest_of(self.petsc, scale)?;
        let anchor = Matrix3::identity() * scale;
        for local in (0..self.owned.len()).filter(|&v| self.held[v]) {
            matrix.add(&[self.global(local as u32)], anchor.as_slice())?;
        }
        Ok(matrix.assemble()?)
    }
}

/// See [`Body::state`].
struct State {
    rotation: Matrix3<f64>,
    force: SMatrix<f64, ROWS, 1>,
}

impl Kind {
    fn new(problem: &Problem, corners: &[Point; 4], label: u16) -> Self {
        let geometry = LinearTet::new(&corners.map(|p| problem.at(p)));
        let density = problem.materials[usize::from(label)].density_kg_m3();
        let weight = problem.gravity * (0.25 * density * geometry.volume);
        let stiffness = geometry.stiffness(&problem.elasticity(label));
        Self { geometry, stiffness, weight }
    }
}

fn add(f: &mut [f64], vertex: u32, force: &Vector3<f64>) {
    let at = 3 * vertex as usize;
    f[at..at + 3].iter_mut().zip(force.iter()).for_each(|(f, force)| *f += force);
}

/// u + step, ghosts too.
fn advance(u: &mut Vector, step: &Vector) -> Result<()> {
    let step = step.values()?;
    Ok(u.with(|u| u.iter_mut().zip(&step).for_each(|(u, step)| *u += step))?)
}

/// The largest of all processes' values.
pub(crate) fn largest_of(petsc: &Petsc, value: f64) -> Result<f64> {
    let mut all = Vector::new(petsc, 1, 1, &[])?;
    all.with(|all| all[0] = value)?;
    Ok(all.max()?)
}

/// The sum of all processes' values.
pub(crate) fn sum_of(petsc: &Petsc, value: f64) -> Result<f64> {
    let mut all = Vector::new(petsc, 1, 1, &[])?;
    all.with(|all| all[0] = value)?;
    Ok(all.sum()?)
}

/// The vertices of the cubes at `places` that belong to cubes of other processes, by number, and where they lie.
fn foreign(numbering: &Numbering, places: Range<usize>) -> (Vec<i32>, Vec<Point>) {
    let owned = numbering.owned(places.clone());
    let mut found: Vec<(i32, Point)> = Vec::new();
    for place in places {
        for p in numbering.corners(place) {
            let number = numbering.number(p);
            if !owned.contains(&(number as usize)) {
                found.push((number as i32, p));
            }
        }
    }
    found.sort_unstable();
    found.dedup();
    found.into_iter().unzip()
}
