//! The files of one frame, found by the run's lists and read back.

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use yawara_mesh::tet_file::{VtkFields, read_vtp_fields, read_vtu_fields};

use super::wrong;
use crate::SimError;
use crate::report::{Frame, SurfaceFrame};

/// The farthest that a point of a frame is from the origin, mm.
const FARTHEST_MM: f64 = 1e7;

/// Where a frame is.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FrameFiles {
    /// Number of the step after which it was written, 0 for the start.
    pub step: usize,
    pub time_s: f64,
    tets: PathBuf,
    surfaces: Vec<(i64, PathBuf)>,
    outline: Option<PathBuf>,
}

/// What a list of frames names.
enum Named {
    Tets,
    Label(i64),
    Outline,
}

/// The frames that `frames.pvd` and, if it is there, `outline.pvd` list, in ascending order.
///
/// # Errors
/// [`SimError::Io`]; [`SimError::Syntax`] with the list and its line: what is no list of frames, files
/// other than `frames/step_…`, steps that do not ascend.
pub(super) fn list(folder: &Path) -> Result<Vec<FrameFiles>, SimError> {
    let mut frames: Vec<FrameFiles> = Vec::new();
    let collection = folder.join("frames.pvd");
    for entry in entries(&collection)? {
        let (line, time_s, path, step, named) = entry.resolve(&collection, folder)?;
        let wrong = |reason: &str| refusal(&collection, line, reason);
        match (named, frames.last_mut()) {
            (Named::Tets, last)
                if last.as_ref().is_none_or(|last| last.step < step && last.time_s < time_s) =>
            {
                let (surfaces, outline) = (Vec::new(), None);
                frames.push(FrameFiles { step, time_s, tets: path, surfaces, outline });
            }
            (Named::Label(label), Some(last)) if last.step == step => {
                last.surfaces.push((label, path))
            }
            (Named::Outline, _) => return Err(wrong("an outline, want tetrahedra and labels")),
            _ => return Err(wrong("out of order: want ascending steps, tetrahedra first")),
        }
    }
    if frames.is_empty() {
        return Err(refusal(&collection, 1, "lists no frame"));
    }
    let outlines = folder.join("outline.pvd");
    if outlines.exists() {
        for entry in entries(&outlines)? {
            let (line, _, path, step, named) = entry.resolve(&outlines, folder)?;
            let at = frames.binary_search_by_key(&step, |frame| frame.step);
            match (named, at) {
                (Named::Outline, Ok(at)) => frames[at].outline = Some(path),
                _ => return Err(refusal(&outlines, line, "no outline of a frame of frames.pvd")),
            }
        }
        if let Some(frame) = frames.iter().find(|frame| frame.outline.is_none()) {
            let reason = format!("has no outline of step {}", frame.step);
            return Err(refusal(&outlines, 1, &reason));
        }
    }
    Ok(frames)
}

fn refusal(list: &Path, line: usize, reason: &str) -> SimError {
    let place = format!("{}, line {line}", list.display());
    SimError::Syntax { place, reason: reason.into() }
}

/// A line of a list.
struct Entry {
    line: usize,
    time: String,
    file: String,
}

fn entries(list: &Path) -> Result<Vec<Entry>, SimError> {
    let text = std::fs::read_to_string(list).map_err(|source| SimError::Io(list.into(), source))?;
    let mut found = Vec::new();
    for (line, text) in (1..).zip(text.lines()).filter(|(_, text)| text.contains("<DataSet ")) {
        let get = |name: &str| {
            let start = text.split(&format!(" {name}=\"")).nth(1);
            let value =
                start.and_then(|rest| rest.split_once('"')).map(|(value, _)| value.to_owned());
            value.ok_or_else(|| refusal(list, line, &format!("no {name}=\"…\"")))
        };
        found.push(Entry { line, time: get("timestep")?, file: get("file")? });
    }
    Ok(found)
}

