//! Whole studies, smaller than `--quick`: what they write, and what their figures have to be.

use std::path::{Path, PathBuf};

use serde_json::Value;
use yawara_bench::cases::{Selection, Shard};
use yawara_bench::studies::{
    Arguments, Common, cracks, cut, drift, elements, endurance, estimates, homogenisation,
    identify, meshes, robust, scaling, table1, touch,
};
use yawara_bench::{BenchError, DIRECT};
use yawara_inverse_update::CHOICES;

/// A folder that goes with the test, and a study's path in it.
fn scratch() -> (tempfile::TempDir, Common) {
    let root = tempfile::tempdir().unwrap();
    let common = Common { out: root.path().join("study"), force: false, quick: true };
    (root, common)
}

/// The files of a study: its CSV has a line per row and as many cells in each, the text is what was
/// printed, and JSON has no nulls. Returns the JSON.
fn files(out: &Path, name: &str, printed: &str) -> Value {
    let read = |end: &str| std::fs::read_to_string(out.join(format!("{name}.{end}"))).unwrap();
    assert_eq!(read("md"), printed);
    assert!(!printed.contains("NaN"), "{printed}");
    let json = read("json");
    assert!(!json.contains("null"), "{json}");
    let value: Value = serde_json::from_str(&json).unwrap();
    let csv = read("csv");
    assert_eq!(csv.lines().count(), 1 + rows(&value).len());
    let commas = |line: &str| line.replace("1e3, ", "").matches(',').count();
    let want = csv.lines().next().map(commas);
    assert!(csv.lines().all(|line| Some(commas(line)) == want), "{csv}");
    assert!(!csv.contains("NaN") && !csv.contains("inf"), "{csv}");
    value
}

fn rows(value: &Value) -> &Vec<Value> {
    value["rows"].as_array().unwrap()
}

fn number(row: &Value, key: &str) -> f64 {
    row[key].as_f64().unwrap_or_else(|| panic!("{key} of {row}"))
}

fn maintainers() -> impl Iterator<Item = &'static str> {
    CHOICES.iter().copied().filter(|name| DIRECT.iter().all(|direct| direct.name() != *name))
}

/// Whether a maintainer holds no n² numbers, so that it takes part at every size.
fn is_sparse(name: &str) -> bool {
    name.starts_with("sparse") || name == "two_level"
}

#[test]
fn touch_compares_rates_and_forces_and_makes_steps_again_without_their_change() {
    let touched = |ease: &str| {
        let (_root, common) = scratch();
        let out = common.out.clone();
        let set = vec!["time.steps=30".to_owned(), ease.to_owned()];
        let text = touch::run(&touch::Arguments { common, set, finest: None }).unwrap();
        files(&out, "touch", &text)
    };
    let value = touched("refinement.ease_s=0.06");
    let [is, even] = &rows(&value)[..] else { panic!("{value}") };
    assert_eq!(
        (is["mesh"].as_str(), even["mesh"].as_str()),
        (Some("as it is"), Some("even level 2"))
    );
    for row in [is, even] {
        assert_eq!((number(row, "converged"), number(row, "steps")), (30.0, 30.0));
        let (error, worst) = (number(row, "force_error"), number(row, "worst_force_error"));
        assert!(0.0 < error && error <= worst && worst < 1.0, "{row}");
        assert!(number(row, "p50_ms") <= number(row, "p99_ms"), "{row}");
    }
    // What a change does to the force at once is what easing is for.
    let [eased, at_once] =
        [value, touched("refinement.ease_s=0")].map(|value| value["jumps"].clone());
    assert!(
        number(&eased, "changes") > 5.0 && number(&at_once, "changes") > 5.0,
        "{eased} {at_once}"
    );
    assert!(number(&eased, "mean") <= number(&eased, "largest"), "{eased}");
    assert!(number(&eased, "mean") < 0.5 * number(&at_once, "mean"), "{eased} {at_once}");
}

