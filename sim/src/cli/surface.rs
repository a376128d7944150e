//! `yawara surface`: the outlines of an image's labels.

use std::path::Path;
use std::sync::Arc;

use nalgebra::Vector3;
use yawara::SimError;
use yawara_mesh::isosurface::{Outline, Outlines, PlyEncoding, SurfaceData, write_ply, write_vtp};
use yawara_mesh::volume::LabelVolume;
use yawara_mesh::{CellGrid, Domain, LabelTree, Lattice, SurfaceError};

use super::arguments::SurfaceArguments;
use super::input::{labels, refuse, writer};
use super::printer::Printer;

/// Voxels along a root cube of the mesh that is cut: its leaves go down to one voxel.
const VOXELS_PER_CELL: usize = 16;

pub fn run(arguments: &SurfaceArguments, out: &mut Printer) -> Result<(), SimError> {
    let SurfaceArguments { image, label, sigma_voxels, out: file } = arguments;
    let write = writer("surface", file, WRITERS)?;
    if !(0.0..=16.0).contains(sigma_voxels) {
        return Err(refuse("surface", "--sigma-voxels", sigma_voxels, "0 to 16"));
    }
    let volume = labels(image)?;
    let outlines = choose(&volume, label, *sigma_voxels)?;
    let grid = CellGrid::around(&volume, VOXELS_PER_CELL)?;
    let tree = Arc::new(LabelTree::new(&volume, grid)?);
    let level = grid.embed_level();
    let lattice = Lattice::new(grid.cells, level);
    let domain = Domain::of_labels(lattice, &tree);
    let Outlines { forest, surfaces } = Outlines::new(&volume, &tree, domain, level, &outlines)?;
    let placement = grid.placement(volume.grid().spacing_mm * 1e-3, &lattice);
    let mut rest = vec![Vector3::zeros(); forest.vertex_capacity()];
    for v in forest.vertices() {
        rest[v.index()] = placement.position(forest.point(v));
    }
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
    let values = volume.values();
    let dense = |label: &i64| values.iter().position(|value| value == label).filter(|&i| i > 0);
    if asked.is_empty() {
        let labels = 1..values.len();
        return Ok(labels.map(|i| Outline { label: i as u16, sigma_voxels }).collect());
    }
    asked
        .iter()
        .map(|label| match dense(label) {
            Some(i) => Ok(Outline { label: i as u16, sigma_voxels }),
            None => {
                let there: Vec<String> = values[1..].iter().map(i64::to_string).collect();
                let want = format!("one of {}", there.join(", "));
                Err(refuse("surface", "--label", label, want))
            }
        })
        .collect()
}
