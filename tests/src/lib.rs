//! Property tests, conformance suites, convergence and layering of the workspace.
#![forbid(unsafe_code)]

pub mod clamped_body;
pub mod cuts;
pub mod inverse_suite;
pub mod mixed_body;
pub mod module_graph;
pub mod organ;
pub mod rules;
pub mod stage_suites;
