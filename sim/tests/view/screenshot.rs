//! What the browser itself shows, pixel by pixel.

use std::io::Cursor;

use super::browser::Browser;
use super::number;

/// A part of the window.
pub struct Shot {
    pub width: usize,
    pub pixels: Vec<[i32; 3]>,
}

impl Shot {
    /// How many pixels are so.
    pub fn count(&self, is_so: impl Fn([i32; 3]) -> bool) -> usize {
        self.pixels.iter().filter(|&&pixel| is_so(pixel)).count()
    }

    /// Columns and rows of the pixels that differ from another shot's by more than what the eye sees.
    pub fn changes(&self, other: &Self) -> Vec<[usize; 2]> {
        assert_eq!((self.width, self.pixels.len()), (other.width, other.pixels.len()));
        let far = |(a, b): (&[i32; 3], &[i32; 3])| (0..3).map(|k| (a[k] - b[k]).abs()).sum::<i32>();
        let pairs = self.pixels.iter().zip(&other.pixels).enumerate();
        let changed = pairs.filter(|(_, pair)| far(*pair) > 24);
        changed.map(|(i, _)| [i % self.width, i / self.width]).collect()
    }
}

/// A screenshot of an element, with what lies over it, once all is drawn as sharp as it gets.
pub fn stage(page: &Browser, id: &str) -> Shot {
    // Without the frame of what has the focus.
    page.run("document.activeElement.blur()");
    page.wait("yawara.body.pair.every((one) => one.sharpness === 1 && !one.is_stale)");
    let place = page.run(&format!(
        "const {{ left, top, width, height }} = document.getElementById('{id}').getBoundingClientRect();
         return [left, top, width, height]",
    ));
    let [left, top, width, height] = [0, 1, 2, 3].map(|i| number(&place[i]).round() as usize);
    let mut reader = png::Decoder::new(Cursor::new(page.screenshot())).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let frame = reader.next_frame(&mut bytes).unwrap();
    let samples = frame.color_type.samples();
    let at = |x: usize, y: usize| {
        let from = y * frame.line_size + samples * x;
        [0, 1, 2].map(|k| i32::from(bytes[from + k]))
    };
    let pixels = (top..top + height).flat_map(|y| (left..left + width).map(move |x| (x, y)));
    Shot { width, pixels: pixels.map(|(x, y)| at(x, y)).collect() }
}
