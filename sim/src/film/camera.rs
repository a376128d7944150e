//! An eye in front of the body, as the page has it: from the front and a little from above.

use nalgebra::{Matrix3, Vector3};

/// Where the eye is from the body, scanner axes.
const FROM: [f64; 3] = [-0.25, 0.9, 0.35];

/// How far away it is, in diagonals of the body's box.
const FAR: f64 = 1.75;

/// Part of the picture that the box takes, across or down.
const TAKES: f64 = 0.94;

/// Looks at a body.
pub(super) struct Camera {
    eye: Vector3<f64>,
    /// Rows: to the right, up, towards the eye.
    axes: Matrix3<f64>,
    middle: [f64; 2],
    /// Pixels of a length at the same distance.
    scale: f64,
}

impl Camera {
    /// One that sees all of a box (mm), as large as a picture of this size in pixels takes it.
    pub fn new([low, high]: [Vector3<f64>; 2], [width, height]: [usize; 2]) -> Self {
        let back = Vector3::from(FROM).normalize();
        let right = Vector3::z().cross(&back).normalize();
        let axes = Matrix3::from_rows(&[right, back.cross(&right), back].map(|x| x.transpose()));
        let eye = 0.5 * (low + high) + back * (FAR * (high - low).norm().max(1e-6));
        let unit = Self { eye, axes, middle: [0.0; 2], scale: 1.0 };
        let corner = |k: usize| {
            let side = Vector3::from_fn(|axis, _| f64::from(u8::from(k >> axis & 1 == 1)));
            unit.see(&(low + (high - low).component_mul(&side)))
        };
        let corners: [Vector3<f64>; 8] = std::array::from_fn(corner);
        let least = corners.iter().fold(corners[0], |least, x| least.inf(x));
        let most = corners.iter().fold(corners[0], |most, x| most.sup(x));
        let size = [width as f64, height as f64];
        let room = |k: usize| TAKES * size[k] / (most[k] - least[k]).max(1e-9);
        let scale = room(0).min(room(1));
        let middle = [0, 1].map(|k| 0.5 * size[k] - 0.5 * scale * (least[k] + most[k]));
        Self { middle, scale, ..unit }
    }

    /// Pixels across and down of a place (mm), and its distance along the view, mm.
    pub fn see(&self, x: &Vector3<f64>) -> Vector3<f64> {
        let at = self.axes * (x - self.eye);
        // Behind the eye there is nothing of a body that the eye sees whole.
        let away = (-at.z).max(1e-3);
        let [across, down] = self.middle;
        Vector3::new(across + at.x * self.scale / away, down - at.y * self.scale / away, away)
    }

    /// A direction along right, up and towards the eye.
    pub fn turn(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        self.axes * direction
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_fills_the_picture_with_superior_up_and_right_at_the_left() {
        let ends = [Vector3::new(-50.0, -30.0, -20.0), Vector3::new(50.0, 40.0, 60.0)];
        let camera = Camera::new(ends, [400, 300]);
        let mut most = [0.0_f64; 2];
        for k in 0..8 {
            let at = Vector3::from_fn(|axis, _| ends[k >> axis & 1][axis]);
            let seen = camera.see(&at);
            assert!((0.0..=400.0).contains(&seen.x) && (0.0..=300.0).contains(&seen.y), "{seen}");
            most = [most[0].max(seen.x), most[1].max(seen.y)];
        }
        assert!(most[0] > 380.0 || most[1] > 285.0, "{most:?}");
        let middle = camera.see(&Vector3::zeros());
        let (up, right) = (camera.see(&(50.0 * Vector3::z())), camera.see(&(50.0 * Vector3::x())));
        assert!(up.y < middle.y - 20.0 && right.x < middle.x - 20.0, "{up} {right}");
        assert!(camera.see(&(50.0 * Vector3::y())).z < middle.z, "anterior is near");
    }
}
