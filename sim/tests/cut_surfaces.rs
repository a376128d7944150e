//! Outlines and surfaces of labels of bodies that a tool has cut, or parts of which nothing joins.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use yawara::report::{Frame, SurfaceFrame};
use yawara::{Simulation, scene_file};

/// A bar of 160 × 40 × 40 mm, fixed at its low x end and drawn out at the other by 30 mm after a blade went along y
/// through it, `depth_mm` deep from above, 2.5 mm beyond its middle.
fn bar(depth_mm: f64, more: &[&str]) -> Simulation {
    let set = [
        "gravity_m_s2=[0, 0, 0]",
        "mesh.start_level=3",
        "mesh.max_level=3",
        "time={steps=2, step_s=0.5}",
        "materials.0.poisson_ratio=0.0",
        "tools.0.release_s=9.0",
        "tools.0.path=[{time_s=0.5, move_m=[0, 0, 0]}, {time_s=1, move_m=[0.03, 0, 0]}]",
        "output.surfaces=[{label=1}]",
    ];
    let blade = format!(
        "tools.1={{kind=\"scalpel\", centre_mm=[2.5, -25, {:?}], edge_m=[0, 0, 0.1], release_s=0.5, \
         path=[{{time_s=0, move_m=[0, 0, 0]}}, {{time_s=0.5, move_m=[0, 0.05, 0]}}]}}",
        20.0 - depth_mm
    );
    let more = more.iter().map(|&one| one.to_owned());
    let own = set.iter().map(|&one| one.to_owned()).chain([blade]).chain(more);
    let scene = scene_file::load("beam", &own.collect::<Vec<_>>()).unwrap().0;
    Simulation::builder(&scene).build().unwrap()
}

/// The last frame.
fn end(simulation: &mut Simulation) -> Frame {
    while simulation.steps_left() > 0 {
        let report = simulation.step().unwrap();
        assert!(report.converged, "{report:?}");
    }
    simulation.frame().unwrap()
}

/// cm³.
fn volume(surface: &SurfaceFrame) -> f64 {
    yawara_mesh::isosurface::volume(&surface.triangles, &surface.points_mm) * 1e-3
}

/// The parts of a surface that hang together by their edges, as sets of triangles.
fn parts(surface: &SurfaceFrame) -> Vec<Vec<[u32; 3]>> {
    let mut root: Vec<u32> = (0..surface.points_mm.len() as u32).collect();
    fn find(root: &mut [u32], v: u32) -> u32 {
        let mut at = v;
        while root[at as usize] != at {
            root[at as usize] = root[root[at as usize] as usize];
            at = root[at as usize];
        }
        at
    }
    for &[a, b, c] in &surface.triangles {
        for (a, b) in [(a, b), (b, c)] {
            let (a, b) = (find(&mut root, a), find(&mut root, b));
            root[a.max(b) as usize] = a.min(b);
        }
    }
    let mut found: BTreeMap<u32, Vec<[u32; 3]>> = BTreeMap::new();
    for &triangle in &surface.triangles {
        found.entry(find(&mut root, triangle[0])).or_default().push(triangle);
    }
    found.into_values().collect()
}

/// By which factor the longest edge is longer than at rest.
fn longest_stretch(surface: &SurfaceFrame) -> f64 {
    let rest: Vec<Vector3<f64>> =
        surface.points_mm.iter().zip(&surface.displacement_mm).map(|(x, u)| x - u).collect();
    let mut most: f64 = 0.0;
    for [a, b, c] in surface.triangles.iter().map(|t| t.map(|v| v as usize)) {
        for (a, b) in [(a, b), (b, c), (c, a)] {
            let length = (rest[a] - rest[b]).norm();
            // What is next to nothing at rest says nothing.
            if length > 0.1 {
                most = most.max((surface.points_mm[a] - surface.points_mm[b]).norm() / length);
            }
        }
    }
    most
}

