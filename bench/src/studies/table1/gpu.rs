//! `table1 --gpu`: one vertex in and out with the inverse on a device, beside the dense maintainers
//! of the host and the bound of the device's memory.

use std::sync::Arc;
use std::time::Instant;

use faer::Mat;
use serde::Serialize;
use yawara_gpu::{
    AdapterChoice, Device, DeviceInverse, DeviceOptions, DeviceScalar, DeviceStore, DeviceType,
    on_device,
};
use yawara_inverse_update::{DenseStore, InverseMaintainer, SparseStiffness, build, drift};

use crate::bodies::organ::Organ;
use crate::error::Result;
use crate::harness::machine::Machine;
use crate::harness::report::markdown::{self, Column};
use crate::harness::report::{self, Summary};
use crate::harness::statistics::{median, milliseconds_since};
use crate::solvers::direct::DIRECT;
use crate::studies::race::{Arguments, Defaults};
use crate::workloads::{History, SplitMix64, Update};

/// Version of the JSON layout.
const SCHEMA: &str = "yawara-bench-table1-gpu-2";

const DEFAULTS: Defaults =
    Defaults { vertices: [&[728, 1024, 2048, 3456], &[192, 432]], pairs: [20, 5], direct: &DIRECT };

/// What one method took at one size; medians, ms.
#[derive(Clone, Debug, Serialize)]
struct Row {
    vertices: usize,
    method: String,
    /// The whole start: the inverse by the host, and its way to the device.
    build_ms: f64,
    /// The way of a whole C to the device; of the host none.
    upload_ms: Option<f64>,
    /// One update, the pass over C included.
    split_ms: f64,
    merge_ms: f64,
    /// One of many updates put off and folded in together, the fold included.
    put_off_ms: f64,
    solve_ms: f64,
    /// Columns of three vertices.
    columns_ms: f64,
    /// A read and write of half of C at the rate of a pass that adds nothing; of the host none.
    bound_ms: Option<f64>,
    drift: f64,
}

/// A maintainer, and how its device is waited for; the host's has none.
trait Competitor {
    fn kept(&mut self) -> &mut dyn InverseMaintainer;

    /// From now on puts off so many updates' columns at the most, where it can.
    fn put_off(&mut self, _most: usize) {}

    /// Folds what is put off, if it is to be, and waits until the device is done.
    fn finish(&mut self, _is_folded: bool) -> Result<()> {
        Ok(())
    }

    /// The way of a C of so many rows to the device, ms; C is lost by it.
    fn upload(&mut self, _rows: usize) -> Result<Option<f64>> {
        Ok(None)
    }
}

impl Competitor for Box<dyn InverseMaintainer> {
    fn kept(&mut self) -> &mut dyn InverseMaintainer {
        self.as_mut()
    }
}

impl<E: DeviceScalar> Competitor for DeviceInverse<E> {
    fn kept(&mut self) -> &mut dyn InverseMaintainer {
        self
    }

    fn put_off(&mut self, most: usize) {
        self.set_most_delayed(most);
    }

    fn finish(&mut self, is_folded: bool) -> Result<()> {
        if is_folded {
            self.fold()?;
        }
        Ok(self.store().finish()?)
    }

    fn upload(&mut self, rows: usize) -> Result<Option<f64>> {
        let other = Mat::<f64>::identity(rows, rows);
        let start = Instant::now();
        self.store().load(other.as_ref())?;
        Ok(Some(milliseconds_since(start)))
    }
}

/// The method of that name, which puts off nothing.
fn start(name: &str, k: SparseStiffness, device: &Arc<Device>) -> Result<Box<dyn Competitor>> {
    Ok(match name {
        "gpu" => Box::new(on_device::<f64>(k, device)?.with_most_delayed(0)),
        "gpu_f32" => Box::new(on_device::<f32>(k, device)?.with_most_delayed(0)),
        _ => Box::new(build(name, k)?),
    })
}

/// An update, until all of it is done; ms.
fn timed(competitor: &mut dyn Competitor, update: &Update) -> Result<f64> {
    let start = Instant::now();
    update.apply(competitor.kept())?;
    competitor.finish(false)?;
    Ok(milliseconds_since(start))
}

/// The methods, dense all of them: the host's and the device's.
const METHODS: [&str; 4] = ["woodbury", "woodbury_f32", "gpu", "gpu_f32"];

/// Runs the study on the first device, or on the one of that number or part of a name; writes its
/// files and returns its table.
/// # Errors
/// `BenchError` for bad arguments or without a device (nothing is written then), or a method that
/// fails.
pub fn run(arguments: &Arguments, adapter: Option<&str>) -> Result<String> {
    let machine = Machine::here();
    let settings = arguments.settings(&DEFAULTS, &machine)?;
    let adapter = adapter.map(|adapter| {
        adapter
            .parse()
            .map_or_else(|_| AdapterChoice::Name(adapter.to_owned()), AdapterChoice::Index)
    });
    let device = Device::open(DeviceOptions { adapter, ..Default::default() })?;
    let folder = arguments.common.folder()?;
    let rate = DeviceStore::pass_rate(&device, 5)?;
    let mut rows = Vec::new();
    for &vertices in &settings.vertices {
        let organ = Organ::with_at_most(vertices)?;
        for method in METHODS {
            // Every method gets the same mesh and the same places.
            let mut history = History::refined(&organ, "linear", vertices, 0, settings.seed)?;
            rows.push(row(method, &mut history, rate, &device, settings.pairs)?);
        }
    }
    report::write(&folder, "table1_gpu", &rows, summary(&rows, &machine, &device, rate))
}

