//! `yawara identify`: moduli from what was measured.

use std::fmt::Write;

use crate::identify::{self, Identified, Measurement, Options, draw, read};
use crate::output::write_json;
use crate::scene::Scene;
use crate::{SimError, scene_file};
use indicatif::ProgressBar;

use super::arguments::IdentifyArguments;
use super::input::{check_file, material as entry};
use super::printer::Printer;

const COMMAND: &str = "yawara identify";

/// Finds the moduli; true if nothing changed any more at the end.
pub fn run(arguments: &IdentifyArguments, out: &mut Printer) -> Result<bool, SimError> {
    let IdentifyArguments { scene, measured, material, prior_factor, json, picture, set } =
        arguments;
    for (option, file, end) in [("--json", json, "json"), ("--picture", picture, "svg")] {
        if let Some(file) = file {
            check_file(COMMAND, option, file, end)?;
        }
    }
    let (scene, _) = scene_file::load(scene, set)?;
    let entries = material.iter().map(|name| entry(COMMAND, "--material", &scene, name));
    let entries = entries.collect::<Result<Vec<usize>, SimError>>()?;
    let tables = measured.iter().map(|file| read(file));
    let tables = tables.collect::<Result<Vec<Vec<Measurement>>, SimError>>()?;
    let options = Options { entries, prior_factor: *prior_factor, ..Options::default() };
    let bar = ProgressBar::new_spinner();
    let found = identify::identify(&scene, None, &tables.concat(), &options, &mut |runs, left| {
        bar.set_message(format!("run {runs}: sum of squares {left:.4e}"));
        bar.tick();
    });
    bar.finish_and_clear();
    let found = found?;
    if let Some(file) = json {
        write_json(file, &found)?;
    }
    if let Some(file) = picture {
        draw(&found, file)?;
    }
    out.print(&summary(&scene, &found))?;
    for file in json.iter().chain(picture) {
        out.print(&format!("written to {}\n", file.display()))?;
    }
    Ok(found.converged)
}

fn summary(scene: &Scene, found: &Identified) -> String {
    let mut text = format!(
        "{:<14}  {:>5}  {:>11}  {:>11}  {:>25}  {:>7}  {}\n",
        "material",
        "label",
        "start Pa",
        "found Pa",
        "95 % band Pa",
        "mesh",
        "told by the measurements"
    );
    for one in &found.moduli {
        let [low, high] = one.band_pa;
        let label = one.label.map_or_else(|| "-".into(), |label| label.to_string());
        let mesh =
            one.mesh_shift.map_or_else(|| "-".into(), |part| format!("{:+.1} %", 1e2 * part));
        let told = if one.is_told { "yes" } else { "no: mostly what was believed before" };
        // Writing to a String can't fail, here and below.
        let _ = writeln!(
            text,
            "{:<14}  {label:>5}  {:>11.4e}  {:>11.4e}  {low:>11.4e} - {high:>11.4e}  {mesh:>7}  {told}",
            scene.materials[one.entry].name, one.start_pa, one.young_modulus_pa
        );
    }
    let noise = if found.sd_is_given { "given" } else { "from what is left" };
    let _ = writeln!(
        text,
        "fit       chi squared {:.1} of {:.1} degrees of freedom, {} components, noise {noise}",
        found.chi_squared,
        found.degrees_of_freedom,
        found.residuals.len()
    );
    let end = if found.converged { "nothing changes any more" } else { "not converged" };
    let _ = writeln!(text, "search    {} runs on {} vertices, {end}", found.runs, found.vertices);
    for reason in &found.left_out {
        let _ = writeln!(text, "left out  {reason}");
    }
    text
}