#[test]
fn touch_refuses_what_has_no_reference() {
    let (root, common) = scratch();
    let set = vec!["time.steps=9".to_owned()];
    let error = refused(root.path(), touch::run(&touch::Arguments { common, set, finest: None }));
    assert!(error.to_string().contains("time.steps"), "{error}");
}

/// A study that refuses leaves nothing behind.
fn refused(root: &Path, result: Result<String, BenchError>) -> BenchError {
    assert!(std::fs::read_dir(root).unwrap().next().is_none());
    result.unwrap_err()
}

fn sizes(common: Common, vertices: Vec<usize>) -> Arguments {
    Arguments { common, vertices, pairs: Some(10), cap_s: 60, memory_gb: Some(1), seed: 2 }
}

#[test]
fn table1_times_all_methods_at_exact_sizes_and_they_stay_right() {
    let (_root, common) = scratch();
    let out = common.out.clone();
    let text = table1::run(&sizes(common, vec![160, 200])).unwrap();
    let value = files(&out, "table1", &text);
    assert_eq!(rows(&value).len(), 2 * 2 * (maintainers().count() + DIRECT.len()));
    for row in rows(&value) {
        let (method, n) = (row["method"].as_str().unwrap(), number(row, "vertices"));
        assert_eq!(number(row, "dofs"), 3.0 * n);
        let direct = DIRECT.iter().any(|direct| direct.name() == method);
        assert_eq!(number(row, "updates"), if direct { 2.0 } else { 20.0 }, "{row}");
        for key in ["split_ms", "merge_ms"] {
            let (p50, p99) = (number(&row[key], "p50"), number(&row[key], "p99"));
            assert!(0.0 < p50 && p50 <= p99, "{row}");
        }
        for key in ["solve_ms", "columns_ms", "bound_ms"] {
            assert!(number(row, key) > 0.0, "{row}");
        }
        // Far above rounding at a condition of 1e5, far below a wrong update.
        let limit = if row["precision"] == "f32" { 1e-9 } else { 1e-10 };
        assert!(number(row, "error_vs_lu") < limit, "{row}");
        assert_eq!(row["reference"], "lu");
        assert_eq!(row["extrapolated"], false);
    }
    let laminate = rows(&value).iter().find(|row| row["family"] == "laminate").unwrap();
    assert!(number(laminate, "rank_max") > 3.0 && number(&rows(&value)[0], "rank_max") == 3.0);
    let ratios = value["ratios"].as_array().unwrap();
    for name in [
        "woodbury / bound",
        "cholesky / woodbury",
        "sparse_refactor_amd / sparse",
        "woodbury / sparse",
        "sparse laminate / sparse rank3",
        "bound / memcpy",
    ] {
        let count = ratios.iter().filter(|ratio| ratio["name"] == name).count();
        assert!(count > 0 && count % 2 == 0, "{name}");
    }
    for ratio in ratios {
        // Whatever the machine does meanwhile, a fresh start takes longer than an update.
        if ratio["name"] == "lu / woodbury" || ratio["name"] == "sparse_refactor_amd / sparse" {
            assert!(number(ratio, "value") > 1.0, "{ratio}");
        }
    }
    assert_eq!(number(&value["memory"][0], "bytes"), 8.0 * 480.0 * 481.0 / 2.0);
    for name in ["table1.svg", "table1_laminate.svg"] {
        let svg = std::fs::read_to_string(out.join(name)).unwrap();
        assert!(svg.contains("sparse_refactor_amd") && svg.contains("</svg>"));
    }
}

#[test]
fn table1_writes_nothing_for_bad_arguments() {
    let (root, common) = scratch();
    let bad = Arguments { pairs: Some(0), ..sizes(common.clone(), vec![160]) };
    let error = refused(root.path(), table1::run(&bad));
    assert!(matches!(error, BenchError::OutOfRange { option: "--pairs", .. }), "{error}");
    let error = refused(root.path(), table1::run(&sizes(common, vec![20, 200])));
    assert!(matches!(error, BenchError::TooFewVertices(20, _)), "{error}");
}

