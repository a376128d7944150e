//! Positions of a detail mesh while the active mesh moves: only what is asked for, and of that
//! only what has moved.

use nalgebra::Vector3;
use yawara_mesh::{BisectionForest, Point, VertexId};

use crate::detail::{DetailMesh, RotationOf};
use crate::error::EmbedError;

/// The positions of some vertices of a [`DetailMesh`], kept from call to call.
///
/// A position is computed again where one that it depends on has changed, or where its vertex came
/// into or went out of the active mesh; the result is that of a fresh start, bit for bit.
pub struct Follower {
    /// By vertex number of the detail forest: asked for.
    wanted: Vec<bool>,
    positions: Vec<Vector3<f64>>,
    /// Whether the position is that of the last call, and was taken from the active mesh.
    state: Vec<State>,
    changed: Vec<bool>,
    evaluated: usize,
}

#[derive(Clone, Copy, PartialEq)]
enum State {
    Unknown,
    Active,
    Embedded,
}

impl Follower {
    /// Asks for the positions of `wanted`, vertices of the detail forest. Cost: O(n).
    pub fn new(mesh: &DetailMesh, wanted: impl IntoIterator<Item = VertexId>) -> Self {
        let n = mesh.forest().vertex_capacity();
        let mut flags = vec![false; n];
        wanted.into_iter().for_each(|v| flags[v.index()] = true);
        Self {
            wanted: flags,
            positions: vec![Vector3::zeros(); n],
            state: vec![State::Unknown; n],
            changed: vec![false; n],
            evaluated: 0,
        }
    }

    /// Brings the positions up to those `x` (m) of `active` (in its own numbers). `mesh` is the
    /// one that this was made for.
    ///
    /// Cost: a look at every vertex that is asked for or depended on; arithmetic only where
    /// something has moved, [`evaluated`](Self::evaluated).
    /// # Errors
    /// As [`DetailMesh::positions`], and [`EmbedError::PositionCount`] for another detail mesh;
    /// nothing has changed then.
    pub fn follow(
        &mut self,
        mesh: &DetailMesh,
        active: &BisectionForest,
        x: &[Vector3<f64>],
        rotation: RotationOf<'_>,
    ) -> Result<&[Vector3<f64>], EmbedError> {
        let (found, want) = (self.positions.len(), mesh.forest().vertex_capacity());
        if found != want {
            return Err(EmbedError::PositionCount { found, want });
        }
        let unit = check(mesh.forest(), active, x)?;
        let vertex_at = |p: Point| {
            let on_coarse = p.iter().all(|c| c % unit == 0);
            on_coarse.then(|| active.vertex_at(p.map(|c| c / unit))).flatten()
        };
        // From fine to coarse: what the vertices asked for depend on, down to active ones.
        let mut needed = self.wanted.clone();
        let mut sources = vec![None; mesh.steps().len()];
        for (step, source) in mesh.steps().iter().zip(&mut sources).rev() {
            if needed[step.vertex.index()] {
                *source = vertex_at(mesh.forest().point(step.vertex));
                if source.is_none() {
                    mesh.each_input(step, |v| needed[v.index()] = true);
                }
            }
        }
        self.evaluated = 0;
        for (step, source) in mesh.steps().iter().zip(sources) {
            let at = step.vertex.index();
            if !needed[at] {
                self.state[at] = State::Unknown;
                continue;
            }
            let (position, state) = match source {
                Some(v) => (x[v.index()], State::Active),
                None => {
                    let mut stale = self.state[at] != State::Embedded;
                    mesh.each_input(step, |v| stale |= self.changed[v.index()]);
                    if !stale {
                        self.changed[at] = false;
                        continue;
                    }
                    self.evaluated += 1;
                    (mesh.place(step, &self.positions, rotation), State::Embedded)
                }
            };
            self.changed[at] =
                self.state[at] == State::Unknown || !same_bits(&position, &self.positions[at]);
            self.positions[at] = position;
            self.state[at] = state;
        }
        Ok(&self.positions)
    }

    /// The positions of the last call by vertex number of the detail forest, m; zero where none
    /// was asked for.
    pub fn positions(&self) -> &[Vector3<f64>] {
        &self.positions
    }

    /// How many positions the last call computed.
    pub fn evaluated(&self) -> usize {
        self.evaluated
    }

    pub(crate) fn into_positions(self) -> Vec<Vector3<f64>> {
        self.positions
    }
}

fn same_bits(a: &Vector3<f64>, b: &Vector3<f64>) -> bool {
    a.iter().zip(b.iter()).all(|(a, b)| a.to_bits() == b.to_bits())
}

/// Lattice units of the detail forest per unit of `active`.
fn check(
    detail: &BisectionForest,
    active: &BisectionForest,
    x: &[Vector3<f64>],
) -> Result<i32, EmbedError> {
    let (coarse, fine) = (active.domain().lattice(), detail.domain().lattice());
    if coarse.cells != fine.cells || coarse.units > fine.units {
        let (found, found_units) = (coarse.cells, coarse.units);
        let (want, want_units) = (fine.cells, fine.units);
        return Err(EmbedError::OtherLattice { found, found_units, want, want_units });
    }
    if x.len() < active.vertex_capacity() {
        let (found, want) = (x.len(), active.vertex_capacity());
        return Err(EmbedError::PositionCount { found, want });
    }
    Ok(fine.units / coarse.units)
}
