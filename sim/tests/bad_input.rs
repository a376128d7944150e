//! Every input that can't be simulated is refused with exit code 2 and one paragraph that names
//! what is wrong, and leaves no directory behind.

#![cfg(feature = "nifti")]

use crate::workbench;

use workbench::{BAR, Nifti, Workbench};

const RUN: [&str; 4] = ["run", "bar.toml", "--out", "results/bar"];

/// `run bar.toml` with more arguments.
fn run_with<'a>(more: &[&'a str]) -> Vec<&'a str> {
    RUN.iter().copied().chain(more.iter().copied()).collect()
}

fn bar() -> Workbench {
    let bench = Workbench::new();
    bench.write("bar.toml", BAR);
    bench
}

/// The bar's scene on an image must be refused with these words.
fn image_refused(bytes: &[u8], words: &[&str]) {
    let bench = bar();
    bench.write("labels.nii", bytes);
    let words: Vec<&str> = words.iter().copied().chain(["labels.nii"]).collect();
    bench.refused(&run_with(&["--set", "image.path=labels.nii"]), &words);
    let mesh = ["mesh", "labels.nii", "--out", "labels.vtu"];
    let output = bench.run(&mesh);
    // What only the scene makes wrong is no fault of the image.
    if output.status.code() != Some(0) {
        bench.refused(&mesh, &words);
    }
}

fn image_spoilt(spoil: impl Fn(&mut Nifti), words: &[&str]) {
    let mut image = Nifti::cube(1);
    spoil(&mut image);
    image_refused(&image.bytes(), words);
}

/// Without its faults the input runs: what the other tests see is the fault.
#[test]
fn the_input_without_faults_runs() {
    let bench = bar();
    bench.write("labels.nii", Nifti::cube(1).bytes());
    bench.succeed(&run_with(&["--set", "image.path=labels.nii"]));
}

#[test]
fn missing_file() {
    bar().refused(&run_with(&["--set", "image.path=no.nii.gz"]), &["no.nii.gz"]);
    bar().refused(&["mesh", "no.nii.gz", "--out", "a.vtu"], &["no.nii.gz"]);
    bar().refused(&["run", "no.toml"], &["no.toml"]);
    bar().refused(&["plan", "livre"], &["livre", "liver, liver_ct, beam, twist"]);
}

#[test]
fn directory() {
    // With its reader a directory may be a DICOM series, and is refused as an empty one.
    let word =
        if cfg!(feature = "dicom") { "no DICOM image in this directory" } else { "a directory" };
    bar().refused(&run_with(&["--set", "image.path=."]), &[word]);
    bar().refused(&["run", "."], &["."]);
}

#[test]
fn empty_file() {
    image_refused(b"", &["empty"]);
}

#[test]
fn truncated_file() {
    let whole = Nifti::cube(1).bytes();
    image_refused(&whole[..200], &["200", "348"]);
    image_refused(&whole[..600], &["512", "248"]);
}

#[test]
fn no_nifti_image() {
    image_refused(&[b'x'; 4000], &["NIfTI"]);
    image_refused(&[0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 3, 1, 2, 3], &[]);
}

#[test]
fn four_dimensions() {
    image_spoilt(
        |image| {
            image.i16(40, 4).i16(48, 3);
        },
        &["3"],
    );
}

#[test]
fn absurd_dimensions() {
    let huge = |image: &mut Nifti| {
        image.i16(42, 32767).i16(44, 32767).i16(46, 32767);
    };
    image_spoilt(huge, &["32767", "limit"]);
    image_spoilt(
        |image| {
            image.i16(42, -8);
        },
        &["dim[1]", "-8"],
    );
    image_spoilt(
        |image| {
            image.i16(44, 0);
        },
        &["dim[2]", "0"],
    );
}

#[test]
fn wrong_offset_of_the_voxels() {
    for offset in [0.0, 348.0, 1e30, f32::NAN] {
        image_spoilt(
            |image| {
                image.f32(108, offset);
            },
            &["vox_offset"],
        );
    }
}

