//! The tangent of a problem where it stands: a factor of its convex part, and what is beside that.

use std::borrow::Cow;
use std::cmp::Ordering;

use faer::Mat;
use faer::reborrow::Reborrow;
use faer::sparse::{Pair, SparseColMatMut, SymbolicSparseColMat};
use nalgebra::{Matrix4, SMatrix};
use rayon::prelude::*;
use yawara_embed::{LdlPattern, SparseLdl};

use super::following::Following;
use super::problem::Problem;
use super::sparse_lu::SparseLu;
use crate::body::Body;
use crate::element::pressures::PressureTangent;
use crate::element::tetrahedron::stress_matrix;
use crate::element::{Element, ElementPoint};
use crate::field::Field;
use crate::forces::ElementTangent;
use crate::forces::tangent::{CornerVector, each_dent, each_lack};
use crate::grip::Turned;
use crate::vectors::{axpy, dot};

/// S = M − N on displacements, pressures eliminated: M is positive definite and factored, N the sum of what
/// elements, and obstacles that turn away, have too little of for that. Or all of S with what loads that follow the body add to it, factored
/// as it is.
///
/// Vectors have the rows of the problem's residuals and steps; constraints are kept by all steps.
pub(super) struct TangentSystem<'a> {
    unknowns: Unknowns,
    shape: Shape,
    pattern: Option<Pattern>,
    /// Of the matrix last made: its memory is used again.
    values: Vec<f64>,
    /// Of the elements, where the problem's body stands.
    tangents: Vec<ElementTangent>,
    /// Of their pressures, in a mixed body.
    pressed: Vec<PressureTangent>,
    kind: Kind,
    factor: Option<Factor>,
    /// N = Σ d dᵀ, by the vertices that elements and pushed points have it on.
    dents: Dents,
    /// Whether it has [served again](Self::serves_again).
    is_old: bool,
    /// Renewals before S is tried again, and how many there were after the last try.
    wait: usize,
    pause: usize,
    constraints: Option<Turned<'a>>,
}

/// Where the runs of entries that elements add, in their order, begin among those of the matrix, and where its factor has some.
/// It serves all problems of the same shape.
pub(super) struct Pattern {
    shape: Shape,
    matrix: SymbolicSparseColMat<usize>,
    at: Vec<u32>,
    /// None while a factor has it.
    factor: Option<LdlPattern>,
}

/// What decides where a matrix has entries.
#[derive(Clone, PartialEq)]
struct Shape {
    per_vertex: usize,
    /// [`Unknowns::of`].
    unknowns: Vec<usize>,
    /// Corners of what adds entries.
    corners: Vec<[usize; 4]>,
}

type Dents = Vec<([usize; 4], CornerVector)>;

/// Which matrix is factored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    /// M, symmetric.
    Convex,
    /// S, with loads that follow the body.
    Whole,
}

enum Factor {
    Convex(SparseLdl),
    Whole(SparseLu),
}

/// The unknowns of a problem, counted through: displacements of free vertices, pressures of all that have
/// elements.
struct Unknowns {
    per_vertex: usize,
    /// By row of the problem, [`HELD`] for none.
    of: Vec<usize>,
    /// The problem's row of each.
    at: Vec<usize>,
    /// The sign of each on the diagonal of M.
    signs: Vec<i8>,
}

/// Takes entries, in the lower half alone of what is symmetric.
struct Entries<'a> {
    unknowns: &'a Unknowns,
    kind: Kind,
    sink: Sink<'a>,
}

/// Where entries go.
enum Sink<'a> {
    /// The places of runs in a list, to make a pattern of.
    Places(Vec<Run>),
    /// Their values to the matrix's, by what is left of [`Pattern::at`].
    Values(std::slice::Iter<'a, u32>, &'a mut [f64]),
}

/// Entries of a column in rows that follow each other: the first, and how many.
type Run = (Pair<usize, usize>, usize);

/// Elements that a thread takes at once.
const AT_LEAST: usize = 32;

/// Products with S at most in a direction.
const PRODUCTS: usize = 40;

/// A direction of less than this part of the curvature that M has there counts as one that curves down.
const FLAT: f64 = 1e-6;

/// One that curves down by less than this part is followed as if it curved down by that.
const SLIGHT: f64 = 1e-3;

/// Renewals between two tries of S at most.
const LONGEST_PAUSE: usize = 7;

const HELD: usize = usize::MAX;

