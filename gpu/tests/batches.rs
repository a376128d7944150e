//! Splits that come together cost as many ways to the device and back as one.
//!
//! Without an adapter the tests print SKIP; `REQUIRE_GPU=1` makes that a failure.

use std::sync::Arc;

use faer::Mat;
use faer::linalg::solvers::DenseSolveCore;
use yawara_gpu::{Device, DeviceInverse, DeviceOptions, GpuError, on_device};
use yawara_inverse_update::{
    InverseError, InverseMaintainer, RingChange, SparseStiffness, StiffnessChange, Update,
};

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

/// Vertices of three rows, each on a spring of 1 to the ground and one to the vertex before it.
fn row(vertices: usize) -> SparseStiffness {
    let mut k = SparseStiffness::zeros(vertices, 3).unwrap();
    let pair = Mat::from_fn(6, 6, |i, j| match (i % 3 == j % 3, i == j) {
        (true, true) => 1.0,
        (true, false) => -1.0,
        _ => 0.0,
    });
    for i in 0..vertices {
        k.add(&[i], Mat::<f64>::identity(3, 3).as_ref()).unwrap();
        if i > 0 {
            k.add(&[i - 1, i], pair.as_ref()).unwrap();
        }
    }
    k
}

/// Springs of ½ each from two vertices to a new one in their middle.
fn bridge(slots: [usize; 2]) -> RingChange {
    let own = |i: usize, j: usize| if i == j { 0.5 } else { 0.0 };
    let half = |i: usize, j: usize| if i % 3 == j % 3 { -0.5 } else { 0.0 };
    // The coarse ring is none, so F makes up for K_c − a12 A22⁻¹ a12ᵀ = ¼ [1, −1; −1, 1].
    let positive = Mat::from_fn(6, 3, |i, j| match (i % 3 == j, i < 3) {
        (true, true) => 0.5,
        (true, false) => -0.5,
        _ => 0.0,
    });
    RingChange {
        slots: slots.to_vec(),
        k_p: Mat::zeros(6, 6),
        k_c: Mat::from_fn(6, 6, own),
        a12: Mat::from_fn(6, 3, half),
        a22: Mat::identity(3, 3),
        b: Mat::zeros(6, 3),
        positive,
        negative: Mat::zeros(6, 0),
        order_key: 0,
    }
}

/// A spring of ¼ between two vertices comes or goes.
fn spring(slots: [usize; 2], comes: bool) -> StiffnessChange {
    let ends = Mat::from_fn(6, 3, |i, j| match (i % 3 == j, i < 3) {
        (true, true) => 0.5,
        (true, false) => -0.5,
        _ => 0.0,
    });
    let (slots, none) = (slots.to_vec(), Mat::zeros(6, 0));
    match comes {
        true => StiffnessChange { slots, added: ends, removed: none },
        false => StiffnessChange { slots, added: none, removed: ends },
    }
}

/// Rings that are disjoint, that share a vertex, and that stand on each other's vertices.
fn bridges(vertices: usize) -> Vec<Update> {
    let young = [[vertices, 11], [vertices + 1, vertices + 5], [2, vertices + 6]];
    let old = [[0, 5], [10, 15], [15, 20], [21, 30], [1, 31]];
    old.into_iter().chain(young).map(|slots| Update::Split(bridge(slots))).collect()
}

/// All of C, how far it is from that of the kept K by LU relative to its largest entry, and a bound
/// of that for numbers of spacing `epsilon`: 16 n ε κ with κ ≤ ‖K‖ ‖C‖ in the Frobenius norm; the
/// factor stands for the products per edit, n for the edits and their sums.
fn inverse_and_error(inverse: &dyn InverseMaintainer, epsilon: f64) -> (Mat<f64>, f64, f64) {
    let all: Vec<usize> = (0..inverse.vertices()).collect();
    let columns = inverse.columns(&all).unwrap();
    let k = inverse.stiffness().to_dense();
    let want = k.partial_piv_lu().inverse();
    let error = (&columns - &want).norm_max() / want.norm_max();
    (columns, error, 16.0 * k.nrows() as f64 * epsilon * k.norm_l2() * want.norm_l2())
}