/// `rate`: bytes per second, read and written, of a pass over C that adds nothing.
fn summary(rows: &[Row], machine: &Machine, device: &Device, rate: f64) -> Summary {
    let (device, pass_gb_s) = (device.report(), rate / 1e9);
    let is_cpu = device.device_type == DeviceType::Cpu;
    let mut text = format!("```\n{device}\n```\n\n");
    if is_cpu {
        text += "This device is a CPU: the figures say nothing about a card.\n\n";
    }
    text += &format!(
        "A pass over C that adds nothing reads and writes {pass_gb_s:.1} GB/s. The bound is one \
         over half of C at that rate. Medians, ms; rings of rank 3.\n\n"
    );
    let columns: [Column<Row>; 10] = [
        ("vertices, method", |row| format!("{}, {}", row.vertices, row.method)),
        ("build", |row| format!("{:.0}", row.build_ms)),
        ("upload", |row| row.upload_ms.map_or(String::new(), |upload| format!("{upload:.1}"))),
        ("split", |row| format!("{:.3}", row.split_ms)),
        ("merge", |row| format!("{:.3}", row.merge_ms)),
        ("put off", |row| format!("{:.3}", row.put_off_ms)),
        ("solve", |row| format!("{:.3}", row.solve_ms)),
        ("columns", |row| format!("{:.3}", row.columns_ms)),
        ("bound", |row| row.bound_ms.map_or(String::new(), |bound| format!("{bound:.3}"))),
        ("drift", |row| format!("{:.0e}", row.drift)),
    ];
    text += &markdown::rows(rows, &columns);
    Summary::new(text)
        .with("schema", SCHEMA)
        .with("machine", machine)
        .with("device", device.to_string())
        .with("is_cpu", is_cpu)
        .with("pass_gb_s", pass_gb_s)
}

/// One method at one size.
fn row(
    method: &str,
    history: &mut History,
    rate: f64,
    device: &Arc<Device>,
    pairs: usize,
) -> Result<Row> {
    let stiffness = history.stiffness()?;
    let (vertices, dofs) = (stiffness.vertices(), stiffness.dofs());
    let begin = Instant::now();
    let mut competitor = start(method, stiffness, device)?;
    competitor.finish(false)?;
    let build_ms = milliseconds_since(begin);
    let (mut split, mut merge) = (Vec::new(), Vec::new());
    for at in 0..=pairs {
        let [first, second] = history.split_and_merge()?;
        let split_ms = timed(competitor.as_mut(), &first)?;
        let merge_ms = timed(competitor.as_mut(), &second)?;
        // The first pair translates kernels and fills caches.
        if at > 0 {
            split.push(split_ms);
            merge.push(merge_ms);
        }
    }
    let (solve_ms, columns_ms) = use_it(competitor.as_mut(), pairs)?;
    let put_off_ms = put_off(competitor.as_mut(), history, pairs)?;
    let drift = drift(competitor.kept(), 1, 16);
    let numbers = dofs * (dofs + 1) / 2;
    let bytes = if method.ends_with("_f32") { 4 } else { 8 } * numbers;
    let bound = 2.0 * bytes as f64 / rate * 1e3;
    Ok(Row {
        vertices,
        method: method.to_owned(),
        build_ms,
        split_ms: median(&split),
        merge_ms: median(&merge),
        put_off_ms,
        solve_ms,
        columns_ms,
        bound_ms: method.starts_with("gpu").then_some(bound),
        drift,
        upload_ms: competitor.upload(dofs)?,
    })
}

/// Medians of a solve and of columns, ms.
fn use_it(competitor: &mut dyn Competitor, repeats: usize) -> Result<(f64, f64)> {
    let dofs = competitor.kept().stiffness().dofs();
    let tool = SplitMix64(7).three_below(dofs / 3);
    let load: Vec<f64> = (0..dofs).map(|i| (0.3 * i as f64).sin()).collect();
    let mut u = vec![0.0; dofs];
    let (mut solve, mut columns) = (Vec::new(), Vec::new());
    for at in 0..=repeats {
        let start = Instant::now();
        competitor.kept().solve(&load, &mut u)?;
        let middle = Instant::now();
        std::hint::black_box(competitor.kept().columns(&tool)?);
        if at > 0 {
            solve.push((middle - start).as_secs_f64() * 1e3);
            columns.push(milliseconds_since(middle));
        }
    }
    Ok((median(&solve), median(&columns)))
}

/// One of many updates, the last of which folds in all that were put off; on the host one of a run.
fn put_off(competitor: &mut dyn Competitor, history: &mut History, pairs: usize) -> Result<f64> {
    competitor.put_off(yawara_inverse_update::MOST_DELAYED);
    let mut times = Vec::new();
    for at in 0..3 {
        let updates =
            (0..pairs).map(|_| history.split_and_merge()).collect::<Result<Vec<_>, _>>()?;
        let begin = Instant::now();
        for update in updates.iter().flatten() {
            update.apply(competitor.kept())?;
        }
        competitor.finish(true)?;
        if at > 0 {
            times.push(milliseconds_since(begin) / (2 * pairs) as f64);
        }
    }
    Ok(median(&times))
}
