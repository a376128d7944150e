//! `yawara-bench STUDY --out DIR`: competitors side by side, times with their errors.
#![forbid(unsafe_code)]

use std::io::Write;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use yawara_bench::studies::sweep::{extremes, stiff};
use yawara_bench::studies::{
    Arguments, CaseArguments, Common, ablation, compare, cracks, cut, drift, elements, endurance,
    estimates, homogenisation, identify, laws, mesh, meshes, pareto, reality, resolution, robust,
    scaling, table1, touch, validate,
};
use yawara_bench::{BenchError, ranks};

/// Studies that run the implementations of a stage side by side, alternating in one process.
#[derive(Parser)]
#[command(name = "yawara-bench", version)]
struct Cli {
    #[command(subcommand)]
    study: Study,
}

#[derive(Subcommand)]
enum Study {
    /// One vertex in and out at the sizes of the paper's Table 1, by every method.
    Table1 {
        #[command(flatten)]
        arguments: Arguments,
        /// With the inverse on the first graphics device, beside the dense ones of the host (needs
        /// the feature `gpu`).
        #[arg(long)]
        gpu: bool,
        /// Another device: its number in `yawara devices`, or a part of its name.
        #[arg(long, value_name = "ADAPTER", requires = "gpu")]
        adapter: Option<String>,
    },
    /// What 10000 random updates leave of the inverse, and whether its monitor sees it (quick:
    /// three of the twelve cases, a small mesh and 300 updates).
    Drift(drift::Arguments),
    /// How the operations grow with the mesh, up to 30000 vertices.
    Scaling(Arguments),
    /// The bisection forest: shapes, closures, cost of a split, volume to label tree (quick: up to
    /// 10⁵ leaves and 128³ voxels instead of 10⁶ and 256³).
    Mesh(Common),
    /// Coarse bodies against the fine one that they stand for, by every homogenisation (quick: the
    /// cases of the mean and the homogeneous one at three levels and ν = 0.3).
    Homogenisation(Common),
    /// What it takes to double a vertex, beside a split and a factor made anew (quick: one small size).
    Cut(Common),
    /// The energy that a cut releases, against fracture mechanics, on even and on graded meshes (quick: coarse ones).
    Cracks(Common),
    /// Linear tetrahedra towards incompressibility, with and without a pressure (quick: meshes and
    /// references half as fine).
    Elements(Common),
    /// What a step costs under each law, on one mesh (quick: a coarse one).
    Laws(Common),
    /// A scene on uniform meshes of rising level: where force, energy and displacement go.
    Meshes(meshes::Arguments),
    /// The estimated error of energy over the error itself, on random scenes (quick: 6 of 50).
    Estimates(estimates::Arguments),
    /// Cases with a known solution: beams, spheres, rotation; errors and their slopes (quick: one
    /// refinement less of each).
    Validate(validate::Arguments),
    /// Error against run time: every stage varied on one scene, against a converged reference.
    Pareto(pareto::Arguments),
    /// A recorded beam of silicone against its simulation, fitted to the bare beam alone (quick: one coarse mesh).
    Reality(reality::Arguments),
    /// Moduli from noisy moves and forces: errors, how often bands hold the truth, the gradient (quick: few points, 10 trials).
    Identify(identify::Arguments),
    /// Bodies at the resolution of their image by PETSc, on the processes of mpirun: iterations, memory, and how far the
    /// start mesh is off (needs the feature `petsc`).
    Resolution(resolution::Arguments),
    /// Stiffness ratios up to 1e9 and Poisson's ratios up to .4999.
    Stiff(CaseArguments),
    /// Thin vessels, long voxels, fast tools, long steps, many updates.
    Extremes(CaseArguments),
    /// Stiff and extreme cases, by element and equilibrium: steps that converge, iterations, times.
    Robust(robust::Arguments),
    /// The rate and the force of palpate beside evenly laid meshes of the same scene, and what a change of the mesh
    /// does to the force (quick: 60 of 390 steps, a coarser reference).
    Touch(touch::Arguments),
    /// Random grabs, pads and balls on the refining liver for 100000 steps: what does not converge, times,
    /// memory (quick: 320 steps).
    Endurance(endurance::Arguments),
    /// What the plan leaves out, against the same with everything switched on.
    Ablation(CaseArguments),
    /// Two results of a study, figure by figure: exits 1 if a count or an error got worse.
    Compare(compare::Arguments),
}