#[test]
fn a_bar_cut_through_has_two_surfaces_that_move_apart_without_a_stretch() {
    let mut cut = bar(45.0, &[]);
    let start = cut.frame().unwrap();
    let frame = end(&mut cut);
    let both = |frame: &Frame| [frame.outline.clone().unwrap(), frame.surfaces[0].clone()];
    for (surface, before) in both(&frame).iter().zip(both(&start)) {
        // The pulled half has moved as a rigid body; so has all of its surface, its side of the cut with it.
        let moved = surface.displacement_mm.iter().map(|u| u.norm());
        let (mut at_rest, mut pulled) = (0, 0);
        for u in moved {
            at_rest += usize::from(u < 0.3);
            pulled += usize::from((u - 30.0).abs() < 0.3);
        }
        let all = surface.points_mm.len();
        assert!(
            at_rest + pulled == all && at_rest > all / 3 && pulled > all / 3,
            "{at_rest} {pulled} {all}"
        );
        assert!(longest_stretch(surface) < 1.01, "{}", longest_stretch(surface));
        // The rims of a cut and of the outline, which is half a voxel off, meet at no vertex: each half has two parts.
        let found = parts(surface);
        assert_eq!(found.len(), 4, "{:?}", found.iter().map(Vec::len).collect::<Vec<_>>());
        let change = volume(surface) / volume(&before) - 1.0;
        assert!(change.abs() < 0.02, "{change} of {} cm³", volume(&before));
        // Both sides of the cut: 2 · 16 cm².
        let area = |triangles: &Vec<[u32; 3]>| {
            yawara_mesh::isosurface::area(triangles, &surface.points_mm) * 1e-2
        };
        let mut areas: Vec<f64> = found.iter().map(area).collect();
        areas.sort_by(f64::total_cmp);
        assert!(areas[..2].iter().all(|area| (area - 16.0).abs() < 1.0), "{areas:?} cm²");
    }
    let summary = cut.summary().unwrap();
    let of_label = &summary.surfaces[0];
    let change = of_label.volume_end_m3 / of_label.volume_rest_m3 - 1.0;
    assert!(change.abs() < 0.02, "{change}");
}

#[test]
fn a_cut_that_ends_in_the_body_opens_up_to_its_end() {
    let frame = end(&mut bar(20.0, &[]));
    let outline = frame.outline.as_ref().unwrap();
    // The lips at the top are apart.
    let rest = |(x, u): (&Vector3<f64>, &Vector3<f64>)| (x - u, u.x);
    let all = outline.points_mm.iter().zip(&outline.displacement_mm).map(rest);
    let lips: Vec<(Vector3<f64>, f64)> =
        all.filter(|(x, _)| x.z > 15.0 && (x.x - 2.5).abs() < 6.0).collect();
    let [left, right] = [true, false]
        .map(|is_left| lips.iter().filter(move |(_, u)| (*u < 11.0) == is_left).map(|(_, u)| *u));
    let gap = right.fold(f64::INFINITY, f64::min) - left.fold(0.0, f64::max);
    assert!(gap > 5.0 && gap.is_finite(), "{gap} mm");
    // What is below the blade's tip is in one, and so is all of a bar that it passes by.
    let uncut = end(&mut bar(-1.0, &[]));
    let most = |frame: &Frame| longest_stretch(frame.outline.as_ref().unwrap());
    assert_eq!(parts(uncut.outline.as_ref().unwrap()).len(), 1);
    // A surface carried as if nothing were cut would be drawn across the gap.
    assert!(most(&frame) < 3.0, "{}", most(&frame));
    assert!(most(&frame) > most(&uncut));
}

#[test]
fn a_cut_that_is_sewn_again_has_the_surface_that_it_had() {
    let suture = "tools.2={kind=\"suture\", centre_mm=[2.5, 0, 0], radius_m=0.05, begin_s=0.6, release_s=1, \
                  path=[{time_s=0.6}, {time_s=1}]}";
    let still = "tools.0.path=[{time_s=0.5, move_m=[0, 0, 0]}]";
    let mut sewn = bar(45.0, &[still, suture]);
    let start = sewn.frame().unwrap();
    sewn.step().unwrap();
    let cut = sewn.frame().unwrap();
    let frame = end(&mut sewn);
    let triangles = |frame: &Frame| frame.outline.as_ref().unwrap().triangles.clone();
    assert!(triangles(&start) != triangles(&cut));
    assert!(triangles(&start) == triangles(&frame));
}
