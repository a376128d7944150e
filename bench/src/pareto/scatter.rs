//! Error against time, with the front.

use crate::harness::cases::Row;
use crate::harness::plot::{Anchor, Axes, FRAME, Picture, Role, SIZE, Shape, key};
use crate::harness::report::each_once;

/// Height of a line of the smallest text.
const LINE: f64 = 13.0;

/// What is on an axis: a row's figure or measurement, and what to call it.
pub(crate) type Axis = (&'static str, &'static str);

/// A scatter plot with logarithmic axes, the front as a line with its rows named; `None` where no
/// row has both values.
///
/// A row that did not converge in every step has a hollow mark and is not on the front. `named`
/// rows have their names beside them wherever they are.
pub(crate) fn scatter(
    title: &str,
    x: Axis,
    y: Axis,
    rows: &[Row],
    named: &[&str],
) -> Option<Picture> {
    let point = |row: &Row| (number(row, x.0), number(row, y.0));
    let points: Vec<(f64, f64)> = rows.iter().map(point).collect();
    let axes = Axes::around(points.iter().copied())?;
    let place = |point| axes.place(point);
    let mut shapes = axes.shapes(title, [x.1, y.1]);
    let on_front = front_of(rows, x.0, y.0);
    let corners: Vec<(f64, f64)> = on_front.iter().map(|&i| place(points[i])).collect();
    shapes.push(Shape::Line { points: stairs(&corners), width: 1.5, role: Role::Ink });
    let groups = each_once(rows.iter().map(|row| &row.group[..]));
    let mut labels = Labels::default();
    for step in stairs(&corners).windows(2) {
        labels.block_line(step[0], step[1]);
    }
    for (i, row) in rows.iter().enumerate().filter(|&(i, _)| points[i].0 * points[i].1 > 0.0) {
        let at = place(points[i]);
        let role = Role::Series(groups.iter().position(|group| *group == row.group).unwrap_or(0));
        let title = format!("{}: {:.3e}, {:.3e}", row.case, points[i].0, points[i].1);
        let radius = if row.group == "default" { 7.0 } else { 5.0 };
        shapes.push(Shape::Disc { at, radius, hollow: !converged(row), role, title });
        labels.block(at, radius);
        if on_front.contains(&i) || named.contains(&&row.group[..]) {
            labels.wanted.push((at, &row.case));
        }
    }
    shapes.extend(labels.shapes());
    shapes.extend(legend(&groups));
    Some(Picture { width: SIZE.0, height: SIZE.1, shapes })
}

/// The rows that converged in every step and that no other such row beats in both values.
pub(crate) fn front_of(rows: &[Row], x: &str, y: &str) -> Vec<usize> {
    let value = |row: &Row, name| if converged(row) { number(row, name) } else { f64::NAN };
    front(&rows.iter().map(|row| (value(row, x), value(row, y))).collect::<Vec<_>>())
}

/// Who is beaten by no one: the points (x, y) for which no other is at most as large in both and
/// smaller in one, as positions in `points`, by ascending x. What is not positive and finite takes
/// no part. Of equal points the first counts. Cost: O(n log n).
fn front(points: &[(f64, f64)]) -> Vec<usize> {
    let valid = |value: f64| value > 0.0 && value.is_finite();
    let mut order: Vec<usize> =
        (0..points.len()).filter(|&i| valid(points[i].0) && valid(points[i].1)).collect();
    order.sort_by(|&i, &j| {
        let (a, b) = (points[i], points[j]);
        a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)).then(i.cmp(&j))
    });
    let mut lowest = f64::INFINITY;
    order.retain(|&i| {
        let better = points[i].1 < lowest;
        lowest = lowest.min(points[i].1);
        better
    });
    order
}

/// Whether every step converged.
pub(crate) fn converged(row: &Row) -> bool {
    row.failure.is_none() && row.number("converged") == row.number("steps")
}

fn number(row: &Row, name: &str) -> f64 {
    row.number(name).filter(|value| *value > 0.0).unwrap_or(f64::NAN)
}

/// From point to point by a level and a vertical line: what lies above and to the right is beaten.
fn stairs(corners: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut points = Vec::new();
    for pair in corners.windows(2) {
        points.extend([pair[0], (pair[1].0, pair[0].1)]);
    }
    points.extend(corners.last());
    points
}

fn legend(groups: &[&str]) -> Vec<Shape> {
    let keys = groups.iter().enumerate().flat_map(|(number, group)| key(number, 5.0, false, group));
    let (x, y) = (FRAME[2] + 22.0, FRAME[1] + 20.0 * groups.len() as f64 + 6.0);
    let note = |y, text| Shape::text((x, y), 12.0, Anchor::Start, text);
    let notes = [note(y, "hollow: a step did not converge"), note(y + 17.0, "line: Pareto front")];
    keys.chain(notes).collect()
}

/// Names beside points, moved up or down until they lie on no other and on no mark.
#[derive(Default)]
struct Labels<'a> {
    /// Boxes that are taken: left, top, right, bottom.
    taken: Vec<[f64; 4]>,
    wanted: Vec<((f64, f64), &'a str)>,
}