impl<'a> TangentSystem<'a> {
    /// That of a problem; still without a factor. `kept` is of a system of the same kind, and serves if it fits.
    pub fn new(problem: &Problem<'a>, kind: Kind, kept: Option<Pattern>) -> Self {
        let unknowns = Unknowns::new(problem);
        let shape = Shape::new(problem, &unknowns);
        Self {
            pattern: kept.filter(|kept| kept.shape == shape),
            unknowns,
            shape,
            values: Vec::new(),
            tangents: Vec::new(),
            pressed: Vec::new(),
            kind,
            factor: None,
            dents: Vec::new(),
            is_old: false,
            wait: 0,
            pause: 0,
            constraints: None,
        }
    }

    /// What serves the next system of this kind.
    pub fn into_pattern(self) -> Option<Pattern> {
        let mut pattern = self.pattern?;
        if let Some(Factor::Convex(factor)) = self.factor {
            pattern.factor = Some(factor.into_pattern());
        }
        Some(pattern)
    }

    /// Whether it may serve a second direction as it is, which counts as a renewal: where it is not definite, which
    /// makes it dear and no exact model anyway, and not about to be tried.
    pub fn serves_again(&mut self) -> bool {
        if self.dents.is_empty() || self.is_old || self.wait == 0 {
            return false;
        }
        self.wait -= 1;
        self.is_old = true;
        true
    }

    /// Renews it where the problem's body stands now; its elements must be those of the last time. None
    /// without tangents, or where M can't be factored.
    ///
    /// M is all of S where that is positive definite, which is found by factoring it: the less often the more often it
    /// was not.
    pub fn renew(&mut self, problem: &Problem<'a>, positions: &Field) -> Option<()> {
        self.dents.clear();
        self.is_old = false;
        let (body, tangent_of) = (&*problem.body, problem.forces.tangent()?);
        self.tangents.resize(body.elements().len(), ElementTangent::zeros());
        let each = self.tangents.par_iter_mut().enumerate().with_min_len(AT_LEAST);
        each.for_each(|(number, tangent)| *tangent = tangent_of(body, number, positions));
        let numbers = (0..body.elements().len()).into_par_iter().with_min_len(AT_LEAST);
        let pressed = numbers.filter_map(|number| body.pressure_tangent(number, positions));
        self.pressed.clear();
        self.pressed.par_extend(pressed);
        if self.kind == Kind::Whole {
            self.factor_of(problem, positions, None)?;
        } else if !self.is_definite(problem, positions) {
            let mut dents = std::mem::take(&mut self.dents);
            self.raise(problem.body, &mut dents);
            self.factor_of(problem, positions, Some(&mut dents))?;
            self.dents = dents;
        }
        self.constraints = None;
        let m = self.unknowns.per_vertex;
        if let Some(constraints) = problem.constraints {
            let force = |k: usize| problem.force_of(constraints.row(k));
            let forces: Vec<Vec<f64>> = (0..constraints.len()).map(force).collect();
            self.constraints = Some(constraints.answered_by(self.solve_all(&forces), m));
        }
        Some(())
    }

    /// Factors S where the problem's body stands, unless that is not likely to be definite; whether it is.
    fn is_definite(&mut self, problem: &Problem<'_>, positions: &Field) -> bool {
        if let Some(less) = self.wait.checked_sub(1) {
            self.wait = less;
            return false;
        }
        let is_exact = |factor: &Factor| matches!(factor, Factor::Convex(one) if one.is_exact());
        let is_definite = self.factor_of(problem, positions, None).is_some()
            && self.factor.as_ref().is_some_and(is_exact);
        self.pause = if is_definite { 0 } else { (2 * self.pause + 1).min(LONGEST_PAUSE) };
        self.wait = self.pause;
        is_definite
    }

    /// Makes the elements' tangents positive semi-definite, and adds what they have then too much to `dents`.
    fn raise(&mut self, body: &Body, dents: &mut Dents) {
        let of_some = |(tangents, elements): (&mut [ElementTangent], &[Element])| {
            let mut own = Dents::new();
            let mut lacks = Vec::new();
            each_dent(tangents, |at, dent| lacks.push((at, dent)));
            for (at, dent) in lacks {
                tangents[at].ger(1.0, &dent, &dent, 1.0);
                own.push((elements[at].vertices, dent));
            }
            own
        };
        let some = self.tangents.par_chunks_mut(AT_LEAST);
        dents.par_extend(some.zip(body.elements().par_chunks(AT_LEAST)).flat_map_iter(of_some));
    }

