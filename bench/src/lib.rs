//! Benches and error-versus-run-time studies.
#![forbid(unsafe_code)]
