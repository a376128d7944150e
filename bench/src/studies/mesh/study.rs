//! `mesh`: shapes, closures, the cost of a split, and what a volume costs to take in.

use std::fmt::Write;
use std::sync::Arc;

use nalgebra::Vector3;
use serde::Serialize;
use yawara_mesh::{BisectionForest, Domain, LabelTree, Lattice, MeshDelta, Placement, Quality};

use super::arguments::Common;
use crate::error::BenchError;
use crate::output::Output;
use crate::plot::{Line, log_log, slope};
use crate::random::SplitMix64;
use crate::studies::mesh_updates::{UpdateCost, UpdateRow, UpdateSlopes, update_row};
use crate::studies::mesh_volumes::{self, VolumeRow};

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
    /// Exponents of their times over leaves.
    pub update_slopes: UpdateSlopes,
    /// Volumes by size.
    pub volumes: Vec<VolumeRow>,
    /// Exponent of the tree's time over heterogeneous tetrahedra.
    pub volume_time_slope: f64,
    /// Exponent of the forest's time over its leaves.
    pub forest_time_slope: f64,
}

/// Runs the study, writes its files and returns its table.
///
/// # Errors
/// [`BenchError`] for bad arguments; nothing is written then.
pub fn run(arguments: &Common) -> Result<String, BenchError> {
    let mut output = Output::create(&arguments.out, arguments.force)?;
    let (cells, sizes): (&[usize], &[usize]) = if arguments.quick {
        (&[3, 6, 13], &[64, 96, 128])
    } else {
        (&[3, 6, 13, 28], &[64, 96, 128, 192, 256])
    };
    let updates: Vec<UpdateRow> =
        cells.iter().map(|&n| update_row(&mut forest(n, 3, 6)?)).collect::<Result<_, _>>()?;
    let volumes: Vec<VolumeRow> =
        sizes.iter().map(|&n| mesh_volumes::row(n)).collect::<Result<_, _>>()?;
    let trees: Vec<(f64, f64)> = volumes.iter().map(|r| (r.nodes as f64, r.seconds)).collect();
    let forests: Vec<(f64, f64)> =
        volumes.iter().map(|r| (r.forest_leaves as f64, r.forest_seconds)).collect();
    let report = Report {
        schema: 3,
        shapes: shapes()?,
        closures: closures()?,
        update_slopes: UpdateSlopes::of(&updates),
        updates,
        volume_time_slope: slope(&trees),
        forest_time_slope: slope(&forests),
        volumes,
    };
    let table = table(&report);
    output.write("mesh.csv", &csv(&report))?;
    output.write("mesh.txt", &table)?;
    for (name, svg) in plots(&report, trees) {
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

fn plots(report: &Report, trees: Vec<(f64, f64)>) -> Vec<(&'static str, String)> {
    let line = |name: &str, points| Line { name: name.into(), points };
    let over_leaves = |name: &str, value: &dyn Fn(&UpdateRow) -> f64| {
        line(name, report.updates.iter().map(|r| (r.leaves as f64, value(r))).collect())
    };
    let updates = log_log(
        "One vertex in and out again",
        ["leaves", "ns"],
        &[
            over_leaves("random places", &|r| r.random.split_and_merge_ns),
            over_leaves("a sweep", &|r| r.local.split_and_merge_ns),
            over_leaves("one pass over the rings' memory, random", &|r| r.random.ring_pass_ns),
            over_leaves("one pass over the rings' memory, sweep", &|r| r.local.ring_pass_ns),
        ],
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
    let mut text = String::from("table,key,a,b,c,d,e\n");
    for r in &report.shapes {
        let (radius, ratio) = (r.circumradius_over_shortest_edge, r.radius_ratio);
        let _ = writeln!(text, "shape,{},{radius},{ratio},,,", r.shape);
    }
    for r in &report.closures {
        let _ = writeln!(text, "closure,{},{},{},{},,", r.generation, r.requests, r.mean, r.most);
    }
    for r in &report.updates {
        for (places, cost) in [("random", &r.random), ("local", &r.local)] {
            let UpdateCost { split_and_merge_ns: time, ring_pass_ns: pass, ratio } = cost;
            let (leaves, bytes) = (r.leaves, r.bytes_per_leaf);
            let _ = writeln!(text, "update_{places},{leaves},{time},{pass},{ratio},{bytes},");
        }
    }
    for r in &report.volumes {
        let _ = writeln!(
            text,
            "volume,{},{},{},{},{},{},{}",
            r.size,
            r.voxels,
            r.nodes,
            r.seconds,
            r.bytes_per_node,
            r.forest_leaves,
            r.forest_seconds
        );
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
    text += "\n          random places: split + merge, a pass over the rings, ratio; a sweep: the same\n";
    text += "leaves          ns      ns  ratio      ns      ns  ratio  bytes/leaf\n";
    for r in &report.updates {
        let columns = [&r.random, &r.local].map(|c| {
            format!("{:6.0}  {:6.0}  {:5.1}", c.split_and_merge_ns, c.ring_pass_ns, c.ratio)
        });
        let _ = writeln!(text, "{:8}  {}  {:10.0}", r.leaves, columns.join("  "), r.bytes_per_leaf);
    }
    let UpdateSlopes { random, local, ring_pass, random_ratio } = report.update_slopes;
    let _ = writeln!(
        text,
        "time goes with leaves^{random:.3} at random places, leaves^{local:.3} in a sweep;\n\
         at random places the pass with leaves^{ring_pass:.3}, the ratio with leaves^{random_ratio:.3}"
    );
    text += &mesh_volumes::table(&report.volumes);
    let _ = writeln!(
        text,
        "the tree's time goes with heterogeneous tetrahedra^{:.2}, the forest's with its leaves^{:.2}",
        report.volume_time_slope, report.forest_time_slope
    );
    text
}
