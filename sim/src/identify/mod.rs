//! Which moduli a body has, from how it moved and what that took.
//!
//! `fit` finds the moduli with which a `model`, a scene on a mesh that stays, says what was `measured`, and how well they are
//! known: what is `identified`; `picture` draws it. Open this file first.

mod fit;
mod identified;
mod measured;
mod model;
mod picture;

use std::path::Path;

use nalgebra::{DMatrix, DVector};
use yawara_mesh::volume::LabelVolume;

use crate::error::SimError;
use crate::scene::Scene;
use fit::{Fit, Fitted, fit};
use model::{Model, Predicted};

pub use identified::{Identified, Modulus, Residual};
pub use measured::{Measured, Measurement, read};

/// Standard deviations on either side in which 95 % of a normal distribution lie.
const BAND: f64 = 1.959_964;

/// An entry is told from the prior where its standard deviation is below this part of that.
const TOLD: f64 = 0.3;

/// How moduli are looked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Entries of the scene's materials whose moduli are looked for; of all that the body is made of if empty.
    pub entries: Vec<usize>,
    /// Before anything is measured a modulus is believed to be within this factor of the scene's, one standard
    /// deviation of its logarithm.
    pub prior_factor: f64,
    /// Runs of the scene at most.
    pub runs: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self { entries: Vec::new(), prior_factor: 10.0, runs: 40 }
    }
}

/// Finds the moduli of a scene's materials with which it says what was measured, with how well they are known.
///
/// The mesh is that of the start: where it changed, predictions would jump. What holds the body keeps the stiffness that it has
/// in the scene. `volume` takes the place of the scene's image; `progress` is told how many runs are done and Σ residual² there.
///
/// Cost: a run of the scene on that mesh for each step of the fit, with a linear solve for each modulus at each time that was measured
/// at, and one run on the mesh that changes.
/// # Errors
/// [`SimError::Value`] for measurements that do not fit the scene, a scene with inertia, memory or cuts, or one that does not converge
/// with the moduli it has; [`SimError::NoResponse`].
pub fn identify(
    scene: &Scene,
    volume: Option<&LabelVolume>,
    measurements: &[Measurement],
    options: &Options,
    progress: &mut dyn FnMut(usize, f64),
) -> Result<Identified, SimError> {
    let (entries, data, whole) = set_up(scene, volume, measurements, options)?;
    let model = whole.on_fixed_mesh();
    let prior_sd = options.prior_factor.ln();
    let moduli = |logs: &DVector<f64>| with(scene, &entries, logs.as_slice());
    let (mut done, mut last) = (0, None::<Predicted>);
    let scale = |values: &[f64]| {
        let off = values.iter().zip(&data).map(|(value, of)| (value - of.measured) / of.sd);
        DVector::from_iterator(data.len(), off)
    };
    let start = entries.iter().map(|&entry| scene.materials[entry].young_modulus_pa.ln());
    let start = DVector::from_iterator(entries.len(), start);
    let Fit { parameters, at, covariance, runs, converged } =
        fit(&start, prior_sd, options.runs, |logs| {
            let (predicted, mut slopes) = model.slopes(&moduli(logs), &entries)?;
            slopes.row_iter_mut().zip(&data).for_each(|(mut row, of)| row /= of.sd);
            let residuals = scale(&predicted.values);
            done += 1;
            progress(done, residuals.norm_squared());
            last = Some(predicted);
            Ok(Fitted { residuals, slopes })
        })?;
    let chi_squared = at.residuals.norm_squared();
    // Of each parameter the part that the measurements tell.
    let told = entries.len() as f64 - covariance.trace() / prior_sd.powi(2);
    let degrees_of_freedom = data.len() as f64 - told;
    let sd_is_given = measurements.iter().all(|one| one.sd.is_some());
    let noise = match sd_is_given {
        true => 1.0,
        false => (chi_squared / degrees_of_freedom.max(1.0)).sqrt(),
    };
    let mut left_out = Vec::new();
    let shift = mesh_shift(&whole, &moduli(&parameters), &at, &scale, &covariance, &mut left_out);
    // With another noise the prior weighs otherwise; where that matters the measurements do not tell.
    let sds: Vec<f64> =
        (0..entries.len()).map(|i| (noise * covariance[(i, i)].sqrt()).min(prior_sd)).collect();
    let found = entries.iter().enumerate().map(|(i, &entry)| Modulus {
        entry,
        label: scene.materials[entry].label,
        start_pa: scene.materials[entry].young_modulus_pa,
        young_modulus_pa: parameters[i].exp(),
        relative_sd: sds[i],
        band_pa: [-1.0, 1.0].map(|sign| (parameters[i] + sign * BAND * sds[i]).exp()),
        is_told: sds[i] < TOLD * prior_sd,
        mesh_shift: shift.as_ref().map(|shift| shift[i].exp_m1()),
    });
    let residuals = data.iter().zip(at.residuals.iter()).map(|(of, off)| Residual {
        predicted: of.measured + off * of.sd,
        sd: noise * of.sd,
        ..of.clone()
    });
    Ok(Identified {
        scene: scene.name.clone(),
        moduli: found.collect(),
        correlation: correlation(&covariance),
        chi_squared: chi_squared / noise.powi(2),
        degrees_of_freedom,
        sd_is_given,
        converged,
        runs,
        vertices: last.map_or(0, |predicted| predicted.vertices),
        left_out,
        residuals: residuals.collect(),
    })
}

