//! A fit as a picture: predicted against measured, and what is left in standard deviations.

use std::fmt::Write;

use super::identified::{Identified, Residual};

/// Edge of each of the two panels, and the margin around them, in pixels.
const PANEL: f64 = 320.0;
const MARGIN: f64 = 60.0;

/// Residuals beyond so many standard deviations are drawn at the edge.
const MOST: f64 = 5.0;

/// Both kinds of measurement, with what they are called and drawn in.
const KINDS: [(&str, &str, &str); 2] =
    [("move_mm", "moves, mm", "#0072b2"), ("force_n", "forces, N", "#d55e00")];

/// An SVG document.
pub(super) fn svg(identified: &Identified) -> String {
    let (width, height) = (2.0 * PANEL + 3.0 * MARGIN, PANEL + 2.0 * MARGIN);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    frame(&mut out, MARGIN, "measured", "predicted");
    frame(&mut out, 2.0 * MARGIN + PANEL, "component", "(predicted − measured) / sd");
    let (bottom, middle) = (MARGIN + PANEL, MARGIN + PANEL / 2.0);
    line(&mut out, [MARGIN, bottom, MARGIN + PANEL, MARGIN], "#999999");
    for (level, colour) in [(0.0, "#999999"), (-2.0, "#cccccc"), (2.0, "#cccccc")] {
        let y = middle - level / MOST * PANEL / 2.0;
        line(&mut out, [2.0 * MARGIN + PANEL, y, 2.0 * (MARGIN + PANEL), y], colour);
    }
    let all = &identified.residuals;
    for (kind, name, colour) in KINDS {
        let mine: Vec<(usize, &Residual)> =
            all.iter().enumerate().filter(|(_, one)| one.kind == kind).collect();
        if mine.is_empty() {
            continue;
        }
        let values = mine.iter().flat_map(|(_, one)| [one.measured, one.predicted]);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        });
        let span = (high - low).max(f64::MIN_POSITIVE);
        let at = |value: f64| PANEL * (0.04 + 0.92 * (value - low) / span);
        let label = format!("{name}: {low:.3} to {high:.3}");
        let line = if kind == KINDS[0].0 { MARGIN - 28.0 } else { MARGIN - 12.0 };
        text(&mut out, [MARGIN, line], &label, colour);
        for (number, one) in mine {
            dot(&mut out, [MARGIN + at(one.measured), bottom - at(one.predicted)], colour);
            let part = (number as f64 + 0.5) / all.len() as f64;
            let off = ((one.predicted - one.measured) / one.sd).clamp(-MOST, MOST);
            let x = 2.0 * MARGIN + PANEL * (1.0 + part);
            dot(&mut out, [x, middle - off / MOST * PANEL / 2.0], colour);
        }
    }
    out.push_str("</svg>\n");
    out
}

fn frame(out: &mut String, left: f64, below: &str, beside: &str) {
    let _ = writeln!(
        out,
        "<rect x=\"{left}\" y=\"{MARGIN}\" width=\"{PANEL}\" height=\"{PANEL}\" fill=\"none\" stroke=\"black\"/>"
    );
    text(out, [left + PANEL / 2.0 - 30.0, MARGIN + PANEL + 24.0], below, "black");
    let [x, y] = [left - 12.0, MARGIN + PANEL / 2.0 + 70.0];
    let _ = writeln!(out, "<text transform=\"translate({x},{y}) rotate(-90)\">{beside}</text>");
}

fn line(out: &mut String, [x1, y1, x2, y2]: [f64; 4], colour: &str) {
    let _ = writeln!(
        out,
        "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"{colour}\"/>"
    );
}

fn text(out: &mut String, [x, y]: [f64; 2], words: &str, colour: &str) {
    let _ = writeln!(out, "<text x=\"{x:.1}\" y=\"{y:.1}\" fill=\"{colour}\">{words}</text>");
}

fn dot(out: &mut String, [x, y]: [f64; 2], colour: &str) {
    let _ = writeln!(
        out,
        "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"2.5\" fill=\"{colour}\" fill-opacity=\"0.6\"/>"
    );
}
