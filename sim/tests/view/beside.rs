//! Two simulations beside each other, led by the same hand.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::PoisonError;

use serde_json::json;

use super::browser::Browser;
use super::{ALONE, LOBE, READY, View, number, pair, runs_again, stage};

const BOTH: &str = "yawara.beside && yawara.beside.was_sized && !yawara.beside.is_stale";

#[test]
fn what_can_not_go_beside_is_refused_by_its_option() {
    for (beside, want) in [
        (
            "stages.homogenisation=papr",
            "--beside stages.homogenisation=papr: stages.homogenisation is",
        ),
        ("stages.homogenisaton=paper", "--beside stages.homogenisaton=paper: unknown key"),
        ("materials.0.poisson_ratio=0.7", "--beside materials.0.poisson_ratio=0.7: materials[0]"),
        ("paper", "--beside paper: want KEY=VALUE"),
        ("time.step_s=0.5", "--beside is time.step_s=0.5, want a key that is not of `time`"),
    ] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_yawara"));
        let output = command.args(["view", "beam", "--beside", beside]).output().unwrap();
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!((output.status.code(), &output.stdout[..]), (Some(2), &b""[..]), "{message}");
        assert!(message.contains(want) && message.matches('\n').count() == 1, "{message}");
    }
}

#[test]
fn one_hand_pulls_two_livers_and_their_difference_is_shown() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(page) = Browser::open(1400, 760) else { return };
    let folder = tempfile::tempdir().unwrap();
    let kept = folder.path().join("kept");
    // One that is not refined, of a parenchyma twice as stiff.
    let beside = ["materials.0.young_modulus_pa=1e4", "mesh.max_level=0"];
    let arguments =
        ["liver", "--beside", beside[0], "--beside", beside[1], "--out", kept.to_str().unwrap()];
    let view = View::start(&arguments);
    page.go(&view.url);
    page.wait(READY);
    page.wait(BOTH);
    assert_eq!(page.run("return yawara.body.is_alike"), true);
    let names = page.run("return [...document.querySelectorAll('.name')].map((x) => x.innerText)");
    assert_eq!(names, json!(["as it is", beside.join(", ")]));
    let at_rest = ["view", "view_beside"].map(|id| stage(&page, id));
    assert!(at_rest.iter().all(|one| one.count(|[r, _, b]| b > r + 25) > 100), "no vessels");

    page.run(
        "window.felt = [{}, {}]; window.uneven = 0;
         setInterval(() => {
           const both = [yawara.last, yawara.last.beside];
           both.forEach((one, i) => { felt[i][one.step] = one.force_n; });
           uneven += both[0].step !== both[1].step || both[0].time_s !== both[1].time_s;
         }, 4)",
    );
    let from = pair(&page.run(LOBE));
    let way: Vec<[f64; 2]> =
        (1..=10).map(|i| [from[0] + 3.0 * f64::from(i), from[1] - 8.0 * f64::from(i)]).collect();
    page.drag(from, &way);
    page.wait("yawara.last.tools.length === 1 && yawara.last.tools[0].force_n[2] > 0.3");
    page.wait(
        "Math.hypot(...yawara.last.beside.force_n) > 1.4 * Math.hypot(...yawara.last.force_n)",
    );
    page.wait("yawara.last.vertices > 760");
    page.run("document.getElementById('pause').click()");
    page.wait("yawara.state.paused && !yawara.body.is_stale && !yawara.beside.is_stale");
    // Led to the same place, to the last bit.
    let places = "[yawara.last, yawara.last.beside].map((one) => one.tools[0].reference_mm)";
    let places = page.run(&format!("return {places}"));
    assert_eq!(places[0], places[1]);
    assert_eq!(page.run("return yawara.last.beside.vertices"), 736);
    let forces = page.run("return [yawara.last.force_n, yawara.last.beside.force_n]");
    let size = |of: &dyn Fn(usize) -> f64| (0..3).map(|k| of(k).powi(2)).sum::<f64>().sqrt();
    let first = size(&|k| number(&forces[0][k]));
    let away = size(&|k| number(&forces[0][k]) - number(&forces[1][k]));
    let words = |id: &str| {
        page.run(&format!("return document.getElementById('{id}').innerText")).to_string()
    };
    assert_eq!(words("force"), format!("\"{first:.3} N\""));
    let second = size(&|k| number(&forces[1][k]));
    assert_eq!(words("force_beside"), format!("\"{second:.3} N\""));
    assert!(words("force_difference").starts_with(&format!("\"{away:.3} N (")), "{away}");
    assert!(words("n_vertices").ends_with("| 736\""));
    let curve = page.run("return document.querySelector('.plot').innerText").to_string();
    assert!(curve.contains("beside"), "{curve}");

    // The difference of displacement, from what both have been sent.
    let most = page.run(
        "const select = document.getElementById('colour');
         select.value = 'difference';
         select.dispatchEvent(new Event('change'));
         const [a, b] = [yawara.body, yawara.beside];
         const [u, v] = [a, b].map((one) => Array.from(one.surfaces[0].moved, (x) => x * one.quantum));
         let most = 0;
         for (let i = 0; i < u.length; i += 3) most = Math.max(most, Math.hypot(u[i] - v[i], u[i + 1] - v[i + 1], u[i + 2] - v[i + 2]));
         return [most, a.most, b.most, a.range];",
    );
    let [want, shown] = [number(&most[0]), number(&most[1])];
    assert!(want > 0.3 && (shown - want).abs() < 1e-5 * want, "{most}");
    assert!(most[1] == most[2] && number(&most[3]) >= shown, "{most}");
    page.wait("!yawara.body.is_stale && !yawara.beside.is_stale");
    assert_eq!(words("what"), "\"difference of displacement, mm\"");
    // The lobe is where they differ most: both have the bright end of the scale, and most of both the dark one.
    for id in ["view", "view_beside"] {
        let picture = stage(&page, id);
        let is_dark = |[r, g, b]: [i32; 3]| b > g + 15 && b > r + 10;
        let is_bright = |[r, g, b]: [i32; 3]| g > b + 40 && g > r - 40;
        let [dark, bright] = [picture.count(is_dark), picture.count(is_bright)];
        assert!(bright > 50 && dark > bright, "{id}: {dark} {bright}");
    }

    // The same camera, and below one another on a narrow screen.
    let corners = "[yawara.body, yawara.beside].map((one) => one.project([-60, 45, 25]))";
    let before = page.run(&format!("return {corners}"));
    page.run(
        "const view = document.getElementById('view');
         view.focus();
         view.dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowUp', bubbles: true }));",
    );
    page.let_go();
    page.run("document.querySelector('input[value=look]').click()");
    let corner = pair(&page.run(
        "const { left, top } = document.getElementById('view_beside').getBoundingClientRect();
         return [left + 40, top + 200]",
    ));
    page.drag(corner, &[[corner[0] + 60.0, corner[1]]]);
    page.let_go();
    page.wait("!yawara.body.is_stale && !yawara.beside.is_stale");
    let after = page.run(&format!("return {corners}"));
    assert_eq!(after[0], after[1]);
    assert!((number(&after[0][0]) - number(&before[0][0])).abs() > 3.0, "{before} {after}");
    page.emulate(360, false);
    page.wait("yawara.beside.canvas.getBoundingClientRect().left === 0 && !yawara.beside.is_stale");
    let narrow = page.run(
        "const [a, b] = [yawara.body, yawara.beside].map((one) => one.canvas.getBoundingClientRect());
         return [b.top >= a.bottom, b.height > 150, document.documentElement.scrollWidth <= 360]",
    );
    assert_eq!(narrow, json!([true, true, true]));

    // Both are kept, and run again to the same forces.
    page.run("document.getElementById('save').click()");
    page.wait("document.getElementById('command').textContent.includes('002')");
    let felt = page.run("return felt");
    for (i, name) in ["001", "002"].into_iter().enumerate() {
        runs_again(&kept.join(name).join("run"), &felt[i]);
    }
    assert_eq!(page.run("return uneven"), 0);
}

