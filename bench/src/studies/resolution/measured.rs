//! What the bodies took, and how far coarser meshes and the built-in factor are off.

use std::time::Instant;

use serde::Serialize;
use yawara_petsc::Petsc;

use super::arguments::Arguments;
use super::bodies::{Uniform, corotated, cube, organ};
use crate::error::{BenchError, Result};
use crate::harness::machine::{peak_bytes, reset_peak, resident_bytes};
use crate::harness::plot::slope;
use crate::harness::report::markdown::rows as table;
use crate::harness::report::{self, Claim, Limit, Summary};
use crate::harness::{Folder, Progress};
use crate::petsc::{Body, Problem, sum_of};

/// Version of the JSON layout.
const SCHEMA: &str = "yawara-bench-resolution-1";

/// Vertices up to which the built-in factor solves the same.
const FACTORED: usize = 40_000;

/// Vertices up to which the equilibrium solvers of this project find the co-rotated body at rest too.
const COROTATED: usize = 1_000;

/// How many times as many iterations the largest cube may take as the smallest.
const GROWTH: f64 = 1.5;

/// Vertices of an image of 512³ voxels that is all body.
const WHOLE: f64 = 513.0 * 513.0 * 513.0;

/// A body at rest.
#[derive(Clone, Debug, Serialize)]
struct Row {
    body: String,
    model: &'static str,
    /// Held ones included.
    unknowns: usize,
    processes: usize,
    /// Outer iterations, and of conjugate gradients.
    outer: usize,
    inner: usize,
    residual: f64,
    /// What of that may be rounding.
    rounding: f64,
    work_j: f64,
    largest_m: f64,
    /// What the start mesh with `laminate` does of the work, relative and less one; of linear bodies whose hold is the
    /// same on both.
    #[serde(skip_serializing_if = "Option::is_none")]
    start_mesh_error: Option<f64>,
    /// ‖u − u'‖ / ‖u'‖ to the solution by the built-in factor, for small bodies of one process.
    #[serde(skip_serializing_if = "Option::is_none")]
    factor_error: Option<f64>,
    setup_s: f64,
    solve_s: f64,
    /// The most that all processes together had, beside what they had before the first body.
    gigabytes: f64,
}

/// Runs the study.
///
/// # Errors
/// [`BenchError::Option`] for cubes that are none; [`BenchError::Petsc`].
pub fn run(arguments: &Arguments) -> Result<String> {
    let Arguments { common, cubes, ratio, liver_mm, residual } = arguments;
    let quick = common.quick && cubes == &[16, 32, 64];
    let cubes = if quick { &vec![8, 16, 32] } else { cubes };
    let check = |option, value: String, is_good, want| match is_good {
        true => Ok(()),
        false => Err(BenchError::Option(option, value, want)),
    };
    for &n in cubes {
        let is_good = n.is_power_of_two() && (8..=512).contains(&n);
        check("--cubes", n.to_string(), is_good, "a power of two from 8 to 512")?;
    }
    let is_positive = |x: f64| x.is_finite() && x > 0.0;
    check("--ratio", ratio.to_string(), is_positive(*ratio), "a number above 0")?;
    check("--residual", residual.to_string(), is_positive(*residual), "a number above 0")?;
    for &mm in liver_mm {
        check("--liver-mm", mm.to_string(), mm.is_finite() && mm >= 0.1, "at least 0.1")?;
    }
    let petsc = Petsc::start()?;
    let is_first = petsc.rank() == 0;
    let folder = is_first.then(|| common.folder()).transpose()?;
    let before = sum_of(petsc, resident_bytes().unwrap_or(0) as f64)?;
    let mut rows = Vec::new();
    let mut progress = Progress::new((2 * (cubes.len() + liver_mm.len())) as f64);
    let mut run = |name: String, problem: &Problem| -> Result<()> {
        for model in ["linear", "corotated"] {
            rows.push(measure((petsc, before), &name, problem, model, *residual)?);
            if is_first {
                progress.advance(&name, 1.0);
            }
        }
        Ok(())
    };
    for &voxels in cubes {
        run(format!("cube of {voxels}³ voxels"), &cube(voxels, *ratio)?)?;
    }
    for &mm in liver_mm {
        run(format!("liver at {mm} mm"), &organ(mm)?)?;
    }
    drop(progress);
    folder.map_or_else(|| Ok(String::new()), |folder| write(&folder, &rows))
}

