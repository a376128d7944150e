//! The findings of the study `drift`, as CSV, JSON, tables and plots.

use std::fmt::Write;

use serde::Serialize;

use super::MONITORED;
use crate::machine::Machine;
use crate::plot::{Line, log_log};
use crate::studies::markdown::table;

/// Version of the JSON layout.
const SCHEMA: &str = "yawara-bench-drift-1";

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
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<f64>,
    /// Largest relative error of `columns`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub columns_error: Option<f64>,
    /// The drift that a maintainer can measure by itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub monitor: Option<f64>,
    pub rebuilds: usize,
}

/// What is claimed of a maintainer in a case, and whether it is so.
#[derive(Clone, Debug, Serialize)]
struct Claim {
    e_ratio: f64,
    poisson_low: f64,
    poisson_high: f64,
    vertices: usize,
    method: &'static str,
    claim: &'static str,
    holds: bool,
}

/// All findings.
#[derive(Debug, Serialize)]
pub(crate) struct Report {
    schema: &'static str,
    machine: Machine,
    homogenisation: &'static str,
    seed: u64,
    updates: usize,
    rows: Vec<Row>,
    claims: Vec<Claim>,
}

impl Row {
    fn case(&self) -> (f64, f64, f64, usize) {
        (self.e_ratio, self.poisson_low, self.poisson_high, self.vertices)
    }

    fn title(&self) -> String {
        let poisson = match self.poisson_low == self.poisson_high {
            true => format!("{}", self.poisson_low),
            false => format!("{}-{}", self.poisson_low, self.poisson_high),
        };
        format!("E ratio {:e}, nu {poisson}, {} vertices", self.e_ratio, self.vertices)
    }
}

/// A figure of a row, if it is finite.
type Figure = fn(&Row) -> Option<f64>;

/// The rows of one maintainer in one case.
type Course<'a> = Vec<&'a Row>;

impl Report {
    pub fn new(machine: Machine, seed: u64, rows: Vec<Row>) -> Self {
        let updates = rows.iter().map(|row| row.updates).max().unwrap_or(0);
        let claims = courses(&rows).iter().filter_map(|course| claim(course, updates)).collect();
        let homogenisation = "laminate";
        Self { schema: SCHEMA, machine, homogenisation, seed, updates, rows, claims }
    }

    pub fn csv(&self) -> String {
        let number = |x: Option<f64>| x.map_or_else(String::new, |x| format!("{x:e}"));
        let mut text = "e_ratio,poisson_low,poisson_high,vertices,method,precision,updates,error,\
                        columns_error,monitor,rebuilds\n"
            .to_owned();
        for r in &self.rows {
            let Row { e_ratio, poisson_low, poisson_high, vertices, method, .. } = r;
            let Row { precision, updates, rebuilds, .. } = r;
            let (error, columns, monitor) =
                (number(r.error), number(r.columns_error), number(r.monitor));
            _ = writeln!(
                text,
                "{e_ratio:e},{poisson_low},{poisson_high},{vertices},{method},{precision},\
                 {updates},{error},{columns},{monitor},{rebuilds}"
            );
        }
        text
    }

    pub fn markdown(&self) -> String {
        let mut text = format!(
            "{} random splits, merges and changes of material, `{}`. Relative errors of solutions \
             against a fresh factor with refinement, the largest on the way; in brackets the times \
             that the maintainer started afresh. Monitor: the largest of its own figures, of \
             {MONITORED} columns.\n\n",
            self.updates, self.homogenisation
        );
        let largest = |course: &Course, value: Figure| {
            let values = course.iter().map(|row| value(row));
            let whole = values.clone().all(|value| value.is_some());
            let ended = course.last().is_some_and(|row| row.updates == self.updates);
            match values.flatten().reduce(f64::max).filter(|_| whole && ended) {
                Some(value) => format!("{value:.0e}"),
                None => "lost".to_owned(),
            }
        };
        let rebuilds = |course: &Course| match course.last().map_or(0, |row| row.rebuilds) {
            0 => String::new(),
            count => format!(" ({count})"),
        };
        text += &self.table("error of solutions", |course| {
            largest(course, |row| row.error) + &rebuilds(course)
        });
        text += &self.table("error of columns", |course| largest(course, |row| row.columns_error));
        text += &self.table("monitor", |course| largest(course, |row| row.monitor));
        for claim in &self.claims {
            let verdict = if claim.holds { "holds" } else { "does NOT hold" };
            let Claim { method, claim, e_ratio, poisson_low, poisson_high, .. } = claim;
            _ = writeln!(
                text,
                "- {method}, E ratio {e_ratio:e}, ν {poisson_low}-{poisson_high}: {claim}: {verdict}"
            );
        }
        text
    }

