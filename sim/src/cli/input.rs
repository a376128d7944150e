//! What the commands on images share: reading labels, choosing a writer.

use std::path::Path;

use crate::SimError;
use yawara_mesh::image::read_labels;
use yawara_mesh::phantom::{LiverPhantom, liver};
use yawara_mesh::volume::LabelVolume;

/// The label map at a path, or the procedural liver for the word `phantom`.
pub fn labels(image: &str) -> Result<LabelVolume, SimError> {
    match image {
        "phantom" => Ok(liver(LiverPhantom::default())?),
        path => Ok(read_labels(Path::new(path))?),
    }
}

/// The one of `writers`, by extension, that the name of `file` asks for.
pub fn writer<W: Copy>(command: &str, file: &Path, writers: &[(&str, W)]) -> Result<W, SimError> {
    let extension = file.extension().and_then(|extension| extension.to_str());
    let found = writers.iter().find(|(name, _)| Some(*name) == extension);
    let names: Vec<String> = writers.iter().map(|(name, _)| format!(".{name}")).collect();
    found.map(|(_, writer)| *writer).ok_or_else(|| {
        let want = format!("a file name that ends in {}", names.join(" or "));
        SimError::value(command, "--out", file.display(), want)
    })
}
