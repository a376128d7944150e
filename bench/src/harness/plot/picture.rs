//! Pictures as lists of shapes: the same as SVG, for files and reports, and as pixels.

use std::fmt::Write;
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
pub(crate) const SERIES: [[u8; 3]; 12] = [
    [0, 0, 0],
    [213, 94, 0],
    [0, 114, 178],
    [0, 158, 115],
    [204, 121, 167],
    [86, 180, 233],
    [230, 159, 0],
    [148, 128, 0],
    [110, 64, 150],
    [128, 128, 128],
    [120, 60, 0],
    [0, 90, 80],
];

impl Role {
    fn class(self) -> String {
        match self {
            Self::Ground => "ground".into(),
            Self::Ink => "ink".into(),
            Self::Faint => "faint".into(),
            Self::Series(n) => format!("series{}", n % SERIES.len()),
            Self::Paint(_) => "paint".into(),
        }
    }

    fn colour(self) -> [u8; 3] {
        match self {
            Self::Ground => [255; 3],
            Self::Ink => [34; 3],
            Self::Faint => [214; 3],
            Self::Series(n) => SERIES[n % SERIES.len()],
            Self::Paint(colour) => colour,
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
    ///
    /// # Errors
    /// What the drawing library or the encoder says.
    pub fn png(&self) -> Result<Vec<u8>, String> {
        let size = [self.width, self.height].map(|n| (f64::from(n) * SCALE) as u32);
        let mut pixels = vec![0; 3 * size[0] as usize * size[1] as usize];
        self.draw(&mut pixels, (size[0], size[1])).map_err(|error| error.to_string())?;
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, size[0], size[1]);
        encoder.set_color(png::ColorType::Rgb);
        encoder
            .write_header()
            .and_then(|mut writer| writer.write_image_data(&pixels))
            .map_err(|error| error.to_string())?;
        Ok(bytes)
    }

    fn draw(
        &self,
        pixels: &mut [u8],
        size: (u32, u32),
    ) -> Result<(), Box<dyn std::error::Error + '_>> {
        register_font();
        let root = BitMapBackend::with_buffer(pixels, size).into_drawing_area();
        root.fill(&WHITE).map_err(|error| error.to_string())?;
        for shape in &self.shapes {
            paint(&root, shape).map_err(|error| error.to_string())?;
        }
        root.present().map_err(|error| error.to_string())?;
        Ok(())
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
        let [r, g, b] = role.colour();
        format!("class=\"{}\" color=\"#{r:02x}{g:02x}{b:02x}\"", role.class())
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

type Area<'a> = DrawingArea<BitMapBackend<'a>, plotters::coord::Shift>;

fn paint(
    root: &Area<'_>,
    shape: &Shape,
) -> Result<(), DrawingAreaErrorKind<<BitMapBackend<'static> as DrawingBackend>::ErrorType>> {
    let pixel = |&(x, y): &(f64, f64)| ((x * SCALE).round() as i32, (y * SCALE).round() as i32);
    let colour = |role: &Role| {
        let [r, g, b] = role.colour();
        RGBColor(r, g, b)
    };
    let pixels = |points: &[(f64, f64)]| points.iter().map(pixel).collect::<Vec<_>>();
    match shape {
        Shape::Line { points, width, role } => {
            let stroke = colour(role).stroke_width((width * SCALE).round().max(1.0) as u32);
            root.draw(&PathElement::new(pixels(points), stroke))
        }
        Shape::Disc { at, radius, hollow, role, .. } => {
            let style = match hollow {
                true => colour(role).stroke_width(3),
                false => colour(role).filled(),
            };
            root.draw(&Circle::new(pixel(at), (radius * SCALE).round() as i32, style))
        }
        Shape::Polygon { points, role } => {
            root.draw(&Polygon::new(pixels(points), colour(role).filled()))
        }
        Shape::Text { at, size, anchor, text } => {
            let side = match anchor {
                Anchor::Start => HPos::Left,
                Anchor::Middle => HPos::Center,
                Anchor::End => HPos::Right,
            };
            let ink = colour(&Role::Ink);
            let font = ("sans-serif", size * SCALE).into_font();
            let style = TextStyle::from(font).color(&ink).pos(Pos::new(side, VPos::Center));
            root.draw(&Text::new(text.clone(), pixel(at), style))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture() -> Picture {
        let corner = vec![(0.0, 0.0), (20.0, 0.0), (0.0, 20.0)];
        let text = "a < b & c".to_owned();
        Picture {
            width: 100,
            height: 50,
            shapes: vec![
                Shape::Polygon { points: corner, role: Role::Paint([255, 0, 0]) },
                Shape::Text { at: (90.0, 25.0), size: 12.0, anchor: Anchor::End, text },
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
