//! `yawara preview`: the picture shows what is held where it is, with the amounts of the plan.

use crate::workbench;

use serde_json::Value;
use workbench::{BAR, Workbench};
use yawara::scene_file;

/// The bar fixed in its left quarter and grabbed in its right one.
fn bench() -> Workbench {
    let bench = Workbench::new();
    let text = BAR.replace("max = [0, 1, 1]", "max = [0.25, 1, 1]");
    bench.write("bar.toml", text.replace("min = [1, 0, 0]", "min = [0.75, 0, 0]"));
    bench
}

/// Width, height and pixels.
fn decoded(bench: &Workbench, name: &str) -> (usize, usize, Vec<u8>) {
    let file = std::io::BufReader::new(std::fs::File::open(bench.path(name)).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Rgb, png::BitDepth::Eight));
    (info.width as usize, info.height as usize, pixels)
}

#[test]
fn colours_are_where_matter_is_held() {
    let bench = bench();
    bench.succeed(&["preview", "bar.toml", "--out", "bar.png"]);
    let (width, height, pixels) = decoded(&bench, "bar.png");
    // The left of the patient is at the right of the two views from below and from the front; the
    // third is from the left.
    let (mut fixed, mut tool) = ([0; 5], [0; 5]);
    for y in 0..height - 220 {
        for x in 0..width {
            let at = 3 * (y * width + x);
            let [r, g, b] = [0, 1, 2].map(|i| i32::from(pixels[at + i]));
            let half = [245, 490, 735, 980].into_iter().filter(|&end| x >= end).count();
            fixed[half] += i32::from(b > r + 50);
            tool[half] += i32::from(r > g + 70 && r > b + 70);
        }
    }
    let least = 2000;
    let has = |count: [i32; 5]| count.map(|n| n > least);
    assert_eq!(has(fixed), [false, true, false, true, true], "{fixed:?}");
    assert_eq!(has(tool), [true, false, true, false, false], "{tool:?}");
    assert_eq!([fixed[0], fixed[2], tool[1], tool[3]], [0; 4]);
}

#[test]
fn amounts_are_those_of_the_plan() {
    let bench = bench();
    let said = bench.succeed(&["preview", "bar.toml", "--out", "bar.png", "--json"]);
    let all: Value = serde_json::from_str(&said).unwrap();
    // A quarter of 8 x 4 x 4 voxels of 5 mm.
    for (i, key) in ["fixed[0]", "tools[0]"].into_iter().enumerate() {
        let one = &all["holdings"][i];
        assert_eq!((&one["key"], &one["voxels"]), (&key.into(), &32.into()), "{said}");
        assert!((one["volume_cm3"].as_f64().unwrap() - 4.0).abs() < 1e-12, "{said}");
    }
    let shown = bench.succeed(&["preview", "bar.toml", "--out", "bar.png"]);
    for vertices in ["", "vertices"] {
        let set = ["--set", "support.hold=vertices", "--set", "tools.0.hold=vertices"];
        let set = if vertices.is_empty() { &set[..0] } else { &set[..] };
        let plan = bench.succeed(&[&["plan", "bar.toml"][..], set].concat());
        let shown = match vertices {
            "" => shown.clone(),
            _ => bench.succeed(&[&["preview", "bar.toml", "--out", "v.png"][..], set].concat()),
        };
        assert!(shown.contains(vertices));
        for line in shown.lines().filter(|line| !line.starts_with("written")) {
            let words: Vec<&str> = line.split_whitespace().collect();
            let skipped = if words[0].starts_with("fixed") { 1 } else { 2 };
            let want = format!("{}: {}", words[0], words[skipped..].join(" "));
            assert!(plan.contains(&want), "no {want:?} in {plan}");
        }
    }
}

#[test]
fn every_built_in_scene_without_a_file_has_a_picture() {
    let bench = Workbench::new();
    for (name, text) in scene_file::built_in() {
        if text.contains("phantom") {
            let said = bench.succeed(&["preview", name, "--out", "one.png"]);
            assert!(said.contains("written to one.png"), "{name}: {said}");
            assert_eq!(decoded(&bench, "one.png").0, 1280, "{name}");
        }
    }
}

#[test]
fn what_can_not_be_drawn_or_written_is_refused() {
    let bench = bench();
    std::fs::create_dir(bench.path("folder.png")).unwrap();
    for (arguments, words) in [
        (["bar.toml", "--out", "folder.png"], &["--out is folder.png", "a file in a folder"][..]),
        (["bar.toml", "--out", "nowhere/bar.png"], &["--out is nowhere/bar.png"]),
        (["bar.toml", "--out", "bar.jpg"], &["--out is bar.jpg", ".png"]),
        (["none.toml", "--out", "bar.png"], &["none.toml"]),
        ([".", "--out", "bar.png"], &["."]),
    ] {
        bench.refused(&[&["preview"][..], &arguments].concat(), words);
    }
}

#[test]
fn a_region_within_an_earlier_one_holds_nothing_more() {
    let whole = "{ shape = 'box', min = [0, 0, 0], max = [0.3, 1, 1] }";
    let within = "{ shape = 'box', min = [0, 0, 0], max = [0.1, 1, 1] }";
    let (scene, _) = scene_file::load("beam", &[format!("fixed=[{whole}, {within}]")]).unwrap();
    let preview = yawara::preview::Preview::new(&scene).unwrap();
    let [first, second] = [0, 1].map(|i| &preview.holdings()[i]);
    assert!(first.voxels > Some(0), "{first:?}");
    assert_eq!((second.voxels, second.volume_cm3), (Some(0), Some(0.0)));
}
