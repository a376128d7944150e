//! The vertices that tools hold in a step: where they go, and what follows them.

use nalgebra::Vector3;

use crate::body::{BodyState, Hold, Standing};
use crate::error::SimError;
use crate::inverse::{Constrained, InverseLink};
use crate::tools::Tool;

/// Which vertices tools hold, and the inverse with them fixed.
pub(super) struct Held<'a> {
    /// Vertex numbers.
    pub vertices: Vec<usize>,
    /// The tool that holds each of them.
    tools: Vec<usize>,
    pub constrained: Constrained<'a>,
    /// Whether a vertex is free to move, by number.
    pub free: Vec<bool>,
}

impl<'a> Held<'a> {
    pub fn new(state: &BodyState, inverse: &'a InverseLink) -> Result<Self, SimError> {
        let mut free = vec![false; state.positions.len()];
        let (mut vertices, mut tools) = (Vec::new(), Vec::new());
        for v in state.vertices() {
            match state.holds[v.index()] {
                Hold::Free => free[v.index()] = true,
                Hold::Fixed => {}
                Hold::Grabbed(tool) => {
                    vertices.push(v.index());
                    tools.push(tool);
                }
            }
        }
        Ok(Held { constrained: inverse.constrained(&vertices)?, vertices, tools, free })
    }

    /// Whether a tool holds any.
    pub fn is_by(&self, tool: usize) -> bool {
        self.tools.contains(&tool)
    }

    /// A first iterate with the held vertices at their targets, and the others moved along
    /// as in the linear body with its current rotations.
    pub fn drag(
        &self,
        state: &BodyState,
        tools: &[Box<dyn Tool>],
        t: f64,
    ) -> Result<Standing, SimError> {
        let mut moved = state.standing();
        if self.vertices.is_empty() {
            return Ok(moved);
        }
        let Standing { positions, pressures } = &mut moved;
        let rotations = state.body.vertex_rotations();
        let held = || self.vertices.iter().zip(&self.tools);
        let targets: Vec<Vector3<f64>> =
            held().map(|(&v, &tool)| tools[tool].target(&state.rest[v], t)).collect();
        let at_targets = || self.vertices.iter().zip(&targets);
        let moves: Vec<Vector3<f64>> = at_targets()
            .map(|(&v, target)| rotations[v].transpose() * (target - positions[v]))
            .collect();
        let m = state.body.unknowns_per_vertex();
        let mut drag = vec![0.0; m * positions.len()];
        self.constrained.drag(&moves, &mut drag)?;
        for (v, d) in drag.chunks_exact(m).enumerate() {
            positions[v] += rotations[v] * Vector3::from_column_slice(&d[..3]);
        }
        // Vertices that have come in since the last solve may have no pressure yet.
        for (q, d) in pressures.iter_mut().zip(drag.chunks_exact(m)) {
            *q += d[m - 1];
        }
        for (&v, target) in at_targets() {
            positions[v] = *target;
        }
        Ok(moved)
    }
}
