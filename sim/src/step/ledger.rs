//! What tools, loads, splits and merges do to the energy of a body.

use nalgebra::{Isometry3, Vector3};

use super::checkpoint::KeptLedger;
use super::contact::ContactState;
use super::equilibrium::StepSolver;
use super::refinement::{Exchange, Remeshed};
use super::slips::{Pair, Places, Slips};
use crate::body::{BodyState, ScannerAxes};
use crate::report::{EnergySummary, ToolReport};
use crate::tools::Tool;

/// Forces by vertex number, N; empty where there are none.
type Loads = Vec<Vector3<f64>>;

/// A tool at an equilibrium, solver axes: where it is and what it does to the body besides its loads.
#[derive(Clone, Copy, Default)]
struct Hand {
    pose: Isometry3<f64>,
    reference: Vector3<f64>,
    /// N, and about `reference`, N m.
    force: Vector3<f64>,
    torque: Vector3<f64>,
}

impl Hand {
    /// What it does, with its torque about `point`.
    fn about(&self, point: &Vector3<f64>) -> Pair {
        let about = self.torque - (point - self.reference).cross(&self.force);
        Pair { along: self.force, about }
    }

    /// ½ (f₀ + f₁)·Δx + ½ (τ₀ + τ₁)·Δθ of what has come from `before`, J.
    fn work_since(&self, before: &Self) -> f64 {
        let turn = (self.pose.rotation * before.pose.rotation.inverse()).scaled_axis();
        let moved = self.reference - before.reference;
        0.5 * (self.force + before.force).dot(&moved)
            + 0.5 * (self.torque + before.torque).dot(&turn)
    }
}

/// Follows the energy of a body from equilibrium to equilibrium.
pub(crate) struct Ledger {
    hands: Vec<Hand>,
    /// Of each tool, and of the weight.
    loads: Vec<Loads>,
    /// Where vertices were at the last equilibrium, m.
    from: Vec<Vector3<f64>>,
    /// What tools press and hold, before the mesh changes, and by how much it has moved then.
    places: Places,
    slips: Slips,
    sums: EnergySummary,
    /// What was stored when it was last measured, J, and what had been given until then.
    stored: f64,
    given: f64,
    /// Whether nothing has moved since.
    is_current: bool,
}

impl Ledger {
    /// Of a body at rest with so many tools.
    pub fn new(tools: usize) -> Self {
        Self {
            hands: vec![Hand::default(); tools],
            loads: Vec::new(),
            from: Vec::new(),
            places: Places::default(),
            slips: Slips::default(),
            sums: EnergySummary::default(),
            stored: 0.0,
            given: 0.0,
            is_current: true,
        }
    }

    /// The account so far.
    pub fn kept(&self) -> KeptLedger {
        let (points, means) = self.slips.kept();
        let hands = self.hands.iter().map(|hand| [hand.force.into(), hand.torque.into()]);
        KeptLedger {
            hands: hands.collect(),
            points,
            means,
            sums: self.sums,
            stored: self.stored,
            given: self.given,
            is_current: self.is_current,
        }
    }

    /// Of what was kept. Where tools are, and their loads, comes when the next step begins.
    pub fn resumed(kept: &KeptLedger) -> Self {
        let hand = |[force, torque]: &[[f64; 3]; 2]| Hand {
            force: (*force).into(),
            torque: (*torque).into(),
            ..Hand::default()
        };
        Self {
            hands: kept.hands.iter().map(hand).collect(),
            slips: Slips::resumed(&kept.points, &kept.means),
            sums: kept.sums,
            stored: kept.stored,
            given: kept.given,
            is_current: kept.is_current,
            ..Self::new(0)
        }
    }

    /// Another tool has come.
    pub fn add_tool(&mut self) {
        self.hands.push(Hand::default());
        self.loads.clear();
        self.is_current = false;
    }

    /// Begins a step: tools may have been led elsewhere since, and the mesh may be another.
    pub fn begin(&mut self, solver: &StepSolver, state: &BodyState, tools: &[Box<dyn Tool>]) {
        let t = solver.reached_s();
        self.is_current = false;
        self.from.clone_from(&state.positions);
        for (hand, tool) in self.hands.iter_mut().zip(tools) {
            (hand.pose, hand.reference) = (tool.pose(t), tool.reference(t));
        }
        if self.loads.is_empty() {
            self.loads = loads(solver, state, tools);
        }
    }

