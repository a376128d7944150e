//! Scenes whose inverse lives on a device, or would.

mod workbench;

use workbench::Workbench;

#[cfg(not(feature = "gpu"))]
#[test]
fn without_the_feature_the_scene_is_refused() {
    for name in ["gpu", "gpu_f32"] {
        let inverse = format!("stages.inverse={name:?}");
        let words = ["stages.inverse", name, "feature `gpu`"];
        Workbench::new().refused(&["run", "liver", "--set", &inverse], &words);
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

    fn agree(base_mm: f64, steps: usize) {
        let (want, _) = run("woodbury", base_mm, steps);
        for inverse in ["gpu", "gpu_f32"] {
            let (got, plan) = run(inverse, base_mm, steps);
            assert!(plan.contains("MiB needed") && plan.contains("bits"), "{plan}");
            for (step, (got, want)) in got.iter().zip(&want).enumerate() {
                assert_eq!(got.len(), want.len(), "{inverse}, step {step}: other vertices");
                let pairs = || got.iter().flatten().zip(want.iter().flatten());
                let size = pairs().map(|(_, w)| w * w).sum::<f64>().sqrt();
                let error = pairs().map(|(g, w)| (g - w).powi(2)).sum::<f64>().sqrt() / size;
                println!("{inverse} step {step}: {} vertices, {error:e}", got.len());
                assert!(error <= 1e-6, "{inverse}, step {step}: off by {error:e}");
            }
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
    #[ignore = "on a software device the default scene takes minutes"]
    fn the_liver_moves_as_on_the_host() {
        if open("liver").is_some() {
            agree(16.0, 14);
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
