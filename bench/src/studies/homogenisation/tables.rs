//! What the study `homogenisation` writes besides its JSON.

use std::fmt::Write;

use yawara_embed::CHOICES;

use super::homogenisation::{PhantomCost, Report, Row};
use super::markdown::{Line, milliseconds, table};
use crate::plot::{self, log_log};

pub(super) fn csv(report: &Report) -> String {
    let mut text = String::from(
        "case,ratio,nu,levels,choice,error_coarse,error_fine,compliance_error,min_eigenvalue,\
         seconds,bytes\n",
    );
    for r in &report.rows {
        let _ = writeln!(
            text,
            "{},{:e},{},{},{},{},{},{},{:e},{},{}",
            r.case,
            r.ratio,
            r.nu,
            r.levels,
            r.choice,
            r.error_coarse,
            r.error_fine,
            r.compliance_error,
            r.min_eigenvalue,
            r.seconds,
            r.bytes
        );
    }
    text
}

/// Means over the cases, then every case; percent.
pub(super) fn tables(report: &Report) -> String {
    let mut columns: Vec<(f64, u8)> = report.rows.iter().map(|r| (r.nu, r.levels)).collect();
    columns.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
    columns.dedup();
    let heads: Vec<String> =
        columns.iter().map(|(nu, levels)| format!("ν {nu}, {levels} levels")).collect();
    let mut text = String::new();
    type Value = fn(&Row) -> f64;
    let values: [(&str, Value); 3] = [
        ("L2 error, %", |r| r.error_coarse),
        ("L2 error of the embedded mesh, %", |r| r.error_fine),
        ("error of the compliance, %", |r| r.compliance_error),
    ];
    for (corner, value) in values {
        let mean = |name: &str, of: &dyn Fn(&Row) -> bool| -> Line {
            let cell = |&(nu, levels): &(f64, u8)| {
                let rows = report.rows.iter().filter(|r| r.nu == nu && r.levels == levels);
                let found: Vec<f64> = rows.filter(|r| of(r)).map(value).collect();
                percent(found.iter().sum::<f64>() / found.len() as f64)
            };
            (name.to_owned(), columns.iter().map(cell).collect())
        };
        let mut lines =
            vec![mean("homogeneous", &|r| r.case == "homogeneous" && r.choice == "linear")];
        for choice in CHOICES {
            lines.push(mean(choice, &|r| r.counts && r.choice == *choice));
        }
        text += &table(&format!("mean {corner}"), &heads, &lines);
    }
    text += &cases(report, &columns, &heads);
    text
}

fn cases(report: &Report, columns: &[(f64, u8)], heads: &[String]) -> String {
    let mut lines: Vec<Line> = Vec::new();
    for row in &report.rows {
        let name = format!("{} {:.0e}, {}", row.case, row.ratio, row.choice);
        let at = columns.iter().position(|&(nu, levels)| nu == row.nu && levels == row.levels);
        let cell = format!("{} / {}", percent(row.error_coarse), percent(row.error_fine));
        if lines.iter().all(|(other, _)| *other != name) {
            lines.push((name.clone(), vec![String::new(); columns.len()]));
        }
        for (_, cells) in lines.iter_mut().filter(|(other, _)| *other == name) {
            if let Some(at) = at {
                cells[at].clone_from(&cell);
            }
        }
    }
    let mut text = table("L2 error coarse / embedded, %", heads, &lines);
    let costs: Vec<Line> = CHOICES
        .iter()
        .map(|&choice| {
            let rows: Vec<&Row> = report.rows.iter().filter(|r| r.choice == choice).collect();
            let mean = rows.iter().map(|r| r.seconds).sum::<f64>() / rows.len() as f64;
            let bytes = rows.iter().map(|r| r.bytes).max().unwrap_or(0);
            (choice.to_owned(), vec![milliseconds(1e3 * mean), format!("{}", bytes / 1000)])
        })
        .collect();
    text += &table("precompute", &["ms, mean".to_owned(), "kB, most".to_owned()], &costs);
    text
}

/// What the organ took.
pub(super) fn costs(costs: &[PhantomCost]) -> String {
    let heads = ["tetrahedra", "s", "ns per tetrahedron", "MB"].map(str::to_owned);
    let line = |cost: &PhantomCost| {
        let each = 1e9 * cost.seconds / cost.nodes as f64;
        let cells = [
            cost.nodes.to_string(),
            format!("{:.3}", cost.seconds),
            format!("{each:.0}"),
            format!("{:.1}", cost.bytes as f64 * 1e-6),
        ];
        (cost.choice.to_owned(), cells.to_vec())
    };
    table("liver phantom of 128 voxels", &heads, &costs.iter().map(line).collect::<Vec<_>>())
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
pub(super) fn plot(report: &Report) -> Option<String> {
    let mut lines = Vec::new();
    for choice in CHOICES {
        for levels in [3, 6] {
            let of = |r: &&Row| {
                r.case == "sphere" && r.nu == 0.3 && r.choice == *choice && r.levels == levels
            };
            let points: Vec<(f64, f64)> =
                report.rows.iter().filter(of).map(|r| (r.ratio, r.error_coarse)).collect();
            if !points.is_empty() {
                let name = format!("{choice}, {levels} levels");
                lines.push(plot::Line { name, points });
            }
        }
    }
    log_log("A stiff sphere, ν = 0.3", ["ratio of moduli", "relative L2 error"], &lines)
}
