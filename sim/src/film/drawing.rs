//! The frames of a run, drawn one after the other into an animated PNG.

use std::io;
use std::path::Path;

use nalgebra::Vector3;

use super::camera::Camera;
use super::raster::Layer;
use crate::SimError;
use crate::output::write_file;
use crate::playback::{COLOURS, Run, surfaces};
use crate::preview::{Colour, Picture};
use crate::report::{Frame, StepReport, outer_faces};

/// Pixels across and down of the body, and down of the curve below it.
const SIZE: [usize; 2] = [720, 420];
const CURVE: usize = 64;

/// Pixels that one of the picture is the mean of, along each side.
const FINE: usize = 2;

/// The ground, the letters, the curve and the arrow.
const GROUND: Colour = [236, 238, 239];
const INK: Colour = [29, 31, 34];
const SOFT: Colour = [150, 155, 160];
const FORCE: Colour = [213, 94, 0];

/// How much of the skin hides what is in it.
const SKIN: f64 = 0.42;

/// Millimetres of arrow a newton, and the longest.
const MM_PER_N: f64 = 14.0;
const LONGEST_MM: f64 = 140.0;

/// Steps between colours that are told apart: fewer of them make a smaller file.
const COLOUR_STEP: u8 = 6;

/// Writes a run to `path` as an animated PNG that lasts `seconds`, and then begins anew: the body as frames
/// have it, lit, the force on the tools, and its curve. The same run gives the same bytes.
///
/// Cost: O(frames · (their triangles + pixels)).
///
/// # Errors
/// As [`Run::frame`]; [`SimError::Io`] if the file can't be written: what stood there is still there then.
pub fn write_picture(run: &Run, path: &Path, seconds: f64) -> Result<(), SimError> {
    let io = |source| SimError::Io(path.into(), source);
    let png = |error: png::EncodingError| io(io::Error::other(error));
    let camera = Camera::new(run.box_mm(), SIZE.map(|n| n * FINE));
    let count = run.frame_count();
    let height = SIZE[1] + CURVE;
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, SIZE[0] as u32, height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::High);
    encoder.set_animated(count as u32, 0).map_err(png)?;
    let mut writer = encoder.write_header().map_err(png)?;
    let all_s: f64 = (0..count).map(|number| lasts(run, number)).sum();
    let mut shown: Option<Picture> = None;
    for number in 0..count {
        let frame = run.frame(number)?;
        let report = run.report(number, &frame);
        let mut picture = Picture::new(SIZE[0], height);
        body(&camera, &frame, &mut picture);
        words(run, &camera, &report, &mut picture);
        let ms = (seconds * lasts(run, number) / all_s * 1e3).round();
        let ms = ms.clamp(10.0, f64::from(u16::MAX)) as u16;
        let [corner, size] =
            shown.as_ref().map_or([[0, 0], [SIZE[0], height]], |shown| changed(shown, &picture));
        writer.set_frame_delay(ms, 1000).map_err(png)?;
        if number > 0 {
            writer.reset_frame_position().map_err(png)?;
            writer.set_frame_dimension(size[0] as u32, size[1] as u32).map_err(png)?;
            writer.set_frame_position(corner[0] as u32, corner[1] as u32).map_err(png)?;
        }
        writer.write_image_data(&cut(&picture, corner, size)).map_err(png)?;
        shown = Some(picture);
    }
    writer.finish().map_err(png)?;
    write_file(path, bytes)
}

/// How long a frame is the last one, s; the last of all stands as long as the one before, a single one a second.
fn lasts(run: &Run, number: usize) -> f64 {
    let next = (number + 1).min(run.frame_count() - 1);
    let before = next.saturating_sub(1);
    if next == before { 1.0 } else { run.moment(next).1 - run.moment(before).1 }
}

/// Draws the surfaces of a frame, or the outside of its tetrahedra; the skin lets through what is in it.
fn body(camera: &Camera, frame: &Frame, picture: &mut Picture) {
    let fine = SIZE.map(|n| n * FINE);
    let (mut solid, mut veil) = (Layer::new(fine), Layer::new(fine));
    let count = surfaces(frame).count();
    for (number, surface) in surfaces(frame).enumerate() {
        let is_veil = surface.label == 0 && count > 1;
        let layer = if is_veil { &mut veil } else { &mut solid };
        layer.draw(camera, &surface.points_mm, &surface.triangles, number as u8);
    }
    if count == 0 {
        let points: Vec<_> = frame.points_mm.iter().map(|x| Vector3::from(*x)).collect();
        let faces: Vec<_> = outer_faces(frame).into_iter().map(|(face, _)| face).collect();
        solid.draw(camera, &points, &faces, 0);
    }
    let colour = |layer: &Layer, at: usize| {
        let paint = COLOURS[usize::from(layer.which[at]) % COLOURS.len()];
        paint.map(|c| f64::from(c) * f64::from(layer.light[at]))
    };
    for y in 0..SIZE[1] {
        for x in 0..SIZE[0] {
            let mut sum = [0.0; 3];
            for i in 0..FINE * FINE {
                let at = (FINE * y + i / FINE) * fine[0] + FINE * x + i % FINE;
                let is_solid = solid.depth[at].is_finite();
                let mut seen = if is_solid { colour(&solid, at) } else { GROUND.map(f64::from) };
                if veil.depth[at] < solid.depth[at] {
                    let over = colour(&veil, at);
                    seen = [0, 1, 2].map(|k| seen[k] + SKIN * (over[k] - seen[k]));
                }
                sum = [0, 1, 2].map(|k| sum[k] + seen[k]);
            }
            if sum == GROUND.map(|c| f64::from(c) * (FINE * FINE) as f64) {
                picture.set(x as i64, y as i64, GROUND);
                continue;
            }
            let few = |c: f64| {
                let c = c / (FINE * FINE) as f64;
                ((c / f64::from(COLOUR_STEP)).round() * f64::from(COLOUR_STEP)).min(255.0) as u8
            };
            picture.set(x as i64, y as i64, sum.map(few));
        }
    }
}

