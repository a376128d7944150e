//! The program as it is called: studies write what they say, and nonsense is refused.

use std::path::Path;
use std::process::{Command, Output};

fn yawara_bench(arguments: &[&str], out: &Path) -> Output {
    let program = env!("CARGO_BIN_EXE_yawara-bench");
    Command::new(program).args(arguments).arg("--out").arg(out).output().expect("the program runs")
}

/// A refusal: exit code 2, one paragraph that names `what`, nothing written.
fn refused(arguments: &[&str], what: &str) {
    let root = tempfile::tempdir().unwrap();
    let output = yawara_bench(arguments, &root.path().join("study"));
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
    assert_eq!(message.trim_end().lines().count(), 1, "{message}");
    assert!(message.starts_with("yawara-bench: ") && message.contains(what), "{message}");
    assert!(output.stdout.is_empty());
    assert!(std::fs::read_dir(root.path()).unwrap().next().is_none(), "{arguments:?}");
}

#[test]
fn bad_arguments_are_refused_in_one_paragraph() {
    refused(&["table1", "--vertices", "512,many"], "many");
    refused(&["table1", "--vertices", "0"], "--vertices is 0, want 8 to 32768");
    refused(&["table1", "--quick", "--vertices", "20"], "20 free vertices are fewer than");
    refused(&["table1", "--cap-s", "0"], "--cap-s is 0");
    refused(&["table1", "--memory-gb", "0"], "--memory-gb is 0");
    refused(&["scaling", "--pairs", "1"], "--pairs is 1, want 5 to 1000000");
    refused(&["drift", "--updates", "0"], "--updates is 0");
    refused(&["drift", "--vertices", "40000"], "--vertices is 40000");
    refused(&["drift", "--seed=-1"], "--seed");
    refused(&["inverse"], "inverse");
    if cfg!(not(feature = "petsc")) {
        refused(&["resolution"], "--features petsc");
        refused(&["validate", "--reference", "petsc"], "--features petsc");
        refused(&["pareto", "beam", "--quick", "--reference", "petsc"], "--features petsc");
    }
    refused(&["drift", "--quik"], "--quick");
}

/// One of several processes of a launcher that would all do the same.
#[test]
fn processes_that_can_not_share_a_study_are_refused() {
    let root = tempfile::tempdir().unwrap();
    let refused = |launcher: &str, study: &str, words: &[&str]| {
        let out = root.path().join("study");
        let mut command = Command::new(env!("CARGO_BIN_EXE_yawara-bench"));
        let output =
            command.env(launcher, "3").args([study, "--quick", "--out"]).arg(&out).output();
        let output = output.unwrap();
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{study}: {message}");
        assert_eq!(message.trim_end().lines().count(), 1, "{message}");
        assert!(words.iter().all(|word| message.contains(word)), "{words:?}: {message}");
        assert!(!out.exists());
    };
    for launcher in ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE"] {
        refused(launcher, "drift", &["3 processes", "without mpirun", "`pareto`"]);
        if cfg!(not(feature = "mpi")) {
            for study in ["pareto", "stiff", "extremes", "robust", "ablation"] {
                refused(launcher, study, &["3 processes", "--features mpi", "--shard"]);
            }
        }
    }
}

#[test]
fn a_directory_in_use_is_refused_unless_forced() {
    let root = tempfile::tempdir().unwrap();
    std::fs::write(root.path().join("notes.txt"), "x").unwrap();
    let drift = ["drift", "--quick", "--vertices", "160", "--updates", "3"];
    let output = yawara_bench(&drift, root.path());
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8(output.stderr).unwrap().contains("--force"));
    let output = yawara_bench(&[&drift[..], &["--force"]].concat(), root.path());
    assert!(output.status.success());
    // No bar in a pipe.
    assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(root.path().join("drift.json").exists() && root.path().join("notes.txt").exists());
}

/// Every figure of a JSON file is a number, and there are some.
fn check_json(path: &Path) -> serde_json::Value {
    let text = std::fs::read_to_string(path).unwrap();
    assert!(!text.contains("null"), "{text}");
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert!(value["machine"]["memcpy_gb_s"].as_f64().unwrap() > 0.0);
    assert!(!value["rows"].as_array().unwrap().is_empty());
    value
}

#[test]
fn the_quick_studies_run_as_documented() {
    for study in ["table1", "scaling", "drift"] {
        let root = tempfile::tempdir().unwrap();
        let out = root.path().join("study");
        let output = yawara_bench(&[study, "--quick"], &out);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{study}: {message}");
        assert!(message.is_empty(), "{study}: {message}");
        let printed = String::from_utf8(output.stdout).unwrap();
        assert!(!printed.contains("NaN") && !printed.contains("inf "), "{printed}");
        let table = std::fs::read_to_string(out.join(format!("{study}.md"))).unwrap();
        assert_eq!(printed, table);
        let value = check_json(&out.join(format!("{study}.json")));
        let errors = if study == "drift" { "error" } else { "error_vs_lu" };
        for row in value["rows"].as_array().unwrap() {
            assert!(row[errors].as_f64().unwrap() < 1e-6, "{study}: {row}");
            if row["method"] == "sparse" {
                assert!(row[errors].as_f64().unwrap() < 1e-10, "{study}: {row}");
            }
        }
        let summary = if study == "drift" { "claims" } else { "ratios" };
        assert!(!value[summary].as_array().unwrap().is_empty(), "{study}");
        assert!(out.join(format!("{study}.csv")).exists());
    }
}
