//! `yawara-bench STUDY --out DIR`: competitors side by side, times with their errors.
#![forbid(unsafe_code)]

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use yawara_bench::BenchError;
use yawara_bench::studies::{inverse, mesh};

/// Studies that run the implementations of a stage side by side, alternating in one process.
#[derive(Parser)]
#[command(version)]
struct Cli {
    #[command(subcommand)]
    study: Study,
}

#[derive(Subcommand)]
enum Study {
    /// Maintainers of the inverse under random splits and merges of the liver phantom.
    Inverse(inverse::Arguments),
    /// The bisection forest: shapes, closures, cost of a split, volume to label tree.
    Mesh(mesh::Arguments),
}

fn run(study: &Study) -> Result<String, BenchError> {
    match study {
        Study::Inverse(arguments) => inverse::run(arguments),
        Study::Mesh(arguments) => mesh::run(arguments),
    }
}

fn main() -> ExitCode {
    match run(&Cli::parse().study) {
        Ok(report) => {
            print!("{report}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("yawara-bench: {error}");
            ExitCode::from(2)
        }
    }
}