#[test]
fn scaling_gives_every_maintainer_exponents_and_leaves_large_ones_out() {
    let (_root, common) = scratch();
    let out = common.out.clone();
    // Three times 6600² numbers are 1.05 GB.
    let arguments = Arguments { pairs: Some(5), ..sizes(common, vec![160, 240, 2200]) };
    let text = scaling::run(&arguments).unwrap();
    let value = files(&out, "scaling", &text);
    let fits = value["fits"].as_array().unwrap();
    for method in maintainers() {
        for family in ["rank3", "laminate"] {
            let splits: Vec<&Value> = fits
                .iter()
                .filter(|f| f["method"] == method && f["family"] == family)
                .filter(|f| f["operation"] == "split")
                .collect();
            assert_eq!(splits.len(), 1, "{method}");
            assert_eq!(splits[0]["sizes"], if is_sparse(method) { 3 } else { 2 });
        }
    }
    let left_out = value["left_out"].as_array().unwrap();
    let dense = maintainers().filter(|name| !is_sparse(name)).count();
    assert_eq!(left_out.len(), 2 * dense);
    assert!(left_out.iter().all(|l| l["vertices"] == 2200));
    assert!(text.contains("left out, needs 1.05 GB, limit 1.00 GB"), "{text}");
    let large = || rows(&value).iter().filter(|row| row["vertices"] == 2200);
    assert!(large().any(|row| row["method"] == "sparse"));
    for row in large() {
        assert!(number(row, "error_vs_lu") < 1e-10, "{row}");
        assert_eq!(row["reference"], "sparse_refactor_amd");
    }
}

#[test]
fn drift_stays_small_for_all_maintainers_on_the_quick_cases() {
    let (_root, common) = scratch();
    let out = common.out.clone();
    let arguments = drift::Arguments { common, vertices: vec![160], updates: Some(60), seed: 3 };
    let text = drift::run(&arguments).unwrap();
    let value = files(&out, "drift", &text);
    // 1, 2, 5, 10, 20, 50, 60 updates, three cases.
    assert_eq!(rows(&value).len(), 7 * 3 * maintainers().count());
    for row in rows(&value) {
        let limit = match (row["method"].as_str().unwrap(), row["precision"].as_str().unwrap()) {
            ("sparse" | "woodbury", _) => 1e-10,
            (_, "f32") => 1e-6,
            _ => 1e-4,
        };
        assert!(number(row, "error") < limit, "{row}");
        assert!(number(row, "monitor") < 1.0, "{row}");
    }
    let names = std::fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().path());
    let svgs: Vec<PathBuf> =
        names.filter(|path| path.extension().is_some_and(|end| end == "svg")).collect();
    assert_eq!(svgs.len(), 3);
}

#[test]
fn drift_writes_nothing_for_bad_arguments() {
    let (root, common) = scratch();
    let arguments = drift::Arguments { common, vertices: vec![], updates: Some(0), seed: 3 };
    let error = refused(root.path(), drift::run(&arguments));
    assert!(matches!(error, BenchError::OutOfRange { option: "--updates", .. }), "{error}");
}

#[test]
fn cut_doubles_vertices_to_the_digits_of_a_new_factor() {
    let (_root, common) = scratch();
    let text = cut::run(&common).unwrap();
    let value = files(&common.out, "cut", &text);
    assert_eq!(rows(&value).len(), 2);
    for row in rows(&value) {
        assert!(row["double_ms"].as_f64().unwrap() > 0.0, "{row}");
        assert!(row["error"].as_f64().unwrap() < 1e-9, "{row}");
    }
}

