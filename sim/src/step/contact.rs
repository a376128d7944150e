//! Where probes touch the surface, and with what force.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix3, Vector3};
use yawara_corot::{
    Constraints, Contact, ContactOutcome, ElementPoint, Equilibrium, Loads, Obstacle, Outcome,
    Problem, Sphere, Tolerance, solve_with_contact,
};

use super::checkpoint::{KeptContact, KeptPush};
use crate::error::SimError;
use crate::inverse::InverseLink;
use crate::tools::Tool;

/// Points this fraction of the radius outside a probe may come to touch it within a solve.
const NEAR: f64 = 0.1;

/// A probe that moves farther than this fraction of its radius in a step may touch points that are not near before;
/// those join when they have come too deep.
const LEAP: f64 = 0.5;

/// Solves of one attempt at most; each after the first adds points that had come too deep.
const ROUNDS: usize = 6;

/// Compliance added to that of each contact before inversion, as a fraction of the largest: points
/// closer together than the mesh resolves make the matrix singular.
const REGULAR: f64 = 1e-6;

/// A probe at the end of a part of a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Probing {
    pub tool: usize,
    pub sphere: Sphere,
    /// How far and where to it has come since the last equilibrium, m.
    pub moved: Vector3<f64>,
}

/// A point that a probe pushes.
#[derive(Clone, Copy, Debug)]
struct Push {
    tool: usize,
    /// Its number among the tool's surface points.
    number: usize,
    point: ElementPoint,
    normal: Vector3<f64>,
    force: f64,
    /// By how much it grew in the last step, N.
    growth: f64,
}

/// Compliance between some points while vertices are held.
struct Known {
    updates: usize,
    held: Vec<usize>,
    /// How many constraints hold the body besides.
    constraints: usize,
    /// Tools and numbers of the points.
    points: Vec<(usize, usize)>,
    normals: Vec<Vector3<f64>>,
    /// By rows, m/N.
    entries: Vec<f64>,
}

/// What an attempt needs besides the equilibrium problem.
pub(crate) struct Surroundings<'a> {
    pub tools: &'a [Box<dyn Tool>],
    pub probing: &'a [Probing],
    pub inverse: &'a InverseLink,
    pub held: &'a [usize],
    /// How much of their last growth pushes begin with.
    pub share: f64,
}

/// The contacts of the last equilibrium, and the compliance that the next one may use again.
#[derive(Default)]
pub(crate) struct ContactState {
    pushes: Vec<Push>,
    /// Those when the step under way began.
    before: Vec<Push>,
    /// n Ĉ nᵀ of all pairs of `pushes`, m/N.
    compliance: Vec<f64>,
    penetration: f64,
    known: Option<Known>,
}

/// How deep points may be in a probe of radius R when a solve with relative residual τ has
/// converged: τ R, m.
fn depth(probing: &[Probing], tolerance: &Tolerance) -> f64 {
    let least = probing.iter().map(|p| p.sphere.radius).fold(f64::INFINITY, f64::min);
    tolerance.residual * least
}

/// The points of `pairs` with the number of their probe.
fn points(pairs: &[Push], around: &Surroundings<'_>) -> Vec<(ElementPoint, usize)> {
    let of = |tool: usize| around.probing.iter().position(|p| p.tool == tool).unwrap_or(0);
    pairs.iter().map(|pair| (pair.point, of(pair.tool))).collect()
}

impl ContactState {
    /// The contacts, without what is known of others.
    pub fn kept(&self) -> KeptContact {
        let kept = |push: &Push| {
            let Push { tool, number, force, growth, .. } = *push;
            KeptPush { tool, number, normal: push.normal.into(), force, growth }
        };
        KeptContact {
            pushes: self.pushes.iter().map(kept).collect(),
            compliance: self.compliance.clone(),
            penetration: self.penetration,
        }
    }

    /// Of what was kept, on the points that tools have now.
    pub fn resumed(kept: &KeptContact, tools: &[Box<dyn Tool>]) -> Self {
        let push = |kept: &KeptPush| {
            let KeptPush { tool, number, normal, force, growth } = *kept;
            let point = *tools[tool].surface_points()?.point(number)?;
            Some(Push { tool, number, point, normal: normal.into(), force, growth })
        };
        Self {
            pushes: kept.pushes.iter().filter_map(push).collect(),
            compliance: kept.compliance.clone(),
            penetration: kept.penetration,
            ..Self::default()
        }
    }