    /// Factors M where the problem's body stands, with N into `dents`; without these S.
    fn factor_of(
        &mut self,
        problem: &Problem<'_>,
        positions: &Field,
        dents: Option<&mut Dents>,
    ) -> Option<()> {
        if self.pattern.is_none() {
            let sink = Sink::Places(Vec::new());
            let mut entries = Entries { unknowns: &self.unknowns, kind: self.kind, sink };
            assemble(problem, positions, (&self.tangents, &self.pressed), &mut entries, None);
            let Sink::Places(places) = entries.sink else { return None };
            self.pattern = Some(Pattern::new(&self.shape, self.unknowns.at.len(), &places)?);
        }
        let Pattern { matrix, at, factor, .. } = self.pattern.as_mut()?;
        self.values.clear();
        self.values.resize(matrix.row_idx().len(), 0.0);
        let sink = Sink::Values(at.iter(), &mut self.values);
        let mut entries = Entries { unknowns: &self.unknowns, kind: self.kind, sink };
        assemble(problem, positions, (&self.tangents, &self.pressed), &mut entries, dents);
        let matrix = SparseColMatMut::new(matrix.as_ref(), &mut self.values);
        self.factor = Some(match (self.kind, self.factor.take()) {
            (Kind::Whole, _) => Factor::Whole(SparseLu::new(matrix.rb())?),
            (Kind::Convex, before) => {
                let of_before = match before {
                    Some(Factor::Convex(factor)) => Some(factor.into_pattern()),
                    _ => factor.take(),
                };
                Factor::Convex(SparseLdl::new(matrix, &self.unknowns.signs, of_before)?)
            }
        });
        Some(())
    }

    /// M⁻¹ r, or S⁻¹ r of the whole; zero without a factor.
    pub fn solve(&self, residual: &[f64]) -> Vec<f64> {
        let mut step = self.solve_all(&[residual]).swap_remove(0);
        if let Some(constraints) = &self.constraints {
            constraints.correct(&mut step, self.unknowns.per_vertex, None);
        }
        step
    }

    /// The same of several at once, whatever constraints ask for.
    fn solve_all<R: AsRef<[f64]>>(&self, residuals: &[R]) -> Vec<Vec<f64>> {
        let at = &self.unknowns.at;
        let mut steps: Vec<_> = residuals.iter().map(|r| vec![0.0; r.as_ref().len()]).collect();
        let Some(factor) = &self.factor else { return steps };
        let mut x = Mat::from_fn(at.len(), steps.len(), |i, k| residuals[k].as_ref()[at[i]]);
        match factor {
            Factor::Convex(factor) => factor.solve_in_place(&mut x),
            Factor::Whole(factor) => factor.solve_in_place(&mut x),
        }
        for (step, x) in steps.iter_mut().zip(x.col_iter()) {
            at.iter().zip(x.iter()).for_each(|(&at, x)| step[at] = *x);
        }
        steps
    }

    /// S⁻¹ r by conjugate gradients, to `accuracy` of what r asks for in the norm of M⁻¹; where they meet a direction
    /// that curves down, what they have found, and along that direction as far as if it curved up as much. Near a
    /// saddle that doubles the distance from it, whatever the other directions ask for.
    pub fn direction(&self, residual: &[f64], accuracy: f64) -> Vec<f64> {
        let mut z = self.solve(residual);
        if self.dents.is_empty() {
            return z;
        }
        let mut r = residual.to_vec();
        let mut rest = dot(&r, &z);
        let enough = accuracy.powi(2) * rest;
        let (mut p, mut of_p) = (z.clone(), r.clone());
        let mut found = vec![0.0; residual.len()];
        for _ in 0..PRODUCTS {
            // M p is known: p is made of vectors M⁻¹ r.
            let convex = dot(&p, &of_p);
            let mut stiff = of_p.clone();
            self.take_dents(&p, &mut stiff);
            let curvature = dot(&p, &stiff);
            if !(curvature > FLAT * convex) {
                let length = rest / (-curvature).max(SLIGHT * convex);
                axpy(length, &p, &mut found);
                return found;
            }
            let length = rest / curvature;
            axpy(length, &p, &mut found);
            axpy(-length, &stiff, &mut r);
            z = self.solve(&r);
            let left = dot(&r, &z);
            if !(left > enough) {
                break;
            }
            let share = left / rest;
            rest = left;
            for (p, z) in p.iter_mut().zip(&z) {
                *p = z + share * *p;
            }
            for (of_p, r) in of_p.iter_mut().zip(&r) {
                *of_p = r + share * *of_p;
            }
        }
        found
    }

