//! The program `yawara`; all of it is in [`yawara::cli`].
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(yawara::cli::run(std::env::args_os()))
}