impl Entry {
    /// Line, time, path, step and kind.
    fn resolve(
        self,
        list: &Path,
        folder: &Path,
    ) -> Result<(usize, f64, PathBuf, usize, Named), SimError> {
        let Self { line, time, file } = self;
        let shown: String = file.chars().take(80).collect();
        let wrong = |reason: String| refusal(list, line, &reason);
        let time_s = time.parse().ok().filter(|time: &f64| time.is_finite() && *time >= 0.0);
        let time_s = time_s.ok_or_else(|| wrong(format!("timestep {time:?}, want seconds")))?;
        let (step, named) = named(&file).ok_or_else(|| {
            wrong(format!(
                "file {shown:?}, want frames/step_000000.vtu, …_label_1.vtp or …_outline.vtp"
            ))
        })?;
        Ok((line, time_s, folder.join(&file), step, named))
    }
}

/// Step and kind of a file by its name; none of a name that runs do not give.
fn named(file: &str) -> Option<(usize, Named)> {
    let (stem, extension) = file.strip_prefix("frames/step_")?.split_once('.')?;
    let (digits, rest) = stem.split_at(stem.find('_').unwrap_or(stem.len()));
    let is_number = digits.len() >= 6 && digits.bytes().all(|b| b.is_ascii_digit());
    let step = digits.parse().ok().filter(|_| is_number)?;
    let named = match (rest, extension) {
        ("", "vtu") => Named::Tets,
        ("_outline", "vtp") => Named::Outline,
        (label, "vtp") => Named::Label(label.strip_prefix("_label_")?.parse().ok()?),
        _ => return None,
    };
    Some((step, named))
}

impl FrameFiles {
    /// The frame as it was written, without what is void.
    ///
    /// # Errors
    /// [`SimError::TetMesh`] with the file that can't be read; [`SimError::Syntax`] with the one that
    /// lacks cells or a field, or has a point farther away than any body is.
    pub fn read(&self) -> Result<Frame, SimError> {
        let grid = read_vtu_fields(&self.tets)?;
        let displacement_mm = displacement(&self.tets, &grid)?;
        let cells = |name: &str| grid.of_cells(name, 1).map(<[f64]>::to_vec);
        let needed = |name: &str| cells(name).ok_or_else(|| lacks(&self.tets, name));
        let maybe = |name: &str| cells(name).unwrap_or_default();
        let surface = |label, path: &Path| -> Result<SurfaceFrame, SimError> {
            let read = read_vtp_fields(path)?;
            let vectors = |points: Vec<[f64; 3]>| points.into_iter().map(Vector3::from).collect();
            Ok(SurfaceFrame {
                label,
                displacement_mm: vectors(displacement(path, &read)?),
                points_mm: vectors(read.points),
                triangles: read.cells,
            })
        };
        let outline = self.outline.as_deref().map(|path| surface(0, path)).transpose()?;
        let surfaces = self.surfaces.iter().map(|(label, path)| surface(*label, path));
        let frame = Frame {
            time_s: self.time_s,
            surfaces: surfaces.collect::<Result<_, _>>()?,
            outline,
            displacement_mm,
            level: needed("level")?.into_iter().map(|level| level as u8).collect(),
            label: needed("label")?.into_iter().map(|label| label as i64).collect(),
            von_mises_pa: needed("von_mises_pa")?,
            young_modulus_pa: maybe("young_modulus_pa"),
            plastic_strain: maybe("plastic_strain"),
            dissipated_j_m3: maybe("dissipated_j_m3"),
            indicator: maybe("indicator"),
            points_mm: grid.points,
            tets: grid.cells,
        };
        Ok(frame.without_void())
    }

    /// The file of a surface: the outline first, then labels.
    pub fn surface(&self, number: usize) -> &Path {
        let surfaces = self.surfaces.iter().map(|(_, path)| path);
        self.outline.iter().chain(surfaces).nth(number).map_or(&self.tets, |path| path)
    }
}

fn lacks(path: &Path, name: &str) -> SimError {
    wrong(path, &format!("has no array {name}, which runs write"))
}

