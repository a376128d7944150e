//! `extremes`: thin vessels, long voxels, fast tools, long steps, many updates.

use super::stiff::SMALL_LIVER;
use super::study::{self, Point};
use crate::bodies::solid::places;
use crate::error::Result;
use crate::harness::cases::CaseArguments;

/// A beam of at most 425 vertices, which is also what its references have.
const SMALL_BEAM: &[&str] = &["mesh.max_level=3", "mesh.max_vertices=425", "time.steps=10"];

/// Vertices of the references of beams, and of livers.
const REFERENCE: [usize; 2] = [425, 1500];

/// Voxels of the block along right, anterior, superior in cubes of 2.5 mm.
const BLOCK: [usize; 3] = [64, 16, 16];

/// Edge of those cubes, mm.
const FINE_MM: f64 = 2.5;

/// Runs the study.
pub fn run(arguments: &CaseArguments) -> Result<String> {
    let quick = arguments.quick;
    let mut points = vessels(quick);
    points.extend(voxels(quick));
    points.extend(tools(quick));
    points.extend(updates(quick));
    study::run("extremes", &points, arguments)
}

fn beam(group: &'static str, name: String, own: &[String]) -> Point {
    Point::new((group, name), "beam", REFERENCE[0], SMALL_BEAM, own)
}

/// The same vessels, a hundred times as stiff, in ever larger voxels: down to less than one across.
fn vessels(quick: bool) -> Vec<Point> {
    let edges: &[f64] = if quick { &[4.0, 12.0] } else { &[2.0, 4.0, 8.0, 12.0] };
    let one = |edge: &f64| {
        let (name, own) = (format!("voxels of {edge} mm"), [format!("image.voxel_mm={edge}")]);
        Point::new(("vessels", name), "liver", REFERENCE[1], SMALL_LIVER, &own)
    };
    edges.iter().map(one).collect()
}

/// A block with a stiff core in voxels ever higher than wide, which are resampled to cubes.
fn voxels(quick: bool) -> Vec<Point> {
    let ratios: &[usize] = if quick { &[1, 8] } else { &[1, 2, 4, 8] };
    let one = |&ratio: &usize| {
        let core = "materials.1={label=2, young_modulus_pa=5e5, poisson_ratio=0.3}";
        let own = ["image.voxel_mm=2.5", core].map(str::to_owned);
        let image = Some(block(ratio));
        Point { image, ..beam("voxels", format!("voxels 1 x 1 x {ratio}"), &own) }
    };
    ratios.iter().map(one).collect()
}

/// The tip is moved farther in the same steps, or as far in fewer.
fn tools(quick: bool) -> Vec<Point> {
    let speeds: &[f64] = if quick { &[0.02, 0.08] } else { &[0.01, 0.02, 0.04, 0.08] };
    let fast = |speed: &f64| {
        let own = [format!("tools.0.path.1.move_m=[0.0, 0.0, {speed}]")];
        beam("tool speed", format!("tool at {speed} m/s"), &own)
    };
    let counts: &[usize] = if quick { &[2, 10] } else { &[1, 2, 5, 10, 20, 40] };
    let long = |count: &usize| {
        let own = [format!("time.steps={count}"), format!("time.step_s={}", 1.0 / *count as f64)];
        beam("load step", format!("{count} steps to 20 mm"), &own)
    };
    speeds.iter().map(fast).chain(counts.iter().map(long)).collect()
}

/// The tip goes up and down again and again: vertices come and go, and the inverse is updated.
fn updates(quick: bool) -> Vec<Point> {
    let cycles: &[usize] = if quick { &[1, 4] } else { &[1, 4, 16, 64] };
    let mut points = Vec::new();
    for inverse in ["sparse", "woodbury", "paper"] {
        for &count in cycles {
            let key = |n: usize| match n % 2 {
                0 => format!("{{time_s={n}.0}}"),
                _ => format!("{{time_s={n}.0, move_m=[0.0, 0.0, 0.02]}}"),
            };
            let keys: Vec<String> = (0..=2 * count).map(key).collect();
            let own = [
                format!("tools.0.path=[{}]", keys.join(", ")),
                format!("tools.0.release_s={}.0", 4 * count),
                format!("time.steps={}", 8 * count),
                "time.step_s=0.25".to_owned(),
                "refinement.dwell_steps=1".to_owned(),
                "refinement.merge_fraction=0.3".to_owned(),
                format!("stages.inverse={inverse}"),
            ];
            points.push(beam("updates", format!("{count} cycles, {inverse}"), &own));
        }
    }
    points
}

/// An NRRD label map of the block: label 2 within 14 mm of its centre, else 1.
pub(in crate::studies) fn block(ratio: usize) -> Vec<u8> {
    let [nx, ny, nz] = [BLOCK[0], BLOCK[1], BLOCK[2] / ratio];
    let high = FINE_MM * ratio as f64;
    let mut bytes = format!(
        "NRRD0004\ntype: uint8\ndimension: 3\nsizes: {nx} {ny} {nz}\nspace: \
         right-anterior-superior\nspace directions: ({FINE_MM},0,0) (0,{FINE_MM},0) (0,0,{high})\n\
         space origin: (0,0,0)\nencoding: raw\n\n"
    )
    .into_bytes();
    bytes.extend(places([nx, ny, nz]).map(|voxel| {
        let [x, y, z] = voxel.map(|c| c as f64 + 0.5);
        let off = [x - 32.0, y - 8.0, z * ratio as f64 - 8.0].map(|cubes| cubes * FINE_MM);
        let radius = off.iter().map(|x| x * x).sum::<f64>().sqrt();
        if radius < 14.0 { 2 } else { 1 }
    }));
    bytes
}