#[test]
fn a_step_that_fails_beside_is_red_and_bodies_that_can_not_be_compared_are_said_to_be() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(page) = Browser::open(1100, 760) else { return };
    let beside = ["--beside", "image.voxel_mm=4.0", "--beside", "solver.step_iterations=1"];
    let stages = ["--beside", "solver.residual=1e-12"];
    let view = View::start(&[&["beam", "--play"], &beside[..], &stages[..]].concat());
    page.go(&view.url);
    page.wait(READY);
    page.wait("yawara.last.step > 0 && !yawara.last.beside.converged");
    page.run("document.getElementById('pause').click()");
    page.wait("yawara.state.paused && !yawara.body.is_stale && !yawara.last.beside.converged");
    assert_eq!(page.run("return yawara.last.converged"), true);
    let status = page.run(
        "const status = document.getElementById('status');
         return [status.className, status.innerText, [...document.querySelectorAll('.name')].map((x) => x.classList.contains('bad'))]",
    );
    let text = status[1].as_str().unwrap();
    assert!(status[0] == "bad" && text.contains("did not converge beside"), "{status}");
    assert_eq!(status[2], json!([false, true]));
    let option = "document.querySelector('#colour [value=difference]').disabled";
    assert_eq!(page.run(&format!("return {option}")), true);
    let warnings = page.run("return document.getElementById('warnings').innerText").to_string();
    assert!(warnings.contains("no difference of displacement"), "{warnings}");
    // What is changed from the page is changed in both, but not what is set beside.
    page.run(
        "yawara.socket.send(JSON.stringify({ do: 'set', changes: ['solver.residual=1e-5', 'stages.corotation=row'] }))",
    );
    page.wait("yawara.state.generation === 2 && yawara.last.generation === 2");
    let choices = page.run(
        "return [yawara.state.plan, yawara.state.beside.plan].map((plan) => plan.find((row) => row.stage === 'corotation').choice)",
    );
    assert_eq!(choices, json!(["row", "row"]));
}

