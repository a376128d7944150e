//! Runs that were interrupted go on from their last checkpoint, to the same bytes.
#![cfg(all(feature = "nifti", feature = "vtu"))]

use crate::workbench;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use sha2::{Digest, Sha256};
use workbench::{BAR, Nifti, Workbench};
use yawara::output::{Interrupted, ResumeError, RunDirectory};
use yawara::report::{StageTimes, StepReport};
use yawara::scene::Scene;
use yawara::{Checkpoint, SimError, Simulation, scene_file};

/// A scene, its settings, and the numbers of frames after which its run is killed.
struct Case {
    scene: &'static str,
    set: &'static [&'static str],
    killed_after: &'static [usize],
}

/// Splits, then merges when the grab lets go.
const REFINED: Case = Case {
    scene: "liver",
    set: &[
        "mesh.max_level=4",
        "tools.0.release_s=0.5",
        "output.checkpoint_steps=7",
        "output.frames_every=1",
    ],
    killed_after: &[8, 16],
};

const CONTACT: Case = Case {
    scene: "palpate",
    set: &[
        "time={ steps=42, step_s=0.01 }",
        "output.checkpoint_steps=11",
        "output.frames_every=2",
        "output.surfaces=[{ label=4 }]",
    ],
    killed_after: &[24],
};

const DYNAMIC: Case = Case {
    scene: "drop",
    set: &[
        "materials.0.law={ kind='prony', terms=[{ fraction=0.3, time_s=0.1 }] }",
        "mesh.max_level=4",
        "time.steps=30",
        "output.checkpoint_steps=8",
        "output.frames_every=1",
    ],
    killed_after: &[9],
};

/// A grab, one that comes when it has gone, and a ball later still.
const TWO_TOOLS: Case = Case {
    scene: "beam",
    set: &[
        "tools=[\
         { kind='grab', region={ shape='sphere', centre=[0.9, 0.5, 0.5], radius_m=0.02 }, release_s=0.2, \
           path=[{ time_s=0.0 }, { time_s=0.2, move_m=[0.0, 0.0, 0.01] }] }, \
         { kind='grab', region={ shape='sphere', centre=[0.6, 0.5, 0.5], radius_m=0.02 }, begin_s=0.24, \
           path=[{ time_s=0.24 }, { time_s=0.6, move_m=[0.0, 0.006, 0.0] }] }, \
         { kind='probe', centre=[0.5, 0.5, 1.6], radius_m=0.01, begin_s=0.4, \
           path=[{ time_s=0.4 }, { time_s=0.6, move_m=[0.0, 0.0, -0.025] }] }]",
        "mesh.max_level=4",
        "time={ steps=30, step_s=0.02 }",
        "output.checkpoint_steps=9",
        "output.frames_every=1",
    ],
    killed_after: &[10],
};

/// Tetrahedra from a file, of a material that remembers.
const MESH_FILE: Case = Case {
    scene: "file.toml",
    set: &["output.checkpoint_steps=8", "output.frames_every=1"],
    killed_after: &[10],
};

impl Case {
    fn settings(&self) -> Vec<String> {
        self.set.iter().map(|one| (*one).into()).collect()
    }

    /// Its scene, after `bench` has what that reads.
    fn scene(&self, bench: &Workbench) -> Scene {
        if self.scene.ends_with(".toml") {
            let mesh = bench.path("mesh.vtu");
            if !mesh.exists() {
                bench.succeed(&["mesh", "phantom", "--base-mm", "24", "--out", "mesh.vtu"]);
                bench.write(self.scene, on_file(&mesh));
            }
            let file = bench.path(self.scene);
            return scene_file::load(file.to_str().unwrap(), &self.settings()).unwrap().0;
        }
        scene_file::load(self.scene, &self.settings()).unwrap().0
    }
}

