//! The findings of the study `inverse`, as CSV, JSON and a table.

use std::fmt::Write;

use serde::Serialize;

/// Version of the JSON layout.
pub(crate) const SCHEMA: &str = "yawara-bench-inverse-1";

/// All findings.
#[derive(Debug, Serialize)]
pub(crate) struct Report {
    pub schema: &'static str,
    pub body: &'static str,
    /// Vertices of the start mesh, and those of them that are not fixed.
    pub vertices: usize,
    pub free_vertices: usize,
    pub updates: usize,
    pub seed: u64,
    /// Threads that the LU may use; updates and solves use one.
    pub threads: usize,
    pub rows: Vec<Row>,
    pub lu: Vec<LuRow>,
}

/// One maintainer under one homogenisation.
#[derive(Debug, Serialize)]
pub(crate) struct Row {
    pub homogenisation: &'static str,
    pub maintainer: &'static str,
    /// Rows of K at the end.
    pub dofs: usize,
    pub rank_p50: f64,
    pub rank_max: f64,
    pub split: Times,
    pub merge: Times,
    pub solve: Times,
    /// ‖C − C_LU‖_F / ‖C_LU‖_F at the end.
    pub error: f64,
    /// Largest √K_jj ‖D^(−½)(K c_j − e_j)‖ over a few columns at the end.
    pub drift: f64,
    pub rebuilds: usize,
}

/// Times of one operation; ratios are medians of ratios within one round.
#[derive(Debug, Serialize)]
pub(crate) struct Times {
    pub count: usize,
    pub p50_ms: f64,
    pub p99_ms: f64,
    /// Over the same operation of `woodbury`.
    pub to_woodbury: f64,
    /// Over one pass that reads and writes as many bytes as the maintainer's C has.
    pub to_pass: f64,
}

/// One inversion afresh.
#[derive(Debug, Serialize)]
pub(crate) struct LuRow {
    pub homogenisation: &'static str,
    pub dofs: usize,
    pub rebuild_ms: f64,
    pub drift: f64,
}

/// Columns of the CSV: one line for each operation of each row, and one for each LU.
const HEADER: &str = "homogenisation,maintainer,operation,dofs,rank_p50,rank_max,count,p50_ms,\
                      p99_ms,ratio_to_woodbury,ratio_to_pass,error,drift,rebuilds\n";

impl Report {
    pub fn json(&self) -> Result<String, serde_json::Error> {
        let mut text = serde_json::to_string_pretty(self)?;
        text.push('\n');
        Ok(text)
    }

    pub fn csv(&self) -> String {
        let mut text = HEADER.to_owned();
        for row in &self.rows {
            for (operation, t) in row.operations() {
                let Row { homogenisation, maintainer, dofs, rank_p50, rank_max, .. } = row;
                let Row { error, drift, rebuilds, .. } = row;
                let Times { count, p50_ms, p99_ms, to_woodbury, to_pass } = t;
                _ = writeln!(
                    text,
                    "{homogenisation},{maintainer},{operation},{dofs},{rank_p50},{rank_max},\
                     {count},{p50_ms},{p99_ms},{to_woodbury},{to_pass},{error:e},{drift:e},\
                     {rebuilds}"
                );
            }
        }
        for LuRow { homogenisation, dofs, rebuild_ms, drift } in &self.lu {
            // Measured once; the others' error is their distance from it, its own is its drift.
            _ = writeln!(
                text,
                "{homogenisation},lu,rebuild,{dofs},,,1,{rebuild_ms},,,,,{drift:e},"
            );
        }
        text
    }

    pub fn table(&self) -> String {
        let mut text = format!(
            "{}, {} vertices ({} free), {} splits and merges, seed {}\n\n",
            self.body, self.vertices, self.free_vertices, self.updates, self.seed
        );
        text.push_str(
            "homogen.  maintainer operation  dofs rank  count   p50 ms   p99 ms  x woodbury  \
             x pass      error      drift\n",
        );
        for row in &self.rows {
            for (operation, t) in row.operations() {
                let rank = format!("{}-{}", row.rank_p50, row.rank_max);
                _ = writeln!(
                    text,
                    "{:<9} {:<10} {:<9} {:>5} {:>4} {:>6} {:>8.3} {:>8.3} {:>11.2} {:>7.2} \
                     {:>10.1e} {:>10.1e}",
                    row.homogenisation,
                    row.maintainer,
                    operation,
                    row.dofs,
                    rank,
                    t.count,
                    t.p50_ms,
                    t.p99_ms,
                    t.to_woodbury,
                    t.to_pass,
                    row.error,
                    row.drift
                );
            }
        }
        for lu in &self.lu {
            let LuRow { homogenisation, dofs, rebuild_ms, drift } = lu;
            _ = writeln!(
                text,
                "{homogenisation:<9} lu         rebuild   {dofs:>5}    -      1 {rebuild_ms:>8.1} \
                 {:>8} {:>11} {:>7} {:>10} {drift:>10.1e}",
                "-", "-", "-", "-"
            );
        }
        text.push_str(FOOTNOTE);
        text
    }
}

const FOOTNOTE: &str = "
rank: median-largest of the change on old vertices. x woodbury, x pass: medians of the ratios
within a round to woodbury's time and to one pass that reads and writes as many bytes as C has
in that maintainer (half of C in woodbury, all of it in paper). error: |C - C_LU| / |C_LU|
(Frobenius) after all updates, C_LU of the stiffness assembled afresh: it holds what the kept K
has lost, too. drift: scaled residual of the worst of 8 columns against the kept K.
";

impl Row {
    fn operations(&self) -> [(&'static str, &Times); 3] {
        [("split", &self.split), ("merge", &self.merge), ("solve", &self.solve)]
    }
}
