//! `yawara preview`: a picture of what a scene holds and where its tools go.

use std::path::Path;

use crate::preview::{Picture, Preview};
use crate::{SimError, scene_file};
use serde_json::json;
use yawara_mesh::atomic_file;

use super::arguments::PreviewArguments;
use super::input::writer;
use super::printer::Printer;

pub fn run(arguments: &PreviewArguments, out: &mut Printer) -> Result<(), SimError> {
    let PreviewArguments { scene, out: file, set, json } = arguments;
    let write = writer("yawara preview", file, &[("png", write_png as Writer)])?;
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty());
    let has_folder = folder.is_none_or(Path::is_dir);
    if file.is_dir() || !has_folder {
        let want = "a file in a folder that exists";
        return Err(SimError::value("yawara preview", "--out", file.display(), want));
    }
    let (scene, _) = scene_file::load(scene, set)?;
    let preview = Preview::new(&scene)?;
    write(file, &preview.picture())?;
    if *json {
        let all = json!({ "file": file, "holdings": preview.holdings() });
        return out.print(&format!("{all:#}\n"));
    }
    for one in preview.holdings() {
        let kind = if one.kind == "fixed" { "" } else { one.kind };
        out.print(&format!("{:<10} {kind:<9} {}\n", one.key, one.in_words()))?;
    }
    out.print(&format!("written to {}\n", file.display()))
}

type Writer = fn(&Path, &Picture) -> Result<(), SimError>;

/// Writes a picture, whole or not at all.
pub fn write_png(file: &Path, picture: &Picture) -> Result<(), SimError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, picture.width as u32, picture.height as u32);
    encoder.set_color(png::ColorType::Rgb);
    let written = encoder.write_header().and_then(|mut png| {
        png.write_image_data(&picture.rgb)?;
        png.finish()
    });
    let io = |source| SimError::Io(file.into(), source);
    written.map_err(|error| io(std::io::Error::other(error)))?;
    atomic_file::write(file, bytes).map_err(io)
}
