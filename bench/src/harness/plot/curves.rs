//! Curves over logarithmic axes, as SVG.

use super::axes::{Axes, FRAME, SIZE, key};
use super::picture::{Picture, Role, SERIES, Shape};
use crate::harness::statistics::median;

/// A named curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// What it shows.
    pub name: String,
    /// Its points; those with a coordinate that is not positive are not drawn.
    pub points: Vec<(f64, f64)>,
}

/// A chart with logarithmic axes; `None` where nothing positive is to be shown.
pub fn log_log(title: &str, titles: [&str; 2], curves: &[Curve]) -> Option<String> {
    let axes = Axes::around(curves.iter().flat_map(|curve| curve.points.iter().copied()))?;
    let mut shapes = axes.shapes(title, titles);
    for (number, Curve { name, points }) in curves.iter().enumerate() {
        // More curves than colours: the further ones have hollow marks.
        let (role, hollow) = (Role::Series(number), number >= SERIES.len());
        let shown = points.iter().filter(|p| p.0 > 0.0 && p.1 > 0.0 && (p.0 * p.1).is_finite());
        let points: Vec<(f64, f64)> = shown.map(|&point| axes.place(point)).collect();
        let disc = |&at| Shape::Disc { at, radius: 4.0, hollow, role, title: name.clone() };
        shapes.extend(points.iter().map(disc));
        let [mark, name] = key(number, 4.0, hollow, name);
        shapes.extend([mark, Shape::Line { points, width: 2.0, role }, name]);
    }
    let height = SIZE.1.max((2.0 * FRAME[1]) as u32 + 20 * curves.len() as u32);
    Some(Picture { width: SIZE.0, height, shapes }.svg())
}

/// Slope of a line through (ln x, ln y): the median of the slopes of all pairs (Theil and Sen),
/// which one disturbed sample does not move. NaN for fewer than two points.
pub fn slope(points: &[(f64, f64)]) -> f64 {
    let mut slopes = Vec::new();
    for (i, a) in points.iter().enumerate() {
        for b in &points[i + 1..] {
            slopes.push((b.1 / a.1).ln() / (b.0 / a.0).ln());
        }
    }
    median(&slopes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slope_of_a_power_law_with_an_outlier() {
        let mut points: Vec<(f64, f64)> =
            (1..9).map(|i| (f64::from(i), 3.0 * f64::from(i).powf(1.5))).collect();
        assert!((slope(&points) - 1.5).abs() < 1e-12);
        points[3].1 *= 10.0;
        assert!((slope(&points) - 1.5).abs() < 0.2);
        assert!(slope(&points[..1]).is_nan());
    }

    #[test]
    fn a_plot_names_its_lines_and_nothing_positive_is_no_plot() {
        let line = |points| Curve { name: "growth".into(), points };
        let svg = log_log("t", ["n", "ns"], &[line(vec![(1.0, 2.0), (10.0, 30.0)])]).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("growth") && svg.contains("</svg>"));
        assert!(log_log("t", ["n", "ns"], &[line(vec![(1.0, 0.0)])]).is_none());
    }
}