    /// One line per case, one column per maintainer.
    fn table(&self, corner: &str, cell: impl Fn(&Course) -> String) -> String {
        let mut methods: Vec<String> = Vec::new();
        let mut lines: Vec<(String, Vec<String>)> = Vec::new();
        let courses = courses(&self.rows);
        for course in &courses {
            if methods.iter().all(|method| method != course[0].method) {
                methods.push(course[0].method.to_owned());
            }
        }
        for course in &courses {
            let title = course[0].title();
            if lines.iter().all(|(name, _)| *name != title) {
                lines.push((title.clone(), vec![String::new(); methods.len()]));
            }
            let at = methods.iter().position(|method| method == course[0].method).unwrap_or(0);
            for (_, cells) in lines.iter_mut().filter(|(name, _)| *name == title) {
                cells[at] = cell(course);
            }
        }
        table(corner, &methods, &lines)
    }

    /// One plot per case: error and monitor of every maintainer over the updates.
    pub fn plots(&self) -> Vec<(String, String)> {
        let mut plots: Vec<(String, Vec<Line>)> = Vec::new();
        let figures: [(&str, Figure); 2] =
            [("error", |row| row.error), ("monitor", |row| row.monitor)];
        for (figure, value) in figures {
            for course in courses(&self.rows) {
                let at = |row: &&Row| Some((row.updates as f64, value(row)?));
                let points = course.iter().filter_map(at).filter(|point| point.1 > 0.0).collect();
                let (title, name) = (course[0].title(), format!("{}, {figure}", course[0].method));
                let line = Line { name, points };
                match plots.iter_mut().find(|(name, _)| *name == title) {
                    Some((_, lines)) => lines.push(line),
                    None => plots.push((title, vec![line])),
                }
            }
        }
        let svg = |(number, (title, lines)): (usize, &(String, Vec<Line>))| {
            let svg = log_log(title, ["updates", "relative error"], lines)?;
            Some((format!("drift_{:02}.svg", number + 1), svg))
        };
        plots.iter().enumerate().filter_map(svg).collect()
    }
}

/// The rows by case and maintainer, both in the order of their first row.
fn courses(rows: &[Row]) -> Vec<Course<'_>> {
    let mut courses: Vec<Course> = Vec::new();
    for row in rows {
        let same = |c: &&mut Course| (c[0].case(), c[0].method) == (row.case(), row.method);
        match courses.iter_mut().find(same) {
            Some(course) => course.push(row),
            None => courses.push(vec![row]),
        }
    }
    courses
}

/// What is claimed at the largest ratio of moduli, up to ν = .499.
fn claim(course: &Course, updates: usize) -> Option<Claim> {
    let &&Row { e_ratio, poisson_low, poisson_high, vertices, method, precision, .. } =
        course.first()?;
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
    Some(Claim { e_ratio, poisson_low, poisson_high, vertices, method, claim, holds })
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
        let report = Report::new(Machine::here(), 1, rows.to_vec());
        report.claims.iter().map(|claim| claim.holds).collect()
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
        let text = Report::new(Machine::here(), 1, rows).markdown();
        assert!(
            text.contains("2e-14") && text.contains("lost") && !text.contains("1e-3"),
            "{text}"
        );
    }
}
