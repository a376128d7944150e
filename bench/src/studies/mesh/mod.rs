//! `mesh`: shapes, closures, the cost of a split, and what a volume costs to take in.
//!
//! Its two larger parts are measured in `updates.rs` and `volumes.rs`.

mod updates;
mod volumes;

use std::sync::Arc;

use nalgebra::Vector3;
use serde::Serialize;
use serde_json::{Map, Value, json};
use yawara_mesh::{BisectionForest, Domain, LabelTree, Lattice, MeshDelta, Quality};

use crate::error::Result;
use crate::harness::arguments::Common;
use crate::harness::plot::{Curve, log_log, slope};
use crate::harness::report::markdown::{self, Column};
use crate::harness::report::{self, Summary};
use crate::workloads::random::SplitMix64;
use updates::{UpdateCost, UpdateRow};
use volumes::VolumeRow;

/// Version of the JSON layout.
const SCHEMA: u32 = 4;

/// A similarity class of tetrahedra.
#[derive(Clone, Debug, Serialize)]
struct ShapeRow {
    /// TYPE0, TYPE1 or TYPE2.
    shape: String,
    circumradius_over_shortest_edge: f64,
    /// Three inradii over the circumradius.
    radius_ratio: f64,
}

/// Requests of random refinement for vertices of one generation.
#[derive(Clone, Debug, Serialize)]
struct ClosureRow {
    generation: u8,
    requests: usize,
    /// Vertices added per request, mean and most.
    mean: f64,
    most: usize,
}

/// Exponents over leaves.
#[derive(Clone, Debug, Serialize)]
struct UpdateSlopes {
    /// Of the times at random places and in a sweep.
    random: f64,
    local: f64,
    /// Of one pass over the rings' memory at random places: what the machine's caches do.
    ring_pass: f64,
    /// Of the ratio to that pass at random places.
    random_ratio: f64,
}

/// A line of the CSV file: a table's name, a key, and that table's columns.
fn line(table: &str, key: impl ToString, values: &[f64]) -> Map<String, Value> {
    let names = [("table", json!(table)), ("key", json!(key.to_string()))];
    let values = ["a", "b", "c", "d", "e", "f"].into_iter().zip(values.iter().map(|x| json!(x)));
    names.into_iter().chain(values).map(|(name, value)| (name.to_owned(), value)).collect()
}

/// Runs the study.
pub fn run(arguments: &Common) -> Result<String> {
    let folder = arguments.folder()?;
    let (cells, sizes): (&[usize], &[usize]) = match arguments.quick {
        true => (&[3, 6, 13], &[64, 96, 128]),
        false => (&[3, 6, 13, 28], &[64, 96, 128, 192, 256]),
    };
    let update = |&n: &usize| updates::row(&mut forest(n, 3, 6)?);
    let found = Found {
        updates: cells.iter().map(update).collect::<Result<_, _>>()?,
        volumes: sizes.iter().map(|&n| volumes::row(n)).collect::<Result<_, _>>()?,
        shapes: shapes()?,
        closures: closures()?,
    };
    report::write(&folder, "mesh", &found.lines(), found.summary())
}

/// Everything measured, table by table.
struct Found {
    shapes: Vec<ShapeRow>,
    closures: Vec<ClosureRow>,
    updates: Vec<UpdateRow>,
    volumes: Vec<VolumeRow>,
}

fn forest(cells: usize, start: u8, max: u8) -> Result<BisectionForest> {
    let cells = [cells; 3];
    let tree = Arc::new(LabelTree::homogeneous(cells, 1));
    Ok(BisectionForest::new(Domain::full(Lattice::new(cells, max)), tree, start, max)?)
}

fn shapes() -> Result<Vec<ShapeRow>> {
    let mut rows = Vec::new();
    for level in 0..3 {
        let f = forest(2, level, 3)?;
        let rest = |v| Vector3::from(f.point(v).map(f64::from));
        let worst = f.leaves().map(|t| Quality::of(&t.vertices.map(rest))).reduce(Quality::worse);
        rows.extend(worst.map(|quality| ShapeRow {
            shape: format!("TYPE{level}"),
            circumradius_over_shortest_edge: quality.circumradius_over_shortest_edge,
            radius_ratio: quality.radius_ratio,
        }));
    }
    Ok(rows)
}

