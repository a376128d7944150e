//! `homogenisation`: how far coarse tetrahedra answer from the fine body that they stand for.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use clap::Args;
use serde::Serialize;
use yawara_embed::{CHOICES, DetailMesh, Embedding, by_name};

use super::homogenisation_cases::{Block, CASES, Inside};
use super::homogenisation_solve::{CubeMesh, Solution};
use super::{homogenisation_tables, json};
use crate::error::BenchError;
use crate::output::Output;
use crate::progress::Progress;

/// What is asked for on the command line.
#[derive(Args, Clone, Debug)]
pub struct Arguments {
    /// Where homogenisation.csv, .json, .md and .svg go: a new or empty directory.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// The cases of the mean and the homogeneous one at three levels and ν = 0.3.
    #[arg(long)]
    pub quick: bool,
    /// Write into a directory that is not empty.
    #[arg(long)]
    pub force: bool,
}

/// One choice on one case.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// What the cube holds.
    pub case: &'static str,
    /// Largest over smallest Young's modulus.
    pub ratio: f64,
    /// Poisson's ratio of all materials.
    pub nu: f64,
    /// Levels from the finest mesh to the coarse one.
    pub levels: u8,
    /// The homogenisation.
    pub choice: &'static str,
    /// Coarse displacement, linear between coarse vertices, against that of the fine solution:
    /// relative L2 error, mean of tension and shear.
    pub error_coarse: f64,
    /// The same with all finer vertices where the embedding has them.
    pub error_fine: f64,
    /// Relative error of the loads' work, mean of tension and shear.
    pub compliance_error: f64,
    /// Smallest eigenvalue of the coarse tetrahedra's elasticity; the matrix has E = 1.
    pub min_eigenvalue: f64,
    /// Time to homogenise all levels, s.
    pub seconds: f64,
    /// Memory of the homogenised materials.
    pub bytes: usize,
    /// Whether the case is one of the mean.
    #[serde(skip)]
    pub counts: bool,
}

/// The whole study.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// By case, ν, choice and levels.
    pub rows: Vec<Row>,
}

/// Runs the study, writes its files and returns its tables.
///
/// # Errors
/// [`BenchError`] for bad arguments or a system that can't be solved; nothing is written then.
pub fn run(arguments: &Arguments) -> Result<String, BenchError> {
    let mut output = Output::create(&arguments.out, arguments.force)?;
    let (ratios, levels): (&[f64], &[u8]) =
        if arguments.quick { (&[0.3], &[3]) } else { (&[0.3, 0.45, 0.49], &[3, 6]) };
    let is_asked = |inside: &Inside| {
        !arguments.quick || *inside == Inside::Homogeneous || inside.counts(levels[0])
    };
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
    let report = Report { rows };
    let tables = homogenisation_tables::tables(&report);
    output.write("homogenisation.csv", &homogenisation_tables::csv(&report))?;
    output.write("homogenisation.md", &tables)?;
    if let Some(svg) = homogenisation_tables::plot(&report) {
        output.write("homogenisation.svg", &svg)?;
    }
    let text = json(&report, &arguments.out, "homogenisation.json")?;
    output.write("homogenisation.json", &text)?;
    Ok(tables)
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
        let embedding =
            Embedding::with_materials(tree, materials, by_name(choice)?, &mut |_| ())?;
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
            let [error_coarse, error_fine] =
                errors(&fine, &details, &coarse, &solution, exact)?;
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

impl Row {
    fn checked(self) -> Result<Self, BenchError> {
        let values = [
            ("error_coarse", self.error_coarse),
            ("error_fine", self.error_fine),
            ("compliance_error", self.compliance_error),
            ("min_eigenvalue", self.min_eigenvalue),
        ];
        for (name, value) in values {
            if !value.is_finite() {
                let what = format!("{name} of {} by {}", self.case, self.choice);
                return Err(BenchError::NotFinite { what, value });
            }
        }
        Ok(self)
    }
}