    /// Moves the free vertices into equilibrium with the probes where they are.
    ///
    /// Starts with the points near a probe; those found too deep in the solution join for another
    /// round. Where no point is near, `equilibrium` solves.
    pub fn solve(
        &mut self,
        problem: &mut Problem<'_>,
        equilibrium: &mut dyn Equilibrium,
        positions: &mut [Vector3<f64>],
        internal: &mut [Vector3<f64>],
        tolerance: &Tolerance,
        around: &Surroundings<'_>,
    ) -> Result<Outcome, SimError> {
        let depth = depth(around.probing, tolerance);
        let obstacles: Vec<&dyn Obstacle> =
            around.probing.iter().map(|p| &p.sphere as &dyn Obstacle).collect();
        let constraints = problem.constraints.map_or(0, Constraints::len);
        let mut pairs = self.near(around, positions);
        let mut total: Option<Outcome> = None;
        for _ in 0..ROUNDS {
            let (outcome, touched) = if pairs.is_empty() {
                (equilibrium.solve(problem, positions, internal, tolerance), None)
            } else {
                let points = points(&pairs, around);
                let forces: Vec<f64> = pairs.iter().map(|pair| pair.force).collect();
                let known = self.known(&pairs, around, constraints);
                let known = known.as_ref().map(|(entries, normals)| (&entries[..], &normals[..]));
                let (points, obstacles) = (&points[..], &obstacles[..]);
                let contact = Contact { points, obstacles, known, depth };
                let touched = solve_with_contact(
                    problem,
                    equilibrium,
                    &contact,
                    &forces,
                    positions,
                    internal,
                    tolerance,
                );
                (touched.outcome, Some(touched))
            };
            let sum = total.map_or(outcome, |before| Outcome {
                iterations: before.iterations + outcome.iterations,
                evaluations: before.evaluations + outcome.evaluations,
                fallbacks: before.fallbacks + outcome.fallbacks,
                ..outcome
            });
            total = Some(sum);
            if !outcome.converged {
                if tolerance.is_late() {
                    self.keep(&pairs, touched, around, constraints);
                }
                return Ok(sum);
            }
            self.keep(&pairs, touched, around, constraints);
            let deeper = deeper(around, positions, &pairs, depth);
            if deeper.is_empty() {
                return Ok(sum);
            }
            pairs.extend(deeper);
        }
        let mut total =
            total.unwrap_or_else(|| equilibrium.solve(problem, positions, internal, tolerance));
        total.converged = false;
        Ok(total)
    }

    /// Points near a probe or pushed by one so far.
    fn near(&self, around: &Surroundings<'_>, positions: &[Vector3<f64>]) -> Vec<Push> {
        let mut pairs = Vec::new();
        for probing in around.probing {
            let reach = NEAR * probing.sphere.radius
                + probing.moved.norm().min(LEAP * probing.sphere.radius);
            each_within(around, probing, positions, reach, |number, point, _| {
                pairs.push(push(probing.tool, number, *point));
            });
        }
        for old in &self.pushes {
            let same = |p: &&mut Push| (p.tool, p.number) == (old.tool, old.number);
            if let Some(pair) = pairs.iter_mut().find(same) {
                pair.force = (old.force + around.share * old.growth).max(0.0);
            }
        }
        pairs
    }

    /// What is known of the compliance between `pairs`, by rows, with the normals that it is for.
    fn known(
        &self,
        pairs: &[Push],
        around: &Surroundings<'_>,
        constraints: usize,
    ) -> Option<(Vec<f64>, Vec<Vector3<f64>>)> {
        let known = self.known.as_ref().filter(|known| {
            known.updates == around.inverse.updates
                && known.held == around.held
                && known.constraints == constraints
        })?;
        let place = |pair: &Push| known.points.iter().position(|p| *p == (pair.tool, pair.number));
        let places: Vec<usize> = pairs.iter().map(place).collect::<Option<_>>()?;
        let k = known.points.len();
        let row = |i: usize| places.iter().map(move |j| known.entries[k * i + j]);
        let entries = places.iter().flat_map(|&i| row(i)).collect();
        Some((entries, places.iter().map(|&i| known.normals[i]).collect()))
    }

