//! The command line.
#![forbid(unsafe_code)]

mod cli;
mod devices_command;
mod haptic_command;
mod labels_command;
mod mesh_command;
mod printer;
mod run_command;
mod surface_command;
mod text;

use std::io::IsTerminal;
use std::io::Write;
use std::process::ExitCode;

use clap::Parser;
use tracing_subscriber::filter::LevelFilter;
use yawara::scene_file;
use yawara::{SimError, Simulation, Stages};

use cli::{Arguments, Command, PlanArguments, RunArguments};
use printer::Printer;

/// Refused input or a failure; also what clap uses for wrong usage.
const REFUSED: u8 = 2;

/// All was written, but some steps did not converge.
const NOT_CONVERGED: u8 = 1;

fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) if error.use_stderr() => return refuse(&cli::paragraph(&error)),
        Err(help) => {
            // Help into a closed pipe is no failure.
            let _ = help.print();
            return ExitCode::SUCCESS;
        }
    };
    tracing_subscriber::fmt()
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .with_max_level(LevelFilter::WARN)
        .with_target(false)
        .without_time()
        .init();
    match execute(arguments.command.unwrap_or(Command::Run(RunArguments::default()))) {
        Ok(code) => code,
        Err(error) => refuse(&error.to_string()),
    }
}

/// One paragraph on stderr.
fn refuse(message: &str) -> ExitCode {
    let words: Vec<&str> = message.split_whitespace().collect();
    // A closed or full standard error is no reason to panic.
    let _ = writeln!(std::io::stderr(), "error: {}", words.join(" "));
    ExitCode::from(REFUSED)
}

fn execute(command: Command) -> Result<ExitCode, SimError> {
    let mut out = Printer::default();
    match command {
        Command::Run(arguments) => {
            if !run_command::run(&arguments, &mut out)? {
                return Ok(ExitCode::from(NOT_CONVERGED));
            }
        }
        Command::Plan(arguments) => plan(&arguments, &mut out)?,
        Command::Mesh(arguments) => mesh_command::run(&arguments, &mut out)?,
        Command::Labels(arguments) => labels_command::run(&arguments, &mut out)?,
        Command::Surface(arguments) => surface_command::run(&arguments, &mut out)?,
        Command::Haptic(arguments) => haptic_command::run(&arguments, &mut out)?,
        Command::Scenes => scenes(&mut out)?,
        Command::Devices => devices_command::run(&mut out)?,
    }
    Ok(ExitCode::SUCCESS)
}

fn plan(arguments: &PlanArguments, out: &mut Printer) -> Result<(), SimError> {
    let (scene, _) = scene_file::load(&arguments.scene, &arguments.set)?;
    let simulation = Simulation::new(&scene, Stages::by_name(&scene.stages)?)?;
    if !arguments.json {
        return out.print(&text::plan(simulation.plan()));
    }
    let json = serde_json::to_string_pretty(simulation.plan())
        .map_err(|error| SimError::Io { path: "<stdout>".into(), source: error.into() })?;
    out.print(&format!("{json}\n"))
}

fn scenes(out: &mut Printer) -> Result<(), SimError> {
    scene_file::built_in().iter().try_for_each(|(name, text)| {
        let table: toml::Table = toml::from_str(text).unwrap_or_default();
        let description = table.get("description").and_then(toml::Value::as_str);
        out.print(&format!("{name:<11} {}\n", description.unwrap_or_default()))
    })
}
