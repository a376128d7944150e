//! Places of a scene, given as fractions of the body's box, in mm or as voxels of the image file.

#![cfg(feature = "nifti")]

use crate::workbench;

use workbench::{BAR, Nifti, Workbench};

/// Voxels along each axis of the file.
const N: f64 = 8.0;

/// A solid cube of 8 x 8 x 8 stored voxels, however it lies in the scanner.
struct Stored {
    name: &'static str,
    /// Steps along the file's axes, mm.
    columns: [[f64; 3]; 3],
    /// Body axis i runs along the file's axis `axes[i].0`, backwards if `axes[i].1`.
    axes: [(usize, bool); 3],
    /// Whether the scanner's axes are the body's.
    straight: bool,
}

/// Where the centre of the first stored voxel is, mm.
const FIRST: [f64; 3] = [10.0, -20.0, 30.0];

const STORED: [Stored; 4] = [
    Stored {
        name: "in the body's order",
        columns: [[5.0, 0.0, 0.0], [0.0, 5.0, 0.0], [0.0, 0.0, 5.0]],
        axes: [(0, false), (1, false), (2, false)],
        straight: true,
    },
    Stored {
        name: "turned and flipped",
        columns: [[0.0, -5.0, 0.0], [0.0, 0.0, 5.0], [-5.0, 0.0, 0.0]],
        axes: [(2, true), (0, true), (1, false)],
        straight: true,
    },
    Stored {
        name: "resampled and flipped",
        columns: [[-5.0, 0.0, 0.0], [0.0, 5.0, 0.0], [0.0, 0.0, 10.0]],
        axes: [(0, true), (1, false), (2, false)],
        straight: true,
    },
    Stored {
        name: "oblique",
        columns: [[4.0, 3.0, 0.0], [-3.0, 4.0, 0.0], [0.0, 0.0, -5.0]],
        axes: [(0, false), (1, false), (2, true)],
        straight: false,
    },
];

impl Stored {
    fn file(&self) -> Vec<u8> {
        let mut image = Nifti::cube(1);
        for axis in 0..3 {
            let edge = self.columns[axis].iter().map(|x| x * x).sum::<f64>().sqrt();
            image.f32(80 + 4 * axis, edge as f32);
            for ras in 0..3 {
                image.f32(280 + 16 * ras + 4 * axis, self.columns[axis][ras] as f32);
            }
            image.f32(292 + 16 * axis, FIRST[axis] as f32);
        }
        image.bytes().to_vec()
    }

    fn mm(&self, voxel: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|ras| {
            FIRST[ras] + (0..3).map(|axis| voxel[axis] * self.columns[axis][ras]).sum::<f64>()
        })
    }

    fn fractions(&self, voxel: [f64; 3]) -> [f64; 3] {
        self.axes.map(|(axis, backwards)| {
            let at = (voxel[axis] + 0.5) / N;
            if backwards { 1.0 - at } else { at }
        })
    }
}

/// The keys `low` and `high` of two corners, the lower values first.
fn corners(suffix: &str, a: [f64; 3], b: [f64; 3]) -> String {
    let low = [0, 1, 2].map(|i| a[i].min(b[i]));
    let high = [0, 1, 2].map(|i| a[i].max(b[i]));
    format!("min{suffix} = {low:?}, max{suffix} = {high:?}")
}

/// A scene of a fixed box, a grab of a ball and a probe beside it.
fn scene(fixed: &str, grab: &str, probe: &str) -> String {
    let (head, _) = BAR.split_once("[[fixed]]").unwrap();
    let tail = BAR.split_once("[time]").unwrap().1;
    let head = head.replace("phantom = \"block\"\nsize_mm = [40, 20, 20]\nvoxel_mm = 5", "");
    let head = head.replace("[image]", "fixed = [{ shape = \"box\", FIXED }]\n[image]");
    let head = head.replace("FIXED", fixed).replace("[image]", "[image]\npath = \"cube.nii\"");
    format!(
        "{head}\n[[tools]]\nkind = \"grab\"\nregion = {{ shape = \"sphere\", {grab}, radius_m = 0.012 }}\n\
         path = [{{ time_s = 0 }}, {{ time_s = 0.3, move_m = [0.002, 0, 0.003] }}]\n\
         [[tools]]\nkind = \"probe\"\n{probe}\nradius_m = 0.0085\n\
         path = [{{ time_s = 0 }}, {{ time_s = 0.3, move_m = [0.001, 0, 0.001] }}]\n[time]{tail}"
    )
}

/// `steps.csv` without the columns of times.
fn rows(bench: &Workbench) -> String {
    let table = bench.read("runs/bar/steps.csv");
    let is_time: Vec<bool> =
        table.lines().next().unwrap().split(',').map(|name| name.ends_with("_ms")).collect();
    let kept = |line: &str| -> String {
        let cells = line.split(',').zip(&is_time);
        cells.filter(|(_, is_time)| !**is_time).map(|(cell, _)| format!("{cell},")).collect()
    };
    table.lines().map(|line| kept(line) + "\n").collect()
}

/// The steps of a scene's run, and the scene that its folder has.
fn steps(bench: &Workbench, text: &str) -> (String, String) {
    bench.write("bar.toml", text);
    bench.succeed(&["run", "bar.toml", "--force"]);
    (rows(bench), bench.read("runs/bar/scene.toml"))
}

