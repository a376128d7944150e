//! A picture of where a scene's regions and tools are on the body at rest.
//!
//! This file is the one to open first: [`Preview`]. `view` looks at the body along one axis, `solid`
//! is the body as cells, `skin` colours its outside by numbers, `canvas` draws, `font` has the letters.

mod canvas;
mod font;
mod skin;
mod solid;
mod view;

use nalgebra::Vector3;

use crate::body::{ScannerAxes, Start};
use crate::error::SimError;
use crate::scene::{Scene, ToolEntry};
use crate::tools::{self, BodyAtRest, Holding, Tool};
use canvas::{BLACK, GREY, width_of};
use solid::Solid;
use view::{MARGIN, SideBySide, View, WIDTH};

pub use canvas::{Colour, Picture};
pub(crate) use skin::{Shade, skin};

/// What is fixed, in pictures.
pub const FIXED: Colour = [30, 80, 200];

/// The tools by number, in pictures; from the ninth on again from the first.
pub const TOOLS: [Colour; 8] = [
    [225, 70, 20],
    [0, 140, 60],
    [170, 30, 160],
    [200, 150, 0],
    [0, 150, 170],
    [120, 80, 40],
    [230, 60, 130],
    [100, 150, 20],
];

const WHITE: Colour = [255; 3];

/// Pixels of a line of the legend.
const LINE: i64 = 28;

/// Times along a path at which it is drawn.
const PLACES: usize = 64;

/// Part of a body's size that is left free around it.
const FREE: f64 = 0.03;

/// How a tool that moves goes: its places at rest and on its way, m, and the radius if it is a ball.
struct Way {
    tool: usize,
    places: Vec<Vector3<f64>>,
    radius: Option<f64>,
}

/// What a scene holds and loads of the body before anything moves, and its picture.
pub struct Preview {
    title: String,
    axes: ScannerAxes,
    solid: Solid,
    holdings: Vec<Holding>,
    ways: Vec<Way>,
}

impl Preview {
    /// Reads the body of a scene and makes its tools. Nothing is homogenised or inverted.
    ///
    /// # Errors
    /// [`SimError`] for a scene that can't be simulated.
    pub fn new(scene: &Scene) -> Result<Self, SimError> {
        scene.validate(&scene.name)?;
        let start = Start::new(scene, None)?;
        let mut body = BodyAtRest::new(scene, &start);
        let end_s = scene.time.steps as f64 * scene.time.step_s;
        let mut ways = Vec::new();
        for (i, entry) in scene.tools.iter().enumerate() {
            let mut tool = tools::by_name(entry, &format!("tools[{i}]"), &mut body)?;
            body.hold(&tool.grasp(&body)?, i);
            if tool.path_mut().is_some() {
                let radius = match entry {
                    ToolEntry::Probe(probe) => Some(probe.radius_m),
                    _ => None,
                };
                ways.push(Way { tool: i, places: way(&*tool, end_s), radius });
            }
        }
        let holdings = tools::holdings(scene, &mut body)?;
        let solid = Solid::of(&start);
        let title = format!("{}: {}", scene.name, start.places.name);
        Ok(Self { title, axes: start.places.axes, solid, holdings, ways })
    }

    /// What each fixed region, then each tool has of the body, as the plan of a run says.
    pub fn holdings(&self) -> &[Holding] {
        &self.holdings
    }

    /// Three views of the body with what is held in colours, and a legend.
    pub fn picture(&self) -> Picture {
        let (low, high) = self.shown();
        let SideBySide { views, scale, below } = SideBySide::new(low, high);
        let height = below + 2 * LINE + LINE * (self.holdings.len() as i64 + 2);
        let mut picture = Picture::new(WIDTH as usize, height as usize);
        picture.text([MARGIN, 16], &shortened(&self.title), 2, BLACK);
        views.iter().for_each(|view| self.draw(view, &mut picture));
        self.scale_bar([MARGIN, below + 4], scale, &mut picture);
        self.legend([MARGIN, below + 2 * LINE], &mut picture);
        picture
    }

