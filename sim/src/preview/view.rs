//! One view of a body: its surface as seen along an axis, lit, with what is held in colours.

use nalgebra::Vector3;

use super::canvas::{BLACK, Colour, GREY, Picture};
use super::solid::Solid;

/// How a view looks at the body: solver axes across, down and away from the eye, each backwards or not.
pub(super) struct Look {
    pub name: &'static str,
    pub axes: [(usize, bool); 3],
    /// Letters at the left, right, top and bottom.
    pub letters: [&'static str; 4],
}

/// As radiologists hang them: the patient's right at the left, seen from the feet, from in front and
/// from the patient's left.
const LOOKS: [Look; 3] = [
    Look {
        name: "axial, from below",
        axes: [(0, true), (1, true), (2, false)],
        letters: ["R", "L", "A", "P"],
    },
    Look {
        name: "coronal, from the front",
        axes: [(0, true), (2, true), (1, true)],
        letters: ["R", "L", "S", "I"],
    },
    Look {
        name: "sagittal, from the left",
        axes: [(1, true), (2, true), (0, false)],
        letters: ["A", "P", "S", "I"],
    },
];

/// How much of a colour covers the surface where what is held is seen, and where it is behind.
const SEEN: f64 = 0.85;
const BEHIND: f64 = 0.5;

/// The body's own colour in full light.
const TISSUE: [f64; 3] = [226.0, 205.0, 190.0];

/// The least and the most light, and how fast it falls off with the slope.
const SHADE: [f64; 2] = [0.45, 1.0];

/// Pixels across, and for the views between the margins.
pub(super) const WIDTH: i64 = 1280;
pub(super) const MARGIN: i64 = 44;
/// The most pixels down for the views.
const TALLEST: f64 = 620.0;
/// The least room across for a view, whose name stands above it, pixels.
const NAME: f64 = 290.0;
/// Pixels above the views.
const TOP: i64 = 96;

/// All looks at a part of space, one beside the other.
pub(super) struct SideBySide {
    pub views: Vec<View<'static>>,
    /// Pixels per m.
    pub scale: f64,
    /// Where there is room below them, pixels.
    pub below: i64,
}

impl SideBySide {
    /// As large as there is room for.
    pub fn new(low: Vector3<f64>, high: Vector3<f64>) -> Self {
        let size = high - low;
        let free = (WIDTH - 6 * MARGIN) as f64;
        let mut scale = TALLEST / size.y.max(size.z);
        let wide = |scale: f64| 2.0 * (scale * size.x).max(NAME) + (scale * size.y).max(NAME);
        while wide(scale) > free {
            scale *= 0.99;
        }
        let tall = (size.y.max(size.z) * scale).ceil() as i64;
        let (mut views, mut left) = (Vec::new(), MARGIN);
        for look in &LOOKS {
            let mut view = View { look, low, high, corner: [left, TOP], scale };
            let [width, height] = view.size();
            view.corner[1] += (tall - height) / 2;
            left += width.max(NAME as i64) + 2 * MARGIN;
            views.push(view);
        }
        Self { views, scale, below: TOP + tall + MARGIN }
    }
}

/// A look that fills a rectangle of a picture.
pub(super) struct View<'a> {
    pub look: &'a Look,
    /// The part of space that it shows, m.
    pub low: Vector3<f64>,
    pub high: Vector3<f64>,
    /// Its left upper corner, pixels.
    pub corner: [i64; 2],
    /// Pixels per m.
    pub scale: f64,
}

impl View<'_> {
    /// Along an axis of the look, from where it begins, m.
    fn along(&self, which: usize, x: &Vector3<f64>) -> f64 {
        let (axis, backwards) = self.look.axes[which];
        if backwards { self.high[axis] - x[axis] } else { x[axis] - self.low[axis] }
    }

    /// Pixels across and down.
    pub fn size(&self) -> [i64; 2] {
        [0, 1].map(|which| {
            let axis = self.look.axes[which].0;
            ((self.high[axis] - self.low[axis]) * self.scale).ceil() as i64
        })
    }

    /// Writes its name above it, and around it where the patient's sides are.
    pub fn name(&self, picture: &mut Picture) {
        let ([x, y], [width, height]) = (self.corner, self.size());
        picture.text([x, TOP - 44], self.look.name, 2, GREY);
        let [left, right, top, bottom] = self.look.letters;
        let (middle, centre) = (y + height / 2 - 10, x + width / 2 - 7);
        picture.text([x - 24, middle], left, 3, BLACK);
        picture.text([x + width + 8, middle], right, 3, BLACK);
        picture.text([centre, y - 22], top, 3, BLACK);
        picture.text([centre, y + height + 4], bottom, 3, BLACK);
    }

    /// The pixel of a solver position.
    pub fn pixel(&self, x: &Vector3<f64>) -> [f64; 2] {
        [0, 1].map(|which| self.corner[which] as f64 + self.along(which, x) * self.scale)
    }

    /// Draws the body; `held` has the colours and the places of what is held.
    pub fn draw(&self, solid: &Solid, held: &[(Colour, &[Vector3<f64>])], picture: &mut Picture) {
        let depth = Surface::new(self.look, solid);
        let mut tint: Vec<Option<(usize, Colour)>> = vec![None; depth.away.len()];
        for &(colour, places) in held {
            for x in places {
                let (at, away) = depth.of_cell(solid.cell(x));
                let nearer = tint[at].is_none_or(|(other, _)| away < other);
                if nearer {
                    tint[at] = Some((away, colour));
                }
            }
        }
        let [width, height] = self.size();
        for v in 0..height {
            for u in 0..width {
                let x = self.position([u as f64 + 0.5, v as f64 + 0.5]);
                let Some(cell) = depth.cell_of(&x, solid) else { continue };
                let Some(first) = depth.away[cell] else { continue };
                let light = depth.light(cell);
                let mut colour = TISSUE.map(|c| c * light);
                if let Some((away, over)) = tint[cell] {
                    let cover = if away <= first + 2 { SEEN } else { BEHIND };
                    let over = over.map(|c| f64::from(c) * (0.5 + 0.5 * light));
                    colour = [0, 1, 2].map(|i| colour[i] + cover * (over[i] - colour[i]));
                }
                let [x0, y0] = self.corner;
                picture.set(x0 + u, y0 + v, colour.map(|c| c.round() as u8));
            }
        }
    }

    /// A solver position that the view shows at an offset from its corner, pixels.
    fn position(&self, offset: [f64; 2]) -> Vector3<f64> {
        let mut x = self.low;
        for which in 0..2 {
            let ((axis, backwards), off) = (self.look.axes[which], offset[which] / self.scale);
            x[axis] = if backwards { self.high[axis] - off } else { self.low[axis] + off };
        }
        x
    }
}

