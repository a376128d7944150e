//! Embedded surfaces: the outlines of labels at voxel size, carried along by the coarse mesh.

use std::borrow::Cow;
use std::cell::RefCell;
use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};
use yawara_corot::rotation::polar_warm;
use yawara_embed::{DetailMesh, Embedding, Follower};
use yawara_mesh::isosurface::{IsoSurface, Outline, Outlines, volume};
use yawara_mesh::volume::LabelVolume;
use yawara_mesh::{BisectionForest, Placement};

use super::opened::{Gaps, Opened};
use super::records::{SurfaceFrame, SurfaceSummary};
use crate::body::{ScannerAxes, cut, cut_for_the_eye, surface_level};
use crate::error::SimError;
use crate::scene::Scene;

/// A surface as the mesh carries it, m.
pub(crate) struct Carried<'a> {
    /// The label as in the image; 0 of all that is not void.
    pub label: i64,
    pub triangles: Cow<'a, [[u32; 3]]>,
    pub rest: Cow<'a, [Vector3<f64>]>,
    pub now: Vec<Vector3<f64>>,
}

/// A surface and where its vertices rest, m.
struct Part {
    /// As in the image; 0 for all that is not void.
    label: i64,
    surface: IsoSurface,
    rest: Vec<Vector3<f64>>,
}

/// All surfaces of a scene, on one fine mesh.
pub(crate) struct Surfaces {
    detail: DetailMesh,
    /// Where the ends of cut edges were last; what has not moved is not computed again.
    follower: RefCell<Follower>,
    /// Of the fine mesh.
    placement: Placement,
    parts: Vec<Part>,
}

impl Surfaces {
    /// The surfaces that a scene asks for: a mesh refined to the labels down to
    /// `output.surface_level`, cut at level ½ of each blurred label.
    pub fn new(
        scene: &Scene,
        coarse: &BisectionForest,
        volume: &LabelVolume,
        embedding: &Embedding,
    ) -> Result<Option<Self>, SimError> {
        let asked = &scene.output.surfaces;
        if asked.is_empty() {
            return Ok(None);
        }
        let mut outlines = Vec::new();
        for (i, one) in asked.iter().enumerate() {
            let label = dense_label(volume, one.label).ok_or_else(|| {
                let want = "a label that occurs in the image";
                let key = format!("output.surfaces[{i}].label");
                SimError::value(&scene.name, &key, one.label, want)
            })?;
            outlines.push(Outline { label, sigma_voxels: one.sigma_voxels });
        }
        let Outlines { forest, placement, rest, surfaces } =
            cut(coarse, volume, surface_level(scene, coarse), &outlines)?;
        let mut parts = Vec::new();
        for (i, (one, surface)) in asked.iter().zip(surfaces).enumerate() {
            let blurred_away = |label: i64| {
                let dense = dense_label(volume, label);
                dense.is_some_and(|dense| volume.labels().contains(&dense))
            };
            if surface.triangles.is_empty() && blurred_away(one.label) {
                tracing::warn!(
                    "label {} has no surface: a blur of {} voxels takes it below one half \
                     everywhere; choose a smaller output.surfaces[{i}].sigma_voxels",
                    one.label,
                    one.sigma_voxels
                );
            }
            parts.push((one.label, surface));
        }
        let detail = DetailMesh::embedded(forest, embedding, placement.unit)?;
        Ok(Some(Self::on(detail, placement, &rest, parts)?))
    }

    /// The outline of all that is not void, as fine as eyes want it; its label is 0.
    fn of_body(coarse: &BisectionForest, labels: &LabelVolume) -> Result<Self, SimError> {
        let Outlines { forest, placement, rest, surfaces } = cut_for_the_eye(coarse, labels)?;
        let parts = surfaces.into_iter().map(|surface| (0, surface)).collect();
        // Beside void no material moves a vertex out of the middle of its edge.
        Self::on(DetailMesh::new(forest), placement, &rest, parts)
    }

    fn on(
        detail: DetailMesh,
        placement: Placement,
        rest: &[Vector3<f64>],
        surfaces: Vec<(i64, IsoSurface)>,
    ) -> Result<Self, SimError> {
        let mut parts = Vec::with_capacity(surfaces.len());
        for (label, surface) in surfaces {
            let rest = surface.positions(rest)?;
            parts.push(Part { label, surface, rest });
        }
        let ends = parts.iter().flat_map(|part| &part.surface.vertices).flat_map(|v| v.edge);
        let follower = RefCell::new(Follower::new(&detail, ends));
        Ok(Self { detail, follower, placement, parts })
    }

    /// The labels of the surfaces.
    #[cfg(feature = "view")]
    pub fn labels(&self) -> Vec<i64> {
        self.parts.iter().map(|part| part.label).collect()
    }

