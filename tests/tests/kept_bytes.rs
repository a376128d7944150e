//! Same scene, same bytes: what built-in scenes write, against the record in `kept_bytes.toml`.
//!
//! Everything in a run directory counts but times and the plan's explanations. Last digits depend
//! on the processor's vector unit, by which kernels are chosen when the program starts, so hashes
//! are kept for each class of it; they depend neither on threads nor on the profile (the record was
//! begun with a release build). The figures hold on every machine. Without a processor of class
//! `x86-v3`, `qemu-x86_64 -cpu max` runs the test as one.
//!
//! `YAWARA_KEEP=1 cargo test -p yawara-tests --test all kept_bytes:: -- --nocapture` prints the record of
//! this machine's class. Whoever changes it says why in `reason`, and in the changelog.

use std::path::{Path, PathBuf};

use serde_json::Value;
use sha2::{Digest, Sha256};
use toml::Table;
use yawara::output::RunDirectory;
use yawara::report::Frame;
use yawara::{Simulation, Stages, scene_file};

const RECORD: &str = include_str!("kept_bytes.toml");

/// How far figures may be off where no bytes are kept: a step is solved to a residual of 1e-6, so
/// that other last digits end it an iteration sooner or later. Counts of the mesh are exact.
fn tolerance(figure: &str) -> f64 {
    match figure {
        "iterations" => 0.05,
        "force_max_n" | "displacement_max_mm" => 1e-4,
        _ => 0.0,
    }
}

/// The vector unit's class, by the names of the architecture's levels.
fn class() -> Option<&'static str> {
    #[cfg(target_arch = "x86_64")]
    {
        let has_v3 = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
        let has_v4 = is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("avx512cd")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512vl");
        if has_v3 {
            return Some(if has_v4 { "x86-v4" } else { "x86-v3" });
        }
    }
    None
}

