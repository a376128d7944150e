//! What a simulation is made again from.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use yawara_mesh::Point;

use crate::body::Hold;
use crate::inverse::KeptInverse;
use crate::report::{EnergySummary, KeptStatistics};

/// All that the next steps of a simulation follow from, besides its scene: numbers of vertices and
/// tetrahedra are those of the mesh that is made again from the start by `splits`, one after the other.
///
/// [`Simulation::checkpoint`](crate::Simulation::checkpoint) makes it,
/// [`Simulation::resume`](crate::Simulation::resume) takes it; on disk a
/// [`RunDirectory`](crate::output::RunDirectory) has it. SI units, solver axes.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Checkpoint {
    /// How many tools there are.
    pub(super) tools: usize,
    /// Stages of the plan, and what was chosen for them.
    pub(super) plan: Vec<(String, String)>,
    pub(super) splits: Vec<Point>,
    /// Tools that began later, in the order in which they came.
    pub(super) came: Vec<usize>,
    pub(super) vertices: KeptVertices,
    pub(super) tets: KeptTets,
    /// Of each grip place and turn (i, j, k, w).
    pub(super) poses: Vec<([f64; 3], [f64; 4])>,
    pub(super) refiner: Option<KeptRefiner>,
    pub(super) solver: KeptSolver,
    pub(super) contact: KeptContact,
    pub(super) ledger: KeptLedger,
    pub(super) inverse: KeptInverse,
    pub(super) support: [f64; 3],
    pub(super) statistics: KeptStatistics,
}

impl Checkpoint {
    /// The steps that had been made.
    pub fn steps(&self) -> usize {
        self.statistics.steps()
    }

    /// Whether all that is told by vertex, tetrahedron, grip and tool is told of this many, vertices numbered below
    /// `capacity`.
    pub(super) fn is_of(&self, [vertices, capacity, tets, grips]: [usize; 4]) -> bool {
        let of = &self.vertices;
        let fields = [&of.positions, &of.velocities, &of.accelerations].map(Vec::len);
        let scalars = [&of.pressures, &of.pressure_rates, &of.pressure_bends].map(Vec::len);
        let KeptTets { rotations, law } = &self.tets;
        let KeptSolver { tool_loads, fading, easing: (_, eased), grips: held, .. } = &self.solver;
        let mut forces = [tool_loads, fading, eased].into_iter().chain(&held.forces).flatten();
        let leaving = self.refiner.as_ref().map_or(&[][..], |refiner| &refiner.leaving);
        let mut numbers = held.held.iter().map(|(number, _)| number).chain(&held.free);
        let holds = [of.holds.len()];
        let mut lengths = fields.iter().chain(&scalars).chain(&holds);
        lengths.all(|length| *length == vertices)
            && rotations.len() == tets
            && (law.is_empty() || law.len() == tets)
            && self.poses.len() == grips
            && forces.all(|(v, _)| *v < capacity)
            && leaving.iter().all(|v| *v < capacity)
            && numbers.all(|number| *number < grips)
            && self.contact.pushes.iter().all(|push| push.tool < self.tools)
            && self.ledger.hands.len() == self.tools
    }
}

/// By vertex, ascending numbers.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct KeptVertices {
    pub holds: Vec<Hold>,
    pub positions: Vec<[f64; 3]>,
    pub velocities: Vec<[f64; 3]>,
    pub accelerations: Vec<[f64; 3]>,
    pub pressures: Vec<f64>,
    pub pressure_rates: Vec<f64>,
    pub pressure_bends: Vec<f64>,
}

/// By tetrahedron, in the order of the mesh made again.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct KeptTets {
    /// By columns.
    pub rotations: Vec<[[f64; 3]; 3]>,
    /// State of the law, and σ − D ε̃, Pa; nothing under a law without states.
    pub law: Vec<(Vec<f64>, [f64; 6])>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct KeptRefiner {
    /// By vertex, ascending numbers.
    pub born: Vec<usize>,
    /// By tetrahedron, in the order of the mesh made again.
    pub measured: Vec<f64>,
    pub most_energy: f64,
    pub most_goal: f64,
    pub waiting: Vec<(Point, f64)>,
    pub leaving: Vec<usize>,
}

/// By number of a vertex its number in the mesh made again, none of those that are gone.
pub(crate) struct Numbers(Vec<Option<usize>>);

impl Numbers {
    pub fn new(numbers: Vec<Option<usize>>) -> Self {
        Self(numbers)
    }

    pub fn of(&self, vertex: usize) -> Option<usize> {
        self.0.get(vertex).copied().flatten()
    }

    /// Forces on vertices, those on vertices that are gone left out.
    pub fn forces<'a>(
        &self,
        forces: impl IntoIterator<Item = (usize, &'a Vector3<f64>)>,
    ) -> KeptForces {
        let kept = forces.into_iter().filter_map(|(v, force)| Some((self.of(v)?, (*force).into())));
        kept.collect()
    }
}

/// Vertex numbers and forces, N.
pub(crate) type KeptForces = Vec<(usize, [f64; 3])>;

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct KeptSolver {
    /// The move of each tool that holds or presses in the last step, m, and its turn, rad.
    pub moves: Vec<(usize, [f64; 6])>,
    /// Steps since the mesh or what it is made of changed.
    pub steady: usize,
    pub tool_loads: KeptForces,
    pub fading: KeptForces,
    /// In how many steps what splits and merges left unbalanced is gone, and the loads of it.
    pub easing: (usize, KeptForces),
    pub grips: KeptGrips,
    pub reached_s: f64,
    /// Length of parts, s, and how many have converged since it changed.
    pub pace: (f64, usize),
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct KeptGrips {
    /// Those that constraints hold, with the first of their rows, and their forces.
    pub held: Vec<(usize, usize)>,
    pub forces: Vec<KeptForces>,
    /// Those that have let go.
    pub free: Vec<usize>,
}

/// A point that a probe pushes.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct KeptPush {
    pub tool: usize,
    pub number: usize,
    pub normal: [f64; 3],
    pub force: f64,
    pub growth: f64,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct KeptContact {
    pub pushes: Vec<KeptPush>,
    /// m/N, by rows.
    pub compliance: Vec<f64>,
    pub penetration: f64,
}

/// By tool and number of a point how far it has moved, and its force.
pub(crate) type KeptPoint = ((usize, usize), [[f64; 3]; 2]);

/// Of a tool what a mean of material has moved and turned, and where it was.
pub(crate) type KeptMean = (usize, [[f64; 3]; 2], [f64; 3]);

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct KeptLedger {
    /// Force and torque of each tool.
    pub hands: Vec<[[f64; 3]; 2]>,
    pub points: Vec<KeptPoint>,
    pub means: Vec<KeptMean>,
    pub sums: EnergySummary,
    pub stored: f64,
    pub given: f64,
    pub is_current: bool,
}
