//! What the study prints and draws.

use yawara_embed::CHOICES;

use super::row::{PhantomCost, Row};
use crate::harness::plot::log_log;
use crate::harness::report::markdown::{Line, milliseconds, table};
use crate::harness::report::{curves, each_once, spread};

fn column(row: &Row) -> String {
    format!("ν {}, {} levels", row.nu, row.levels)
}

/// Means over the cases, then every case; percent.
pub(super) fn tables(rows: &[Row]) -> String {
    let heads = each_once(rows.iter().map(column));
    let mut text = String::new();
    type Value = fn(&Row) -> f64;
    let values: [(&str, Value); 3] = [
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
    let costs: Vec<Line> = CHOICES
        .iter()
        .map(|&choice| {
            let rows: Vec<&Row> = rows.iter().filter(|r| r.choice == choice).collect();
            let mean = rows.iter().map(|r| r.seconds).sum::<f64>() / rows.len() as f64;
            let bytes = rows.iter().map(|r| r.bytes).max().unwrap_or(0);
            (choice.to_owned(), vec![milliseconds(1e3 * mean), format!("{}", bytes / 1000)])
        })
        .collect();
    text + &table("precompute", &["ms, mean".to_owned(), "kB, most".to_owned()], &costs)
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
pub(super) fn plot(rows: &[Row]) -> Option<String> {
    let spheres = rows.iter().filter(|r| r.case == "sphere" && r.nu == 0.3);
    let curves = curves(spheres, |r| {
        Some((format!("{}, {} levels", r.choice, r.levels), (r.ratio, r.error_coarse)))
    });
    log_log("A stiff sphere, ν = 0.3", ["ratio of moduli", "relative L2 error"], &curves)
}
