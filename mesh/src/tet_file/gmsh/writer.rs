//! Writes plain meshes as MSH 2.2 and 4.1 text.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use nalgebra::Vector3;

use crate::tet_file::TetMeshError;
use crate::tet_file::file;
use crate::tet_file::mesh::PlainMesh;

/// The type of a four-node tetrahedron.
const TETRAHEDRON: i64 = 4;

/// Writes `mesh` as MSH 2.2 text; material tags become physical groups, named by `names`.
///
/// Tag 0 stands for no group. Nodes and elements are numbered from 1 in the order of the mesh.
/// Units: coordinates are divided by `unit_m` (metres per file unit). With `unit_m` 1 (or a power
/// of two) reading gives back the same mesh, bit for bit; else coordinates agree to two units in
/// the last place. The file is written beside `path` and renamed. Cost: O(n).
///
/// # Errors
/// [`TetMeshError::LengthUnit`]; [`TetMeshError::Tag`] for tags beyond 0 to 2³¹ − 1 and names with
/// line breaks; [`TetMeshError::NotFinite`] if a coordinate overflows in the file's unit;
/// [`TetMeshError::Io`].
/// # Source
/// Gmsh reference manual, "MSH file format version 2 (Legacy)".
pub fn write_msh22(
    path: &Path,
    mesh: &PlainMesh,
    names: &BTreeMap<i64, String>,
    unit_m: f64,
) -> Result<(), TetMeshError> {
    let points = file::in_units(mesh, unit_m)?;
    let mut text = start("2.2", mesh, names)?;
    let _ = writeln!(text, "$Nodes\n{}", points.len());
    for (i, x) in points.iter().enumerate() {
        // Debug format: the shortest digits that read back as the same number.
        let _ = writeln!(text, "{} {:?} {:?} {:?}", i + 1, x[0], x[1], x[2]);
    }
    let _ = writeln!(text, "$EndNodes\n$Elements\n{}", mesh.tets().len());
    let volumes = Volumes::of(mesh);
    for (i, (tet, tag)) in mesh.tets().iter().zip(mesh.tags()).enumerate() {
        let [a, b, c, d] = tet.map(|v| v as usize + 1);
        let volume = volumes.number(*tag);
        let _ = writeln!(text, "{} {TETRAHEDRON} 2 {tag} {volume} {a} {b} {c} {d}", i + 1);
    }
    text.push_str("$EndElements\n");
    file::write(path, text.as_bytes())
}

/// Writes `mesh` as MSH 4.1 text: one volume per material tag, in a physical group of that tag.
///
/// Tetrahedra stand in blocks of equal tags; where the tags of a mesh alternate, reading gives
/// them back in the order of the mesh all the same, since each run of equal tags is a block.
/// The rest is as for [`write_msh22`].
///
/// # Errors
/// As [`write_msh22`].
/// # Source
/// Gmsh reference manual, "MSH file format".
pub fn write_msh41(
    path: &Path,
    mesh: &PlainMesh,
    names: &BTreeMap<i64, String>,
    unit_m: f64,
) -> Result<(), TetMeshError> {
    let points = file::in_units(mesh, unit_m)?;
    let volumes = Volumes::of(mesh);
    let mut text = start("4.1", mesh, names)?;
    entities(&mut text, &points, &volumes);
    let n = points.len();
    let _ = writeln!(text, "$Nodes\n1 {n} 1 {n}\n3 1 0 {n}");
    for i in 1..=n {
        let _ = writeln!(text, "{i}");
    }
    for x in &points {
        let _ = writeln!(text, "{:?} {:?} {:?}", x[0], x[1], x[2]);
    }
    let runs: Vec<&[i64]> = mesh.tags().chunk_by(|a, b| a == b).collect();
    let n = mesh.tets().len();
    let _ = writeln!(text, "$EndNodes\n$Elements\n{} {n} 1 {n}", runs.len());
    let mut first = 0;
    for run in runs {
        let _ = writeln!(text, "3 {} {TETRAHEDRON} {}", volumes.number(run[0]), run.len());
        for i in first..first + run.len() {
            let [a, b, c, d] = mesh.tets()[i].map(|v| v as usize + 1);
            let _ = writeln!(text, "{} {a} {b} {c} {d}", i + 1);
        }
        first += run.len();
    }
    text.push_str("$EndElements\n");
    file::write(path, text.as_bytes())
}

/// One volume per material tag, numbered from 1 in ascending order of tags.
struct Volumes(Vec<i64>);

impl Volumes {
    fn of(mesh: &PlainMesh) -> Self {
        let mut tags = mesh.tags().to_vec();
        tags.sort_unstable();
        tags.dedup();
        Self(tags)
    }

    fn number(&self, tag: i64) -> usize {
        self.0.partition_point(|&t| t < tag) + 1
    }
}

/// `$MeshFormat` and `$PhysicalNames`, after a check of tags and names.
fn start(
    version: &str,
    mesh: &PlainMesh,
    names: &BTreeMap<i64, String>,
) -> Result<String, TetMeshError> {
    let name_of = |tag: &i64| names.get(tag).cloned().unwrap_or_default();
    for tag in mesh.tags().iter().chain(names.keys()) {
        if !(0..=i64::from(i32::MAX)).contains(tag) || name_of(tag).contains(char::is_control) {
            return Err(TetMeshError::Tag { tag: *tag, name: name_of(tag) });
        }
    }
    let mut text = format!("$MeshFormat\n{version} 0 8\n$EndMeshFormat\n");
    if !names.is_empty() {
        let _ = writeln!(text, "$PhysicalNames\n{}", names.len());
        for (tag, name) in names {
            let _ = writeln!(text, "3 {tag} \"{name}\"");
        }
        text.push_str("$EndPhysicalNames\n");
    }
    Ok(text)
}

/// `$Entities`: volumes only, each with the bounding box of all points.
fn entities(text: &mut String, points: &[Vector3<f64>], volumes: &Volumes) {
    let (mut low, mut high) = (points[0], points[0]);
    for x in points {
        (low, high) = (low.inf(x), high.sup(x));
    }
    let bounds: Vec<String> = low.iter().chain(high.iter()).map(|c| format!("{c:?}")).collect();
    let bounds = bounds.join(" ");
    let _ = writeln!(text, "$Entities\n0 0 0 {}", volumes.0.len());
    for &tag in &volumes.0 {
        let groups = if tag == 0 { "0".into() } else { format!("1 {tag}") };
        let _ = writeln!(text, "{} {bounds} {groups} 0", volumes.number(tag));
    }
    text.push_str("$EndEntities\n");
}