#[test]
fn wrong_datatype() {
    image_spoilt(
        |image| {
            image.i16(70, 128);
        },
        &["RGB24", "128"],
    );
    image_spoilt(
        |image| {
            image.i16(70, 77);
        },
        &["77"],
    );
}

#[test]
fn wrong_spacing_even_with_a_valid_sform() {
    for (spacing, shown) in [(0.0, "0"), (-5.0, "-5"), (f32::NAN, "NaN"), (f32::INFINITY, "inf")] {
        image_spoilt(
            |image| {
                image.f32(84, spacing);
            },
            &["pixdim[2]", shown],
        );
    }
}

/// One spacing so large that cubes of the others would be too many.
#[test]
fn far_too_unequal_spacings() {
    let spoil = |image: &mut Nifti| {
        image.f32(88, 5e5).f32(320, 5e5);
    };
    image_spoilt(spoil, &["500000", "limit"]);
}

#[test]
fn nothing_but_background() {
    image_spoilt(|image| image.voxels.fill(0), &["background"]);
}

#[test]
fn label_without_material() {
    image_spoilt(|image| image.voxels[100..110].fill(7), &["label 7", "10 voxels", "materials"]);
}

/// All labels are named at once, with what to give.
#[test]
fn labels_without_material() {
    let spoil = |image: &mut Nifti| {
        image.voxels[100..110].fill(7);
        image.voxels[110..112].fill(9);
    };
    let paste = ["image.ignore_labels=[7, 9]", "materials.1={ other = true, young_modulus_pa"];
    image_spoilt(spoil, &["label 7 (10 voxels), label 9 (2 voxels)", paste[0], paste[1]]);
}

/// Hounsfield units as labels.
#[test]
fn intensities_given_as_labels() {
    let mut image = Nifti::cube(1);
    image.i16(70, 256);
    image.voxels = (0..512).map(|v| (v % 100) as u8 ^ 0x80).collect();
    image_refused(&image.bytes(), &["does not look like a label map", "-128 to", "range"]);
}

/// A header in another unit than it says.
#[test]
fn body_of_a_wrong_size() {
    let resized = |edge: f32| {
        let mut image = Nifti::cube(1);
        for i in 0..3 {
            image.f32(80 + 4 * i, edge).f32(280 + 20 * i, edge);
        }
        image.bytes()
    };
    let bench = Workbench::new();
    bench.write(
        "bar.toml",
        BAR.replace("phantom = \"block\"\nsize_mm = [40, 20, 20]\nvoxel_mm = 5", ""),
    );
    bench.write("m.nii", resized(0.005)).write("um.nii", resized(5000.0));
    for (file, size, unit) in
        [("m.nii", "0.04 x 0.04 x 0.04 mm", "m"), ("um.nii", "40000 x 40000 x 40000 mm", "um")]
    {
        let image = format!("image.path={file}");
        let set = ["--set", &image[..], "--set", "mesh.base_mm=10"];
        bench.refused(&run_with(&set), &[file, size, "image.unit=m", "1 mm to 5 m"]);
        let unit = format!("image.unit={unit}");
        let plan = bench.succeed(&[&["plan", "bar.toml"], &set[..], &["--set", &unit]].concat());
        assert!(plan.contains("body of 40 x 40 x 40 mm"), "{plan}");
    }
    // Taken as it stands.
    bench.write("small.nii", resized(0.1));
    let set = ["--set", "image.path=small.nii", "--set", "mesh.base_mm=0.2"];
    bench.refused(&run_with(&set), &["0.8 x 0.8 x 0.8 mm"]);
    let plan = [&["plan", "bar.toml"], &set[..], &["--set", "image.unit=mm"]].concat();
    assert!(bench.succeed(&plan).contains("body of 0.8 x 0.8 x 0.8 mm"));
    bar().refused(&run_with(&["--set", "image.unit=mm"]), &["image.unit", "image.path"]);
    bench.refused(&run_with(&["--set", "image.unit=inch"]), &["image.unit", "um"]);
    let topology = "mesh.topology=components";
    for (beside, named) in [
        ("output.checkpoint_steps=2", "output.checkpoint_steps"),
        ("stages.homogenisation=kharevych", "mesh.topology"),
    ] {
        let set = run_with(&["--set", topology, "--set", beside]);
        bar().refused(&set, &["components", named]);
    }
    let level = ["--set", "mesh.apart_level=1"];
    bar().refused(&run_with(&level), &["mesh.apart_level", "topology"]);
    let apart = ["--set", topology, "--set", "mesh.apart_level=30"];
    bar().refused(&run_with(&apart), &["mesh.apart_level is 30", "max_level"]);
    bar().refused(&run_with(&["--set", "mesh.base_mm=1e9"]), &["mesh.base_mm is 1000000000", "80"]);
}

