//! `yawara completions`: what a shell may complete, from the arguments themselves.

use crate::SimError;
use clap::CommandFactory;

use super::arguments::{Arguments, CompletionsArguments};
use super::printer::Printer;

pub fn run(arguments: &CompletionsArguments, out: &mut Printer) -> Result<(), SimError> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut Arguments::command(), "yawara", &mut script);
    out.print(&String::from_utf8_lossy(&script))
}
