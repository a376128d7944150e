//! Sizes and topology of a surface.

use nalgebra::Vector3;

use super::error::SurfaceError;
use super::surface::IsoSurface;
use crate::union_find::groups;

/// Area of triangles between `points`, in the squared unit of these. Cost: O(triangles).
///
/// # Panics
/// If a triangle has a corner that `points` do not.
pub fn area(triangles: &[[u32; 3]], points: &[Vector3<f64>]) -> f64 {
    let double = triangles.iter().map(|triangle| {
        let [a, b, c] = triangle.map(|v| points[v as usize]);
        (b - a).cross(&(c - a)).norm()
    });
    0.5 * double.sum::<f64>()
}

/// Volume that triangles between `points` enclose, in the cubed unit of these; positive where the normals point
/// outwards. Cost: O(triangles).
///
/// # Panics
/// As [`area`].
pub fn volume(triangles: &[[u32; 3]], points: &[Vector3<f64>]) -> f64 {
    // Measured from a point of the surface: far from the origin large terms would cancel.
    let origin = points.first().copied().unwrap_or_default();
    let six = triangles.iter().map(|triangle| {
        let [a, b, c] = triangle.map(|v| points[v as usize] - origin);
        a.dot(&b.cross(&c))
    });
    six.sum::<f64>() / 6.0
}

impl IsoSurface {
    /// Area, Σ |(b − a) × (c − a)| / 2, in the squared unit of `points`.
    ///
    /// `points`: one per surface vertex, from [`IsoSurface::positions`]. Cost: O(triangles).
    ///
    /// # Errors
    /// [`SurfaceError::EntryCount`].
    pub fn area(&self, points: &[Vector3<f64>]) -> Result<f64, SurfaceError> {
        self.check(points)?;
        Ok(area(&self.triangles, points))
    }

    /// Volume enclosed, Σ a · (b × c) / 6, in the cubed unit of `points`; positive where the
    /// normals point outwards. An open surface encloses none: the sum has no meaning then.
    ///
    /// `points`: one per surface vertex, from [`IsoSurface::positions`]. Cost: O(triangles).
    ///
    /// # Errors
    /// [`SurfaceError::EntryCount`].
    pub fn volume(&self, points: &[Vector3<f64>]) -> Result<f64, SurfaceError> {
        self.check(points)?;
        Ok(volume(&self.triangles, points))
    }

    fn check(&self, points: &[Vector3<f64>]) -> Result<(), SurfaceError> {
        let (found, want) = (points.len(), self.vertices.len());
        if found != want {
            return Err(SurfaceError::EntryCount { what: "points", found, want });
        }
        Ok(())
    }

    /// Euler characteristic V − E + F: 2 for each sphere, less 2 for each handle, where the
    /// surface is closed. Cost: O(n log n).
    pub fn euler_characteristic(&self) -> i64 {
        let mut edges: Vec<[u32; 2]> = self
            .triangles
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
            .map(|[a, b]| [a.min(b), a.max(b)])
            .collect();
        edges.sort_unstable();
        edges.dedup();
        self.vertices.len() as i64 - edges.len() as i64 + self.triangles.len() as i64
    }

    /// Number of pieces that share no vertex. Cost: O(n log n).
    pub fn component_count(&self) -> usize {
        let pairs = self.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c]]);
        groups(self.vertices.len(), pairs).len()
    }
}