impl Labels<'_> {
    fn block(&mut self, (x, y): (f64, f64), radius: f64) {
        self.taken.push([x - radius, y - radius, x + radius, y + radius]);
    }

    /// A level or vertical line.
    fn block_line(&mut self, a: (f64, f64), b: (f64, f64)) {
        self.taken.push([a.0.min(b.0), a.1.min(b.1), a.0.max(b.0), a.1.max(b.1)]);
    }

    fn shapes(mut self) -> Vec<Shape> {
        let mut shapes = Vec::new();
        for ((x, y), text) in self.wanted {
            // A letter of this size is about so wide.
            let width = 6.2 * text.chars().count() as f64;
            let fits = x + 9.0 + width < FRAME[2];
            let from = if fits { x + 9.0 } else { x - 9.0 - width };
            let box_at = |y: f64| [from, y - 0.5 * LINE, from + width, y + 0.5 * LINE];
            let free = |y: &f64| {
                let a = box_at(*y);
                let apart = |b: &[f64; 4]| a[2] < b[0] || b[2] < a[0] || a[3] < b[1] || b[3] < a[1];
                a[1] > FRAME[1] && a[3] < FRAME[3] && self.taken.iter().all(apart)
            };
            let shifts =
                (0..14).map(|n| f64::from((n + 1) / 2) * if n % 2 == 0 { 8.0 } else { -8.0 });
            let height = shifts.map(|shift| y + shift).find(free).unwrap_or(y);
            self.taken.push(box_at(height));
            let (x, anchor) =
                if fits { (from, Anchor::Start) } else { (from + width, Anchor::End) };
            shapes.push(Shape::text((x, height), 12.0, anchor, text));
        }
        shapes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(name: &str, ms: f64, error: f64, converged: usize) -> Row {
        let mut row = Row::new("g", name);
        row.figures.put("error", error);
        row.figures.put("steps", 2);
        row.figures.put("converged", converged);
        row.measured.put("ms", ms);
        row
    }

    const X: Axis = ("ms", "ms per step");
    const Y: Axis = ("error", "error");

    #[test]
    fn a_point_is_on_the_front_if_none_beats_it() {
        let points = [(3.0, 1.0), (1.0, 3.0), (2.0, 2.0), (2.0, 2.5), (3.0, 3.0), (2.0, 2.0)];
        assert_eq!(front(&points), [1, 2, 0]);
        assert_eq!(front(&[(1.0, 1.0), (2.0, 1.0)]), [0], "slower and no better");
        // What is no point takes no part.
        let points = [(f64::NAN, 0.1), (0.5, f64::INFINITY), (0.0, 1.0), (2.0, 2.0)];
        assert_eq!(front(&points), [3]);
        assert!(front(&[]).is_empty());
    }

    #[test]
    fn marks_lie_where_their_values_are_and_the_front_is_named() {
        let mut rows = vec![
            row("fast", 1.0, 0.1, 2),
            row("slow", 100.0, 0.001, 2),
            row("beaten", 100.0, 0.1, 2),
            row("lost", 0.5, 1e-4, 1),
        ];
        rows.push(Row { failure: Some("no".into()), ..Row::new("g", "failed") });
        assert_eq!(front_of(&rows, "ms", "error"), [0, 1]);
        let picture = scatter("t", X, Y, &rows, &[]).unwrap();
        let discs = picture.shapes.iter().filter_map(|shape| match shape {
            Shape::Disc { at, hollow, title, .. } if title.contains(':') => Some((*at, *hollow)),
            _ => None,
        });
        let (at, hollow): (Vec<(f64, f64)>, Vec<bool>) = discs.unzip();
        assert_eq!(hollow, [false, false, false, true]);
        // Two decades of either axis are as long as any other two.
        assert!((at[1].0 - at[2].0).abs() < 1e-9);
        assert!(at[1].1 > at[0].1 && (at[2].1 - at[0].1).abs() < 1e-9);
        let svg = picture.svg();
        for (name, shown) in [("fast", 2), ("slow", 2), ("beaten", 1), ("lost", 1)] {
            assert_eq!(svg.matches(&format!(">{name}")).count(), shown, "{name}");
        }
    }

    #[test]
    fn names_do_not_cover_each_other() {
        let mut labels = Labels::default();
        for i in 0..5 {
            labels.wanted.push(((200.0, 200.0 + 2.0 * f64::from(i)), "a name of some length"));
        }
        let height = |shape: &Shape| match shape {
            Shape::Text { at, .. } => at.1,
            _ => unreachable!(),
        };
        let heights: Vec<f64> = labels.shapes().iter().map(height).collect();
        for (i, a) in heights.iter().enumerate() {
            assert!(heights[..i].iter().all(|b| (a - b).abs() >= LINE), "{heights:?}");
        }
        assert!(scatter("t", X, Y, &[], &[]).is_none(), "nothing positive is no plot");
    }
}
