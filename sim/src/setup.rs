//! From a scene to labels, domain, materials and the start mesh.

use std::sync::Arc;

use nalgebra::Vector3;
use yawara_embed::Material;
use yawara_mesh::phantom::{LiverPhantom, block, liver};
use yawara_mesh::volume::{LabelVolume, read_labels_with};
use yawara_mesh::{BisectionForest, CellGrid, Domain, LabelTree, Lattice, Placement, VertexId};

use crate::error::SimError;
use crate::scene::{Image, Phantom, Region, Scene};
use crate::start::spans_a_plane;

/// What a body is made of, before anything moves.
pub(crate) struct Setup {
    /// What the image is called in messages.
    pub image_name: String,
    /// Where its voxels come from and whether they were resampled.
    pub image_done: String,
    pub volume: LabelVolume,
    pub tree: Arc<LabelTree>,
    pub forest: BisectionForest,
    pub placement: Placement,
    /// One material per dense label; entry 0 stands for void.
    pub materials: Vec<Material>,
    pub organ: OrganBox,
    /// Edge of a base cell, m.
    pub base_m: f64,
    /// By start vertex number: true where it touches a voxel that is not void.
    pub solid: Vec<bool>,
    /// Face-connected groups of base cells that nothing holds, and their cells.
    pub excluded_components: usize,
    pub excluded_cells: usize,
}

/// The bounding box of all non-void voxels, in solver coordinates (m).
#[derive(Clone, Copy, Debug)]
pub(crate) struct OrganBox {
    pub low: Vector3<f64>,
    pub high: Vector3<f64>,
}

impl OrganBox {
    fn of(volume: &LabelVolume) -> Option<Self> {
        let [low, high] = volume.bounding_box()?;
        let voxel = volume.grid().spacing_mm * 1e-3;
        let at = |v: [usize; 3], add: usize| Vector3::from_fn(|i, _| (v[i] + add) as f64 * voxel);
        Some(Self { low: at(low, 0), high: at(high, 1) })
    }

    /// Solver position of a point given in fractions of the box.
    pub fn at(&self, fraction: [f64; 3]) -> Vector3<f64> {
        let size = self.high - self.low;
        Vector3::from_fn(|i, _| self.low[i] + fraction[i] * size[i])
    }
}

impl Region {
    /// True where solver position `x` lies in the region.
    pub(crate) fn contains(&self, organ: &OrganBox, x: &Vector3<f64>) -> bool {
        // Vertices that lie on the region's boundary in exact arithmetic belong to it.
        let slack = 1e-9 * (organ.high - organ.low).norm();
        match self {
            Self::Box { min, max } => {
                let (low, high) = (organ.at(*min), organ.at(*max));
                (0..3).all(|i| x[i] >= low[i] - slack && x[i] <= high[i] + slack)
            }
            Self::Sphere { centre, radius_m } => (x - organ.at(*centre)).norm() <= radius_m + slack,
        }
    }

    /// Solver position of its centre.
    pub(crate) fn centre(&self, organ: &OrganBox) -> Vector3<f64> {
        match self {
            Self::Box { min, max } => 0.5 * (organ.at(*min) + organ.at(*max)),
            Self::Sphere { centre, .. } => organ.at(*centre),
        }
    }
}

/// The labels a scene asks for, what to call them in messages, and what was done to them.
fn read_volume(scene: &Scene) -> Result<(LabelVolume, String, String), SimError> {
    let Image { path, phantom, length_mm, size_mm, voxel_mm } = &scene.image;
    if let Some(path) = path {
        let (volume, report) = read_labels_with(path, None)?;
        if let Some(resampling) = report.resampling {
            let [x, y, z] = resampling.from_mm;
            return Err(SimError::Anisotropic { image: path.display().to_string(), x, y, z });
        }
        let done = format!("{} label map", report.format);
        return Ok((volume, path.display().to_string(), done));
    }
    let voxel_mm = voxel_mm.unwrap_or(2.0);
    match phantom {
        Some(Phantom::Liver) => {
            let mut size = LiverPhantom { voxel_mm, seed: scene.seed, ..Default::default() };
            if let Some(length_mm) = length_mm {
                size.length_mm = *length_mm;
            }
            Ok((liver(size)?, "the liver phantom".into(), "procedural".into()))
        }
        Some(Phantom::Block) => {
            let size = size_mm.unwrap_or([voxel_mm; 3]);
            let cells = size.map(|s| (s / voxel_mm).round().max(1.0) as usize);
            Ok((block(cells, voxel_mm)?, "the block phantom".into(), "procedural".into()))
        }
        None => Err(SimError::NoImage { scene: scene.name.clone() }),
    }
}

impl Setup {
    /// Reads the image and builds everything that does not depend on stages.
    pub fn new(scene: &Scene) -> Result<Self, SimError> {
        let (volume, image_name, image_done) = read_volume(scene)?;
        let materials = materials(scene, &volume, &image_name)?;
        let organ = OrganBox::of(&volume).ok_or(SimError::Empty { image: image_name.clone() })?;
        let voxel_mm = volume.grid().spacing_mm;
        let voxels_per_cell = voxels_per_cell(scene.mesh.base_mm.unwrap_or(voxel_mm), voxel_mm);
        let grid = CellGrid::around(&volume, voxels_per_cell)?;
        let tree = Arc::new(LabelTree::new(&volume, grid)?);
        let lattice = Lattice::new(grid.cells, scene.mesh.finest_level());
        let base_m = voxels_per_cell as f64 * voxel_mm * 1e-3;
        let placement = Placement {
            origin: Vector3::from_fn(|i, _| grid.first_voxel[i] as f64 * voxel_mm * 1e-3),
            unit: base_m / f64::from(lattice.units),
        };
        let mut setup = Self {
            image_name,
            image_done,
            volume,
            forest: start_forest(scene, Domain::of_labels(lattice, &tree), &tree)?,
            tree,
            placement,
            materials,
            organ,
            base_m,
            solid: Vec::new(),
            excluded_components: 0,
            excluded_cells: 0,
        };
        setup.drop_unheld_components(scene)?;
        setup.solid = vec![false; setup.forest.vertex_capacity()];
        for v in setup.forest.vertices() {
            setup.solid[v.index()] = touches_solid(&setup.volume, &setup.rest(v));
        }
        Ok(setup)
    }

