//! Bodies of linear tetrahedra over simple shapes, for studies with a known solution.

use nalgebra::{Matrix3, Matrix6, Vector3};
use yawara_corot::{Body, Element};
use yawara_embed::LinearTet;
use yawara_mesh::TetId;
use yawara_mesh::kuhn::{ROOTS_PER_CELL, root_corners};

/// A tetrahedral body at rest with the elasticity of every tetrahedron.
#[derive(Clone, Debug)]
pub struct Solid {
    /// Rest positions by vertex number.
    pub points: Vec<Vector3<f64>>,
    /// Corners.
    pub tets: Vec<[usize; 4]>,
    /// Elasticity D by tetrahedron.
    pub elasticity: Vec<Matrix6<f64>>,
}

impl Solid {
    /// A block from the origin to `size`, `cells` cubes of six Kuhn tetrahedra each.
    pub fn block(cells: [usize; 3], size: [f64; 3], elasticity: Matrix6<f64>) -> Self {
        let counts = cells.map(|n| n + 1);
        let point = |at: [usize; 3]| {
            Vector3::from_fn(|axis, _| size[axis] * at[axis] as f64 / cells[axis] as f64)
        };
        let number = |p: [i32; 3]| {
            let [x, y, z] = p.map(|c| c as usize);
            x + counts[0] * (y + counts[1] * z)
        };
        let roots = |cell: [usize; 3]| {
            (0..ROOTS_PER_CELL).map(move |order| root_corners(cell, order, 1).map(number))
        };
        let tets: Vec<[usize; 4]> = places(cells).flat_map(roots).collect();
        let elasticity = vec![elasticity; tets.len()];
        Self { points: places(counts).map(point).collect(), tets, elasticity }
    }

    /// A ball around the origin: a sphere's triangles, an octahedron's faces divided into
    /// `divisions`² each, extruded inwards through the `radii` (descending, the last may be 0: the
    /// centre). `elasticity` is that between radius i and i + 1.
    pub fn ball(
        divisions: usize,
        radii: &[f64],
        elasticity: impl Fn(usize) -> Matrix6<f64>,
    ) -> Self {
        let (directions, triangles) = octahedral_sphere(divisions);
        let sphere = directions.len();
        let mut solid = Self { points: Vec::new(), tets: Vec::new(), elasticity: Vec::new() };
        for &radius in radii.iter().filter(|&&r| r > 0.0) {
            solid.points.extend(directions.iter().map(|d| d * radius));
        }
        let centre = solid.points.len();
        if radii.last() == Some(&0.0) {
            solid.points.push(Vector3::zeros());
        }
        for layer in 0..radii.len() - 1 {
            let d = elasticity(layer);
            for triangle in &triangles {
                // Cut by the order of the numbers: neighbours agree on the diagonals.
                let mut base = *triangle;
                base.sort_unstable();
                let [a, b, c] = base.map(|v| v + layer * sphere);
                if radii[layer + 1] == 0.0 {
                    solid.push([a, b, c, centre], d);
                    continue;
                }
                let [a1, b1, c1] = [a, b, c].map(|v| v + sphere);
                solid.push([a, b, c, c1], d);
                solid.push([a, b, b1, c1], d);
                solid.push([a, a1, b1, c1], d);
            }
        }
        solid
    }

    fn push(&mut self, corners: [usize; 4], elasticity: Matrix6<f64>) {
        self.tets.push(corners);
        self.elasticity.push(elasticity);
    }

    /// Rest geometry of a tetrahedron.
    pub fn geometry(&self, tet: usize) -> LinearTet {
        LinearTet::new(&self.tets[tet].map(|v| self.points[v]))
    }

    /// The elements, unrotated, by the numbers of the tetrahedra.
    pub fn body(&self) -> Body {
        self.fill(Body::new())
    }

    /// The same in an empty `body` of either kind of element.
    pub fn fill(&self, body: Body) -> Body {
        self.fill_made_of(body, &[])
    }

    /// The same under a law that has to know of each element what it is made of.
    pub fn fill_made_of(&self, mut body: Body, made_of: &[f64]) -> Body {
        for (tet, &vertices) in self.tets.iter().enumerate() {
            let element = Element {
                tet: TetId(tet as u32),
                vertices,
                geometry: self.geometry(tet),
                elasticity: self.elasticity[tet],
            };
            body.insert_made_of(element, &Matrix3::identity(), made_of);
        }
        body
    }

