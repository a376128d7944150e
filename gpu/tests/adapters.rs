//! The list of adapters, with a driver and without one.
//!
//! Without an adapter the first two tests print SKIP; `REQUIRE_GPU=1` makes that a failure.

use std::ffi::OsString;
use std::process::Command;
use std::sync::mpsc;
use std::time::Duration;
use yawara_gpu::{AdapterReport, GpuError, adapters};

/// The list, or `None` after a line on stderr where tests without a device are allowed.
fn adapters_or_skip(test: &str) -> Option<Vec<AdapterReport>> {
    match adapters() {
        Ok(list) => Some(list),
        Err(error) if std::env::var_os("REQUIRE_GPU").is_some_and(|value| value == "1") => {
            panic!("{test}: REQUIRE_GPU=1, but: {error}")
        }
        Err(error) => {
            eprintln!("SKIP {test}: {error}");
            None
        }
    }
}

#[test]
fn reports_hold_what_every_vulkan_device_guarantees() {
    let Some(list) = adapters_or_skip("reports") else { return };
    assert!(!list.is_empty());
    for report in &list {
        assert!(!report.name.trim().is_empty(), "{report:?}");
        assert_eq!(report.backend, "vulkan", "{report:?}");
        // Required limits of Vulkan 1.0, table 33: maxStorageBufferRange 2²⁷, shared memory
        // 16 384, 128 invocations, 65 535 groups. wgpu holds bindings below 2³¹.
        assert!(report.max_storage_binding_bytes >= 1 << 27, "{report:?}");
        assert!(report.max_storage_binding_bytes < 1 << 31, "{report:?}");
        assert!(report.max_buffer_bytes >= report.max_storage_binding_bytes, "{report:?}");
        assert!(report.max_workgroup_storage_bytes >= 16_384, "{report:?}");
        assert!(report.max_threads_per_workgroup >= 128, "{report:?}");
        assert!(report.max_workgroups_per_dimension >= 65_535, "{report:?}");
        assert!(report.to_string().starts_with(&report.name));
    }
    assert_eq!(adapters().unwrap(), list, "the order is the same in every call");
}

#[test]
fn every_reported_adapter_opens_and_computes_in_the_reported_precision() {
    let Some(list) = adapters_or_skip("open") else { return };
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: wgpu::Backends::VULKAN,
        flags: wgpu::InstanceFlags::empty(),
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let found = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
    assert_eq!(found.len(), list.len());
    for report in &list {
        let adapter = found
            .iter()
            .find(|adapter| {
                let info = adapter.get_info();
                (&info.name, &info.driver_info, &info.device_pci_bus_id)
                    == (&report.name, &report.driver_info, &report.pci_bus_id)
            })
            .unwrap_or_else(|| panic!("no device behind {report:?}"));
        let f64_offered = adapter.features().contains(wgpu::Features::SHADER_F64);
        assert_eq!(report.shader_f64, f64_offered, "{report:?}");
        let (device, queue) = open(adapter, report);
        // 1 + 2⁻⁴⁰ and its square need more digits than 32 bits have.
        let x = 1.0 + f64::from(2.0f32.powi(-40));
        if report.shader_f64 {
            let square = square_on(&device, &queue, "f64", &x.to_le_bytes());
            assert_eq!(f64::from_le_bytes(square.try_into().unwrap()), x * x, "{report:?}");
        }
        let square = square_on(&device, &queue, "f32", &3.0f32.to_le_bytes());
        assert_eq!(f32::from_le_bytes(square.try_into().unwrap()), 9.0, "{report:?}");
    }
}

/// Opens the device with every limit that the report promises.
fn open(adapter: &wgpu::Adapter, report: &AdapterReport) -> (wgpu::Device, wgpu::Queue) {
    let required_features = match report.shader_f64 {
        true => wgpu::Features::SHADER_F64,
        false => wgpu::Features::empty(),
    };
    let required_limits = wgpu::Limits {
        max_buffer_size: report.max_buffer_bytes,
        max_storage_buffer_binding_size: report.max_storage_binding_bytes,
        max_compute_workgroup_storage_size: report.max_workgroup_storage_bytes.try_into().unwrap(),
        max_compute_invocations_per_workgroup: report.max_threads_per_workgroup,
        max_compute_workgroups_per_dimension: report.max_workgroups_per_dimension,
        ..adapter.limits()
    };
    let request =
        wgpu::DeviceDescriptor { required_features, required_limits, ..Default::default() };
    pollster::block_on(adapter.request_device(&request))
        .unwrap_or_else(|error| panic!("{report:?} does not open: {error}"))
}

