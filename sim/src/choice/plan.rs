//! What a scene needs, what it does not, and why.

use yawara_embed::Embedding;

use super::element;
use super::stages::Stages;
use crate::body::{FileMesh, ImageBody, Origin, Start, TopologySummary, surface_level};
use crate::inverse::InverseLink;
use crate::report::{PlanRow, WARNING};
use crate::scene::{AUTO, GrabHold, MassModel, NearProbe, Scene, SupportHold, ToolEntry};
use crate::tools::Holding;

/// Why a body with inertia keeps all of its parts.
const FREE: &str = "with inertia no part need be held";

/// The plan of a scene, in the order of the pipeline; `chosen` is the element, then the law and why it is that.
pub(crate) fn rows(
    scene: &Scene,
    start: &Start,
    stages: &Stages,
    chosen: &str,
    (law, why_law): (&str, &str),
    held: &[Holding],
) -> Vec<PlanRow> {
    let mut rows = match &start.origin {
        Origin::Image(setup) => {
            vec![
                image(setup),
                mesh(scene, setup),
                domain(scene, setup),
                homogenisation(setup, stages),
            ]
        }
        Origin::MeshFile(mesh) => mesh_file(scene, mesh, stages),
    };
    let element = stages.element.as_ref().map_or(chosen, |own| own.name());
    rows.extend([
        row("element", element, true, element::reason(scene, stages, chosen)),
        row("corotation", stages.forces.name(), true, "rotations are not known to stay small"),
        row("equilibrium", stages.equilibrium.name(), true, "every step is solved to a residual"),
        dynamics(scene, stages),
        row("law", law, true, why_law),
        refinement(scene, stages),
        estimates(scene, stages),
        budget(scene),
        holds(scene, held),
        tools(scene, start, held),
        compliance(scene),
        surface(scene, start),
    ]);
    rows.extend(checkpoints(scene));
    rows
}

/// None unless asked for.
fn checkpoints(scene: &Scene) -> Option<PlanRow> {
    let every = scene.output.checkpoint_steps;
    let why = "asked for: there the mesh is numbered and the inverse computed afresh";
    (every > 0).then(|| row("checkpoints", &format!("every {every} steps"), true, why))
}

/// The rows of a mesh that is what it is.
fn mesh_file(scene: &Scene, mesh: &FileMesh, stages: &Stages) -> Vec<PlanRow> {
    let domain = match mesh.excluded_components {
        0 if scene.dynamics.is_some() => row("domain", "all parts", true, FREE),
        0 => row("domain", "all parts", true, "every part is held by a fixed region"),
        parts => row(
            "domain",
            "held parts",
            true,
            format!(
                "{parts} part(s) with {} tetrahedra are not held by a fixed region and left out",
                mesh.excluded_tets
            ),
        ),
    };
    let why = format!("every tetrahedron has one of {} material(s)", mesh.materials.len());
    vec![
        row("image", "none", false, "the scene names a mesh file"),
        row("mesh", &mesh.places.name, true, &mesh.done),
        domain,
        row("homogenisation", stages.homogenisation.name(), false, why),
    ]
}

fn row(stage: &str, choice: &str, runs: bool, why: impl Into<String>) -> PlanRow {
    PlanRow { stage: stage.into(), choice: choice.into(), runs, why: why.into() }
}

fn image(setup: &ImageBody) -> PlanRow {
    let image = &setup.summary.image;
    let [nx, ny, nz] = image.dims;
    let mut why = image.format.clone();
    if image.format != "procedural" {
        why += &format!(" {}", image.content);
    }
    if image.resampled {
        why += &format!("; {}", image.resampling());
    }
    why += &format!("; {nx} x {ny} x {nz} voxels of {} mm", image.voxel_mm);
    let [x, y, z] = setup.places.organ.size_mm();
    why += &format!(", body of {x} x {y} x {z} mm");
    if image.blur_mm > 0.0 {
        why += &format!(", smoothed by {} mm", image.blur_mm);
    }
    if !image.ignored_labels.is_empty() {
        let voxels: u64 = image.ignored_labels.iter().map(|one| one.voxels).sum();
        why += &format!("; {} label(s) ignored, {voxels} voxels", image.ignored_labels.len());
    }
    for other in image.materials.iter().filter(|material| material.other) {
        why += &format!("; {} label(s) take the material of others", other.labels.len());
    }
    for empty in image.empty_ranges() {
        why += &format!("; {WARNING}no voxel lies in the range of \"{}\"", empty.name);
    }
    row("image", setup.image_name(), true, why)
}

