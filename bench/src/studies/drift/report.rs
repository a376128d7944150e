//! The findings of the study `drift`: rows, claims, tables and plots.

use serde::Serialize;

use crate::harness::plot::log_log;
use crate::harness::report::markdown::table;
use crate::harness::report::{Claim, Summary, curves, each_once, spread};

/// Version of the JSON layout.
const SCHEMA: &str = "yawara-bench-drift-2";

/// Columns that the monitor looks at.
pub(super) const MONITORED: usize = 8;

/// One maintainer after so many updates; a figure that is not finite is left out.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Row {
    pub e_ratio: f64,
    pub poisson_low: f64,
    pub poisson_high: f64,
    pub vertices: usize,
    pub method: &'static str,
    pub precision: &'static str,
    pub updates: usize,
    /// Largest relative error of `solve` over a few loads, against a fresh K.
    pub error: Option<f64>,
    /// Largest relative error of `columns`.
    pub columns_error: Option<f64>,
    /// The drift that a maintainer can measure by itself.
    pub monitor: Option<f64>,
    pub rebuilds: usize,
}

impl Row {
    fn title(&self) -> String {
        let Self { e_ratio, poisson_low, poisson_high, vertices, .. } = self;
        let span = if poisson_low == poisson_high { "" } else { &format!("-{poisson_high}") };
        format!("E ratio {e_ratio:e}, nu {poisson_low}{span}, {vertices} vertices")
    }
}

/// A figure of a row, if it is finite.
type Figure = fn(&Row) -> Option<f64>;

/// What the rows say.
pub(super) fn summary(rows: &[Row]) -> Summary {
    let updates = rows.iter().map(|row| row.updates).max().unwrap_or(0);
    let claims = claims(rows, updates);
    let mut text = format!(
        "{updates} random splits, merges and changes of material, `laminate`. Relative errors of \
         solutions against a fresh factor with refinement, the largest on the way; in brackets how \
         often the maintainer started afresh. Monitor: the largest of its own figures, of \
         {MONITORED} columns.\n\n"
    );
    let largest = |rows: &[&Row], value: Figure| {
        let values = rows.iter().map(|row| value(row));
        let whole = values.clone().all(|value| value.is_some());
        let ended = rows.last().is_some_and(|row| row.updates == updates);
        match values.flatten().reduce(f64::max).filter(|_| whole && ended) {
            Some(value) => format!("{value:.0e}"),
            None => "lost".to_owned(),
        }
    };
    let rebuilds = |rows: &[&Row]| match rows.last().map_or(0, |row| row.rebuilds) {
        0 => String::new(),
        count => format!(" ({count})"),
    };
    let runs = runs(rows);
    // One line per case, one column per maintainer.
    let methods: Vec<String> = each_once(rows.iter().map(|row| row.method.to_owned()));
    let place = |run: &&Vec<&Row>| (run[0].title(), run[0].method.to_owned());
    let mut show = |corner: &str, cell: &dyn Fn(&[&Row]) -> String| {
        text += &table(corner, &methods, &spread(&methods, &runs, place, |run| cell(run)));
    };
    show("error of solutions", &|run| largest(run, |row| row.error) + &rebuilds(run));
    show("error of columns", &|run| largest(run, |row| row.columns_error));
    show("monitor", &|run| largest(run, |row| row.monitor));
    text.extend(claims.iter().map(Claim::text));
    let summary = Summary::new(text)
        .with("schema", SCHEMA)
        .with("homogenisation", "laminate")
        .with("updates", updates)
        .with("claims", claims);
    let titles = each_once(rows.iter().map(Row::title));
    titles.into_iter().enumerate().fold(summary, |summary, (number, title)| {
        let svg = plot(&title, rows);
        summary.with_file(format!("drift_{:02}.svg", number + 1), svg)
    })
}

