//! The bisection forest by itself.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use yawara_mesh::{CellGrid, Domain, LabelTree, Lattice, MeshDelta, Placement, TetId, VertexId};

use crate::arrays::{rows, vector};
use crate::error::refused;
use crate::volume::label_volume;

/// A conforming tetrahedral mesh that refines and merges.
#[pyclass]
pub struct BisectionForest {
    forest: yawara_mesh::BisectionForest,
    placement: Placement,
    axes: yawara_mesh::volume::Grid,
    values: Vec<i64>,
}

#[pymethods]
impl BisectionForest {
    /// Around the labels that are not 0, in cells of so many voxels; see `Simulation` for `labels` and `affine`.
    #[new]
    #[pyo3(signature = (labels, affine, *, voxels_per_cell=8, start_level=0, max_level=12))]
    fn new(
        labels: &Bound<'_, PyAny>,
        affine: &Bound<'_, PyAny>,
        voxels_per_cell: usize,
        start_level: u8,
        max_level: u8,
    ) -> PyResult<Self> {
        if !voxels_per_cell.is_power_of_two() {
            return Err(refused(format!(
                "voxels_per_cell is {voxels_per_cell}, want a power of 2"
            )));
        }
        let volume = label_volume(labels, affine)?;
        let grid = CellGrid::around(&volume, voxels_per_cell).map_err(refused)?;
        let lattice = Lattice::new(grid.cells, max_level);
        let placement = grid.placement(volume.grid().spacing_mm * 1e-3, &lattice);
        let tree = LabelTree::new(&volume, grid).map_err(refused)?;
        let domain = Domain::of_labels(lattice, &tree);
        let forest =
            yawara_mesh::BisectionForest::new(domain, Arc::new(tree), start_level, max_level);
        let (axes, values) = (volume.grid().clone(), volume.values().to_vec());
        Ok(Self { forest: forest.map_err(refused)?, placement, axes, values })
    }

    /// Active vertices.
    #[getter]
    fn vertex_count(&self) -> usize {
        self.forest.vertex_count()
    }

    /// Leaf tetrahedra.
    #[getter]
    fn tetrahedron_count(&self) -> usize {
        self.forest.leaf_count()
    }

    /// Positions of the vertices, n × 3, m.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let of = |v: VertexId| {
            let x = self.placement.position(self.forest.point(v));
            (self.axes.origin_mm * 1e-3 + self.axes.rotation * x).into()
        };
        rows(py, &self.forest.vertices().map(of).collect::<Vec<[f64; 3]>>())
    }

    /// The vertices of each tetrahedron, m × 4, in the order of bisection.
    #[getter]
    fn tetrahedra<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<u32>> {
        let mut number = vec![0; self.forest.vertex_capacity()];
        for (at, v) in self.forest.vertices().enumerate() {
            number[v.index()] = at as u32;
        }
        let leaves = self.forest.leaves().map(|tet| tet.vertices.map(|v| number[v.index()]));
        rows(py, &leaves.collect::<Vec<_>>())
    }

    /// How often each tetrahedron's root was bisected.
    #[getter]
    fn levels<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u8>> {
        vector(py, self.forest.leaves().map(|tet| tet.level).collect())
    }

    /// The label of most of each tetrahedron.
    #[getter]
    fn labels<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        let tree = self.forest.tree();
        let label = |node| self.values[usize::from(tree.majority(node))];
        vector(py, self.forest.leaves().map(|tet| label(tet.node)).collect())
    }

    /// Whether each tetrahedron has more than one label in it.
    #[getter]
    fn is_mixed<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        let tree = self.forest.tree();
        vector(
            py,
            self.forest.leaves().map(|tet| tree.labels(tet.node).as_slice().len() > 1).collect(),
        )
    }

    /// Bisects tetrahedra, and before them those that have to be for the mesh to fit together; returns how many vertices
    /// came in. What is as fine as `max_level` stays.
    fn split(&mut self, tetrahedra: Vec<usize>) -> PyResult<usize> {
        let leaves: Vec<TetId> = self.forest.leaves().map(|tet| tet.id).collect();
        check(&tetrahedra, leaves.len(), "tetrahedra")?;
        let points: Vec<_> =
            tetrahedra.iter().filter_map(|&at| self.forest.refinement_point(leaves[at])).collect();
        let (before, mut delta) = (self.forest.vertex_count(), MeshDelta::empty());
        for point in points {
            // It may have come in with another.
            if self.forest.vertex_at(point).is_none() {
                self.forest.split_with_closure(point, &mut delta, |_, _| ()).map_err(refused)?;
            }
        }
        Ok(self.forest.vertex_count() - before)
    }

    /// Takes out those of these vertices that can go; returns how many went.
    fn merge(&mut self, vertices: Vec<usize>) -> PyResult<usize> {
        let all: Vec<VertexId> = self.forest.vertices().collect();
        check(&vertices, all.len(), "vertices")?;
        let (before, mut delta) = (all.len(), MeshDelta::empty());
        for at in vertices {
            if self.forest.is_mergeable(all[at]) {
                self.forest.merge(all[at], &mut delta).map_err(refused)?;
            }
        }
        Ok(before - self.forest.vertex_count())
    }

    /// Splits until every tetrahedron has at least this level.
    fn refine_uniformly(&mut self, level: u8) -> PyResult<()> {
        self.forest.refine_uniformly(level).map_err(refused)
    }
}

/// Refuses numbers that nothing has.
fn check(numbers: &[usize], count: usize, what: &str) -> PyResult<()> {
    match numbers.iter().find(|number| **number >= count) {
        Some(number) => Err(refused(format!("{what}: {number} is none of 0..{count}"))),
        None => Ok(()),
    }
}