fn on_file(mesh: &Path) -> String {
    let material = "[[materials]]\nlabel = N\nyoung_modulus_pa = 5e3\npoisson_ratio = 0.3\n\
        law = { kind = 'prony', terms = [{ fraction = 0.4, time_s = 0.1 }] }\n";
    let materials: String = (0..=4).map(|n| material.replace('N', &n.to_string())).collect();
    format!(
        "name = 'file'\n[mesh]\npath = {mesh:?}\n{materials}\
         [[fixed]]\nshape = 'box'\nmin = [0.55, 0.0, 0.0]\nmax = [1.0, 0.35, 1.0]\n\
         [[tools]]\nkind = 'grab'\nregion = {{ shape = 'sphere', centre = [0.1, 0.7, 0.7], radius_m = 0.02 }}\n\
         path = [{{ time_s = 0.0 }}, {{ time_s = 0.3, move_m = [0.0, 0.02, 0.0] }}]\n\
         [time]\nsteps = 30\nstep_s = 0.02\n"
    )
}

/// All of a step but its times.
fn told(report: StepReport) -> String {
    format!("{:?}", StepReport { times: StageTimes::default(), ..report })
}

/// Steps and the frame at the end, from where the simulation is, and its checkpoints.
fn rest(simulation: &mut Simulation, every: usize) -> (Vec<String>, Vec<Checkpoint>) {
    let (mut all, mut kept) = (Vec::new(), Vec::new());
    while simulation.steps_left() > 0 {
        let report = simulation.step().unwrap();
        let step = report.step;
        all.push(told(report));
        if step.is_multiple_of(every) && simulation.steps_left() > 0 {
            kept.push(simulation.checkpoint().unwrap());
        }
    }
    all.push(format!("{:?}", simulation.frame().unwrap()));
    (all, kept)
}

/// Without checkpoints the steps are the same but for what a solver leaves: nothing that a step follows from is lost.
fn is_as_without(case: &Case) {
    let bench = Workbench::new();
    let scene = case.scene(&bench);
    let mut plain = scene.clone();
    plain.output.checkpoint_steps = 0;
    let reports = |scene: &Scene| -> Vec<StepReport> {
        let mut simulation = Simulation::builder(scene).build().unwrap();
        let every = scene.output.checkpoint_steps;
        let mut all = Vec::new();
        while simulation.steps_left() > 0 {
            all.push(simulation.step().unwrap());
            if every > 0 && all.len().is_multiple_of(every) {
                simulation.checkpoint().unwrap();
            }
        }
        all
    };
    let [with, without] = [&scene, &plain].map(reports);
    let forces = |report: &StepReport| -> Vec<f64> {
        report.tools.iter().flat_map(|tool| tool.force_n).collect()
    };
    let most = without.iter().flat_map(forces).fold(0.0, |most: f64, force| most.max(force.abs()));
    let mut worst = 0.0_f64;
    for (with, without) in with.iter().zip(&without) {
        let counts = |report: &StepReport| (report.vertices, report.splits, report.merges);
        assert_eq!(counts(with), counts(without), "step {}", with.step);
        let pairs = forces(with).into_iter().zip(forces(without));
        worst =
            pairs.fold(worst, |worst, (with, without)| worst.max((with - without).abs() / most));
    }
    println!("{}: forces differ by {worst:e} of {most} N", case.scene);
    // Each has solved to its relative residual.
    assert!(worst < 10.0 * scene.solver.residual, "{worst:e} of {most} N");
}

/// A simulation that resumes any checkpoint of another one makes the rest of its steps to the last bit.
fn goes_on(case: &Case) -> Vec<String> {
    let bench = Workbench::new();
    let scene = case.scene(&bench);
    let every = scene.output.checkpoint_steps;
    let mut whole = Simulation::builder(&scene).build().unwrap();
    let (want, checkpoints) = rest(&mut whole, every);
    assert!(checkpoints.len() > 1);
    for checkpoint in &checkpoints {
        let done = checkpoint.steps();
        let mut resumed = Simulation::builder(&scene).build().unwrap();
        resumed.resume(checkpoint).unwrap();
        let (got, _) = rest(&mut resumed, every);
        assert_eq!(got.len(), want.len() - done);
        for (n, (got, want)) in got.iter().zip(&want[done..]).enumerate() {
            assert!(got == want, "after {done} step {}:\n{got:.600}\n{want:.600}", done + n + 1);
        }
    }
    want
}

