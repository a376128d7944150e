//! A run that is over, played in the page.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::PoisonError;

use super::browser::Browser;
use super::{ALONE, READY, View, number};

/// A run of the liver with vessels, a frame every second step, made in a scratch folder.
pub struct Finished {
    folder: tempfile::TempDir,
}

impl Finished {
    pub fn new(arguments: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let made = Self { folder };
        let output = made.yawara(&[&["run"], arguments, &["--out", "over"]].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        made
    }

    pub fn liver() -> Self {
        Self::new(&[
            "liver",
            "--steps=12",
            "--set",
            "output.frames_every=2",
            "--set",
            "output.surfaces=[{ label = 2 }]",
        ])
    }

    pub fn run(&self) -> PathBuf {
        self.folder.path().join("over")
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_yawara"));
        command.args(arguments).current_dir(self.folder.path());
        command
    }

    pub fn yawara(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    /// The force on all tools in a step, as the table has it.
    pub fn force(&self, step: usize) -> [f64; 3] {
        let text = fs::read_to_string(self.run().join("steps.csv")).unwrap();
        let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
        let at = |name: &str| rows[0].iter().position(|one| *one == name).unwrap();
        assert_eq!(rows[step][at("step")], step.to_string());
        ["force_x_n", "force_y_n", "force_z_n"].map(|name| rows[step][at(name)].parse().unwrap())
    }
}

/// Whether the page shows this force, in its numbers and in its words.
pub fn shows_force(page: &Browser, force: [f64; 3]) {
    let shown = page.run("return yawara.last.force_n");
    assert_eq!([0, 1, 2].map(|axis| number(&shown[axis])), force);
    let size = force.iter().map(|x| x * x).sum::<f64>().sqrt();
    let words = page.run("return document.getElementById('force').textContent");
    assert_eq!(words.as_str().unwrap(), format!("{size:.3} N"));
}

#[test]
fn a_run_is_played_with_the_numbers_of_its_table() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(page) = Browser::open(1100, 760) else { return };
    let finished = Finished::liver();
    let view = View::start(&[finished.run().to_str().unwrap()]);
    page.go(&view.url);
    page.wait(READY);
    page.wait("yawara.clock && yawara.body.surfaces.length === 2");
    assert_eq!(page.run("return [yawara.last.step, yawara.clock.last]"), serde_json::json!([0, 6]));
    let is_hidden = |id: &str| {
        page.run(&format!("return document.getElementById('{id}').offsetParent === null")) == true
    };
    for (id, hidden) in [("pause", true), ("save", true), ("radius", true), ("seek", false)] {
        assert_eq!(is_hidden(id), hidden, "{id}");
    }
    // To the middle, by the slider.
    page.run("const seek = document.getElementById('seek'); seek.value = 3; seek.dispatchEvent(new Event('input'))");
    page.wait("yawara.last.step === 6 && yawara.clock.asked === null && !yawara.body.is_stale");
    shows_force(&page, finished.force(6));
    assert!(number(&page.run("return Math.hypot(...yawara.last.force_n)")) > 0.3);
    // The arrow stands at the lobe that is pulled.
    let place = page.run("return yawara.last.tools[0].reference_mm");
    assert!(number(&place[0]) < -60.0 && number(&place[2]) > 20.0, "{place}");
    assert_eq!(page.run("return document.querySelectorAll('#labels div').length"), 1);
    // What is drawn has moved, as far as the run's own file says to the unit of what is sent.
    let most = number(&page.run(
        "const { moved } = yawara.body.surfaces[0];
         let most = 0;
         moved.forEach((x) => { most = Math.max(most, Math.abs(x)); });
         return most * yawara.body.quantum;",
    ));
    let outline = yawara_mesh::tet_file::read_vtp_fields(
        &finished.run().join("frames/step_000006_outline.vtp"),
    );
    let outline = outline.unwrap();
    let moved = outline.of_points("displacement_mm", 3).unwrap();
    let want = moved.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let quantum = number(&page.run("return yawara.body.quantum"));
    assert!((most - want).abs() <= 0.5001 * quantum && want > 5.0, "{most} {want}");
    // By a press on the force curve: the last frame.
    page.run(
        "const canvas = document.querySelector('.plot canvas');
         const { right, top } = canvas.getBoundingClientRect();
         canvas.dispatchEvent(new PointerEvent('pointerdown', { clientX: right, clientY: top, buttons: 1 }))",
    );
    page.wait("yawara.last.step === 12");
    shows_force(&page, finished.force(12));
    // By keys.
    page.run("document.getElementById('view').focus()");
    let press = |key: &str| {
        page.run(&format!(
            "document.activeElement.dispatchEvent(new KeyboardEvent('keydown', {{ key: '{key}', bubbles: true }}))"
        ));
    };
    press("b");
    page.wait("yawara.last.step === 10");
    press("Home");
    page.wait("yawara.last.step === 0");
    press(" ");
    page.wait("document.getElementById('play').textContent === 'Pause' || yawara.last.step === 12");
    page.wait("yawara.last.step === 12 && !yawara.clock.plays");
    // Hands stay off what is over.
    page.run("yawara.socket.send(JSON.stringify({ do: 'grab', hand: 0, rest_mm: [0, 0, 0], radius_mm: 9 }))");
    page.wait("document.getElementById('notices').textContent.includes('over')");
    page.run("yawara.socket.send(JSON.stringify({ do: 'seek', frame: 7 }))");
    page.wait("document.getElementById('notices').textContent.includes('below 7')");
    assert_eq!(page.run("return yawara.last.step"), 12);
}

#[test]
fn a_page_that_is_narrow_and_dark_plays_a_run_of_a_mesh_without_outlines() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(page) = Browser::open(500, 760) else { return };
    let finished = Finished::new(&["beam", "--steps=4", "--set", "output.outline=false"]);
    let view = View::start(&[finished.run().to_str().unwrap()]);
    page.emulate(360, true);
    page.go(&view.url);
    page.wait(READY);
    page.wait("yawara.clock");
    assert_eq!(
        page.run("return [innerWidth, document.documentElement.scrollWidth <= 360]"),
        serde_json::json!([360, true])
    );
    assert_eq!(page.run("return yawara.body.surfaces.length"), 0);
    page.run("document.getElementById('next').click()");
    page.wait("yawara.last.frame === 1");
    let (ground, ink) = (
        "getComputedStyle(document.body).backgroundColor",
        "getComputedStyle(document.getElementById('seek_out')).color",
    );
    assert_eq!(
        page.run(&format!("return [{ground}, {ink}]")),
        serde_json::json!(["rgb(21, 23, 26)", "rgb(233, 234, 236)"])
    );
    shows_force(&page, finished.force(number(&page.run("return yawara.last.step")) as usize));
}