    /// Ends a step in which tools have come to do what `reports` say: enters their work there.
    pub fn end(
        &mut self,
        solver: &StepSolver,
        state: &BodyState,
        contact: &ContactState,
        tools: &[Box<dyn Tool>],
        axes: ScannerAxes,
        reports: &mut [ToolReport],
    ) {
        let t = solver.reached_s();
        let now = loads(solver, state, tools);
        let positions = &state.positions;
        let before = self.hands.clone();
        for (number, report) in reports.iter_mut().enumerate() {
            let mut hand = Hand {
                pose: tools[number].pose(t),
                reference: tools[number].reference(t),
                force: axes.to_solver_direction(&report.force_n.into()),
                torque: axes.to_solver_direction(&report.torque_n_m.into()),
            };
            for (x, load) in positions.iter().zip(&now[number]) {
                hand.force -= load;
                hand.torque -= (x - hand.reference).cross(load);
            }
            report.work_j = hand.work_since(&self.hands[number])
                + self.work_of_loads(number, &now[number], positions);
            self.sums.tools_work_j += report.work_j;
            self.hands[number] = hand;
        }
        let weight = tools.len();
        self.sums.weight_work_j += self.work_of_loads(weight, &now[weight], positions);
        let least = self.sums.tools_work_least_j.min(self.sums.tools_work_j);
        self.sums.tools_work_least_j = least;
        self.loads = now;
        let forces =
            |tool: usize, point: &_| [&before, &self.hands].map(|of| of[tool].about(point));
        let works = std::mem::take(&mut self.slips).works(contact, forces);
        works.into_iter().for_each(|work| self.sums.holds.add(work));
    }

    /// ½ Σ (f₀ + f₁)·Δx over the vertices, J.
    fn work_of_loads(&self, of: usize, now: &Loads, positions: &[Vector3<f64>]) -> f64 {
        let moves = || positions.iter().zip(&self.from).map(|(x, from)| x - from);
        let work = |loads: &Loads| loads.iter().zip(moves()).map(|(f, u)| f.dot(&u)).sum::<f64>();
        0.5 * (work(&self.loads[of]) + work(now))
    }

    /// Looks at what tools press and hold before the mesh changes.
    pub fn look(&mut self, solver: &StepSolver, state: &BodyState, tools: &[Box<dyn Tool>]) {
        self.places = Places::new(state, tools, solver.reached_s());
    }

    /// Takes the splits and merges of a step into account.
    pub fn remeshed(
        &mut self,
        remeshed: &Remeshed,
        solver: &StepSolver,
        state: &BodyState,
        contact: &ContactState,
        tools: &[Box<dyn Tool>],
    ) {
        if let Some(stored) = remeshed.stored_j {
            let given = self.sums.given_j();
            self.sums.close(given - self.given, stored - self.stored);
            (self.stored, self.given) = (stored, given);
            self.is_current = true;
        }
        let exchanges = &remeshed.exchanges;
        if exchanges.is_empty() {
            return;
        }
        // Merges come first. What acts on a vertex that goes acts on the ends of its edge from then
        // on; seen from the mesh after them, so it is with a vertex that has come, backwards.
        let mut works: Vec<(f64, f64)> = vec![(0.0, 0.0); exchanges.len()];
        let mut after = loads(solver, state, tools);
        for (of, loads) in self.loads.iter_mut().chain(&mut after).enumerate() {
            let is_before = of < tools.len() + 1;
            let is_weight = of % (tools.len() + 1) == tools.len();
            let mut on = |work: &mut (f64, f64), exchange: &Exchange| {
                let done = exchange.hand_on(loads);
                *if is_weight { &mut work.1 } else { &mut work.0 } += done;
            };
            let mut pairs = works.iter_mut().zip(exchanges);
            match is_before {
                true => {
                    pairs.filter(|(_, one)| !one.is_split).for_each(|(work, one)| on(work, one))
                }
                false => {
                    while let Some((work, one)) = pairs.next_back() {
                        if one.is_split {
                            on(work, one);
                        }
                    }
                }
            }
        }
        for (exchange, (by_tools, by_weight)) in exchanges.iter().zip(works) {
            self.sums.tools_work_j += by_tools;
            self.sums.weight_work_j += by_weight;
            let change = exchange.energy_j - by_tools - by_weight;
            if exchange.is_split {
                self.sums.splits.add(change);
            } else {
                self.sums.merges.add(change);
            }
        }
        let now = Places::new(state, tools, solver.reached_s());
        self.slips = self.places.slips(&now, state, contact, tools);
        self.stored += exchanges.iter().map(|exchange| exchange.energy_j).sum::<f64>();
        self.given = self.sums.given_j();
        self.loads.clear();
    }