/// What a run left: hashes by kind of output, figures by name.
struct Run {
    hashes: Vec<(&'static str, String)>,
    figures: Vec<(&'static str, f64)>,
}

/// Runs a built-in scene to its end, as `yawara run` does.
fn run(name: &str) -> Run {
    let (scene, _) = scene_file::load(name, &[]).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let mut directory = RunDirectory::create(&folder.path().join(name), false).unwrap();
    let mut simulation = Simulation::new(&scene, Stages::by_name(&scene.stages).unwrap()).unwrap();
    directory.write_scene(&scene, simulation.plan()).unwrap();
    let mut values = Sha256::new();
    let (mut iterations, mut displacement) = (0, 0.0_f64);
    let mut write = |simulation: &Simulation, directory: &mut RunDirectory, step| {
        let frame = simulation.frame().unwrap();
        add_values(&mut values, &frame);
        let lengths = frame.displacement_mm.iter().map(|u| u.iter().map(|x| x * x).sum::<f64>());
        displacement = lengths.fold(displacement, |most, length| most.max(length.sqrt()));
        directory.write_frame(&frame, step).unwrap();
    };
    write(&simulation, &mut directory, 0);
    while simulation.steps_left() > 0 {
        let report = simulation.step().unwrap();
        iterations += report.iterations;
        directory.write_step(&report).unwrap();
        if report.step.is_multiple_of(scene.output.frames_every) || simulation.steps_left() == 0 {
            write(&simulation, &mut directory, report.step);
        }
    }
    let summary = simulation.summary().unwrap();
    directory.write_summary(&summary).unwrap();
    let written = directory.finish().unwrap();
    let mut hashes = vec![("values", hex(values))];
    hashes.extend(file_hashes(&written));
    let figures = vec![
        ("vertices", summary.mesh.vertices.end as f64),
        ("tetrahedra", summary.mesh.tets.end as f64),
        ("splits", summary.mesh.splits as f64),
        ("merges", summary.mesh.merges as f64),
        ("iterations", iterations as f64),
        ("force_max_n", summary.force.max_n),
        ("displacement_max_mm", displacement),
    ];
    Run { hashes, figures }
}

/// The numbers of a frame, however they are written.
fn add_values(hash: &mut Sha256, frame: &Frame) {
    let points = frame.points_mm.iter().chain(&frame.displacement_mm).flatten();
    let fields = frame.young_modulus_pa.iter().chain(&frame.von_mises_pa).chain(&frame.indicator);
    points.chain(fields).for_each(|value| hash.update(value.to_le_bytes()));
    frame.tets.iter().flatten().for_each(|vertex| hash.update(vertex.to_le_bytes()));
    frame.label.iter().for_each(|label| hash.update(label.to_le_bytes()));
    hash.update(&frame.level);
}

/// One hash for each kind of file.
fn file_hashes(run: &Path) -> Vec<(&'static str, String)> {
    let of = |bytes: Vec<u8>| hex(Sha256::new().chain_update(bytes));
    let bytes = |file: &PathBuf| std::fs::read(file).unwrap();
    let read = |file: &Path| std::fs::read_to_string(file).unwrap();
    let entries = std::fs::read_dir(run.join("frames")).unwrap();
    let mut frames: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    frames.sort();
    vec![
        ("scene.toml", of(bytes(&run.join("scene.toml")))),
        ("steps.csv", of(without_times(&read(&run.join("steps.csv"))).into())),
        ("frames.pvd", of(bytes(&run.join("frames.pvd")))),
        ("frames", of(frames.iter().flat_map(bytes).collect())),
        ("summary.json", of(without_words(&read(&run.join("summary.json"))).into())),
    ]
}

/// A table without its columns in milliseconds.
fn without_times(table: &str) -> String {
    let header: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    let kept = |line: &str| {
        let columns = line.split(',').zip(&header).filter(|(_, name)| !name.ends_with("_ms"));
        columns.map(|(value, _)| value).collect::<Vec<_>>().join(",") + "\n"
    };
    table.lines().map(kept).collect()
}

/// A summary without times and without the plan's explanations.
fn without_words(summary: &str) -> String {
    fn strip(value: &mut Value) {
        match value {
            Value::Object(fields) => {
                let drops = ["why", "setup_s", "wall_s"];
                fields.retain(|name, _| !name.ends_with("_ms") && !drops.contains(&name.as_str()));
                fields.values_mut().for_each(strip);
            }
            Value::Array(values) => values.iter_mut().for_each(strip),
            _ => {}
        }
    }
    let mut value = serde_json::from_str(summary).unwrap();
    strip(&mut value);
    value.to_string()
}

fn hex(hash: Sha256) -> String {
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Compares a run with its record; with `YAWARA_KEEP` set it prints what the record would be.
fn check(scene: &str) {
    let run = run(scene);
    let class = class();
    if std::env::var_os("YAWARA_KEEP").is_some() {
        print_record(scene, class, &run);
        return;
    }
    let record: Table = RECORD.parse().unwrap();
    let kept = &record[scene];
    let mut wrong = Vec::new();
    for (name, figure) in &run.figures {
        let want = &kept["figures"][name];
        let want = want.as_float().unwrap_or_else(|| want.as_integer().unwrap() as f64);
        if !((figure - want).abs() <= tolerance(name) * want.abs()) {
            wrong.push(format!("{name} is {figure}, kept is {want}"));
        }
    }
    match class.and_then(|class| kept.get(class)) {
        Some(hashes) => {
            let differ =
                run.hashes.iter().filter(|(name, hash)| hashes[name].as_str() != Some(hash));
            wrong.extend(differ.map(|(name, _)| format!("other bytes in {name}")));
        }
        None => println!("{scene}: no hashes kept for {class:?}, compared figures only"),
    }
    assert!(wrong.is_empty(), "{scene}: {}", wrong.join("; "));
}

fn print_record(scene: &str, class: Option<&str>, run: &Run) {
    let figures: Vec<String> =
        run.figures.iter().map(|(name, figure)| format!("{name} = {figure}\n")).collect();
    let hashes: Vec<String> =
        run.hashes.iter().map(|(name, hash)| format!("\"{name}\" = \"{hash}\"\n")).collect();
    let class = class.unwrap_or("unknown");
    let (figures, hashes) = (figures.concat(), hashes.concat());
    println!(
        "[{scene}]\nreason = \"\"\n\n[{scene}.figures]\n{figures}\n[{scene}.{class}]\n{hashes}"
    );
}

#[test]
fn the_beam_writes_the_kept_bytes() {
    check("beam");
}

#[test]
fn the_twisted_bar_writes_the_kept_bytes() {
    check("twist");
}

#[test]
fn the_liver_writes_the_kept_bytes() {
    check("liver");
}

#[test]
fn only_times_and_explanations_are_left_out() {
    let table = "step,time_s,solve_ms,force_n\n1,0.1,3.5,2\n";
    assert_eq!(without_times(table), "step,time_s,force_n\n1,0.1,2\n");
    let summary = r#"{"plan":[{"why":"x","choice":"p1"}],"wall_s":2,"time_s":1,"a":{"p_ms":3}}"#;
    assert_eq!(without_words(summary), r#"{"plan":[{"choice":"p1"}],"time_s":1,"a":{}}"#);
}
