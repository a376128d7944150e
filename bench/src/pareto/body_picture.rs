//! What the body looks like, where it is moved the most.

use std::collections::HashMap;

use nalgebra::{Vector2, Vector3};
use yawara::Simulation;
use yawara::report::Frame;

use crate::error::Result;
use crate::harness::plot::{Picture, Role, Shape};

/// Size and margin of the picture.
const SIZE: (u32, u32) = (520, 380);
const MARGIN: f64 = 12.0;

/// The frame with the largest displacement that was seen.
#[derive(Default)]
pub(crate) struct Largest {
    frame: Option<Frame>,
    moved_mm: f64,
}

impl Largest {
    /// Looks at the body as it is.
    pub fn see(&mut self, simulation: &Simulation) -> Result<()> {
        let frame = simulation.frame()?;
        let length = |u: &[f64; 3]| Vector3::from(*u).norm();
        let moved = frame.displacement_mm.iter().map(length).fold(0.0, f64::max);
        if self.frame.is_none() || moved > self.moved_mm {
            (self.frame, self.moved_mm) = (Some(frame), moved);
        }
        Ok(())
    }

    /// The outer faces of what is not void, coloured by label, seen from the front left and above.
    pub fn picture(&self) -> Option<Picture> {
        let faces = outer_faces(self.frame.as_ref()?);
        (!faces.is_empty()).then(|| draw(&faces))
    }
}

struct Face {
    corners: [Vector3<f64>; 3],
    label: i64,
}

/// Faces of one tetrahedron with material only.
fn outer_faces(frame: &Frame) -> Vec<Face> {
    let mut seen: HashMap<[u32; 3], Option<([u32; 3], i64)>> = HashMap::new();
    for (tet, &label) in frame.tets.iter().zip(&frame.label).filter(|(_, label)| **label != 0) {
        let [a, b, c, d] = *tet;
        // Seen from outside, counter-clockwise.
        for face in [[b, c, d], [a, d, c], [a, b, d], [a, c, b]] {
            let mut key = face;
            key.sort_unstable();
            let entry = seen.entry(key).or_insert(Some((face, label)));
            if *entry != Some((face, label)) {
                *entry = None;
            }
        }
    }
    let mut outer: Vec<([u32; 3], i64)> = seen.into_values().flatten().collect();
    // The map's order is another one every time.
    outer.sort_unstable();
    let at = |v: u32| Vector3::from(frame.points_mm[v as usize]);
    outer.into_iter().map(|(face, label)| Face { corners: face.map(at), label }).collect()
}

fn draw(faces: &[Face]) -> Picture {
    // To the viewer, to the right and up, in scanner axes.
    let view = Vector3::new(-0.45, 0.8, 0.4).normalize();
    let right = Vector3::z().cross(&view).normalize();
    let up = view.cross(&right);
    let flat = |x: &Vector3<f64>| Vector2::new(x.dot(&right), -x.dot(&up));
    let corners = faces.iter().flat_map(|face| &face.corners).map(flat);
    let low = corners.clone().reduce(|a, b| a.inf(&b)).unwrap_or_default();
    let size = corners.reduce(|a, b| a.sup(&b)).unwrap_or_default() - low;
    let room = Vector2::new(f64::from(SIZE.0), f64::from(SIZE.1)).add_scalar(-2.0 * MARGIN);
    let scale = room.component_div(&size).min();
    let off = (0.5 * (room - scale * size)).add_scalar(MARGIN);
    let place = |x: &Vector3<f64>| {
        let at = off + scale * (flat(x) - low);
        (at.x, at.y)
    };
    let mut labels: Vec<i64> = faces.iter().map(|face| face.label).collect();
    labels.sort_unstable();
    labels.dedup();
    let seen = |face| {
        let &Face { corners: [a, b, c], .. } = face;
        (view.dot(&(a + b + c)), face, (b - a).cross(&(c - a)).normalize())
    };
    let mut visible: Vec<_> =
        faces.iter().map(seen).filter(|(_, _, normal)| normal.dot(&view) > 0.0).collect();
    visible.sort_by(|a, b| a.0.total_cmp(&b.0));
    let light = Vector3::new(-0.2, 0.5, 0.85).normalize();
    let mut shapes = Vec::new();
    for (_, face, normal) in visible {
        let number = labels.iter().position(|label| *label == face.label).unwrap_or(0);
        let bright = 0.55 + 0.45 * normal.dot(&light).max(0.0);
        let mut points: Vec<(f64, f64)> = face.corners.iter().map(place).collect();
        let colour = |factor: f64| Role::Paint(tissue(number).map(|c| (c * factor) as u8));
        shapes.push(Shape::Polygon { points: points.clone(), role: colour(bright) });
        points.push(points[0]);
        shapes.push(Shape::Line { points, width: 0.4, role: colour(0.6 * bright) });
    }
    Picture { width: SIZE.0, height: SIZE.1, shapes }
}

/// Colours by label, in its order: flesh, blue, green, yellow and again.
fn tissue(number: usize) -> [f64; 3] {
    let colours = [[214.0, 130.0, 112.0], [106.0, 140.0, 205.0], [120.0, 170.0, 110.0]];
    colours.get(number % 4).copied().unwrap_or([222.0, 196.0, 110.0])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(tets: Vec<[u32; 4]>, label: Vec<i64>) -> Frame {
        let points_mm = vec![[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [1., 1., 1.]];
        Frame { points_mm, tets, label, ..Frame::default() }
    }

    #[test]
    fn inner_faces_and_void_are_not_seen() {
        let two = vec![[0, 1, 2, 3], [4, 2, 1, 3]];
        assert_eq!(outer_faces(&frame(two.clone(), vec![1, 1])).len(), 6);
        assert_eq!(outer_faces(&frame(two.clone(), vec![1, 2])).len(), 6);
        assert_eq!(outer_faces(&frame(two.clone(), vec![1, 0])).len(), 4);
        assert!(outer_faces(&frame(two, vec![0, 0])).is_empty());
    }

    #[test]
    fn normals_point_outward_and_the_drawing_stays_on_its_paper() {
        let faces = outer_faces(&frame(vec![[0, 1, 2, 3]], vec![1]));
        let centre = Vector3::repeat(0.25);
        for Face { corners: [a, b, c], .. } in &faces {
            assert!((b - a).cross(&(c - a)).dot(&(a - centre)) > 0.0);
        }
        let picture = draw(&faces);
        assert!(!picture.shapes.is_empty());
        for shape in &picture.shapes {
            let Shape::Polygon { points, .. } = shape else { continue };
            for (x, y) in points {
                assert!((0.0..=f64::from(SIZE.0)).contains(x), "{x}");
                assert!((0.0..=f64::from(SIZE.1)).contains(y), "{y}");
            }
        }
    }
}
