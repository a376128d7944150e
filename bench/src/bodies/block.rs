//! A unit cube, clamped at the bottom and pulled at the top, solved at rest by any element.

use std::sync::Arc;

use nalgebra::Vector3;
use yawara::inverse::SlotMap;
use yawara_embed::{ElementFormulation, Embedding, LinearTet, Material, MixedModuli, by_name};
use yawara_inverse_update::{InverseMaintainer, Sparse};
use yawara_mesh::kuhn::{Point, bisect, midpoint};
use yawara_mesh::volume::{Grid, LabelVolume};
use yawara_mesh::{BisectionForest, CellGrid, LabelTree, VertexId};

use crate::bodies::cube_mesh::CubeMesh;
use crate::bodies::solid::places;
use crate::error::Result;

/// Voxels along the cube.
const VOXELS: usize = 16;

/// Level at which a cube of six tetrahedra is a voxel.
pub(crate) const VOXEL_LEVEL: u8 = 12;

/// The finest level that a block can be solved at.
pub(crate) const FINEST_LEVEL: u8 = 15;

/// Height from which pressures count as away from the clamp, whose edge makes them singular.
const ABOVE_CLAMP: f64 = 0.25;

/// A unit cube of E = 1 around what fills it.
pub(crate) struct Block {
    tree: Arc<LabelTree>,
    embedding: Embedding,
    moduli: MixedModuli,
}

/// Relative errors of a field, ‖u − u*‖ / ‖u*‖ each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Difference {
    /// Of displacements.
    pub displacement: f64,
    /// Of pressures; means nothing where the modulus is not the same everywhere.
    pub pressure: f64,
    /// Of pressures away from the singular edge of the clamp.
    pub pressure_above: f64,
}

/// Displacements and pressures of a block under one load.
pub(crate) struct Field {
    mesh: CubeMesh,
    /// By vertex number.
    displacement: Vec<Vector3<f64>>,
    pressure: Pressure,
}

/// Tension positive, Pa.
enum Pressure {
    /// Linear between vertices, by vertex number.
    Linear(Vec<f64>),
    /// Constant in tetrahedra.
    Constant,
}

impl Block {
    /// The cube with one Poisson's ratio throughout, homogenised by `laminate`; with a ball of
    /// radius .3 around (.53, .47, .51) that is so many times as stiff, if there is one.
    pub fn new(ball: Option<f64>, poisson_ratio: f64) -> Result<Self> {
        let tree = if ball.is_some() { sphere()? } else { LabelTree::homogeneous([1; 3], 1) };
        let tree = Arc::new(tree);
        let materials =
            [1.0, 1.0, ball.unwrap_or(1.0)].map(|young| Material::new(young, poisson_ratio, 1.0));
        let materials = materials.into_iter().collect::<Result<Vec<_>, _>>()?;
        let moduli = MixedModuli::new(&materials[1].elasticity())?;
        let embedding = Embedding::new(Arc::clone(&tree), materials, by_name("laminate")?)?;
        Ok(Self { tree, embedding, moduli })
    }

    /// The fields under tension and shear on the uniform mesh of a level.
    pub fn solve(&self, level: u8, element: &dyn ElementFormulation) -> Result<[Field; 2]> {
        let mesh = CubeMesh::new(&self.tree, level, FINEST_LEVEL)?;
        let (slots, k) = mesh.assembled(element, &self.embedding)?;
        let inverse = Sparse::new(k)?;
        let m = element.unknowns();
        let [tension, shear] = mesh.loads(m).map(|load| {
            let load = slots.gather(m, &load);
            let mut u = vec![0.0; load.len()];
            inverse.solve(&load, &mut u)?;
            Ok(self.field(&mesh, &slots, &u, m))
        });
        tension.and_then(|tension| Ok([tension, shear?]))
    }

    fn field(&self, mesh: &CubeMesh, slots: &SlotMap, solution: &[f64], m: usize) -> Field {
        let mut u = vec![0.0; m * mesh.forest.vertex_capacity()];
        slots.scatter(m, solution, &mut u);
        let displacement = u.chunks_exact(m).map(|u| Vector3::new(u[0], u[1], u[2])).collect();
        let of = |u: &[f64]| u.get(3).map_or(0.0, |q| self.moduli.shear * q);
        let pressure = u.chunks_exact(m).map(of).collect();
        let pressure = if m == 4 { Pressure::Linear(pressure) } else { Pressure::Constant };
        Field { mesh: mesh.clone(), displacement, pressure }
    }

    /// How far `coarse` is from `fine`, which has to have linear pressures: in L² over the cube,
    /// and pressures also over the part above [`ABOVE_CLAMP`].
    pub fn difference(&self, coarse: &Field, fine: &Field) -> Difference {
        let level = fine.forest().start_level();
        let mut sums = Sums::default();
        for tet in coarse.forest().leaves() {
            let index = tet.vertices.map(VertexId::index);
            let u = index.map(|i| coarse.displacement[i]);
            let p = match &coarse.pressure {
                Pressure::Linear(p) => index.map(|i| p[i]),
                Pressure::Constant => {
                    let geometry = LinearTet::new(&tet.vertices.map(|v| coarse.mesh.rest(v)));
                    [self.moduli.bulk * geometry.gradient(&u).trace(); 4]
                }
            };
            let corners =
                std::array::from_fn(|i| (coarse.forest().point(tet.vertices[i]), u[i], p[i]));
            descend(&corners, tet.level, level, fine, &mut sums);
        }
        let [displacement, pressure, pressure_above] =
            sums.map(|[error, whole]| (error / whole).sqrt());
        Difference { displacement, pressure, pressure_above }
    }
}

