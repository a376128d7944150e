//! What a hand did, kept as a scene with the paths of its tools, which `yawara run` makes again.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use crate::SimError;
use crate::output::write_file;
use crate::scene::{Course, Key, Scene};

/// The most recordings of a session.
const MOST: usize = 1000;

/// A recording on disk.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Recording {
    /// The scene that runs it again.
    pub scene: PathBuf,
    /// The run directory beside it, to be made.
    pub run: PathBuf,
}

impl Recording {
    /// Writes `scene` into a new folder of `directory`: `scene.toml` and a `toolN_path.csv` for each tool
    /// that moves.
    ///
    /// # Errors
    /// [`SimError::Io`]; [`SimError::Value`] after a thousand of them.
    pub fn write(directory: &Path, mut scene: Scene) -> Result<Self, SimError> {
        let io = |path: &Path| {
            let path = path.to_owned();
            move |source| SimError::Io(path, source)
        };
        fs::create_dir_all(directory).map_err(io(directory))?;
        let name = |number: usize| directory.join(format!("{number:03}"));
        let free = (1..=MOST).map(name).find(|folder| !folder.exists());
        let folder = free.ok_or_else(|| {
            let want = format!("a folder of at most {MOST} recordings");
            SimError::value(&scene.name, "the recording", directory.display(), want)
        })?;
        fs::create_dir(&folder).map_err(io(&folder))?;
        for (number, tool) in scene.tools.iter_mut().enumerate() {
            let Some(Course { path, path_csv, .. }) = tool.course_mut() else { continue };
            if path.len() > 1 {
                let file = folder.join(format!("tool{number}_path.csv"));
                write_file(&file, csv(path))?;
                path.clear();
                *path_csv = Some(file);
            }
        }
        let file = folder.join("scene.toml");
        let text = toml::to_string(&scene)
            .map_err(|error| SimError::Io(file.clone(), std::io::Error::other(error)))?;
        write_file(&file, text)?;
        Ok(Self { scene: file, run: folder.join("run") })
    }
}

/// A path as a scene's `path_csv` has it, every number as it reads back.
fn csv(path: &[Key]) -> String {
    let mut text = String::from("time_s,x_m,y_m,z_m,turn_deg\n");
    for Key { time_s, move_m: [x, y, z], turn_deg } in path {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{time_s:?},{x:?},{y:?},{z:?},{turn_deg:?}");
    }
    text
}
