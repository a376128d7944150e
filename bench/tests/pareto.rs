//! The study `pareto` as it is called: interrupted, shared among processes, compared, shown.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use serde_json::Value;

/// A few steps of a small beam, all quick candidates.
const SMALL: &[&str] = &[
    "pareto",
    "beam",
    "--quick",
    "--reference-vertices",
    "500",
    "--set",
    "mesh.max_level=3",
    "--set",
    "mesh.max_vertices=200",
    "--set",
    "time.steps=3",
    "--combination",
    "row & p1p1: stages.corotation=row, stages.element=p1p1",
];

fn command(arguments: &[&str], out: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_yawara-bench"));
    command.args(arguments).arg("--out").arg(out).stdin(Stdio::null());
    command
}

fn succeed(arguments: &[&str], out: &Path) -> String {
    let output = command(arguments, out).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {stderr}");
    String::from_utf8(output.stdout).unwrap()
}

/// A whole run, for all tests to look at.
fn whole() -> &'static Path {
    static WHOLE: OnceLock<(tempfile::TempDir, PathBuf)> = OnceLock::new();
    let (_, path) = WHOLE.get_or_init(|| {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("whole");
        succeed(SMALL, &path);
        (root, path)
    });
    path
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// Names and figures of all rows: all that is not measured.
fn figures(folder: &Path) -> Vec<(Value, Value, Value)> {
    let value = json(&folder.join("pareto.json"));
    let rows = value["rows"].as_array().unwrap();
    rows.iter()
        .map(|row| (row["case"].clone(), row["figures"].clone(), row["failure"].clone()))
        .collect()
}

/// Finished cases, by name, with their bytes.
fn cases(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let Ok(entries) = std::fs::read_dir(folder.join("cases")) else { return BTreeMap::new() };
    let files = entries.flatten().map(|entry| entry.path());
    let files = files.filter(|path| path.extension().is_some_and(|end| end == "json"));
    files
        .map(|path| {
            (path.file_name().unwrap().to_string_lossy().into(), std::fs::read(&path).unwrap())
        })
        .collect()
}