    /// y ← y − N x.
    fn take_dents(&self, x: &[f64], y: &mut [f64]) {
        let m = self.unknowns.per_vertex;
        for (vertices, dent) in &self.dents {
            let at = |i: usize| m * vertices[i / 3] + i % 3;
            let along: f64 = (0..12).map(|i| dent[i] * x[at(i)]).sum();
            (0..12).for_each(|i| y[at(i)] -= along * dent[i]);
        }
    }
}

/// Enters all that the matrix is made of, tangents of elements as they are; with `dents` obstacles as in M, and what
/// that has too much into these.
fn assemble(
    problem: &Problem<'_>,
    positions: &Field,
    (tangents, pressed): (&[ElementTangent], &[PressureTangent]),
    entries: &mut Entries<'_>,
    mut dents: Option<&mut Dents>,
) {
    let body = &*problem.body;
    let is_convex = entries.kind == Kind::Convex;
    for (number, (element, tangent)) in body.elements().iter().zip(tangents).enumerate() {
        let alike = [problem.inertia.map(|of| of.matrix(number)), body.grip_matrix(element.tet)];
        let mut tangent = Cow::Borrowed(tangent);
        alike.iter().flatten().for_each(|part| add_alike(tangent.to_mut(), part));
        match pressed.get(number) {
            Some(pressed) => {
                let matrix = with_pressures(body, number, pressed, &tangent);
                entries.add_corners(element.vertices, 4, matrix.as_slice());
            }
            None => entries.add_corners(element.vertices, 3, tangent.as_slice()),
        }
    }
    if let Some(pushes) = problem.pushes {
        pushes.each_stiffness(positions, |point, stiffness| {
            let ElementPoint { vertices, weights } = *point;
            let mut stiffness = stiffness;
            if let Some(dents) = dents.as_deref_mut() {
                let lacking = stiffness;
                each_lack(&[lacking], |_, lack| {
                    stiffness += lack * lack.transpose();
                    let dent = CornerVector::from_fn(|i, _| weights[i / 3] * lack[i % 3]);
                    dents.push((vertices, dent));
                });
            }
            let entry = |i: usize, j: usize| stiffness[(i % 3, j % 3)];
            let weight = |i: usize, j: usize| weights[i / 3] * weights[j / 3];
            let tangent = ElementTangent::from_fn(|i, j| weight(i, j) * entry(i, j));
            entries.add_corners(vertices, 3, tangent.as_slice());
        });
    }
    for following in problem.following.iter().filter(|_| !is_convex) {
        let stiffness = following.stiffness(positions);
        entries.add_corners(following.vertices(), 3, stiffness.as_slice());
    }
    // Rows without elements.
    let unknowns = entries.unknowns;
    for (row, sign) in unknowns.signs.iter().enumerate() {
        entries.push(row, row, &[f64::from(*sign) * f64::MIN_POSITIVE]);
    }
}

impl Unknowns {
    fn new(problem: &Problem<'_>) -> Self {
        let m = problem.unknowns_per_vertex();
        let is_unknown = |row: &usize| match row % m {
            3 => problem.body.pressure_row(row / m).1 > 0.0,
            _ => problem.free[row / m],
        };
        let at: Vec<usize> = (0..problem.rows()).filter(is_unknown).collect();
        let mut of = vec![HELD; problem.rows()];
        at.iter().enumerate().for_each(|(number, &row)| of[row] = number);
        let signs = at.iter().map(|row| if row % m > 2 { -1 } else { 1 }).collect();
        Self { per_vertex: m, of, at, signs }
    }
}

impl Pattern {
    /// Of n × n entries in runs that come in this order.
    fn new(shape: &Shape, n: usize, runs: &[Run]) -> Option<Self> {
        let of_run = |&(Pair { row, col }, length): &Run| {
            (row..row + length).map(move |row| Pair { row, col })
        };
        let places: Vec<_> = runs.iter().flat_map(of_run).collect();
        let (matrix, _) = SymbolicSparseColMat::try_new_from_indices(n, n, &places).ok()?;
        let at = |(place, _): &Run| {
            let column = matrix.col_range(place.col);
            let rows = &matrix.row_idx()[column.clone()];
            Some((column.start + rows.binary_search(&place.row).ok()?) as u32)
        };
        let at = runs.iter().map(at).collect::<Option<_>>()?;
        Some(Self { shape: shape.clone(), matrix, at, factor: None })
    }
}