    /// Length of a cube's edge at the start level, m.
    pub fn start_edge_m(&self) -> f64 {
        self.base_m / f64::from(1u32 << (self.forest.start_level() / 3))
    }

    /// Rest position of a vertex, m.
    pub fn rest(&self, vertex: VertexId) -> Vector3<f64> {
        self.placement.position(self.forest.point(vertex))
    }

    /// True where a scene region fixes `vertex`.
    pub fn is_fixed(&self, scene: &Scene, vertex: VertexId) -> bool {
        let x = self.rest(vertex);
        scene.fixed.iter().any(|region| region.contains(&self.organ, &x))
    }

    fn nothing_fixed(&self) -> SimError {
        SimError::NothingFixed { image: self.image_name.clone(), base_mm: self.base_m * 1e3 }
    }

    /// Groups of base cells that hang together by faces but are not held could move freely or
    /// turn about an edge: they are taken out and counted.
    fn drop_unheld_components(&mut self, scene: &Scene) -> Result<(), SimError> {
        let fixed: Vec<[i32; 3]> = self
            .forest
            .vertices()
            .filter(|&v| self.is_fixed(scene, v) && touches_solid(&self.volume, &self.rest(v)))
            .map(|v| self.forest.point(v))
            .collect();
        if fixed.is_empty() {
            return Err(self.nothing_fixed());
        }
        let mut domain = self.forest.domain().clone();
        let components = domain.components();
        let lattice = *domain.lattice();
        let mut kept = 0;
        for component in components {
            let held: Vec<Vector3<f64>> = fixed
                .iter()
                .filter(|&&p| {
                    lattice.cells_around(p).any(|cell| component.binary_search(&cell).is_ok())
                })
                .map(|&p| self.placement.position(p))
                .collect();
            if spans_a_plane(&held) {
                kept += 1;
                continue;
            }
            self.excluded_components += 1;
            self.excluded_cells += component.len();
            domain.exclude(&component);
        }
        if kept == 0 {
            return Err(self.nothing_fixed());
        }
        if self.excluded_components > 0 {
            tracing::warn!(
                "{} part(s) of {} ({} base cells) are not held by a fixed region and left out",
                self.excluded_components,
                self.image_name,
                self.excluded_cells
            );
            self.forest = start_forest(scene, domain, &self.tree)?;
        }
        Ok(())
    }
}

fn start_forest(
    scene: &Scene,
    domain: Domain,
    tree: &Arc<LabelTree>,
) -> Result<BisectionForest, SimError> {
    let (start, max) = (scene.mesh.start_level, scene.mesh.finest_level());
    let forest = BisectionForest::new(domain, Arc::clone(tree), start, max)?;
    let (count, limit) = (forest.vertex_count(), scene.mesh.max_vertices);
    if count > limit {
        return Err(SimError::TooManyVertices { count, limit });
    }
    Ok(forest)
}

/// True where one of the voxels around solver position `x` is not void.
fn touches_solid(volume: &LabelVolume, x: &Vector3<f64>) -> bool {
    let voxel_m = volume.grid().spacing_mm * 1e-3;
    let dims = volume.grid().dims;
    let range = |axis: usize| {
        let at = x[axis] / voxel_m;
        // A vertex on a voxel boundary, up to rounding, touches both sides.
        let low = (at - 1e-6).floor().max(0.0) as usize;
        let high = (at + 1e-6).floor();
        let end = if high < 0.0 { 0 } else { (high as usize + 1).min(dims[axis]) };
        low..end
    };
    range(2).any(|z| range(1).any(|y| range(0).any(|x| volume.get(x, y, z) != 0)))
}

/// The power of two of voxels nearest (in ratio) to a base edge.
pub(crate) fn voxels_per_cell(base_mm: f64, voxel_mm: f64) -> usize {
    let power = (base_mm / voxel_mm).log2().round().clamp(0.0, 10.0);
    1 << power as u32
}

/// One material per dense label, void first.
fn materials(
    scene: &Scene,
    volume: &LabelVolume,
    image_name: &str,
) -> Result<Vec<Material>, SimError> {
    let counts = volume.counts();
    let mut softest = f64::INFINITY;
    let mut solid = Vec::new();
    for (dense, &value) in volume.values().iter().enumerate().skip(1) {
        let Some(entry) = scene.materials.iter().find(|m| m.label == value) else {
            return Err(SimError::LabelWithoutMaterial {
                label: value,
                image: image_name.into(),
                voxels: counts[dense],
            });
        };
        softest = softest.min(entry.young_modulus_pa);
        solid.push(Material::new(
            entry.young_modulus_pa,
            entry.poisson_ratio,
            entry.density_kg_m3,
        )?);
    }
    if solid.is_empty() {
        return Err(SimError::Empty { image: image_name.into() });
    }
    let void = Material::new(softest * scene.void.stiffness_ratio, scene.void.poisson_ratio, 0.0)?;
    Ok(std::iter::once(void).chain(solid).collect())
}