/// The displacements of points that are none too far away, of at least one cell.
fn displacement<const N: usize>(
    path: &Path,
    read: &VtkFields<N>,
) -> Result<Vec<[f64; 3]>, SimError> {
    if read.cells.is_empty() {
        return Err(wrong(path, "has no cells"));
    }
    let name = "displacement_mm";
    let moved = read.of_points(name, 3).ok_or_else(|| lacks(path, name))?;
    let numbers = read.points.as_flattened().iter().chain(moved);
    match numbers.enumerate().find(|(_, x)| !(x.abs() <= FARTHEST_MM)) {
        None => Ok(moved.as_chunks::<3>().0.to_vec()),
        Some((_, x)) => {
            let reason =
                format!("has a point or displacement of {x} mm, want at most {FARTHEST_MM}");
            Err(wrong(path, &reason))
        }
    }
}

#[cfg(test)]
mod tests {
    use yawara_mesh::tet_file::{VtkArray, VtkValues, tetrahedra_xml};

    use super::*;

    fn listed(text: &str) -> Result<Vec<usize>, String> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("frames.pvd"), text).unwrap();
        let frames = list(folder.path()).map_err(|error| error.to_string())?;
        Ok(frames.iter().map(|frame| frame.step).collect())
    }

    #[test]
    fn a_list_names_frames_and_nothing_else() {
        let line = |time: &str, file: &str| {
            format!("<DataSet timestep=\"{time}\" part=\"0\" file=\"{file}\"/>\n")
        };
        let start = line("0.0", "frames/step_000000.vtu");
        let good = [
            &start[..],
            &line("0.0", "frames/step_000000_label_-2.vtp"),
            &line("0.5", "frames/step_1000000.vtu"),
        ];
        assert_eq!(listed(&good.concat()).unwrap(), [0, 1_000_000]);
        for (bad, want) in [
            ("".to_owned(), "line 1: lists no frame"),
            (start.replace("0.0", "soon"), "line 1: timestep \"soon\""),
            (start.replace("0.0", "-1"), "line 1: timestep \"-1\""),
            (start.replace("frames/", "../../"), "want frames/step_"),
            (line("0", "/etc/passwd"), "want frames/step_"),
            (line("0", "frames/step_00000x.vtu"), "want frames/step_"),
            (line("0", "frames/step_000000/../../x.vtu"), "want frames/step_"),
            (start.replace("file", "folder"), "no file="),
            ([&start[..], &start].concat(), "line 2: out of order"),
            (line("0.0", "frames/step_000000_label_1.vtp"), "line 1: out of order"),
            (line("0.0", "frames/step_000000_outline.vtp"), "line 1: an outline"),
        ] {
            let message = listed(&bad).unwrap_err();
            assert!(message.contains("frames.pvd") && message.contains(want), "{want}: {message}");
        }
    }

    /// The frame that a file of these labels has, of a tetrahedron each.
    fn read(labels: &[i64]) -> Result<Frame, String> {
        let folder = tempfile::tempdir().unwrap();
        let tets = folder.path().join("a.vtu");
        let points: Vec<f64> = (0..12 * labels.len()).map(|i| i as f64).collect();
        let cells: Vec<[u32; 4]> =
            (0..labels.len() as u32).map(|i| [0, 1, 2, 3].map(|k| 4 * i + k)).collect();
        let of = |name, components, values| VtkArray { name, components, values };
        let moved = [of("displacement_mm", 3, VtkValues::Float64(&points))];
        let levels = vec![2; labels.len()];
        let fields = [
            of("level", 1, VtkValues::UInt8(&levels)),
            of("label", 1, VtkValues::Int64(labels)),
            of("von_mises_pa", 1, VtkValues::Float64(&points[..labels.len()])),
        ];
        std::fs::write(&tets, tetrahedra_xml(&points, &cells, &moved, &fields)).unwrap();
        let files = FrameFiles { step: 0, time_s: 0.0, tets, surfaces: Vec::new(), outline: None };
        files.read().map_err(|error| error.to_string())
    }

    #[test]
    fn a_frame_is_of_what_is_not_void() {
        let frame = read(&[0, 7]).unwrap();
        assert_eq!((&frame.label[..], &frame.tets[..]), (&[7][..], &[[0, 1, 2, 3]][..]));
        assert_eq!((frame.points_mm[0], frame.von_mises_pa[0]), ([12.0, 13.0, 14.0], 1.0));
        assert!(read(&[]).unwrap_err().contains("a.vtu: has no cells"));
    }
}