impl Field {
    /// Vertices of the mesh, held ones included.
    pub fn vertices(&self) -> usize {
        self.forest().vertex_count()
    }

    fn forest(&self) -> &BisectionForest {
        &self.mesh.forest
    }

    /// The number here of another mesh's vertex, which is one of this mesh too.
    fn same(&self, other: &Self, v: VertexId) -> usize {
        self.forest().vertex_at(other.forest().point(v)).map_or(0, VertexId::index)
    }

    /// The displacements of `of` at the vertices of `on`, which are vertices of its too, linear in
    /// between: what no element of that mesh can be much better than.
    pub fn interpolant(on: &Self, of: &Self) -> Self {
        let mut displacement = on.displacement.clone();
        for v in on.forest().vertices() {
            displacement[v.index()] = of.displacement[of.same(on, v)];
        }
        Self { mesh: on.mesh.clone(), displacement, pressure: Pressure::Constant }
    }

    /// The limit that two fields on uniform meshes, three levels apart, converge to with h², on the
    /// coarser one's mesh: u + ⅓(u − u_coarse). Pressures are those of the finer mesh.
    ///
    /// Both have to have linear pressures.
    pub fn limit(coarse: &Self, fine: &Self) -> Self {
        let mut displacement = coarse.displacement.clone();
        let mut pressures = vec![0.0; displacement.len()];
        for v in coarse.forest().vertices() {
            let same = fine.same(coarse, v);
            let exact = fine.displacement[same];
            displacement[v.index()] = exact + (exact - displacement[v.index()]) / 3.0;
            if let Pressure::Linear(pressure) = &fine.pressure {
                pressures[v.index()] = pressure[same];
            }
        }
        Self { mesh: coarse.mesh.clone(), displacement, pressure: Pressure::Linear(pressures) }
    }
}

/// A lattice point with displacement and pressure there.
type Corner = (Point, Vector3<f64>, f64);

/// Of displacements, pressures and those above the clamp: Σ over tetrahedra of equal volume of the
/// square of a difference, and of what it is from.
type Sums = [[f64; 2]; 3];

/// Follows the linear fields of a tetrahedron down to the level of `fine` and compares.
fn descend(corners: &[Corner; 4], level: u8, finest: u8, fine: &Field, sums: &mut Sums) {
    if level < finest {
        let end = yawara_mesh::kuhn::bisected_corner(level);
        let (a, b) = (corners[0], corners[end]);
        let point = midpoint(&corners.map(|c| c.0), level);
        let middle = (point, 0.5 * (a.1 + b.1), 0.5 * (a.2 + b.2));
        for half in bisect(corners, level, middle) {
            descend(&half, level + 1, finest, fine, sums);
        }
        return;
    }
    let Pressure::Linear(pressure) = &fine.pressure else { return };
    let reference = corners.map(|(point, ..)| {
        let index = fine.forest().vertex_at(point).map_or(0, VertexId::index);
        (fine.displacement[index], pressure[index])
    });
    for axis in 0..3 {
        let exact = reference.map(|r| r.0[axis]);
        let error = std::array::from_fn(|i| corners[i].1[axis] - exact[i]);
        sums[0][0] += square(&error);
        sums[0][1] += square(&exact);
    }
    let exact = reference.map(|r| r.1);
    let error = std::array::from_fn(|i| corners[i].2 - exact[i]);
    let edge = f64::from(fine.forest().domain().lattice().units) * ABOVE_CLAMP;
    let is_above = corners.iter().all(|(point, ..)| f64::from(point[2]) >= edge);
    for sum in &mut sums[1..if is_above { 3 } else { 2 }] {
        sum[0] += square(&error);
        sum[1] += square(&exact);
    }
}

/// ∫ f² of a linear f over a tetrahedron, up to V/20.
fn square(values: &[f64; 4]) -> f64 {
    values.iter().map(|x| x * x).sum::<f64>() + values.iter().sum::<f64>().powi(2)
}

/// Label 2 where a voxel's centre lies in the ball.
fn sphere() -> Result<LabelTree> {
    let labels = places([VOXELS; 3]).map(|voxel| {
        let centre = voxel.map(|c| (c as f64 + 0.5) / VOXELS as f64);
        let off = Vector3::from(centre) - Vector3::new(0.53, 0.47, 0.51);
        1 + u16::from(off.norm() < 0.3)
    });
    let grid = Grid::centred([VOXELS; 3], 1e3 / VOXELS as f64);
    let volume = LabelVolume::new(grid, labels.collect(), vec![0, 1, 2])?;
    let cells = CellGrid { cells: [1; 3], voxels_per_cell: VOXELS, first_voxel: [0; 3] };
    Ok(LabelTree::new(&volume, cells)?)
}
