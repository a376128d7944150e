//! The bodies, and the same on coarser meshes and by the built-in factor.

use std::sync::Arc;

use faer::Mat;
use nalgebra::Vector3;
use yawara::inverse::Assembly;
use yawara_corot::{ElementCorotation, Tolerance, equilibrium_by_name};
use yawara_embed::{Embedding, Material, P1, SparseCholesky, by_name};
use yawara_inverse_update::elimination_order;
use yawara_mesh::phantom::{LiverPhantom, liver};
use yawara_mesh::volume::{Grid, LabelVolume};
use yawara_mesh::{
    BisectionForest, CellGrid, Domain, LabelTree, Lattice, Placement, Point, VertexId,
};

use crate::bodies::organ::{elements_of, held_box, organ_materials};
use crate::bodies::solid::places;
use crate::bodies::{Solid, Statics};
use crate::error::{BenchError, Result};
use crate::petsc::Problem;
use crate::solvers::direct::lower_half;

/// Voxels along a root cube.
const VOXELS_PER_CELL: usize = 8;

/// A unit cube of E = 1 Pa and ρ = 1 kg/m³ on its clamped bottom, around a ball of radius .3 that is `ratio` times as
/// stiff. Its weight, which leans, sinks it by some hundredths.
pub(super) fn cube(voxels: usize, ratio: f64) -> Result<Problem> {
    let labels = places([voxels; 3]).map(|voxel| {
        let centre = voxel.map(|c| (c as f64 + 0.5) / voxels as f64);
        1 + u16::from((Vector3::from(centre) - Vector3::new(0.53, 0.47, 0.51)).norm() < 0.3)
    });
    let grid = Grid::centred([voxels; 3], 1e3 / voxels as f64);
    let volume = LabelVolume::new(grid, labels.collect(), vec![0, 1, 2])?;
    let along = voxels / VOXELS_PER_CELL;
    let grid =
        CellGrid { cells: [along; 3], voxels_per_cell: VOXELS_PER_CELL, first_voxel: [0; 3] };
    let materials = [1e-3, 1.0, ratio].map(|young| Material::new(young, 0.3, 1.0));
    Ok(Problem {
        cubes: (0..along.pow(3)).collect(),
        tree: Arc::new(LabelTree::new(&volume, grid)?),
        materials: materials.into_iter().collect::<Result<_, _>>()?,
        origin: Vector3::zeros(),
        voxel_m: 1.0 / voxels as f64,
        is_held: Box::new(|x| x.z <= 0.0),
        is_held_alike: true,
        gravity: Vector3::new(0.02, 0.0, -0.05),
    })
}

/// The liver phantom, held where its scene holds it, under a twentieth of its weight.
pub(super) fn organ(voxel_mm: f64) -> Result<Problem> {
    let volume = liver(LiverPhantom { length_mm: 196.0, voxel_mm, seed: 1 })?;
    let grid = CellGrid::around(&volume, VOXELS_PER_CELL)?;
    let tree = Arc::new(LabelTree::new(&volume, grid)?);
    let (lattice, voxel_m) = (Lattice::new(grid.cells, 0), 1e-3 * voxel_mm);
    let [low, high] = held_box(&volume);
    Ok(Problem {
        cubes: Domain::of_labels(lattice, &tree).cells().collect(),
        tree,
        materials: organ_materials()?,
        origin: Vector3::from(grid.first_voxel.map(|v| v as f64 * voxel_m)),
        voxel_m,
        is_held: Box::new(move |x| (0..3).all(|i| x[i] >= low[i] && x[i] <= high[i])),
        is_held_alike: false,
        gravity: Vector3::new(0.0, 0.0, -9.81 / 20.0),
    })
}