fn measure(
    (petsc, before): (&Petsc, f64),
    name: &str,
    problem: &Problem,
    model: &'static str,
    residual: f64,
) -> Result<Row> {
    reset_peak();
    let begin = Instant::now();
    let body = Body::new(petsc, problem)?;
    let setup_s = begin.elapsed().as_secs_f64();
    let is_linear = model == "linear";
    let rest = body.come_to_rest(!is_linear, residual)?;
    let solve_s = begin.elapsed().as_secs_f64() - setup_s;
    let peak = sum_of(petsc, peak_bytes().unwrap_or(0) as f64)?;
    let is_compared = is_linear && problem.is_held_alike;
    let start = is_compared.then(|| Uniform::solve(problem, 0)).transpose()?;
    let finest = problem.tree.grid().embed_level();
    let is_small = |limit: usize| petsc.size() == 1 && body.vertices() <= limit;
    let factored = match is_linear {
        true if is_small(FACTORED) => Some(Uniform::solve(problem, finest)?.displacements),
        false if is_small(COROTATED) => Some(corotated(problem, residual)?),
        _ => None,
    };
    let factor_error = factored.map(|factored| {
        let (mut off, mut size) = (0.0, 0.0);
        for (point, want) in &factored {
            off += (rest.displacements[body.number(*point)] - want).norm_squared();
            size += want.norm_squared();
        }
        (off / size).sqrt()
    });
    Ok(Row {
        body: name.to_owned(),
        model,
        unknowns: 3 * body.vertices(),
        processes: petsc.size(),
        outer: rest.outer,
        inner: rest.inner,
        residual: rest.residual,
        rounding: rest.rounding,
        work_j: rest.work_j,
        largest_m: rest.largest_m,
        start_mesh_error: start.map(|start| start.work_j / rest.work_j - 1.0),
        factor_error,
        setup_s,
        solve_s,
        gigabytes: 1e-9 * (peak - before),
    })
}

fn write(folder: &Folder, rows: &[Row]) -> Result<String> {
    let mut text = table(
        rows,
        &[
            ("body", |row| row.body.clone()),
            ("model", |row| row.model.to_owned()),
            ("unknowns", |row| row.unknowns.to_string()),
            ("processes", |row| row.processes.to_string()),
            ("outer", |row| row.outer.to_string()),
            ("CG", |row| row.inner.to_string()),
            ("residual", |row| format!("{:.1e}", row.residual)),
            ("of it rounding", |row| format!("{:.1e}", row.rounding)),
            ("work, J", |row| format!("{:.6e}", row.work_j)),
            ("start mesh's error", |row| shown(row.start_mesh_error)),
            ("apart from the factor", |row| shown(row.factor_error)),
            ("set up, s", |row| format!("{:.1}", row.setup_s)),
            ("solve, s", |row| format!("{:.1}", row.solve_s)),
            ("GB", |row| format!("{:.2}", row.gigabytes)),
        ],
    );
    let linear: Vec<&Row> =
        rows.iter().filter(|row| row.model == "linear" && row.body.starts_with("cube")).collect();
    let mut claims = Vec::new();
    if let [first, .., last] = linear[..] {
        let growth = last.inner as f64 / first.inner.max(1) as f64;
        let what = "iterations of the largest cube over those of the smallest";
        claims.push(Claim::new(what, growth, Limit::AtMost(GROWTH)));
        let points: Vec<(f64, f64)> =
            linear.iter().map(|row| (row.unknowns as f64, row.gigabytes)).collect();
        let slope = slope(&points);
        let whole = last.gigabytes * (3.0 * WHOLE / last.unknowns as f64).powf(slope);
        text += &format!(
            "\nMemory grows as the unknowns to the power of {slope:.2}: an image of 512³ voxels would take {whole:.0} GB.\n"
        );
    }
    text.extend(claims.iter().map(Claim::text));
    let summary = Summary::new(text).with("schema", SCHEMA).with("claims", claims);
    report::write(folder, "resolution", rows, summary)
}

fn shown(error: Option<f64>) -> String {
    error.map_or_else(String::new, |error| format!("{error:.1e}"))
}