/// A finer mesh lets more go, never as much as theory; a graded one takes fewer vertices than an even one that is as good.
#[test]
fn cracks_release_less_than_theory_and_more_on_finer_meshes() {
    let (_root, common) = scratch();
    let text = cracks::run(&common).unwrap();
    let value = files(&common.out, "cracks", &text);
    for (specimen, even, graded) in [("penny", 2, 3), ("edge", 4, 5)] {
        let of = |mesh: &str| -> Vec<_> {
            let own =
                rows(&value).iter().filter(|r| r["specimen"] == specimen && r["mesh"] == mesh);
            own.collect()
        };
        let (even_rows, graded_rows) = (of("even"), of("graded"));
        assert_eq!([even_rows.len(), graded_rows.len()], [even, graded]);
        for meshes in [&even_rows, &graded_rows] {
            for pair in meshes.windows(2) {
                assert!(number(pair[0], "released") < number(pair[1], "released"), "{pair:?}");
            }
            assert!(meshes.iter().all(|row| number(row, "released") < 1.0), "{meshes:?}");
        }
        let finest = even_rows[even - 1];
        let good = graded_rows.iter().find(|row| number(row, "error") <= number(finest, "error"));
        let good = number(good.unwrap(), "vertices");
        assert!(2.0 * good < number(finest, "vertices"), "{good} and {finest}");
    }
}

#[test]
fn elements_writes_what_is_documented() {
    let (_root, common) = scratch();
    let out = &common.out;
    let text = elements::run(&common).unwrap();
    let value = files(out, "elements", &text);
    assert_eq!(rows(&value).len(), 2 * (4 * 3 + 2 * 2));
    assert!(text.contains("p1p1"));
    assert!(std::fs::read_to_string(out.join("elements.svg")).unwrap().contains("</svg>"));
    assert!(elements::run(&common).is_err(), "the directory is in use");
}

/// The bounds that the choices are held to, and what is written.
#[test]
fn homogenisation_holds_what_is_claimed() {
    let (_root, common) = scratch();
    let out = &common.out;
    let text = homogenisation::run(&common).unwrap();
    let value = files(out, "homogenisation", &text);
    assert_eq!(rows(&value).len(), (8 + 7) * yawara_embed::CHOICES.len());
    let keys = [
        "case",
        "ratio",
        "nu",
        "levels",
        "choice",
        "error_coarse",
        "error_fine",
        "compliance_error",
        "min_eigenvalue",
        "seconds",
        "bytes",
    ];
    for row in rows(&value) {
        assert!(row.as_object().unwrap().keys().eq(keys));
        assert!(number(row, "min_eigenvalue") > 0.0, "{row}");
    }
    let mean = |choice: &str, key: &str| {
        let of = |row: &&Value| row["choice"] == choice && row["case"] != "homogeneous";
        rows(&value).iter().filter(of).take(7).map(|row| number(row, key)).sum::<f64>() / 7.0
    };
    let [laminate, linear, kharevych, paper] =
        ["laminate", "linear", "kharevych", "paper"].map(|c| mean(c, "error_coarse"));
    assert!(laminate < 0.17 && kharevych < 0.09, "{laminate} {kharevych}");
    assert!(kharevych < laminate && laminate < linear && linear < paper && paper > 1.0);
    let media = |choice: &str| {
        let means = value["mean_of_media"].as_array().unwrap();
        number(means.iter().find(|mean| mean["choice"] == choice).unwrap(), "error_coarse")
    };
    assert!(media("hierarchical") < 0.75 * media("laminate"), "{text}");
    assert!(mean("kharevych", "error_fine") < kharevych);
    assert!(mean("laminate", "error_fine") < 1.001 * laminate);
    let svg = std::fs::read_to_string(out.join("homogenisation.svg")).unwrap();
    assert!(svg.contains("kharevych, 3 levels"));
}

