//! What forces on the body at rest meet.

use nalgebra::Vector3;
use yawara_corot::ElementPoint;
use yawara_inverse_update::Load;

use super::simulation::Simulation;
use crate::error::SimError;

/// Loads that are solved for at once.
const TOGETHER: usize = 32;

/// Up to so many rows their whole block of K⁻¹ is made: 72 MB.
const MOST_ROWS: usize = 3000;

impl Simulation {
    /// wᵀ K⁻¹ w of the body at rest for each load w, forces on points of the material: by how much these give way along
    /// themselves, m/N for a force of 1 N. Zero for a load that acts on nothing that may move.
    ///
    /// Cost: half a solve each where the maintainer can do that, for loads that act on neighbours together.
    /// # Errors
    /// [`SimError::Inverse`].
    pub(crate) fn softness(
        &self,
        loads: &[Vec<(ElementPoint, Vector3<f64>)>],
    ) -> Result<Vec<f64>, SimError> {
        let inverse = &self.body.inverse;
        let m = self.body.state.body.unknowns_per_vertex();
        let of = |load: &Vec<(ElementPoint, Vector3<f64>)>| -> Load {
            let mut sums = std::collections::BTreeMap::<usize, f64>::new();
            for (point, force) in load {
                for (&v, share) in point.vertices.iter().zip(point.weights) {
                    let Some(slot) = inverse.slot(v).filter(|_| self.body.state.is_free(v)) else {
                        continue;
                    };
                    for axis in 0..3 {
                        *sums.entry(m * slot + axis).or_default() += share * force[axis];
                    }
                }
            }
            sums.into_iter().collect()
        };
        let local: Vec<Load> = loads.iter().map(of).collect();
        let mut rows: Vec<usize> = local.iter().flatten().map(|one| one.0).collect();
        rows.sort_unstable();
        rows.dedup();
        if rows.len() < loads.len().min(MOST_ROWS) {
            return self.softness_by_rows(&rows, &local);
        }
        let mut order: Vec<usize> = (0..local.len()).collect();
        order.sort_by_key(|&i| local[i].first().map_or(0, |first| first.0));
        let mut softness = vec![0.0; loads.len()];
        for some in order.chunks(TOGETHER) {
            let together: Vec<Load> = some.iter().map(|&i| local[i].clone()).collect();
            let block = inverse.maintainer().compliance(&together)?;
            some.iter().enumerate().for_each(|(k, &i)| softness[i] = block[(k, k)]);
        }
        Ok(softness)
    }

    /// The same by half a solve for each of the rows that loads act on.
    fn softness_by_rows(&self, rows: &[usize], loads: &[Load]) -> Result<Vec<f64>, SimError> {
        let units: Vec<Load> = rows.iter().map(|&row| vec![(row, 1.0)]).collect();
        let block = self.body.inverse.maintainer().compliance(&units)?;
        let place = |row: usize| rows.partition_point(|other| *other < row);
        let softness = loads.iter().map(|load| {
            let load: Vec<(usize, f64)> = load.iter().map(|&(row, f)| (place(row), f)).collect();
            let pairs = load.iter().flat_map(|a| load.iter().map(move |b| (a, b)));
            pairs.map(|((i, f), (j, g))| f * g * block[(*i, *j)]).sum()
        });
        Ok(softness.collect())
    }
}