/// What the scene says of these measurements, with the moduli that it has and on the mesh that it starts with, by component that was
/// measured, mm and N.
///
/// Cost: a run of the scene.
/// # Errors
/// As [`identify`].
pub fn predict(
    scene: &Scene,
    volume: Option<&LabelVolume>,
    measurements: &[Measurement],
) -> Result<Vec<f64>, SimError> {
    let model = Model::new(scene, volume, measurements)?.on_fixed_mesh();
    Ok(model.predict(&with(scene, &[], &[]))?.values)
}

/// Half of Σ ((predicted − measured)/sd)² with the moduli that the scene has, and its derivatives by ln E of these entries of its
/// materials: for a search of one's own, with any number of them.
///
/// Cost: a run of the scene, and one linear solve for each time at which something was measured.
/// # Errors
/// As [`identify`].
pub fn misfit(
    scene: &Scene,
    volume: Option<&LabelVolume>,
    measurements: &[Measurement],
    entries: &[usize],
) -> Result<(f64, Vec<f64>), SimError> {
    let options = Options { entries: entries.to_vec(), ..Options::default() };
    let (entries, data, whole) = set_up(scene, volume, measurements, &options)?;
    let data: Vec<(f64, f64)> = data.iter().map(|of| (of.measured, of.sd)).collect();
    whole.on_fixed_mesh().gradient(&with(scene, &[], &[]), &entries, &data)
}

/// Draws what was measured against what was predicted, and what is left of it, to an SVG file.
///
/// # Errors
/// [`SimError::Io`].
pub fn draw(identified: &Identified, file: &Path) -> Result<(), SimError> {
    crate::output::write_file(file, picture::svg(identified))
}

/// The entries that are looked for, what was measured by component, and the scene.
fn set_up<'a>(
    scene: &Scene,
    volume: Option<&'a LabelVolume>,
    measurements: &'a [Measurement],
    options: &Options,
) -> Result<(Vec<usize>, Vec<Residual>, Model<'a>), SimError> {
    let refused = |key: &str, value: String, want: &str| {
        Err(SimError::value("yawara identify", key, value, want))
    };
    if measurements.is_empty() {
        return refused("measurements", "none".into(), "one at least");
    }
    if !(options.prior_factor > 1.0 && options.prior_factor <= 1e6) {
        return refused(
            "the prior's factor",
            options.prior_factor.to_string(),
            "above 1, at most 1e6",
        );
    }
    let given = measurements.iter().filter(|one| one.sd.is_some()).count();
    if given > 0 && given < measurements.len() {
        let value = format!("given for {given} of {} measurements", measurements.len());
        return refused("sd", value, "given for all or for none");
    }
    let whole = Model::new(scene, volume, measurements)?;
    let there = whole.entries.clone();
    let entries = &options.entries;
    for (number, entry) in entries.iter().enumerate() {
        if !there.contains(entry) || entries[..number].contains(entry) {
            let want = "the number of an entry of the scene's materials that the body is made of, each once";
            return refused("a material", entry.to_string(), want);
        }
    }
    let entries = if entries.is_empty() { there } else { entries.clone() };
    Ok((entries, components(measurements), whole))
}

/// What was measured, by component.
fn components(measurements: &[Measurement]) -> Vec<Residual> {
    let forces = measurements.iter().filter(|one| matches!(one.of, Measured::Force(_)));
    let largest = forces
        .flat_map(|one| one.values.into_iter().flatten())
        .fold(0.0, |most: f64, f| most.max(f.abs()));
    let mut data = Vec::new();
    for one in measurements {
        let (kind, otherwise) = match one.of {
            Measured::Move(_) => ("move_mm", 1.0),
            Measured::Force(_) => ("force_n", 1e-2 * largest.max(f64::MIN_POSITIVE)),
        };
        for (axis, value) in one.values.iter().enumerate() {
            data.extend(value.map(|measured| Residual {
                place: one.place.clone(),
                time_s: one.time_s,
                kind,
                axis,
                measured,
                predicted: 0.0,
                sd: one.sd.unwrap_or(otherwise),
            }));
        }
    }
    data
}

/// The moduli of all entries of a scene's materials, those of `entries` by their logarithms.
fn with(scene: &Scene, entries: &[usize], logs: &[f64]) -> Vec<f64> {
    let mut moduli: Vec<f64> = scene.materials.iter().map(|one| one.young_modulus_pa).collect();
    entries.iter().zip(logs).for_each(|(&entry, log)| moduli[entry] = log.exp());
    moduli
}

/// By how much ln E would be another if predictions were those of the mesh that the scene asks for.
fn mesh_shift(
    whole: &Model<'_>,
    moduli: &[f64],
    at: &Fitted,
    scale: &dyn Fn(&[f64]) -> DVector<f64>,
    covariance: &DMatrix<f64>,
    left_out: &mut Vec<String>,
) -> Option<DVector<f64>> {
    if !whole.scene().mesh.refines() {
        left_out.push("error of the mesh: the scene refines none (mesh.max_level)".into());
        return None;
    }
    left_out.push("refinement while fitting: predictions would jump with the mesh".into());
    match whole.predict(moduli) {
        Ok(finer) => {
            let change = scale(&finer.values) - &at.residuals;
            Some(covariance * at.slopes.tr_mul(&change))
        }
        Err(error) => {
            left_out.push(format!("error of the mesh: {error}"));
            None
        }
    }
}

fn correlation(covariance: &DMatrix<f64>) -> Vec<Vec<f64>> {
    let sd = |i: usize| covariance[(i, i)].sqrt();
    let n = covariance.nrows();
    (0..n).map(|i| (0..n).map(|j| covariance[(i, j)] / (sd(i) * sd(j))).collect()).collect()
}