/// The scene's organ is not in the volume at all.
#[test]
fn organ_that_misses_the_volume() {
    image_spoilt(|image| image.voxels.fill(9), &["label 9", "512 voxels", "materials"]);
}

#[test]
fn material_out_of_range() {
    let cases = [
        ("poisson_ratio", "0.5", "less than 0.5"),
        ("poisson_ratio", "-1", "more than -1"),
        ("poisson_ratio", "nan", "NaN"),
        ("young_modulus_pa", "0", "between 1e-6 and 1e15"),
        ("young_modulus_pa", "-5e3", "-5000"),
        ("young_modulus_pa", "nan", "NaN"),
        ("young_modulus_pa", "inf", "1e15"),
        ("density_kg_m3", "-1", "at least 0"),
        ("label", "0", "void"),
    ];
    for (key, value, word) in cases {
        let set = format!("materials.0.{key}={value}");
        let shown = format!("materials[0].{key}");
        bar().refused(&run_with(&["--set", &set]), &["--set", &shown, word]);
        // The same value in the file: the line is named.
        let line = BAR.lines().position(|line| line.starts_with(key));
        if let Some(line) = line {
            let mut lines: Vec<String> = BAR.lines().map(str::to_owned).collect();
            lines[line] = format!("{key} = {value}");
            let bench = bar();
            bench.write("bar.toml", lines.join("\n"));
            let place = format!("bar.toml, line {}", line + 1);
            bench.refused(&RUN, &[&place, &shown, word]);
        }
    }
}

/// What a material takes of the image.
#[test]
fn materials_that_do_not_fit_the_image() {
    let soft = "materials.0={range=[-30, 150], young_modulus_pa=1, poisson_ratio=0}";
    let entry = |i: usize, what: &str| {
        format!("materials.{i}={{{what}, young_modulus_pa=1, poisson_ratio=0}}")
    };
    let cases = [
        // On the phantom of the scene.
        (vec![soft.to_owned()], "materials[0].range", "phantoms hold labels"),
        (vec![entry(0, "name='x'")], "materials[0]", "without label"),
        (vec![entry(0, "other=true, label=1")], "materials[0].other", "beside label"),
        (vec![entry(1, "other=true"), entry(2, "other=true")], "materials[2].other", "one such"),
    ];
    for (set, key, word) in cases {
        let set: Vec<&str> = set.iter().flat_map(|set| ["--set", set]).collect();
        bar().refused(&run_with(&set), &[key, word]);
    }
    let on_file = [
        (entry(1, "label=2"), "materials[1].label is 2", "a range, as materials[0] has one"),
        (entry(1, "other=true"), "materials[1].other", "a range, as materials[0] has one"),
        (entry(1, "range=[140, 300]"), "materials[1].range", "[-30.0, 150.0]"),
        (entry(1, "range=[-inf, inf]"), "materials[1].range", "materials[0].range"),
        (entry(1, "range=[200, 200]"), "materials[1].range", "low below high"),
        (entry(1, "range=[300, 200]"), "materials[1].range", "low below high"),
        (entry(1, "range=[nan, 200]"), "materials[1].range", "low below high"),
        (entry(1, "range=[200, nan]"), "materials[1].range", "low below high"),
        (entry(1, "range=[200]"), "materials[1].range", "an array of 2 numbers"),
        (entry(1, "range=[200, 300], label=1"), "materials[1].label is 1", "each label once"),
        (entry(1, "range=[200, 300], label=0"), "materials[1].label is 0", "void"),
        ("image.ignore_labels=[5]".into(), "image.ignore_labels[0]", "holds intensities"),
    ];
    for (set, key, word) in on_file {
        let bench = bar();
        bench.write("labels.nii", Nifti::cube(40).bytes());
        let image = ["--set", soft, "--set", "image.path=labels.nii"];
        bench.succeed(&[&["plan", "bar.toml"][..], &image].concat());
        let set = [&image[..], &["--set", &set]].concat();
        bench.refused(&run_with(&set), &["--set", key, word]);
    }
    // In the file, the line is named.
    let bench = bar();
    bench.write("bar.toml", BAR.replace("label = 1", "range = [3, 3]"));
    bench.refused(&RUN, &["bar.toml, line 8: materials[0].range is [3.0, 3.0]"]);
}

