//! What the study finds, prints and draws.

use serde::Serialize;
use yawara_embed::CHOICES;

use crate::error::{BenchError, Result};
use crate::harness::plot::log_log;
use crate::harness::report::markdown::{self, Column, Line, milliseconds, table};
use crate::harness::report::{curves, each_once, spread};

/// One choice on one case.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Row {
    /// What the cube holds.
    pub case: &'static str,
    /// Largest over smallest Young's modulus.
    pub ratio: f64,
    /// Poisson's ratio of all materials.
    pub nu: f64,
    /// Levels from the finest mesh to the coarse one.
    pub levels: u8,
    pub choice: &'static str,
    /// Coarse displacement, linear between coarse vertices, against that of the fine solution:
    /// relative L2 error, mean of tension and shear.
    pub error_coarse: f64,
    /// The same with all finer vertices where the embedding has them.
    pub error_fine: f64,
    /// Relative error of the loads' work, mean of tension and shear.
    pub compliance_error: f64,
    /// Smallest eigenvalue of the coarse tetrahedra's elasticity; the matrix has E = 1.
    pub min_eigenvalue: f64,
    /// Time to homogenise all levels, s.
    pub seconds: f64,
    /// Memory of the homogenised materials.
    pub bytes: usize,
    /// Whether the case is one of the mean.
    #[serde(skip)]
    pub counts: bool,
}

/// The error of one choice, mean over the further media.
#[derive(Clone, Debug, Serialize)]
pub(super) struct MediaMean {
    pub choice: &'static str,
    pub levels: u8,
    /// As in [`Row`].
    pub error_coarse: f64,
    /// As in [`Row`].
    pub error_fine: f64,
}

/// What it costs to homogenise an organ of 128 voxels' length.
pub(super) struct PhantomCost {
    pub choice: &'static str,
    /// Heterogeneous tetrahedra.
    pub nodes: usize,
    pub seconds: f64,
    pub bytes: usize,
}

impl Row {
    /// Refuses a figure that nobody can read.
    pub(super) fn checked(self) -> Result<Self> {
        let figures = [
            ("error_coarse", self.error_coarse),
            ("error_fine", self.error_fine),
            ("compliance_error", self.compliance_error),
            ("min_eigenvalue", self.min_eigenvalue),
        ];
        let Some((name, value)) = figures.into_iter().find(|(_, value)| !value.is_finite()) else {
            return Ok(self);
        };
        Err(BenchError::NotFinite(format!("{name} of {} by {}", self.case, self.choice), value))
    }
}

fn column(row: &Row) -> String {
    format!("ν {}, {} levels", row.nu, row.levels)
}

/// Means over the cases, then every case; percent.
pub(super) fn tables(rows: &[Row]) -> String {
    let heads = each_once(rows.iter().map(column));
    let mut text = String::new();
    type Figure = fn(&Row) -> f64;
    let values: [(&str, Figure); 3] = [
        ("L2 error, %", |r| r.error_coarse),
        ("L2 error of the embedded mesh, %", |r| r.error_fine),
        ("error of the compliance, %", |r| r.compliance_error),
    ];
    for (corner, value) in values {
        let mean = |name: &str, of: &dyn Fn(&Row) -> bool| -> Line {
            let cell = |head: &String| {
                let found = rows.iter().filter(|r| column(r) == *head && of(r));
                let found: Vec<f64> = found.map(value).collect();
                percent(found.iter().sum::<f64>() / found.len() as f64)
            };
            (name.to_owned(), heads.iter().map(cell).collect())
        };
        let mut lines =
            vec![mean("homogeneous", &|r| r.case == "homogeneous" && r.choice == "linear")];
        for choice in CHOICES {
            lines.push(mean(choice, &|r| r.counts && r.choice == *choice));
        }
        text += &table(&format!("mean {corner}"), &heads, &lines);
    }
    let place = |r: &&Row| (format!("{} {:.0e}, {}", r.case, r.ratio, r.choice), column(r));
    let lines = spread(&heads, rows, place, |row| {
        format!("{} / {}", percent(row.error_coarse), percent(row.error_fine))
    });
    text += &table("L2 error coarse / embedded, %", &heads, &lines);
    let cost = |&choice: &&str| {
        let rows = rows.iter().filter(|r| r.choice == choice);
        let mean = rows.clone().map(|r| r.seconds).sum::<f64>() / rows.clone().count() as f64;
        let bytes = rows.map(|r| r.bytes).max().unwrap_or(0);
        (choice.to_owned(), vec![milliseconds(1e3 * mean), (bytes / 1000).to_string()])
    };
    let costs: Vec<Line> = CHOICES.iter().map(cost).collect();
    text + &table("precompute", &["ms, mean", "kB, most"].map(str::to_owned), &costs)
}

