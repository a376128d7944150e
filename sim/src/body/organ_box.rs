//! The box around a body, and regions in its fractions.

use nalgebra::Vector3;
use yawara_mesh::Lattice;
use yawara_mesh::volume::LabelVolume;

/// The bounding box of all non-void voxels, in solver coordinates (m).
#[derive(Clone, Copy, Debug)]
pub(crate) struct OrganBox {
    pub low: Vector3<f64>,
    pub high: Vector3<f64>,
}

impl OrganBox {
    pub fn of(volume: &LabelVolume) -> Option<Self> {
        let [low, high] = volume.bounding_box()?;
        let voxel = volume.grid().spacing_mm * 1e-3;
        let at = |v: [usize; 3], add: usize| Vector3::from_fn(|i, _| (v[i] + add) as f64 * voxel);
        Some(Self { low: at(low, 0), high: at(high, 1) })
    }

    /// Its edges, mm, to three digits after the point.
    pub fn size_mm(&self) -> [f64; 3] {
        (self.high - self.low).map(|edge| (edge * 1e6).round() / 1e3).into()
    }

    /// Its longest edge, mm.
    pub fn longest_mm(&self) -> f64 {
        (self.high - self.low).max() * 1e3
    }

    /// Where `x` lies on a grid of 2²⁰ points a side over the box, packed as a lattice key is.
    pub fn grid_key(&self, x: &Vector3<f64>) -> u64 {
        let size = self.high - self.low;
        let longest = size.max().max(f64::MIN_POSITIVE);
        let at = (x - self.low) * (f64::from(1u32 << 20) / longest);
        // Saturates: nothing lies outside the box.
        Lattice::key([at.x as i32, at.y as i32, at.z as i32].map(|c| c.max(0)))
    }

    /// Solver position of a point given in fractions of the box.
    pub fn at(&self, fraction: [f64; 3]) -> Vector3<f64> {
        let size = self.high - self.low;
        Vector3::from_fn(|i, _| self.low[i] + fraction[i] * size[i])
    }
}

/// A region in fractions of the organ's box.
#[derive(Clone, Debug)]
pub(crate) enum Zone {
    /// All points between two corners.
    Box { min: [f64; 3], max: [f64; 3] },
    /// All points near a centre, radius in m.
    Sphere { centre: [f64; 3], radius_m: f64 },
}

impl Zone {
    /// True where solver position `x` lies in it.
    pub fn contains(&self, organ: &OrganBox, x: &Vector3<f64>) -> bool {
        // Vertices that lie on the boundary in exact arithmetic belong to it.
        let slack = 1e-9 * (organ.high - organ.low).norm();
        match self {
            Self::Box { min, max } => {
                let (low, high) = (organ.at(*min), organ.at(*max));
                (0..3).all(|i| x[i] >= low[i] - slack && x[i] <= high[i] + slack)
            }
            Self::Sphere { centre, radius_m } => (x - organ.at(*centre)).norm() <= radius_m + slack,
        }
    }

    /// Solver position of its centre.
    pub fn centre(&self, organ: &OrganBox) -> Vector3<f64> {
        match self {
            Self::Box { min, max } => 0.5 * (organ.at(*min) + organ.at(*max)),
            Self::Sphere { centre, .. } => organ.at(*centre),
        }
    }
}
