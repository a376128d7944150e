//! What goes wrong on a device is an error that says so, and leaves the host's state as it was.
//!
//! Without an adapter the tests print SKIP; `REQUIRE_GPU=1` makes that a failure.

use std::sync::Arc;

use faer::Mat;
use yawara_gpu::{
    AdapterChoice, Device, DeviceInverse, DeviceOptions, GpuError, adapters, needed_bytes,
    on_device,
};
use yawara_inverse_update::{InverseError, InverseMaintainer, RingChange, SparseStiffness};

/// The first device, or `None` after a line on stderr where tests without one are allowed.
fn open(test: &str, options: DeviceOptions) -> Option<Arc<Device>> {
    match Device::open(options) {
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

/// Vertices of three rows in a chain of springs of stiffness 1 from a wall.
fn chain(vertices: usize) -> SparseStiffness {
    let mut k = SparseStiffness::zeros(vertices, 3).unwrap();
    let pair = Mat::from_fn(6, 6, |i, j| match (i % 3 == j % 3, i == j) {
        (true, true) => 1.0,
        (true, false) => -1.0,
        _ => 0.0,
    });
    for i in 1..vertices {
        k.add(&[i - 1, i], pair.as_ref()).unwrap();
    }
    if vertices > 0 {
        k.add(&[0], Mat::<f64>::identity(3, 3).as_ref()).unwrap();
    }
    k
}

/// A vertex that hangs on a vertex by a spring of stiffness 1.
fn hanger(slot: usize) -> RingChange {
    let one = Mat::<f64>::identity(3, 3);
    RingChange {
        slots: vec![slot],
        k_p: Mat::zeros(3, 3),
        k_c: one.clone(),
        a12: -&one,
        a22: one,
        b: Mat::zeros(3, 3),
        positive: Mat::zeros(3, 0),
        negative: Mat::zeros(3, 0),
        order_key: 0,
    }
}

/// u of a unit load on the last vertex, along x: 1, 2, … along the chain.
fn pulled(inverse: &dyn InverseMaintainer) -> Result<Vec<f64>, InverseError> {
    let n = inverse.stiffness().dofs();
    let mut f = vec![0.0; n];
    f[n - 3] = 1.0;
    let mut u = vec![f64::NAN; n];
    inverse.solve(&f, &mut u)?;
    Ok(u)
}

fn cause(error: &InverseError) -> GpuError {
    let InverseError::Storage { method: "gpu" | "gpu_f32", cause } = error else {
        panic!("another error: {error}")
    };
    cause.get().downcast_ref::<GpuError>().expect("the device's own error").clone()
}

#[test]
fn options_that_can_not_be_had_are_refused() {
    let Some(_) = open("options", DeviceOptions::default()) else { return };
    let found = adapters().unwrap();
    let chosen = |adapter| {
        let adapter = Some(adapter);
        Device::open(DeviceOptions { adapter, ..Default::default() })
    };
    let beyond = AdapterChoice::Index(found.len() + 3);
    for choice in [beyond, AdapterChoice::Name("no such card".into())] {
        let error = chosen(choice.clone()).unwrap_err();
        let GpuError::NoSuchAdapter { choice: asked, found: list } = error else {
            panic!("{error}")
        };
        assert_eq!(asked, choice.to_string());
        found.iter().for_each(|report| assert!(list.contains(&report.name), "{list}"));
    }
    // A part of the last one's name in capitals, if it is its own.
    let last = found.last().unwrap();
    let part: String = last.name.to_uppercase();
    if found.iter().filter(|report| report.name == last.name).count() == 1 {
        for choice in [AdapterChoice::Name(part), AdapterChoice::Index(found.len() - 1)] {
            assert_eq!(chosen(choice).unwrap().report(), last);
        }
    }
    let error = Device::open(DeviceOptions { chunk_tiles: Some(0), ..Default::default() }).err();
    assert!(matches!(error, Some(GpuError::Limit { got: 0, want: 1, .. })));
}

#[test]
fn more_rows_than_a_buffer_holds_are_refused() {
    // A chunk larger than the device's largest buffer.
    let options = DeviceOptions { chunk_tiles: Some(65_535), ..Default::default() };
    let Some(device) = open("limits", options) else { return };
    if device.report().max_storage_binding_bytes < 65_535 * 64 * 64 * 8 {
        let error = on_device::<f64>(chain(2), &device).err().expect("too large");
        let cause = cause(&error);
        assert!(matches!(cause, GpuError::Limit { .. }), "{cause}");
        assert!(cause.to_string().contains("largest buffer"), "{cause}");
    }
}

#[test]
fn without_room_nothing_is_made_and_the_room_is_given_back() {
    let options = DeviceOptions { most_bytes: Some(1 << 20), ..Default::default() };
    let Some(device) = open("room", options) else { return };
    let error = on_device::<f64>(chain(200), &device).err().expect("no room");
    let cause = cause(&error);
    let GpuError::OutOfMemory { bytes, left, .. } = cause else { panic!("{cause}") };
    assert!(bytes > left);
    assert!(error.to_string().contains("bytes on the device"), "{error}");
    assert_eq!(device.used_bytes(), 0, "what was made before is given back");
}

/// Room for one tile row of C and no more: the split that needs a second one is refused, and
/// everything goes on as before.
#[test]
fn a_refused_growth_leaves_the_inverse_as_it_was() {
    let one = DeviceOptions { chunk_tiles: Some(1), ..Default::default() };
    let Some(device) = open("growth", one.clone()) else { return };
    let room = {
        let inverse: DeviceInverse<f64> = on_device(chain(21), &device).unwrap();
        let used = device.used_bytes();
        drop(inverse);
        used
    };
    let options = DeviceOptions { most_bytes: Some(room), ..one };
    let device = open("growth", options).unwrap();
    let mut inverse: DeviceInverse<f64> = on_device(chain(21), &device).unwrap();
    let before = (pulled(&inverse).unwrap(), inverse.stiffness().to_dense());
    // 63 rows fill a tile but for one row.
    let error = inverse.split(&hanger(20)).unwrap_err();
    assert!(matches!(cause(&error), GpuError::OutOfMemory { .. }), "{error}");
    assert_eq!(inverse.vertices(), 21);
    assert_eq!((pulled(&inverse).unwrap(), inverse.stiffness().to_dense()), before);
    // A merge needs no room: the chain's end goes.
    let change = RingChange::fixed(inverse.stiffness(), 20).unwrap();
    inverse.merge(20, &change).unwrap();
    assert_eq!(inverse.vertices(), 20);
    // Its neighbour is held by the spring that went to it, now fixed: 1/20 + 1/1 from both sides.
    let u = pulled(&inverse).unwrap();
    assert!((u[57] - 20.0 / 21.0).abs() < 1e-13, "{}", u[57]);
}

#[test]
fn a_lost_device_says_so_and_the_host_keeps_k() {
    let Some(device) = open("loss", DeviceOptions::default()) else { return };
    let mut inverse: DeviceInverse<f64> = on_device(chain(30), &device).unwrap();
    inverse.split(&hanger(29)).unwrap();
    let u = pulled(&inverse).unwrap();
    assert!((u[90] - 31.0).abs() < 1e-10, "{}", u[90]);
    device.destroy();
    let k = inverse.stiffness().to_dense();
    let mut untouched = vec![5.0; 93];
    let load = vec![1.0; 93];
    let errors = [
        inverse.split(&hanger(3)).map(|_| ()).unwrap_err(),
        inverse.merge(30, &hanger(29)).map(|_| ()).unwrap_err(),
        inverse.solve(&load, &mut untouched).unwrap_err(),
        inverse.columns(&[0]).map(|_| ()).unwrap_err(),
        inverse.watch(1).map(|_| ()).unwrap_err(),
        inverse.rebuild().unwrap_err(),
        on_device::<f64>(chain(3), &device).map(|_| ()).unwrap_err(),
    ];
    for error in errors {
        assert!(matches!(cause(&error), GpuError::Lost { .. }), "{error}");
        assert!(error.to_string().contains("the device is lost"), "{error}");
    }
    assert_eq!(untouched, vec![5.0; 93]);
    assert_eq!(inverse.stiffness().to_dense(), k);
    // What the host kept is enough to start again.
    let device = open("loss", DeviceOptions::default()).unwrap();
    let again: DeviceInverse<f64> = on_device(inverse.stiffness().clone(), &device).unwrap();
    assert!((pulled(&again).unwrap()[90] - 31.0).abs() < 1e-10);
}

/// Rows come and go over the ends of tiles and chunks; C_ij of a chain with hangers is known.
#[test]
fn growth_adds_chunks_and_runs_repeat_to_the_last_bit() {
    let options = DeviceOptions { chunk_tiles: Some(2), ..Default::default() };
    let Some(device) = open("chunks", options) else { return };
    let run = || {
        let mut inverse: DeviceInverse<f64> = on_device(chain(20), &device).unwrap();
        let first = inverse.store().chunks();
        for i in 0..80 {
            inverse.split(&hanger(if i == 0 { 19 } else { 19 + i })).unwrap();
        }
        // 300 rows are 5 tile rows, 15 tiles, 8 chunks of 2.
        assert_eq!((first, inverse.store().chunks()), (1, 8));
        let long = pulled(&inverse).unwrap();
        for i in (60..80).rev() {
            assert_eq!(inverse.merge(20 + i, &hanger(19 + i)).unwrap(), None);
        }
        (long, pulled(&inverse).unwrap())
    };
    let (long, short) = run();
    for (i, u) in long.chunks(3).enumerate() {
        assert!((u[0] - (i + 1) as f64).abs() < 1e-9, "vertex {i}: {}", u[0]);
        assert_eq!(u[1..], [0.0, 0.0]);
    }
    assert!((short[237] - 80.0).abs() < 1e-9, "{}", short[237]);
    assert_eq!(run(), (long, short), "the same in every run");
}

#[test]
fn the_memory_announced_is_what_is_made() {
    let options = DeviceOptions { chunk_tiles: Some(1), ..Default::default() };
    let Some(device) = open("memory", options) else { return };
    let inverse: DeviceInverse<f32> = on_device(chain(400), &device).unwrap();
    let place = inverse.place().expect("a device");
    assert!(place.contains(&device.report().name) && place.contains("32 bits"), "{place}");
    let (needed, used) = (needed_bytes(1200, 4), device.used_bytes());
    // Long columns have an eighth more rows than there are.
    assert!(used >= needed - needed / 10 && used < needed + needed / 2, "{used} of {needed}");
}
