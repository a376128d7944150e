//! A run that is over as a page without a server, and as a scene for other programs.

use std::fs;
use std::path::Path;
use std::sync::PoisonError;

use gltf::Gltf;
use gltf::animation::util::ReadOutputs;
use yawara_mesh::tet_file::{read_vtp_fields, read_vtu_fields};

use super::browser::Browser;
use super::playback::{Finished, replace, shows_force};
use super::{ALONE, COLOURS, READY, number};

pub fn exported(finished: &Finished, arguments: &[&str]) -> String {
    let output = finished.yawara(&[&["export", "over"], arguments].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn a_page_alone_plays_the_run_without_server_and_network() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(page) = Browser::open(1100, 760) else { return };
    let finished = Finished::liver();
    // Names that would be elements of the page.
    let (scene, vessels) = ("</script><!--<script><b id='bad'>liver", "<i id='bad'>vessels");
    let text = finished.run().join("scene.toml");
    replace(&text, "name = \"liver\"", &format!("name = \"{scene}\""));
    replace(&text, "name = \"vessels\"", &format!("name = \"{vessels}\""));
    let said = exported(&finished, &["--html", "alone.html"]);
    let file = finished.path("alone.html");
    assert!(fs::metadata(&file).unwrap().len() < 10_000_000, "{said}");
    let whole = fs::read(&file).unwrap();
    exported(&finished, &["--html", "alone.html"]);
    assert!(fs::read(&file).unwrap() == whole, "the same run, the same bytes");
    page.devtools("Network.enable", &serde_json::json!({}));
    let none = serde_json::json!({
        "offline": true, "latency": 0, "downloadThroughput": 0, "uploadThroughput": 0,
    });
    page.devtools("Network.emulateNetworkConditions", &none);
    page.go(&format!("file://{}", file.display()));
    page.wait(READY);
    page.wait("yawara.clock && yawara.body.surfaces.length === 2");
    let words = page.run(
        "return [document.getElementById('scene'), document.getElementById('legend').lastChild].map((one) => one.textContent)",
    );
    assert_eq!(words, serde_json::json!([scene, vessels]));
    assert_eq!(page.run("return document.getElementById('bad')"), serde_json::Value::Null);
    // Nothing but the page itself, and modules that are in it.
    let loaded = page.run(
        "return performance.getEntriesByType('resource').map((one) => one.name).filter((name) => !name.startsWith('data:'))",
    );
    assert_eq!(loaded, serde_json::json!([]));
    page.run("const seek = document.getElementById('seek'); seek.value = 3; seek.dispatchEvent(new Event('input'))");
    page.wait("yawara.last.step === 6 && !yawara.body.is_stale");
    shows_force(&page, finished.force(6));
    let colours = page.run(COLOURS);
    assert!(number(&colours["body"]) > 10_000.0 && number(&colours["blue"]) > 100.0, "{colours}");
    // As far from the run's own file as was said.
    let bound: f64 = said.split(" mm").next().unwrap().rsplit(' ').next().unwrap().parse().unwrap();
    let shown =
        page.run("return [...yawara.body.surfaces[1].mesh.geometry.attributes.position.array]");
    let read = read_vtp_fields(&finished.run().join("frames/step_000006_label_2.vtp")).unwrap();
    let points = read.points.as_flattened();
    assert_eq!(shown.as_array().unwrap().len(), points.len());
    let off = points.iter().enumerate().map(|(i, x)| (x - number(&shown[i])).abs());
    let off = off.fold(0.0, f64::max);
    // And two roundings of 32-bit floats.
    assert!(off <= bound * 1.05 + 2e-5 && off > 0.0, "{off} mm, said {bound}");
}

/// The positions of a mesh in a frame, from its own vertices and the targets weighed as the animation says.
pub fn positions(scene: &Gltf, mesh: usize, frame: usize) -> Vec<[f64; 3]> {
    let blob = scene.blob.as_deref().unwrap();
    let mesh = scene.meshes().nth(mesh).unwrap();
    let primitive = mesh.primitives().next().unwrap();
    let reader = primitive.reader(|_| Some(blob));
    let mut at: Vec<[f64; 3]> =
        reader.read_positions().unwrap().map(|x| x.map(f64::from)).collect();
    let animation = scene.animations().next().unwrap();
    let of_mesh = |channel: &gltf::animation::Channel<'_>| {
        channel.target().node().mesh().is_some_and(|one| one.index() == mesh.index())
    };
    let channel = animation.channels().find(of_mesh).unwrap();
    if let ReadOutputs::MorphTargetWeights(weights) =
        channel.reader(|_| Some(blob)).read_outputs().unwrap()
    {
        let weights: Vec<f32> = weights.into_f32().collect();
        let count = primitive.morph_targets().count();
        for (target, (moved, _, _)) in reader.read_morph_targets().enumerate() {
            let weight = f64::from(weights[frame * count + target]);
            for (x, u) in at.iter_mut().zip(moved.unwrap()) {
                (0..3).for_each(|axis| x[axis] += weight * f64::from(u[axis]));
            }
        }
    }
    at
}