/// A cube of 0.1 m in five tetrahedra of two labels, whose left side is fixed.
fn cube(folder: &Path) -> PathBuf {
    let nodes =
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];
    let nodes: String = (1..)
        .zip(nodes)
        .map(|(i, x)| format!("{i} {}\n", x.map(|x: i32| (100 * x).to_string()).join(" ")))
        .collect();
    let mesh = format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n8\n{nodes}$EndNodes\n$Elements\n5\n\
         1 4 2 3 1 1 2 3 6\n2 4 2 3 1 1 3 4 8\n3 4 2 3 1 1 6 8 5\n4 4 2 4 1 3 6 7 8\n5 4 2 4 1 1 3 8 6\n\
         $EndElements\n"
    );
    let file = folder.join("cube.msh");
    fs::write(&file, mesh).unwrap();
    let scene = r#"
        name = "cube"
        [[materials]]
        label = 3
        young_modulus_pa = 5e3
        poisson_ratio = 0.3
        density_kg_m3 = 1000
        [[materials]]
        label = 4
        young_modulus_pa = 5e3
        poisson_ratio = 0.3
        density_kg_m3 = 1000
        [mesh]
        path = FILE
        [[fixed]]
        shape = "box"
        min = [0.0, 0.0, 0.0]
        max = [0.1, 1.0, 1.0]
        [support]
        hold = "vertices"
        [time]
        steps = 1
        step_s = 0.01
    "#;
    let scene = scene.replace("FILE", &format!("{file:?}"));
    fs::write(folder.join("cube.toml"), scene).unwrap();
    folder.join("cube.toml")
}

#[test]
fn bodies_of_mesh_files_go_beside_each_other_led_from_the_second_picture() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(page) = Browser::open(1400, 760) else { return };
    let folder = tempfile::tempdir().unwrap();
    let scene = cube(folder.path());
    let stiffer = ["materials.0.young_modulus_pa=1e4", "materials.1.young_modulus_pa=1e4"];
    let beside = ["--beside", stiffer[0], "--beside", stiffer[1]];
    let view = View::start(&[&[scene.to_str().unwrap()][..], &beside].concat());
    page.go(&view.url);
    page.wait(READY);
    page.wait(BOTH);
    let option = "document.querySelector('#colour [value=difference]').disabled";
    assert_eq!(page.run(&format!("return {option}")), true);
    let from = pair(&page.run(
        "const { low, high } = yawara.body.box;
         const at = [low[0] + 0.8 * (high[0] - low[0]), high[1], 0.5 * (low[2] + high[2])];
         const [x, y] = yawara.beside.project(at);
         const place = document.getElementById('view_beside').getBoundingClientRect();
         return [place.left + x, place.top + y]",
    ));
    page.drag(from, &[[from[0] + 40.0, from[1]]]);
    page.wait(
        "[yawara.last, yawara.last.beside].every((one) => Math.hypot(...one.force_n) > 0.05)",
    );
    page.run("document.getElementById('pause').click()");
    page.wait("yawara.state.paused && !yawara.body.is_stale && !yawara.beside.is_stale");
    let both = page.run(
        "return [yawara.last, yawara.last.beside].map((one) => [one.tools[0].reference_mm, Math.hypot(...one.force_n)])",
    );
    assert_eq!(both[0][0], both[1][0], "led to the same place");
    // Linear but for what turns: twice the modulus is twice the force.
    let ratio = number(&both[1][1]) / number(&both[0][1]);
    assert!((1.9..2.1).contains(&ratio), "{both}");
    // Without voxels a cut has the labels of its tetrahedra.
    page.run("document.getElementById('cut').click()");
    page.wait("!yawara.body.is_stale && !yawara.beside.is_stale");
    let cut = page.run(
        "return [yawara.body, yawara.beside].map((one) => {
           const { array, count } = one.cut.mesh.geometry.attributes.color;
           return [count > 9, new Set(Array.from({ length: count }, (_, i) => array.slice(3 * i, 3 * i + 3).join())).size];
         })",
    );
    assert_eq!(cut, json!([[true, 2], [true, 2]]));
}
