//! Tools of a scene that do nothing, or hardly what was meant, as far as that is seen at rest.

use nalgebra::Vector3;

use super::path::ToolPath;
use crate::body::{Start, Zone};
use crate::scene::{GrabEntry, LoadEntry, ProbeEntry, Scene, ToolEntry};

/// Places along a probe's path at which its distance is measured.
const PLACES: usize = 64;

/// What is odd about the tools, a sentence each that begins with the tool's key.
pub(crate) fn warnings(scene: &Scene, start: &Start) -> Vec<String> {
    let odd = |tool: &ToolEntry| match tool {
        ToolEntry::Grab(grab) => grab_of_fixed(grab, start),
        ToolEntry::Probe(probe) => probe_out_of_reach(probe, scene, start),
        ToolEntry::Resect(_)
        | ToolEntry::Coagulate(_)
        | ToolEntry::Scalpel(_)
        | ToolEntry::Suture(_) => None,
        ToolEntry::Pressure(entry) => {
            let is_zero = entry.pressure.iter().all(|key| key.pressure_pa == 0.0);
            is_zero.then(|| "is a pressure of 0 Pa all the time".into())
        }
        ToolEntry::Load(load) => is_zero(load).then(|| "is a load of 0 all the time".into()),
    };
    let numbered = scene.tools.iter().enumerate();
    let of_one = numbered.filter_map(|(i, tool)| Some(format!("tools[{i}] {}", odd(tool)?)));
    of_one.chain(shared(scene, start)).collect()
}

fn is_zero(load: &LoadEntry) -> bool {
    let all = load.load.iter().flat_map(|at| [at.force_n, at.torque_n_m, at.traction_pa]);
    all.flatten().flatten().all(|x| x == 0.0)
}

/// A grab whose material is all fixed.
fn grab_of_fixed(grab: &GrabEntry, start: &Start) -> Option<String> {
    let points = start.material_points(&start.places.zone(&grab.region, "").ok()?);
    let is_fixed = |x| start.fixed.iter().any(|zone| zone.contains(&start.places.organ, x));
    let all = !points.is_empty() && points.iter().all(|point| is_fixed(&point.rest));
    all.then(|| "grabs nothing but what [[fixed]] holds".into())
}

/// A probe that comes nowhere near the body as it rests.
fn probe_out_of_reach(probe: &ProbeEntry, scene: &Scene, start: &Start) -> Option<String> {
    let path = ToolPath::read(&probe.path, probe.path_csv.as_deref(), start.places.axes).ok()?;
    let run_s = scene.time.steps as f64 * scene.time.step_s;
    let end_s = probe.release_s.unwrap_or(run_s).min(run_s);
    let centre = start.places.start_of(probe.start("", "").ok()?, "").ok()?;
    let distance = |i: usize| {
        let at: Vector3<f64> = centre + path.motion(end_s * i as f64 / PLACES as f64).0;
        start.nearest_material(&at).0.map_or(f64::INFINITY, |nearest| (nearest - at).norm())
    };
    let nearest = (0..=PLACES).map(distance).fold(f64::INFINITY, f64::min) - probe.radius_m;
    let far = format!("stays {:.3} mm or more away from the body as it rests", 1e3 * nearest);
    (nearest > 0.0).then_some(far)
}

/// Grabs that have material in common.
fn shared(scene: &Scene, start: &Start) -> Vec<String> {
    let numbered = scene.tools.iter().enumerate();
    let grabs: Vec<(usize, Zone)> = numbered
        .filter_map(|(i, tool)| match tool {
            ToolEntry::Grab(grab) => Some((i, start.places.zone(&grab.region, "").ok()?)),
            _ => None,
        })
        .collect();
    let mut found = Vec::new();
    for (at, (second, zone)) in grabs.iter().enumerate().filter(|(at, _)| *at > 0) {
        let points = start.material_points(zone);
        for (first, other) in &grabs[..at] {
            if points.iter().any(|point| other.contains(&start.places.organ, &point.rest)) {
                found.push(format!("tools[{second}] grabs material that tools[{first}] has too"));
            }
        }
    }
    found
}
