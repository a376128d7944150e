//! What a body does in a run, by the same points on every mesh, and how far two runs are apart.

use nalgebra::Vector3;
use yawara::{Probe, Simulation};
use yawara_mesh::geometry::signed_volume;

use crate::error::{BenchError, Result};

/// A run as it is compared: displacements of fixed points, the tools' force and the body's volume
/// after every step.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Path {
    pub level: u8,
    /// Rest positions of the points, m.
    pub rest: Vec<Vector3<f64>>,
    /// Step by step, point by point, m.
    pub displacements: Vec<Vector3<f64>>,
    /// Step by step, N.
    pub forces: Vec<Vector3<f64>>,
    /// Step by step, m³.
    pub volumes: Vec<f64>,
}

/// Volume of the tetrahedra at `x`, positive as they are at rest.
pub(crate) fn volume(probe: &Probe, x: &[Vector3<f64>]) -> f64 {
    let rest = probe.rest();
    let one = |tet: &[u32; 4]| {
        let sign = signed_volume(&tet.map(|v| rest[v as usize])).signum();
        sign * signed_volume(&tet.map(|v| x[v as usize]))
    };
    probe.tets().iter().map(one).sum()
}

impl Path {
    /// Nothing yet, of the points of `probe`.
    pub fn of(probe: &Probe, level: u8) -> Self {
        Self { level, rest: probe.rest().to_vec(), ..Self::default() }
    }

    /// Adds the step that `simulation` has just made, with its force.
    pub fn push(
        &mut self,
        simulation: &Simulation,
        probe: &mut Probe,
        force: [f64; 3],
    ) -> Result<()> {
        let now = simulation.probe_positions(probe)?;
        self.displacements.extend(now.iter().zip(&self.rest).map(|(x, rest)| x - rest));
        self.forces.push(force.into());
        self.volumes.push(volume(probe, &now));
        Ok(())
    }
}

/// The distance of a run from another, gathered step by step.
pub(crate) struct Distance<'a> {
    from: &'a Path,
    step: usize,
    /// Σ‖u − u'‖², Σ‖u'‖² over points and steps; the same of forces.
    displacement: [f64; 2],
    force: [f64; 2],
    /// Largest |V − V'|, and the volume at rest.
    volume: [f64; 2],
}

impl<'a> Distance<'a> {
    /// Of a run with the points of `probe` from `path`.
    pub fn from(path: &'a Path, probe: &Probe) -> Result<Self> {
        if probe.rest() != path.rest {
            let (got, want) = (probe.rest().len(), path.rest.len());
            return Err(BenchError::OtherPoints { got, want, level: path.level });
        }
        let volume = [0.0, volume(probe, probe.rest())];
        Ok(Self { from: path, step: 0, displacement: [0.0; 2], force: [0.0; 2], volume })
    }

    /// Adds a step: positions `x` of the points, the tools' force.
    pub fn add(&mut self, probe: &Probe, x: &[Vector3<f64>], force: [f64; 3]) {
        let (Some(force_there), Some(volume_there)) =
            (self.from.forces.get(self.step), self.from.volumes.get(self.step))
        else {
            return;
        };
        let off = (volume(probe, x) - volume_there).abs();
        // A NaN must stay visible: `max` would drop it.
        if !(off <= self.volume[0]) {
            self.volume[0] = off;
        }
        let points = self.from.rest.len();
        let there = &self.from.displacements[points * self.step..points * (self.step + 1)];
        for ((x, rest), u) in x.iter().zip(&self.from.rest).zip(there) {
            self.displacement[0] += (x - rest - u).norm_squared();
            self.displacement[1] += u.norm_squared();
        }
        self.force[0] += (Vector3::from(force) - force_there).norm_squared();
        self.force[1] += force_there.norm_squared();
        self.step += 1;
    }

    /// √(Σ‖u − u'‖² / Σ‖u'‖²) over all points and steps, √(Σ‖f − f'‖² / Σ‖f'‖²) over all steps, and
    /// the largest |V − V'| of all steps over the volume at rest.
    pub fn errors(&self) -> [f64; 3] {
        let [u, f, v] = [self.displacement, self.force, self.volume].map(|[error, of]| error / of);
        [u.sqrt(), f.sqrt(), v]
    }
}
