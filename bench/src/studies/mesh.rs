//! `mesh`: shapes, closures, the cost of a split, and what a volume costs to take in.

use std::fmt::Write;
use std::hint::black_box;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use clap::Args;
use nalgebra::Vector3;
use serde::Serialize;
use yawara_mesh::phantom::{LiverPhantom, liver};
use yawara_mesh::{
    BisectionForest, CellGrid, Domain, LabelTree, Lattice, MeshDelta, Placement, Point, Quality,
};

use crate::error::BenchError;
use crate::output::Output;
use crate::plot::{Line, log_log, slope};
use crate::random::SplitMix64;
use crate::statistics::median;

/// What is asked for on the command line.
#[derive(Args, Clone, Debug)]
pub struct Arguments {
    /// Where mesh.csv, mesh.json and the plots go: a new or empty directory.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Up to 10⁵ leaves and 128³ voxels instead of 10⁶ and 256³.
    #[arg(long)]
    pub quick: bool,
    /// Write into a directory that is not empty.
    #[arg(long)]
    pub force: bool,
}

/// A similarity class of tetrahedra.
#[derive(Clone, Debug, Serialize)]
pub struct ShapeRow {
    /// TYPE0, TYPE1 or TYPE2.
    pub shape: String,
    /// Circumradius over shortest edge.
    pub circumradius_over_shortest_edge: f64,
    /// Three inradii over the circumradius.
    pub radius_ratio: f64,
}

/// Requests of random refinement at one generation.
#[derive(Clone, Debug, Serialize)]
pub struct ClosureRow {
    /// Generation of the vertex asked for.
    pub generation: u8,
    /// How many requests.
    pub requests: usize,
    /// Vertices added per request, mean and most.
    pub mean: f64,
    /// The most.
    pub most: usize,
}

/// A split and its merge at random places of a mesh of fixed depth.
#[derive(Clone, Debug, Serialize)]
pub struct UpdateRow {
    /// Leaves of the mesh.
    pub leaves: usize,
    /// Median time of a split with its merge, ns.
    pub split_and_merge_ns: f64,
    /// Reading and writing as many bytes as the ring holds, once, at random places, ns.
    pub ring_pass_ns: f64,
    /// Their ratio.
    pub ratio: f64,
    /// Bytes of the forest per leaf.
    pub bytes_per_leaf: f64,
}

/// A liver phantom taken into a label tree.
#[derive(Clone, Debug, Serialize)]
pub struct VolumeRow {
    /// Voxels along the longest side.
    pub size: usize,
    /// Voxels in all.
    pub voxels: usize,
    /// Heterogeneous tetrahedra.
    pub nodes: usize,
    /// Time of the label tree, s.
    pub seconds: f64,
    /// Voxels per second.
    pub voxels_per_second: f64,
    /// Bytes per heterogeneous tetrahedron.
    pub bytes_per_node: f64,
}

/// The whole study.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Version of this layout.
    pub schema: u32,
    /// Shapes.
    pub shapes: Vec<ShapeRow>,
    /// Closures by generation.
    pub closures: Vec<ClosureRow>,
    /// Updates by size.
    pub updates: Vec<UpdateRow>,
    /// Exponent of time over leaves.
    pub update_slope: f64,
    /// Volumes by size.
    pub volumes: Vec<VolumeRow>,
    /// Exponent of time over heterogeneous tetrahedra.
    pub volume_time_slope: f64,
}

/// Runs the study, writes its files and returns its table.
///
/// # Errors
/// [`BenchError`] for bad arguments; nothing is written then.
pub fn run(arguments: &Arguments) -> Result<String, BenchError> {
    let mut output = Output::create(&arguments.out, arguments.force)?;
    let (cells, sizes): (&[usize], &[usize]) = if arguments.quick {
        (&[3, 6, 13], &[64, 96, 128])
    } else {
        (&[3, 6, 13, 28], &[64, 96, 128, 192, 256])
    };
    let updates: Vec<UpdateRow> = cells.iter().map(|&n| update_row(n)).collect::<Result<_, _>>()?;
    let volumes: Vec<VolumeRow> = sizes.iter().map(|&n| volume_row(n)).collect::<Result<_, _>>()?;
    let times: Vec<(f64, f64)> =
        updates.iter().map(|r| (r.leaves as f64, r.split_and_merge_ns)).collect();
    let trees: Vec<(f64, f64)> = volumes.iter().map(|r| (r.nodes as f64, r.seconds)).collect();
    let report = Report {
        schema: 1,
        shapes: shapes()?,
        closures: closures()?,
        update_slope: slope(&times),
        updates,
        volume_time_slope: slope(&trees),
        volumes,
    };
    let table = table(&report);
    output.write("mesh.csv", &csv(&report))?;
    output.write("mesh.txt", &table)?;
    for (name, svg) in plots(&report, times, trees) {
        output.write(name, &svg)?;
    }
    let json = serde_json::to_string_pretty(&report).map_err(|error| BenchError::Io {
        path: arguments.out.join("mesh.json"),
        source: error.into(),
    })?;
    output.write("mesh.json", &json)?;
    Ok(table)
}

