//! The bodies of all benches: the liver phantom with the materials of the built-in scene.

use std::sync::Arc;

use nalgebra::Vector3;
use yawara_corot::{Body, Element};
use yawara_embed::{Embedding, LinearTet, Material, by_name};
use yawara_mesh::phantom::{GALLBLADDER_LABEL, LiverPhantom, PARENCHYMA, TUMOUR, VESSELS, liver};
use yawara_mesh::volume::LabelVolume;
use yawara_mesh::{
    BisectionForest, CellGrid, Domain, LabelTree, Lattice, Placement, Point, VertexId,
};

use crate::error::Result;

/// How large a body is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// Base cells of 16 mm, voxels of 2 mm: about 736 vertices at the start.
    Full,
    /// Base cells of 32 mm, voxels of 4 mm: about 150 vertices at the start.
    Quick,
}

/// Length of the phantom, mm.
const LENGTH_MM: f64 = 196.0;

/// Voxels along a base cell.
const VOXELS_PER_CELL: usize = 8;

/// Levels below the start mesh down to which vertices may come in: to edges of a voxel.
const MAX_LEVEL: u8 = 9;

/// Label, E (Pa), ν, ρ (kg/m³).
const TISSUES: [(i64, f64, f64, f64); 4] = [
    (PARENCHYMA, 5e3, 0.45, 1060.0),
    (VESSELS, 5e5, 0.45, 1060.0),
    (GALLBLADDER_LABEL, 2e4, 0.45, 1010.0),
    (TUMOUR, 5e4, 0.45, 1060.0),
];

/// What stands for void inside base cells: a thousandth of the softest tissue, ν = 0.
const VOID: (f64, f64, f64) = (5.0, 0.0, 0.0);

/// The back of the right lobe is held: a box in fractions of the organ's own.
const HELD: [[f64; 3]; 2] = [[0.55, 0.0, 0.0], [1.0, 0.35, 1.0]];

/// The liver phantom, meshed at its start level and held at the back.
#[derive(Clone, Debug)]
pub struct Organ {
    /// Labels of the voxels.
    pub volume: LabelVolume,
    /// Labels of all tetrahedra.
    pub tree: Arc<LabelTree>,
    /// The start mesh, one face-connected component.
    pub forest: BisectionForest,
    /// Where the mesh lies, m.
    pub placement: Placement,
    /// By dense label, void first.
    pub materials: Vec<Material>,
    held: [Vector3<f64>; 2],
}

impl Size {
    /// The phantom's parameters.
    pub fn phantom(self) -> LiverPhantom {
        let voxel_mm = if self == Self::Full { 2.0 } else { 4.0 };
        LiverPhantom { length_mm: LENGTH_MM, voxel_mm, seed: 1 }
    }
}

impl Organ {
    /// Makes the phantom, its labels and its start mesh.
    /// # Errors
    /// Those of the image, the forest and the embedding: a defect of the constants above.
    pub fn new(size: Size) -> Result<Self> {
        let volume = liver(size.phantom())?;
        let grid = CellGrid::around(&volume, VOXELS_PER_CELL)?;
        let tree = Arc::new(LabelTree::new(&volume, grid)?);
        let lattice = Lattice::new(grid.cells, MAX_LEVEL);
        let voxel_m = volume.grid().spacing_mm * 1e-3;
        let placement = Placement {
            origin: Vector3::from_fn(|i, _| grid.first_voxel[i] as f64 * voxel_m),
            unit: VOXELS_PER_CELL as f64 * voxel_m / f64::from(lattice.units),
        };
        let domain = Domain::of_labels(lattice, &tree);
        Ok(Self {
            forest: BisectionForest::new(domain, Arc::clone(&tree), 0, MAX_LEVEL)?,
            held: held_box(&volume),
            materials: organ_materials()?,
            volume,
            tree,
            placement,
        })
    }

    /// The body of the finer start mesh that has at most `free` free vertices, the coarser one if
    /// neither has.
    pub(crate) fn with_at_most(free: usize) -> Result<Self> {
        let full = Self::new(Size::Full)?;
        if full.free_vertices().count() <= free { Ok(full) } else { Self::new(Size::Quick) }
    }