/// Waits until so many cases are finished, or the process has ended.
fn wait_for_cases(child: &mut Child, folder: &Path, count: usize) {
    let begin = Instant::now();
    while cases(folder).len() < count && child.try_wait().unwrap().is_none() {
        assert!(begin.elapsed() < Duration::from_secs(300), "no case in five minutes");
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn a_whole_run_has_every_file_and_every_candidate() {
    let folder = whole();
    for name in ["csv", "json", "md", "svg", "png"] {
        let bytes = std::fs::read(folder.join(format!("pareto.{name}"))).unwrap();
        assert!(!bytes.is_empty(), "{name}");
    }
    assert!(std::fs::read(folder.join("pareto.png")).unwrap().starts_with(b"\x89PNG"));
    let value = json(&folder.join("pareto.json"));
    let rows = value["rows"].as_array().unwrap();
    let row = |name: &str| rows.iter().find(|row| row["case"] == name).unwrap();
    let error = |name: &str| row(name)["figures"]["error_displacement"].as_f64().unwrap();
    // The reference has level 3: its own level is as near as the residuals are.
    assert!(error("uniform level 0") > 1e-2);
    assert!(error("default") < error("uniform level 0"));
    assert_eq!(row("default")["figures"]["converged"], 3);
    assert!((error("default") - error("equilibrium newton")).abs() < 1e-4);
    assert!((error("default") - error("inverse in f32")).abs() < 1e-4);
    assert!(rows.iter().any(|row| row["case"] == "the paper's literal combination"));
    assert!(rows.iter().any(|row| row["group"] == "named"));
    assert!(!value["front"].as_array().unwrap().is_empty());
    assert!(value["reference"]["residual_max"].as_f64().unwrap() <= 1e-10);
    let left_out = value["left_out"].as_array().unwrap();
    assert!(left_out.iter().any(|row| row["stage"] == "homogenisation"));
}

#[test]
fn an_interrupt_at_any_point_loses_no_finished_case() {
    for (signal, count) in [("KILL", 2), ("INT", 5)] {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("study");
        let mut child = command(SMALL, &folder).stdout(Stdio::null()).spawn().unwrap();
        wait_for_cases(&mut child, &folder, count);
        let id = child.id().to_string();
        let mut kill = Command::new("kill");
        // A process that has ended before can't be killed, nor has it lost anything.
        let _ = kill.args([&format!("-{signal}"), &id]).stderr(Stdio::null()).status();
        let status = child.wait().unwrap();
        let before = cases(&folder);
        assert!(before.len() >= count, "{signal}: {} cases, {status}", before.len());
        for (name, bytes) in &before {
            let row: Value = serde_json::from_slice(bytes).unwrap();
            assert!(row["case"].is_string(), "{name}");
        }
        succeed(SMALL, &folder);
        let after = cases(&folder);
        for (name, bytes) in &before {
            assert_eq!(after.get(name), Some(bytes), "{signal}: {name} was made again");
        }
        assert_eq!(figures(&folder), figures(whole()), "{signal}");
        let left = std::fs::read_dir(folder.join("cases")).unwrap().flatten();
        let partial = left.filter(|entry| entry.path().extension().is_some_and(|e| e == "partial"));
        assert_eq!(partial.count(), 0);
    }
}

#[test]
fn processes_that_share_a_folder_make_the_table_of_one() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("study");
    let shard = |part: &str| succeed(&[SMALL, &["--shard", part]].concat(), &folder);
    let printed = shard("2/3");
    assert!(printed.contains("cases are done"), "{printed}");
    assert!(!folder.join("pareto.json").exists());
    let mut child = command(&[SMALL, &["--shard", "3/3"]].concat(), &folder)
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    shard("1/3");
    assert!(child.wait().unwrap().success());
    // Whoever was last has written the tables; if both ended at once, a run without parts does.
    succeed(SMALL, &folder);
    assert_eq!(figures(&folder), figures(whole()));
}

#[test]
fn other_options_and_bad_ones_are_refused() {
    let refused = |arguments: &[&str], out: &Path, words: &[&str]| {
        let Output { status, stderr, .. } = command(arguments, out).output().unwrap();
        let message = String::from_utf8(stderr).unwrap();
        assert_eq!(status.code(), Some(2), "{arguments:?}: {message}");
        assert_eq!(message.trim_end().lines().count(), 1, "{message}");
        assert!(words.iter().all(|word| message.contains(word)), "{words:?}: {message}");
    };
    let other = [SMALL, &["--set", "time.steps=2"]].concat();
    refused(&other, whole(), &["options.json", "scene.time.steps = 3", "2", "--force"]);
    let root = tempfile::tempdir().unwrap();
    let none = root.path().join("none");
    refused(&["pareto", "baem"], &none, &["\"baem\" is neither a built-in scene"]);
    refused(&["pareto", "beam", "--shard", "3/2"], &none, &["3/2"]);
    refused(&["pareto", "beam", "--cap-s", "0"], &none, &["--cap-s is 0"]);
    let bad = ["pareto", "beam", "--combination", "mine: stages.corotation=colum"];
    refused(&bad, &none, &["stages.corotation is \"colum\""]);
    refused(&["pareto", "beam", "--combination", "mine"], &none, &["NAME: KEY=VALUE"]);
    assert!(!none.exists());
}

#[test]
fn a_result_that_got_worse_ends_with_exit_code_1() {
    let compare = |a: &Path, b: &Path, more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_yawara-bench"));
        let output = command.arg("compare").args([a, b]).args(more).output().unwrap();
        (output.status.code(), String::from_utf8_lossy(&output.stdout).into_owned())
    };
    let root = tempfile::tempdir().unwrap();
    let worse = root.path().join("worse.json");
    let mut value = json(&whole().join("pareto.json"));
    let error = &mut value["rows"][0]["figures"]["error_force"];
    *error = (error.as_f64().unwrap() * 1.5).into();
    value["rows"][0]["measured"]["step_p50_ms"] = 1e9.into();
    std::fs::write(&worse, value.to_string()).unwrap();
    let (code, printed) = compare(whole(), whole(), &["--tolerance", "0"]);
    assert_eq!(code, Some(0), "{printed}");
    let (code, printed) = compare(whole(), &worse, &[]);
    assert_eq!(code, Some(1), "{printed}");
    assert!(printed.contains("figures.error_force") && printed.contains("1 worse"), "{printed}");
    assert_eq!(compare(whole(), &worse, &["--tolerance", "0.6"]).0, Some(0));
    assert_eq!(compare(&worse, whole(), &[]).0, Some(0), "better is not worse");
    assert_eq!(compare(whole(), root.path(), &["--tolerance", "-1"]).0, Some(2));
    assert_eq!(compare(whole(), &root.path().join("none"), &[]).0, Some(2));
}

/// The first headless browser on the PATH.
fn browser() -> Option<&'static str> {
    ["chromium", "chromium-browser", "google-chrome"].into_iter().find(|name| {
        let found = Command::new(name).arg("--version").stdout(Stdio::null()).status();
        found.is_ok_and(|status| status.success())
    })
}

#[test]
fn the_report_opens_in_a_browser_without_an_error_and_its_table_sorts() {
    let page = std::fs::read_to_string(whole().join("report.html")).unwrap();
    for outside in ["http://", "https://", "src=", "@import", "url("] {
        let page = page.replace("http://www.w3.org/2000/svg", "");
        assert!(!page.contains(outside), "the report asks for {outside}");
    }
    let Some(browser) = browser() else {
        assert!(std::env::var_os("REQUIRE_BROWSER").is_none(), "no chromium on the PATH");
        println!("SKIP: no chromium on the PATH to open the report in");
        return;
    };
    let profile = tempfile::tempdir().unwrap();
    let error_column = 7;
    let output = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr"])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg("--dump-dom")
        .arg(format!("file://{}#sort={error_column}", whole().join("report.html").display()))
        .output()
        .unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{stderr}");
    assert!(!stderr.contains("CONSOLE"), "{stderr}");
    let page = String::from_utf8(output.stdout).unwrap();
    let rows = figures(whole()).len();
    assert!(page.contains(&format!("data-ready=\"{rows}\"")), "the script ran to its end");
    let errors: Vec<f64> = page
        .split("<tr")
        .filter_map(|row| {
            let cell = row.split("<td").nth(error_column + 1)?;
            cell.split("data-value=\"").nth(1)?.split('"').next()?.parse().ok()
        })
        .collect();
    assert!(errors.len() > 5 && errors.is_sorted(), "{errors:?}");
}