    /// Takes into account that other labels have made the body store `change` J more.
    pub fn edited(&mut self, change: f64) {
        self.sums.edits.add(change);
        self.stored += change;
        self.given += change;
        self.is_current = false;
    }

    /// Points of the surface have other numbers from now on: by how much they had moved does not count.
    pub fn forget_points(&mut self) {
        self.slips.forget_points();
    }

    /// Everything so far.
    pub fn summary(&self, state: &BodyState) -> EnergySummary {
        let mut sums = self.sums;
        // Of elements that have just come in no rotation is of where the body is.
        let stored = if self.is_current { self.stored } else { state.energy_j() };
        sums.stored_j = stored;
        sums.dissipated_j = state.body.dissipated_j();
        sums.close(sums.given_j() - self.given, stored - self.stored);
        sums
    }
}

impl Exchange {
    /// The work of `loads` in the jump of the vertex, J; hands what acts on it on to the ends of its edge.
    pub(super) fn hand_on(&self, loads: &mut Loads) -> f64 {
        let Some(force) = loads.get_mut(self.vertex).map(std::mem::take) else { return 0.0 };
        self.edge.iter().for_each(|&end| loads[end] += 0.5 * force);
        force.dot(&self.jump)
    }
}

/// The loads of each tool, and the weight, where the body is.
fn loads(solver: &StepSolver, state: &BodyState, tools: &[Box<dyn Tool>]) -> Vec<Loads> {
    let t = solver.reached_s();
    let count = state.positions.len();
    let kept = |loads: Loads| match loads.iter().all(|f| f.norm_squared() == 0.0) {
        true => Vec::new(),
        false => loads,
    };
    let mut all = Vec::with_capacity(tools.len() + 1);
    for tool in tools {
        let mut loads = Vec::new();
        if tool.acts_at(t) {
            loads.resize(count, Vector3::zeros());
            tool.add_loads(state, t, &mut loads);
        }
        all.push(kept(loads));
    }
    all.push(kept(solver.weights(state, t)));
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two vertices that came one after the other, the second beside the first.
    #[test]
    fn what_acts_on_a_vertex_that_goes_acts_on_the_ends_of_its_edge() {
        let exchange = |vertex, edge, jump: [f64; 3]| Exchange {
            is_split: false,
            vertex,
            edge,
            jump: jump.into(),
            energy_j: 0.0,
        };
        let mut loads = vec![Vector3::zeros(); 5];
        (loads[3], loads[4]) = (Vector3::new(1.0, 0.0, 0.0), Vector3::new(0.0, 8.0, 0.0));
        let last = exchange(4, [3, 0], [0.0, 0.5, 0.0]).hand_on(&mut loads);
        let first = exchange(3, [1, 2], [0.25, 0.25, 0.0]).hand_on(&mut loads);
        // 8 N over ½ m, then (1, 4) N over (¼, ¼) m.
        assert_eq!([last, first], [4.0, 1.25]);
        let want = [[0.0, 4.0, 0.0], [0.5, 2.0, 0.0], [0.5, 2.0, 0.0], [0.0; 3], [0.0; 3]];
        assert_eq!(loads, want.map(Vector3::from));
        assert_eq!(exchange(9, [0, 1], [1.0; 3]).hand_on(&mut loads), 0.0);
    }

    #[test]
    fn a_hand_works_as_it_moves_and_turns_wherever_its_torque_is_taken() {
        let hand = |move_m: [f64; 3], turn: f64, force: f64, torque: f64| {
            let reference = Vector3::from(move_m) + Vector3::new(0.0, 2.0, 0.0);
            let pose = Isometry3::new(Vector3::from(move_m), Vector3::new(0.0, 0.0, turn));
            let (force, torque) = (Vector3::new(force, 0.0, 0.0), Vector3::new(0.0, 0.0, torque));
            Hand { pose, reference, force, torque }
        };
        let (before, now) = (hand([0.0; 3], 0.5, 1.0, 0.0), hand([0.25, 1.0, 0.0], 0.75, 3.0, 4.0));
        // ½ (1 + 3) N · ¼ m + ½ (0 + 4) N m · ¼.
        assert!((now.work_since(&before) - 1.0).abs() < 1e-15);
        // 1 N along x through (0, 2, 0) turns clockwise about what is below it.
        let about = before.about(&Vector3::new(5.0, 1.5, 0.0));
        assert_eq!((about.along.x, about.about), (1.0, Vector3::new(0.0, 0.0, -0.5)));
    }
}
