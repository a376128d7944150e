//! `homogenisation`: how far coarse tetrahedra answer from the fine body that they stand for.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;
use yawara_embed::{CHOICES, DetailMesh, Embedding, by_name};
use yawara_mesh::phantom::{LiverPhantom, liver};
use yawara_mesh::{CellGrid, LabelTree};

use super::arguments::Common;
use super::homogenisation_cases::{Block, CASES, Inside};
use super::homogenisation_solve::{CubeMesh, Solution};
use super::{homogenisation_tables, json};
use crate::error::BenchError;
use crate::organ::organ_materials;
use crate::output::Output;
use crate::progress::Progress;

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
pub fn run(arguments: &Common) -> Result<String, BenchError> {
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
    let mut tables = homogenisation_tables::tables(&report);
    tables += &homogenisation_tables::costs(&phantom_costs()?);
    output.write("homogenisation.csv", &homogenisation_tables::csv(&report))?;
    output.write("homogenisation.md", &tables)?;
    if let Some(svg) = homogenisation_tables::plot(&report) {
        output.write("homogenisation.svg", &svg)?;
    }
    let text = json(&report, &arguments.out, "homogenisation.json")?;
    output.write("homogenisation.json", &text)?;
    Ok(tables)
}

/// What it costs to homogenise an organ of 128 voxels' length.
#[derive(Clone, Debug)]
pub(super) struct PhantomCost {
    pub choice: &'static str,
    /// Heterogeneous tetrahedra.
    pub nodes: usize,
    pub seconds: f64,
    pub bytes: usize,
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The bounds that the choices are held to, and what is written.
    #[test]
    fn the_quick_study_holds_what_is_claimed() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path().join("study");
        let text = run(&Common { out: out.clone(), quick: true, force: false }).unwrap();
        assert_eq!(std::fs::read_to_string(out.join("homogenisation.md")).unwrap(), text);
        let json = std::fs::read_to_string(out.join("homogenisation.json")).unwrap();
        let value: serde_json::Value = serde_json::from_str(&json).unwrap();
        let rows = value["rows"].as_array().unwrap();
        assert_eq!(rows.len(), 8 * CHOICES.len());
        let keys = [
            "case",
            "ratio",
            "nu",
            "levels",
            "choice",
            "error_coarse",
            "error_fine",
            "compliance_error",
            "min_eigenvalue",
            "seconds",
            "bytes",
        ];
        for row in rows {
            assert!(row.as_object().unwrap().keys().eq(keys));
            assert!(row["min_eigenvalue"].as_f64().unwrap() > 0.0, "{row}");
        }
        let mean = |choice: &str, key: &str| {
            let of =
                |row: &&serde_json::Value| row["choice"] == choice && row["case"] != "homogeneous";
            rows.iter().filter(of).map(|row| row[key].as_f64().unwrap()).sum::<f64>() / 7.0
        };
        let [laminate, linear, kharevych, paper] =
            ["laminate", "linear", "kharevych", "paper"].map(|c| mean(c, "error_coarse"));
        assert!(laminate < 0.17 && kharevych < 0.09, "{laminate} {kharevych}");
        assert!(kharevych < laminate && laminate < linear && linear < paper && paper > 1.0);
        assert!(mean("kharevych", "error_fine") < kharevych);
        assert!(mean("laminate", "error_fine") < 1.001 * laminate);
        let csv = std::fs::read_to_string(out.join("homogenisation.csv")).unwrap();
        assert_eq!(csv.lines().count(), 1 + rows.len());
        let svg = std::fs::read_to_string(out.join("homogenisation.svg")).unwrap();
        assert!(svg.contains("kharevych, 3 levels"));
    }
}