/// Writes what the frame is of, and draws forces and their curve.
fn words(run: &Run, camera: &Camera, report: &StepReport, picture: &mut Picture) {
    for tool in &report.tools {
        let (at, force) = (Vector3::from(tool.reference_mm), Vector3::from(tool.force_n));
        let size = force.norm();
        if size < 1e-4 || !at.iter().all(|x| x.is_finite()) {
            continue;
        }
        let tip = at + force * ((MM_PER_N * size).min(LONGEST_MM) / size);
        let [from, to] = [at, tip].map(|x| {
            let seen = camera.see(&x) / FINE as f64;
            [seen.x, seen.y]
        });
        arrow(from, to, picture);
    }
    let force = norm(&report.force_n);
    picture.text([14, 12], run.scene(), 2, INK);
    picture.text([14, 36], &format!("{:.3} s   {force:.2} N", report.time_s), 2, INK);
    let (top, bottom) = (SIZE[1] as f64 + 8.0, (SIZE[1] + CURVE) as f64 - 8.0);
    let forces: Vec<f64> = run.steps().iter().map(|step| norm(&step.force_n)).collect();
    let most = forces.iter().copied().filter(|f| f.is_finite()).fold(1e-9, f64::max);
    let last = (forces.len().max(2) - 1) as f64;
    let width = SIZE[0] as f64;
    let place = |i: usize| {
        let [left, right] = [14.0, width - 14.0];
        let share = (forces[i] / most).min(1.0);
        [left + (right - left) * i as f64 / last, bottom - (bottom - top) * share]
    };
    picture.line([14.0, bottom + 2.0], [width - 14.0, bottom + 2.0], 0.6, SOFT);
    for i in 1..forces.len() {
        let colour = if i < report.step { FORCE } else { SOFT };
        picture.line(place(i - 1), place(i), 1.1, colour);
    }
    if let Some(at) = report.step.checked_sub(1) {
        picture.disc(place(at), 4.0, FORCE);
    }
}

fn arrow(from: [f64; 2], to: [f64; 2], picture: &mut Picture) {
    let along = nalgebra::Vector2::new(to[0] - from[0], to[1] - from[1]);
    let length = along.norm();
    let Some(along) = along.try_normalize(1e-6) else { return };
    let head = length.min(14.0);
    let neck = [to[0] - head * along.x, to[1] - head * along.y];
    picture.line(from, neck, 2.2, FORCE);
    // Discs that grow smaller make the head.
    let steps = 28;
    for i in 0..=steps {
        let s = f64::from(i) / f64::from(steps);
        let at = [neck[0] + s * head * along.x, neck[1] + s * head * along.y];
        picture.disc(at, 6.5 * (1.0 - s), FORCE);
    }
}

fn norm(v: &[f64; 3]) -> f64 {
    Vector3::from(*v).norm()
}

/// Corner and size of the least rectangle outside of which two pictures are the same.
fn changed(before: &Picture, now: &Picture) -> [[usize; 2]; 2] {
    let (mut low, mut high) = ([now.width, now.height], [0, 0]);
    for y in 0..now.height {
        for x in (0..now.width).filter(|&x| before.at(x, y) != now.at(x, y)) {
            low = [low[0].min(x), low[1].min(y)];
            high = [high[0].max(x + 1), high[1].max(y + 1)];
        }
    }
    // One pixel where nothing has changed: no frame is empty.
    let size = |k: usize| high[k].saturating_sub(low[k]).max(1);
    let corner = |k: usize, most: usize| low[k].min(most - 1);
    [[corner(0, now.width), corner(1, now.height)], [size(0), size(1)]]
}

/// The pixels of a rectangle.
fn cut(picture: &Picture, [left, top]: [usize; 2], [width, height]: [usize; 2]) -> Vec<u8> {
    let row = |y: usize| {
        let start = 3 * ((top + y) * picture.width + left);
        &picture.rgb[start..start + 3 * width]
    };
    (0..height).flat_map(row).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_changed_is_the_least_rectangle() {
        let before = Picture::new(9, 7);
        let mut now = before.clone();
        assert_eq!(changed(&before, &now), [[8, 6], [1, 1]]);
        now.set(3, 2, INK);
        now.set(5, 4, INK);
        assert_eq!(changed(&before, &now), [[3, 2], [3, 3]]);
        let pixels = cut(&now, [3, 2], [3, 3]);
        assert_eq!((pixels.len(), &pixels[..3], &pixels[24..]), (27, &INK[..], &INK[..]));
    }
}