/// By column of cells along a look: how many cells away the first one of the body is.
struct Surface<'a> {
    look: &'a Look,
    dims: [usize; 3],
    away: Vec<Option<usize>>,
    /// The same, smoothed over neighbours.
    smooth: Vec<f64>,
}

impl<'a> Surface<'a> {
    fn new(look: &'a Look, solid: &Solid) -> Self {
        let dims = look.axes.map(|(axis, _)| solid.dims[axis]);
        let mut away = vec![None; dims[0] * dims[1]];
        for v in 0..dims[1] {
            for u in 0..dims[0] {
                let cell = |w: usize| {
                    let mut cell = [0; 3];
                    for (which, at) in [u, v, w].into_iter().enumerate() {
                        let (axis, backwards) = look.axes[which];
                        cell[axis] = if backwards { dims[which] - 1 - at } else { at };
                    }
                    cell
                };
                away[u + dims[0] * v] = (0..dims[2]).find(|&w| solid.get(cell(w)));
            }
        }
        let mut surface = Self { look, dims, away, smooth: Vec::new() };
        surface.smooth = (0..surface.away.len()).map(|at| surface.mean(at)).collect();
        surface
    }

    /// The mean of what is around a column.
    fn mean(&self, at: usize) -> f64 {
        let (u, v) = (at % self.dims[0], at / self.dims[0]);
        let (mut sum, mut count) = (0.0, 0.0);
        for b in v.saturating_sub(2)..(v + 3).min(self.dims[1]) {
            for a in u.saturating_sub(2)..(u + 3).min(self.dims[0]) {
                if let Some(away) = self.away[a + self.dims[0] * b] {
                    (sum, count) = (sum + away as f64, count + 1.0);
                }
            }
        }
        if count > 0.0 { sum / count } else { 0.0 }
    }

    /// The column of a cell, and how far away that is in it.
    fn of_cell(&self, cell: [usize; 3]) -> (usize, usize) {
        let [u, v, w] = [0, 1, 2].map(|which| {
            let (axis, backwards) = self.look.axes[which];
            if backwards { self.dims[which] - 1 - cell[axis] } else { cell[axis] }
        });
        (u + self.dims[0] * v, w)
    }

    /// The column of a solver position, if there is one.
    fn cell_of(&self, x: &Vector3<f64>, solid: &Solid) -> Option<usize> {
        let at = (x - solid.origin) / solid.edge;
        let inside = [0, 1].into_iter().all(|which| {
            let axis = self.look.axes[which].0;
            at[axis] >= 0.0 && at[axis] < solid.dims[axis] as f64
        });
        inside.then(|| self.of_cell(solid.cell(x)).0)
    }

    /// How much light falls on a column, from above at the left.
    fn light(&self, at: usize) -> f64 {
        let (u, v) = (at % self.dims[0], at / self.dims[0]);
        let there = |u: usize, v: usize| {
            let other = u + self.dims[0] * v;
            self.away[other].map_or(self.smooth[at], |_| self.smooth[other])
        };
        let across = there((u + 1).min(self.dims[0] - 1), v) - there(u.saturating_sub(1), v);
        let down = there(u, (v + 1).min(self.dims[1] - 1)) - there(u, v.saturating_sub(1));
        let normal = Vector3::new(0.5 * across, 0.5 * down, -1.0).normalize();
        let lit = normal.dot(&Vector3::new(-0.35, -0.45, -0.82).normalize()).max(0.0);
        SHADE[0] + lit * (SHADE[1] - SHADE[0])
    }
}
