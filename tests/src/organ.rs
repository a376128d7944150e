//! Small inhomogeneous bodies with real forests, embeddings and rings.

use std::sync::Arc;

use nalgebra::Vector3;
use proptest::prelude::*;
use yawara_corot::Element;
use yawara_embed::{
    ElementFormulation, Embedding, Homogenisation, LinearTet, Material, P1, RingStiffness, by_name,
};
use yawara_mesh::volume::{Grid, LabelVolume};
use yawara_mesh::{
    BisectionForest, CellGrid, Domain, LabelTree, Lattice, MeshDelta, Placement, Tet, VertexId,
};

/// A box of base cells of 4³ voxels whose labels are drawn freely.
#[derive(Clone, Debug)]
pub struct Organ {
    /// Base cells along x, y, z.
    pub cells: [usize; 3],
    /// One label (1..) per voxel, x fastest.
    pub labels: Vec<u16>,
    /// Material of labels 1, 2, ...
    pub materials: Vec<(f64, f64)>,
}

/// Voxels along a base cell.
const VOXELS: usize = 4;

/// Voxel edge, mm.
const VOXEL_MM: f64 = 2.5;

impl Organ {
    /// All voxels of one material.
    pub fn homogeneous(cells: [usize; 3], young_modulus_pa: f64, poisson_ratio: f64) -> Self {
        let voxels = cells.iter().product::<usize>() * VOXELS.pow(3);
        Self { cells, labels: vec![1; voxels], materials: vec![(young_modulus_pa, poisson_ratio)] }
    }

    /// The labels as a volume.
    pub fn volume(&self) -> LabelVolume {
        let dims = self.cells.map(|n| n * VOXELS);
        let values = (0..=self.materials.len() as i64).collect();
        LabelVolume::new(Grid::centred(dims, VOXEL_MM), self.labels.clone(), values).unwrap()
    }

    /// The label tree.
    pub fn tree(&self) -> Arc<LabelTree> {
        let grid = CellGrid { cells: self.cells, voxels_per_cell: VOXELS, first_voxel: [0, 0, 0] };
        Arc::new(LabelTree::new(&self.volume(), grid).unwrap())
    }

    /// The start mesh.
    pub fn forest(&self, start_level: u8, max_level: u8) -> BisectionForest {
        let domain = Domain::full(Lattice::new(self.cells, max_level));
        BisectionForest::new(domain, self.tree(), start_level, max_level).unwrap()
    }

    /// Where a forest down to `max_level` lies.
    pub fn placement(&self, max_level: u8) -> Placement {
        let base_m = VOXELS as f64 * VOXEL_MM * 1e-3;
        let unit = base_m / f64::from(Lattice::new(self.cells, max_level).units);
        Placement { origin: Vector3::new(0.01, -0.02, 0.005), unit }
    }

    /// The embedding by a named homogenisation.
    pub fn embedding(&self, homogenisation: &str) -> Embedding {
        self.embedding_by(by_name(homogenisation).unwrap())
    }

    /// The embedding by any homogenisation.
    pub fn embedding_by(&self, homogenisation: Box<dyn Homogenisation>) -> Embedding {
        let solid = self.materials.iter().map(|&(e, nu)| Material::new(e, nu, 1000.0).unwrap());
        let void = Material::new(1.0, 0.0, 0.0).unwrap();
        let materials = std::iter::once(void).chain(solid).collect();
        Embedding::new(self.tree(), materials, homogenisation).unwrap()
    }
}

/// Organs of a few cells with up to `labels` labels in blobs, E in 10^`exponents` Pa.
pub fn organs(
    cells: [usize; 3],
    labels: u16,
    exponents: std::ops::Range<f64>,
    poisson: std::ops::Range<f64>,
) -> impl Strategy<Value = Organ> {
    let voxels = cells.iter().product::<usize>() * VOXELS.pow(3);
    let material = (exponents, poisson).prop_map(|(e, nu)| (10f64.powf(e), nu));
    (
        proptest::collection::vec(1..=labels, voxels),
        proptest::collection::vec(material, usize::from(labels)),
        0..=1u8,
    )
        .prop_map(move |(mut drawn, materials, noisy)| {
            if noisy == 0 {
                // Blocks of one label, so that homogeneous subtrees occur too.
                let [nx, ny, _] = cells.map(|n| n * VOXELS);
                for i in 0..drawn.len() {
                    let (x, y, z) = (i % nx, i / nx % ny, i / (nx * ny));
                    drawn[i] = drawn[x / 2 * 2 + nx * (y / 2 * 2 + ny * (z / 2 * 2))];
                }
            }
            Organ { cells, labels: drawn, materials }
        })
}

/// The tetrahedra of a forest, unturned.
pub fn elements(
    forest: &BisectionForest,
    placement: &Placement,
    embedding: &Embedding,
) -> impl Iterator<Item = Element> {
    forest.leaves().map(|tet| element(forest, placement, embedding, &tet))
}

/// One of them.
pub fn element(
    forest: &BisectionForest,
    placement: &Placement,
    embedding: &Embedding,
    tet: &Tet,
) -> Element {
    Element {
        tet: tet.id,
        vertices: tet.vertices.map(VertexId::index),
        geometry: LinearTet::new(&tet.vertices.map(|v| placement.position(forest.point(v)))),
        elasticity: embedding.elasticity(tet.node),
    }
}

/// The hand-over of a split or merge of an organ's forest.
pub fn ring(
    forest: &BisectionForest,
    placement: &Placement,
    embedding: &Embedding,
    delta: &MeshDelta,
) -> RingStiffness {
    P1.ring(delta, embedding, &|v: VertexId| placement.position(forest.point(v)))
}
