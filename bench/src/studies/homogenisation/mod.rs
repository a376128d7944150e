//! `homogenisation`: how far coarse tetrahedra answer from the fine body that they stand for.
//!
//! `mixture.rs` says what the unit cubes are made of, `report.rs` has the rows and prints them.

mod mixture;
mod report;

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use yawara_embed::{CHOICES, DetailMesh, Embedding, by_name};
use yawara_mesh::phantom::{LiverPhantom, liver};
use yawara_mesh::{BisectionForest, CellGrid, LabelTree};

use crate::bodies::{CubeMesh, organ_materials};
use crate::error::Result;
use crate::harness::report::{Summary, write};
use crate::harness::{Common, Progress};
use mixture::{Block, CASES, Inside, MEDIA};
use report::{PhantomCost, Row};

/// Runs the study.
pub fn run(arguments: &Common) -> Result<String> {
    let quick = arguments.quick;
    let folder = arguments.folder()?;
    let (ratios, levels): (&[f64], &[u8]) =
        if quick { (&[0.3], &[3]) } else { (&[0.3, 0.45, 0.49], &[3, 6]) };
    let is_asked =
        |inside: &Inside| !quick || *inside == Inside::Homogeneous || inside.counts(levels[0]);
    let cases: Vec<Inside> = CASES.into_iter().filter(is_asked).collect();
    let blocks = cases.len() * ratios.len() + MEDIA.len();
    let mut progress = Progress::new((blocks * CHOICES.len()) as f64);
    let (mut rows, mut media) = (Vec::new(), Vec::new());
    for inside in cases {
        let block = Block::new(inside)?;
        for &nu in ratios {
            rows.extend(case_rows(&block, nu, levels, &mut progress)?);
        }
    }
    for (inside, nu) in MEDIA {
        media.extend(case_rows(&Block::new(inside)?, nu, levels, &mut progress)?);
    }
    drop(progress);
    let means = report::means(&media);
    let text =
        report::tables(&rows) + &report::media(&media, &means) + &report::costs(&phantom_costs()?);
    let plot = report::plot(&rows);
    rows.extend(media);
    let summary =
        Summary::new(text).with("mean_of_media", means).with_file("homogenisation.svg", plot);
    write(&folder, "homogenisation", &rows, summary)
}

/// The local choices on the liver phantom, all levels: the better of two runs.
fn phantom_costs() -> Result<Vec<PhantomCost>> {
    let volume = liver(LiverPhantom { length_mm: 196.0, voxel_mm: 196.0 / 128.0, seed: 1 })?;
    let tree = Arc::new(LabelTree::new(&volume, CellGrid::around(&volume, 8)?)?);
    let mut costs = Vec::new();
    for choice in CHOICES {
        if by_name(choice)?.global().is_some() {
            continue;
        }
        let mut cost =
            PhantomCost { choice, nodes: tree.node_count(), seconds: f64::INFINITY, bytes: 0 };
        for _ in 0..2 {
            let materials = organ_materials()?;
            let begin = Instant::now();
            let embedding = Embedding::new(Arc::clone(&tree), materials, by_name(choice)?)?;
            cost.seconds = cost.seconds.min(begin.elapsed().as_secs_f64());
            cost.bytes = embedding.bytes();
        }
        costs.push(cost);
    }
    Ok(costs)
}

/// All choices on one body.
fn case_rows(block: &Block, nu: f64, levels: &[u8], progress: &mut Progress) -> Result<Vec<Row>> {
    let finest = block.tree.grid().embed_level();
    let mesh = |levels: u8| CubeMesh::new(&block.tree, finest - levels, finest - levels);
    let fine = mesh(0)?;
    let mut exact = None;
    let mut rows = Vec::new();
    for choice in CHOICES {
        progress.advance(&format!("{} {:.0e}, {choice}", block.inside.name(), block.ratio()), 1.0);
        let begin = Instant::now();
        let embedding = embedded(block, nu, choice)?;
        let seconds = begin.elapsed().as_secs_f64();
        // The finest tetrahedra are the same for all.
        if exact.is_none() {
            exact = Some(fine.solve(&embedding)?);
        }
        let Some(exact) = &exact else { continue };
        let forest = || BisectionForest::clone(&fine.forest);
        let details = [
            DetailMesh::new(forest()),
            DetailMesh::embedded(forest(), &embedding, fine.placement.unit)?,
        ];
        for &levels in levels {
            let coarse = mesh(levels)?;
            let solution = coarse.solve(&embedding)?;
            // Mean over the loads of the error with middles and with the embedding.
            let mut errors = [0.0; 2];
            for (error, detail) in errors.iter_mut().zip(&details) {
                let carried = fine.carried(detail, &coarse, &solution)?;
                for (u, v) in carried.iter().zip(&exact.displacements) {
                    *error += 0.5 * fine.relative_error(u, v);
                }
            }
            let of_compliance =
                |i: usize| (solution.compliances[i] / exact.compliances[i] - 1.0).abs();
            let row = Row {
                case: block.inside.name(),
                ratio: block.ratio(),
                nu,
                levels,
                choice,
                error_coarse: errors[0],
                error_fine: errors[1],
                compliance_error: 0.5 * (of_compliance(0) + of_compliance(1)),
                min_eigenvalue: min_eigenvalue(&coarse, &embedding),
                seconds,
                bytes: embedding.bytes(),
                counts: block.inside.counts(levels),
            };
            rows.push(row.checked()?);
        }
    }
    Ok(rows)
}

/// The block's materials on all levels.
fn embedded(block: &Block, nu: f64, choice: &str) -> Result<Embedding> {
    let (tree, materials) = (Arc::clone(&block.tree), block.materials(nu)?);
    let mut go_on = |_| ControlFlow::Continue(());
    Ok(Embedding::with_materials(tree, materials, by_name(choice)?, &mut go_on)?)
}

fn min_eigenvalue(mesh: &CubeMesh, embedding: &Embedding) -> f64 {
    let of = |tet: yawara_mesh::Tet| embedding.elasticity(tet.node).symmetric_eigenvalues().min();
    mesh.forest.leaves().map(of).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn a_uniform_rod_of_no_lateral_strain_is_solved_exactly() {
        // ν = 0 under tension: u_z = z t / E, no corner effect, compliance t² V / E.
        let block = Block::new(Inside::Homogeneous).unwrap();
        let embedding = embedded(&block, 0.0, "laminate").unwrap();
        let finest = block.tree.grid().embed_level();
        let mesh = CubeMesh::new(&block.tree, finest - 6, finest - 6).unwrap();
        let solution = mesh.solve(&embedding).unwrap();
        for v in mesh.forest.vertices() {
            let want = Vector3::new(0.0, 0.0, mesh.rest(v).z);
            assert!((solution.displacements[0][v.index()] - want).norm() < 1e-12);
        }
        assert!((solution.compliances[0] - 1.0).abs() < 1e-12);
        // Carried to the finest mesh it is still exact, and 1 % more is an error of 1 %.
        let fine = CubeMesh::new(&block.tree, finest, finest).unwrap();
        let detail = DetailMesh::new(BisectionForest::clone(&fine.forest));
        let [u, _] = fine.carried(&detail, &mesh, &solution).unwrap();
        let exact: Vec<Vector3<f64>> = u.iter().map(|u| u / 1.01).collect();
        assert!((fine.relative_error(&u, &exact) - 0.01).abs() < 1e-12);
    }
}
