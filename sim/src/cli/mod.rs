//! The command line: a file per command.
//!
//! `arguments` is the file to open first: what each command takes. `console` writes plans and
//! summaries for people, `printer` is standard output, `input` is what the commands on images share.

mod arguments;
mod completions;
mod console;
#[cfg(feature = "view")]
mod export;
mod feel;
mod haptic;
mod identify;
mod init;
mod input;
mod labels;
mod man;
mod mesh;
mod preview;
mod printer;
mod run;
mod surface;
#[cfg(feature = "view")]
mod view;

use std::ffi::OsString;
use std::io::{IsTerminal, Write};

use crate::output::Cleaned;
use crate::scene::library;
use crate::{SimError, Simulation, scene_file};
use clap::Parser;
use tracing_subscriber::filter::LevelFilter;

use arguments::{
    Arguments, CleanArguments, Command, DEFAULT_SCENE, PlanArguments, RunArguments, meant,
    paragraph,
};
use printer::Printer;

/// Refused input or a failure; also what clap uses for wrong usage.
const REFUSED: u8 = 2;

/// All was written, but some steps did not converge.
const NOT_CONVERGED: u8 = 1;

/// All is well.
const DONE: u8 = 0;

/// Runs the program with these words, its own name first; returns the status that it ends with. Results go to
/// standard output, errors and warnings to standard error.
pub fn run(words: impl IntoIterator<Item = OsString>) -> u8 {
    let words: Vec<OsString> = words.into_iter().collect();
    let arguments = match Arguments::try_parse_from(&words) {
        Ok(arguments) => arguments,
        Err(error) if error.use_stderr() => return refuse(&misused(&error, &words)),
        Err(help) => {
            // Help into a closed pipe is no failure.
            let _ = help.print();
            return DONE;
        }
    };
    // Whoever calls may have one already.
    let _ = tracing_subscriber::fmt()
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .with_max_level(LevelFilter::WARN)
        .with_target(false)
        .without_time()
        .try_init();
    let run = RunArguments { scene: DEFAULT_SCENE.into(), ..RunArguments::default() };
    match execute(arguments.command.unwrap_or(Command::Run(run))) {
        Ok(code) => code,
        Err(error) => refuse(&error.to_string()),
    }
}

/// A usage error, with what was probably meant.
fn misused(error: &clap::Error, words: &[OsString]) -> String {
    let words: Vec<String> =
        words.iter().skip(1).map(|word| word.to_string_lossy().into_owned()).collect();
    match meant(&words) {
        Some(hint) => format!("{}; {hint}", paragraph(error)),
        None => paragraph(error),
    }
}

/// One paragraph on stderr.
fn refuse(message: &str) -> u8 {
    let words: Vec<&str> = message.split_whitespace().collect();
    // A closed or full standard error is no reason to panic.
    let _ = writeln!(std::io::stderr(), "error: {}", words.join(" "));
    REFUSED
}

fn execute(command: Command) -> Result<u8, SimError> {
    let mut out = Printer::default();
    match command {
        Command::Init(arguments) => init::run(&arguments, &mut out)?,
        Command::Run(arguments) => {
            join_pool();
            if !run::run(&arguments, &mut out)? {
                return Ok(NOT_CONVERGED);
            }
        }
        Command::Plan(arguments) => plan(&arguments, &mut out)?,
        Command::Preview(arguments) => preview::run(&arguments, &mut out)?,
        Command::Mesh(arguments) => mesh::run(&arguments, &mut out)?,
        Command::Labels(arguments) => labels::run(&arguments, &mut out)?,
        Command::Surface(arguments) => surface::run(&arguments, &mut out)?,
        Command::Haptic(arguments) => {
            join_pool();
            haptic::run(&arguments, &mut out)?;
        }
        Command::Feel(arguments) => feel::run(&arguments, &mut out)?,
        Command::Identify(arguments) => {
            join_pool();
            if !identify::run(&arguments, &mut out)? {
                return Ok(NOT_CONVERGED);
            }
        }
        #[cfg(feature = "view")]
        Command::View(arguments) => view::run(&arguments, &mut out)?,
        #[cfg(feature = "view")]
        Command::Export(arguments) => export::run(&arguments, &mut out)?,
        Command::Clean(arguments) => clean(&arguments, &mut out)?,
        Command::Scenes => scenes(&mut out)?,
        Command::Materials => out.print(&console::materials(library()))?,
        Command::Devices => devices(&mut out)?,
        Command::Completions(arguments) => completions::run(&arguments, &mut out)?,
        Command::Man(arguments) => man::run(&arguments, &mut out)?,
    }
    Ok(DONE)
}

/// Makes this thread, which steps, one of those that share the work of a step: besides as many of them as there are
/// cores it would wait for one of these.
fn join_pool() {
    // Where the pool is there already, work is shared all the same.
    let _ = rayon::ThreadPoolBuilder::new().use_current_thread().build_global();
}

fn plan(arguments: &PlanArguments, out: &mut Printer) -> Result<(), SimError> {
    let (scene, _) = scene_file::load(&arguments.scene, &arguments.set)?;
    let simulation = Simulation::builder(&scene).build()?;
    if !arguments.json {
        return out.print(&console::plan(simulation.plan()));
    }
    let json = serde_json::to_string_pretty(simulation.plan())
        .map_err(|error| SimError::Io("<stdout>".into(), error.into()))?;
    out.print(&format!("{json}\n"))
}

fn clean(arguments: &CleanArguments, out: &mut Printer) -> Result<(), SimError> {
    let Cleaned { removed, kept } = crate::output::clean(&arguments.folder, arguments.all)?;
    for path in removed {
        out.print(&format!("removed {}\n", path.display()))?;
    }
    for (path, steps) in kept {
        let path = path.display();
        let how = format!("`yawara run --resume {path}` goes on after step {steps}");
        out.print(&format!("kept {path}: {how}, clean --all removes it\n"))?;
    }
    Ok(())
}

fn scenes(out: &mut Printer) -> Result<(), SimError> {
    scene_file::built_in().iter().try_for_each(|(name, text)| {
        let table: toml::Table = toml::from_str(text).unwrap_or_default();
        let description = table.get("description").and_then(toml::Value::as_str);
        out.print(&format!("{name:<11} {}\n", description.unwrap_or_default()))
    })
}

/// The graphics adapters of this machine.
#[cfg(feature = "gpu")]
fn devices(out: &mut Printer) -> Result<(), SimError> {
    (0..)
        .zip(yawara_gpu::adapters()?)
        .try_for_each(|(index, adapter): (usize, _)| out.print(&format!("{index}: {adapter}\n")))
}

#[cfg(not(feature = "gpu"))]
fn devices(_: &mut Printer) -> Result<(), SimError> {
    Err(SimError::FeatureMissing("yawara devices".into(), "gpu"))
}