/// Means over the further media, by choice and levels.
pub(super) fn means(media: &[Row]) -> Vec<MediaMean> {
    let mut means = Vec::new();
    for (&choice, levels) in CHOICES
        .iter()
        .flat_map(|c| each_once(media.iter().map(|r| r.levels)).into_iter().map(move |l| (c, l)))
    {
        let of = |r: &&Row| r.choice == choice && r.levels == levels;
        let found: Vec<&Row> = media.iter().filter(of).collect();
        let mean = |figure: fn(&Row) -> f64| {
            found.iter().map(|&r| figure(r)).sum::<f64>() / found.len() as f64
        };
        let (error_coarse, error_fine) = (mean(|r| r.error_coarse), mean(|r| r.error_fine));
        means.push(MediaMean { choice, levels, error_coarse, error_fine });
    }
    means
}

/// The further media: every one of them, coarse error, and their mean.
pub(super) fn media(media: &[Row], means: &[MediaMean]) -> String {
    let column = |choice: &str, levels: u8| format!("{choice}, {levels}");
    let heads = each_once(media.iter().map(|r| column(r.choice, r.levels)));
    let place =
        |r: &&Row| (format!("{} {:.0e}, ν {}", r.case, r.ratio, r.nu), column(r.choice, r.levels));
    let mut lines = spread(&heads, media, place, |row| percent(row.error_coarse));
    let mean = |head: &String| {
        let found = means.iter().find(|m| column(m.choice, m.levels) == *head);
        found.map_or(String::new(), |m| percent(m.error_coarse))
    };
    lines.push(("mean".to_owned(), heads.iter().map(mean).collect()));
    table("media: L2 error, % (choice, levels)", &heads, &lines)
}

/// What the organ took.
pub(super) fn costs(costs: &[PhantomCost]) -> String {
    let columns: [Column<PhantomCost>; 5] = [
        ("liver phantom of 128 voxels", |cost| cost.choice.to_owned()),
        ("tetrahedra", |cost| cost.nodes.to_string()),
        ("s", |cost| format!("{:.3}", cost.seconds)),
        ("ns per tetrahedron", |cost| format!("{:.0}", 1e9 * cost.seconds / cost.nodes as f64)),
        ("MB", |cost| format!("{:.1}", cost.bytes as f64 * 1e-6)),
    ];
    markdown::rows(costs, &columns)
}

fn percent(value: f64) -> String {
    match 100.0 * value {
        x if x.is_nan() => String::new(),
        x if x >= 1000.0 => format!("{x:.0e}"),
        x if x >= 99.95 => format!("{x:.0}"),
        x if x >= 9.995 => format!("{x:.1}"),
        x => format!("{x:.2}"),
    }
}

/// Error over the ratio of moduli, spheres at ν = 0.3.
pub(super) fn plot(rows: &[Row]) -> Option<String> {
    let spheres = rows.iter().filter(|r| r.case == "sphere" && r.nu == 0.3);
    let curves = curves(spheres, |r| {
        Some((format!("{}, {} levels", r.choice, r.levels), (r.ratio, r.error_coarse)))
    });
    log_log("A stiff sphere, ν = 0.3", ["ratio of moduli", "relative L2 error"], &curves)
}
