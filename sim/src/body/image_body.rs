//! From a scene to labels, domain, materials and the start mesh.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::Vector3;
use yawara_embed::Material;
use yawara_mesh::volume::LabelVolume;
use yawara_mesh::{
    BisectionForest, CellGrid, Domain, LabelTree, Lattice, Part, Placement, VertexId,
};

use super::axes::ScannerAxes;
use super::components::{self, spans_a_plane};
use super::image_source::ImageSource;
use super::organ_box::{OrganBox, Zone};
use super::places::{FileVoxels, Places};
use super::summary::{BodySummary, DomainSummary, ImageSummary, TopologySummary};
use super::{label_refinement, material_points};
use crate::error::SimError;
use crate::scene::{Image, Scene, SupportHold};

/// Base cells along the longest side of a body where a scene gives no `base_mm`.
const BASE_CELLS: f64 = 10.0;

/// What a body is made of, before anything moves.
pub(crate) struct ImageBody {
    /// Image, parts and label refinement, for the plan and the summary.
    pub summary: BodySummary,
    pub volume: LabelVolume,
    pub tree: Arc<LabelTree>,
    pub forest: BisectionForest,
    /// The forest before what nothing joins was taken apart, and the contents of what came of that.
    pub apart: Option<(BisectionForest, Vec<Part>)>,
    pub placement: Placement,
    /// One material per dense label; entry 0 stands for void.
    pub materials: Vec<Material>,
    /// The position of each in the scene; none of void.
    pub positions: Vec<Option<usize>>,
    pub places: Places,
    /// What `[[fixed]]` holds.
    pub fixed: Vec<Zone>,
    /// Edge of a base cell, m.
    pub base_m: f64,
    /// By start vertex number: true where it touches a voxel that is not void.
    pub solid: Vec<bool>,
}

impl ImageBody {
    /// Reads the image and builds everything that does not depend on stages.
    pub fn new(scene: &Scene, volume: Option<LabelVolume>) -> Result<Self, SimError> {
        let source = match volume {
            Some(volume) => ImageSource::of_memory(scene, volume)?,
            None => ImageSource::read(scene)?,
        };
        let (materials, positions) = (source.materials(scene)?, source.positions());
        let ImageSource { volume, axes, summary: image, .. } = source;
        let organ = OrganBox::of(&volume).ok_or(SimError::Empty(image.name.clone()))?;
        if scene.image.path.is_some() && scene.image.unit.is_none() {
            check_size(&image, &organ)?;
        }
        let places = Places {
            name: image.name.clone(),
            organ,
            axes: ScannerAxes::of_grid(volume.grid()),
            voxels: Some(FileVoxels::new(axes, &image)),
        };
        let fixed = places.fixed(scene)?;
        let voxel_mm = volume.grid().spacing_mm;
        check_base(scene, &organ, voxel_mm)?;
        let base_mm = scene.mesh.base_mm.unwrap_or_else(|| organ.longest_mm() / BASE_CELLS);
        let voxels_per_cell = voxels_per_cell(base_mm, voxel_mm);
        let grid = CellGrid::around(&volume, voxels_per_cell)?;
        let tree = Arc::new(LabelTree::new(&volume, grid)?);
        let lattice = Lattice::new(grid.cells, scene.mesh.finest_level());
        let base_m = voxels_per_cell as f64 * voxel_mm * 1e-3;
        let placement = grid.placement(voxel_mm * 1e-3, &lattice);
        let mut setup = Self {
            summary: BodySummary {
                image,
                domain: DomainSummary::default(),
                label_refinement: None,
                topology: TopologySummary::default(),
            },
            volume,
            forest: start_forest(scene, Domain::of_labels(lattice, &tree), &tree)?,
            tree,
            apart: None,
            placement,
            materials,
            positions,
            places,
            fixed,
            base_m,
            solid: Vec::new(),
        };
        setup.drop_unheld_components(scene)?;
        setup.summary.label_refinement =
            label_refinement::refine(&mut setup.forest, scene, &setup.places, &placement)?;
        if scene.mesh.topology.is_merged() {
            setup.summary.topology.unjoined = setup.forest.unjoined().len();
        } else {
            setup.separate(scene)?;
        }
        setup.solid = vec![false; setup.forest.vertex_capacity()];
        for v in setup.forest.vertices() {
            setup.solid[v.index()] = touches_solid(&setup.volume, &setup.rest(v));
        }
        Ok(setup)
    }

    /// Takes apart what no face of a voxel joins.
    fn separate(&mut self, scene: &Scene) -> Result<(), SimError> {
        let limit = scene.mesh.max_vertices;
        let before = self.forest.vertex_count();
        let unjoined = self.forest.refine_unjoined(scene.mesh.apart_level(), limit)?;
        self.summary.topology.refined = self.forest.vertex_count() - before;
        if self.summary.topology.refined > 0 {
            // Coarser again it would hang together.
            self.forest.make_floor();
        }
        self.summary.topology.unjoined = unjoined.len();
        let whole = self.forest.clone();
        let delta = self.forest.separate(&unjoined)?;
        let count = self.forest.vertex_count();
        if count > limit {
            return Err(SimError::TooManyVertices { count, limit });
        }
        self.summary.topology.doubled = delta.recast.len();
        self.summary.topology.vertices = delta.doubled.len();
        self.apart = Some((whole, delta.parts));
        Ok(())
    }