fn mesh(scene: &Scene, setup: &ImageBody) -> PlanRow {
    let used = setup.base_m * 1e3;
    let asked = scene.mesh.base_mm.unwrap_or(used);
    let rounded = if scene.mesh.base_mm.is_none() {
        "; no base_mm is given: a tenth of the body's longest side, rounded to a power of two of voxels"
            .into()
    } else if (asked - used).abs() > 1e-9 * used {
        format!("; {asked} mm were asked for, rounded to a power of two of voxels")
    } else {
        String::new()
    };
    let mut why = format!(
        "{} base cells of {used} mm, level {} to {}, {} vertices at the start{rounded}",
        setup.forest.domain().cells().count(),
        scene.mesh.start_level,
        scene.mesh.finest_level(),
        setup.forest.vertex_count(),
    );
    if let Some(refined) = &setup.summary.label_refinement {
        why += &format!(
            "; {} of them towards labels down to level {}",
            refined.vertices, refined.level
        );
        if refined.tets_left > 0 {
            why += &format!(
                "; {WARNING}max_vertices = {} ended it with {} tetrahedra of several labels left",
                scene.mesh.max_vertices, refined.tets_left
            );
        }
    }
    let TopologySummary { refined, unjoined, doubled, vertices, .. } = setup.summary.topology;
    if unjoined > 0 && scene.mesh.topology.is_merged() {
        why += &format!(
            "; {unjoined} tetrahedra hold together what no face of a voxel joins near by \
             (mesh.topology = \"components\" takes it apart)"
        );
    } else if !scene.mesh.topology.is_merged() {
        why += &format!(
            "; what no face of a voxel joins near by is apart: {refined} vertices came in to refine there, \
             {doubled} tetrahedra are there several times and are not split, {vertices} vertices came in for that"
        );
    }
    row("mesh", "bisection", true, why)
}

fn domain(scene: &Scene, setup: &ImageBody) -> PlanRow {
    let domain = &setup.summary.domain;
    if scene.dynamics.is_some() {
        let why = format!("{} part(s) joined by faces; {FREE}", domain.components);
        return row("domain", "all parts", true, why);
    }
    let (kept, cells, voxels) = domain.total(true);
    let (excluded, without_cells, without_voxels) = domain.total(false);
    let mut why = format!(
        "{kept} of {} part(s) joined by faces, with {cells} base cells and {voxels} voxels, held by \
         a fixed region",
        domain.components
    );
    if excluded == 0 {
        return row("domain", "all parts", true, why);
    }
    why += &format!(
        "; {excluded} part(s) with {without_cells} base cells and {without_voxels} voxels are not \
         held and left out"
    );
    row("domain", "held parts", true, why)
}

fn homogenisation(setup: &ImageBody, stages: &Stages) -> PlanRow {
    let nodes = setup.tree.node_count();
    let name = stages.homogenisation.name();
    if nodes == 0 {
        return row("homogenisation", name, false, "every tetrahedron has one material");
    }
    let mut why = format!(
        "{nodes} heterogeneous tetrahedra down to level {} (one voxel)",
        setup.tree.grid().embed_level()
    );
    if let Some(warning) = stages.homogenisation.warning() {
        why += &format!("; {WARNING}{warning}");
    }
    row("homogenisation", name, true, why)
}

/// Adds what a global homogenisation did to its row.
pub(crate) fn homogenised(rows: &mut [PlanRow], embedding: &Embedding) {
    if embedding.homogenisation().global().is_none() {
        return;
    }
    let (nodes, left) = (embedding.tree().node_count(), embedding.left_to_local_rule());
    if let Some(row) = rows.iter_mut().find(|row| row.stage == "homogenisation" && row.runs) {
        row.why += &format!(
            "; {} of them from solutions of the fine body, {left} left to laminate; \
             new vertices are placed by laminate",
            nodes - left
        );
    }
}

