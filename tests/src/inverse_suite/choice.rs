//! The maintainers that the suite is instantiated for, by name.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::{Arc, Mutex, PoisonError};

use yawara_gpu::{Device, DeviceOptions, GpuError};
use yawara_inverse_update::{
    Delayed, HostStore, InverseError, InverseMaintainer, REFINED_RESIDUAL, SparseStiffness,
    TwoLevel, TwoLevelOptions,
};

/// The scene name: what stands before the variant, `delayed` of `delayed@1`.
pub fn method(name: &str) -> &str {
    name.split('@').next().unwrap_or(name)
}

/// Devices opened so far, by tiles per chunk: shaders are translated once for all tests.
static DEVICES: Mutex<BTreeMap<Option<usize>, Arc<Device>>> = Mutex::new(BTreeMap::new());

/// The first device of this machine, with that many tiles of C per buffer.
///
/// # Errors
/// As [`Device::open`].
pub fn device(chunk_tiles: Option<usize>) -> Result<Arc<Device>, GpuError> {
    let mut devices = DEVICES.lock().unwrap_or_else(PoisonError::into_inner);
    let options = DeviceOptions { chunk_tiles, ..Default::default() };
    Ok(match devices.entry(chunk_tiles) {
        Entry::Occupied(known) => Arc::clone(known.get()),
        Entry::Vacant(unknown) => Arc::clone(unknown.insert(Device::open(options)?)),
    })
}

/// Tiles per chunk of a name such as `gpu@2`; `None` for other maintainers.
fn chunk_tiles(name: &str) -> Option<Option<usize>> {
    let tiles = name.split_once('@').map(|(_, tiles)| tiles.parse().expect("a number of tiles"));
    method(name).starts_with("gpu").then_some(tiles)
}

/// Whether a maintainer can be made here; says SKIP where it takes a device and there is none.
///
/// # Panics
/// If there is none and `REQUIRE_GPU=1` is set.
pub fn is_available(name: &str) -> bool {
    let Some(tiles) = chunk_tiles(name) else { return true };
    match device(tiles) {
        Ok(_) => true,
        Err(error) if std::env::var_os("REQUIRE_GPU").is_some_and(|value| value == "1") => {
            panic!("{name}: REQUIRE_GPU=1, but: {error}")
        }
        Err(error) => {
            eprintln!("SKIP {name}: {error}");
            false
        }
    }
}

/// Makes the maintainer of that name: `delayed@8` folds at 8 columns, `two_level@1` has patches of any size, `gpu@2`
/// keeps 2 tiles per buffer.
///
/// # Errors
/// As [`yawara_inverse_update::build`].
pub fn build(
    name: &str,
    stiffness: SparseStiffness,
) -> Result<Box<dyn InverseMaintainer>, InverseError> {
    if let Some(tiles) = chunk_tiles(name) {
        let device = device(tiles).expect("asked for before");
        return yawara_gpu::build(method(name), stiffness, &device);
    }
    match name.split_once('@') {
        Some(("delayed", most)) => {
            let most = most.parse().expect("a number of columns");
            let delayed = Delayed::new(stiffness, HostStore::new())?;
            Ok(Box::new(delayed.with_most_delayed(most)))
        }
        Some(("two_level", most)) => {
            let most = most.parse().expect("a part of the vertices");
            let options = TwoLevelOptions { most, ..Default::default() };
            Ok(Box::new(TwoLevel::with_options(stiffness, options)?))
        }
        _ => yawara_inverse_update::build(name, stiffness),
    }
}

/// The scaled residual that a maintainer may leave on purpose, on top of rounding: 0 but where it
/// stores less than f64 and refines.
pub fn residual(name: &str) -> f64 {
    match method(name) {
        "woodbury_f32" | "gpu_f32" => REFINED_RESIDUAL,
        _ => 0.0,
    }
}

/// Whether what a maintainer shows is a C that went through all updates, and not a solution with K
/// or with its factors.
pub fn updates_inverse(name: &str) -> bool {
    matches!(method(name), "woodbury" | "delayed" | "gpu" | "paper")
}

/// Whether `solve` multiplies by what `columns` shows; not where C is a sum of parts, which may
/// cancel, or kept in factors.
pub fn solves_by_columns(name: &str) -> bool {
    !matches!(method(name), "sparse" | "two_level" | "delayed" | "gpu")
}

/// Whether `precondition` and `rough_compliance` are C but for rounding; if not, they are of another matrix, which is
/// as good as the updates leave it.
pub fn comes_close(name: &str) -> bool {
    method(name) != "two_level"
}
