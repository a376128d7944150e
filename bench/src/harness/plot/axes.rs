//! Logarithmic axes of a chart.

use super::picture::{Anchor, Role, Shape};

/// The sides of the plot within the picture: left, top, right, bottom.
pub(crate) const FRAME: [f64; 4] = [76.0, 56.0, 640.0, 420.0];

/// Width and height of the picture; names stand on the right of the plot.
pub(crate) const SIZE: (u32, u32) = (860, 480);

/// Two logarithmic axes.
pub(crate) struct Axes {
    x: Scale,
    y: Scale,
}

impl Axes {
    /// Around all positive coordinates; `None` without any.
    pub fn around(points: impl Iterator<Item = (f64, f64)> + Clone) -> Option<Self> {
        let (x, y) = (points.clone().map(|p| p.0), points.map(|p| p.1));
        Some(Self { x: Scale::of(x)?, y: Scale::of(y)? })
    }

    /// Where a point is in the picture.
    pub fn place(&self, (x, y): (f64, f64)) -> (f64, f64) {
        let [left, top, right, bottom] = FRAME;
        (left + self.x.at(x) * (right - left), bottom - self.y.at(y) * (bottom - top))
    }

    /// The axes with their ticks, their titles and that of the chart.
    pub fn shapes(&self, title: &str, titles: [&str; 2]) -> Vec<Shape> {
        let [left, top, right, bottom] = FRAME;
        let line = |points| Shape::Line { points, width: 1.0, role: Role::Faint };
        let mut shapes = vec![Shape::text((left, 18.0), 16.0, Anchor::Start, title)];
        for value in self.x.ticks() {
            let at = left + self.x.at(value) * (right - left);
            shapes.push(line(vec![(at, top), (at, bottom)]));
            shapes.push(Shape::text((at, bottom + 14.0), 12.0, Anchor::Middle, tick_name(value)));
        }
        for value in self.y.ticks() {
            let at = bottom - self.y.at(value) * (bottom - top);
            shapes.push(line(vec![(left, at), (right, at)]));
            shapes.push(Shape::text((left - 6.0, at), 12.0, Anchor::End, tick_name(value)));
        }
        let frame = vec![(left, top), (left, bottom), (right, bottom)];
        shapes.push(Shape::Line { points: frame, width: 1.0, role: Role::Ink });
        let middle = (0.5 * (left + right), bottom + 38.0);
        shapes.push(Shape::text(middle, 13.0, Anchor::Middle, titles[0]));
        shapes.push(Shape::text((4.0, top - 16.0), 13.0, Anchor::Start, titles[1]));
        shapes
    }
}

/// The n-th line of a legend beside the plot, where nothing lies under it: a mark, and its name.
pub(crate) fn key(number: usize, radius: f64, hollow: bool, name: &str) -> [Shape; 2] {
    let (x, y) = (FRAME[2] + 28.0, FRAME[1] + 20.0 * number as f64);
    let (role, title) = (Role::Series(number), name.to_owned());
    let disc = Shape::Disc { at: (x, y), radius, hollow, role, title };
    [disc, Shape::text((x + 12.0, y), 13.0, Anchor::Start, name)]
}

/// A logarithmic axis.
struct Scale {
    low: f64,
    high: f64,
}

impl Scale {
    fn of(values: impl Iterator<Item = f64>) -> Option<Self> {
        let (mut low, mut high) = (f64::INFINITY, 0.0f64);
        for value in values.filter(|value| value.is_finite() && *value > 0.0) {
            (low, high) = (low.min(value), high.max(value));
        }
        (high > 0.0).then_some(Self { low: low / 1.4, high: high * 1.4 })
    }

    /// 0 at the low end, 1 at the high one.
    fn at(&self, value: f64) -> f64 {
        (value / self.low).ln() / (self.high / self.low).ln()
    }

    /// Round values within, with fewer digits where there are many decades.
    fn ticks(&self) -> Vec<f64> {
        let decades = (self.high / self.low).log10();
        let steps: &[f64] = if decades > 3.0 { &[1.0] } else { &[1.0, 2.0, 5.0] };
        let first = self.low.log10().floor() as i32;
        let last = self.high.log10().ceil() as i32;
        let stride = (decades / 8.0).ceil().max(1.0) as usize;
        (first..=last)
            .step_by(stride)
            .flat_map(|power| steps.iter().map(move |step| step * 10f64.powi(power)))
            .filter(|value| (self.low..=self.high).contains(value))
            .collect()
    }
}

fn tick_name(value: f64) -> String {
    match value {
        v if (0.001..10_000.0).contains(&v) => format!("{}", (v * 1e6).round() / 1e6),
        v => format!("{v:.0e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_few_and_within() {
        for (low, high) in [(1.0, 2.0), (1e-9, 1e9), (3.0, 3.1), (1e-4, 0.5)] {
            let scale = Scale { low, high };
            let ticks = scale.ticks();
            assert!(
                ticks.len() < 14 && ticks.iter().all(|t| (low..=high).contains(t)),
                "{ticks:?}"
            );
        }
    }
}