fn partial(bench: &Workbench, run: &str, id: u32) -> PathBuf {
    bench.path(&format!(".{run}.{id}.partial"))
}

/// Waits for a file of a run that goes on.
fn wait_for(file: &Path, child: &mut Child) {
    let begin = Instant::now();
    while !file.exists() {
        let ended = child.try_wait().unwrap();
        assert!(ended.is_none(), "ended before {}: {ended:?}", file.display());
        assert!(begin.elapsed() < Duration::from_secs(100), "no {}", file.display());
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn spawn(bench: &Workbench, arguments: &[&str]) -> Child {
    let mut command = bench.command(arguments);
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// Begins a run and kills it once `files` are there; its partial directory.
fn killed(bench: &Workbench, run: &str, arguments: &[&str], files: &[&str]) -> PathBuf {
    let mut child = spawn(bench, arguments);
    let left = partial(bench, run, child.id());
    for file in files {
        wait_for(&left.join(file), &mut child);
    }
    child.kill().unwrap();
    child.wait().unwrap();
    left
}

/// What a file of a run says, without what depends on time, machine and command.
fn content(path: &Path) -> Vec<u8> {
    let bytes = fs::read(path).unwrap();
    match path.file_name().unwrap().to_str().unwrap() {
        "steps.csv" => {
            let text = String::from_utf8(bytes).unwrap();
            let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
            let is_kept = |i: &usize| !rows[0][*i].ends_with("_ms");
            let kept: Vec<usize> = (0..rows[0].len()).filter(is_kept).collect();
            let line = |row: &Vec<&str>| kept.iter().map(|&i| row[i]).collect::<Vec<_>>().join(",");
            rows.iter().map(line).collect::<Vec<_>>().join("\n").into_bytes()
        }
        "summary.json" => {
            let mut summary: Value = serde_json::from_slice(&bytes).unwrap();
            summary.as_object_mut().unwrap().remove("made_by").unwrap();
            without_times(&mut summary);
            serde_json::to_vec(&summary).unwrap()
        }
        _ => bytes,
    }
}

fn without_times(value: &mut Value) {
    match value {
        Value::Object(entries) => {
            let is_time = |key: &str| key.ends_with("_ms") || ["setup_s", "wall_s"].contains(&key);
            let times: Vec<String> = entries.keys().filter(|key| is_time(key)).cloned().collect();
            times.iter().for_each(|key| drop(entries.remove(key)));
            entries.values_mut().for_each(without_times);
        }
        Value::Array(values) => values.iter_mut().for_each(without_times),
        _ => {}
    }
}

/// All files of a run by name.
fn files(run: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![run.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => folders.push(path),
                false => drop(found.insert(path.strip_prefix(run).unwrap().into(), content(&path))),
            }
        }
    }
    found
}

fn assert_same(bench: &Workbench, got: &str, want: &str) {
    let [got, want] = [got, want].map(|run| files(&bench.path(run)));
    let names = |files: &BTreeMap<PathBuf, _>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&got), names(&want));
    for (name, bytes) in &want {
        assert!(got[name] == *bytes, "{} differs", name.display());
    }
}

/// A run that was killed, as often as the case says, leaves what a run leaves that was not.
fn comes_to_the_same(case: &Case) {
    let bench = Workbench::new();
    case.scene(&bench);
    let set = case.set.iter().flat_map(|one| ["--set", one]);
    let run = |out| ["run", case.scene, "--out", out].into_iter().chain(set.clone());
    bench.succeed(&run("whole").collect::<Vec<_>>());
    let mut begin: Vec<&str> = run("cut").collect();
    for after in case.killed_after {
        let frame = format!("frames/step_{after:06}.vtu");
        let left = killed(&bench, "cut", &begin, &["checkpoint", &frame]);
        assert!(left.join("checkpoint").exists() && !left.join("summary.json").exists());
        begin = vec!["run", "--resume", "cut"];
    }
    let printed = bench.succeed(&begin);
    assert!(printed.contains("goes on after step"), "{printed}");
    assert_same(&bench, "cut", "whole");
    assert!(bench.files().iter().all(|file| !file.to_string_lossy().contains("partial")));
}