    /// What the image is called in messages.
    pub fn image_name(&self) -> &str {
        &self.summary.image.name
    }

    /// Length of a cube's edge at the start level, m.
    pub fn start_edge_m(&self) -> f64 {
        self.base_m / f64::from(1u32 << (self.forest.start_level() / 3))
    }

    /// Edge of the cube that six tetrahedra of a level fill, m.
    pub fn edge_m(&self, level: u8) -> f64 {
        self.base_m / (f64::from(level) / 3.0).exp2()
    }

    /// Rest position of a vertex, m.
    pub fn rest(&self, vertex: VertexId) -> Vector3<f64> {
        self.placement.position(self.forest.point(vertex))
    }

    fn nothing_fixed(&self) -> SimError {
        SimError::NothingFixed(self.image_name().into(), self.base_m * 1e3)
    }

    /// What fixed regions hold of the start mesh's vertices or of the material, by the base cells
    /// around it.
    fn fixed_places(&self, scene: &Scene) -> BTreeMap<usize, Vec<Vector3<f64>>> {
        let mut places: BTreeMap<usize, Vec<Vector3<f64>>> = BTreeMap::new();
        if scene.support.hold == SupportHold::Elastic {
            let voxel_m = self.volume.grid().spacing_mm * 1e-3;
            for zone in &self.fixed {
                let points = material_points::of_volume(&self.volume, &self.places.organ, zone);
                for point in &points {
                    // A face between two voxels, up to rounding, belongs to the cells of both.
                    let [below, above] = [-1e-6, 1e-6].map(|off| {
                        let voxel = point.rest.map(|x| (x / voxel_m + off).floor() as i64);
                        self.tree.grid().cell_of(voxel.into())
                    });
                    places.entry(below).or_default().push(point.rest);
                    if above != below {
                        places.entry(above).or_default().push(point.rest);
                    }
                }
            }
            return places;
        }
        let lattice = *self.forest.domain().lattice();
        for v in self.forest.vertices() {
            let x = self.rest(v);
            let fixes = |zone: &Zone| zone.contains(&self.places.organ, &x);
            if self.fixed.iter().any(fixes) && touches_solid(&self.volume, &x) {
                for cell in lattice.cells_around(self.forest.point(v)) {
                    places.entry(cell).or_default().push(x);
                }
            }
        }
        places
    }

    /// Groups of base cells that hang together by faces but are not held could move freely or
    /// turn about an edge: they are taken out and counted.
    fn drop_unheld_components(&mut self, scene: &Scene) -> Result<(), SimError> {
        let fixed = self.fixed_places(scene);
        // With inertia nothing need be held.
        let all = scene.dynamics.is_some();
        if fixed.is_empty() && !all {
            return Err(self.nothing_fixed());
        }
        let mut domain = self.forest.domain().clone();
        let components = domain.components();
        let is_held = |component: &[usize]| {
            let held = component.iter().filter_map(|cell| fixed.get(cell)).flatten();
            spans_a_plane(&held.copied().collect::<Vec<_>>())
        };
        let voxels = components::solid_voxels(&self.volume, self.tree.grid());
        let found = components::summary(&components, |part| all || is_held(part), &voxels);
        if found.kept == 0 {
            return Err(self.nothing_fixed());
        }
        let (parts, cells, voxels) = found.total(false);
        if parts > 0 {
            tracing::warn!(
                "{parts} part(s) of {} ({cells} base cells, {voxels} voxels) are not held by a \
                 fixed region and left out",
                self.image_name(),
            );
            for (component, part) in components.iter().zip(&found.parts) {
                if !part.kept {
                    domain.exclude(component);
                }
            }
            self.forest = start_forest(scene, domain, &self.tree)?;
        }
        self.summary.domain = found;
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
pub(crate) fn touches_solid(volume: &LabelVolume, x: &Vector3<f64>) -> bool {
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

/// Refuses what is no organ of any animal but an image in another unit. Voxels larger than the image make
/// a body no larger.
fn check_size(image: &ImageSummary, organ: &OrganBox) -> Result<(), SimError> {
    let whole = |i: usize| image.stored_dims[i] as f64 * image.stored_voxel_mm[i];
    let body = organ.size_mm();
    let size_mm = [0, 1, 2].map(|i| body[i].min((whole(i) * 1e3).round() / 1e3));
    match Image::LIKELY_MM.contains(&size_mm.into_iter().fold(0.0, f64::max)) {
        true => Ok(()),
        false => Err(SimError::BodySize { image: image.name.clone(), size_mm }),
    }
}

/// A base cell may be as large as what a power of two of voxels makes of the body's longest side.
fn check_base(scene: &Scene, organ: &OrganBox, voxel_mm: f64) -> Result<(), SimError> {
    let most = 2.0 * organ.longest_mm().max(voxel_mm);
    match scene.mesh.base_mm {
        Some(base) if base > most => {
            let want = format!("at most {most:.3}, twice the longest side of the body");
            Err(SimError::value(&scene.name, "mesh.base_mm", base, want))
        }
        _ => Ok(()),
    }
}

/// The power of two of voxels nearest (in ratio) to a base edge.
pub(crate) fn voxels_per_cell(base_mm: f64, voxel_mm: f64) -> usize {
    let power = (base_mm / voxel_mm).log2().round().clamp(0.0, 10.0);
    1 << power as u32
}
