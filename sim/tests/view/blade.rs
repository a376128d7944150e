//! A body that is cut, by a hand on the page or in a run that is over.

use std::fs;
use std::sync::PoisonError;

use super::browser::Browser;
use super::export::{exported, farthest, open, positions};
use super::playback::{Finished, shows_force};
use super::{ALONE, LOBE, READY, View, number, pair, runs_again};

/// Triangles of the skin.
const TRIANGLES: &str = "return yawara.body.surfaces[0].mesh.geometry.index.count / 3";

#[test]
fn a_blade_opens_the_liver_a_suture_closes_it_and_what_was_done_is_run_again() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(page) = Browser::open(1100, 760) else { return };
    let folder = tempfile::tempdir().unwrap();
    let kept = folder.path().join("kept");
    let view = View::start(&["liver", "--out", kept.to_str().unwrap()]);
    page.go(&view.url);
    page.wait(READY);
    page.wait("yawara.body.surfaces.length === 4");
    let whole = number(&page.run(TRIANGLES));
    page.run(
        "window.felt = {}; setInterval(() => { felt[yawara.last.step] = yawara.last.force_n; }, 4);
         document.querySelector('input[value=cut]').click();
         const depth = document.getElementById('depth');
         depth.value = 20;
         depth.dispatchEvent(new Event('input'));",
    );
    let at = pair(&page.run(LOBE));
    let way: Vec<[f64; 2]> = (1..=8).map(|i| [at[0] - 12.0 * f64::from(i), at[1]]).collect();
    page.drag([at[0] + 20.0, at[1]], &way);
    page.wait("yawara.last.tools.some((tool) => tool.kind === 'scalpel' && tool.edge_mm)");
    page.wait(&format!("yawara.body.surfaces[0].mesh.geometry.index.count / 3 > {}", whole + 40.0));
    page.let_go();
    page.wait("yawara.last.tools.length === 0");
    // What is drawn has all of its vertices.
    let drawn = "const { geometry } = yawara.body.surfaces[0].mesh;
        return Math.max(...geometry.index.array) + 1 === geometry.attributes.position.count";
    assert_eq!(page.run(drawn), true);
    // A lip is pulled away from the other.
    page.run("document.querySelector('input[value=grab]').click()");
    let lip = [at[0] - 40.0, at[1] + 30.0];
    page.drag(lip, &[[lip[0], lip[1] + 30.0], [lip[0], lip[1] + 60.0]]);
    page.wait("Math.hypot(...yawara.last.force_n) > 0.3 && yawara.last.converged");
    page.wait("Object.values(felt).filter((force) => force[2] !== 0).length > 6");
    page.run("document.getElementById('save').click()");
    page.wait("document.getElementById('command').textContent.includes('001')");
    let felt = page.run("return felt");
    page.let_go();
    // Sewn again it is whole.
    page.wait("yawara.last.at_rest");
    page.run(
        "document.querySelector('input[value=sew]').click();
         const radius = document.getElementById('radius');
         radius.value = 40;
         radius.dispatchEvent(new Event('input'));",
    );
    page.drag([at[0] + 20.0, at[1]], &way);
    page.wait(&format!("yawara.body.surfaces[0].mesh.geometry.index.count / 3 === {whole}"));
    page.let_go();
    runs_again(&kept.join("001/run"), &felt);
    let summary = fs::read_to_string(kept.join("001/run/summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
    assert!(number(&summary["tools"][0]["cut_cm2"]) > 5.0, "{}", summary["tools"][0]);
    assert!(number(&summary["tools"][0]["doubled"]) > 5.0, "{}", summary["tools"][0]);
}

#[test]
fn a_run_that_was_cut_is_played_and_exported_with_what_it_became() {
    let finished = Finished::new(&["incision"]);
    exported(&finished, &["--gltf", "run.glb"]);
    let scene = open(&finished.path("run.glb"));
    // A mesh a frame: 0, 2, … 20.
    assert_eq!(scene.meshes().count(), 11);
    for (frame, step) in [(0, 0), (4, 8), (10, 20)] {
        let file = finished.run().join(format!("frames/step_{step:06}_outline.vtp"));
        let read = yawara_mesh::tet_file::read_vtp_fields(&file).unwrap();
        let off = farthest(&positions(&scene, frame, frame), &read.points);
        assert!(off <= 2.0_f64.powi(-23) * 400.0, "step {step}: {off} mm");
    }
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(page) = Browser::open(1100, 760) else { return };
    let view = View::start(&[finished.run().to_str().unwrap()]);
    page.go(&view.url);
    page.wait(READY);
    let whole = number(&page.run(TRIANGLES));
    let seek = |frame: usize| {
        page.run(&format!(
            "const seek = document.getElementById('seek'); seek.value = {frame}; seek.dispatchEvent(new Event('input'))"
        ));
        page.wait(&format!("yawara.last.step === {} && yawara.clock.asked === null", 2 * frame));
    };
    seek(10);
    shows_force(&page, finished.force(20));
    assert!(number(&page.run(TRIANGLES)) > whole + 20.0);
    // And back to what is whole.
    seek(0);
    assert_eq!(number(&page.run(TRIANGLES)), whole);
}