/// Where the co-rotated body comes to rest on its finest mesh by the equilibrium solvers of this project: displacements by
/// voxel corner, m.
/// # Errors
/// [`BenchError::NotConverged`] if it does not.
pub(super) fn corotated(problem: &Problem, residual: f64) -> Result<Vec<(Point, Vector3<f64>)>> {
    let finest = problem.tree.grid().embed_level();
    let (forest, placement) = meshed(problem, finest)?;
    let embedding = embedded(problem)?;
    let mut solid = Solid { points: Vec::new(), tets: Vec::new(), elasticity: Vec::new() };
    solid.points = forest.vertices().map(|v| placement.position(forest.point(v))).collect();
    for element in elements_of(&forest, &placement, &embedding) {
        solid.tets.push(element.vertices);
        solid.elasticity.push(element.elasticity);
    }
    let load = weights(problem, &forest, &placement, &embedding);
    let load: Vec<_> = load.chunks_exact(3).map(Vector3::from_column_slice).collect();
    let mut statics = Statics::new(&solid, |x| (problem.is_held)(x))?;
    let mut equilibrium = equilibrium_by_name("fallback")?;
    let tolerance = Tolerance::new(residual, 500);
    let found = statics.solve(&ElementCorotation, equilibrium.as_mut(), &load, &tolerance, &|| ());
    if !found.converged {
        let (case, method) = ("resolution", found.method);
        return Err(BenchError::NotConverged {
            case,
            method,
            reached: found.residual,
            limit: residual,
        });
    }
    Ok(forest.vertices().map(|v| (forest.point(v), statics.displacement(v.index()))).collect())
}

/// The uniform mesh of a level.
fn meshed(problem: &Problem, level: u8) -> Result<(BisectionForest, Placement)> {
    let grid = problem.tree.grid();
    let finest = grid.embed_level();
    let domain = Domain::of_labels(Lattice::new(grid.cells, finest), &problem.tree);
    let forest = BisectionForest::new(domain, Arc::clone(&problem.tree), level, finest)?;
    Ok((forest, Placement { origin: problem.origin, unit: problem.voxel_m }))
}

fn embedded(problem: &Problem) -> Result<Embedding> {
    let (tree, materials) = (Arc::clone(&problem.tree), problem.materials.clone());
    Ok(Embedding::new(tree, materials, by_name("laminate")?)?)
}

/// A quarter of each tetrahedron's weight at each of its corners, three numbers by vertex number, N.
fn weights(
    problem: &Problem,
    forest: &BisectionForest,
    placement: &Placement,
    embedding: &Embedding,
) -> Vec<f64> {
    let mut load = vec![0.0; 3 * forest.vertex_capacity()];
    for (leaf, element) in forest.leaves().zip(elements_of(forest, placement, embedding)) {
        let mass = embedding.density(leaf.node) * element.geometry.volume;
        for v in element.vertices {
            (0..3).for_each(|i| load[3 * v + i] += 0.25 * mass * problem.gravity[i]);
        }
    }
    load
}

/// The linear body on the uniform mesh of a level.
pub(super) struct Uniform {
    /// Its vertices, by voxel corner, with their displacements, m.
    pub displacements: Vec<(Point, Vector3<f64>)>,
    /// Work of the load, J.
    pub work_j: f64,
}

impl Uniform {
    /// Solves for it by a factor of its own; at the finest level that is what PETSc solves.
    /// # Errors
    /// [`BenchError::NotFactored`] if the body is not held.
    pub fn solve(problem: &Problem, level: u8) -> Result<Self> {
        let (forest, placement) = meshed(problem, level)?;
        let embedding = embedded(problem)?;
        let rest = |v: VertexId| placement.position(forest.point(v));
        let is_fixed = |v: VertexId| (problem.is_held)(&rest(v));
        let order_key = |v: VertexId| Lattice::key(forest.point(v));
        let assembly = Assembly::new(&P1, &is_fixed, &order_key);
        let slots = assembly.slots(forest.vertices());
        let k = assembly.assemble(elements_of(&forest, &placement, &embedding), &slots)?;
        let factor = SparseCholesky::new(&lower_half(&k), Some(&elimination_order(&k)), 3);
        let factor = factor.ok_or(BenchError::NotFactored("sparse_refactor_nd", k.dofs()))?;
        let load = slots.gather(3, &weights(problem, &forest, &placement, &embedding));
        let mut u = Mat::from_fn(load.len(), 1, |row, _| load[row]);
        factor.solve_in_place(&mut u);
        let work_j = load.iter().zip(u.col_as_slice(0)).map(|(f, u)| f * u).sum();
        let mut by_vertex = vec![0.0; 3 * forest.vertex_capacity()];
        slots.scatter(3, u.col_as_slice(0), &mut by_vertex);
        let of = |v: VertexId| Vector3::from_column_slice(&by_vertex[3 * v.index()..][..3]);
        let displacements = forest.vertices().map(|v| (forest.point(v), of(v))).collect();
        Ok(Self { displacements, work_j })
    }
}