    /// The box of the body, of all balls and of where they go, with some room, m.
    fn shown(&self) -> (Vector3<f64>, Vector3<f64>) {
        let (mut low, mut high) =
            (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
        let Solid { dims, edge, origin, is_solid } = &self.solid;
        for (i, _) in is_solid.iter().enumerate().filter(|(_, is_solid)| **is_solid) {
            let cell = [i % dims[0], i / dims[0] % dims[1], i / (dims[0] * dims[1])];
            let corner = origin + Vector3::from(cell.map(|c| c as f64)) * *edge;
            low = low.inf(&corner);
            high = high.sup(&corner.add_scalar(*edge));
        }
        // What goes far away leaves the picture.
        let (far, middle) = (high - low, 0.5 * (low + high));
        let [least, most] = [middle - far, middle + far];
        for Way { places, radius, .. } in &self.ways {
            let radius = radius.unwrap_or(0.0);
            for x in places {
                low = low.inf(&x.add_scalar(-radius).sup(&least));
                high = high.sup(&x.add_scalar(radius).inf(&most));
            }
        }
        let room = FREE * (high - low).max();
        (low.add_scalar(-room), high.add_scalar(room))
    }

    /// One view with its name and letters.
    fn draw(&self, view: &View<'_>, picture: &mut Picture) {
        let all = (0..self.holdings.len()).map(|i| (self.colour(i), &self.holdings[i]));
        // Vertices and points have no size.
        let (spread, dots): (Vec<_>, Vec<_>) =
            all.partition(|(_, one)| one.volume_cm3.or(one.area_cm2).is_some());
        let spread: Vec<_> =
            spread.into_iter().map(|(colour, one)| (colour, &one.places[..])).collect();
        view.draw(&self.solid, &spread, picture);
        for (colour, one) in dots {
            for x in &one.places {
                picture.disc(view.pixel(x), 4.0, colour);
            }
        }
        for way in &self.ways {
            let colour = tool_colour(way.tool);
            let pixels: Vec<[f64; 2]> = way.places.iter().map(|x| view.pixel(x)).collect();
            // On what it holds a path of its own colour would not be seen.
            for (half, colour) in [(3.5, WHITE), (1.5, colour)] {
                for pair in pixels.windows(2) {
                    picture.line(pair[0], pair[1], half, colour);
                }
            }
            let Some(&last) = pixels.last() else { continue };
            match way.radius {
                Some(radius) => picture.circle(pixels[0], radius * view.scale, 1.5, colour),
                None => picture.disc(pixels[0], 4.0, BLACK),
            }
            picture.disc(last, 5.5, WHITE);
            picture.disc(last, 4.0, colour);
        }
        view.name(picture);
    }

    fn colour(&self, holding: usize) -> Colour {
        let fixed = self.holdings.iter().filter(|one| one.kind == "fixed").count();
        if holding < fixed { FIXED } else { tool_colour(holding - fixed) }
    }

    /// A bar of a round length, about a sixth of the picture.
    fn scale_bar(&self, [x, y]: [i64; 2], scale: f64, picture: &mut Picture) {
        let about_mm = WIDTH as f64 / 6.0 / scale * 1e3;
        let power = 10f64.powf(about_mm.log10().floor());
        let round = [5.0, 2.0, 1.0].into_iter().find(|digit| digit * power <= about_mm);
        let length_mm = round.unwrap_or(1.0) * power;
        let pixels = (length_mm * 1e-3 * scale).round() as i64;
        picture.fill([x, y], [pixels, 5], BLACK);
        for end in [x, x + pixels - 3] {
            picture.fill([end, y - 5], [3, 15], BLACK);
        }
        picture.text([x + pixels + 14, y - 5], &format!("{length_mm} mm"), 2, BLACK);
        let turned = self.axes.to_ras_direction(&Vector3::x()).x < 0.9999;
        if turned {
            let note = "oblique image: seen along its own axes";
            picture.text([WIDTH - MARGIN - width_of(note, 2), y - 5], note, 2, GREY);
        }
    }

    fn legend(&self, [x, y]: [i64; 2], picture: &mut Picture) {
        for (i, one) in (0..).zip(&self.holdings) {
            let y = y + LINE * i;
            picture.fill([x, y], [18, 18], self.colour(i as usize));
            let name = if one.kind == "fixed" { String::new() } else { format!(" {}", one.kind) };
            let words = format!("{}{name}: {}", one.key, one.in_words());
            picture.text([x + 30, y + 2], &shortened(&words), 2, BLACK);
        }
        let last = y + LINE * self.holdings.len() as i64;
        let how = "pale: behind the surface; line: the path of a tool; circle: a ball";
        picture.text([x, last + 2], how, 2, GREY);
    }
}

fn tool_colour(tool: usize) -> Colour {
    TOOLS[tool % TOOLS.len()]
}

/// Where a tool's reference is over the run.
fn way(tool: &dyn Tool, end_s: f64) -> Vec<Vector3<f64>> {
    let times = (0..=PLACES).map(|i| end_s * i as f64 / PLACES as f64);
    times.filter(|&t| tool.acts_at(t)).map(|t| tool.reference(t)).collect()
}

/// What of a text fits into a line.
fn shortened(text: &str) -> String {
    const MOST: usize = 96;
    match text.chars().count() {
        0..=MOST => text.into(),
        count => format!("...{}", text.chars().skip(count - MOST + 3).collect::<String>()),
    }
}
