//! `cracks`: the energy that a cut releases, against fracture mechanics, on even meshes and on graded ones.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Instant;

use nalgebra::Vector3;
use serde::Serialize;
use yawara_embed::{Embedding, Material, by_name};
use yawara_mesh::{
    BisectionForest, Domain, FineFace, LabelTree, Lattice, Placement, Region, Severed, Tet, TetId,
};

use crate::bodies::cube_mesh::CubeMesh;
use crate::error::Result;
use crate::harness::plot::{log_log, slope};
use crate::harness::report::markdown::table;
use crate::harness::report::{self, Summary, curves, spread};
use crate::harness::{Common, Machine, Progress};

/// Version of the JSON layout.
const SCHEMA: &str = "yawara-bench-cracks-1";

/// Meshes have no more vertices than this.
const MOST_VERTICES: usize = 40_000;

/// How far above the middle of the height a crack lies, base cells: in no plane of any mesh.
const ABOVE_MIDDLE: f64 = 0.389;

/// Young's modulus of what stands for the part of a tetrahedron that a sheet lacks, relative to the material's.
const LACKING: f64 = 1e-6;

/// A plane crack in a block of E = 1, ν = 0 and height 1 that is held at the bottom and pulled by σ = 1 at the top.
#[derive(Clone)]
struct Specimen {
    name: &'static str,
    cells: [usize; 3],
    /// Level of the finest tetrahedra, between which cuts go.
    finest: u8,
    /// How far a place in the crack's plane (x, y, base cells) is from its front, negative in the crack.
    beyond: fn([f64; 2]) -> f64,
    /// The energy that it releases, in cells.
    released: fn() -> f64,
    /// Levels of even and of graded meshes, and how many of them are for `--quick`.
    even: &'static [u8],
    graded: &'static [u8],
    quick: [usize; 2],
}

/// Radius of the penny, and length of the edge crack, base cells.
const RADIUS: f64 = 1.0;
const LENGTH: f64 = 2.0;

/// The finest tetrahedra for `--quick`.
const QUICK_FINEST: u8 = 12;

const SPECIMENS: [Specimen; 2] = [
    Specimen {
        name: "penny",
        cells: [6, 6, 6],
        finest: 15,
        beyond: |[x, y]| (x - 3.0).hypot(y - 3.0) - RADIUS,
        released: penny,
        even: &[3, 4, 5, 6, 7],
        graded: &[3, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14],
        quick: [2, 3],
    },
    Specimen {
        name: "edge",
        cells: [4, 1, 12],
        finest: 18,
        beyond: |[x, _]| x - LENGTH,
        released: edge,
        even: &[3, 4, 5, 6, 7, 8, 9],
        graded: &[3, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18],
        quick: [4, 5],
    },
];

/// One mesh of one specimen.
#[derive(Clone, Debug, Serialize)]
struct Row {
    specimen: &'static str,
    mesh: &'static str,
    /// Level of its finest tetrahedra: edges of 2^(−level/3) base cells.
    level: u8,
    vertices: usize,
    /// Energy released by the cut over that of fracture mechanics.
    released: f64,
    error: f64,
    /// Assembly, factor and solution.
    seconds: f64,
}

/// How the two kinds of mesh of a specimen converge, and what one saves.
#[derive(Clone, Debug, Serialize)]
struct Comparison {
    specimen: &'static str,
    /// Of the error over the number of vertices, both as logarithms: the median over pairs of meshes, from level 6 on.
    #[serde(skip_serializing_if = "Option::is_none")]
    even_slope: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    graded_slope: Option<f64>,
    /// Vertices and seconds of the finest even mesh over those of the least graded one whose error is as small.
    #[serde(skip_serializing_if = "Option::is_none")]
    vertices_over_graded: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    seconds_over_graded: Option<f64>,
}

/// A column of the table.
type Figure = fn(&Row) -> String;

const FIGURES: [(&str, Figure); 4] = [
    ("vertices", |row| row.vertices.to_string()),
    ("released over theory", |row| format!("{:.4}", row.released)),
    ("error", |row| format!("{:.2} %", 100.0 * row.error)),
    ("seconds", |row| format!("{:.2}", row.seconds)),
];

/// Runs the study.
///
/// # Errors
/// Those of the folder, of the meshes and of the factor.
pub fn run(arguments: &Common) -> Result<String> {
    let folder = arguments.folder()?;
    let rows = measure(arguments.quick)?;
    let comparisons = SPECIMENS.each_ref().map(|specimen| compare(specimen.name, &rows));
    let machine = Machine::here();
    let mut text = format!("# cracks\n\n{}\n\n", machine.cpu);
    let heads: Vec<String> = FIGURES.map(|(name, _)| name.to_owned()).into();
    let cells: Vec<_> =
        rows.iter().flat_map(|row| FIGURES.map(|(name, figure)| (row, name, figure))).collect();
    let place = |(row, name, _): &(&Row, &str, Figure)| {
        (format!("{}, {}, level {}", row.specimen, row.mesh, row.level), (*name).to_owned())
    };
    text += &table("", &heads, &spread(&heads, cells, place, |(row, _, figure)| figure(row)));
    text.extend(comparisons.iter().map(Comparison::text));
    let summary = Summary::new(text)
        .with("schema", SCHEMA)
        .with("machine", machine)
        .with("comparisons", comparisons)
        .with_file("cracks.svg", plot(&rows));
    report::write(&folder, "cracks", &rows, summary)
}

