//! Runs the program in a scratch directory.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A scratch directory, the working directory of the program.
pub struct Workbench {
    dir: tempfile::TempDir,
}

impl Workbench {
    pub fn new() -> Self {
        Self { dir: tempfile::tempdir().unwrap() }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> &Self {
        fs::write(self.path(name), bytes).unwrap();
        self
    }

    pub fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_yawara"));
        command.args(arguments).current_dir(self.dir.path());
        command
    }

    pub fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    /// Runs what must succeed; its standard output.
    pub fn succeed(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {stderr}");
        String::from_utf8(output.stdout).unwrap()
    }

    /// Runs what must be refused: exit code 2, one paragraph that has all of `words`, and not a
    /// file more or less than before.
    pub fn refused(&self, arguments: &[&str], words: &[&str]) {
        let before = self.files();
        let output = self.run(arguments);
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
        let message = stderr.strip_prefix("error: ").unwrap_or_else(|| panic!("{stderr}"));
        assert_eq!(message.matches('\n').count(), 1, "one paragraph: {stderr}");
        for word in words {
            assert!(message.contains(word), "no {word:?} in {stderr}");
        }
        assert_eq!(self.files(), before, "{arguments:?} left something behind");
    }

    /// All files and directories, hidden ones too, relative to the scratch directory.
    pub fn files(&self) -> Vec<PathBuf> {
        fn list(at: &Path, root: &Path, found: &mut Vec<PathBuf>) {
            for entry in fs::read_dir(at).unwrap() {
                let path = entry.unwrap().path();
                found.push(path.strip_prefix(root).unwrap().into());
                if path.is_dir() {
                    list(&path, root, found);
                }
            }
        }
        let mut found = Vec::new();
        list(self.dir.path(), self.dir.path(), &mut found);
        found.sort();
        found
    }
}

/// A bar of 4 × 2 × 2 base cells, held at one end and pulled at the other.
pub const BAR: &str = r#"
name = "bar"
[image]
phantom = "block"
size_mm = [40, 20, 20]
voxel_mm = 5
[[materials]]
label = 1
young_modulus_pa = 5e3
poisson_ratio = 0.3
[mesh]
base_mm = 10
max_level = 3
[[fixed]]
shape = "box"
min = [0, 0, 0]
max = [0, 1, 1]
[[tools]]
kind = "grab"
region = { shape = "box", min = [1, 0, 0], max = [1, 1, 1] }
path = [{ time_s = 0 }, { time_s = 0.3, move_m = [0.004, 0, 0.004] }]
[time]
steps = 3
step_s = 0.1
[output]
frames_every = 2
"#;

/// A NIfTI-1 label map of 1-byte voxels, 5 mm wide.
pub struct Nifti {
    /// The 348 bytes of the header and 4 of extension flags.
    pub header: [u8; 352],
    pub voxels: Vec<u8>,
}

impl Nifti {
    /// A cube of 8 × 8 × 8 voxels, all of one label.
    pub fn cube(label: u8) -> Self {
        let mut image = Self { header: [0; 352], voxels: vec![label; 512] };
        image.i32(0, 348);
        for (i, dim) in [3, 8, 8, 8, 1, 1, 1, 1].into_iter().enumerate() {
            image.i16(40 + 2 * i, dim);
        }
        // Datatype 2 of 8 bits; no qform, an sform; millimetres.
        image.i16(70, 2).i16(72, 8).i16(252, 0).i16(254, 1);
        image.f32(76, 1.0).f32(80, 5.0).f32(84, 5.0).f32(88, 5.0).f32(108, 352.0);
        image.header[123] = 2;
        for (i, origin) in [10.0, 20.0, 30.0].into_iter().enumerate() {
            image.f32(280 + 20 * i, 5.0).f32(292 + 16 * i, origin);
        }
        image.header[344..348].copy_from_slice(b"n+1\0");
        image
    }

    pub fn i16(&mut self, at: usize, value: i16) -> &mut Self {
        self.header[at..at + 2].copy_from_slice(&value.to_le_bytes());
        self
    }

    pub fn i32(&mut self, at: usize, value: i32) -> &mut Self {
        self.header[at..at + 4].copy_from_slice(&value.to_le_bytes());
        self
    }

    pub fn f32(&mut self, at: usize, value: f32) -> &mut Self {
        self.header[at..at + 4].copy_from_slice(&value.to_le_bytes());
        self
    }

    pub fn bytes(&self) -> Vec<u8> {
        [&self.header[..], &self.voxels].concat()
    }
}
