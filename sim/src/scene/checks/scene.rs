//! Which values of a scene are in range.

use std::collections::BTreeSet;
use std::path::Path;

use super::check::Check;
use crate::SimError;
use crate::scene::{
    AUTO, Adapter, GoalEntry, Image, LoadEntry, NearProbe, ON_DEVICE, Phantom, ScalpelEntry, Scene,
    StageNames, Support, SupportHold, SurfaceEntry, ToolEntry,
};

/// The most steps of a run.
const MAX_STEPS: usize = 10_000_000;

/// How far a block may be from a whole number of voxels, in voxels.
const VOXEL_SLACK: f64 = 1e-6;

/// The longest time over which a change of the mesh is felt, s.
const EASE_S: f64 = 10.0;

/// The farthest that a probe is near, m.
const NEAR_M: f64 = 1.0;

/// Velocities above it (m/s, rad/s) are mistakes.
const FASTEST: f64 = 1e6;

impl Scene {
    /// Checks all values; `place` (the file, or a name) begins the messages.
    /// # Errors
    /// [`SimError::Value`] or [`SimError::MissingKey`] for the first violation: key, value, range.
    pub fn validate(&self, place: &str) -> Result<(), SimError> {
        self.validate_for(place, false)
    }

    /// The same, for a body whose volume is `in_memory` or not.
    pub(crate) fn validate_for(&self, place: &str, in_memory: bool) -> Result<(), SimError> {
        let check = Check { place };
        check.that(!self.name.trim().is_empty(), "name", &self.name, "a name that is not empty")?;
        let plain = |c: char| c.is_alphanumeric() || "-_. ".contains(c);
        let named = self.name.chars().all(plain) && !self.name.starts_with('.');
        let want = "letters, digits, -, _, spaces and inner dots only";
        check.that(named, "name", &self.name, want)?;
        let storable = i64::try_from(self.seed).is_ok();
        check.that(storable, "seed", self.seed, "at most 9223372036854775807")?;
        match &self.mesh.path {
            _ if in_memory => check.volume_in_memory(self)?,
            Some(path) => check.mesh_file(self, path)?,
            None => check.image(&self.image)?,
        }
        check.image_content(self)?;
        check.materials(self)?;
        check.mesh(self)?;
        check.label_refinement(&self.mesh)?;
        check.topology(self)?;
        for (i, region) in self.fixed.iter().enumerate() {
            check.region(region, &format!("fixed[{i}]"))?;
        }
        let Support { hold, stiffness_n_m4 } = self.support;
        if let Some(stiffness) = stiffness_n_m4 {
            check.positive("support.stiffness_n_m4", stiffness)?;
            let want = "no such key unless support.hold is \"elastic\"";
            let elastic = hold == SupportHold::Elastic;
            check.that(elastic, "support.stiffness_n_m4", stiffness, want)?;
        }
        check.vector("gravity_m_s2", &self.gravity_m_s2)?;
        let bearable = self.gravity_m_s2.iter().all(|g| g.abs() <= 1e6);
        check.that(bearable, "gravity_m_s2", self.gravity_m_s2, "at most 1e6 in each axis")?;
        for (i, tool) in self.tools.iter().enumerate() {
            check.tool(tool, &format!("tools[{i}]"))?;
        }
        check.edits(self)?;
        check.stages(self)?;
        check.numbers(self)?;
        check.dynamics(self)?;
        check.output(self)
    }
}