pub fn farthest(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    assert_eq!(a.len(), b.len());
    let both = a.as_flattened().iter().zip(b.as_flattened());
    both.fold(0.0, |most, (a, b)| most.max((a - b).abs()))
}

pub fn open(path: &Path) -> Gltf {
    Gltf::from_slice(&fs::read(path).unwrap()).unwrap()
}

#[test]
fn a_scene_has_the_surfaces_of_every_frame() {
    let finished = Finished::liver();
    exported(&finished, &["--gltf", "run.glb"]);
    let scene = open(&finished.path("run.glb"));
    let names: Vec<_> = scene.meshes().map(|mesh| mesh.name().unwrap().to_owned()).collect();
    assert_eq!(names, ["skin", "vessels"]);
    let blob = scene.blob.as_deref().unwrap();
    let animation = scene.animations().next().unwrap();
    let reader = animation.channels().next().unwrap();
    let times: Vec<f32> = reader.reader(|_| Some(blob)).read_inputs().unwrap().collect();
    assert_eq!(times.len(), 7);
    assert!((times[6] - 0.6).abs() < 1e-6, "{times:?}");
    for (frame, step) in [(0, 0), (3, 6), (6, 12)] {
        for (mesh, end) in ["outline", "label_2"].iter().enumerate() {
            let file = finished.run().join(format!("frames/step_{step:06}_{end}.vtp"));
            let read = read_vtp_fields(&file).unwrap();
            let off = farthest(&positions(&scene, mesh, frame), &read.points);
            // 2⁻²³ (|x| + |u|) of a body within 200 mm.
            assert!(off <= 2.0_f64.powi(-23) * 400.0, "step {step}: {off} mm");
        }
    }
    // Superior is up, anterior is to the front, in metres.
    let turned = scene.nodes().next().unwrap().transform().matrix();
    let to = |axis: usize| [0, 1, 2].map(|row| (turned[axis][row] * 1e3).round());
    assert_eq!([to(0), to(1), to(2)], [[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]);
}

#[test]
fn a_scene_of_a_run_without_outlines_has_the_mesh_of_every_frame() {
    let finished = Finished::new(&["beam", "--steps=6", "--set", "output.outline=false"]);
    exported(&finished, &["--gltf", "run.glb"]);
    let scene = open(&finished.path("run.glb"));
    let last = scene.meshes().count() - 1;
    assert_eq!(scene.meshes().nth(last).unwrap().name(), Some("step 6"));
    let file = finished.run().join("frames/step_000006.vtu");
    let read = read_vtu_fields(&file).unwrap();
    let off = farthest(&positions(&scene, last, last), &read.points);
    assert!(off <= 2.0_f64.powi(-23) * 400.0, "{off} mm");
    // One is shown at a time.
    let blob = scene.blob.as_deref().unwrap();
    let animation = scene.animations().next().unwrap();
    for (mesh, channel) in animation.channels().enumerate() {
        let reader = channel.reader(|_| Some(blob));
        let Some(ReadOutputs::Scales(sizes)) = reader.read_outputs() else { panic!("no scales") };
        for (frame, size) in sizes.enumerate() {
            assert_eq!(size, [f32::from(u8::from(frame == mesh)); 3]);
        }
    }
}

/// Pixels in rows, each red, green, blue.
type Pixels = Vec<u8>;

#[test]
fn a_picture_lasts_as_long_as_asked_and_shows_the_body_move() {
    let finished = Finished::liver();
    exported(&finished, &["--picture", "run.png", "--seconds", "6"]);
    let bytes = fs::read(finished.path("run.png")).unwrap();
    exported(&finished, &["--picture", "run.png", "--seconds", "6"]);
    assert!(fs::read(finished.path("run.png")).unwrap() == bytes, "the same run, the same bytes");
    let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
    let (width, height) = (reader.info().width as usize, reader.info().height as usize);
    assert_eq!(reader.info().animation_control.unwrap().num_frames, 7);
    let mut shown: Pixels = vec![0; 3 * width * height];
    let (mut lasts_ms, mut moments) = (Vec::new(), Vec::<Pixels>::new());
    for _ in 0..7 {
        let mut part = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut part).unwrap();
        let frame = *reader.info().frame_control().unwrap();
        assert_eq!((frame.delay_den, frame.blend_op), (1000, png::BlendOp::Source));
        lasts_ms.push(frame.delay_num);
        let [w, x, y] = [frame.width, frame.x_offset, frame.y_offset].map(|n| n as usize);
        for row in 0..frame.height as usize {
            let at = 3 * ((y + row) * width + x);
            shown[at..at + 3 * w].copy_from_slice(&part[3 * w * row..3 * w * (row + 1)]);
        }
        moments.push(shown.clone());
    }
    // Six intervals of a second each, and the last frame stands as long.
    assert_eq!(lasts_ms, [857; 7]);
    let body = |pixels: &Pixels| {
        pixels.as_chunks::<3>().0.iter().filter(|rgb| rgb[0] > rgb[2].saturating_add(20)).count()
    };
    let vessels = |pixels: &Pixels| {
        pixels.as_chunks::<3>().0.iter().filter(|rgb| rgb[2] > rgb[0].saturating_add(20)).count()
    };
    for pixels in &moments {
        assert!(body(pixels) > 20_000 && vessels(pixels) > 500, "{}", body(pixels));
    }
    let other = |a: &Pixels, b: &Pixels| a.iter().zip(b).filter(|(a, b)| a != b).count();
    assert!(moments.windows(2).all(|two| other(&two[0], &two[1]) > 1000));
    // The start is drawn over all that was shown when the picture begins anew.
    assert!(other(&moments[0], &moments[6]) > 1000);
}

