//! Where the places of a scene are, in whichever way they are given.

use nalgebra::Vector3;

use super::axes::ScannerAxes;
use super::organ_box::{OrganBox, Zone};
use super::summary::ImageSummary;
use crate::error::SimError;
use crate::scene::{Region, Scene, Shape, Way};

/// Fractions are rounded to its inverse: a place given in mm or voxels then has the same numbers as
/// one given in fractions.
const FRACTION_STEPS: f64 = 1e12;

/// How a body lies in the scanner and in its image file.
#[derive(Clone, Debug)]
pub(crate) struct Places {
    /// The image or the mesh file, for messages.
    pub name: String,
    pub organ: OrganBox,
    pub axes: ScannerAxes,
    /// None of a body that is no image.
    pub voxels: Option<FileVoxels>,
}

/// How the voxels of an image file lie in solver axes, which are the file's but for order and sense.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FileVoxels {
    /// Solver axis i runs along the file's axis `axes[i].0`, backwards if `axes[i].1`.
    axes: [(usize, bool); 3],
    /// Voxels along the solver's axes.
    dims: Vector3<f64>,
    /// Their edges along those, m.
    edges: Vector3<f64>,
    /// The middle of the image, m.
    middle: Vector3<f64>,
}

impl FileVoxels {
    /// Those of an image before it was resampled, which keeps its middle.
    pub fn new(axes: [(usize, bool); 3], image: &ImageSummary) -> Self {
        let stored = image.stored_dims.map(|n| n as f64);
        let edges = if image.resampled { image.stored_voxel_mm } else { [image.voxel_mm; 3] };
        let used = Vector3::from(image.dims.map(|n| n as f64));
        Self {
            axes,
            dims: stored.into(),
            edges: Vector3::from(edges) * 1e-3,
            middle: 0.5e-3 * image.voxel_mm * used,
        }
    }

    /// Solver position of a place between the centres of voxels, which have whole numbers, m.
    fn position(&self, index: [f64; 3]) -> Vector3<f64> {
        Vector3::from_fn(|i, _| {
            let (axis, backwards) = self.axes[i];
            let from_middle = index[axis] - 0.5 * (self.dims[i] - 1.0);
            self.middle[i] + self.edges[i] * if backwards { -from_middle } else { from_middle }
        })
    }
}

impl Places {
    /// The regions of `[[fixed]]`.
    ///
    /// # Errors
    /// As [`Self::zone`].
    pub fn fixed(&self, scene: &Scene) -> Result<Vec<Zone>, SimError> {
        let numbered = scene.fixed.iter().enumerate();
        numbered.map(|(i, region)| self.zone(region, &format!("fixed[{i}]"))).collect()
    }

    /// A region in fractions of the body's box. A box in mm becomes the box around its corners along
    /// the solver's axes, one of voxels goes from the lower side of the first to the upper side of the
    /// last.
    ///
    /// # Errors
    /// [`SimError::MissingKey`] or [`SimError::Value`] that begins with the image and `key`: a place
    /// that is not given in one way, in voxels without an image, or a region in mm or voxels all of
    /// which lies outside of the body's box.
    pub fn zone(&self, region: &Region, key: &str) -> Result<Zone, SimError> {
        let (way, zone) = match region.shape(&self.name, key)? {
            Shape::Box(way, min, max) => {
                let half = if way == Way::Voxels { 0.5 } else { 0.0 };
                let ends = [min.map(|x| x - half), max.map(|x| x + half)];
                let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
                for corner in 0..8 {
                    let at = [0, 1, 2].map(|axis| ends[corner >> axis & 1][axis]);
                    let at = self.fractions(way, at, &format!("{key}.min"))?;
                    low = [0, 1, 2].map(|i| low[i].min(at[i]));
                    high = [0, 1, 2].map(|i| high[i].max(at[i]));
                }
                (way, Zone::Box { min: low, max: high })
            }
            Shape::Sphere(way, centre, radius_m) => {
                let centre = self.fractions(way, centre, &format!("{key}.centre"))?;
                (way, Zone::Sphere { centre, radius_m })
            }
        };
        if way != Way::Fractions && !self.meets_body(&zone) {
            return Err(self.outside(region, key, way));
        }
        Ok(zone)
    }

    /// Where a probe's centre is before it moves, solver axes, m; `key` is the probe's.
    ///
    /// # Errors
    /// As [`Self::zone`], but it may lie anywhere.
    pub fn start_of(
        &self,
        (way, at): (Way, [f64; 3]),
        key: &str,
    ) -> Result<Vector3<f64>, SimError> {
        Ok(self.organ.at(self.fractions(way, at, &format!("{key}.centre"))?))
    }

    /// A place in fractions of the body's box.
    fn fractions(&self, way: Way, at: [f64; 3], key: &str) -> Result<[f64; 3], SimError> {
        let x = match (way, self.voxels) {
            (Way::Fractions, _) => return Ok(at),
            (Way::Millimetres, _) => self.axes.to_solver(&Vector3::from(at)),
            (Way::Voxels, Some(voxels)) => voxels.position(at),
            (Way::Voxels, None) => {
                let (key, value) = (format!("{key}{}", way.suffix()), format!("{at:?}"));
                let want = "mm or fractions in its place: a mesh file has no voxels";
                return Err(SimError::value(&self.name, &key, value, want));
            }
        };
        let fraction = (x - self.organ.low).component_div(&(self.organ.high - self.organ.low));
        Ok(fraction.map(|f| (f * FRACTION_STEPS).round() / FRACTION_STEPS).into())
    }

    /// Whether any of a zone lies in the body's box.
    fn meets_body(&self, zone: &Zone) -> bool {
        let inside = |x: Vector3<f64>| x.sup(&self.organ.low).inf(&self.organ.high);
        let nearest = match zone {
            Zone::Box { min, max } => {
                return (0..3).all(|i| min[i] <= 1.0 && max[i] >= 0.0);
            }
            Zone::Sphere { centre, .. } => inside(self.organ.at(*centre)),
        };
        zone.contains(&self.organ, &nearest)
    }

    fn outside(&self, region: &Region, key: &str, way: Way) -> SimError {
        let name = if matches!(region, Region::Box { .. }) { "min" } else { "centre" };
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for corner in 0..8 {
            let at = self.organ.at([0, 1, 2].map(|axis| f64::from(corner >> axis & 1)));
            let at = self.axes.to_ras_mm(&at);
            low = [0, 1, 2].map(|i| low[i].min(at[i]));
            high = [0, 1, 2].map(|i| high[i].max(at[i]));
        }
        let [low, high] = [low, high].map(|x| x.map(|x| (x * 1e3).round() / 1e3));
        let key = format!("{key}.{name}{}", way.suffix());
        let want = format!(
            "a region that meets the body, whose box goes from {low:?} to {high:?} mm (right, \
             anterior, superior)"
        );
        SimError::value(&self.name, &key, "outside of the body", want)
    }
}
