//! Where the tools of a run were, by its scene.

use nalgebra::Vector3;

use crate::SimError;
use crate::body::ScannerAxes;
use crate::scene::{ProbeEntry, Region, Shape, ToolEntry, Way};
use crate::tools::ToolPath;

/// Where a tool is over time, scanner RAS.
pub(super) struct ToolPlace {
    start_mm: Vector3<f64>,
    path: ToolPath,
}

impl ToolPlace {
    /// That of a grab, probe, pressure or load whose place is given in mm or in fractions of the body's box,
    /// which goes from `low` to `high`, mm; none of one in voxels, since a run does not keep how those lie.
    ///
    /// # Errors
    /// Those of a place that is not given in one way, or of the file of a path.
    pub fn of(
        entry: &ToolEntry,
        key: &str,
        [low, high]: [Vector3<f64>; 2],
    ) -> Result<Option<Self>, SimError> {
        let none = || ToolPath::new(Vec::new(), ScannerAxes::identity());
        // A path is in scanner axes.
        let read = |keys: &[_], csv: Option<&std::path::Path>| {
            ToolPath::read(keys, csv, ScannerAxes::identity())
        };
        let of_region = |region: &Region| -> Result<_, SimError> {
            Ok(match region.shape("scene", &format!("{key}.region"))? {
                Shape::Box(way, min, max) => (way, [0, 1, 2].map(|i| 0.5 * (min[i] + max[i]))),
                Shape::Sphere(way, centre, _) => (way, centre),
            })
        };
        let ((way, at), path) = match entry {
            ToolEntry::Grab(grab) => {
                (of_region(&grab.region)?, read(&grab.path, grab.path_csv.as_deref())?)
            }
            ToolEntry::Probe(probe @ ProbeEntry { path, path_csv, .. }) => {
                (probe.start("scene", key)?, read(path, path_csv.as_deref())?)
            }
            ToolEntry::Scalpel(one) => {
                (one.start("scene", key)?, read(&one.path, one.path_csv.as_deref())?)
            }
            ToolEntry::Resect(one) | ToolEntry::Coagulate(one) | ToolEntry::Suture(one) => {
                (one.start("scene", key)?, read(&one.path, one.path_csv.as_deref())?)
            }
            ToolEntry::Pressure(pressure) => (of_region(&pressure.region)?, none()),
            ToolEntry::Load(load) => match (&load.region, load.at_mm) {
                (_, Some(at)) => ((Way::Millimetres, at), none()),
                (Some(region), None) => (of_region(region)?, none()),
                (None, None) => return Ok(None),
            },
        };
        let at = Vector3::from(at);
        let start_mm = match way {
            Way::Millimetres => at,
            Way::Fractions => low + at.component_mul(&(high - low)),
            Way::Voxels => return Ok(None),
        };
        Ok(Some(Self { start_mm, path }))
    }

    /// At time `t` (s), mm.
    pub fn at(&self, t: f64) -> [f64; 3] {
        (self.start_mm + Vector3::from(self.path.pose(t).move_m) * 1e3).into()
    }
}
