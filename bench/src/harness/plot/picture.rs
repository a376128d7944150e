//! Pictures as lists of shapes: the same as SVG, for files and reports, and as pixels.

use std::fmt::Write;
use std::io::{Error, Result};
use std::sync::Once;

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// What a shape stands for: its class in a style sheet, and its colour on white paper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Role {
    /// The paper.
    Ground,
    /// Text and axes.
    Ink,
    /// Lines that guide the eye.
    Faint,
    /// The n-th kind of mark.
    Series(usize),
    /// A colour of its own, red, green, blue.
    Paint([u8; 3]),
}

/// Colours that stay apart in print and for colour-blind eyes (Okabe and Ito), then darker ones.
pub(crate) const SERIES: [u32; 12] = [
    0x000000, 0xd55e00, 0x0072b2, 0x009e73, 0xcc79a7, 0x56b4e9, 0xe69f00, 0x948000, 0x6e4096,
    0x808080, 0x783c00, 0x005a50,
];

impl Role {
    /// Class and colour.
    fn paint(self) -> (String, u32) {
        match self {
            Self::Ground => ("ground".into(), 0xffffff),
            Self::Ink => ("ink".into(), 0x222222),
            Self::Faint => ("faint".into(), 0xd6d6d6),
            Self::Series(n) => (format!("series{}", n % SERIES.len()), SERIES[n % SERIES.len()]),
            Self::Paint([r, g, b]) => ("paint".into(), u32::from_be_bytes([0, r, g, b])),
        }
    }
}

/// Which end of a text its place is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// A shape; lengths in pixels, y downwards.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Shape {
    /// A line through points.
    Line { points: Vec<(f64, f64)>, width: f64, role: Role },
    /// A disc or, hollow, a ring; `title` is shown where a pointer rests on it.
    Disc { at: (f64, f64), radius: f64, hollow: bool, role: Role, title: String },
    /// A filled polygon.
    Polygon { points: Vec<(f64, f64)>, role: Role },
    /// A text, its middle at the height of `at`.
    Text { at: (f64, f64), size: f64, anchor: Anchor, text: String },
}

impl Shape {
    pub fn text(at: (f64, f64), size: f64, anchor: Anchor, text: impl Into<String>) -> Self {
        Self::Text { at, size, anchor, text: text.into() }
    }
}

/// Shapes, later ones on top of earlier ones.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Picture {
    pub width: u32,
    pub height: u32,
    pub shapes: Vec<Shape>,
}

/// Pixels of a PNG per pixel of the picture.
const SCALE: f64 = 2.0;

impl Picture {
    /// As a text to be put into a file or a page. Classes (`ink`, `series0` …) let a page choose
    /// other colours.
    pub fn svg(&self) -> String {
        let Self { width, height, .. } = self;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
             width=\"{width}\" height=\"{height}\" font-family=\"sans-serif\">\n"
        );
        let (w, h) = (f64::from(*width), f64::from(*height));
        let paper = vec![(0.0, 0.0), (w, 0.0), (w, h), (0.0, h)];
        let paper = Shape::Polygon { points: paper, role: Role::Ground };
        for shape in std::iter::once(&paper).chain(&self.shapes) {
            element(&mut svg, shape);
        }
        svg + "</svg>\n"
    }

    /// As the bytes of a PNG file, twice as many pixels a side.
    pub fn png(&self) -> Result<Vec<u8>> {
        let [width, height] = [self.width, self.height].map(|n| (f64::from(n) * SCALE) as u32);
        let mut pixels = vec![255; 3 * width as usize * height as usize];
        register_font();
        let mut backend = BitMapBackend::with_buffer(&mut pixels, (width, height));
        for shape in &self.shapes {
            paint(&mut backend, shape)?;
        }
        drop(backend);
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.write_header()?.write_image_data(&pixels)?;
        Ok(bytes)
    }
}

/// Makes `sans-serif` known to the plotting library, which looks for no fonts of the system.
fn register_font() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let font = epaint_default_fonts::UBUNTU_LIGHT;
        // Without it texts are refused later, with a message.
        let _ = plotters::style::register_font("sans-serif", FontStyle::Normal, font);
    });
}

/// Text as it may stand in a page.
pub(crate) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