#[test]
fn a_mesh_that_refines_goes_on() {
    let steps = goes_on(&REFINED);
    let some = |key: &str| {
        steps.iter().any(|step| step.contains(key) && !step.contains(&format!("{key}0,")))
    };
    assert!(some(" splits: ") && some(" merges: "));
}

#[test]
fn a_contact_goes_on() {
    let steps = goes_on(&CONTACT);
    assert!(steps.iter().any(|step| step.contains("contacts: ") && !step.contains("contacts: 0,")));
}

#[test]
fn a_body_with_inertia_that_remembers_goes_on() {
    goes_on(&DYNAMIC);
}

#[test]
fn tools_that_come_later_go_on() {
    goes_on(&TWO_TOOLS);
}

#[test]
fn a_mesh_from_a_file_goes_on() {
    goes_on(&MESH_FILE);
}

#[test]
fn checkpoints_lose_nothing_of_a_mesh_that_refines() {
    is_as_without(&REFINED);
}

#[test]
fn checkpoints_lose_nothing_of_a_contact() {
    is_as_without(&CONTACT);
}

#[test]
fn checkpoints_lose_nothing_of_motion_and_memory() {
    is_as_without(&DYNAMIC);
}

#[test]
fn checkpoints_lose_nothing_of_tools_that_come_later() {
    is_as_without(&TWO_TOOLS);
}

#[test]
fn checkpoints_lose_nothing_of_a_mesh_file() {
    is_as_without(&MESH_FILE);
}

#[test]
fn a_killed_run_that_refines_comes_to_the_same() {
    comes_to_the_same(&REFINED);
}

#[test]
fn a_killed_run_with_contact_comes_to_the_same() {
    comes_to_the_same(&CONTACT);
}

#[test]
fn a_killed_run_with_inertia_comes_to_the_same() {
    comes_to_the_same(&DYNAMIC);
}

#[test]
fn a_killed_run_with_tools_that_come_later_comes_to_the_same() {
    comes_to_the_same(&TWO_TOOLS);
}

#[test]
fn a_killed_run_of_a_mesh_file_comes_to_the_same() {
    comes_to_the_same(&MESH_FILE);
}

#[test]
fn a_simulation_of_another_scene_or_stage_is_refused() {
    let scene = TWO_TOOLS.scene(&Workbench::new());
    let checkpoint = Simulation::builder(&scene).build().unwrap().checkpoint().unwrap();
    let resume = |change: &dyn Fn(&mut Scene)| {
        let mut other = scene.clone();
        change(&mut other);
        Simulation::builder(&other).build().unwrap().resume(&checkpoint)
    };
    resume(&|_| ()).unwrap();
    let error = resume(&|other| other.stages.homogenisation = "linear".into()).unwrap_err();
    assert!(
        matches!(&error, SimError::OtherStage { stage, .. } if stage == "homogenisation"),
        "{error}"
    );
    resume(&|other| drop(other.tools.pop())).unwrap_err();
    resume(&|other| other.mesh.start_level = 2).unwrap_err();
    let error = resume(&|other| other.output.checkpoint_steps = 0).unwrap_err().to_string();
    assert!(error.contains("output.checkpoint_steps is 0, want at least 1"), "{error}");
}

/// A bar of many short steps, of an image.
fn bar() -> Workbench {
    let bench = Workbench::new();
    let text = BAR.replace("frames_every = 2", "frames_every = 20\ncheckpoint_steps = 40");
    bench.write("bar.toml", text).write("a.nii", Nifti::cube(1).bytes());
    bench
}

