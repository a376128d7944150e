//! Lines over logarithmic axes, as SVG.

use plotters::prelude::*;

use crate::statistics::median;

/// A named line.
pub struct Line {
    /// What it shows.
    pub name: String,
    /// Points, all coordinates positive.
    pub points: Vec<(f64, f64)>,
}

/// Colours that stay apart in print and for colour-blind eyes (Okabe and Ito).
const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(0, 0, 0),
    RGBColor(240, 228, 66),
];

/// Width of a plot and of the names of its lines beside it.
const PLOT: u32 = 720;
const NAMES: u32 = 220;

/// A log-log plot; `None` where nothing positive is to be shown.
pub fn log_log(title: &str, axes: [&str; 2], lines: &[Line]) -> Option<String> {
    let all = || lines.iter().flat_map(|line| line.points.iter().copied());
    let range = |pick: fn((f64, f64)) -> f64| {
        let (mut low, mut high) = (f64::INFINITY, 0.0f64);
        for value in all().map(pick).filter(|v| *v > 0.0 && v.is_finite()) {
            low = low.min(value);
            high = high.max(value);
        }
        (high > 0.0).then_some((low / 1.5)..(high * 1.5))
    };
    let (x, y) = (range(|p| p.0)?, range(|p| p.1)?);
    crate::picture::register_font();
    let mut svg = String::new();
    draw(&mut svg, title, axes, lines, x, y).ok()?;
    Some(svg)
}

fn draw(
    svg: &mut String,
    title: &str,
    axes: [&str; 2],
    lines: &[Line],
    x: std::ops::Range<f64>,
    y: std::ops::Range<f64>,
) -> Result<(), Box<dyn std::error::Error>> {
    let root = SVGBackend::with_string(svg, (PLOT + NAMES, 480)).into_drawing_area();
    root.fill(&WHITE)?;
    let (left, right) = root.split_horizontally(PLOT);
    let mut chart = ChartBuilder::on(&left)
        .caption(title, ("sans-serif", 20))
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(72)
        .build_cartesian_2d(x.log_scale(), y.log_scale())?;
    chart.configure_mesh().x_desc(axes[0]).y_desc(axes[1]).draw()?;
    for (number, line) in lines.iter().enumerate() {
        let colour = COLOURS[number % COLOURS.len()];
        // More lines than colours: the further ones have hollow marks.
        let mark = if number < COLOURS.len() { colour.filled() } else { colour.stroke_width(1) };
        let stroke = colour.stroke_width(2);
        chart.draw_series(LineSeries::new(line.points.iter().copied(), stroke))?;
        chart.draw_series(line.points.iter().map(|&point| Circle::new(point, 4, mark)))?;
        // Beside the plot: no line lies under its names.
        let height = 48 + 20 * number as i32;
        right.draw(&PathElement::new([(0, height), (22, height)], stroke))?;
        right.draw(&Circle::new((11, height), 4, mark))?;
        right.draw(&Text::new(line.name.as_str(), (30, height - 7), ("sans-serif", 14)))?;
    }
    root.present()?;
    drop(chart);
    drop((left, right));
    drop(root);
    Ok(())
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
        let line = |points| Line { name: "growth".into(), points };
        let svg = log_log("t", ["n", "ns"], &[line(vec![(1.0, 2.0), (10.0, 30.0)])]).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("growth") && svg.contains("</svg>"));
        assert!(log_log("t", ["n", "ns"], &[line(vec![(1.0, 0.0)])]).is_none());
    }
}