fn element(svg: &mut String, shape: &Shape) {
    let list = |points: &[(f64, f64)]| {
        let one = |(x, y): &(f64, f64)| format!("{x:.1},{y:.1}");
        points.iter().map(one).collect::<Vec<_>>().join(" ")
    };
    let paint = |role: Role| {
        let (class, colour) = role.paint();
        format!("class=\"{class}\" color=\"#{colour:06x}\"")
    };
    _ = match shape {
        Shape::Line { points, width, role } => writeln!(
            svg,
            "<polyline {} points=\"{}\" fill=\"none\" stroke=\"currentColor\" \
             stroke-width=\"{width}\"/>",
            paint(*role),
            list(points)
        ),
        Shape::Disc { at: (x, y), radius, hollow, role, title } => {
            let fill = if *hollow { "none" } else { "currentColor" };
            writeln!(
                svg,
                "<circle {} cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" fill=\"{fill}\" \
                 stroke=\"currentColor\" stroke-width=\"1.5\"><title>{}</title></circle>",
                paint(*role),
                escape(title)
            )
        }
        Shape::Polygon { points, role } => writeln!(
            svg,
            "<polygon {} points=\"{}\" fill=\"currentColor\"/>",
            paint(*role),
            list(points)
        ),
        Shape::Text { at: (x, y), size, anchor, text } => {
            let anchor = match anchor {
                Anchor::Start => "start",
                Anchor::Middle => "middle",
                Anchor::End => "end",
            };
            // Not every reader of SVG knows `dominant-baseline`.
            let y = y + 0.35 * size;
            writeln!(
                svg,
                "<text {} x=\"{x:.1}\" y=\"{y:.1}\" font-size=\"{size}\" \
                 text-anchor=\"{anchor}\" fill=\"currentColor\">{}</text>",
                paint(Role::Ink),
                escape(text)
            )
        }
    };
}

fn paint(backend: &mut BitMapBackend<'_>, shape: &Shape) -> Result<()> {
    let pixel = |&(x, y): &(f64, f64)| ((x * SCALE).round() as i32, (y * SCALE).round() as i32);
    let pixels = |points: &[(f64, f64)]| points.iter().map(pixel).collect::<Vec<_>>();
    let colour = |role: &Role| {
        let [_, r, g, b] = role.paint().1.to_be_bytes();
        RGBColor(r, g, b)
    };
    let drawn = match shape {
        Shape::Line { points, width, role } => {
            let stroke = colour(role).stroke_width((width * SCALE).round().max(1.0) as u32);
            backend.draw_path(pixels(points), &stroke)
        }
        Shape::Disc { at, radius, hollow, role, .. } => {
            let style = colour(role).stroke_width(3);
            backend.draw_circle(pixel(at), (radius * SCALE).round() as u32, &style, !hollow)
        }
        Shape::Polygon { points, role } => backend.fill_polygon(pixels(points), &colour(role)),
        Shape::Text { at, size, anchor, text } => {
            let side = match anchor {
                Anchor::Start => HPos::Left,
                Anchor::Middle => HPos::Center,
                Anchor::End => HPos::Right,
            };
            let ink = colour(&Role::Ink);
            let font = ("sans-serif", size * SCALE).into_font();
            let style = TextStyle::from(font).color(&ink).pos(Pos::new(side, VPos::Center));
            backend.draw_text(text, &style, pixel(at))
        }
    };
    drawn.map_err(|error| Error::other(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture() -> Picture {
        let corner = vec![(0.0, 0.0), (20.0, 0.0), (0.0, 20.0)];
        Picture {
            width: 100,
            height: 50,
            shapes: vec![
                Shape::Polygon { points: corner, role: Role::Paint([255, 0, 0]) },
                Shape::text((90.0, 25.0), 12.0, Anchor::End, "a < b & c"),
            ],
        }
    }

    #[test]
    fn texts_are_no_markup() {
        let svg = picture().svg();
        assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n"));
        assert!(svg.contains(">a &lt; b &amp; c</text>"), "{svg}");
        assert!(svg.contains("color=\"#ff0000\""), "{svg}");
    }

    #[test]
    fn pixels_are_where_the_shapes_are() {
        let bytes = picture().png().unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((info.width, info.height), (200, 100));
        let at = |x: usize, y: usize| &pixels[3 * (x + 200 * y)..][..3];
        assert_eq!(at(4, 4), [255, 0, 0]);
        assert_eq!(at(199, 99), [255; 3]);
        let dark = |x: usize, y: usize| at(x, y).iter().all(|&value| value < 128);
        let inked = (40..80).any(|y| (100..181).any(|x| dark(x, y)));
        assert!(inked, "the text has left ink");
        assert!(!(40..80).any(|y| (184..200).any(|x| dark(x, y))), "and ends at its place");
    }
}