    /// Every surface as the mesh `forest` with its vertices at `positions`, m, carries it. What is apart in the mesh is in
    /// the surfaces, which have other triangles then.
    ///
    /// # Errors
    /// [`SimError::Surface`] if a position is not finite.
    pub fn carried(
        &self,
        forest: &BisectionForest,
        positions: &[Vector3<f64>],
    ) -> Result<Vec<Carried<'_>>, SimError> {
        let mut follower = self.follower.borrow_mut();
        let now = follower.follow(&self.detail, forest, positions, &rotation)?;
        let units = self.detail.forest().domain().lattice().units / forest.domain().lattice().units;
        let placement =
            Placement { unit: self.placement.unit * f64::from(units), ..self.placement };
        let gaps = Gaps::of(forest, placement);
        let carried = |part| {
            let Part { label, surface, rest }: &Part = part;
            let label = *label;
            let now = surface.positions(now)?;
            let Some(gaps) = &gaps else {
                let (triangles, rest) = (surface.triangles[..].into(), rest[..].into());
                return Ok(Carried { label, triangles, rest, now });
            };
            let shows = |dense: u16| label == 0 || dense == surface.label;
            let opened = gaps.open(surface, [rest.clone(), now], positions, shows);
            let Opened { triangles, rest, now } = opened;
            Ok(Carried { label, triangles: triangles.into(), rest: rest.into(), now })
        };
        self.parts.iter().map(carried).collect()
    }

    /// Every surface as the active mesh carries it, scanner RAS.
    pub fn frames(
        &self,
        forest: &BisectionForest,
        positions: &[Vector3<f64>],
        axes: &ScannerAxes,
    ) -> Result<Vec<SurfaceFrame>, SimError> {
        let frame = |carried: Carried<'_>| {
            let Carried { label, triangles, rest, now } = carried;
            let moved = rest.iter().zip(&now).map(|(rest, now)| (now - rest) * 1e3);
            SurfaceFrame {
                label,
                triangles: triangles.into_owned(),
                displacement_mm: moved.map(|u| axes.to_ras_direction(&u)).collect(),
                points_mm: now.iter().map(|x| axes.to_ras_mm(x)).collect(),
            }
        };
        Ok(self.carried(forest, positions)?.into_iter().map(frame).collect())
    }

    /// Sizes at rest and now.
    pub fn summary(
        &self,
        forest: &BisectionForest,
        positions: &[Vector3<f64>],
    ) -> Result<Vec<SurfaceSummary>, SimError> {
        let carried = self.carried(forest, positions)?;
        let both = self.parts.iter().zip(&carried);
        both.map(|(Part { label, surface, rest }, carried)| {
            Ok(SurfaceSummary {
                label: *label,
                triangles: surface.triangles.len(),
                pieces: surface.component_count(),
                area_rest_m2: surface.area(rest)?,
                // Without a triangle it is −0.
                volume_rest_m3: surface.volume(rest)? + 0.0,
                volume_end_m3: volume(&carried.triangles, &carried.now) + 0.0,
            })
        })
        .collect()
    }
}

/// The outline of all that is not void, cut when the first frame is asked for.
pub(crate) struct BodyOutline(RefCell<Stage>);

enum Stage {
    /// The labels that it is cut from.
    Asked(Arc<LabelVolume>),
    Cut(Box<Surfaces>),
}

impl BodyOutline {
    pub fn new(labels: Arc<LabelVolume>) -> Self {
        Self(RefCell::new(Stage::Asked(labels)))
    }

    /// The labels that it is cut from; none once it is cut.
    #[cfg(feature = "view")]
    pub fn labels(&self) -> Option<Arc<LabelVolume>> {
        match &*self.0.borrow() {
            Stage::Asked(labels) => Some(Arc::clone(labels)),
            Stage::Cut(_) => None,
        }
    }

    /// The outline itself, to be carried along elsewhere.
    ///
    /// # Errors
    /// [`SimError::Surface`] if it can't be cut.
    #[cfg(feature = "view")]
    pub fn into_surfaces(self, forest: &BisectionForest) -> Result<Surfaces, SimError> {
        match self.0.into_inner() {
            Stage::Asked(labels) => Surfaces::of_body(forest, &labels),
            Stage::Cut(surfaces) => Ok(*surfaces),
        }
    }

    /// Cuts the outline beside `forest`, unless that is done.
    ///
    /// # Errors
    /// [`SimError::Surface`] if it can't be cut.
    pub fn cut(&self, forest: &BisectionForest) -> Result<(), SimError> {
        let mut stage = self.0.borrow_mut();
        if let Stage::Asked(labels) = &*stage {
            *stage = Stage::Cut(Box::new(Surfaces::of_body(forest, labels)?));
        }
        Ok(())
    }

    /// The outline as the active mesh carries it, scanner RAS; its label is 0.
    pub fn frame(
        &self,
        forest: &BisectionForest,
        positions: &[Vector3<f64>],
        axes: &ScannerAxes,
    ) -> Result<Option<SurfaceFrame>, SimError> {
        self.cut(forest)?;
        match &*self.0.borrow() {
            Stage::Cut(surfaces) => Ok(surfaces.frames(forest, positions, axes)?.pop()),
            Stage::Asked(_) => Ok(None),
        }
    }
}

/// Found from the gradient alone, so that a position does not depend on the way to it.
pub(crate) fn rotation(f: &Matrix3<f64>) -> Matrix3<f64> {
    polar_warm(f, &Matrix3::identity())
}

fn dense_label(volume: &LabelVolume, label: i64) -> Option<u16> {
    let at = volume.values().iter().position(|&value| value == label)?;
    u16::try_from(at).ok().filter(|&dense| dense > 0)
}