fn refinement(scene: &Scene, stages: &Stages) -> PlanRow {
    let indicator = &stages.indicator;
    if scene.mesh.path.is_some() {
        return row("refinement", indicator.name(), false, "a mesh from a file has no levels");
    }
    if !scene.mesh.refines() {
        return row("refinement", indicator.name(), false, "max_level equals start_level");
    }
    let rules = &scene.refinement;
    let until = match rules.split_above {
        None => {
            let what = if indicator.is_of_goal() { "goal" } else { "energy" };
            format!("until the {what} is within {} %", 100.0 * rules.target)
        }
        Some(above) => {
            let below = above * rules.merge_fraction;
            format!("split above {above:e} {}, merge below {below:e}", indicator.unit())
        }
    };
    let before =
        rules.near_probe.as_ref().map_or_else(String::new, |NearProbe { level, within_m }| {
            format!(", to level {level} within {} mm of a probe", 1e3 * within_m)
        });
    let why = format!("{until}{before}, at most {} vertices", scene.mesh.max_vertices);
    row("refinement", indicator.name(), true, why)
}

/// Whose error is estimated, and when.
fn estimates(scene: &Scene, stages: &Stages) -> PlanRow {
    let name = stages.indicator.name();
    let stage = "error estimate";
    if scene.mesh.path.is_some() {
        return row(stage, name, false, "a mesh from a file has no finer levels");
    }
    if !stages.indicator.estimates() {
        return row(stage, name, false, "the indicator does not say how far a figure is off");
    }
    let mut of = vec!["of the energy, and so of the force of a tool that acts alone"];
    if scene.dynamics.is_none() {
        of.push("of each force beside others by its dual");
    }
    if scene.refinement.goal.is_some() || stages.indicator.is_of_goal() {
        of.push("of the goal by its dual");
    }
    let when = match (scene.mesh.refines(), scene.measured_every()) {
        (false, _) => "steps with a frame".into(),
        (true, 1) => "every step".into(),
        (true, every) => format!("one of {every} steps, and those with a frame"),
    };
    row(stage, name, true, format!("{}; in {when}", of.join(", ")))
}

/// The row of the inverse, once there is one.
pub(crate) fn inverse(scene: &Scene, inverse: &InverseLink) -> PlanRow {
    let name = inverse.maintainer().name();
    let mut why = String::from("the mesh changes while the body moves");
    if !scene.mesh.refines() {
        why = "the mesh never changes: factored once".into();
    }
    if scene.stages.inverse == AUTO {
        let vertices = inverse.maintainer().vertices();
        why += &format!("; {name} is the fastest for {vertices} vertices with unknowns");
        match inverse.maintainer().stiffness().updates_at_once() {
            0 => {}
            at_once => why += &format!(" and up to {at_once} changes at once"),
        }
    }
    if let Some(place) = inverse.maintainer().place() {
        why += &format!("; {place}");
    }
    if let Some(adapter) = &scene.stages.gpu_adapter {
        why += &format!(", by gpu_adapter = {adapter}");
    }
    row("inverse update", name, scene.mesh.refines(), why)
}

fn dynamics(scene: &Scene, stages: &Stages) -> PlanRow {
    let Some(dynamics) = &scene.dynamics else {
        return row("dynamics", "none", false, "no [dynamics]: every step is an equilibrium");
    };
    let mass = match dynamics.mass {
        MassModel::Consistent => "consistent",
        MassModel::Lumped => "lumped",
    };
    let why = format!(
        "{mass} mass, damping {} /s by mass and {} s by stiffness, steps of {} s",
        dynamics.damping_mass_per_s, dynamics.damping_stiffness_s, scene.time.step_s
    );
    let integrator = stages.integrator.as_ref().map_or("implicit_euler", |own| own.name());
    row("dynamics", integrator, true, why)
}

