//! How much of the body each fixed region and each tool of a scene has.

use nalgebra::Vector3;
use serde::Serialize;
use yawara_corot::WeightedPoint;
use yawara_mesh::VertexId;

use super::at_rest::BodyAtRest;
use crate::body::{Hold, Start, Zone};
use crate::error::SimError;
use crate::scene::{GrabHold, LoadEntry, Region, Scene, SupportHold, ToolEntry};

/// What a fixed region or a tool holds or loads of the body at rest; a probe has none.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Holding {
    /// Its key in the scene, e.g. `tools[1]`.
    pub key: String,
    /// `fixed`, or the kind of the tool.
    pub kind: &'static str,
    /// Voxels that are not void and that it has any of, of a body from an image.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub voxels: Option<usize>,
    /// Volume of the material, cm³; of a flat region that of a layer of one voxel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume_cm3: Option<f64>,
    /// Vertices of the start mesh.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vertices: Option<usize>,
    /// Area of the surface, cm².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub area_cm2: Option<f64>,
    /// Radius of a ball that pushes the surface, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius_mm: Option<f64>,
    /// Where it is, solver axes, m.
    #[serde(skip)]
    pub places: Vec<Vector3<f64>>,
}

impl Holding {
    /// How much it is, e.g. `120 voxels, 15.00 cm³`.
    pub fn in_words(&self) -> String {
        let mut words = Vec::new();
        words.extend(self.voxels.map(|n| format!("{n} voxels")));
        words.extend(self.volume_cm3.map(|volume| format!("{volume:.2} cm³")));
        words.extend(self.vertices.map(|n| format!("{n} vertices")));
        words.extend(self.area_cm2.map(|area| format!("{area:.2} cm² of the surface")));
        words.extend(self.radius_mm.map(|mm| format!("ball of radius {mm} mm")));
        match words.is_empty() {
            true => "a point".into(),
            false => words.join(", "),
        }
    }

    /// Of `zone` but `others`.
    fn of_material(
        mut self,
        points: Vec<WeightedPoint>,
        start: &Start,
        zone: &Zone,
        others: &[Zone],
    ) -> Self {
        // A region too small for any voxel has the nearest point.
        let least = usize::from(!points.is_empty());
        self.voxels = start.voxels_in(zone, others).map(|voxels| voxels.max(least));
        self.volume_cm3 = Some(1e6 * points.iter().map(|point| point.weight).sum::<f64>());
        self.places = points.into_iter().map(|point| point.rest).collect();
        self
    }

    fn of_vertices(mut self, start: &Start, is_held: impl Fn(&VertexId) -> bool) -> Self {
        let held = start.vertices.iter().filter(|v| is_held(v));
        self.places = held.map(|v| start.rest[v.index()]).collect();
        self.vertices = Some(self.places.len());
        self
    }

    fn of_surface(mut self, region: &Region, body: &mut BodyAtRest<'_>) -> Result<Self, SimError> {
        let patch = body.surface_patch(&self.key, region)?;
        self.area_cm2 = Some(1e4 * (0..patch.len()).map(|i| patch.area(i).norm()).sum::<f64>());
        self.places = patch.rest().to_vec();
        Ok(self)
    }

    fn of_load(mut self, load: &LoadEntry, body: &mut BodyAtRest<'_>) -> Result<Self, SimError> {
        if let Some(at_mm) = load.at_mm {
            self.places = vec![body.material_at(&self.key, at_mm)?];
            return Ok(self);
        }
        let Some(region) = &load.region else { return Ok(self) };
        if load.load.iter().any(|at| at.traction_pa.is_some()) {
            return self.of_surface(region, body);
        }
        let points = body.material_inside(&self.key, region)?;
        let zone = body.zone(&self.key, region)?;
        Ok(self.of_material(points, body.start(), &zone, &[]))
    }
}

/// What each fixed region, then each tool of the scene has of `body`, whose vertices they hold already.
///
/// # Errors
/// As for the tools themselves.
pub(crate) fn holdings(scene: &Scene, body: &mut BodyAtRest<'_>) -> Result<Vec<Holding>, SimError> {
    let mut all = Vec::new();
    let start = body.start();
    for (i, zone) in start.fixed.iter().enumerate() {
        let holding = Holding { key: format!("fixed[{i}]"), kind: "fixed", ..Holding::default() };
        all.push(match scene.support.hold {
            SupportHold::Vertices => {
                let is_in =
                    |v: &VertexId| zone.contains(&start.places.organ, &start.rest[v.index()]);
                holding.of_vertices(start, is_in)
            }
            SupportHold::Elastic => {
                holding.of_material(start.held_by(i), start, zone, &start.fixed[..i])
            }
        });
    }
    for (i, tool) in scene.tools.iter().enumerate() {
        let key = format!("tools[{i}]");
        let holding = Holding { key: key.clone(), kind: tool.kind(), ..Holding::default() };
        all.push(match tool {
            ToolEntry::Grab(grab) if grab.hold == GrabHold::Vertices => {
                holding.of_vertices(start, |&v| body.held_by(v) == Hold::Grabbed(i))
            }
            ToolEntry::Grab(grab) => {
                let points = body.material_points(&key, &grab.region)?;
                holding.of_material(points, start, &body.zone(&key, &grab.region)?, &[])
            }
            ToolEntry::Probe(probe) => Holding { radius_mm: Some(1e3 * probe.radius_m), ..holding },
            ToolEntry::Scalpel(_) => holding,
            ToolEntry::Resect(one) | ToolEntry::Coagulate(one) | ToolEntry::Suture(one) => {
                Holding { radius_mm: Some(1e3 * one.radius_m), ..holding }
            }
            ToolEntry::Pressure(pressure) => holding.of_surface(&pressure.region, body)?,
            ToolEntry::Load(load) => holding.of_load(load, body)?,
        });
    }
    Ok(all)
}