/// Random refinement from 27 to a few thousand vertices.
fn closures() -> Result<Vec<ClosureRow>> {
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

impl Found {
    fn summary(&self) -> Summary {
        let Found { shapes, closures, updates, volumes } = self;
        let fit = |figure: fn(&UpdateRow) -> f64| {
            slope(&updates.iter().map(|r| (r.leaves as f64, figure(r))).collect::<Vec<_>>())
        };
        let slopes = UpdateSlopes {
            random: fit(|r| r.random.split_and_merge_ns),
            local: fit(|r| r.local.split_and_merge_ns),
            ring_pass: fit(|r| r.random.ring_pass_ns),
            random_ratio: fit(|r| r.random.ratio),
        };
        let trees: Vec<(f64, f64)> = volumes.iter().map(|r| (r.nodes as f64, r.seconds)).collect();
        let forests: Vec<(f64, f64)> =
            volumes.iter().map(|r| (r.forest_leaves as f64, r.forest_seconds)).collect();
        let [tree_slope, forest_slope] = [slope(&trees), slope(&forests)];
        let UpdateSlopes { random, local, ring_pass, random_ratio } = &slopes;
        let text = self.element_tables()
            + &self.update_table()
            + &format!(
                "Time goes with leaves^{random:.3} at random places, leaves^{local:.3} in a sweep; \
                 at random places the pass with leaves^{ring_pass:.3}, the ratio with \
                 leaves^{random_ratio:.3}.\n\n"
            )
            + &volumes::table(volumes)
            + &format!(
                "The tree's time goes with heterogeneous tetrahedra^{tree_slope:.2}, the forest's \
                 with its leaves^{forest_slope:.2}.\n"
            );
        let curve = Curve { name: "liver phantom, 64 to 256 voxels".into(), points: trees };
        let titles = ["heterogeneous tetrahedra", "s"];
        Summary::new(text)
            .with("schema", SCHEMA)
            .with("shapes", shapes)
            .with("closures", closures)
            .with("updates", updates)
            .with("update_slopes", slopes)
            .with("volumes", volumes)
            .with("volume_time_slope", tree_slope)
            .with("forest_time_slope", forest_slope)
            .with_file("mesh_updates.svg", self.update_chart())
            .with_file("mesh_volumes.svg", log_log("Volume to label tree", titles, &[curve]))
    }

    fn lines(&self) -> Vec<Map<String, Value>> {
        let mut lines = Vec::new();
        for r in &self.shapes {
            let values = [r.circumradius_over_shortest_edge, r.radius_ratio];
            lines.push(line("shape", &r.shape, &values));
        }
        for r in &self.closures {
            let values = [r.requests as f64, r.mean, r.most as f64];
            lines.push(line("closure", r.generation, &values));
        }
        for r in &self.updates {
            for (table, cost) in [("update_random", &r.random), ("update_local", &r.local)] {
                let UpdateCost { split_and_merge_ns, ring_pass_ns, ratio } = *cost;
                let values = [split_and_merge_ns, ring_pass_ns, ratio, r.bytes_per_leaf];
                lines.push(line(table, r.leaves, &values));
            }
        }
        for r in &self.volumes {
            let [voxels, nodes, leaves] = [r.voxels, r.nodes, r.forest_leaves].map(|n| n as f64);
            let values = [voxels, nodes, r.seconds, r.bytes_per_node, leaves, r.forest_seconds];
            lines.push(line("volume", r.size, &values));
        }
        lines
    }

    fn element_tables(&self) -> String {
        let shapes: [Column<ShapeRow>; 3] = [
            ("shape", |r| r.shape.clone()),
            ("circumradius/shortest edge", |r| format!("{:.4}", r.circumradius_over_shortest_edge)),
            ("3 r/R", |r| format!("{:.4}", r.radius_ratio)),
        ];
        let closure = |r: &ClosureRow| {
            let cells = [r.requests.to_string(), format!("{:.2}", r.mean), r.most.to_string()];
            (r.generation.to_string(), cells.to_vec())
        };
        let mut closures: Vec<_> = self.closures.iter().map(closure).collect();
        let requests: usize = self.closures.iter().map(|r| r.requests).sum();
        let added: f64 = self.closures.iter().map(|r| r.mean * r.requests as f64).sum();
        let mean = format!("{:.2}", added / requests as f64);
        closures.push(("all".into(), vec![requests.to_string(), mean, String::new()]));
        let heads = ["requests", "vertices added: mean", "most"].map(str::to_owned);
        markdown::rows(&self.shapes, &shapes) + &markdown::table("generation", &heads, &closures)
    }

    fn update_table(&self) -> String {
        let columns: [Column<UpdateRow>; 8] = [
            ("split + merge, leaves", |r| r.leaves.to_string()),
            ("random places: ns", |r| format!("{:.0}", r.random.split_and_merge_ns)),
            ("pass over the rings, ns", |r| format!("{:.0}", r.random.ring_pass_ns)),
            ("ratio", |r| format!("{:.1}", r.random.ratio)),
            ("a sweep: ns", |r| format!("{:.0}", r.local.split_and_merge_ns)),
            ("pass, ns", |r| format!("{:.0}", r.local.ring_pass_ns)),
            ("ratio", |r| format!("{:.1}", r.local.ratio)),
            ("bytes/leaf", |r| format!("{:.0}", r.bytes_per_leaf)),
        ];
        markdown::rows(&self.updates, &columns)
    }

    fn update_chart(&self) -> Option<String> {
        type Figure = fn(&UpdateRow) -> f64;
        let values: [(&str, Figure); 4] = [
            ("random places", |r| r.random.split_and_merge_ns),
            ("a sweep", |r| r.local.split_and_merge_ns),
            ("one pass over the rings' memory, random", |r| r.random.ring_pass_ns),
            ("one pass over the rings' memory, sweep", |r| r.local.ring_pass_ns),
        ];
        let curves = values.map(|(name, value)| Curve {
            name: name.to_owned(),
            points: self.updates.iter().map(|r| (r.leaves as f64, value(r))).collect(),
        });
        log_log("One vertex in and out again", ["leaves", "ns"], &curves)
    }
}
