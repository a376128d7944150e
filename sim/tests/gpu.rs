//! Scenes whose inverse lives on a device, or would.

use crate::workbench;

use workbench::Workbench;

#[cfg(not(feature = "gpu"))]
#[test]
fn without_the_feature_the_scene_is_refused() {
    for name in ["gpu", "gpu_f32"] {
        let inverse = format!("stages.inverse={name:?}");
        let words = ["stages.inverse", name, "feature `gpu`"];
        Workbench::new().refused(&["run", "liver", "--set", &inverse], &words);
        let named = ["run", "liver", "--set", &inverse, "--set", "stages.gpu_adapter=card"];
        Workbench::new().refused(&named, &words);
    }
}

#[test]
fn an_adapter_without_an_inverse_on_it_is_refused() {
    for inverse in ["auto", "sparse"] {
        let inverse = format!("stages.inverse={inverse:?}");
        for (adapter, value) in [("NVIDIA", "\"NVIDIA\""), ("1", "1")] {
            let adapter = format!("stages.gpu_adapter={adapter}");
            let arguments = ["plan", "liver", "--set", &inverse, "--set", &adapter];
            let want = format!("stages.gpu_adapter is {value}, want no such key beside");
            let words = [&adapter[..], &want, "gpu and gpu_f32"];
            Workbench::new().refused(&arguments, &words);
        }
    }
}

#[test]
fn an_adapter_is_a_number_or_a_name() {
    let cases = [
        ("-1", "stages.gpu_adapter is -1, want an adapter's number in `yawara devices` or a part"),
        ("true", "stages.gpu_adapter is true, want a string or a whole number"),
        ("''", "stages.gpu_adapter is \"\", want a part of an adapter's name, or its number"),
    ];
    for (value, want) in cases {
        let adapter = format!("stages.gpu_adapter={value}");
        let arguments = ["plan", "liver", "--set", "stages.inverse=gpu", "--set", &adapter];
        Workbench::new().refused(&arguments, &[want]);
    }
}

#[cfg(feature = "gpu")]
mod with_the_feature {
    use super::Workbench;
    use std::sync::Arc;

    use yawara::{SimError, Simulation, Stages, scene_file};
    use yawara_gpu::{Device, DeviceOptions};
    use yawara_inverse_update::InverseError;

    /// The first device, or `None` after a line on stderr where tests without one are allowed.
    fn open(test: &str) -> Option<Arc<Device>> {
        match Device::open(DeviceOptions::default()) {
            Ok(device) => Some(device),
            Err(error) if std::env::var_os("REQUIRE_GPU").is_some_and(|value| value == "1") => {
                panic!("{test}: REQUIRE_GPU=1, but: {error}")
            }
            Err(error) => {
                eprintln!("SKIP {test}: {error}");
                None
            }
        }
    }

    /// Positions after every step, on base cells of that size.
    fn run(inverse: &str, base_mm: f64, steps: usize) -> (Vec<Vec<[f64; 3]>>, String) {
        let overrides = [
            format!("stages.inverse={inverse:?}"),
            format!("mesh.base_mm={base_mm:?}"),
            "solver.residual=1e-9".to_owned(),
        ];
        let (scene, _) = scene_file::load("liver", &overrides).unwrap();
        let stages = Stages::by_name(&scene.stages).unwrap();
        let mut simulation = Simulation::new(&scene, stages).unwrap();
        let plan = format!("{:?}", simulation.plan());
        let mut frames = Vec::new();
        for _ in 0..steps {
            simulation.step().unwrap();
            frames.push(simulation.frame().unwrap().displacement_mm);
        }
        (frames, plan)
    }

    fn norm(numbers: impl Iterator<Item = f64>) -> f64 {
        numbers.map(|x| x * x).sum::<f64>().sqrt()
    }

    fn agree(base_mm: f64, steps: usize) {
        let (want, _) = run("woodbury", base_mm, steps);
        let sizes: Vec<f64> =
            want.iter().map(|frame| norm(frame.iter().flatten().copied())).collect();
        let largest = sizes.iter().copied().fold(0.0, f64::max);
        for inverse in ["gpu", "gpu_f32"] {
            let (got, plan) = run(inverse, base_mm, steps);
            assert!(plan.contains("MiB needed") && plan.contains("bits"), "{plan}");
            for (step, (got, want)) in got.iter().zip(&want).enumerate() {
                assert_eq!(got.len(), want.len(), "{inverse}, step {step}: other vertices");
                let pairs = got.iter().flatten().zip(want.iter().flatten());
                // Let go, the body is back at rest: there it is the motion before that counts.
                let size = if sizes[step] > 0.0 { sizes[step] } else { largest };
                let error = norm(pairs.map(|(g, w)| g - w)) / size;
                println!("{inverse} step {step}: {} vertices, {error:e}", got.len());
                assert!(error <= 1e-6, "{inverse}, step {step}: off by {error:e}");
            }
        }
    }

