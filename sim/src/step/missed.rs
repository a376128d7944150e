//! Where a body that finds no equilibrium is farthest from it.

use nalgebra::{Matrix3, Vector3};
use yawara_corot::{Problem, Tolerance};

use crate::body::BodyState;
use crate::report::Missed;

/// A tetrahedron whose two smaller principal stretches have a sum below this is as good as folded: at 0
/// its rotation is no longer unique.
const FOLDED: f64 = 0.1;

/// What is left of the forces on the vertices, N, by vertex number; zero on those that are held.
pub(super) fn unbalanced(
    mut problem: Problem<'_>,
    positions: &[Vector3<f64>],
    tolerance: &Tolerance,
) -> Vec<Vector3<f64>> {
    let mut internal = vec![Vector3::zeros(); positions.len()];
    let mut residual = vec![0.0; problem.rows()];
    problem.evaluate(positions, &mut internal, &mut residual, tolerance);
    let rows = residual.chunks_exact(problem.unknowns_per_vertex());
    rows.map(|row| Vector3::new(row[0], row[1], row[2])).collect()
}

/// The vertex with the largest of `forces`, with the largest label of what is around it; none
/// where all are zero or not finite.
pub(super) fn worst(state: &BodyState, forces: &[Vector3<f64>]) -> Option<Missed> {
    let sizes = forces.iter().map(Vector3::norm).enumerate();
    let finite = sizes.filter(|(_, size)| size.is_finite() && *size > 0.0);
    let (v, force_n) = finite.max_by(|a, b| a.1.total_cmp(&b.1))?;
    let around = state.body.elements().iter().filter(|element| element.vertices.contains(&v));
    let cells = around.map(|element| state.cell(element.tet));
    let label = cells.filter(|cell| !cell.is_void).map(|cell| cell.label).max().unwrap_or(0);
    let folded = state.body.elements().iter().filter(|element| {
        let is_void = state.cell(element.tet).is_void;
        !is_void && is_folded(&element.deformation_gradient(&state.positions))
    });
    let (place, is_linear) = (state.rest[v], state.body.law().name() == "linear");
    Some(Missed { place, label, force_n, folded: folded.count(), is_linear })
}

fn is_folded(gradient: &Matrix3<f64>) -> bool {
    let mut stretches = gradient.singular_values();
    stretches.as_mut_slice().sort_by(f64::total_cmp);
    gradient.determinant() <= 0.0 || stretches[0] + stretches[1] < FOLDED
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_flat_or_inside_out_is_folded() {
        let diagonal =
            |a: f64, b: f64, c: f64| is_folded(&Matrix3::from_diagonal(&[a, b, c].into()));
        assert!(!diagonal(1.0, 1.0, 1.0) && !diagonal(0.1, 3.0, 1.0));
        assert!(diagonal(0.04, 3.0, 0.04) && diagonal(-0.5, 1.0, 1.0));
    }
}
