//! The voxels of a body as a page shows them on a cut: labels, and grey values of a scan.

use std::path::Path;

use nalgebra::Vector3;
use yawara_mesh::image::read_intensities_with;
use yawara_mesh::volume::{Grid, IntensityVolume, LabelVolume};

use crate::SimError;
use crate::scene::Scene;

/// Voxels that a page gets at most; of larger bodies each second, third, … along every axis.
const MOST: usize = 1 << 21;

/// The part of the body's grey values that is darker than the darkest shade, and lighter than the lightest.
const BEYOND: f64 = 0.01;

/// The voxels of the box around a body.
#[derive(Debug, PartialEq)]
pub(super) struct Voxels {
    /// Along the axes of the image, the first fastest.
    pub dims: [usize; 3],
    /// Rows of the affine map from rest, scanner RAS mm, to voxels: voxel i is what comes to i..i + 1.
    pub to_voxels: [[f32; 4]; 3],
    /// 0 in void, else 1 + the number of the surface in whose colour the label is shown.
    pub labels: Vec<u8>,
    pub grey: Option<Grey>,
}

/// Grey values at the same voxels.
#[derive(Debug, PartialEq)]
pub(super) struct Grey {
    pub shades: Vec<u8>,
    /// What shades 0 and 255 stand for, in the scan's unit.
    pub range: [f32; 2],
}

/// The scan that a page shows: the file, or what the labels of the scene are made of; none else.
///
/// # Errors
/// [`SimError`] of a file that can't be read.
pub(super) fn scan(
    scene: &Scene,
    grey: Option<&Path>,
) -> Result<Option<IntensityVolume>, SimError> {
    if let Some(path) = grey {
        return Ok(Some(read_intensities_with(path, None)?.0));
    }
    match &scene.image.path {
        Some(path) if scene.reads_intensities() => {
            let (image, _) = read_intensities_with(path, scene.image.spacing())?;
            Ok(Some(image.scaled(scene.image.unit_mm())?))
        }
        _ => Ok(None),
    }
}

impl Voxels {
    /// Those of a volume whose labels are shown in the colours of the surfaces `shown`, the first of which is the
    /// skin: labels that have no other surface are shown as that. None of a volume that is all void.
    ///
    /// # Errors
    /// [`SimError::Value`] if no voxel of the body is in the scan.
    pub fn of(
        volume: &LabelVolume,
        shown: &[i64],
        scan: Option<&IntensityVolume>,
    ) -> Result<Option<Self>, SimError> {
        let Some([low, high]) = volume.bounding_box() else { return Ok(None) };
        let size = [0, 1, 2].map(|i| high[i] + 1 - low[i]);
        let count = |step: usize| size.map(|n| n.div_ceil(step)).iter().product::<usize>();
        let step = (1..).find(|&step| count(step) <= MOST).unwrap_or(1);
        let dims = size.map(|n| n.div_ceil(step));
        let grid = volume.grid();
        let colour = |value: &i64| match value {
            0 => 0,
            _ => 1 + shown.iter().skip(1).position(|one| one == value).map_or(0, |at| at + 1),
        };
        let colours: Vec<u8> = volume.values().iter().map(|v| colour(v).min(255) as u8).collect();
        let mut labels = Vec::with_capacity(count(step));
        let mut places = Vec::with_capacity(count(step));
        for z in 0..dims[2] {
            for y in 0..dims[1] {
                for x in 0..dims[0] {
                    // The voxel in the middle of those that it stands for.
                    let mut at = [x, y, z];
                    (0..3).for_each(|i| at[i] = (low[i] + step * at[i] + step / 2).min(high[i]));
                    labels.push(colours[usize::from(volume.get(at[0], at[1], at[2]))]);
                    let local = at.map(|i| (i as f64 + 0.5) * grid.spacing_mm * 1e-3);
                    places.push(grid.to_ras_mm(local.into()));
                }
            }
        }
        let grey = scan.map(|scan| Grey::of(scan, &places, &labels)).transpose()?;
        let turn = grid.rotation.transpose() / (grid.spacing_mm * step as f64);
        let off = -turn * grid.origin_mm - Vector3::from(low.map(|x| x as f64 / step as f64));
        let row = |i: usize| [turn[(i, 0)], turn[(i, 1)], turn[(i, 2)], off[i]].map(|x| x as f32);
        Ok(Some(Self { dims, to_voxels: [0, 1, 2].map(row), labels, grey }))
    }
}

impl Grey {
    fn of(
        scan: &IntensityVolume,
        places: &[Vector3<f64>],
        labels: &[u8],
    ) -> Result<Self, SimError> {
        let values: Vec<Option<f32>> = places.iter().map(|at| value_at(scan, at)).collect();
        let in_body = values.iter().zip(labels).filter(|(_, label)| **label > 0);
        let mut all: Vec<f32> = in_body.filter_map(|(value, _)| *value).collect();
        if all.is_empty() {
            let Grid { dims, origin_mm, .. } = scan.grid();
            let value = format!("a scan of {dims:?} voxels from {:?} mm on", origin_mm.as_slice());
            let want = "one in which the body lies";
            return Err(SimError::value("yawara view", "--grey", value, want));
        }
        let beyond = (BEYOND * all.len() as f64) as usize;
        let last = all.len() - 1;
        let (_, low, _) = all.select_nth_unstable_by(beyond, f32::total_cmp);
        let low = *low;
        let (_, high, _) = all.select_nth_unstable_by(last - beyond, f32::total_cmp);
        let range = [low, *high];
        let width = (range[1] - range[0]).max(f32::MIN_POSITIVE);
        // A cast saturates; what is not in the scan is as dark as can be.
        let shade = |value: &Option<f32>| {
            value.map_or(0, |value| (255.0 * (value - range[0]) / width).round() as u8)
        };
        Ok(Self { shades: values.iter().map(shade).collect(), range })
    }
}