const RUN: [&str; 7] =
    ["run", "bar.toml", "--set", "image={ path='a.nii' }", "--steps", "2000", "--out"];

fn run_to(out: &str) -> Vec<&str> {
    [&RUN[..], &[out]].concat()
}

#[test]
fn a_run_that_was_to_replace_another_comes_to_the_same() {
    let bench = bar();
    bench.succeed(&run_to("whole"));
    bench.succeed(&[&run_to("cut")[..], &["--set", "materials.0.young_modulus_pa=7e3"]].concat());
    let mut child = spawn(&bench, &[&run_to("cut")[..], &["--force"]].concat());
    let left = format!("cut/.cut.{}.partial", child.id());
    wait_for(&bench.path(&left).join("checkpoint"), &mut child);
    child.kill().unwrap();
    child.wait().unwrap();
    bench.write("cut/notes.txt", "kept");
    // By the partial directory's own name.
    bench.succeed(&["run", "--resume", &left]);
    assert_eq!(bench.read("cut/notes.txt"), "kept");
    fs::remove_file(bench.path("cut/notes.txt")).unwrap();
    assert_same(&bench, "cut", "whole");
}

/// The checkpoint of another version of the program, whole.
fn of_version(bytes: &[u8], version: &[u8; 5]) -> Vec<u8> {
    let begin = bytes.split_inclusive(|&byte| byte == b'\n').take(2).map(<[u8]>::len).sum();
    let (head, rest) = bytes.split_at(begin);
    let mut rest = rest.to_vec();
    let this = env!("CARGO_PKG_VERSION").as_bytes();
    let at = rest.windows(this.len()).position(|window| window == this).unwrap();
    rest[at..at + this.len()].copy_from_slice(version);
    let hash: String = Sha256::digest(&rest).iter().map(|byte| format!("{byte:02x}")).collect();
    let line = head.iter().position(|&byte| byte == b'\n').unwrap() + 1;
    [&head[..line], hash.as_bytes(), b"\n", &rest].concat()
}

#[test]
fn what_can_not_be_gone_on_with_is_refused() {
    let bench = bar();
    let resume = ["run", "--resume", "cut"];
    bench.refused(&resume, &["cut: no interrupted run"]);
    bench.refused(&["run", "--resume", ".cut.1.partial"], &[".cut.1.partial: no interrupted run"]);
    bench.refused(&[&resume[..], &["--steps", "3"]].concat(), &["--resume", "--steps"]);

    // While it is written.
    let mut child = spawn(&bench, &run_to("cut"));
    let left = partial(&bench, "cut", child.id());
    wait_for(&left.join("checkpoint"), &mut child);
    let output = bench.run(&resume);
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2));
    assert!(message.contains("still being written"), "{message}");
    assert!(child.try_wait().unwrap().is_none(), "the run was over too soon");
    child.kill().unwrap();
    child.wait().unwrap();

    // Each of these is undone after.
    let refused = |file: &Path, bytes: &[u8], words: &[&str]| {
        let was = fs::read(file).unwrap();
        fs::write(file, bytes).unwrap();
        bench.refused(&resume, words);
        fs::write(file, was).unwrap();
    };
    let checkpoint = left.join("checkpoint");
    let whole = fs::read(&checkpoint).unwrap();
    for at in [0, 30, 90, whole.len() / 2, whole.len() - 1] {
        let mut flipped = whole.clone();
        flipped[at] ^= 4;
        refused(&checkpoint, &flipped, &["checkpoint: damaged"]);
    }
    for length in [0, 10, 50, 200, whole.len() / 2, whole.len() - 1] {
        refused(&checkpoint, &whole[..length], &["checkpoint: damaged"]);
    }
    refused(&checkpoint, &[&whole[..], b"x"].concat(), &["checkpoint: damaged"]);
    let layout = [b"yawara checkpoint 7\n", &whole[20..]].concat();
    refused(&checkpoint, &layout, &["layout 7", "want layout 2"]);
    let want = concat!("want ", env!("CARGO_PKG_VERSION"));
    refused(&checkpoint, &of_version(&whole, b"0.0.7"), &["by yawara 0.0.7", want]);

    let scene = left.join("scene.toml");
    let edited = fs::read_to_string(&scene).unwrap().replace("5000.0", "6000.0");
    refused(&scene, edited.as_bytes(), &["scene.toml", "edited since the checkpoint"]);
    let image = bench.path("a.nii");
    let mut other = fs::read(&image).unwrap();
    *other.last_mut().unwrap() = 0;
    refused(&image, &other, &["a.nii", "has changed"]);
    let steps = left.join("steps.csv");
    refused(&steps, &fs::read(&steps).unwrap()[..500], &["steps.csv: damaged", "rows before"]);

    let missing = |file: &Path, words: &[&str]| {
        let aside = bench.path("aside");
        fs::rename(file, &aside).unwrap();
        bench.refused(&resume, words);
        fs::rename(&aside, file).unwrap();
    };
    missing(&image, &["a.nii", "can't be read", "the run began in"]);
    missing(&checkpoint, &["no checkpoint yet", "output.checkpoint_steps"]);
    missing(&left.join("frames/step_000020.vtu"), &["step_000020.vtu: damaged"]);

    bench.write("cut", "a file");
    bench.refused(&resume, &["cut: stands where the run is to end"]);
    fs::remove_file(bench.path("cut")).unwrap();
    let second = bench.path(".cut.4194999999.partial");
    fs::create_dir(&second).unwrap();
    bench.refused(&resume, &["several interrupted runs", "4194999999"]);
    fs::remove_dir(&second).unwrap();

    // Nothing of all that has hurt it.
    let printed = bench.succeed(&["clean", "."]);
    assert!(
        printed.contains("kept ") && printed.contains(".partial` goes on after step "),
        "{printed}"
    );
    bench.succeed(&resume);
    bench.refused(&resume, &["cut: the run is complete"]);
    bench.succeed(&run_to("whole"));
    assert_same(&bench, "cut", "whole");
}