#[test]
fn no_intensity_in_any_range() {
    let bench = bar();
    bench.write("labels.nii", Nifti::cube(40).bytes());
    let set = ["--set", "materials.0={range=[41, 50], young_modulus_pa=1, poisson_ratio=0}"];
    let image = ["--set", "image.path=labels.nii"];
    let words = ["labels.nii", "no voxel lies in a range", "from 40 to 40"];
    bench.refused(&run_with(&[set, image].concat()), &words);
}

#[test]
fn labels_of_what_can_not_be_classified() {
    let bench = bar();
    bench.write("labels.nii", Nifti::cube(40).bytes());
    let labels = |more: &[&'static str]| {
        let mut arguments = vec!["labels", "labels.nii", "--out", "a.nii"];
        arguments.extend(more);
        arguments
    };
    bench.succeed(&labels(&["--range", "1:3:50"]));
    let cases: [(&[&'static str], &[&str]); 9] = [
        (&["--range", "1:3"], &["--range is 1:3", "LABEL:LOW:HIGH"]),
        (&["--range", "1:3:4:5"], &["LABEL:LOW:HIGH"]),
        (&["--range", "1.5:3:4"], &["LABEL:LOW:HIGH"]),
        (&["--range", "1:5:4"], &["[5, 4)", "below"]),
        (&["--range", "1:nan:4"], &["NaN", "below"]),
        (&["--range", "0:3:4"], &["void"]),
        (&["--range", "1:3:9", "--range", "2:8:10"], &["ranges 0 and 1 share values"]),
        (&["--blur-mm", "1"], &["--blur-mm", "--range"]),
        (&["--voxel-mm", "0"], &["> 0"]),
    ];
    for (more, words) in cases {
        bench.refused(&labels(more), words);
    }
    bench.refused(&["labels", "labels.nii", "--out", "a.mha"], &["a.mha", ".nii.gz"]);
    bench.refused(&["labels", "no.nii", "--out", "b.nii"], &["no.nii"]);
}

#[test]
fn value_out_of_range() {
    let cases = [
        ("time.steps=0", "10000000"),
        ("time.step_s=nan", "NaN"),
        ("gravity_m_s2=[0, nan, 0]", "gravity_m_s2[1]"),
        ("mesh.base_mm=0", "more than 0"),
        ("mesh.max_level=31", "at most 18"),
        ("mesh.start_level=4", "at most max_level, 3"),
        ("void.stiffness_ratio=1.5", "at most 1"),
        ("solver.residual=1", "less than 1"),
        ("solver.max_iterations=0", "at least 1"),
        ("refinement.split_above=0", "more than 0"),
        ("refinement.merge_fraction=1", "less than 1"),
        ("refinement.every_steps=0", "at least 1"),
        ("refinement.ease_s=-0.1", "0 to 10"),
        ("refinement.ease_s=nan", "0 to 10"),
        (
            "refinement.near_probe={ level = 4, within_m = 0.01 }",
            "at most mesh.max_level, which is 3",
        ),
        ("refinement.near_probe={ level = 2, within_m = -0.01 }", "0 to 1"),
        ("refinement.near_probe={ level = 2, within_m = nan }", "0 to 1"),
        ("fixed.0.min=[0.5, 0, 0]", "fixed[0].min[0] is 0.5, want at most fixed[0].max[0], 0.0"),
        ("tools.0.path=[]", "tools[0].path"),
        ("tools.0.path.1.time_s=0", "tools[0].path[1].time_s"),
        ("tools.0.turn_axis=[0, 0, 0]", "tools[0].turn_axis"),
        ("tools.0.region={shape=\"sphere\", centre=[0,0,0], radius_m=0}", "radius_m"),
        ("materials.1={label=1, young_modulus_pa=1, poisson_ratio=0}", "each label once"),
        ("stages.inverse=magic", "woodbury, woodbury_f32, delayed, sparse, two_level, paper, lu"),
        ("stages.element=magic", "auto, p1, p1p1"),
        ("stages.homogenisation=magic", "laminate"),
        ("stages.corotation=magic", "element"),
        ("stages.equilibrium=magic", "anderson"),
        ("stages.indicator=magic", "energy, residual, goal, volume"),
        ("image.size_mm=[40, 20, 21]", "image.size_mm[2] is 21.0"),
        ("image.voxel_mm=-5", "image.voxel_mm"),
        ("image.path=\"\"", "image.path"),
        ("image.blur_mm=-1", "at least 0"),
        ("image.blur_mm=nan", "NaN"),
        ("image.blur_mm=2", "label map"),
        ("image.ignore_labels=[3, 1]", "image.ignore_labels[1] is 1"),
        ("image.ignore_labels=[0.5]", "a whole number"),
        ("image.ignore_others=1", "true or false"),
        ("mesh.label_level=4", "to max_level, 3"),
        ("mesh.label_region={shape=\"sphere\", centre=[0,0,0], radius_m=1}", "mesh.label_level"),
        ("output.field=1", "true or false"),
        ("materials.0.law={kind=\"maxwell\"}", "prony"),
        ("materials.0.law={kind=\"prony\"}", "materials[0].law.terms is 0, want at least one term"),
        (
            "materials.0.law={kind=\"prony\", terms=[{fraction=0.5, time_s=-1}]}",
            "terms[0].time_s is -1",
        ),
        (
            "materials.0.law={kind=\"prony\", terms=[{fraction=1.5, time_s=1}]}",
            "terms[0].fraction is 1.5, want 0 to 1",
        ),
        (
            "materials.0.law={kind=\"prony\", terms=[{fraction=0.6, time_s=1}, {fraction=0.6, time_s=2}]}",
            "terms[1].fraction is 0.6, want so little that all fractions together are at most 1",
        ),
        (
            "materials.0.law={kind=\"prony\", power_law={exponent=0.1, from_s=2, to_s=1, terms=4}}",
            "power_law.to_s is 1.0, want finite and more than from_s, 2.0",
        ),
        ("materials.0.law={kind=\"plastic\", yield_pa=0}", "law.yield_pa is 0"),
        (
            "materials.0.law={kind=\"plastic\", yield_pa=1, hardening_pa=-1}",
            "law.hardening_pa is -1",
        ),
        (
            "materials.0.law={kind=\"creep\", yield_strain=0, rate_per_s=0, max_strain=1}",
            "law.rate_per_s is 0",
        ),
        ("name=../up", "name"),
        ("seed=-1", "at least 0"),
    ];
    for (set, word) in cases {
        let key = set.split(['=', '.']).next().unwrap();
        bar().refused(&run_with(&["--set", set]), &[key, word]);
        bar().refused(&["plan", "bar.toml", "--set", set], &[key, word]);
    }
    bar().refused(&run_with(&["--steps", "0"]), &["time.steps is 0"]);
}

#[test]
fn no_image() {
    let bench = bar();
    bench.write("bar.toml", BAR.replace("phantom = \"block\"", ""));
    bench.refused(&RUN, &["--set image.path=FILE.nii.gz"]);
    bench.refused(&["run", "liver_ct"], &["--set image.path=FILE.nii.gz"]);
}

#[test]
fn nothing_fixed() {
    // Beside the body, on one of its edges only, and no region at all.
    let outside = "fixed.0={shape=\"box\", min=[2,2,2], max=[3,3,3]}";
    let edge = "fixed.0={shape=\"box\", min=[0,0,0], max=[0,0,1]}";
    for set in [outside, edge, "fixed=[]"] {
        bar().refused(&run_with(&["--set", set]), &["fixed"]);
    }
}

#[test]
fn tool_outside_the_body() {
    let far = "tools.0.region={shape=\"sphere\", centre=[3, 3, 3], radius_m=0.002}";
    bar().refused(&run_with(&["--set", far]), &["tools[0]", "outside"]);
}

/// Where a load acts and what it is, each given once.
#[test]
fn load_that_contradicts_itself() {
    let near = "region = { shape = \"box\", min = [0.5, 0, 0], max = [1, 1, 1] }";
    let line = "region = { shape = \"box\", min = [0, 0.3, 0.3], max = [1, 0.4, 0.4] }";
    let gap = "region = { shape = \"box\", min = [0.5, 0.5, 0.5], max = [0.51, 0.51, 0.51] }";
    let force = "force_n = [0, 0, 1]";
    let cases: [(&str, &str, &[&str]); 14] = [
        ("", force, &["tools[0].region is missing", "at_mm"]),
        (&format!("{near}, at_mm = [5, 0, 0]"), force, &["tools[0].at_mm is [5.0, 0.0, 0.0]"]),
        ("at_mm = [5, 0, nan]", force, &["tools[0].at_mm[2] is NaN"]),
        ("at_mm = [5, 0, 17]", force, &["tools[0].at_mm lies outside", "7.000 mm", "5.000 mm"]),
        ("at_mm = [5, 0, 0]", "torque_n_m = [0, 0, 1]", &["load[0].torque_n_m", "beside at_mm"]),
        ("at_mm = [5, 0, 0]", "traction_pa = [0, 0, 1]", &["traction_pa", "beside at_mm"]),
        (near, "", &["tools[0].load is", "in at least one entry"]),
        (near, "force_n = [0, inf, 0]", &["tools[0].load[0].force_n[1] is inf", "finite"]),
        (near, "force_n = [0, 0, 2e12]", &["force_n is [0.0, 0.0, 2000000000000.0]", "1e12"]),
        (near, "force_n = [0, 1]", &["tools[0].load[0].force_n", "an array of 3 numbers"]),
        (
            near,
            "force_n = [0, 0, 1], traction_pa = [0, 0, 1]",
            &["load[0].traction_pa is [0.0, 0.0, 1.0]", "beside force_n"],
        ),
        (near, "pressure_pa = 3", &["unknown key `tools[0].load[0].pressure_pa`", "traction_pa"]),
        (gap, force, &["tools[0].region", "no material of", "middle of a voxel"]),
        (line, "torque_n_m = [0, 0, 1]", &["tools[0].region", "torque_n_m", "line"]),
    ];
    for (place, load, words) in cases {
        let place = if place.is_empty() { String::new() } else { format!("{place}, ") };
        let load = if load.is_empty() { String::new() } else { format!(", {load}") };
        let set = format!("tools=[{{ kind = \"load\", {place}load = [{{ time_s = 0{load} }}] }}]");
        bar().refused(&run_with(&["--set", &set]), words);
    }
    let twice = "load = [{ time_s = 1, force_n = [0, 0, 1] }, { time_s = 1 }]";
    let set = format!("tools=[{{ kind = \"load\", {near}, {twice} }}]");
    bar().refused(&run_with(&["--set", &set]), &["tools[0].load[1].time_s is 1.0", "more than"]);
    let set = format!("tools=[{{ kind = \"load\", {near}, load = [] }}]");
    bar().refused(&run_with(&["--set", &set]), &["tools[0].load is []"]);
    let set = format!("tools=[{{ kind = \"load\", {near}, laod = [] }}]");
    bar().refused(&run_with(&["--set", &set]), &["unknown key", "did you mean `load`?"]);
}

/// Two slabs, of which the second is not held: a load on both is borne by the first alone.
#[test]
fn load_on_a_part_that_is_left_out() {
    let bench = bar();
    let mut image = Nifti::cube(1);
    let is_gap = |i: usize| (2..6).contains(&(i % 8));
    (0..512).filter(|&i| is_gap(i)).for_each(|i| image.voxels[i] = 0);
    bench.write("labels.nii", image.bytes());
    // What is left out is said before the error, so that there are two paragraphs.
    let run = |place: &str| {
        let load = "load = [{ time_s = 0, force_n = [0, 0, 0.01] }]";
        let tools = format!("tools=[{{ kind = \"load\", {place}, {load} }}]");
        let output = bench.run(&run_with(&["--set", "image.path=labels.nii", "--set", &tools]));
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let second = "region = { shape = \"box\", min = [0.8, 0, 0], max = [1, 1, 1] }";
    for (place, key) in [(second, "tools[0].region"), ("at_mm = [47, 40, 50]", "tools[0].at_mm")] {
        let (code, message) = run(place);
        let words =
            format!("error: labels.nii: {key} is in parts that are left out, want material");
        assert!(code == Some(2) && message.contains(&words), "{message}");
    }
    let (code, message) = run("region = { shape = \"box\", min = [0, 0, 0], max = [1, 1, 1] }");
    assert_eq!(code, Some(0), "{message}");
    let steps = bench.read("results/bar/steps.csv");
    let at = steps.lines().next().unwrap().split(',').position(|name| name == "force_z_n");
    let last = steps.lines().last().unwrap().split(',').nth(at.unwrap()).unwrap();
    assert!((last.parse::<f64>().unwrap() - 0.01).abs() < 1e-12, "{last} N");
}

/// A voxel's edge off the surface, which rounding of coordinates may be, is the nearest point of it;
/// tables and the summary have a load as they have a grab.
#[test]
fn a_load_is_written_down_as_every_tool_is() {
    let bench = bar();
    let load = "load = [{ time_s = 0 }, { time_s = 0.3, force_n = [0, 0, 0.01] }]";
    let set = format!("tools=[{{ kind = \"load\", at_mm = [20, 0, 10.5], {load} }}]");
    bench.succeed(&run_with(&["--set", &set]));
    let steps = bench.read("results/bar/steps.csv");
    let header: Vec<&str> = steps.lines().next().unwrap().split(',').collect();
    let column = header.iter().position(|name| *name == "tool0_force_z_n").unwrap();
    let last: Vec<&str> = steps.lines().last().unwrap().split(',').collect();
    assert!((last[column].parse::<f64>().unwrap() - 0.01).abs() < 1e-12, "{steps}");
    assert!(header.contains(&"tool0_torque_x_n_m"), "{steps}");
    assert!(bench.read("results/bar/summary.json").contains("\"kind\": \"load\""));
    assert!(bench.read("results/bar/scene.toml").contains("at_mm"));
    // The scene as it was resolved runs again.
    bench.succeed(&["run", "results/bar/scene.toml", "--out", "results/again"]);
    assert_eq!(bench.read("results/again/steps.csv").lines().count(), steps.lines().count());
}

#[test]
fn too_many_vertices_at_the_start() {
    bar().refused(&run_with(&["--set", "mesh.max_vertices=20"]), &["mesh.max_vertices", "20"]);
}

#[test]
fn unknown_key() {
    let bench = bar();
    bench.write("bar.toml", BAR.replace("[output]\nframes_every", "[output]\nframe_every"));
    bench.refused(&RUN, &["bar.toml, line", "output.frame_every", "did you mean `frames_every`?"]);
    let set = ["--set", "materials.0.poison_ratio=0.3"];
    bar().refused(&run_with(&set), &["--set", "`poisson_ratio`"]);
    // Of a ball's region, not of a box.
    let set = ["--set", "tools.0.region.radius_m=1"];
    bar().refused(&run_with(&set), &["unknown key `tools[0].region.radius_m`"]);
}

#[test]
fn broken_toml() {
    let cases = [
        ("steps = 3", "steps = ", "line 23, column"),
        ("[output]", "[time]", "duplicate key"),
        ("steps = 3", "steps = 3.5", "time.steps is 3.5, want a whole number"),
        ("step_s = 0.1", "", "time.step_s is missing, want a number"),
    ];
    for (from, to, word) in cases {
        let bench = bar();
        bench.write("bar.toml", BAR.replace(from, to));
        bench.refused(&RUN, &["bar.toml", word]);
    }
    let bench = bar();
    bench.write("bar.toml", [0xff, 0xfe, 0x00]);
    bench.refused(&RUN, &["bar.toml", "UTF-8"]);
}

#[test]
fn unwritable_output() {
    let bench = bar();
    bench.write("file", "");
    bench.refused(&["run", "bar.toml", "--out", "file/results"], &["file"]);
    bench.refused(&["run", "bar.toml", "--out", "file"], &["file", "not a directory"]);
    bench.refused(&["mesh", "phantom", "--out", "no such folder/a.vtu"], &["no such folder/a.vtu"]);
    #[cfg(target_os = "linux")]
    bench.refused(&["run", "bar.toml", "--out", "/proc/results/bar"], &["/proc/results"]);
}

#[test]
fn wrong_usage() {
    let bench = bar();
    bench.refused(&["run", "--stesp", "3"], &["'--stesp'", "'--steps'"]);
    bench.refused(&["rum"], &["'rum'"]);
    bench.refused(&["liver"], &["did you mean `yawara run liver`?"]);
    bench.refused(&["bar.toml", "--steps", "2"], &["`yawara run bar.toml --steps 2`"]);
    bench.refused(&["--out", "here"], &["did you mean `yawara run --out here`?"]);
    bench.write("ct.nii", Nifti::cube(1).bytes());
    bench.refused(&["ct.nii"], &["`yawara init ct.nii`, then `yawara run scene.toml`"]);
    bench.refused(&["run", "--steps", "many"], &["many"]);
    bench.refused(&["run", "bar.toml", "--steps", "-1"], &["time.steps is -1", "at least 0"]);
    for broken in ["image.size_mm=[40, 20", "tools.0={ kind = 'grab' region", "name='bar"] {
        let set = ["run", "bar.toml", "--set", broken];
        bench.refused(&set, &["--set", broken, "no TOML value"]);
    }
    bench.refused(&["run", "bar.toml", "--set", "steps"], &["--set steps", "KEY=VALUE"]);
    bench.refused(&["mesh", "phantom", "--out", "a.txt"], &["a.txt", ".vtu"]);
    bench
        .refused(&["mesh", "phantom", "--base-mm", "nan", "--out", "a.vtu"], &["--base-mm", "NaN"]);
    bench.refused(&["mesh", "phantom", "--level", "18", "--out", "a.vtu"], &["--level", "at most"]);
    bench.refused(&["mesh", "phantom", "--level", "31", "--out", "a.vtu"], &["--level", "18"]);
}