fn forest(cells: usize, start: u8, max: u8) -> Result<BisectionForest, BenchError> {
    let cells = [cells; 3];
    let tree = Arc::new(LabelTree::homogeneous(cells, 1));
    Ok(BisectionForest::new(Domain::full(Lattice::new(cells, max)), tree, start, max)?)
}

fn shapes() -> Result<Vec<ShapeRow>, BenchError> {
    let placement = Placement { origin: Vector3::zeros(), unit: 1.0 };
    (0..3)
        .map(|level| {
            let f = forest(2, level, 3)?;
            let worst = f
                .leaves()
                .map(|t| Quality::of(&t.vertices.map(|v| placement.position(f.point(v)))))
                .reduce(Quality::worse);
            let Quality { radius_ratio, circumradius_over_shortest_edge } = worst
                .unwrap_or(Quality { radius_ratio: 0.0, circumradius_over_shortest_edge: 0.0 });
            let shape = format!("TYPE{level}");
            Ok(ShapeRow { shape, circumradius_over_shortest_edge, radius_ratio })
        })
        .collect()
}

/// Random refinement from 27 to a few thousand vertices.
fn closures() -> Result<Vec<ClosureRow>, BenchError> {
    const MAX_LEVEL: u8 = 18;
    let mut f = forest(2, 0, MAX_LEVEL)?;
    let mut random = SplitMix64(1);
    let mut delta = MeshDelta::empty();
    let mut added = vec![Vec::new(); usize::from(MAX_LEVEL) + 1];
    while f.vertex_count() < 4000 {
        let leaf = random.below(f.leaf_count());
        let Some(p) = f.leaves().nth(leaf).and_then(|tet| f.refinement_point(tet.id)) else {
            continue;
        };
        let generation = f.domain().lattice().generation(p);
        let before = f.vertex_count();
        f.split_with_closure(p, &mut delta, |_, _| ())?;
        added[usize::from(generation)].push(f.vertex_count() - before);
    }
    let row = |(generation, added): (usize, &Vec<usize>)| ClosureRow {
        generation: generation as u8,
        requests: added.len(),
        mean: added.iter().sum::<usize>() as f64 / added.len() as f64,
        most: added.iter().copied().max().unwrap_or(0),
    };
    Ok(added.iter().enumerate().filter(|(_, a)| !a.is_empty()).map(row).collect())
}

/// Bytes that a split touches of one tetrahedron: its own record and its children's.
const BYTES_PER_RING_TET: usize = 3 * 64;

/// Splits per sample: long enough for the clock, short enough for many samples.
const BATCH: usize = 512;

fn update_row(cells: usize) -> Result<UpdateRow, BenchError> {
    let mut f = forest(cells, 3, 6)?;
    let mut random = SplitMix64(2);
    let all = f.candidates();
    let points: Vec<Point> = (0..BATCH * 8).map(|_| all[random.below(all.len())]).collect();
    let mut delta = MeshDelta::empty();
    let ring_bytes = 6 * BYTES_PER_RING_TET;
    let mut memory = vec![1u8; (f.leaf_count() * 64).max(4 * ring_bytes)];
    let (mut times, mut passes) = (Vec::new(), Vec::new());
    for round in 0..5 {
        for batch in points.chunks(BATCH) {
            let begin = Instant::now();
            for &p in batch {
                let v = f.split(p, &mut delta)?;
                f.merge(v, &mut delta)?;
            }
            let split = begin.elapsed().as_nanos() as f64 / batch.len() as f64;
            let starts: Vec<usize> =
                batch.iter().map(|_| random.below(memory.len() - ring_bytes)).collect();
            let begin = Instant::now();
            for &start in &starts {
                for byte in black_box(&mut memory[start..start + ring_bytes]) {
                    *byte = byte.wrapping_add(1);
                }
            }
            let pass = begin.elapsed().as_nanos() as f64 / batch.len() as f64;
            // The first round warms caches and free lists.
            if round > 0 {
                times.push(split);
                passes.push(pass);
            }
        }
    }
    let (split_and_merge_ns, ring_pass_ns) = (median(&times), median(&passes));
    Ok(UpdateRow {
        leaves: f.leaf_count(),
        split_and_merge_ns,
        ring_pass_ns,
        ratio: split_and_merge_ns / ring_pass_ns,
        bytes_per_leaf: f.bytes() as f64 / f.leaf_count() as f64,
    })
}