fn budget(scene: &Scene) -> PlanRow {
    let refines = scene.mesh.path.is_none() && scene.mesh.refines();
    let splits = scene.refinement.max_splits_per_step;
    let mut why = format!("at most {splits} splits a step, the others wait and are counted");
    match (scene.budget.step_ms, scene.budget.realtime) {
        (Some(ms), true) => why += &format!("; a step ends {ms} ms after it began, solved or not"),
        (Some(ms), false) => why += &format!("; {ms} ms do not count: budget.realtime is false"),
        (None, _) => {}
    }
    let why = if refines { why } else { "nothing is refined".into() };
    row("budget", "splits", refines, why)
}

/// What is held: the same on every mesh, or not.
fn holds(scene: &Scene, held: &[Holding]) -> PlanRow {
    let is_grab = |hold| {
        let mut tools = scene.tools.iter();
        tools.any(|tool| matches!(tool, ToolEntry::Grab(grab) if grab.hold == hold))
    };
    let fixed = |hold| !scene.fixed.is_empty() && scene.support.hold == hold;
    let material = fixed(SupportHold::Elastic) || is_grab(GrabHold::Mean) || is_grab(GrabHold::Pad);
    match (fixed(SupportHold::Vertices) || is_grab(GrabHold::Vertices), material) {
        (false, false) => row("holds", "none", false, "nothing is fixed or grabbed"),
        (false, true) => {
            let why = format!("the same problem on every mesh{}", amounts(held, true));
            row("holds", "material", true, why)
        }
        (true, _) => {
            let why = format!(
                "as the start mesh{}; {WARNING}a finer mesh has more vertices to hold, another problem",
                amounts(held, true)
            );
            row("holds", "vertices", true, why)
        }
    }
}

/// How much each fixed region has, or each tool.
fn amounts(held: &[Holding], fixed: bool) -> String {
    let those = held.iter().filter(|one| (one.kind == "fixed") == fixed);
    those.map(|one| format!("; {}: {}", one.key, one.in_words())).collect()
}

/// How many tools of each kind, how much they have of the body, and which of them hardly do what was meant.
fn tools(scene: &Scene, start: &Start, held: &[Holding]) -> PlanRow {
    let kinds: Vec<&str> = scene.tools.iter().map(ToolEntry::kind).collect();
    if kinds.is_empty() {
        return row("tools", "none", false, "the scene has none");
    }
    let mut why = format!("{} tool(s){}", kinds.len(), amounts(held, false));
    for odd in crate::tools::warnings(scene, start) {
        why += &format!("; {WARNING}{odd}");
    }
    row("tools", &kinds.join(", "), true, why)
}

fn compliance(scene: &Scene) -> PlanRow {
    let probes = scene.tools.iter().filter(|tool| matches!(tool, ToolEntry::Probe(_))).count();
    let held = |hold| {
        let is_held =
            |tool: &&ToolEntry| matches!(tool, ToolEntry::Grab(grab) if grab.hold == hold);
        scene.tools.iter().filter(is_held).count()
    };
    let found = [
        (held(GrabHold::Vertices), "held vertices", "grab(s) of vertices"),
        (held(GrabHold::Mean), "held means", "grab(s) of a mean"),
        (probes, "contacts", "probe(s)"),
    ];
    let runs: Vec<_> = found.iter().filter(|found| found.0 > 0).collect();
    if runs.is_empty() {
        return row("compliance columns", "none", false, "no tool holds or probes the body");
    }
    let choices: Vec<&str> = runs.iter().map(|found| found.1).collect();
    let why: Vec<String> = runs.iter().map(|(n, _, what)| format!("{n} {what}")).collect();
    row("compliance columns", &choices.join(" and "), true, why.join(", "))
}

fn surface(scene: &Scene, start: &Start) -> PlanRow {
    let asked = &scene.output.surfaces;
    let Origin::Image(setup) = &start.origin else {
        return row("surface", "none", false, "a mesh from a file has faces of its own");
    };
    if asked.is_empty() {
        return row("surface", "none", false, "output.surfaces names no label");
    }
    let level = surface_level(scene, &setup.forest);
    let labels: Vec<String> = asked.iter().map(|one| one.label.to_string()).collect();
    let why = format!("labels {}, cut at level {level}", labels.join(", "));
    row("surface", "marching tetrahedra", true, why)
}