/// Error and monitor of every maintainer over the updates, in one case.
fn plot(title: &str, rows: &[Row]) -> Option<String> {
    let figures: [(&str, Figure); 2] = [("error", |row| row.error), ("monitor", |row| row.monitor)];
    let rows: Vec<&Row> = rows.iter().filter(|row| row.title() == title).collect();
    let of = |(figure, value): (&str, Figure)| {
        curves(&rows, |row| {
            let point = (row.updates as f64, value(row).filter(|value| *value > 0.0)?);
            Some((format!("{}, {figure}", row.method), point))
        })
    };
    log_log(title, ["updates", "relative error"], &figures.map(of).concat())
}

/// The rows of one maintainer in one case each, both in the order of their first row.
fn runs(rows: &[Row]) -> Vec<Vec<&Row>> {
    let key = |row: &Row| (row.title(), row.method);
    let keys = each_once(rows.iter().map(key));
    keys.iter().map(|one| rows.iter().filter(|row| key(row) == *one).collect()).collect()
}

fn claims(rows: &[Row], updates: usize) -> Vec<Claim> {
    runs(rows).iter().filter_map(|run| claim(run, updates)).collect()
}

/// What is claimed at the largest ratio of moduli, up to ν = .499.
fn claim(course: &[&Row], updates: usize) -> Option<Claim> {
    let &&Row { e_ratio, poisson_low, poisson_high, method, precision, .. } = course.first()?;
    if e_ratio != 1e6 || poisson_high > 0.499 {
        return None;
    }
    let last = course.last()?;
    let whole = last.updates == updates;
    let within = |limit: f64| whole && course.iter().all(|r| r.error.is_some_and(|e| e <= limit));
    let (claim, holds) = match (method, precision) {
        ("sparse" | "woodbury", _) => {
            ("errors ≤ 1e-10 without a fresh start", within(1e-10) && last.rebuilds == 0)
        }
        (_, "f32") => {
            ("errors ≤ 1e-9 or a fresh start", within(1e-9) || whole && last.rebuilds > 0)
        }
        _ => return None,
    };
    let name = format!("{method}, E ratio {e_ratio:e}, ν {poisson_low}-{poisson_high}");
    Some(Claim { name, value: None, claim: claim.to_owned(), holds })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(method: &'static str, updates: usize, error: Option<f64>, rebuilds: usize) -> Row {
        Row {
            e_ratio: 1e6,
            poisson_low: 0.3,
            poisson_high: 0.499,
            vertices: 512,
            method,
            precision: if method.ends_with("_f32") { "f32" } else { "f64" },
            updates,
            error,
            columns_error: error,
            monitor: error,
            rebuilds,
        }
    }

    fn holds(rows: &[Row]) -> Vec<bool> {
        claims(rows, 10).iter().map(|claim| claim.holds).collect()
    }

    #[test]
    fn claims_fail_on_an_error_a_fresh_start_or_an_early_end() {
        let good = |method| vec![row(method, 1, Some(1e-14), 0), row(method, 10, Some(1e-11), 0)];
        let mut rows = good("sparse");
        assert_eq!(holds(&rows), [true]);
        rows[0].error = Some(1e-9);
        assert_eq!(holds(&rows), [false]);
        let mut rows = good("woodbury");
        rows[1].rebuilds = 1;
        assert_eq!(holds(&rows), [false]);
        let mut rows = good("sparse");
        rows.extend(good("woodbury_f32").into_iter().take(1));
        assert_eq!(holds(&rows), [true, false]);
        let mut rows = good("woodbury_f32");
        rows[1].error = None;
        assert_eq!(holds(&rows), [false]);
        rows[1].rebuilds = 1;
        assert_eq!(holds(&rows), [true]);
        assert!(holds(&good("paper")).is_empty());
    }

    #[test]
    fn a_maintainer_that_is_lost_is_said_to_be() {
        let rows = vec![row("sparse", 10, Some(2e-14), 0), row("paper", 5, Some(1e-3), 0)];
        let text = summary(&rows).text;
        assert!(["2e-14", "lost"].iter().all(|words| text.contains(words)), "{text}");
        assert!(!text.contains("1e-3"), "{text}");
    }
}