    /// Rest position of a lattice point, m.
    pub fn rest(&self, point: Point) -> Vector3<f64> {
        self.placement.position(point)
    }

    /// Vertices of the start mesh that are not fixed, ascending.
    pub fn free_vertices(&self) -> impl Iterator<Item = VertexId> + '_ {
        let [low, high] = &self.held;
        self.forest.vertices().filter(|&v| {
            let x = self.rest(self.forest.point(v));
            (0..3).any(|i| x[i] < low[i] || x[i] > high[i])
        })
    }

    /// The organ's material on all levels, by a homogenisation's scene name.
    /// # Errors
    /// `BenchError::Embed` if there is no such homogenisation or it fails.
    pub fn embedding(&self, homogenisation: &str) -> Result<Embedding> {
        let stage = by_name(homogenisation)?;
        Ok(Embedding::new(Arc::clone(&self.tree), self.materials.clone(), stage)?)
    }

    /// The elements of the start mesh, unrotated.
    pub fn body(&self, embedding: &Embedding) -> Body {
        let mut body = Body::new();
        elements_of(&self.forest, &self.placement, embedding).for_each(|e| body.insert(e));
        body
    }

    /// Rest positions of the start mesh by vertex number, m.
    pub fn rest_positions(&self) -> Vec<Vector3<f64>> {
        let mut rest = vec![Vector3::zeros(); self.forest.vertex_capacity()];
        for v in self.forest.vertices() {
            rest[v.index()] = self.rest(self.forest.point(v));
        }
        rest
    }
}

/// The elements of a forest's leaves, unrotated.
pub(crate) fn elements_of<'a>(
    forest: &'a BisectionForest,
    placement: &'a Placement,
    embedding: &'a Embedding,
) -> impl Iterator<Item = Element> + 'a {
    forest.leaves().map(|tet| {
        let corners = tet.vertices.map(|v| placement.position(forest.point(v)));
        Element {
            tet: tet.id,
            vertices: tet.vertices.map(VertexId::index),
            geometry: LinearTet::new(&corners),
            elasticity: embedding.elasticity(tet.node),
        }
    })
}

pub(crate) fn held_box(volume: &LabelVolume) -> [Vector3<f64>; 2] {
    // A volume without a voxel inside was refused with its grid of cells.
    let [low, high] = volume.bounding_box().unwrap_or_default();
    let voxel_m = volume.grid().spacing_mm * 1e-3;
    // Vertices on the box's faces belong to it, up to rounding.
    let slack = 1e-6 * voxel_m;
    [(0, -slack), (1, slack)].map(|(side, outward)| {
        Vector3::from_fn(|i, _| {
            let size = (high[i] + 1 - low[i]) as f64;
            (low[i] as f64 + HELD[side][i] * size) * voxel_m + outward
        })
    })
}

/// The phantom's materials by dense label.
pub(crate) fn organ_materials() -> Result<Vec<Material>> {
    let tissues = TISSUES.map(|(_, young, poisson_ratio, density)| (young, poisson_ratio, density));
    let material = |(young, poisson_ratio, density)| Material::new(young, poisson_ratio, density);
    Ok([VOID].into_iter().chain(tissues).map(material).collect::<Result<_, _>>()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bodies_have_the_documented_size_and_are_held() {
        for (size, want) in [(Size::Full, 736.0), (Size::Quick, 150.0)] {
            let organ = Organ::new(size).unwrap();
            let count = organ.forest.vertex_count() as f64;
            assert!((count / want - 1.0).abs() < 0.15, "{size:?}: {count} vertices");
            let free = organ.free_vertices().count() as f64;
            assert!(free < count - 3.0 && free > 0.5 * count, "{free} of {count} are free");
            assert_eq!(organ.forest.domain().components().len(), 1);
            // Dense labels are the tissues in order.
            assert_eq!(organ.volume.values()[1..], TISSUES.map(|tissue| tissue.0));
            assert_eq!(organ.materials.len(), organ.volume.values().len());
        }
    }
}
