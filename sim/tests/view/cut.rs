//! What the page shows where a plane cuts the body: labels, or the grey values of a scan, carried along.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::PoisonError;

use super::browser::Browser;
use super::{ALONE, READY, View, number, stage};

/// A scan of 2 mm voxels, whose values are where they are along x, scanner RAS mm.
fn scan(folder: &Path) -> PathBuf {
    let (file, dims) = (folder.join("scan.nrrd"), [120, 40, 40]);
    let header = "NRRD0004\ntype: float\ndimension: 3\nspace: right-anterior-superior\nsizes: 120 40 40\n\
        space directions: (2,0,0) (0,2,0) (0,0,2)\nspace origin: (-119,-39,-39)\nencoding: raw\nendian: little\n\n";
    let mut bytes = header.as_bytes().to_vec();
    for at in 0..dims.iter().product() {
        bytes.extend((2.0 * (at % dims[0]) as f32 - 119.0).to_le_bytes());
    }
    fs::write(&file, bytes).unwrap();
    file
}

fn refused(arguments: &[&str]) -> String {
    let output =
        Command::new(env!("CARGO_BIN_EXE_yawara")).arg("view").args(arguments).output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), &output.stdout[..]), (Some(2), &b""[..]), "{message}");
    assert_eq!(message.matches('\n').count(), 1, "{message}");
    message
}

#[test]
fn a_scan_that_can_not_be_shown_is_refused_by_its_option() {
    let folder = tempfile::tempdir().unwrap();
    let scan = scan(folder.path());
    let scan = scan.to_str().unwrap();
    let message = refused(&["beam", "--grey", "nowhere.nii.gz"]);
    assert!(message.contains("nowhere.nii.gz"), "{message}");
    let there = fs::read(scan).unwrap();
    let at = there.windows(2).position(|pair| pair == b"\n\n").unwrap();
    let header = String::from_utf8(there[..at].to_vec()).unwrap();
    let header = header.replace("space origin: (-119,-39,-39)", "space origin: (900,900,900)");
    let elsewhere = folder.path().join("elsewhere.nrrd");
    fs::write(&elsewhere, [header.as_bytes(), &there[at..]].concat()).unwrap();
    let message = refused(&["beam", "--grey", elsewhere.to_str().unwrap()]);
    assert!(message.contains("--grey is a scan of [120, 40, 40] voxels from"), "{message}");
    assert!(message.contains("want one in which the body lies"), "{message}");
}

/// Where the triangles of the cut are, and how bright both ends along x are.
const FOUND: &str = "
    const { position, color } = yawara.body.cut.mesh.geometry.attributes;
    const found = { count: position.count, low: Infinity, off: 0, first: [Infinity, 0], last: [-Infinity, 0] };
    for (let i = 0; i < position.count; i += 1) {
      const [x, y, z] = position.array.slice(3 * i, 3 * i + 3);
      found.low = Math.min(found.low, z);
      found.off = Math.max(found.off, Math.abs(y - yawara.body.plane.constant));
      if (x < found.first[0]) found.first = [x, color.array[3 * i]];
      if (x > found.last[0]) found.last = [x, color.array[3 * i]];
    }
    return found;";

#[test]
fn grey_values_on_the_cut_go_along_with_the_body() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(page) = Browser::open(1100, 760) else { return };
    let folder = tempfile::tempdir().unwrap();
    let scan = scan(folder.path());
    let arguments = ["beam", "--set", "mesh.max_level=3", "--set", "image.voxel_mm=2.0"];
    let view = View::start(&[&arguments[..], &["--grey", scan.to_str().unwrap()]].concat());
    page.go(&view.url);
    page.wait(READY);
    page.wait("yawara.last.step > 3");
    page.run("document.getElementById('pause').click()");
    page.wait("yawara.state.paused && !yawara.body.is_stale");
    assert_eq!(page.run("return yawara.body.cut.mesh.visible"), false);
    page.run("document.getElementById('cut').click()");
    page.wait("yawara.body.cut.mesh.visible && !yawara.body.is_stale");
    let shown =
        page.run("return document.getElementById('cut_shows').selectedOptions[0].innerText");
    assert!(shown.as_str().unwrap().starts_with("grey, -"), "{shown}");
    // It hangs from one end: what rests at the other is as bright as what is brightest, wherever it is now.
    let found = || page.run(FOUND);
    let ends = |found: &serde_json::Value| [&found["first"], &found["last"]].map(|x| number(&x[1]));
    let bent = found();
    assert!(number(&bent["count"]) > 1000.0 && number(&bent["off"]) < 1e-3, "{bent}");
    assert!(ends(&bent)[0] < 0.01 && ends(&bent)[1] > 0.95, "{bent}");
    let rest = page.run("return [yawara.body.box.low[2], yawara.body.box.high[0]]");
    assert!(number(&bent["low"]) < number(&rest[0]) - 20.0, "{bent} from {rest}");
    assert!(number(&bent["last"][0]) < number(&rest[1]) - 5.0, "{bent} from {rest}");
    // The same cut by labels has one colour; without the label there is nothing left of it.
    page.run(
        "const select = document.getElementById('cut_shows');
         select.value = 'label'; select.dispatchEvent(new Event('change'))",
    );
    page.wait("!yawara.body.is_stale");
    let labels = found();
    assert_eq!(labels["count"], bent["count"]);
    assert_eq!(ends(&labels)[0], ends(&labels)[1]);
    page.run("document.querySelector('#legend input').click()");
    page.wait("!yawara.body.is_stale");
    assert_eq!(number(&found()["count"]), 0.0);
}

#[test]
fn a_cut_through_the_liver_shows_what_is_in_it() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(page) = Browser::open(1100, 760) else { return };
    let view = View::start(&["liver"]);
    page.go(&view.url);
    page.wait(READY);
    let whole = stage(&page, "view");
    page.run("document.getElementById('cut').click()");
    page.wait("yawara.body.cut.mesh.visible && !yawara.body.is_stale");
    assert_eq!(page.run("return yawara.body.cut_shows"), "label");
    let colours = page.run(
        "const { color } = yawara.body.cut.mesh.geometry.attributes;
         const seen = new Set();
         for (let i = 0; i < color.count; i += 1) seen.add(color.array.slice(3 * i, 3 * i + 3).join());
         return seen.size",
    );
    assert!((3.0..=4.0).contains(&number(&colours)), "{colours} colours of labels");
    assert!(stage(&page, "view").changes(&whole).len() > 5000);
}