fn plot(rows: &[Row]) -> Option<String> {
    let name = |row: &Row| format!("{}, {}", row.specimen, row.mesh);
    let lines = curves(rows.iter(), |row| Some((name(row), (row.seconds, row.error))));
    log_log("Energy released by a crack", ["seconds", "relative error"], &lines)
}

fn measure(quick: bool) -> Result<Vec<Row>> {
    let mut cases = Vec::new();
    for mut specimen in SPECIMENS {
        if quick {
            specimen.finest = QUICK_FINEST;
        }
        let kinds = [("even", specimen.even), ("graded", specimen.graded)];
        for ((kind, levels), few) in kinds.into_iter().zip(specimen.quick) {
            let levels = if quick { &levels[..few] } else { levels };
            cases.extend(levels.iter().map(|&level| (specimen.clone(), kind, level)));
        }
    }
    let mut progress = Progress::new(cases.len() as f64);
    let mut rows = Vec::new();
    for (specimen, kind, level) in cases {
        rows.push(specimen.solve(kind, level)?);
        progress.advance(&format!("{}, {kind}, level {level}", specimen.name), 1.0);
    }
    Ok(rows)
}

impl Specimen {
    /// Height of the crack's plane, base cells.
    fn height(&self) -> f64 {
        0.5 * self.cells[2] as f64 + ABOVE_MIDDLE
    }

    fn solve(&self, mesh: &'static str, level: u8) -> Result<Row> {
        let tree = Arc::new(LabelTree::homogeneous(self.cells, 1));
        let lattice = Lattice::new(self.cells, self.finest);
        let domain = Domain::full(lattice);
        let mut forest = BisectionForest::new(domain, Arc::clone(&tree), 0, self.finest)?;
        let cell = f64::from(lattice.units);
        let wants = |forest: &BisectionForest, tet: &Tet| {
            mesh == "even" || self.is_coarse(forest, tet, level, cell)
        };
        forest.refine_where(level, MOST_VERTICES, Region::Everywhere, &wants)?;
        let materials = [LACKING, 1.0].map(|young| Material::new(young, 0.0, 1.0));
        let materials = materials.into_iter().collect::<Result<Vec<_>, _>>()?;
        let mut embedding = Embedding::new(tree, materials, by_name("laminate")?)?;
        let delta = forest.sever(&self.crossed(&forest))?;
        embedding.adopt(Arc::clone(forest.tree()), &delta.parts)?;
        let cells = self.cells.map(|count| count as f64);
        let placement = Placement { origin: Vector3::zeros(), unit: 1.0 / (cells[2] * cell) };
        let vertices = forest.vertex_count();
        let cut = CubeMesh { forest: Arc::new(forest), placement };
        let begin = Instant::now();
        let [work, _] = cut.solve(&embedding)?.compliances;
        let seconds = begin.elapsed().as_secs_f64();
        // Uncut it is stretched evenly: σ²/E times its volume.
        let whole = cells[0] * cells[1] / cells[2].powi(2);
        let released = 0.5 * (work - whole) * cells[2].powi(3) / (self.released)();
        let error = (released - 1.0).abs();
        Ok(Row { specimen: self.name, mesh, level, vertices, released, error, seconds })
    }

    /// Whether a tetrahedron is larger than a graded mesh has it there: its edges √(h r), h the finest and r from the
    /// front, which spreads the error evenly where strains grow with r^(−½).
    fn is_coarse(&self, forest: &BisectionForest, tet: &Tet, level: u8, cell: f64) -> bool {
        let size = |level: u8| (-f64::from(level) / 3.0).exp2();
        let corners = tet.vertices.map(|v| Vector3::from(forest.point(v).map(f64::from)) / cell);
        let middle = corners.iter().sum::<Vector3<f64>>() * 0.25;
        let away = (self.beyond)([middle.x, middle.y]).hypot(middle.z - self.height());
        let finest = size(level);
        size(tet.level) > (finest * away.max(finest)).sqrt() * (1.0 + 1e-9)
    }

    /// The faces of finest tetrahedra that the crack parts.
    fn crossed(&self, forest: &BisectionForest) -> Vec<Severed> {
        let cell = f64::from(forest.domain().lattice().units);
        let units = cell * f64::from(forest.finest_units());
        let height = self.height();
        let beside = 2.0 * (-f64::from(self.finest) / 3.0).exp2();
        let mut open: HashMap<FineFace, (TetId, Vector3<f64>)> = HashMap::new();
        let mut found = Vec::new();
        for leaf in forest.leaves() {
            let z = leaf.vertices.map(|v| f64::from(forest.point(v)[2]) / cell);
            if z.iter().all(|z| *z < height - beside) || z.iter().all(|z| *z > height + beside) {
                continue;
            }
            for fine in forest.finest_in(&leaf) {
                let corners = fine.corners.map(|p| Vector3::from(p.map(f64::from)) / units);
                let middle = corners.iter().sum::<Vector3<f64>>() * 0.25;
                if (middle.z - height).abs() > beside {
                    continue;
                }
                for face in fine.faces {
                    let Some((other, there)) = open.remove(&face) else {
                        open.insert(face, (leaf.id, middle));
                        continue;
                    };
                    let between = 0.5 * (there + middle);
                    let is_parted = (there.z > height) != (middle.z > height);
                    if is_parted && (self.beyond)([between.x, between.y]) < 0.0 {
                        found.push(Severed { face, leaves: [other, leaf.id] });
                    }
                }
            }
        }
        found
    }
}