#[test]
fn a_run_directory_that_is_broken_or_not_over_is_refused_by_the_file() {
    let finished = Finished::new(&["beam", "--steps=2", "--set", "mesh.max_level=3"]);
    let refused = |arguments: &[&str]| {
        let mut command = finished.command(&[&["view"], arguments].concat());
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        // What is served prints an address, and would go on.
        let mut served = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut served).unwrap();
        if !served.is_empty() {
            child.kill().unwrap();
        }
        let output = child.wait_with_output().unwrap();
        assert!(served.is_empty(), "{arguments:?} is served");
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert_eq!(message.matches('\n').count(), 1, "{message}");
        message
    };
    let run = finished.run();
    let frame = "frames/step_000002_outline.vtp";
    let spoil: [Spoilt; 13] = [
        ("summary.json", &|path| fs::remove_file(path).unwrap(), "has finished"),
        ("summary.json", &|path| fs::write(path, "{").unwrap(), "EOF"),
        ("summary.json", &|path| replace(path, "\"schema\": 1", "\"schema\": 9"), "schema is 9"),
        (
            "summary.json",
            &|path| replace(path, "\"count\": 2", "\"count\": 3"),
            "steps.csv: has 2 steps",
        ),
        ("scene.toml", &|path| fs::write(path, "name = 3").unwrap(), "scene.toml"),
        ("steps.csv", &|path| fs::write(path, "").unwrap(), "line 1: no column"),
        ("steps.csv", &|path| fs::write(path, [0xff, 0xfe]).unwrap(), "UTF-8"),
        (
            "frames.pvd",
            &|path| replace(path, "step_000002", "step_000009"),
            "outline.pvd, line 5: no outline of a frame",
        ),
        (
            "frames.pvd",
            &|path| replace(path, "frames/step_000002", "../../etc"),
            "want frames/step_",
        ),
        ("frames/step_000002.vtu", &|path| fs::remove_file(path).unwrap(), "step_000002.vtu"),
        ("frames/step_000002.vtu", &|path| cut(path), "step_000002.vtu"),
        (frame, &|path| cut(path), "step_000002_outline.vtp"),
        (
            frame,
            &|path| replace(path, "Name=\"displacement_mm\"", "Name=\"displacement_um\""),
            "no array displacement_mm",
        ),
    ];
    for (name, spoil, want) in spoil {
        let path = run.join(name);
        let whole = fs::read(&path).unwrap();
        spoil(&path);
        let message = refused(&["over"]);
        assert!(message.contains(want), "{name}, want {want}: {message}");
        fs::write(&path, whole).unwrap();
    }
    for option in [
        &["--set", "time.steps=3"][..],
        &["--beside", "stages.homogenisation=paper"],
        &["--out", "elsewhere"],
        &["--play"],
        &["--keep-going"],
    ] {
        let message = refused(&[&["over"], option].concat());
        assert!(message.contains(option[0]) && message.contains("want a scene"), "{message}");
    }
    assert!(refused(&["over/frames"]).contains("summary.json"));
    // Whole again.
    drop(View::start(&[run.to_str().unwrap()]));
}

/// A file of a run, what is done to it, and what is said of that.
type Spoilt<'a> = (&'a str, &'a dyn Fn(&Path), &'a str);

pub fn replace(path: &Path, from: &str, to: &str) {
    let bytes = fs::read(path).unwrap();
    let at = bytes.windows(from.len()).position(|window| window == from.as_bytes());
    let at = at.unwrap_or_else(|| panic!("no {from} in {}", path.display()));
    let spoilt = [&bytes[..at], to.as_bytes(), &bytes[at + from.len()..]].concat();
    fs::write(path, spoilt).unwrap();
}

fn cut(path: &Path) {
    let bytes = fs::read(path).unwrap();
    fs::write(path, &bytes[..bytes.len() / 2]).unwrap();
}
