//! What the commands on images share: reading labels, choosing a writer.

use std::path::Path;

use crate::SimError;
use crate::scene::Scene;
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

/// Refuses a name that is no place for a file whose name ends so.
/// # Errors
/// [`SimError::Value`] with the command, the option, the name and what it has to be.
pub fn check_file(command: &str, option: &str, file: &Path, end: &str) -> Result<(), SimError> {
    let refused = |want: &str| SimError::value(command, option, file.display(), want);
    if file.extension().is_none_or(|extension| extension != end) {
        return Err(refused(&format!("a file name that ends in .{end}")));
    }
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty());
    if file.is_dir() || !folder.is_none_or(Path::is_dir) {
        return Err(refused("a file in a folder that exists"));
    }
    Ok(())
}

/// The entry of a scene's materials by its name or number.
/// # Errors
/// [`SimError::Value`] with the names that there are.
pub fn material(command: &str, option: &str, scene: &Scene, name: &str) -> Result<usize, SimError> {
    let by_name = scene.materials.iter().position(|one| one.name == name);
    by_name.or_else(|| name.parse().ok().filter(|n| *n < scene.materials.len())).ok_or_else(|| {
        let names: Vec<&str> = scene.materials.iter().map(|one| &*one.name).collect();
        let want = format!("one of {}, or its number from 0", names.join(", "));
        SimError::value(command, option, name, want)
    })
}
