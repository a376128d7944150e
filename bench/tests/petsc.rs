//! References by PETSc, as they are called: alone, under mpirun, beside the built-in ones, refused.
#![cfg(feature = "petsc")]

mod mpirun;

use std::path::Path;
use std::process::{Command, Output, Stdio};

use mpirun::FLAGS;
use serde_json::Value;

const PROGRAM: &str = env!("CARGO_BIN_EXE_yawara-bench");

fn ended(command: &mut Command) -> Output {
    command.stdin(Stdio::null()).output().expect("the program, or mpirun (openmpi-bin), is there")
}

/// Runs in one process that was started by itself, or in several.
fn run(processes: usize, arguments: &[&str], out: &Path) -> Output {
    let mut command = match processes {
        1 => Command::new(PROGRAM),
        _ => {
            let mut command = Command::new("mpirun");
            command.args(FLAGS).args(["-n", &processes.to_string(), PROGRAM]);
            command
        }
    };
    ended(command.args(arguments).arg("--out").arg(out))
}

fn succeeds(processes: usize, arguments: &[&str], out: &Path) {
    let output = run(processes, arguments, out);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {stderr}", output.status);
    assert!(stderr.is_empty(), "{stderr}");
}

fn json(folder: &Path, study: &str) -> Value {
    let text = std::fs::read_to_string(folder.join(format!("{study}.json"))).unwrap();
    serde_json::from_str(&text).unwrap()
}

fn number(row: &Value, key: &str) -> f64 {
    row[key].as_f64().unwrap_or_else(|| panic!("no number {key:?} in {row}"))
}

#[test]
fn one_process_and_three_find_what_the_built_in_factor_finds() {
    let root = tempfile::tempdir().unwrap();
    let arguments = ["resolution", "--cubes", "8,16,32", "--ratio", "1000"];
    let [alone, shared] = [1, 3].map(|processes| {
        let out = root.path().join(processes.to_string());
        succeeds(processes, &arguments, &out);
        json(&out, "resolution")
    });
    let rows = |report: &Value| report["rows"].as_array().unwrap().clone();
    let (alone, shared) = (rows(&alone), rows(&shared));
    assert_eq!((alone.len(), shared.len()), (6, 6));
    for (one, other) in alone.iter().zip(&shared) {
        assert_eq!((&one["body"], &one["model"]), (&other["body"], &other["model"]));
        assert_eq!((&one["processes"], &other["processes"]), (&1.into(), &3.into()));
        for key in ["work_j", "largest_m"] {
            let (a, b) = (number(one, key), number(other, key));
            assert!(a > 0.0 && (a / b - 1.0).abs() < 1e-10, "{key}: {a} and {b}");
        }
        for row in [one, other] {
            assert!(number(row, "residual") <= number(row, "rounding").max(1e-10), "{row}");
        }
        // The co-rotated body is found by another method where it is small.
        if one["model"] == "linear" || number(one, "unknowns") < 3000.0 {
            let error = number(one, "factor_error");
            assert!(error > 0.0 && error < 1e-9, "{one}");
        }
        if one["model"] == "linear" {
            // Cubes of eight voxels have another stiffness than what is in them.
            assert!(number(one, "start_mesh_error") < -0.05, "{one}");
        }
    }
    let iterations = |size: usize| number(&alone[2 * size], "inner");
    assert!(iterations(2) <= 1.5 * iterations(1), "{} {}", iterations(2), iterations(1));
}

#[test]
fn a_reference_by_petsc_is_the_built_in_one() {
    let root = tempfile::tempdir().unwrap();
    let [own, petsc] = ["built-in", "petsc"].map(|name| {
        let out = root.path().join(name);
        let arguments = ["pareto", "beam", "--quick", "--only", "default", "--reference", name];
        succeeds(1, &arguments, &out);
        let bytes = std::fs::read(out.join("cases/reference.bin")).unwrap();
        let head = bytes.iter().position(|byte| *byte == b'\n').unwrap();
        let numbers = bytes[head + 1..].chunks_exact(8);
        numbers.map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect::<Vec<f64>>()
    });
    assert_eq!(own.len(), petsc.len());
    let off: f64 = own.iter().zip(&petsc).map(|(a, b)| (a - b).powi(2)).sum();
    let size: f64 = own.iter().map(|a| a * a).sum();
    // Not the same bits: another factor has made them.
    assert!(off > 0.0 && (off / size).sqrt() < 1e-8, "{:e}", (off / size).sqrt());
}

#[test]
fn validation_by_petsc_is_compared_with_that_by_the_built_in_factor() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("validate");
    succeeds(1, &["validate", "--quick", "--reference", "petsc"], &out);
    let claims = json(&out, "validate")["claims"].clone();
    let claim = &claims[0];
    assert_eq!(claim["holds"], true, "{claims}");
    let over = number(claim, "value");
    assert!(over > 0.0, "the same factor has made both");
}

#[test]
fn what_makes_no_sense_is_refused() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("study");
    let refused = |processes: usize, arguments: &[&str], words: &str| {
        let output = run(processes, arguments, &out);
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success() && message.contains(words), "{arguments:?}: {message}");
    };
    refused(1, &["resolution", "--cubes", "12"], "--cubes is 12, want a power of two");
    refused(1, &["resolution", "--cubes", "4"], "--cubes is 4, want a power of two from 8 to 512");
    refused(1, &["resolution", "--ratio", "0"], "--ratio");
    refused(1, &["resolution", "--residual", "NaN"], "--residual");
    refused(1, &["resolution", "--liver-mm", "0"], "--liver-mm");
    assert!(!out.exists());
    refused(2, &["validate", "--quick", "--reference", "petsc"], "without mpirun");
}