/// The value of the voxel that a place (scanner RAS, mm) is in.
fn value_at(scan: &IntensityVolume, at: &Vector3<f64>) -> Option<f32> {
    let Grid { spacing_mm, rotation, origin_mm, .. } = scan.grid();
    let local = (rotation.tr_mul(&(at - origin_mm)) / *spacing_mm).map(f64::floor);
    if local.iter().any(|x| *x < 0.0) {
        return None;
    }
    let [x, y, z] = [local.x, local.y, local.z].map(|x| x as usize);
    scan.get(x, y, z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    /// A body of two labels that fills a part of an oblique image, and a scan on another grid that has x along the first
    /// axis of scanner RAS in mm.
    fn body() -> (LabelVolume, IntensityVolume) {
        let rotation = *Rotation3::from_axis_angle(&Vector3::z_axis(), 0.3).matrix();
        let grid =
            Grid { rotation, origin_mm: [5.0, -3.0, 2.0].into(), ..Grid::centred([8, 7, 6], 2.0) };
        let inside = |x: usize, y: usize, z: usize| (2..7).contains(&x) && y > 1 && z < 5;
        let mut original = Vec::new();
        for (z, y, x) in
            (0..6).flat_map(|z| (0..7).flat_map(move |y| (0..8).map(move |x| (z, y, x))))
        {
            original.push(if inside(x, y, z) { [4, 9][usize::from(x > 4)] } else { 0 });
        }
        let labels = LabelVolume::from_original(grid, original.iter().copied()).unwrap();
        let of_scan = Grid::centred([60, 60, 60], 1.0);
        let values = (0..60 * 60 * 60).map(|at| (at % 60) as f32 - 29.5).collect();
        (labels, IntensityVolume::new(of_scan, values).unwrap())
    }

    #[test]
    fn a_place_at_rest_finds_its_label_and_its_grey_value() {
        let (volume, scan) = body();
        let voxels = Voxels::of(&volume, &[0, 9], Some(&scan)).unwrap().unwrap();
        assert_eq!(voxels.dims, [5, 5, 5]);
        let grid = volume.grid();
        let Grey { shades, range } = voxels.grey.as_ref().unwrap();
        for (x, y, z) in [(2, 2, 0), (4, 3, 1), (5, 6, 4), (6, 4, 2)] {
            let local = Vector3::new(x as f64 + 0.4, y as f64 + 0.5, z as f64 + 0.7) * 2e-3;
            let at = grid.to_ras_mm(local);
            let place = voxels.to_voxels.map(|[a, b, c, d]| {
                (f64::from(a) * at.x + f64::from(b) * at.y + f64::from(c) * at.z + f64::from(d))
                    .floor()
            });
            assert_eq!(place, [x - 2, y - 2, z].map(|x| x as f64));
            let index = place[0] as usize + 5 * (place[1] as usize + 5 * place[2] as usize);
            // The first surface is the skin, of which label 4 is.
            assert_eq!(voxels.labels[index], if x > 4 { 2 } else { 1 });
            let middle = grid.to_ras_mm(local.map(|x| ((x * 500.0).floor() + 0.5) * 2e-3));
            let shown = range[0] + f32::from(shades[index]) / 255.0 * (range[1] - range[0]);
            assert!((f64::from(shown) - middle.x).abs() < 1.0, "{shown} for {}", middle.x);
        }
    }

    #[test]
    fn a_scan_of_another_place_is_refused() {
        let (volume, scan) = body();
        let far = Grid { origin_mm: [900.0, 0.0, 0.0].into(), ..scan.grid().clone() };
        let far = IntensityVolume::new(far, scan.values().to_vec()).unwrap();
        let error = Voxels::of(&volume, &[0], Some(&far)).unwrap_err().to_string();
        assert!(error.contains("--grey is a scan of [60, 60, 60] voxels from [900"), "{error}");
        assert_eq!(Voxels::of(&volume, &[0], None).unwrap().unwrap().grey, None);
    }

    #[test]
    fn of_a_large_body_each_second_voxel_is_shown() {
        let dims = [200, 150, 140];
        let volume = LabelVolume::from_original(
            Grid::centred(dims, 0.5),
            (0..dims.iter().product()).map(|at: usize| i64::from(at % 200 < 100) + 1),
        );
        let voxels = Voxels::of(&volume.unwrap(), &[0, 2], None).unwrap().unwrap();
        assert_eq!(voxels.dims, [100, 75, 70]);
        assert_eq!(voxels.labels.len(), 100 * 75 * 70);
        // Row by row along x: the first half is of label 2.
        assert_eq!((voxels.labels[49], voxels.labels[50]), (2, 1));
        // A voxel of the page is 1 mm.
        assert_eq!(voxels.to_voxels[0], [1.0, 0.0, 0.0, 50.0]);
    }
}