#[test]
fn what_can_not_be_exported_is_refused_and_leaves_nothing() {
    let finished = Finished::new(&["beam", "--steps=2", "--set", "mesh.max_level=3"]);
    fs::create_dir(finished.path("folder.html")).unwrap();
    fs::write(finished.path("old.html"), "old").unwrap();
    let refused = |arguments: &[&str], want: &str| {
        let files = || fs::read_dir(finished.path(".")).unwrap().count();
        let before = files();
        let output = finished.yawara(&[&["export"], arguments].concat());
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains(want) && message.matches('\n').count() == 1, "{message}");
        assert_eq!(files(), before, "{arguments:?}");
    };
    refused(&["over"], "one of --html, --gltf and --picture");
    refused(
        &["over", "--html", "page.htm"],
        "--html is page.htm, want a file name that ends in .html",
    );
    refused(&["over", "--gltf", "scene.gltf"], "ends in .glb");
    refused(&["over", "--picture", "run.gif"], "ends in .png");
    refused(&["over", "--picture", "run.png", "--seconds", "0"], "--seconds is 0, want 0.1 to 60");
    refused(&["over", "--picture", "run.png", "--seconds", "NaN"], "--seconds is NaN");
    refused(&["over", "--html", "page.html", "--seconds", "3"], "--picture");
    refused(&["over", "--html", "none/page.html"], "a file in a folder that exists");
    refused(&["over", "--html", "folder.html"], "a file in a folder that exists");
    refused(&["nowhere", "--html", "page.html"], "nowhere/summary.json");
    // A frame that went after its list was read.
    let frame = finished.run().join("frames/step_000002.vtu");
    fs::write(&frame, "<VTKFile").unwrap();
    refused(&["over", "--html", "old.html", "--gltf", "new.glb"], "step_000002.vtu");
    assert_eq!(fs::read_to_string(finished.path("old.html")).unwrap(), "old");
}