    /// Keeps the contacts of an equilibrium and their compliance.
    fn keep(
        &mut self,
        pairs: &[Push],
        touched: Option<ContactOutcome>,
        around: &Surroundings<'_>,
        constraints: usize,
    ) {
        self.pushes.clear();
        self.penetration = 0.0;
        let Some(touched) = touched else {
            self.compliance.clear();
            return;
        };
        let before = pairs.len();
        let pushing: Vec<usize> = (0..before).filter(|&i| touched.multipliers[i] > 0.0).collect();
        for &i in &pushing {
            let (force, normal) = (touched.multipliers[i], touched.normals[i]);
            self.pushes.push(Push { force, normal, ..pairs[i] });
        }
        self.penetration = touched.penetration;
        // A solve without iterations returns no compliance: the last one stays valid.
        if !touched.compliance.is_empty() {
            let entry = |i: &usize, j: &usize| touched.compliance[before * i + j];
            self.compliance =
                pushing.iter().flat_map(|i| pushing.iter().map(move |j| entry(i, j))).collect();
            self.known = Some(Known {
                updates: around.inverse.updates,
                held: around.held.to_vec(),
                constraints,
                points: pairs.iter().map(|pair| (pair.tool, pair.number)).collect(),
                normals: touched.shaped,
                entries: touched.compliance,
            });
        }
    }

    /// Notes the forces with which a step begins.
    pub fn begin(&mut self) {
        self.before.clone_from(&self.pushes);
    }

    /// Ends a step: sets how much forces have grown in it, if that may continue.
    pub fn end(&mut self, is_whole: bool) {
        for push in &mut self.pushes {
            let same = |old: &&Push| (old.tool, old.number) == (push.tool, push.number);
            let old = self.before.iter().find(same).map_or(0.0, |old| old.force);
            push.growth = if is_whole { push.force - old } else { 0.0 };
        }
    }

    /// Has pushes go on at the same material after the mesh has changed.
    pub fn follow(&mut self, tools: &[Box<dyn Tool>]) {
        for push in &mut self.pushes {
            let skin = tools[push.tool].surface_points();
            if let Some(point) = skin.and_then(|skin| skin.point(push.number)) {
                push.point = *point;
            }
        }
    }

    /// Whether any probe pushes.
    pub fn is_pressed(&self) -> bool {
        !self.pushes.is_empty()
    }

    /// Of every contact the tool and the number of the point, and the force on it, N.
    pub fn pushes(&self) -> impl Iterator<Item = ((usize, usize), Vector3<f64>)> {
        self.pushes.iter().map(|push| ((push.tool, push.number), push.force * push.normal))
    }

    /// Of every contact the tool, the point and the force on it, N.
    pub fn touching(&self) -> impl Iterator<Item = (usize, ElementPoint, Vector3<f64>)> {
        self.pushes.iter().map(|push| (push.tool, push.point, push.force * push.normal))
    }

    /// Adds the forces of all contacts to `loads`, by vertex number, N.
    pub fn add_loads(&self, loads: &mut [Vector3<f64>]) {
        for push in &self.pushes {
            for (&v, weight) in push.point.vertices.iter().zip(push.point.weights) {
                loads[v] += weight * push.force * push.normal;
            }
        }
    }

    /// Adds the forces of all contacts to `loads`.
    pub fn add_to(&self, loads: &mut Loads) {
        self.pushes.iter().for_each(|push| loads.add_point(&push.point, push.force * push.normal));
    }

    /// Force and torque about `reference` of a tool on the body, N and N m, the number of points it
    /// pushes and how deep the deepest is in any probe, m.
    pub fn of_tool(
        &self,
        tool: usize,
        reference: &Vector3<f64>,
        positions: &[Vector3<f64>],
    ) -> (Vector3<f64>, Vector3<f64>, usize, f64) {
        let (mut force, mut torque, mut count) = (Vector3::zeros(), Vector3::zeros(), 0);
        for push in self.pushes.iter().filter(|push| push.tool == tool) {
            let f = push.force * push.normal;
            force += f;
            torque += (push.point.position(positions) - reference).cross(&f);
            count += 1;
        }
        (force, torque, count, self.penetration)
    }