/// Squares one number of type `scalar` on the device; bytes in and out.
fn square_on(device: &wgpu::Device, queue: &wgpu::Queue, scalar: &str, x: &[u8]) -> Vec<u8> {
    let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
    let size = x.len() as u64;
    let buffer = |usage| {
        let descriptor =
            wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false };
        device.create_buffer(&descriptor)
    };
    use wgpu::BufferUsages as Usage;
    let data = buffer(Usage::STORAGE | Usage::COPY_SRC | Usage::COPY_DST);
    let readback = buffer(Usage::MAP_READ | Usage::COPY_DST);
    queue.write_buffer(&data, 0, x);

    let source = format!(
        "alias T = {scalar};
         @group(0) @binding(0) var<storage, read_write> x: array<T>;
         @compute @workgroup_size(1) fn square() {{ x[0] = x[0] * x[0]; }}"
    );
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(source.into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some("square"),
        compilation_options: Default::default(),
        cache: None,
    });
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[wgpu::BindGroupEntry { binding: 0, resource: data.as_entire_binding() }],
    });

    let mut encoder = device.create_command_encoder(&Default::default());
    let mut pass = encoder.begin_compute_pass(&Default::default());
    pass.set_pipeline(&pipeline);
    pass.set_bind_group(0, &group, &[]);
    pass.dispatch_workgroups(1, 1, 1);
    drop(pass);
    encoder.copy_buffer_to_buffer(&data, 0, &readback, 0, size);
    queue.submit([encoder.finish()]);

    let (send, mapped) = mpsc::channel();
    readback.map_async(wgpu::MapMode::Read, .., move |result| send.send(result).unwrap());
    let wait =
        wgpu::PollType::Wait { submission_index: None, timeout: Some(Duration::from_secs(60)) };
    device.poll(wait).expect("the device answers within a minute");
    if let Some(error) = pollster::block_on(scope.pop()) {
        panic!("{scalar}: {error}");
    }
    mapped.recv().unwrap().expect("the result can be read back");
    readback.get_mapped_range(..).unwrap().to_vec()
}

const CHILD: &str = "child_prints_the_list";

/// Run by the tests below in a process of its own: the loader reads its environment once.
#[test]
#[ignore = "only a part of the tests without a driver"]
fn child_prints_the_list() {
    match adapters() {
        Ok(list) => println!("\nLIST {}", list.len()),
        Err(error) => println!("\nERROR {error}"),
    }
}

/// What `child_prints_the_list` says under the given environment; fails if it crashes or panics.
fn child_answer(environment: &[(&str, OsString)]) -> String {
    let output = Command::new(std::env::current_exe().unwrap())
        .args([CHILD, "--exact", "--ignored", "--nocapture"])
        .envs(environment.iter().map(|(key, value)| (key, value)))
        .output()
        .unwrap();
    let stdout = String::from_utf8_lossy(&output.stdout).into_owned();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{environment:?}: {}\n{stdout}{stderr}", output.status);
    assert!(!stderr.contains("panicked"), "{stderr}");
    let answer =
        stdout.lines().find(|line| line.starts_with("LIST ") || line.starts_with("ERROR "));
    answer.unwrap_or_else(|| panic!("the child said nothing:\n{stdout}{stderr}")).to_owned()
}

const NO_ADAPTER: &str =
    "ERROR no Vulkan adapter; install mesa-vulkan-drivers or choose another inverse";

#[test]
fn child_sees_what_this_process_sees() {
    // Else the tests without a driver could pass for a reason of their own.
    let expected = match adapters() {
        Ok(list) => format!("LIST {}", list.len()),
        Err(error) => format!("ERROR {error}"),
    };
    assert_eq!(child_answer(&[]), expected);
}

#[test]
fn without_a_driver_the_error_says_what_to_install() {
    let folder = tempfile::tempdir().unwrap();
    let (empty, garbage) = (folder.path().join("empty.json"), folder.path().join("garbage.json"));
    let missing_library = folder.path().join("missing_library.json");
    std::fs::write(&empty, "").unwrap();
    std::fs::write(&garbage, "{\"ICD\": [").unwrap();
    let manifest = "{\"file_format_version\": \"1.0.0\", \
         \"ICD\": {\"library_path\": \"/nonexistent/libvulkan_none.so\", \"api_version\": \"1.3.0\"}}";
    std::fs::write(&missing_library, manifest).unwrap();
    let absent = folder.path().join("absent.json");
    for file in [empty, garbage, missing_library, absent] {
        // Loaders before 1.3.207 know the second name only.
        let environment = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"]
            .map(|variable| (variable, file.clone().into_os_string()));
        assert_eq!(child_answer(&environment), NO_ADAPTER, "{}", file.display());
    }
}

#[test]
#[cfg(target_os = "linux")]
fn without_a_loader_the_error_is_the_same() {
    // The linker takes the first file of that name and gives up when it is no library, which is
    // how a machine without the loader looks from inside.
    let folder = tempfile::tempdir().unwrap();
    for name in ["libvulkan.so.1", "libvulkan.so"] {
        std::fs::write(folder.path().join(name), "not a shared library\n").unwrap();
    }
    let environment = [("LD_LIBRARY_PATH", folder.path().as_os_str().to_owned())];
    assert_eq!(child_answer(&environment), NO_ADAPTER);
}

#[test]
fn errors_name_the_way_out() {
    assert_eq!(format!("ERROR {}", GpuError::NoAdapter), NO_ADAPTER);
    let text = GpuError::NoVulkan("macos").to_string();
    assert_eq!(text, "no Vulkan on macos; choose another inverse");
}
