//! `yawara devices`, built with graphics support and without.

use crate::workbench;

use workbench::Workbench;

#[cfg(not(feature = "gpu"))]
#[test]
fn without_the_feature_it_says_so() {
    Workbench::new().refused(&["devices"], &["yawara devices", "feature `gpu`"]);
}

#[cfg(feature = "gpu")]
#[test]
fn without_a_driver_it_says_what_to_install() {
    let bench = Workbench::new();
    let mut command = bench.command(&["devices"]);
    // The names that old and new Vulkan loaders read.
    for name in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"] {
        command.env(name, bench.path("no driver.json"));
    }
    let output = command.output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(stderr.starts_with("error: no Vulkan adapter; install"), "{stderr}");
}

#[cfg(feature = "gpu")]
#[test]
fn with_a_driver_every_adapter_is_listed() {
    let bench = Workbench::new();
    match yawara_gpu::adapters() {
        Ok(adapters) => {
            let text = bench.succeed(&["devices"]);
            for (index, adapter) in adapters.iter().enumerate() {
                assert!(text.contains(&format!("{index}: {adapter}\n")), "{text}");
            }
        }
        Err(error) if std::env::var_os("REQUIRE_GPU").is_some_and(|value| value == "1") => {
            panic!("REQUIRE_GPU=1, but: {error}")
        }
        Err(error) => {
            eprintln!("SKIP devices: {error}");
            bench.refused(&["devices"], &[]);
        }
    }
}
