//! Studies under mpirun, as they are called: shared, stopped, killed, refused.
#![cfg(feature = "mpi")]

mod mpirun;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use mpirun::FLAGS;
use serde_json::Value;

/// Steps of a small beam, all quick candidates, long enough for a signal to come while they run;
/// stopped processes have time enough.
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
    "time.steps=80",
    "--set",
    "time.step_s=0.025",
    "--cap-s",
    "600",
];

/// Not every launcher ends the others when one process fails: with these mpirun does not.
const NO_HELP: &[&str] = &["--mca", "orte_abort_on_non_zero_status", "0"];

const PROGRAM: &str = env!("CARGO_BIN_EXE_yawara-bench");

/// What takes longer hangs.
const LIMIT: Duration = Duration::from_secs(300);

fn piped(command: &mut Command) -> Child {
    let command = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().expect("mpirun (openmpi-bin) is on the PATH")
}

/// Starts a study of `processes` that share `out`.
fn mpirun(processes: usize, arguments: &[&str], out: &Path) -> Child {
    mpirun_with(&["-n", &processes.to_string()], arguments, out)
}

fn mpirun_with(flags: &[&str], arguments: &[&str], out: &Path) -> Child {
    let mut command = Command::new("mpirun");
    command.args(FLAGS).args(flags).arg(PROGRAM).args(arguments);
    piped(command.arg("--out").arg(out))
}

/// Waits until it is true, or the processes have ended.
fn wait_for(child: &mut Child, is_true: impl Fn() -> bool) {
    let begin = Instant::now();
    while !is_true() && child.try_wait().unwrap().is_none() {
        if begin.elapsed() > LIMIT {
            let _ = child.kill();
            panic!("nothing has happened in {LIMIT:?}");
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Its end, which comes in time; with what was printed.
fn end(mut child: Child) -> (Output, String) {
    wait_for(&mut child, || false);
    let output = child.wait_with_output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    (output, stderr)
}

fn succeeds(child: Child) -> String {
    let (output, stderr) = end(child);
    assert!(output.status.success(), "{}: {stderr}", output.status);
    assert!(stderr.is_empty(), "{stderr}");
    String::from_utf8(output.stdout).unwrap()
}

fn alone(out: &Path) -> String {
    succeeds(piped(Command::new(PROGRAM).args(SMALL).arg("--out").arg(out)))
}

/// A run of one process, for all tests to look at.
fn whole() -> &'static Path {
    static WHOLE: OnceLock<(tempfile::TempDir, PathBuf)> = OnceLock::new();
    let (_, path) = WHOLE.get_or_init(|| {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("whole");
        alone(&path);
        (root, path)
    });
    path
}

/// The merged result without times and without what follows from them.
fn table(folder: &Path) -> String {
    let text = std::fs::read_to_string(folder.join("pareto.json")).unwrap();
    let mut value: Value = serde_json::from_str(&text).unwrap();
    for key in ["machine", "front", "front_force"] {
        value.as_object_mut().unwrap().remove(key).unwrap();
    }
    value["reference"]["total_s"].take();
    for row in value["rows"].as_array_mut().unwrap() {
        row["measured"].take();
    }
    value.to_string()
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

/// Sends a signal to the process of that rank that works in `folder`.
fn signal(name: &str, rank: usize, folder: &Path) {
    let wanted = format!("OMPI_COMM_WORLD_RANK={rank}");
    let has = |path: PathBuf, text: &str| {
        let bytes = std::fs::read(path).unwrap_or_default();
        bytes.split(|&byte| byte == 0).any(|part| part == text.as_bytes())
    };
    let is_wanted = |process: &PathBuf| {
        has(process.join("environ"), &wanted)
            && has(process.join("cmdline"), PROGRAM)
            && has(process.join("cmdline"), folder.to_str().unwrap())
    };
    let processes = std::fs::read_dir("/proc").unwrap().flatten().map(|entry| entry.path());
    let found: Vec<PathBuf> = processes.filter(is_wanted).collect();
    assert_eq!(found.len(), 1, "rank {rank}: {found:?}");
    let id = found[0].file_name().unwrap();
    let status = Command::new("kill").arg(format!("-{name}")).arg(id).status();
    assert!(status.unwrap().success());
}

#[test]
fn processes_of_mpirun_make_the_table_of_one() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("study");
    let printed = succeeds(mpirun(2, SMALL, &folder));
    assert_eq!(printed.matches("# beam: error against time").count(), 1, "{printed}");
    assert_eq!(table(&folder), table(whole()));
    for name in ["pareto.csv", "pareto.md", "pareto.svg", "pareto.png", "report.html"] {
        assert!(folder.join(name).exists(), "{name}");
    }
    let before = cases(&folder);
    assert_eq!(before.keys().collect::<Vec<_>>(), cases(whole()).keys().collect::<Vec<_>>());
    assert_eq!(succeeds(mpirun(3, SMALL, &folder)).matches("# beam").count(), 1);
    assert_eq!(cases(&folder), before, "finished cases are not run again");
    let anew = [SMALL, &["--force", "--only", "default"]].concat();
    succeeds(mpirun(1, &anew, &folder));
    assert_eq!(cases(&folder).len(), 1);
}

#[test]
fn whoever_is_free_takes_the_next_case() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("study");
    let all = cases(whole()).len();
    let done = || cases(&folder).len();
    let mut child = mpirun(2, SMALL, &folder);
    wait_for(&mut child, || done() >= 1);
    // The first gives out nothing meanwhile: the other finishes what it has. Between two cases it
    // has none, but not every time.
    let others_own = (0..10).any(|_| {
        signal("STOP", 0, &folder);
        let (before, begin) = (done(), Instant::now());
        wait_for(&mut child, || done() > before || begin.elapsed() > Duration::from_secs(5));
        let more = done() > before;
        signal("CONT", 0, &folder);
        more
    });
    assert!(others_own, "rank 1 runs no case");
    signal("STOP", 1, &folder);
    assert!(done() + 2 < all, "too few cases left to tell");
    wait_for(&mut child, || done() + 1 >= all);
    std::thread::sleep(Duration::from_millis(100));
    assert!(child.try_wait().unwrap().is_none() && !folder.join("pareto.json").exists());
    signal("CONT", 1, &folder);
    succeeds(child);
    assert_eq!(table(&folder), table(whole()));
}

#[test]
fn a_killed_process_ends_the_run_and_no_finished_case_is_lost() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("study");
    let mut kept = BTreeMap::new();
    for rank in [1, 0] {
        let mut child = mpirun(2, SMALL, &folder);
        let enough = kept.len() + 2;
        wait_for(&mut child, || cases(&folder).len() >= enough);
        signal("KILL", rank, &folder);
        let (output, stderr) = end(child);
        assert!(!output.status.success(), "{rank}: {stderr}");
        assert!(!folder.join("pareto.json").exists());
        let now = cases(&folder);
        assert!(kept.iter().all(|(name, bytes)| now.get(name) == Some(bytes)));
        kept = now;
    }
    alone(&folder);
    let after = cases(&folder);
    assert!(kept.iter().all(|(name, bytes)| after.get(name) == Some(bytes)));
    assert_eq!(table(&folder), table(whole()));
}

