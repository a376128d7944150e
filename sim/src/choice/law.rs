//! Which law a scene calls for.

use super::stages::Stages;
use crate::body::{Memory, Start};
use crate::scene::{AUTO, Region, Scene, ToolEntry};
use crate::tools::ToolPath;

/// A grab that goes farther than this part of the body's longest side makes strains at which the linear law
/// has no equilibrium.
const FAR: f64 = 0.5;

/// A grab that turns a ball of material by more than this, degrees, strains what is around it by as much.
const TURNED_DEG: f64 = 15.0;

/// The law of a scene, and why.
pub(crate) fn of_scene(scene: &Scene, stages: &Stages, start: &Start) -> (String, String) {
    if let Some(own) = &stages.law {
        return (own.name().into(), "given".into());
    }
    if let Some(why) = memory(scene) {
        return ("inelastic".into(), why);
    }
    let damping_s = scene.dynamics.as_ref().map_or(0.0, |d| d.damping_stiffness_s);
    if scene.stages.law != AUTO {
        return (scene.stages.law.clone(), "asked for".into());
    }
    if damping_s > 0.0 {
        return ("rayleigh".into(), "damped by stiffness".into());
    }
    let [goes, turns] = farthest(scene, start);
    let longest = start.places.organ.longest_mm();
    let strains = if goes > FAR * longest {
        format!("a grab goes {goes:.0} mm, the body's longest side is {longest:.0} mm")
    } else if turns > TURNED_DEG {
        format!("a grab turns a ball of material by {turns:.0} degrees")
    } else {
        let why =
            "no grab goes as far as half of the body's length, or turns a ball of material far";
        return ("linear".into(), why.into());
    };
    match scene.dynamics.is_none() && stages.forces.name().starts_with("element") {
        true => ("neo_hookean".into(), format!("{strains}: strains that linear does not bear")),
        false => ("linear".into(), strains),
    }
}

/// How far from its material's place at rest a grab goes, mm, and how far one turns a ball, degrees.
fn farthest(scene: &Scene, start: &Start) -> [f64; 2] {
    let reach = |tool: &ToolEntry| {
        let ToolEntry::Grab(grab) = tool else { return None };
        // What can't be read is refused where the tool is made.
        let path = ToolPath::read(&grab.path, grab.path_csv.as_deref(), start.places.axes).ok()?;
        let is_ball = matches!(grab.region, Region::Sphere { .. });
        Some([1e3 * path.reach_m(), if is_ball { path.turns_deg() } else { 0.0 }])
    };
    let all = scene.tools.iter().filter_map(reach);
    all.fold([0.0; 2], |[a, b], [c, d]| [a.max(c), b.max(d)])
}

/// What materials remember, if any does.
fn memory(scene: &Scene) -> Option<String> {
    // Errors are said where the body is made.
    Memory::of(scene).ok()??;
    let with_law =
        scene.materials.iter().enumerate().filter_map(|(i, one)| Some((i, one.law.as_ref()?)));
    let words: Vec<String> = with_law
        .map(|(i, law)| {
            let fit = law.law().ok().and_then(|law| law.fit_error);
            let fit = fit.map_or_else(String::new, |error| {
                format!(" of terms within {:.2} % of its power law", 100.0 * error)
            });
            format!("materials[{i}] {}{fit}", law.kind())
        })
        .collect();
    Some(format!("{}; moduli of steps of {} s", words.join(", "), scene.time.step_s))
}
