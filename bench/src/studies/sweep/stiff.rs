//! `stiff`: how far apart the stiffness of materials may be, and how near to incompressible they.

use super::study::{self, Point};
use crate::error::Result;
use crate::harness::cases::CaseArguments;

/// A liver of large voxels: a few hundred vertices.
pub(super) const SMALL_LIVER: &[&str] = &[
    "image.voxel_mm=8",
    "mesh.base_mm=32",
    "mesh.max_level=3",
    "mesh.max_vertices=400",
    "time.steps=8",
    "refinement.split_above=2e-6",
];

/// Vertices of its references.
const REFERENCE: usize = 1500;

/// Young's modulus of the parenchyma, Pa.
const SOFT_PA: f64 = 5e3;

/// Runs the study.
pub fn run(arguments: &CaseArguments) -> Result<String> {
    let quick = arguments.quick;
    let powers: &[i32] = if quick { &[0, 3, 6, 9] } else { &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9] };
    let ratios: &[f64] =
        if quick { &[0.3, 0.49, 0.4999] } else { &[0.0, 0.3, 0.4, 0.45, 0.49, 0.499, 0.4999] };
    let mut points = Vec::new();
    for inverse in ["sparse", "woodbury"] {
        let kept = format!("stages.inverse={inverse}");
        let base = [SMALL_LIVER, &[&kept]].concat();
        for &power in powers {
            let stiff = SOFT_PA * 10f64.powi(power);
            let own = [1, 2, 3].map(|i| format!("materials.{i}.young_modulus_pa={stiff:e}"));
            let name = ("E ratio", format!("E ratio 1e{power}, {inverse}"));
            points.push(Point::new(name, "liver", REFERENCE, &base, &own));
        }
        for &nu in ratios {
            for element in ["p1", "p1p1"] {
                let mut own =
                    [0, 1, 2, 3].map(|i| format!("materials.{i}.poisson_ratio={nu}")).to_vec();
                own.push(format!("stages.element={element}"));
                let name = ("Poisson's ratio", format!("nu {nu}, {element}, {inverse}"));
                points.push(Point::new(name, "liver", REFERENCE, &base, &own));
            }
        }
    }
    study::run("stiff", &points, arguments)
}