#[test]
fn a_run_that_ends_early_stays_if_it_has_a_checkpoint() {
    let bench = bar();
    let file = bench.path("bar.toml");
    let scene = scene_file::load(file.to_str().unwrap(), &[]).unwrap().0;
    let target = bench.path("run");
    let mut simulation = Simulation::builder(&scene).build().unwrap();
    let mut directory = RunDirectory::create(&target, false).unwrap();
    let checkpoint = simulation.checkpoint().unwrap();
    let error = directory.write_checkpoint(&checkpoint).unwrap_err().to_string();
    assert!(error.contains("output.checkpoint_steps is 0"), "{error}");
    directory.write_scene(&scene, simulation.plan()).unwrap();
    assert_eq!(directory.resumable(), None);
    drop(directory);
    assert!(bench.files().iter().all(|file| !file.starts_with(".run")), "{:?}", bench.files());

    let mut directory = RunDirectory::create(&target, false).unwrap();
    directory.write_scene(&scene, simulation.plan()).unwrap();
    directory.write_step(&simulation.step().unwrap()).unwrap();
    directory.write_checkpoint(&simulation.checkpoint().unwrap()).unwrap();
    let Err(SimError::Resume(error)) = Interrupted::take(&target) else { panic!("taken twice") };
    assert!(matches!(error, ResumeError::BeingWritten(_)), "{error}");
    drop(directory);
    for _ in 0..2 {
        let Interrupted { directory, checkpoint, .. } = Interrupted::take(&target).unwrap();
        assert_eq!(checkpoint.steps(), 1);
        assert!(directory.resumable().is_some_and(Path::exists));
    }
}

#[test]
fn clean_removes_what_can_be_gone_on_with_if_all_is_to_go() {
    let bench = bar();
    let left = killed(&bench, "cut", &run_to("cut"), &["checkpoint"]);
    bench.succeed(&["clean", "."]);
    assert!(left.exists());
    assert!(bench.succeed(&["clean", ".", "--all"]).contains("removed"));
    assert!(!left.exists());
}
