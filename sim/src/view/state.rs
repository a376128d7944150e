//! What a page is told besides pictures, as JSON.

use serde_json::{Value, json};

use super::hand::Hand;
use crate::report::{StepReport, ToolReport};
use crate::scene::Scene;
use crate::step::{Simulation, indicator};

/// How a session stands.
pub(super) struct Standing<'a> {
    pub simulation: &'a Simulation,
    /// What `yawara run` is told to run the same.
    pub name: &'a str,
    pub changes: &'a [String],
    pub generation: u64,
    pub is_paused: bool,
    /// Of the surfaces, in their order.
    pub labels: &'a [i64],
    /// The most steps of a simulation here.
    pub most_steps: usize,
    /// What is told of the simulation beside it.
    pub beside: Option<&'a Value>,
}

impl Standing<'_> {
    /// What a page needs to know of a simulation, whichever step it is at.
    pub fn json(&self) -> Value {
        let Self { simulation, name, changes, generation, is_paused, labels, .. } = self;
        let scene = simulation.scene();
        let name_of = |label: i64| {
            let found = scene.materials.iter().find(|one| one.label == Some(label));
            if label == 0 { "skin" } else { found.map_or("", |one| &one.name[..]) }
        };
        json!({
            "kind": "state",
            "version": env!("CARGO_PKG_VERSION"),
            "scene": scene.name,
            "description": scene.description,
            "generation": generation,
            "paused": is_paused,
            "step_s": scene.time.step_s,
            "most_steps": self.most_steps,
            "labels": labels.iter().map(|&label| json!({
                "label": label, "name": name_of(label),
            })).collect::<Vec<_>>(),
            "plan": simulation.plan(),
            "warnings": warnings(simulation),
            "stages": stages(scene),
            "numbers": numbers(scene),
            "materials": scene.materials.iter().map(|one| json!({
                "name": one.name, "young_modulus_pa": one.young_modulus_pa,
            })).collect::<Vec<_>>(),
            "command": command(name, changes),
            "beside": self.beside,
        })
    }
}

/// What the plan warns of.
pub(super) fn warnings(simulation: &Simulation) -> Vec<String> {
    simulation.plan().iter().flat_map(|row| row.warnings().collect::<Vec<_>>()).collect()
}

/// The stages that may be changed, with what they are and may be.
fn stages(scene: &Scene) -> Value {
    let with_auto = |choices: &[&'static str]| [&["auto"], choices].concat();
    let of = |key: &str, value: &str, choices: Vec<&'static str>| json!({ "key": format!("stages.{key}"), "value": value, "choices": choices });
    let stages = &scene.stages;
    json!([
        of("homogenisation", &stages.homogenisation, yawara_embed::CHOICES.to_vec()),
        of("element", &stages.element, with_auto(yawara_embed::FORMULATIONS)),
        of("corotation", &stages.corotation, yawara_corot::FORCES.to_vec()),
        of("equilibrium", &stages.equilibrium, yawara_corot::EQUILIBRIA.to_vec()),
        of("indicator", &stages.indicator, indicator::CHOICES.to_vec()),
        of("inverse", &stages.inverse, with_auto(yawara_inverse_update::CHOICES)),
    ])
}

/// The numbers that may be changed.
fn numbers(scene: &Scene) -> Value {
    let refinement = &scene.refinement;
    json!([
        { "key": "refinement.target", "value": refinement.target },
        { "key": "refinement.split_above", "value": refinement.split_above },
        { "key": "refinement.max_splits_per_step", "value": refinement.max_splits_per_step },
        { "key": "mesh.max_vertices", "value": scene.mesh.max_vertices },
        { "key": "solver.residual", "value": scene.solver.residual },
    ])
}

/// The line that runs the same scene, its words quoted for a shell.
fn command(name: &str, changes: &[String]) -> String {
    let mut line = format!("yawara run {}", quoted(name));
    for change in changes {
        line += &format!(" --set {}", quoted(change));
    }
    line
}

/// A word as a POSIX shell reads it.
pub(super) fn quoted(word: &str) -> String {
    let is_plain = |b: u8| b.is_ascii_alphanumeric() || b"_-./=,:+".contains(&b);
    match !word.is_empty() && word.bytes().all(is_plain) {
        true => word.into(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}

/// What is said of a step beside its picture. `hands` are those of each tool, with their pages.
pub(super) fn of_step(report: &StepReport, hands: &[(u64, u8, &Hand)], more: Value) -> String {
    let tool = |(number, felt): (usize, &ToolReport)| {
        let hand = hands.iter().find(|(_, _, hand)| hand.tool == number);
        json!({
            "tool": number,
            "kind": felt.kind,
            "force_n": felt.force_n,
            "force_error_n": felt.force_error_n,
            "torque_n_m": felt.torque_n_m,
            "reference_mm": felt.reference_mm,
            "contacts": felt.contacts,
            "penetration_m": felt.penetration_m,
            "page": hand.map(|hand| hand.0),
            "hand": hand.map(|hand| hand.1),
            "stamp": hand.map(|hand| hand.2.stamp),
            "radius_mm": hand.and_then(|hand| hand.2.drawn.radius_mm),
            "edge_mm": hand.and_then(|hand| hand.2.drawn.edge_mm),
            "stiffness_n_m": hand.map(|hand| {
                let s = hand.2.model.stiffness;
                [0, 1, 2].map(|i| [0, 1, 2].map(|j| s[(i, j)]))
            }),
        })
    };
    // Tools that have let go say nothing any more.
    let is_felt = |(number, felt): &(usize, &ToolReport)| {
        felt.force_n != [0.0; 3] || hands.iter().any(|(_, _, hand)| hand.tool == *number)
    };
    let times = &report.times;
    let mut said = json!({
        "step": report.step,
        "time_s": report.time_s,
        "vertices": report.vertices,
        "tets": report.tets,
        "splits": report.splits,
        "merges": report.merges,
        "waiting": report.waiting,
        "iterations": report.iterations,
        "substeps": report.substeps,
        "residual": finite(report.residual),
        "converged": report.converged,
        "failure": report.failure,
        "error_estimate": report.error_estimate,
        "goal": report.goal,
        "force_n": report.force_n,
        "tools": report.tools.iter().enumerate().filter(is_felt).map(tool).collect::<Vec<_>>(),
        "times_ms": {
            "tool": times.tool_ms, "solve": times.solve_ms, "indicator": times.indicator_ms,
            "remesh": times.remesh_ms, "inverse": times.inverse_ms,
        },
    });
    if let (Value::Object(said), Value::Object(more)) = (&mut said, more) {
        said.extend(more);
    }
    said.to_string()
}

/// JSON has no infinity.
fn finite(x: f64) -> Option<f64> {
    x.is_finite().then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_survives_a_shell() {
        let changes = ["stages.inverse=lu".into(), "fixed=[{shape='box'}]".into()];
        let want = r"yawara run 'my scene.toml' --set stages.inverse=lu --set 'fixed=[{shape='\''box'\''}]'";
        assert_eq!(command("my scene.toml", &changes), want);
    }
}
