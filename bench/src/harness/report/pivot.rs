//! Rows spread over the lines and columns of a table, or over the curves of a chart.

use super::markdown::Line;
use crate::harness::plot::Curve;

/// A line for each name, in the order of their first rows, with the cells of its rows in the columns
/// `heads`; `place` gives a row's line and column. Rows of other columns are left out.
pub(crate) fn spread<R>(
    heads: &[String],
    rows: impl IntoIterator<Item = R>,
    place: impl Fn(&R) -> (String, String),
    cell: impl Fn(&R) -> String,
) -> Vec<Line> {
    let mut lines: Vec<Line> = Vec::new();
    for row in rows {
        let (name, head) = place(&row);
        let Some(column) = heads.iter().position(|one| *one == head) else { continue };
        let at = lines.iter().position(|(other, _)| *other == name).unwrap_or_else(|| {
            lines.push((name, vec![String::new(); heads.len()]));
            lines.len() - 1
        });
        lines[at].1[column] = cell(&row);
    }
    lines
}

/// A curve for each name, in the order of their first rows; `point` gives a row's curve and point,
/// `None` leaves it out.
pub(crate) fn curves<R>(
    rows: impl IntoIterator<Item = R>,
    point: impl Fn(R) -> Option<(String, (f64, f64))>,
) -> Vec<Curve> {
    let mut curves: Vec<Curve> = Vec::new();
    for (name, point) in rows.into_iter().filter_map(point) {
        match curves.iter_mut().find(|curve| curve.name == name) {
            Some(curve) => curve.points.push(point),
            None => curves.push(Curve { name, points: vec![point] }),
        }
    }
    curves
}

/// The items in the order of their first occurrence, each once.
pub(crate) fn each_once<T: PartialEq>(items: impl IntoIterator<Item = T>) -> Vec<T> {
    let mut once = Vec::new();
    for item in items {
        if !once.contains(&item) {
            once.push(item);
        }
    }
    once
}
