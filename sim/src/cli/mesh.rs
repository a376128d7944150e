//! `yawara mesh`: the undeformed tetrahedra of a label map at one uniform level.

use std::path::Path;
use std::sync::Arc;

use crate::SimError;
use crate::output::write_vtu;
use crate::report::Frame;
use nalgebra::Vector3;
use yawara_mesh::geometry::signed_volume;
use yawara_mesh::lattice::MAX_LEVEL;
use yawara_mesh::volume::{Grid, LabelVolume};
use yawara_mesh::{BisectionForest, CellGrid, Domain, LabelTree, Lattice, Placement, Quality};

use super::arguments::MeshArguments;
use super::input::{labels, writer};
use super::printer::Printer;

/// The most tetrahedra of a uniform mesh: about 10 GB on the way to the file.
const MAX_TETS: u64 = 20_000_000;

/// The coarsest base cell in voxels, 2^k: its embedding has 3k levels, at most `MAX_LEVEL`.
const MAX_DOUBLINGS: f64 = MAX_LEVEL as f64 / 3.0;

pub fn run(arguments: &MeshArguments, out: &mut Printer) -> Result<(), SimError> {
    let MeshArguments { image, base_mm, level, out: file } = arguments;
    let write = writer("yawara mesh", file, WRITERS)?;
    if let Some(base) = base_mm.filter(|base| !(*base > 0.0 && base.is_finite())) {
        return Err(SimError::value("yawara mesh", "--base-mm", base, "finite and more than 0"));
    }
    let volume = labels(image)?;
    let mesh = UniformMesh::new(image, &volume, *base_mm, *level)?;
    let frame = mesh.frame(&volume);
    write(file, &frame)?;
    out.print(&mesh.describe(&volume, &frame))?;
    out.print(&format!("written to {}\n", file.display()))
}

type Writer = fn(&Path, &Frame) -> Result<(), SimError>;

/// What can be written, by extension.
const WRITERS: &[(&str, Writer)] = &[
    ("vtu", write_vtu),
    #[cfg(feature = "gmsh")]
    ("msh", crate::output::write_msh),
];

/// A forest that is not refined any further.
struct UniformMesh {
    forest: BisectionForest,
    tree: Arc<LabelTree>,
    placement: Placement,
    grid: Grid,
    voxels_per_cell: usize,
}

impl UniformMesh {
    fn new(
        image: &str,
        volume: &LabelVolume,
        base_mm: Option<f64>,
        level: u8,
    ) -> Result<Self, SimError> {
        let grid = volume.grid().clone();
        let empty = || SimError::Empty(image.into());
        let [low, high] = volume.bounding_box().ok_or_else(empty)?;
        let longest = (0..3).map(|i| high[i] + 1 - low[i]).max().unwrap_or(1) as f64;
        let voxels = base_mm.map_or(longest / 8.0, |base| base / grid.spacing_mm);
        let doublings = voxels.log2().round().clamp(0.0, MAX_DOUBLINGS);
        let voxels_per_cell = 1usize << doublings as u32;
        if level > MAX_LEVEL {
            return Err(SimError::value(
                "yawara mesh",
                "--level",
                level,
                format!("at most {MAX_LEVEL}"),
            ));
        }
        let cells = CellGrid::around(volume, voxels_per_cell)?;
        let tree = Arc::new(LabelTree::new(volume, cells)?);
        let lattice = Lattice::new(cells.cells, level);
        let domain = Domain::of_labels(lattice, &tree);
        let roots = 6 * domain.cells().count() as u64;
        if roots << level > MAX_TETS {
            let finest = (MAX_TETS / roots.max(1)).max(1).ilog2();
            let want = format!(
                "at most {finest}: {roots} base tetrahedra give {} at this level, the limit is \
                 {MAX_TETS} (or choose a larger --base-mm)",
                roots << level
            );
            return Err(SimError::value("yawara mesh", "--level", level, want));
        }
        let placement = cells.placement(grid.spacing_mm * 1e-3, &lattice);
        let forest = BisectionForest::new(domain, tree.clone(), level, level)?;
        Ok(Self { forest, tree, placement, grid, voxels_per_cell })
    }

    /// Points, tetrahedra, levels and labels; nothing has moved.
    fn frame(&self, volume: &LabelVolume) -> Frame {
        let mut number = vec![0; self.forest.vertex_capacity()];
        let mut frame = Frame::default();
        let mut rest = vec![Vector3::zeros(); self.forest.vertex_capacity()];
        for vertex in self.forest.vertices() {
            number[vertex.index()] = frame.points_mm.len() as u32;
            rest[vertex.index()] = self.placement.position(self.forest.point(vertex));
            frame.points_mm.push(self.grid.to_ras_mm(rest[vertex.index()]).into());
        }
        for tet in self.forest.leaves() {
            let mut corners = tet.vertices.map(|v| number[v.index()]);
            if signed_volume(&tet.vertices.map(|v| rest[v.index()])) < 0.0 {
                corners.swap(2, 3);
            }
            frame.tets.push(corners);
            frame.level.push(tet.level);
            frame.label.push(volume.values()[usize::from(self.tree.majority(tet.node))]);
        }
        frame
    }

    fn describe(&self, volume: &LabelVolume, frame: &Frame) -> String {
        let corner = |v: u32| Vector3::from(frame.points_mm[v as usize]);
        let worst = frame
            .tets
            .iter()
            .map(|tet| Quality::of(&tet.map(corner)))
            .reduce(Quality::worse)
            .map_or(String::new(), |q| format!(", worst 3r/R {:.4}", q.radius_ratio));
        let labels: Vec<String> =
            volume.values()[1..].iter().map(|label| label.to_string()).collect();
        format!(
            "{} vertices, {} tetrahedra in {} parts{worst}\n\
             base cells of {} mm ({} voxels of {} mm), labels {}\n",
            frame.points_mm.len(),
            frame.tets.len(),
            self.forest.domain().components().len(),
            self.voxels_per_cell as f64 * self.grid.spacing_mm,
            self.voxels_per_cell,
            self.grid.spacing_mm,
            labels.join(", ")
        )
    }
}