#[test]
fn the_three_ways_give_the_same_run() {
    // Along the file's axes: what is fixed, the middle of the grab, and of the ball in the air.
    let (first, last) = ([0.0; 3], [7.0, 7.0, 1.0]);
    let (held, ball) = ([3.0, 5.0, 6.0], [3.5, -2.0, 4.0]);
    let outer = [first.map(|x| x - 0.5), last.map(|x| x + 0.5)];
    for stored in &STORED {
        let bench = Workbench::new();
        bench.write("cube.nii", stored.file());
        let [low, high] = outer.map(|x| stored.fractions(x));
        let (f, m) = (|x| stored.fractions(x), |x| stored.mm(x));
        let by_fractions = scene(
            &corners("", low, high),
            &format!("centre = {:?}", f(held)),
            &format!("centre = {:?}", f(ball)),
        );
        let by_voxels = scene(
            &corners("_voxel", first, last),
            &format!("centre_voxel = {held:?}"),
            &format!("centre_voxel = {ball:?}"),
        );
        // Along the scanner's axes an oblique box is another.
        let fixed = match stored.straight {
            true => corners("_mm", m(outer[0]), m(outer[1])),
            false => corners("", low, high),
        };
        let by_mm = scene(
            &fixed,
            &format!("centre_mm = {:?}", m(held)),
            &format!("centre_mm = {:?}", m(ball)),
        );
        let (want, _) = steps(&bench, &by_fractions);
        for (way, text) in [("_voxel", by_voxels), ("_mm", by_mm)] {
            let (found, kept) = steps(&bench, &text);
            assert!(found == want, "{}: {way}\n{found}\n{want}", stored.name);
            // What was written is kept, and runs again.
            assert!(kept.contains(&format!("centre{way} = ")), "{kept}");
            assert!(!kept.contains("centre = "), "{kept}");
            assert!(steps(&bench, &kept).0 == want, "{}: {way}, again", stored.name);
        }
    }
}

#[test]
fn an_oblique_box_in_mm_is_the_box_around_its_corners() {
    let bench = Workbench::new();
    let stored = &STORED[3];
    bench.write("cube.nii", stored.file());
    let middle = stored.mm([3.5, 3.5, 7.0]);
    // 10 mm wide along the scanner's axes: 14 mm along those of the image, at 37 degrees to them.
    let [a, b] = [-5.0, 5.0].map(|off| middle.map(|x| x + off));
    let grab = "centre_voxel = [3, 5, 1]";
    let probe = "centre_voxel = [3.5, -2, 4]";
    let (found, _) = steps(&bench, &scene(&corners("_mm", a, b), grab, probe));
    let around = |side: f64| [0.5 + side * 7.0 / 40.0, 0.5 + side * 7.0 / 40.0];
    let ([x0, y0], [x1, y1]) = (around(-1.0), around(1.0));
    let z = [-2.5 / 40.0, 7.5 / 40.0];
    let (want, _) =
        steps(&bench, &scene(&corners("", [x0, y0, z[0]], [x1, y1, z[1]]), grab, probe));
    assert!(found == want, "{found}\n{want}");
}

#[test]
fn voxels_of_a_phantom_are_those_of_its_grid() {
    let bench = Workbench::new();
    bench.write("bar.toml", BAR);
    bench.succeed(&["run", "bar.toml"]);
    let want = rows(&bench);
    bench.write(
        "bar.toml",
        BAR.replace(
            "{ shape = \"box\", min = [1, 0, 0], max = [1, 1, 1] }",
            "{ shape = \"box\", min_mm = [20, -10, -10], max_mm = [20, 10, 10] }",
        ),
    );
    bench.succeed(&["run", "bar.toml", "--force"]);
    assert_eq!(rows(&bench), want);
    let by =
        |region: &str| BAR.replace("{ shape = \"box\", min = [1, 0, 0], max = [1, 1, 1] }", region);
    let [a, b] =
        ["min = [0.875, 0, 0], max = [1, 1, 1]", "min_voxel = [7, 0, 0], max_voxel = [7, 3, 3]"]
            .map(|ends| {
                bench.write("bar.toml", by(&format!("{{ shape = \"box\", {ends} }}")));
                bench.succeed(&["run", "bar.toml", "--force"]);
                rows(&bench)
            });
    assert_eq!(a, b);
}

#[test]
fn a_place_is_given_once_and_on_the_body() {
    let bench = Workbench::new();
    bench.write("bar.toml", BAR);
    let region = |text: &str| format!("tools.0.region={{ shape = {text} }}");
    for (text, words) in [
        (
            "'sphere', radius_m = 0.01, centre = [1, 1, 1], centre_mm = [0, 0, 0]",
            &[
                "tools[0].region.centre_mm is [0.0, 0.0, 0.0]",
                "no such key beside centre",
                "centre_voxel",
            ][..],
        ),
        (
            "'sphere', radius_m = 0.01",
            &["tools[0].region.centre is missing", "centre_mm (scanner RAS mm)", "centre_voxel"],
        ),
        (
            "'box', min = [0, 0, 0], max_mm = [1, 1, 1]",
            &["tools[0].region.max_mm", "max beside min", "both corners in one way"],
        ),
        (
            "'box', min_voxel = [0, 0, 0], max_voxel = [1, 1, nan]",
            &["tools[0].region.max_voxel[2] is NaN", "finite"],
        ),
        (
            "'box', min_mm = [30, 0, 0], max_mm = [40, 1, 1]",
            &[
                "tools[0].region.min_mm is outside of the body",
                "[-20.0, -10.0, -10.0] to [20.0, 10.0, 10.0] mm",
            ],
        ),
        (
            "'sphere', radius_m = 0.01, centre_voxel = [3, 3, 200]",
            &["tools[0].region.centre_voxel is outside of the body", "mm"],
        ),
    ] {
        bench.refused(&["run", "bar.toml", "--set", &region(text)], words);
    }
}
