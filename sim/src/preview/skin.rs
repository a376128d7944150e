//! A skin in colours by a number at each of its points.

use nalgebra::Vector3;

use super::canvas::{BLACK, Colour, GREY, Picture};
use super::view::{MARGIN, SideBySide, WIDTH};
use super::{LINE, shortened};

/// A point of the skin, scanner axes, m.
pub(crate) struct Shade {
    pub at: Vector3<f64>,
    /// Outward.
    pub normal: Vector3<f64>,
    pub value: f64,
}

/// Dark to bright, alike to all eyes: viridis at quarters of its way.
const COLOURS: [[f64; 3]; 5] = [
    [68.0, 1.0, 84.0],
    [59.0, 82.0, 139.0],
    [33.0, 145.0, 140.0],
    [94.0, 201.0, 98.0],
    [253.0, 231.0, 37.0],
];

/// What is below the floor.
const PALE: Colour = [225, 222, 218];

/// Values beyond these parts of all have the colour of the ends.
const ENDS: [f64; 2] = [0.02, 0.98];

/// Three views of points with a bar of their colours, by the logarithms of values above 0; or above `floor`, evenly, and what is
/// below is pale.
pub(crate) fn skin(title: &str, points: &[Shade], floor: Option<f64>) -> Picture {
    let all = || points.iter().map(|point| point.at);
    let low = all().reduce(|a, b| a.inf(&b)).unwrap_or_default();
    let high = all().reduce(|a, b| a.sup(&b)).unwrap_or(Vector3::repeat(0.1));
    let mut values: Vec<f64> = points.iter().map(|point| point.value).collect();
    values.retain(|value| *value > 0.0 && floor.is_none_or(|floor| *value >= floor));
    values.sort_by(f64::total_cmp);
    let part = |part: f64| values.get((part * (values.len() as f64 - 1.0)).round() as usize);
    let [least, most] = match floor {
        Some(floor) => [floor, part(1.0).map_or(2.0 * floor, |most| *most)],
        None => ENDS.map(|end| part(end).copied().unwrap_or(1.0)),
    };
    let share = |value: f64, [least, most]: [f64; 2]| {
        (value - least) / (most - least).max(f64::MIN_POSITIVE)
    };
    let colour = |value: f64| match floor {
        Some(floor) if value < floor => PALE,
        Some(_) => at(share(value, [least, most])),
        None => at(share(value.ln(), [least.ln(), most.ln()])),
    };
    let size = high - low;
    let SideBySide { views, scale, below } = SideBySide::new(low, high);
    let mut picture = Picture::new(WIDTH as usize, (below + 3 * LINE) as usize);
    picture.text([MARGIN, 16], &shortened(title), 2, BLACK);
    // So large that discs of points as far apart as these on the whole meet.
    let spacing = (2.0 * (size.x * size.y + size.y * size.z + size.z * size.x)
        / points.len().max(1) as f64)
        .sqrt();
    let radius = (0.8 * spacing * scale).max(1.5);
    for view in &views {
        let (axis, backwards) = view.look.axes[2];
        let towards = |x: &Vector3<f64>| if backwards { x[axis] } else { -x[axis] };
        // Those behind are drawn over by those before them.
        let mut seen: Vec<&Shade> =
            points.iter().filter(|point| towards(&point.normal) > 0.0).collect();
        seen.sort_by(|a, b| towards(&a.at).total_cmp(&towards(&b.at)));
        for point in seen {
            picture.disc(view.pixel(&point.at), radius, colour(point.value));
        }
        view.name(&mut picture);
    }
    let bar = 400;
    for step in 0..bar {
        let part = step as f64 / bar as f64;
        picture.fill([MARGIN + 120 + step, below + LINE], [1, 18], at(part));
    }
    picture.text([MARGIN, below + LINE], &short(least), 2, BLACK);
    picture.text([MARGIN + 130 + bar, below + LINE], &short(most), 2, BLACK);
    if floor.is_some() {
        picture.fill([MARGIN + 300 + bar, below + LINE], [18, 18], PALE);
        picture.text([MARGIN + 328 + bar, below + LINE], "less: not felt", 2, GREY);
    }
    picture
}

/// Three digits, and no more places than that takes.
fn short(value: f64) -> String {
    let places = (2.0 - value.abs().max(1e-9).log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{value:.places$}")
}

/// The colour a part of the way from the least to the most.
fn at(part: f64) -> Colour {
    let steps = (COLOURS.len() - 1) as f64;
    let along = part.clamp(0.0, 1.0) * steps;
    let first = (along.floor() as usize).min(COLOURS.len() - 2);
    let rest = along - first as f64;
    [0, 1, 2].map(|i| {
        let [a, b] = [COLOURS[first][i], COLOURS[first + 1][i]];
        (a + rest * (b - a)).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_before_hides_what_is_behind_and_small_values_are_pale() {
        let shade = |y: f64, value: f64, out: f64| Shade {
            at: Vector3::new(0.0, y, 0.0),
            normal: Vector3::new(0.0, out, 0.0),
            value,
        };
        let corners = [Vector3::repeat(-0.1), Vector3::repeat(0.1)].map(|at| Shade {
            at,
            normal: Vector3::x(),
            value: 0.2,
        });
        let points: Vec<Shade> =
            corners.into_iter().chain([shade(0.05, 9.0, 1.0), shade(-0.05, 0.2, 1.0)]).collect();
        let picture = skin("test", &points, Some(1.0));
        let has = |colour: Colour| picture.rgb.chunks_exact(3).any(|pixel| pixel == colour);
        assert!(has(at(1.0)) && has(PALE));
        assert_eq!([at(0.0), at(1.0), at(7.0)], [[68, 1, 84], [253, 231, 37], [253, 231, 37]]);
        assert!(skin("nothing", &[], None).width > 0);
        assert_eq!([short(0.05), short(1234.6), short(7.0)], ["0.0500", "1235", "7.00"]);
    }
}
