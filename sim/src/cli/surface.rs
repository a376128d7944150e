//! `yawara surface`: the outlines of an image's labels.

use std::path::Path;
use std::sync::Arc;

use crate::SimError;
use yawara_mesh::isosurface::{Outline, Outlines, PlyEncoding, SurfaceData, write_ply, write_vtp};
use yawara_mesh::volume::LabelVolume;
use yawara_mesh::{CellGrid, Domain, LabelTree, Lattice, SurfaceError};

use super::arguments::SurfaceArguments;
use super::input::{labels, writer};
use super::printer::Printer;

/// Voxels along a root cube of the mesh that is cut: its leaves go down to one voxel.
const VOXELS_PER_CELL: usize = 16;

pub fn run(arguments: &SurfaceArguments, out: &mut Printer) -> Result<(), SimError> {
    let SurfaceArguments { image, label, sigma_voxels, out: file } = arguments;
    let write = writer("yawara surface", file, WRITERS)?;
    if !(0.0..=16.0).contains(sigma_voxels) {
        return Err(SimError::value("yawara surface", "--sigma-voxels", sigma_voxels, "0 to 16"));
    }
    let volume = labels(image)?;
    let outlines = choose(&volume, label, *sigma_voxels)?;
    let grid = CellGrid::around(&volume, VOXELS_PER_CELL)?;
    let tree = Arc::new(LabelTree::new(&volume, grid)?);
    let level = grid.embed_level();
    let domain = Domain::of_labels(Lattice::new(grid.cells, level), &tree);
    let Outlines { rest, surfaces, .. } = Outlines::new(&volume, &tree, domain, level, &outlines)?;
    let (mut points_mm, mut label_of, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
    for surface in &surfaces {
        let x = surface.positions(&rest)?;
        let original = volume.values()[usize::from(surface.label)];
        out.print(&format!(
            "label {original}: {} triangles in {} piece(s), {:.2} cm², {:.2} mL\n",
            surface.triangles.len(),
            surface.component_count(),
            1e4 * surface.area(&x)?,
            1e6 * surface.volume(&x)?
        ))?;
        let first = points_mm.len() as u32;
        triangles.extend(surface.triangles.iter().map(|corners| corners.map(|v| first + v)));
        label_of.resize(points_mm.len() + x.len(), original);
        points_mm.extend(x.iter().map(|x| volume.grid().to_ras_mm(*x)));
    }
    let data = SurfaceData {
        points_mm: &points_mm,
        triangles: &triangles,
        displacement_mm: None,
        label: Some(&label_of),
    };
    write(file, &data)?;
    out.print(&format!("written to {}\n", file.display()))
}

type Writer = fn(&Path, &SurfaceData<'_>) -> Result<(), SurfaceError>;

/// What can be written, by extension.
const WRITERS: &[(&str, Writer)] = &[
    ("ply", |file, data| write_ply(file, data, PlyEncoding::BinaryLittleEndian)),
    ("vtp", write_vtp),
];

/// The labels asked for, or all.
fn choose(
    volume: &LabelVolume,
    asked: &[i64],
    sigma_voxels: f64,
) -> Result<Vec<Outline>, SimError> {
    let there = &volume.values()[1..];
    let asked = if asked.is_empty() { there } else { asked };
    let outline = |label: &i64| match (1..).zip(there).find(|(_, value)| *value == label) {
        Some((dense, _)) => Ok(Outline { label: dense, sigma_voxels }),
        None => {
            let there: Vec<String> = there.iter().map(i64::to_string).collect();
            let want = format!("one of {}", there.join(", "));
            Err(SimError::value("yawara surface", "--label", label, want))
        }
    };
    asked.iter().map(outline).collect()
}