#[test]
fn a_batch_takes_as_many_submits_as_one_split() {
    let Some(device) = open("submits", DeviceOptions::default()) else { return };
    let (vertices, mut seen) = (40, Vec::new());
    let changes = bridges(vertices);
    for count in [1, 2, 8] {
        let mut inverse: DeviceInverse<f64> = on_device(row(vertices), &device).unwrap();
        let before = (device.submits(), device.answers());
        inverse.batch(&changes[..count]).unwrap();
        assert_eq!(inverse.vertices(), vertices + count);
        seen.push((device.submits() - before.0, device.answers() - before.1));
    }
    // With a spring that comes, one that goes, and a vertex that stands on the last one.
    let mut updates = changes;
    updates.push(Update::Content(spring([vertices + 7, 3], true)));
    updates.push(Update::Content(spring([10, 11], false)));
    updates.push(Update::Split(bridge([vertices + 7, 10])));
    let mut inverse: DeviceInverse<f64> = on_device(row(vertices), &device).unwrap();
    let before = (device.submits(), device.answers());
    inverse.batch(&updates).unwrap();
    seen.push((device.submits() - before.0, device.answers() - before.1));
    // The block of C; the columns, whose diagonal comes back; the new rows.
    assert_eq!(seen, [(3, 2); 4]);
    let mut want = row(vertices);
    updates.iter().for_each(|update| want.update(update).unwrap());
    assert_eq!(inverse.stiffness().to_dense(), want.to_dense());
    let (_, error, bound) = inverse_and_error(&inverse, f64::EPSILON);
    assert!(error <= bound && bound < 1e-9, "{error:e} of {bound:e}");
    assert_eq!(inverse.counts().rebuilds, 0);
}

#[test]
fn a_batch_is_its_splits_and_their_inverse() {
    let options = DeviceOptions { chunk_tiles: Some(1), ..Default::default() };
    let Some(device) = open("batch", options) else { return };
    let vertices = 40;
    let changes = bridges(vertices);
    let mut batch: DeviceInverse<f64> = on_device(row(vertices), &device).unwrap();
    let mut single: DeviceInverse<f64> = on_device(row(vertices), &device).unwrap();
    let mut rough: DeviceInverse<f32> = on_device(row(vertices), &device).unwrap();
    let mut rough_single: DeviceInverse<f32> = on_device(row(vertices), &device).unwrap();
    // Twice, so that the second batch finds terms put off.
    for _ in 0..2 {
        batch.batch(&changes).unwrap();
        rough.batch(&changes).unwrap();
        for change in &changes {
            change.make(&mut single).unwrap();
            change.make(&mut rough_single).unwrap();
        }
    }
    let (one, error, bound) = inverse_and_error(&batch, f64::EPSILON);
    let (other, other_error, _) = inverse_and_error(&single, f64::EPSILON);
    assert!(error <= bound && other_error <= bound, "{error:e}, {other_error:e} of {bound:e}");
    assert!((&one - &other).norm_max() <= 2.0 * bound * other.norm_max());
    assert_eq!(batch.stiffness().to_dense(), single.stiffness().to_dense());
    assert_eq!(batch.counts().rebuilds + single.counts().rebuilds, 0);
    // In f32, before K refines it, what a batch leaves is of the size that its splits leave.
    let (drift, of_splits) = (rough.watch(1).unwrap(), rough_single.watch(1).unwrap());
    assert!(drift > 0.0 && drift <= 4.0 * of_splits, "{drift:e}, by splits {of_splits:e}");
    assert_eq!(rough.counts().rebuilds, 0);
}

/// Room for one tile row of C: the first of three splits fits, the second does not.
#[test]
fn a_batch_without_room_makes_what_fits() {
    let one = DeviceOptions { chunk_tiles: Some(1), ..Default::default() };
    let Some(device) = open("room", one.clone()) else { return };
    let room = {
        let inverse: DeviceInverse<f64> = on_device(row(20), &device).unwrap();
        let used = device.used_bytes();
        drop(inverse);
        used
    };
    let device = open("room", DeviceOptions { most_bytes: Some(room), ..one }).unwrap();
    let mut inverse: DeviceInverse<f64> = on_device(row(20), &device).unwrap();
    let batch = [[0, 4], [5, 9], [10, 14]].map(|slots| Update::Split(bridge(slots)));
    let error = inverse.batch(&batch).unwrap_err();
    let InverseError::Batch { done: 1, source } = error else { panic!("{error}") };
    let InverseError::Storage { cause, .. } = *source else { panic!("{source}") };
    let cause = cause.get().downcast_ref::<GpuError>().unwrap();
    assert!(matches!(cause, GpuError::OutOfMemory { .. }), "{cause}");
    let mut want = row(20);
    want.update(&batch[0]).unwrap();
    assert_eq!(inverse.stiffness().to_dense(), want.to_dense());
    let (_, error, bound) = inverse_and_error(&inverse, f64::EPSILON);
    assert!(error <= bound, "{error:e} of {bound:e}");
}

#[test]
fn a_batch_on_a_lost_device_leaves_k() {
    let Some(device) = open("loss", DeviceOptions::default()) else { return };
    let mut inverse: DeviceInverse<f64> = on_device(row(40), &device).unwrap();
    let k = inverse.stiffness().to_dense();
    device.destroy();
    let error = inverse.batch(&bridges(40)).unwrap_err();
    assert!(matches!(error, InverseError::Batch { done: 0, .. }), "{error}");
    assert!(error.to_string().contains("the device is lost"), "{error}");
    assert_eq!((inverse.vertices(), inverse.stiffness().to_dense()), (40, k));
}
