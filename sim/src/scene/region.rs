//! Regions, and the three ways in which a scene gives a place.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::SimError;

/// A region at rest. Its corners or its centre are given in one of three ways: as fractions of the
/// organ's bounding box along right, anterior, superior (0 is the low side, 1 the high side), in
/// scanner RAS mm, or as indices of voxels of the image file, along its axes and counted from 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "shape", rename_all = "snake_case", deny_unknown_fields)]
pub enum Region {
    /// All points between two corners.
    Box {
        /// Low corner, fractions.
        #[serde(skip_serializing_if = "Option::is_none")]
        min: Option<[f64; 3]>,
        /// High corner, fractions.
        #[serde(skip_serializing_if = "Option::is_none")]
        max: Option<[f64; 3]>,
        /// Low corner, mm.
        #[serde(skip_serializing_if = "Option::is_none")]
        min_mm: Option<[f64; 3]>,
        /// High corner, mm.
        #[serde(skip_serializing_if = "Option::is_none")]
        max_mm: Option<[f64; 3]>,
        /// First voxel along each axis of the file: the box begins at its lower side.
        #[serde(skip_serializing_if = "Option::is_none")]
        min_voxel: Option<[f64; 3]>,
        /// Last voxel along each axis of the file: the box ends at its upper side.
        #[serde(skip_serializing_if = "Option::is_none")]
        max_voxel: Option<[f64; 3]>,
    },
    /// All points near a centre.
    Sphere {
        /// Centre, fractions.
        #[serde(skip_serializing_if = "Option::is_none")]
        centre: Option<[f64; 3]>,
        /// Centre, mm.
        #[serde(skip_serializing_if = "Option::is_none")]
        centre_mm: Option<[f64; 3]>,
        /// Centre in voxels, whose centres have whole numbers.
        #[serde(skip_serializing_if = "Option::is_none")]
        centre_voxel: Option<[f64; 3]>,
        /// Radius, m.
        radius_m: f64,
    },
}

impl Region {
    /// The box between two corners, fractions.
    pub fn between(min: [f64; 3], max: [f64; 3]) -> Self {
        let (min_mm, max_mm, min_voxel, max_voxel) = (None, None, None, None);
        Self::Box { min: Some(min), max: Some(max), min_mm, max_mm, min_voxel, max_voxel }
    }

    /// The ball around a centre (fractions) of radius `radius_m`, m.
    pub fn around(centre: [f64; 3], radius_m: f64) -> Self {
        Self::Sphere { centre: Some(centre), centre_mm: None, centre_voxel: None, radius_m }
    }

    /// What it says; `place` and `key` begin messages.
    ///
    /// # Errors
    /// [`SimError::MissingKey`] or [`SimError::Value`] unless every place is given in one way, and both
    /// corners of a box in the same.
    pub(crate) fn shape(&self, place: &str, key: &str) -> Result<Shape, SimError> {
        let key = |name: &str| format!("{key}.{name}");
        match *self {
            Self::Box { min, max, min_mm, max_mm, min_voxel, max_voxel } => {
                let (low, min) = one(place, &key("min"), [min, min_mm, min_voxel])?;
                let (high, max) = one(place, &key("max"), [max, max_mm, max_voxel])?;
                if low != high {
                    let name = key(&format!("max{}", high.suffix()));
                    let want =
                        format!("max{} beside min{0}: both corners in one way", low.suffix());
                    return Err(SimError::value(place, &name, format!("{max:?}"), want));
                }
                Ok(Shape::Box(low, min, max))
            }
            Self::Sphere { centre, centre_mm, centre_voxel, radius_m } => {
                let (way, at) = one(place, &key("centre"), [centre, centre_mm, centre_voxel])?;
                Ok(Shape::Sphere(way, at, radius_m))
            }
        }
    }
}

/// A way to give a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Way {
    /// Fractions of the organ's bounding box along right, anterior, superior.
    Fractions,
    /// Scanner RAS, mm.
    Millimetres,
    /// Indices along the axes of the image file.
    Voxels,
}

impl Way {
    /// How keys of places end.
    pub fn suffix(self) -> &'static str {
        match self {
            Self::Fractions => "",
            Self::Millimetres => "_mm",
            Self::Voxels => "_voxel",
        }
    }
}

/// A region whose places are given in one way.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Shape {
    /// Between two corners.
    Box(Way, [f64; 3], [f64; 3]),
    /// Around a centre, with the radius, m.
    Sphere(Way, [f64; 3], f64),
}

/// The one of three ways in which the place `key` is given.
pub(super) fn one(
    place: &str,
    key: &str,
    ways: [Option<[f64; 3]>; 3],
) -> Result<(Way, [f64; 3]), SimError> {
    let all = [Way::Fractions, Way::Millimetres, Way::Voxels].into_iter().zip(ways);
    let mut given = all.filter_map(|(way, at)| Some((way, at?)));
    let name = key.rsplit('.').next().unwrap_or(key);
    let choice = format!(
        "{name} (fractions of the body's box), {name}_mm (scanner RAS mm) or {name}_voxel (voxels of \
         the image file)"
    );
    let Some((way, at)) = given.next() else {
        return Err(SimError::MissingKey { place: place.into(), key: key.into(), want: choice });
    };
    match given.next() {
        None => Ok((way, at)),
        Some((second, value)) => {
            let key = format!("{key}{}", second.suffix());
            let want = format!("no such key beside {name}{}: one of {choice}", way.suffix());
            Err(SimError::value(place, &key, format!("{value:?}"), want))
        }
    }
}