impl Study {
    /// Updates of the inverse are compared with direct methods that run in one thread: so does all
    /// else beside them. This thread steps, and is one of those that share the work, as in `yawara run`.
    fn set_threads(&self) -> Result<(), rayon::ThreadPoolBuildError> {
        let mut pool = rayon::ThreadPoolBuilder::new().use_current_thread();
        if matches!(self, Self::Table1 { .. } | Self::Drift(_) | Self::Scaling(_)) {
            pool = pool.num_threads(1);
        }
        pool.build_global()
    }

    /// Whether processes of one mpirun share its cases.
    fn shares_cases(&self) -> bool {
        matches!(
            self,
            Self::Pareto(_)
                | Self::Stiff(_)
                | Self::Extremes(_)
                | Self::Robust(_)
                | Self::Ablation(_)
        )
    }
}

/// What is printed, and whether all is as it should be.
fn run(study: &Study) -> Result<(String, bool), BenchError> {
    if !matches!(study, Study::Resolution(_)) {
        ranks::check(study.shares_cases())?;
    }
    let printed = match study {
        #[cfg(feature = "gpu")]
        Study::Table1 { arguments, gpu: true, adapter } => {
            table1::gpu::run(arguments, adapter.as_deref())
        }
        #[cfg(not(feature = "gpu"))]
        Study::Table1 { gpu: true, .. } => Err(BenchError::FeatureMissing("--gpu", "gpu")),
        Study::Table1 { arguments, gpu: false, .. } => table1::run(arguments),
        Study::Drift(arguments) => drift::run(arguments),
        Study::Scaling(arguments) => scaling::run(arguments),
        Study::Mesh(arguments) => mesh::run(arguments),
        Study::Homogenisation(arguments) => homogenisation::run(arguments),
        Study::Cut(arguments) => cut::run(arguments),
        Study::Cracks(arguments) => cracks::run(arguments),
        Study::Elements(arguments) => elements::run(arguments),
        Study::Laws(arguments) => laws::run(arguments),
        Study::Meshes(arguments) => meshes::run(arguments),
        Study::Estimates(arguments) => estimates::run(arguments),
        Study::Validate(arguments) => validate::run(arguments),
        Study::Reality(arguments) => reality::run(arguments),
        Study::Identify(arguments) => identify::run(arguments),
        Study::Resolution(arguments) => resolution::run(arguments),
        Study::Pareto(arguments) => pareto::run(arguments),
        Study::Stiff(arguments) => stiff::run(arguments),
        Study::Extremes(arguments) => extremes::run(arguments),
        Study::Robust(arguments) => robust::run(arguments),
        Study::Touch(arguments) => touch::run(arguments),
        Study::Endurance(arguments) => endurance::run(arguments),
        Study::Ablation(arguments) => ablation::run(arguments),
        Study::Compare(arguments) => {
            let found = compare::compare(arguments)?;
            return Ok((found.markdown(), found.worse.is_empty()));
        }
    };
    printed.map(|text| (text, true))
}

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) if error.use_stderr() => return refuse(&paragraph(&error)),
        Err(help) => {
            // Help into a closed pipe is no failure.
            let _ = help.print();
            return ExitCode::SUCCESS;
        }
    };
    if let Err(error) = cli.study.set_threads() {
        return refuse(&error.to_string());
    }
    match run(&cli.study).and_then(|done| ranks::finish().map(|()| done)) {
        Ok((report, good)) => {
            // All is in the files: a reader that leaves early misses nothing.
            let _ = write!(std::io::stdout(), "{report}");
            if good { ExitCode::SUCCESS } else { ExitCode::FAILURE }
        }
        Err(error) => {
            let code = refuse(&error.to_string());
            // The others would wait for what this one will not do.
            ranks::abort(REFUSED);
            code
        }
    }
}

/// The exit code of what is refused, and of what fails.
const REFUSED: u8 = 2;

/// One paragraph on stderr.
fn refuse(message: &str) -> ExitCode {
    let words: Vec<&str> = message.split_whitespace().collect();
    let rank = ranks::rank().map_or_else(String::new, |rank| format!("rank {rank}: "));
    let _ = writeln!(std::io::stderr(), "yawara-bench: {rank}{}", words.join(" "));
    ExitCode::from(REFUSED)
}

/// The message of a usage error without the usage lines.
fn paragraph(error: &clap::Error) -> String {
    let text = error.to_string();
    let text = text.strip_prefix("error: ").unwrap_or(&text);
    let end =
        ["\nUsage:", "\nFor more information"].iter().filter_map(|mark| text.find(mark)).min();
    format!("{} (see yawara-bench --help)", text[..end.unwrap_or(text.len())].trim_end())
}