    /// The forces of a dead traction t(x), Pa, on the boundary faces that `on` picks by their
    /// centroid: a third of each face's share on its corners.
    pub fn traction(
        &self,
        on: impl Fn(&Vector3<f64>) -> bool,
        traction: impl Fn(&Vector3<f64>) -> Vector3<f64>,
    ) -> Vec<Vector3<f64>> {
        let mut forces = vec![Vector3::zeros(); self.points.len()];
        for face in self.boundary() {
            let [a, b, c] = face.map(|v| self.points[v]);
            let centroid = (a + b + c) / 3.0;
            if on(&centroid) {
                let share = (b - a).cross(&(c - a)).norm() / 6.0 * traction(&centroid);
                face.into_iter().for_each(|v| forces[v] += share);
            }
        }
        forces
    }

    /// Faces with one tetrahedron, each as the numbers of its corners in ascending order.
    pub fn boundary(&self) -> Vec<[usize; 3]> {
        let mut faces: Vec<[usize; 3]> = Vec::with_capacity(4 * self.tets.len());
        for tet in &self.tets {
            for opposite in 0..4 {
                let mut face = [1, 2, 3].map(|step| tet[(opposite + step) % 4]);
                face.sort_unstable();
                faces.push(face);
            }
        }
        faces.sort_unstable();
        let alone = |i: usize| {
            (i == 0 || faces[i - 1] != faces[i])
                && (i + 1 == faces.len() || faces[i + 1] != faces[i])
        };
        (0..faces.len()).filter(|&i| alone(i)).map(|i| faces[i]).collect()
    }
}

/// The places of a grid, the first axis fastest.
pub(crate) fn places([nx, ny, nz]: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    (0..nx * ny * nz).map(move |i| [i % nx, i / nx % ny, i / (nx * ny)])
}

/// Directions and triangles of an octahedron with its faces divided and blown up.
fn octahedral_sphere(divisions: usize) -> (Vec<Vector3<f64>>, Vec<[usize; 3]>) {
    let n = divisions as i32;
    let mut number = std::collections::HashMap::new();
    let mut directions = Vec::new();
    let mut triangles = Vec::new();
    for octant in 0..8 {
        let sign = [0, 1, 2].map(|axis| if octant >> axis & 1 == 0 { 1 } else { -1 });
        let mut vertex = |i: i32, j: i32| {
            let at = [sign[0] * i, sign[1] * j, sign[2] * (n - i - j)];
            *number.entry(at).or_insert_with(|| {
                directions.push(Vector3::from(at.map(f64::from)).normalize());
                directions.len() - 1
            })
        };
        for i in 0..n {
            for j in 0..n - i {
                triangles.push([vertex(i, j), vertex(i + 1, j), vertex(i, j + 1)]);
                if i + j + 2 <= n {
                    triangles.push([vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)]);
                }
            }
        }
    }
    (directions, triangles)
}

#[cfg(test)]
mod tests {
    use super::*;
    use yawara_embed::isotropic;

    fn volume(solid: &Solid) -> f64 {
        (0..solid.tets.len()).map(|t| solid.geometry(t).volume).sum()
    }

    #[test]
    fn a_block_fills_its_box_and_its_boundary_is_its_surface() {
        let solid = Solid::block([3, 2, 1], [3.0, 1.0, 0.5], isotropic(1.0, 0.3));
        assert!((volume(&solid) - 1.5).abs() < 1e-14);
        assert_eq!((solid.points.len(), solid.tets.len()), (24, 36));
        // Two triangles per cell face on the surface.
        assert_eq!(solid.boundary().len(), 2 * 2 * (3 * 2 + 3 + 2));
        let forces = solid.traction(|x| x.x > 2.9, |_| Vector3::new(0.0, 4.0, 0.0));
        let total: Vector3<f64> = forces.iter().sum();
        assert!((total - Vector3::new(0.0, 2.0, 0.0)).norm() < 1e-14);
    }

    #[test]
    fn a_ball_is_closed_and_its_volume_converges() {
        let ball = |n: usize, radii: &[f64]| Solid::ball(n, radii, |_| isotropic(1.0, 0.3));
        let full = 4.0 / 3.0 * std::f64::consts::PI;
        let missing = [8, 16].map(|n| full - volume(&ball(n, &[1.0, 0.5, 0.0])));
        assert!(missing[0] > 0.0 && (missing[0] / missing[1]).log2() > 1.8, "{missing:?}");
        assert_eq!(ball(4, &[1.0, 0.5, 0.0]).boundary().len(), 8 * 16);
        assert_eq!(ball(4, &[1.0, 0.5]).boundary().len(), 2 * 8 * 16);
        let shell = ball(16, &[1.0, 0.7, 0.5]);
        assert!((volume(&shell) / (full * 0.875) - 1.0).abs() < 0.02);
    }
}
