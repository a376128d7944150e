//! A picture of pixels, and what is drawn into it.

use super::font;

/// Red, green, blue.
pub type Colour = [u8; 3];

pub(super) const BLACK: Colour = [25, 25, 25];
pub(super) const GREY: Colour = [110, 110, 110];

/// Pixels in rows from the top, each red, green, blue.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Three bytes a pixel.
    pub rgb: Vec<u8>,
}

impl Picture {
    /// A white one.
    pub(crate) fn new(width: usize, height: usize) -> Self {
        Self { width, height, rgb: vec![255; 3 * width * height] }
    }

    /// The colour of a pixel; white beyond the edges.
    pub fn at(&self, x: usize, y: usize) -> Colour {
        let i = 3 * (y * self.width + x);
        if x < self.width && y < self.height {
            [self.rgb[i], self.rgb[i + 1], self.rgb[i + 2]]
        } else {
            [255; 3]
        }
    }

    /// Sets a pixel, unless it is beyond the edges.
    pub(crate) fn set(&mut self, x: i64, y: i64, colour: Colour) {
        let inside = |at: i64, size: usize| usize::try_from(at).ok().filter(|&at| at < size);
        if let (Some(x), Some(y)) = (inside(x, self.width), inside(y, self.height)) {
            let i = 3 * (y * self.width + x);
            self.rgb[i..i + 3].copy_from_slice(&colour);
        }
    }

    /// Fills a rectangle.
    pub(super) fn fill(&mut self, [x, y]: [i64; 2], [width, height]: [i64; 2], colour: Colour) {
        for row in y..y + height {
            for column in x..x + width {
                self.set(column, row, colour);
            }
        }
    }

    /// Fills a disc.
    pub(crate) fn disc(&mut self, [x, y]: [f64; 2], radius: f64, colour: Colour) {
        let reach = radius.ceil() as i64;
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                if (dx as f64).hypot(dy as f64) <= radius {
                    let at = |middle: f64, d: i64| (middle.round() as i64).saturating_add(d);
                    self.set(at(x, dx), at(y, dy), colour);
                }
            }
        }
    }

    /// A line as thick as `2 half` pixels.
    pub(crate) fn line(&mut self, a: [f64; 2], b: [f64; 2], half: f64, colour: Colour) {
        let length = (b[0] - a[0]).hypot(b[1] - a[1]);
        // What is beyond the edges is not drawn, but would take long.
        let steps = (2.0 * length).ceil().clamp(1.0, 1e4) as usize;
        for step in 0..=steps {
            let s = step as f64 / steps as f64;
            self.disc([a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1])], half, colour);
        }
    }

    /// The outline of a circle.
    pub(super) fn circle(&mut self, [x, y]: [f64; 2], radius: f64, half: f64, colour: Colour) {
        const SIDES: usize = 96;
        let at = |side: usize| {
            let (sin, cos) = (std::f64::consts::TAU * side as f64 / SIDES as f64).sin_cos();
            [x + radius * cos, y + radius * sin]
        };
        for side in 0..SIDES {
            self.line(at(side), at(side + 1), half, colour);
        }
    }

    /// Writes from the left upper corner on, with dots of `size` pixels.
    pub(crate) fn text(&mut self, [x, y]: [i64; 2], text: &str, size: i64, colour: Colour) {
        for (i, letter) in (0..).zip(text.chars()) {
            let left = x + i * (font::WIDTH + 1) * size;
            for (column, dots) in (0..).zip(font::columns(letter)) {
                for row in (0..font::HEIGHT).filter(|row| dots >> row & 1 == 1) {
                    self.fill([left + column * size, y + row * size], [size, size], colour);
                }
            }
        }
    }
}

/// Pixels that a text is wide.
pub(super) fn width_of(text: &str, size: i64) -> i64 {
    text.chars().count() as i64 * (font::WIDTH + 1) * size - size
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_far_beyond_the_edges_is_not_drawn() {
        let mut picture = Picture::new(5, 5);
        picture.disc([f64::INFINITY, -1e300], 2.0, [0; 3]);
        picture.line([1e300, 2.0], [-1e300, 1e300], 1.0, [0; 3]);
        assert_eq!(picture.rgb, Picture::new(5, 5).rgb);
        picture.disc([2.0, 2.0], 1.0, [0; 3]);
        assert_eq!([picture.at(1, 2), picture.at(1, 1)], [[0; 3], [255; 3]]);
    }
}
