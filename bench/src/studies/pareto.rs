//! `pareto`: error against run time on a scene.

use clap::Args;

use crate::error::Result;
use crate::harness::arguments::in_range;
use crate::harness::cases::Selection;
use crate::pareto::{Candidate, Options, Study};
use crate::solvers::ReferenceBy;

/// What is asked for on the command line.
#[derive(Args, Clone, Debug)]
pub struct Arguments {
    /// A built-in scene or a TOML file.
    #[arg(default_value = "liver")]
    pub scene: String,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub selection: Selection,
    /// Fewer candidates on a small mesh: the beam in less than a minute.
    #[arg(long)]
    pub quick: bool,
    /// Replaces a value of the scene for all, as for yawara run.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// A further candidate: values of the scene that it replaces.
    #[arg(long, value_name = "NAME: KEY=VALUE, KEY=VALUE")]
    pub combination: Vec<String>,
    /// Only the candidates whose names have one of these words in them; repeatable.
    #[arg(long, value_name = "WORDS")]
    pub only: Vec<String>,
    /// Seconds that the run of one candidate may take [default: 40, quick: 10].
    #[arg(long, value_name = "S")]
    pub cap_s: Option<usize>,
    /// Vertices that the uniform mesh of the reference may have [default: 30000, quick: 3000].
    #[arg(long, value_name = "N")]
    pub reference_vertices: Option<usize>,
    /// What the reference is solved by.
    #[arg(long, value_enum, default_value_t)]
    pub reference: ReferenceBy,
}

/// Up to a day.
const SECONDS: (usize, usize) = (1, 86_400);

/// Fewer are no mesh, more take days.
const VERTICES: (usize, usize) = (8, 1_000_000);

impl Arguments {
    /// The study asked for.
    /// # Errors
    /// `BenchError::OutOfRange`, `BenchError::Combination`, and those of [`Study::new`].
    pub fn study(&self) -> Result<Study> {
        let named: Vec<Candidate> =
            self.combination.iter().map(|text| Candidate::parse(text)).collect::<Result<_, _>>()?;
        let mut options = Options::new(&self.scene, self.quick);
        options.overrides.extend(self.set.iter().cloned());
        for one in &named {
            // What is mistyped is refused before anything is measured.
            one.stages(&one.scene(&options.scene, &options.overrides)?)?;
        }
        if let Some(seconds) = self.cap_s {
            in_range("--cap-s", seconds, SECONDS)?;
            options.cap_s = seconds as f64;
        }
        if let Some(vertices) = self.reference_vertices {
            in_range("--reference-vertices", vertices, VERTICES)?;
            options.reference_vertices = vertices;
        }
        options.reference = self.reference;
        let mut study = Study::new(options)?;
        study.candidates.extend(named);
        if !self.only.is_empty() {
            let wanted = |one: &Candidate| self.only.iter().any(|words| one.name.contains(words));
            study.candidates.retain(wanted);
        }
        Ok(study)
    }
}

/// Runs the study.
pub fn run(arguments: &Arguments) -> Result<String> {
    arguments.study()?.run(&arguments.selection)
}
