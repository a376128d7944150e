//! Tools that do nothing are told in the plan and the summary; contradictions are refused.

use crate::workbench;

use workbench::{BAR, Workbench};

/// The bar with tools of its own after its grab.
fn bar_with(tools: &str) -> Workbench {
    let bench = Workbench::new();
    bench.write("bar.toml", format!("{BAR}\n{tools}"));
    bench
}

/// Plan and summary must say `words`; the run goes on.
fn warned(tools: &str, words: &str) {
    let bench = bar_with(tools);
    let plan = bench.succeed(&["plan", "bar.toml"]);
    assert!(plan.contains("WARNING: ") && plan.contains(words), "{plan}");
    let output = bench.run(&["run", "bar.toml", "--out", "out"]);
    let text = String::from_utf8(output.stdout).unwrap();
    let warnings = text.lines().filter(|line| line.starts_with("warning"));
    assert!(warnings.collect::<String>().contains(words), "{text}");
    assert!(bench.read("out/summary.json").contains(words));
}

fn refused(tools: &str, words: &[&str]) {
    bar_with(tools).refused(&["run", "bar.toml", "--out", "out"], words);
}

fn probe(centre: &str) -> String {
    let keys = "kind = \"probe\"\nradius_m = 0.005\npath = [{ time_s = 0 }]";
    format!("[[tools]]\n{keys}\ncentre = {centre}\n")
}

#[test]
fn a_scene_whose_tools_all_act_has_no_warning() {
    let bench = bar_with("");
    assert!(!bench.succeed(&["plan", "bar.toml"]).contains("WARNING"));
    assert!(!bench.succeed(&["run", "bar.toml", "--out", "out"]).contains("warning"));
    assert!(!bench.read("out/summary.json").contains("\"warnings\""));
}

#[test]
fn a_probe_that_touches_nothing() {
    warned(&probe("[0.5, 0.5, 3.0]"), "tools[1] stays 35.000 mm or more away");
    // The block is 20 mm high, so that its end may reach it, but does not.
    warned(&probe("[0.0, 0.5, 1.4]"), "tools[1] stays 3.000 mm or more away");
}

#[test]
fn a_probe_that_begins_inside() {
    refused(&probe("[0.5, 0.5, 0.5]"), &["tools[1].centre", "[0.5, 0.5, 0.5]", "outside"]);
}

#[test]
fn a_grab_of_what_is_fixed() {
    let tool = "[[tools]]\nkind = \"grab\"\npath = [{ time_s = 0 }]\n\
                region = { shape = \"box\", min = [0, 0, 0], max = [0, 1, 1] }";
    warned(tool, "tools[1] grabs nothing but what [[fixed]] holds");
}

#[test]
fn grabs_of_the_same_material() {
    let grab = |low: f64| {
        format!(
            "[[tools]]\nkind = \"grab\"\npath = [{{ time_s = 0 }}]\n\
             region = {{ shape = \"box\", min = [{low:?}, 0, 0], max = [1, 1, 1] }}"
        )
    };
    refused(&grab(1.0), &["tools[1].region", "tools[0]", "one grab"]);
    let twice = format!("{}\n{}", grab(0.75), grab(0.5));
    let plan = bar_with(&twice).succeed(&["plan", "bar.toml"]);
    assert!(plan.contains("tools[2] grabs material that tools[1] has too"), "{plan}");
}

#[test]
fn a_tool_that_lets_go_before_it_begins() {
    for release in ["-1", "0"] {
        let set = format!("tools.0.release_s={release}");
        let command = ["run", "bar.toml", "--out", "out", "--set", &set];
        let said = format!("tools[0].release_s is {release}.0, want");
        bar_with("").refused(&command, &[&said, "after the start"]);
    }
}

#[test]
fn loads_of_nothing() {
    let pressure = "[[tools]]\nkind = \"pressure\"\npressure = [{ time_s = 0, pressure_pa = 0 }]\n\
                    region = { shape = \"box\", min = [0, 0, 0], max = [1, 1, 1] }";
    warned(pressure, "tools[1] is a pressure of 0 Pa");
    let load = "[[tools]]\nkind = \"load\"\nload = [{ time_s = 0, force_n = [0, 0, 0] }]\n\
                region = { shape = \"box\", min = [0, 0, 0], max = [1, 1, 1] }";
    warned(load, "tools[1] is a load of 0");
}

#[test]
fn points_of_a_probe_are_bounded() {
    let fine = format!("{}spacing_m = 1e-6\n", probe("[0.5, 0.5, 2.0]"));
    refused(&fine, &["spacing_m", "1000000 points"]);
}