/// Nested meshes of a beam that is held by its material and has no weight: force and energy can only
/// fall, and what a step says of its error is compared with their limit.
#[test]
fn meshes_follow_a_scene_to_its_limit() {
    let (_root, common) = scratch();
    let out = common.out.clone();
    let set = vec!["gravity_m_s2=[0, 0, 0]".to_owned()];
    let (scene, finest) = ("beam".to_owned(), Some(6));
    let arguments = meshes::Arguments { scene, common, set, finest };
    let printed = meshes::run(&arguments).unwrap();
    assert!(printed.contains("force_n of `p1`: monotone"), "{printed}");
    let value = files(&out, "meshes", &printed);
    assert!(out.join("meshes.svg").exists());
    assert_eq!(rows(&value).len(), 14);
    let limits = value["limits"].as_array().unwrap();
    for levels in rows(&value).chunks(7) {
        assert!(levels.iter().all(|row| row["converged"] == true), "{levels:?}");
        for pair in levels.windows(2) {
            assert!(number(&pair[1], "vertices") > number(&pair[0], "vertices"));
            for figure in ["force_n", "energy_j"] {
                assert!(number(&pair[1], figure) <= number(&pair[0], figure), "{levels:?}");
            }
        }
        let is_theirs = |limit: &&Value| {
            limit["element"] == levels[0]["element"] && limit["figure"] == "energy_j"
        };
        let limit = number(limits.iter().find(is_theirs).unwrap(), "limit");
        for row in levels {
            let error = number(row, "energy_j") / limit - 1.0;
            let want = number(row, "error_estimate") / error;
            assert!((number(row, "effectivity") / want - 1.0).abs() < 1e-9, "{row}");
        }
    }
    let [p1, p1p1] = [6, 13].map(|at| number(&rows(&value)[at], "force_n"));
    assert!((p1 - p1p1).abs() < 0.01 * p1, "{p1} and {p1p1} N");

    let (root, common) = scratch();
    let set = vec!["tools.0.hold=\"glue\"".to_owned()];
    let arguments = meshes::Arguments { common, set, ..arguments };
    refused(root.path(), meshes::run(&arguments));
}

/// What is estimated is the error itself within a factor of three, for any body and tool.
#[test]
fn estimates_go_with_the_error_on_random_scenes() {
    let (_root, common) = scratch();
    let out = common.out.clone();
    let arguments =
        estimates::Arguments { common, set: Vec::new(), scenes: Some(8), seed: 1, finest: 9 };
    let printed = estimates::run(&arguments).unwrap();
    let value = files(&out, "estimates", &printed);
    assert_eq!(rows(&value).len(), 3 * 8);
    let mut compared = 0;
    for row in rows(&value) {
        let error = (number(row, "energy_j") / number(row, "reference_j") - 1.0).abs();
        assert!((number(row, "error") - error).abs() < 1e-12, "{row}");
        let effectivity = number(row, "error_estimate") / error;
        assert!((number(row, "effectivity") / effectivity - 1.0).abs() < 1e-9, "{row}");
        let has_limit = row.get("left").is_some();
        if has_limit && row["converged"] == true {
            assert!(0.3 < effectivity && effectivity < 3.0, "{row}");
            compared += 1;
        }
    }
    assert!(compared > 16, "{printed}");

    let (root, common) = scratch();
    let arguments = estimates::Arguments { common, finest: 10, ..arguments };
    let error = refused(root.path(), estimates::run(&arguments));
    assert!(matches!(error, BenchError::OutOfRange { option: "--finest", .. }), "{error}");
}

/// A case with a known force and one on a mesh of slivers, by both elements and two equilibria; called
/// again the study has nothing left to do.
#[test]
fn robust_has_a_row_for_every_case_element_and_equilibrium() {
    let (root, common) = scratch();
    let out = common.out.clone();
    let words = |words: [&str; 2]| words.map(str::to_owned).to_vec();
    let arguments = robust::Arguments {
        selection: Selection { out: common.out, force: false, shard: Shard::ALL },
        quick: true,
        equilibria: words(["anderson", "direct"]),
        only: words(["slivers", "pull"]),
        cap_s: Some(600),
    };
    let printed = robust::run(&arguments).unwrap();
    let text = std::fs::read_to_string(out.join("robust.json")).unwrap();
    let value: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(rows(&value).len(), 2 * 2 * 2);
    assert_eq!(std::fs::read_to_string(out.join("robust.csv")).unwrap().lines().count(), 9);
    for row in rows(&value) {
        let figures = &row["figures"];
        let steps = number(figures, "steps");
        let case = row["case"].as_str().unwrap();
        assert!(printed.contains(case) && row.get("failure").is_none(), "{row}");
        // The paper's own solver takes one application of the inverse: large turns are not for it.
        if case.ends_with("anderson") {
            assert_eq!(number(figures, "converged"), steps, "{row}");
            assert!(number(figures, "error") < 1e-6, "{row}");
        }
        assert!(number(figures, "iterations_p50") <= number(figures, "iterations_max"), "{row}");
        assert!(number(&row["measured"], "max_over_p50") >= 1.0, "{row}");
    }
    assert_eq!(robust::run(&arguments).unwrap(), printed);

    let other = root.path().join("other");
    let selection = Selection { out: other.clone(), ..arguments.selection.clone() };
    let bad =
        robust::Arguments { selection, equilibria: words(["anderson", "newten"]), ..arguments };
    let error = robust::run(&bad).unwrap_err().to_string();
    assert!(error.contains("newten") && !other.exists(), "{error}");
}