impl Check<'_> {
    fn image(&self, image: &Image) -> Result<(), SimError> {
        for (key, length) in
            [("image.voxel_mm", image.voxel_mm), ("image.length_mm", image.length_mm)]
        {
            length.map_or(Ok(()), |length| self.positive(key, length))?;
        }
        for (i, &size) in image.size_mm.iter().flatten().enumerate() {
            self.positive(&format!("image.size_mm[{i}]"), size)?;
        }
        if let Some(path) = &image.path {
            let blank = path.as_os_str().is_empty();
            return self.that(!blank, "image.path", path, "the path of a label map or an image");
        }
        let want = "no such key without image.path: it is the unit of a file";
        self.that(image.unit.is_none(), "image.unit", image.unit, want)?;
        let want = "a label map: give it with --set image.path=FILE.nii.gz (or name a phantom, \
                    `liver` or `block`, in image.phantom)";
        let phantom = self.given(image.phantom, "image.path", want)?;
        let want = "the edge of a voxel of the phantom in mm";
        let voxel = self.given(image.voxel_mm, "image.voxel_mm", want)?;
        match phantom {
            Phantom::Liver => {
                let want = "the left-right length of the liver phantom in mm, e.g. 200";
                self.given(image.length_mm, "image.length_mm", want).map(drop)
            }
            Phantom::Block => {
                let want = "the size of the block phantom in mm, e.g. [40, 20, 20]";
                let size = self.given(image.size_mm, "image.size_mm", want)?;
                size.iter().enumerate().try_for_each(|(i, &edge)| {
                    let voxels = edge / voxel;
                    let whole = voxels > 0.5 && (voxels - voxels.round()).abs() <= VOXEL_SLACK;
                    let want = format!("a whole number of voxels of {voxel:?} mm");
                    self.that(whole, &format!("image.size_mm[{i}]"), edge, &want)
                })
            }
        }
    }

    /// A volume in memory is the body: the scene names no other source of one.
    fn volume_in_memory(&self, scene: &Scene) -> Result<(), SimError> {
        let Image { path, phantom, length_mm, size_mm, voxel_mm, .. } = &scene.image;
        let want = "no such key beside a volume in memory: a simulation has one or the other";
        self.that(scene.mesh.path.is_none(), "mesh.path", &scene.mesh.path, want)?;
        self.that(path.is_none(), "image.path", path, want)?;
        self.that(phantom.is_none(), "image.phantom", phantom, want)?;
        self.that(length_mm.is_none(), "image.length_mm", length_mm, want)?;
        self.that(size_mm.is_none(), "image.size_mm", size_mm, want)?;
        self.that(voxel_mm.is_none(), "image.voxel_mm", voxel_mm, want)
    }

    /// What a tool that changes labels or cuts can't be beside.
    fn edits(&self, scene: &Scene) -> Result<(), SimError> {
        for (i, tool) in scene.tools.iter().enumerate().filter(|(_, tool)| tool.edits()) {
            let (key, kind) = (format!("tools[{i}].kind"), tool.kind());
            let does = if tool.cuts() { "cuts" } else { "changes labels" };
            let want = "no such tool beside mesh.path: a mesh from a file has no voxels";
            self.that(scene.mesh.path.is_none(), &key, kind, want)?;
            let steps = scene.output.checkpoint_steps;
            let want = format!("0 beside a tool that {does} ({kind})");
            self.that(steps == 0, "output.checkpoint_steps", steps, &want)?;
            if let Some(one) = tool.ablation() {
                let made = one.becomes.is_none_or(|label| scene.material_of(label).is_some());
                let want = "a label of a material of the scene";
                self.that(made, &format!("tools[{i}].becomes"), one.becomes, want)?;
            }
            for (j, other) in scene.tools.iter().enumerate() {
                let pulls = |load: &LoadEntry| load.load.iter().any(|at| at.traction_pa.is_some());
                let is_on_surface = match other {
                    ToolEntry::Pressure(_) => true,
                    ToolEntry::Load(load) => pulls(load),
                    _ => false,
                };
                let want = format!(
                    "no pressure or traction beside a tool that {does} ({kind}): the surface may go"
                );
                let other_key = format!("tools[{j}].kind");
                self.that(!is_on_surface, &other_key, other.kind(), &want)?;
                let both = tool.cuts() && other.ablation().is_some();
                let want = format!("no tool that changes labels beside one that cuts ({kind})");
                self.that(!both, &other_key, other.kind(), &want)?;
            }
            if let ToolEntry::Scalpel(ScalpelEntry { level: Some(level), .. }) = tool {
                let most = scene.mesh.finest_level();
                let want = format!("at most mesh.max_level, {most}");
                self.that(*level <= most, &format!("tools[{i}].level"), level, &want)?;
            }
        }
        Ok(())
    }

    /// What the body can't be beside that hangs together by material alone.
    fn topology(&self, scene: &Scene) -> Result<(), SimError> {
        let mesh = &scene.mesh;
        if mesh.topology.is_merged() {
            let want = "no such key without mesh.topology = \"components\"";
            return self.that(
                mesh.apart_level.is_none(),
                "mesh.apart_level",
                mesh.apart_level,
                want,
            );
        }
        if let Some(level) = mesh.apart_level {
            let (least, most) = (mesh.start_level, mesh.finest_level());
            let want = format!("from start_level, {least}, to max_level, {most}");
            self.that((least..=most).contains(&level), "mesh.apart_level", level, &want)?;
        }
        let refused = |is_there: bool, beside: &str| {
            let want = format!("\"merged\" beside {beside}");
            self.that(!is_there, "mesh.topology", "components", &want)
        };
        refused(scene.mesh.path.is_some(), "mesh.path: a mesh from a file has no voxels")?;
        refused(scene.output.checkpoint_steps > 0, "output.checkpoint_steps")?;
        let ablates = scene.tools.iter().any(|tool| tool.ablation().is_some());
        refused(ablates, "a tool that changes labels")
    }

    /// A mesh from a file is what there is: no image beside it and no levels below it.
    fn mesh_file(&self, scene: &Scene, path: &Path) -> Result<(), SimError> {
        let blank = path.as_os_str().is_empty();
        self.that(!blank, "mesh.path", path, "the path of a mesh, .msh or .vtu")?;
        self.positive("mesh.unit_m", scene.mesh.unit_m)?;
        let want = "no image beside mesh.path: a scene has one or the other";
        let image = &scene.image;
        self.that(image.path.is_none(), "image.path", &image.path, want)?;
        self.that(image.phantom.is_none(), "image.phantom", image.phantom, want)?;
        let mesh = &scene.mesh;
        let want = "no such key beside mesh.path: a mesh from a file is not refined (give its \
                    image instead to refine)";
        self.that(mesh.max_level.is_none(), "mesh.max_level", mesh.max_level, want)?;
        self.that(mesh.start_level == 0, "mesh.start_level", mesh.start_level, want)?;
        self.that(mesh.label_level.is_none(), "mesh.label_level", mesh.label_level, want)?;
        self.that(mesh.base_mm.is_none(), "mesh.base_mm", mesh.base_mm, want)
    }

    fn mesh(&self, scene: &Scene) -> Result<(), SimError> {
        let mesh = &scene.mesh;
        let finest = yawara_mesh::lattice::MAX_LEVEL;
        if let (None, Some(base_mm)) = (&mesh.path, mesh.base_mm) {
            self.positive("mesh.base_mm", base_mm)?;
        }
        let (start, max) = (mesh.start_level, mesh.finest_level());
        let want = format!("at most {finest}");
        self.that(max <= finest, "mesh.max_level", max, &want)?;
        let want = format!("at most max_level, {max}");
        self.that(start <= max, "mesh.start_level", start, &want)?;
        self.that(mesh.max_vertices >= 4, "mesh.max_vertices", mesh.max_vertices, "at least 4")
    }

    fn stages(&self, scene: &Scene) -> Result<(), SimError> {
        let stages = &scene.stages;
        let inverses = [&[AUTO], yawara_inverse_update::CHOICES, ON_DEVICE].concat();
        let elements = [&[AUTO], yawara_embed::FORMULATIONS].concat();
        let laws = [&[AUTO], yawara_corot::LAWS].concat();
        let integrators = [&[AUTO], yawara_corot::INTEGRATORS].concat();
        for (key, name, choices) in [
            ("element", &stages.element, &elements[..]),
            ("homogenisation", &stages.homogenisation, yawara_embed::CHOICES),
            ("corotation", &stages.corotation, yawara_corot::FORCES),
            ("law", &stages.law, &laws),
            ("integrator", &stages.integrator, &integrators),
            ("equilibrium", &stages.equilibrium, yawara_corot::EQUILIBRIA),
            ("indicator", &stages.indicator, crate::step::indicator::CHOICES),
            ("inverse", &stages.inverse, &inverses),
        ] {
            let want = format!("one of {}", choices.join(", "));
            self.that(choices.contains(&&name[..]), &format!("stages.{key}"), name, &want)?;
        }
        self.adapter(stages)
    }

    /// A device is chosen for an inverse that lives on one.
    fn adapter(&self, stages: &StageNames) -> Result<(), SimError> {
        let Some(adapter) = &stages.gpu_adapter else { return Ok(()) };
        let refused =
            |want: String| SimError::value(self.place, "stages.gpu_adapter", adapter, want);
        if !ON_DEVICE.contains(&&stages.inverse[..]) {
            return Err(refused(format!(
                "no such key beside stages.inverse = {:?}: it goes with {}",
                stages.inverse,
                ON_DEVICE.join(" and ")
            )));
        }
        match adapter {
            Adapter::Name(name) if name.trim().is_empty() => {
                Err(refused("a part of an adapter's name, or its number".into()))
            }
            _ => Ok(()),
        }
    }

    fn numbers(&self, scene: &Scene) -> Result<(), SimError> {
        let Scene { time, solver, refinement, .. } = scene;
        let in_range = (1..=MAX_STEPS).contains(&time.steps);
        self.that(in_range, "time.steps", time.steps, &format!("1 to {MAX_STEPS}"))?;
        self.positive("time.step_s", time.step_s)?;
        let in_range = solver.residual > 0.0 && solver.residual < 1.0;
        self.that(in_range, "solver.residual", solver.residual, "more than 0 and less than 1")?;
        let iterations = solver.max_iterations;
        self.that(iterations >= 1, "solver.max_iterations", iterations, "at least 1")?;
        let iterations = solver.step_iterations;
        self.that(iterations >= 1, "solver.step_iterations", iterations, "at least 1")?;
        let halvings = solver.max_halvings;
        self.that(halvings <= 30, "solver.max_halvings", halvings, "at most 30")?;
        if let Some(above) = refinement.split_above {
            self.positive("refinement.split_above", above)?;
        }
        let target = refinement.target;
        let in_range = target > 0.0 && target < 1.0;
        self.that(in_range, "refinement.target", target, "more than 0 and less than 1")?;
        let fraction = refinement.merge_fraction;
        let in_range = (0.0..1.0).contains(&fraction);
        self.that(in_range, "refinement.merge_fraction", fraction, "at least 0 and less than 1")?;
        if let Some(every) = refinement.every_steps {
            self.that(every >= 1, "refinement.every_steps", every, "at least 1")?;
        }
        let ease_s = refinement.ease_s;
        let in_range = (0.0..=EASE_S).contains(&ease_s);
        self.that(in_range, "refinement.ease_s", ease_s, &format!("0 to {EASE_S}"))?;
        self.near_probe(scene)?;
        self.goal(scene)
    }

    fn near_probe(&self, scene: &Scene) -> Result<(), SimError> {
        let Some(NearProbe { level, within_m }) = &scene.refinement.near_probe else {
            return Ok(());
        };
        let finest = scene.mesh.finest_level();
        let want = format!("at most mesh.max_level, which is {finest}");
        self.that(*level <= finest, "refinement.near_probe.level", level, &want)?;
        let in_range = (0.0..=NEAR_M).contains(within_m);
        self.that(in_range, "refinement.near_probe.within_m", within_m, &format!("0 to {NEAR_M}"))
    }

    fn goal(&self, scene: &Scene) -> Result<(), SimError> {
        let indicator = &scene.stages.indicator;
        let want = "another indicator with [dynamics]: a goal is one of a body at rest";
        let is_at_rest = indicator != "goal" || scene.dynamics.is_none();
        self.that(is_at_rest, "stages.indicator", indicator, want)?;
        let Some(goal) = &scene.refinement.goal else { return Ok(()) };
        let want = "no such key with mesh.path, whose mesh has no levels, or [dynamics]";
        let is_known = scene.mesh.path.is_none() && scene.dynamics.is_none();
        self.that(is_known, "refinement.goal", goal, want)?;
        if let Some(region) = goal.region() {
            self.region(region, "refinement.goal.region")?;
        }
        match goal {
            GoalEntry::Displacement { direction, .. } => {
                self.axis(direction, "refinement.goal.direction")
            }
            GoalEntry::Force { .. } | GoalEntry::Volume { .. } => Ok(()),
        }
    }

    fn dynamics(&self, scene: &Scene) -> Result<(), SimError> {
        if let Some(step_ms) = scene.budget.step_ms {
            self.positive("budget.step_ms", step_ms)?;
        }
        let Some(dynamics) = &scene.dynamics else {
            let (key, name) = ("stages.integrator", &scene.stages.integrator);
            let still = [AUTO, "quasi_static"].contains(&&name[..]);
            return self.that(still, key, name, "[dynamics] in the scene");
        };
        let undamped = !(scene.stages.law == "linear" && dynamics.damping_stiffness_s > 0.0);
        let want = "rayleigh or auto beside dynamics.damping_stiffness_s > 0";
        self.that(undamped, "stages.law", &scene.stages.law, want)?;
        for (key, value) in [
            ("dynamics.damping_mass_per_s", dynamics.damping_mass_per_s),
            ("dynamics.damping_stiffness_s", dynamics.damping_stiffness_s),
        ] {
            let in_range = (0.0..=1e12).contains(&value);
            self.that(in_range, key, value, "0 to 1e12")?;
        }
        for (key, vector) in [
            ("dynamics.velocity_m_s", &dynamics.velocity_m_s),
            ("dynamics.spin_rad_s", &dynamics.spin_rad_s),
        ] {
            self.vector(key, vector)?;
            let slow = vector.iter().all(|v| v.abs() <= FASTEST);
            self.that(slow, key, vector, "at most 1e6 in each axis")?;
        }
        for (i, material) in scene.materials.iter().enumerate() {
            let (key, density) = (format!("materials[{i}].density_kg_m3"), material.density_kg_m3);
            self.that(density > 0.0, &key, density, "more than 0: a dynamic body has mass")?;
        }
        Ok(())
    }

    fn output(&self, scene: &Scene) -> Result<(), SimError> {
        let output = &scene.output;
        let finest = yawara_mesh::lattice::MAX_LEVEL;
        let in_range = output.surface_level.is_none_or(|level| level <= finest);
        let want = format!("at most {finest}");
        self.that(in_range, "output.surface_level", output.surface_level, &want)?;
        let msh = cfg!(feature = "gmsh") || !output.msh;
        self.that(msh, "output.msh", output.msh, "false: this build leaves the feature gmsh out")?;
        let on_image = scene.mesh.path.is_none() || !output.field;
        let want = "false: a mesh from a file has no grid of voxels";
        self.that(on_image, "output.field", output.field, want)?;
        let mut seen = BTreeSet::new();
        for (i, SurfaceEntry { label, sigma_voxels }) in output.surfaces.iter().enumerate() {
            let key = |name: &str| format!("output.surfaces[{i}].{name}");
            let want = "an image: a mesh from a file has no surfaces to extract";
            self.that(scene.mesh.path.is_none(), &key("label"), label, want)?;
            self.that(*label != 0, &key("label"), label, "a label other than 0")?;
            self.that(seen.insert(*label), &key("label"), label, "each label once")?;
            let in_range = (0.0..=16.0).contains(sigma_voxels);
            self.that(in_range, &key("sigma_voxels"), sigma_voxels, "0 to 16")?;
        }
        Ok(())
    }
}
