//! What is asked for on the command line.

use clap::Args;

use crate::harness::Common;

/// What is solved, and how well.
#[derive(Args, Clone, Debug)]
pub struct Arguments {
    #[command(flatten)]
    pub(super) common: Common,
    /// Voxels along unit cubes with a stiff ball, powers of two, comma-separated; quick: 8,16,32.
    #[arg(long, value_delimiter = ',', value_name = "N", default_value = "16,32,64")]
    pub(super) cubes: Vec<usize>,
    /// How many times as stiff the ball is as what is around it.
    #[arg(long, value_name = "RATIO", default_value_t = 1e6)]
    pub(super) ratio: f64,
    /// Voxels of the liver phantom, mm, comma-separated; without it no liver is solved.
    #[arg(long, value_delimiter = ',', value_name = "MM")]
    pub(super) liver_mm: Vec<f64>,
    /// Residual over load at which a body counts as at rest.
    #[arg(long, value_name = "R", default_value_t = 1e-10)]
    pub(super) residual: f64,
}