fn volume_row(size: usize) -> Result<VolumeRow, BenchError> {
    let length_mm = 200.0;
    // The organ with its margin of background fills the grid along its longest side.
    let voxel_mm = length_mm / (size as f64 - 4.0);
    let volume = liver(LiverPhantom { length_mm, voxel_mm, seed: 1 })?;
    let voxels = volume.labels().len();
    let grid = CellGrid::around(&volume, 16)?;
    let mut seconds = f64::INFINITY;
    let mut tree = None;
    for _ in 0..3 {
        let begin = Instant::now();
        tree = Some(LabelTree::new(&volume, grid)?);
        seconds = seconds.min(begin.elapsed().as_secs_f64());
    }
    let (nodes, bytes) = tree.map_or((0, 0), |t| (t.node_count(), t.bytes()));
    Ok(VolumeRow {
        size: volume.grid().dims.into_iter().max().unwrap_or(0),
        voxels,
        nodes,
        seconds,
        voxels_per_second: voxels as f64 / seconds,
        bytes_per_node: bytes as f64 / nodes as f64,
    })
}

fn plots(
    report: &Report,
    times: Vec<(f64, f64)>,
    trees: Vec<(f64, f64)>,
) -> Vec<(&'static str, String)> {
    let passes = report.updates.iter().map(|r| (r.leaves as f64, r.ring_pass_ns)).collect();
    let line = |name: &str, points| Line { name: name.into(), points };
    let updates = log_log(
        "One vertex in and out again",
        ["leaves", "ns"],
        &[line("split + merge", times), line("one pass over the ring's bytes", passes)],
    );
    let volumes = log_log(
        "Volume to label tree",
        ["heterogeneous tetrahedra", "s"],
        &[line("liver phantom, 64 to 256 voxels", trees)],
    );
    [("mesh_updates.svg", updates), ("mesh_volumes.svg", volumes)]
        .into_iter()
        .filter_map(|(name, svg)| svg.map(|svg| (name, svg)))
        .collect()
}

fn csv(report: &Report) -> String {
    let mut text = String::from("table,key,a,b,c,d\n");
    for r in &report.shapes {
        let (radius, ratio) = (r.circumradius_over_shortest_edge, r.radius_ratio);
        let _ = writeln!(text, "shape,{},{radius},{ratio},,", r.shape);
    }
    for r in &report.closures {
        let _ = writeln!(text, "closure,{},{},{},{},", r.generation, r.requests, r.mean, r.most);
    }
    for r in &report.updates {
        let (time, pass) = (r.split_and_merge_ns, r.ring_pass_ns);
        let _ =
            writeln!(text, "update,{},{time},{pass},{},{}", r.leaves, r.ratio, r.bytes_per_leaf);
    }
    for r in &report.volumes {
        let (nodes, seconds) = (r.nodes, r.seconds);
        let _ =
            writeln!(text, "volume,{},{},{nodes},{seconds},{}", r.size, r.voxels, r.bytes_per_node);
    }
    text
}

fn table(report: &Report) -> String {
    let mut text = String::from("shape  circumradius/shortest edge  3 r/R\n");
    for r in &report.shapes {
        let (radius, ratio) = (r.circumradius_over_shortest_edge, r.radius_ratio);
        let _ = writeln!(text, "{:5}  {radius:26.4}  {ratio:5.4}", r.shape);
    }
    text += "\ngeneration  requests  vertices added: mean  most\n";
    for r in &report.closures {
        let _ =
            writeln!(text, "{:10}  {:8}  {:20.2}  {:4}", r.generation, r.requests, r.mean, r.most);
    }
    let (requests, added) = report
        .closures
        .iter()
        .fold((0, 0.0), |(n, a), r| (n + r.requests, a + r.mean * r.requests as f64));
    let _ = writeln!(text, "all         {requests:8}  {:20.2}", added / requests as f64);
    text += "\nleaves    split + merge, ns  one pass over the ring, ns  ratio  bytes/leaf\n";
    for r in &report.updates {
        let (time, pass) = (r.split_and_merge_ns, r.ring_pass_ns);
        let (ratio, bytes) = (r.ratio, r.bytes_per_leaf);
        let _ =
            writeln!(text, "{:8}  {time:17.0}  {pass:26.0}  {ratio:5.1}  {bytes:10.0}", r.leaves);
    }
    let _ = writeln!(text, "time goes with leaves^{:.3}", report.update_slope);
    text += "\nsize  voxels     heterogeneous tets  s       Mvoxel/s  bytes/tet\n";
    for r in &report.volumes {
        let speed = r.voxels_per_second / 1e6;
        let _ = writeln!(
            text,
            "{:4}  {:9}  {:18}  {:6.3}  {speed:8.1}  {:9.1}",
            r.size, r.voxels, r.nodes, r.seconds, r.bytes_per_node
        );
    }
    let _ =
        writeln!(text, "time goes with heterogeneous tetrahedra^{:.2}", report.volume_time_slope);
    text
}