    const COARSE: [&str; 4] = ["--set", "mesh.base_mm=32.0", "--set", "stages.inverse=gpu"];

    #[test]
    fn a_scene_names_its_adapter_by_number_or_by_name() {
        if open("adapter").is_none() {
            return;
        }
        let adapters = yawara_gpu::adapters().unwrap();
        for (index, report) in adapters.iter().enumerate() {
            let name = report.name.to_lowercase();
            let has_it =
                |other: &&yawara_gpu::AdapterReport| other.name.to_lowercase().contains(&name);
            let by_number = index.to_string();
            let by_name = format!("{:?}", &name[..]);
            let mut choices = vec![by_number];
            choices.extend((adapters.iter().filter(has_it).count() == 1).then_some(by_name));
            for choice in choices {
                let bench = Workbench::new();
                let set = format!("stages.gpu_adapter={choice}");
                let arguments = [&["plan", "liver"][..], &COARSE, &["--set", &set]].concat();
                let plan = bench.succeed(&arguments);
                let words = plan.split_whitespace().collect::<Vec<_>>().join(" ");
                assert!(words.contains(&report.name), "{choice}: {plan}");
                assert!(words.contains(&format!("by gpu_adapter = {choice}")), "{plan}");
            }
        }
    }

    #[test]
    fn an_adapter_that_is_not_there_is_refused_with_those_that_are() {
        if open("no such adapter").is_none() {
            return;
        }
        let adapters = yawara_gpu::adapters().unwrap();
        for (choice, shown) in
            [("99", "no adapter is 99"), ("no such", "no adapter is \"no such\"")]
        {
            let set = format!("stages.gpu_adapter={choice}");
            let arguments = [&["run", "liver"][..], &COARSE, &["--set", &set]].concat();
            let bench = Workbench::new();
            let output = bench.run(&arguments);
            // Drivers may have words of their own there.
            let stderr = String::from_utf8(output.stderr).unwrap();
            assert_eq!(output.status.code(), Some(2), "{stderr}");
            let start = format!("error: stages.gpu_adapter: {shown}, want");
            let message = stderr.lines().find(|line| line.starts_with(&start));
            let message = message.unwrap_or_else(|| panic!("no {start:?} in {stderr}"));
            for report in &adapters {
                assert!(message.contains(&report.name), "{message}");
            }
            assert!(bench.files().is_empty(), "{:?}", bench.files());
        }
    }

    /// Half of the default scene's resolution: a software device takes its time.
    #[test]
    fn a_coarse_liver_moves_as_on_the_host() {
        if open("liver").is_some() {
            agree(32.0, 6);
        }
    }

    #[test]
    #[ignore = "on a software device the default scene takes half an hour"]
    fn the_liver_moves_as_on_the_host() {
        if open("liver").is_some() {
            agree(16.0, 24);
        }
    }

    #[test]
    fn a_device_lost_on_the_way_ends_the_run_and_leaves_its_results() {
        let Some(device) = open("loss") else { return };
        let (scene, _) = scene_file::load("liver", &["mesh.base_mm=32.0".to_owned()]).unwrap();
        let mut stages = Stages::by_name(&scene.stages).unwrap();
        let lent = Arc::clone(&device);
        stages.inverse = Box::new(move |k| yawara_gpu::build("gpu", k, &lent));
        let mut simulation = Simulation::new(&scene, stages).unwrap();
        simulation.step().unwrap();
        simulation.step().unwrap();
        device.destroy();
        let error = simulation.step().unwrap_err();
        assert!(matches!(error, SimError::Inverse(InverseError::Storage { .. })), "{error}");
        assert!(error.to_string().contains("the device is lost"), "{error}");
        assert_eq!(simulation.summary().unwrap().steps.count, 2);
        simulation.frame().unwrap();
    }

    #[test]
    fn without_a_driver_the_run_is_refused_not_moved_to_the_host() {
        let bench = Workbench::new();
        let arguments = ["run", "liver", "--set", "stages.inverse=\"gpu\""];
        let mut command = bench.command(&arguments);
        for name in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"] {
            command.env(name, bench.path("no driver.json"));
        }
        let output = command.output().unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{stderr}");
        assert!(stderr.contains("no Vulkan adapter; install"), "{stderr}");
    }
}