    /// Adds to `loads`, and to `forces` by vertex number, by how much contacts push more where the body
    /// moves by `moves` and the tool of `lead` by that, m, so that all of them stay.
    pub fn add_changes(
        &self,
        moves: &[Vector3<f64>],
        lead: Option<(usize, Vector3<f64>)>,
        forces: &mut [Vector3<f64>],
        loads: &mut Loads,
    ) {
        let lack = |push: &Push| {
            let lead = lead.filter(|lead| lead.0 == push.tool).map_or_else(Vector3::zeros, |l| l.1);
            push.normal.dot(&(lead - push.point.position(moves)))
        };
        let lacks = DVector::from_iterator(self.pushes.len(), self.pushes.iter().map(lack));
        let all: Vec<usize> = (0..self.pushes.len()).collect();
        let Some(growth) = self.factor(&all).map(|factor| factor.solve(&lacks)) else { return };
        for (push, growth) in self.pushes.iter().zip(growth.iter()) {
            let force = *growth * push.normal;
            loads.add_point(&push.point, force);
            for (&v, weight) in push.point.vertices.iter().zip(push.point.weights) {
                forces[v] += weight * force;
            }
        }
    }

    /// N Ĉ Nᵀ of some of the pushes, factored; none without contact or where it is not known.
    fn factor(&self, pushes: &[usize]) -> Option<Cholesky<f64, Dyn>> {
        let (k, n) = (self.pushes.len(), pushes.len());
        if n == 0 || self.compliance.len() != k * k {
            return None;
        }
        let mut w = DMatrix::from_fn(n, n, |i, j| self.compliance[k * pushes[i] + pushes[j]]);
        let largest = w.diagonal().max();
        for i in 0..n {
            w[(i, i)] += REGULAR * largest;
        }
        w.cholesky()
    }

    /// ∂force/∂(displacement) of a tool while its contacts stay: −N (N Ĉ Nᵀ)⁻¹ Nᵀ in the sense of
    /// [`of_tool`](Self::of_tool), N/m, symmetric negative; with the sign turned, the inverse of
    /// the compliance that the tool feels. Zero without contact.
    pub fn stiffness(&self, tool: usize) -> Matrix3<f64> {
        let mine = (0..self.pushes.len()).filter(|&i| self.pushes[i].tool == tool);
        let mine: Vec<usize> = mine.collect();
        let Some(factor) = self.factor(&mine) else { return Matrix3::zeros() };
        let normals = DMatrix::from_fn(mine.len(), 3, |i, axis| self.pushes[mine[i]].normal[axis]);
        let product = normals.transpose() * factor.solve(&normals);
        Matrix3::from_fn(|i, j| 0.5 * (product[(i, j)] + product[(j, i)]))
    }
}

fn push(tool: usize, number: usize, point: ElementPoint) -> Push {
    Push { tool, number, point, normal: Vector3::zeros(), force: 0.0, growth: 0.0 }
}

/// Calls `visit` with number, point and gap of all points within `reach` (m) of a probe.
fn each_within(
    around: &Surroundings<'_>,
    probing: &Probing,
    positions: &[Vector3<f64>],
    reach: f64,
    mut visit: impl FnMut(usize, &ElementPoint, f64),
) {
    let Some(skin) = around.tools[probing.tool].surface_points() else { return };
    let Sphere { centre, radius } = probing.sphere;
    skin.each_near(positions, &centre, radius + reach, |number, point| {
        let gap = (point.position(positions) - centre).norm() - radius;
        if gap <= reach {
            visit(number, point, gap);
        }
    });
}

/// The points that are deeper than `depth` and not among `pairs`.
fn deeper(
    around: &Surroundings<'_>,
    positions: &[Vector3<f64>],
    pairs: &[Push],
    depth: f64,
) -> Vec<Push> {
    let mut found = Vec::new();
    for probing in around.probing {
        let known = |number: usize| {
            pairs.iter().any(|pair| (pair.tool, pair.number) == (probing.tool, number))
        };
        each_within(around, probing, positions, 0.0, |number, point, gap| {
            if gap < -depth && !known(number) {
                found.push(push(probing.tool, number, *point));
            }
        });
    }
    found
}