/// The integral of a function from 0 to `end`, by Simpson's rule.
fn integral(end: f64, of: impl Fn(f64) -> f64) -> f64 {
    const PARTS: usize = 200;
    let step = end / PARTS as f64;
    let weight = |i: usize| match i {
        0 | PARTS => 1.0,
        _ if i % 2 == 1 => 4.0,
        _ => 2.0,
    };
    (0..=PARTS).map(|i| weight(i) * of(i as f64 * step)).sum::<f64>() * step / 3.0
}

/// A penny-shaped crack in a cylinder as wide as the block: K = (2/π) σₙ √(πa) (1 + α/2 − 5α²/8 + .421 α³) √(1 − α),
/// α = a/b, σₙ = σ/(1 − α²).
/// # Source
/// Benthem and Koiter 1973, in Tada, Paris, Irwin, The Stress Analysis of Cracks Handbook.
fn penny() -> f64 {
    use std::f64::consts::PI;
    let wide = 6.0 / PI.sqrt();
    // G = K²/E on the front of length 2πa.
    integral(RADIUS, |a| {
        let alpha = a / wide;
        let shape = 1.0 + alpha / 2.0 - 0.625 * alpha.powi(2) + 0.421 * alpha.powi(3);
        let k = 2.0 / PI * (PI * a).sqrt() * shape * (1.0 - alpha).sqrt() / (1.0 - alpha.powi(2));
        k * k * 2.0 * PI * a
    })
}

/// A crack at one edge of a strip under tension: K = σ √(πa) (1.122 − .231 α + 10.55 α² − 21.71 α³ + 30.382 α⁴), α = a/W,
/// to .5 %.
/// # Source
/// Gross and Srawley 1964, Brown and Srawley 1966, in Tada, Paris, Irwin, The Stress Analysis of Cracks Handbook.
fn edge() -> f64 {
    integral(LENGTH, |a| {
        let alpha = a / 4.0;
        let shape = 1.122 - 0.231 * alpha + 10.55 * alpha.powi(2) - 21.71 * alpha.powi(3)
            + 30.382 * alpha.powi(4);
        std::f64::consts::PI * a * shape * shape
    })
}

fn compare(specimen: &'static str, rows: &[Row]) -> Comparison {
    let of = |mesh: &'static str| {
        let own = rows.iter().filter(move |row| row.specimen == specimen && row.mesh == mesh);
        own.collect::<Vec<_>>()
    };
    let (even, graded) = (of("even"), of("graded"));
    let falls = |rows: &[&Row]| {
        let late = rows.iter().filter(|row| row.level >= 6);
        let points: Vec<_> = late.map(|row| (row.vertices as f64, row.error)).collect();
        (points.len() > 1).then(|| slope(&points))
    };
    let finest = even.last();
    let as_good = |finest: &&&Row| {
        let good = graded.iter().filter(|row| row.error <= finest.error);
        good.min_by_key(|row| row.vertices).copied()
    };
    let ratio = |figure: fn(&Row) -> f64| {
        let (finest, graded) = (finest?, finest.as_ref().and_then(as_good)?);
        Some(figure(finest) / figure(graded))
    };
    Comparison {
        specimen,
        even_slope: falls(&even),
        graded_slope: falls(&graded),
        vertices_over_graded: ratio(|row| row.vertices as f64),
        seconds_over_graded: ratio(|row| row.seconds),
    }
}

impl Comparison {
    fn text(&self) -> String {
        let say = |x: Option<f64>| x.map_or("-".to_owned(), |x| format!("{x:.2}"));
        format!(
            "{}: error falls with vertices to the power {} on even meshes, {} on graded ones; the finest even mesh has {} times the \
             vertices of a graded one that is as good, and takes {} times as long.\n",
            self.specimen,
            say(self.even_slope),
            say(self.graded_slope),
            say(self.vertices_over_graded),
            say(self.seconds_over_graded),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sneddon 1946: 8 σ² a³/(3E) in an infinite body without a Poisson ratio.
    #[test]
    fn theory_is_that_of_small_cracks() {
        let [found, infinite] = [penny(), 8.0 / 3.0 * RADIUS.powi(3)];
        assert!(found > infinite && found < 1.03 * infinite, "{found} and {infinite}");
        // The strip as a half space would release π (1.122 a)²/2.
        assert!(edge() > 0.5 * std::f64::consts::PI * (1.122 * LENGTH).powi(2));
    }
}
