//! Triangles that hide each other, lit from beside the eye.

use nalgebra::Vector3;

use super::camera::Camera;

/// Where the lamp is: right, up, towards the eye.
const LAMP: [f64; 3] = [-0.4, 0.6, 1.0];

/// How much light there is without the lamp, of all.
const AMBIENT: f64 = 0.42;

/// The nearest of what has been drawn, by pixel.
pub(super) struct Layer {
    width: usize,
    height: usize,
    /// Distance along the view, mm; infinite where nothing is.
    pub depth: Vec<f32>,
    /// From 0 to 1.
    pub light: Vec<f32>,
    /// Which surface.
    pub which: Vec<u8>,
}

impl Layer {
    pub fn new([width, height]: [usize; 2]) -> Self {
        let n = width * height;
        let depth = vec![f32::INFINITY; n];
        Self { width, height, depth, light: vec![0.0; n], which: vec![0; n] }
    }

    /// Draws a closed surface, of which only what looks to the eye is seen. Points in mm, corners
    /// counter-clockwise as seen from outside.
    pub fn draw(
        &mut self,
        camera: &Camera,
        points: &[Vector3<f64>],
        triangles: &[[u32; 3]],
        which: u8,
    ) {
        let mut normals = vec![Vector3::zeros(); points.len()];
        for corners in triangles {
            let [a, b, c] = corners.map(|corner| points[corner as usize]);
            // As long as twice the area: large triangles count more.
            let normal = (b - a).cross(&(c - a));
            corners.iter().for_each(|&corner| normals[corner as usize] += normal);
        }
        let lamp = Vector3::from(LAMP).normalize();
        let light = |normal: &Vector3<f64>| {
            let along = camera.turn(normal).try_normalize(0.0).map_or(0.0, |n| n.dot(&lamp));
            AMBIENT + (1.0 - AMBIENT) * along.max(0.0)
        };
        let lit: Vec<f64> = normals.iter().map(light).collect();
        let seen: Vec<Vector3<f64>> = points.iter().map(|x| camera.see(x)).collect();
        for corners in triangles {
            let at = corners.map(|corner| seen[corner as usize]);
            self.fill(at, corners.map(|corner| lit[corner as usize]), which);
        }
    }

    fn fill(&mut self, [a, b, c]: [Vector3<f64>; 3], lit: [f64; 3], which: u8) {
        let side = |p: &Vector3<f64>, q: &Vector3<f64>, [x, y]: [f64; 2]| {
            (q.x - p.x) * (y - p.y) - (q.y - p.y) * (x - p.x)
        };
        // Negative as rows go down: what looks away is not drawn.
        let area = side(&a, &b, [c.x, c.y]);
        if !(area < 0.0) {
            return;
        }
        let range = |axis: usize, most: usize| {
            let (low, high) =
                (a[axis].min(b[axis]).min(c[axis]), a[axis].max(b[axis]).max(c[axis]));
            // A cast saturates: what is beyond the edges is not drawn.
            let first = (low - 0.5).ceil().max(0.0) as usize;
            first..((high + 0.5).floor().max(0.0) as usize).min(most)
        };
        for row in range(1, self.height) {
            for column in range(0, self.width) {
                let at = [column as f64 + 0.5, row as f64 + 0.5];
                let share =
                    [side(&b, &c, at), side(&c, &a, at), side(&a, &b, at)].map(|s| s / area);
                if share.iter().any(|share| *share < 0.0) {
                    continue;
                }
                let mean = |of: [f64; 3]| (0..3).map(|k| share[k] * of[k]).sum::<f64>() as f32;
                let depth = mean([a.z, b.z, c.z]);
                let pixel = row * self.width + column;
                if depth < self.depth[pixel] {
                    self.depth[pixel] = depth;
                    self.light[pixel] = mean(lit);
                    self.which[pixel] = which;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearer_of_two_is_seen_and_what_looks_away_is_not() {
        let ends = [Vector3::repeat(-50.0), Vector3::repeat(50.0)];
        let camera = Camera::new(ends, [40, 40]);
        // Facing anterior, where the eye is: the patient's right is at the left.
        let at = |y: f64, size: f64| {
            [[size, -size], [-size, -size], [0.0, size]].map(|[x, z]| Vector3::new(x, y, z))
        };
        let mut layer = Layer::new([40, 40]);
        layer.draw(&camera, &at(0.0, 60.0), &[[0, 1, 2]], 1);
        layer.draw(&camera, &at(30.0, 15.0), &[[0, 1, 2]], 2);
        layer.draw(&camera, &at(-30.0, 60.0), &[[0, 1, 2]], 3);
        layer.draw(&camera, &at(45.0, 60.0), &[[0, 2, 1]], 4);
        let count = |which: u8| {
            let both = layer.which.iter().zip(&layer.depth);
            both.filter(|(one, depth)| **one == which && depth.is_finite()).count()
        };
        assert!(count(1) > 100 && count(2) > 10 && count(4) == 0, "{} {}", count(1), count(2));
        assert!(count(2) < count(1));
        let lit = layer.light.iter().zip(&layer.depth).filter(|(_, depth)| depth.is_finite());
        // The lamp is 49.15 degrees from anterior: .42 + .58 cos.
        assert!(lit.clone().all(|(light, _)| (light - 0.7994).abs() < 1e-3), "{lit:?}");
    }
}
