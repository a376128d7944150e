//! Checks that every key may need: ranges, finite numbers, regions.

use std::fmt::Debug;

use crate::SimError;
use crate::scene::{Region, Shape};

pub(crate) struct Check<'a> {
    pub place: &'a str,
}

impl Check<'_> {
    pub fn that(&self, ok: bool, key: &str, value: impl Debug, want: &str) -> Result<(), SimError> {
        if ok {
            return Ok(());
        }
        let value = format!("{value:?}");
        // A key that may be absent, and is there.
        let given = value.strip_prefix("Some(").and_then(|given| given.strip_suffix(')'));
        Err(SimError::value(self.place, key, given.unwrap_or(&value), want))
    }

    pub fn positive(&self, key: &str, value: f64) -> Result<(), SimError> {
        self.that(value > 0.0 && value.is_finite(), key, value, "finite and more than 0")
    }

    pub fn finite(&self, key: &str, value: f64) -> Result<(), SimError> {
        self.that(value.is_finite(), key, value, "a finite number")
    }

    pub fn vector(&self, key: &str, vector: &[f64; 3]) -> Result<(), SimError> {
        vector.iter().enumerate().try_for_each(|(i, &x)| self.finite(&format!("{key}[{i}]"), x))
    }

    pub fn given<T>(&self, value: Option<T>, key: &str, want: &str) -> Result<T, SimError> {
        value.ok_or_else(|| SimError::MissingKey {
            place: self.place.into(),
            key: key.into(),
            want: want.into(),
        })
    }

    pub fn region(&self, region: &Region, key: &str) -> Result<(), SimError> {
        match region.shape(self.place, key)? {
            Shape::Box(way, min, max) => {
                let [low, high] =
                    ["min", "max"].map(|name| format!("{key}.{name}{}", way.suffix()));
                self.vector(&low, &min)?;
                self.vector(&high, &max)?;
                (0..3).try_for_each(|i| {
                    let want = format!("at most {high}[{i}], {:?}", max[i]);
                    // Flat boxes are faces, so equality is fine.
                    self.that(min[i] <= max[i], &format!("{low}[{i}]"), min[i], &want)
                })
            }
            Shape::Sphere(way, centre, radius_m) => {
                self.vector(&format!("{key}.centre{}", way.suffix()), &centre)?;
                self.positive(&format!("{key}.radius_m"), radius_m)
            }
        }
    }
}