/// Few points and trials: moduli within their deviations, an exact gradient, and tables that the program reads.
#[test]
fn identify_finds_moduli_by_an_exact_gradient() {
    let (_root, common) = scratch();
    let out = common.out.clone();
    let arguments = identify::Arguments { common, trials: Some(2) };
    let printed = identify::run(&arguments).unwrap();
    let text = std::fs::read_to_string(out.join("identify.json")).unwrap();
    let value: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(rows(&value).len(), 4);
    for row in rows(&value) {
        let (error, sd) = (number(row, "error"), number(row, "relative_sd"));
        assert!(error.abs() < 4.0 * sd && sd < 0.05, "{row}");
        assert!(printed.contains(row["material"].as_str().unwrap()));
    }
    assert!(number(&value, "coverage") > 0.5);
    assert!(number(&value["gradient"], "off") < 1e-6, "{}", value["gradient"]);
    let measured = yawara::identify::read(&out.join("quarters.csv")).unwrap();
    assert_eq!(measured.len(), 4 + number(&rows(&value)[0], "points") as usize);
}

/// Two scenes of all, one of them cut short: every step is counted once, and again the same.
#[test]
fn endurance_counts_every_step_and_follows_from_its_seed() {
    let (root, common) = scratch();
    let run = |name: &str, seed| {
        let common = Common { out: root.path().join(name), ..common.clone() };
        let (laws, cuts) = (seed == 3, seed == 4);
        let arguments = endurance::Arguments { common, steps: Some(50), seed, laws, cuts };
        let printed = endurance::run(&arguments).unwrap();
        files(&root.path().join(name), "endurance", &printed)
    };
    let value = run("one", 3);
    let cases: Vec<&str> = rows(&value).iter().map(|row| row["group"].as_str().unwrap()).collect();
    assert_eq!(cases, ["grab", "pad", "all"]);
    for row in rows(&value) {
        let figures = &row["figures"];
        let failed: f64 = ["not_finite", "out_of_iterations", "no_equilibrium"]
            .map(|kind| number(figures, kind))
            .iter()
            .sum();
        assert_eq!(number(figures, "converged") + failed, number(figures, "steps"), "{row}");
        assert_eq!(failed, 0.0, "{row}");
        assert!(number(figures, "splits") > 0.0 && number(figures, "force_max_n") > 0.0, "{row}");
    }
    let all = rows(&value).last().unwrap();
    assert_eq!((number(&all["figures"], "steps"), number(&all["figures"], "scenes")), (50.0, 2.0));
    assert!(value["unsolved"].as_array().unwrap().is_empty());
    let figures = |value: &Value| rows(value).iter().map(|row| row["figures"].clone()).collect();
    let (again, other): (Vec<Value>, Vec<Value>) =
        (figures(&run("again", 3)), figures(&run("other", 4)));
    let one: Vec<Value> = figures(&value);
    assert_eq!(one, again);
    assert_ne!(one, other);

    let common = Common { out: root.path().join("none"), ..common };
    let (laws, cuts) = (false, false);
    let bad = endurance::Arguments { common, steps: Some(0), seed: 1, laws, cuts };
    let error = endurance::run(&bad).unwrap_err();
    assert!(matches!(error, BenchError::OutOfRange { option: "--steps", .. }), "{error}");
    assert!(!root.path().join("none").exists());
}