impl Shape {
    fn new(problem: &Problem<'_>, unknowns: &Unknowns) -> Self {
        let pushed = problem.pushes.map_or(&[][..], |pushes| pushes.points);
        let elements = problem.body.elements().iter().map(|element| element.vertices);
        let pushed = pushed.iter().map(|(point, _)| point.vertices);
        let following = problem.following.iter().map(Following::vertices);
        Self {
            per_vertex: unknowns.per_vertex,
            unknowns: unknowns.of.clone(),
            corners: elements.chain(pushed).chain(following).collect(),
        }
    }
}

impl Entries<'_> {
    /// Adds the matrix, by columns, of what has four corners with `rows` each: displacements, which are unknown all
    /// three, or held, or these and the pressure. Unknowns of a vertex follow each other.
    fn add_corners(&mut self, vertices: [usize; 4], rows: usize, matrix: &[f64]) {
        let Unknowns { per_vertex: m, of, .. } = self.unknowns;
        // The first unknown of each corner, and how many rows of it come before.
        let first = vertices.map(|v| match of[m * v] {
            HELD if rows > 3 => (of[m * v + 3], 3),
            HELD => (HELD, rows),
            first => (first, 0),
        });
        let is_whole = self.kind == Kind::Whole;
        for (values, column) in matrix.chunks_exact(4 * rows).zip(0..) {
            let (own, held) = first[column / rows];
            let Some(axis) = (column % rows).checked_sub(held) else { continue };
            for (&(row, held), values) in first.iter().zip(values.chunks_exact(rows)) {
                let above = match row.cmp(&own) {
                    _ if held == rows => continue,
                    _ if is_whole => 0,
                    Ordering::Less => continue,
                    Ordering::Equal => axis,
                    Ordering::Greater => 0,
                };
                self.push(row + above, own + axis, &values[held + above..]);
            }
        }
    }

    /// Adds values of a column from a row on.
    fn push(&mut self, row: usize, col: usize, values: &[f64]) {
        match &mut self.sink {
            Sink::Places(places) => places.push((Pair { row, col }, values.len())),
            Sink::Values(at, sums) => {
                if let Some(&at) = at.next() {
                    let sums = &mut sums[at as usize..][..values.len()];
                    sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
                }
            }
        }
    }
}

/// Adds a matrix on the corners, the same for each axis.
fn add_alike(tangent: &mut ElementTangent, corners: &Matrix4<f64>) {
    for (i, j) in (0..4).flat_map(|j| (0..4).map(move |i| (i, j))) {
        (0..3).for_each(|axis| tangent[(3 * i + axis, 3 * j + axis)] += corners[(i, j)]);
    }
}

/// A tangent with what an element's pressures and its dilation have to do with each other, four rows a corner: rows
/// of pressures are [`Problem::evaluate`]'s (P q − G u)/h with the sign of G u, columns h δq.
fn with_pressures(
    body: &Body,
    number: usize,
    pressed: &PressureTangent,
    tangent: &ElementTangent,
) -> SMatrix<f64, 16, 16> {
    let Element { vertices, geometry, .. } = &body.elements()[number];
    let pull = geometry.volume * body.rotation(number) * stress_matrix(&pressed.pull);
    let weights = vertices.map(|v| body.pressure_row(v).1);
    let stiffening = body.stiffening();
    let mut whole = SMatrix::<f64, 16, 16>::zeros();
    for (i, j) in (0..4).flat_map(|j| (0..4).map(move |i| (i, j))) {
        let corners = tangent.fixed_view::<3, 3>(3 * i, 3 * j);
        whole.fixed_view_mut::<3, 3>(4 * i, 4 * j).copy_from(&corners);
        let force = weights[i] * (pull * geometry.gradients[j]);
        for axis in 0..3 {
            whole[(4 * j + axis, 4 * i + 3)] = force[axis];
            whole[(4 * i + 3, 4 * j + axis)] = force[axis];
        }
        let own = if i == j { pressed.own } else { 0.0 };
        let entry = weights[i] * weights[j] * stiffening * (pressed.across + own);
        whole[(4 * i + 3, 4 * j + 3)] = -entry;
    }
    whole
}
