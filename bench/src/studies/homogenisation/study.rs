//! All cases by all choices.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use yawara_embed::{CHOICES, DetailMesh, Embedding, by_name};
use yawara_mesh::phantom::{LiverPhantom, liver};
use yawara_mesh::{CellGrid, LabelTree};

use super::cube_mesh::{CubeMesh, Solution};
use super::mixture::{Block, CASES, Inside};
use super::row::{PhantomCost, Row};
use super::tables;
use crate::bodies::organ::organ_materials;
use crate::error::BenchError;
use crate::harness::Progress;
use crate::harness::arguments::Common;
use crate::harness::report::{self, Summary};

/// Runs the study, writes its files and returns its tables.
///
/// # Errors
/// [`BenchError`] for bad arguments or a system that can't be solved; nothing is written then.
pub fn run(arguments: &Common) -> Result<String, BenchError> {
    let quick = arguments.quick;
    let folder = arguments.destination.folder()?;
    let (ratios, levels): (&[f64], &[u8]) =
        if quick { (&[0.3], &[3]) } else { (&[0.3, 0.45, 0.49], &[3, 6]) };
    let is_asked =
        |inside: &Inside| !quick || *inside == Inside::Homogeneous || inside.counts(levels[0]);
    let cases: Vec<Inside> = CASES.into_iter().filter(is_asked).collect();
    let mut progress = Progress::new((cases.len() * ratios.len() * CHOICES.len()) as f64);
    let mut rows = Vec::new();
    for inside in cases {
        let block = Block::new(inside)?;
        for &nu in ratios {
            rows.extend(case_rows(&block, nu, levels, &mut progress)?);
        }
    }
    drop(progress);
    let text = tables::tables(&rows) + &tables::costs(&phantom_costs()?);
    let summary = Summary::new(text).with_file("homogenisation.svg", tables::plot(&rows));
    report::write(&folder, "homogenisation", &rows, summary)
}

/// The local choices on the liver phantom, all levels: the better of two runs.
fn phantom_costs() -> Result<Vec<PhantomCost>, BenchError> {
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
fn case_rows(
    block: &Block,
    nu: f64,
    levels: &[u8],
    progress: &mut Progress,
) -> Result<Vec<Row>, BenchError> {
    let fine = CubeMesh::new(block, 0)?;
    let mut exact = None;
    let mut rows = Vec::new();
    for choice in CHOICES {
        progress.advance(&format!("{} {:.0e}, {choice}", block.inside.name(), block.ratio()), 1.0);
        let begin = Instant::now();
        let (tree, materials) = (Arc::clone(&block.tree), block.materials(nu)?);
        let mut go_on = |_| ControlFlow::Continue(());
        let embedding = Embedding::with_materials(tree, materials, by_name(choice)?, &mut go_on)?;
        let seconds = begin.elapsed().as_secs_f64();
        // The finest tetrahedra are the same for all.
        if exact.is_none() {
            exact = Some(fine.solve(&embedding)?);
        }
        let Some(exact) = &exact else { continue };
        let details = [
            DetailMesh::new(fine.forest.clone()),
            DetailMesh::embedded(fine.forest.clone(), &embedding, fine.unit())?,
        ];
        for &levels in levels {
            let coarse = CubeMesh::new(block, levels)?;
            let solution = coarse.solve(&embedding)?;
            let [error_coarse, error_fine] = errors(&fine, &details, &coarse, &solution, exact)?;
            let of_compliance =
                |i: usize| (solution.compliances[i] / exact.compliances[i] - 1.0).abs();
            let row = Row {
                case: block.inside.name(),
                ratio: block.ratio(),
                nu,
                levels,
                choice,
                error_coarse,
                error_fine,
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

/// Mean over the loads of the error with middles and with the embedding.
fn errors(
    fine: &CubeMesh,
    details: &[DetailMesh; 2],
    coarse: &CubeMesh,
    solution: &Solution,
    exact: &Solution,
) -> Result<[f64; 2], BenchError> {
    let mut errors = [0.0; 2];
    for (error, detail) in errors.iter_mut().zip(details) {
        let carried = fine.carried(detail, coarse, solution)?;
        for (u, v) in carried.iter().zip(&exact.displacements) {
            *error += 0.5 * fine.relative_error(u, v);
        }
    }
    Ok(errors)
}

fn min_eigenvalue(mesh: &CubeMesh, embedding: &Embedding) -> f64 {
    let of = |tet: yawara_mesh::Tet| embedding.elasticity(tet.node).symmetric_eigenvalues().min();
    mesh.forest.leaves().map(of).fold(f64::INFINITY, f64::min)
}