#[test]
fn an_error_of_one_process_ends_all() {
    let root = tempfile::tempdir().unwrap();
    let refused = |child: Child, words: &[&str]| {
        let (output, stderr) = end(child);
        assert_eq!(output.status.code(), Some(2), "{stderr}");
        assert!(words.iter().all(|word| stderr.contains(word)), "{words:?}: {stderr}");
        assert!(output.stdout.is_empty());
    };
    let folder = root.path().join("study");
    let first = [SMALL, &["--out", folder.to_str().unwrap()]].concat();
    let other = [&[":", "-n", "1", PROGRAM], SMALL, &["--set", "time.steps=2"]].concat();
    let flags = [NO_HELP, &["-n", "1"]].concat();
    let child = mpirun_with(&flags, &[first, other].concat(), &folder);
    refused(child, &["rank 1: ", "options.json", "time.steps = 80"]);
    assert!(!folder.join("pareto.json").exists());
    let notes = root.path().join("notes");
    std::fs::create_dir(&notes).unwrap();
    std::fs::write(notes.join("notes.txt"), "x").unwrap();
    let flags = [NO_HELP, &["-n", "2"]].concat();
    refused(mpirun_with(&flags, SMALL, &notes), &["rank 0: ", "notes is not empty"]);
    let none = root.path().join("none");
    refused(mpirun(2, &["drift", "--quick"], &none), &["2 processes", "without mpirun"]);
    refused(mpirun(2, &["pareto", "baem"], &none), &["\"baem\" is neither"]);
    assert!(!none.exists());
}

/// As a cluster's scheduler starts them, with a task that is killed and started again.
#[test]
fn tasks_of_an_array_job_share_a_folder() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("array");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("sweep.slurm");
    let task = |number: &str| {
        let mut command = Command::new("bash");
        command.arg(&script).args(SMALL).arg("--out").arg(&out).env("YAWARA_BENCH", PROGRAM);
        command.env("SLURM_ARRAY_TASK_ID", number).env("SLURM_ARRAY_TASK_MAX", "2");
        piped(&mut command)
    };
    let (mut first, second) = (task("1"), task("2"));
    wait_for(&mut first, || !cases(&out).is_empty());
    first.kill().unwrap();
    first.wait().unwrap();
    succeeds(second);
    assert!(!out.join("pareto.json").exists());
    succeeds(task("1"));
    assert_eq!(table(&out), table(whole()));
}
