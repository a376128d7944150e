//! `yawara export`: a run that is over as a page, a scene or a picture.

use std::path::Path;

use crate::SimError;
use crate::film::write_picture;
use crate::playback::{Run, write_gltf};
use crate::view::write_html;

use super::arguments::ExportArguments;
use super::input::check_file;
use super::printer::Printer;

/// How long a picture may last, s.
const LASTS_S: std::ops::RangeInclusive<f64> = 0.1..=60.0;

/// Writes what is asked for, all names checked before any work.
pub fn run(arguments: &ExportArguments, out: &mut Printer) -> Result<(), SimError> {
    let ExportArguments { run, html, gltf, picture, seconds } = arguments;
    if html.is_none() && gltf.is_none() && picture.is_none() {
        let want = "one of --html, --gltf and --picture";
        return Err(SimError::value("yawara export", "what to write", "not said", want));
    }
    for (option, file, end) in
        [("--html", html, "html"), ("--gltf", gltf, "glb"), ("--picture", picture, "png")]
    {
        if let Some(file) = file {
            check_file("yawara export", option, file, end)?;
        }
    }
    if !(LASTS_S.contains(seconds)) {
        let want = format!("{} to {}", LASTS_S.start(), LASTS_S.end());
        return Err(SimError::value("yawara export", "--seconds", seconds, want));
    }
    let run = Run::open(run)?;
    if let Some(file) = html {
        let off_mm = write_html(&run, file)?;
        say(out, file, &format!("surfaces to {off_mm:.1e} mm"))?;
    }
    if let Some(file) = gltf {
        write_gltf(&run, file)?;
        say(out, file, "in 32-bit floats")?;
    }
    if let Some(file) = picture {
        write_picture(&run, file, *seconds)?;
        say(out, file, &format!("{} frames in {seconds} s", run.frame_count()))?;
    }
    Ok(())
}

fn say(out: &mut Printer, file: &Path, precision: &str) -> Result<(), SimError> {
    let bytes = std::fs::metadata(file).map_err(|source| SimError::Io(file.into(), source))?.len();
    let size = bytes as f64 * 1e-6;
    out.print(&format!("written to {}: {size:.1} MB, {precision}\n", file.display()))
}
