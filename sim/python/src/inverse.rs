//! The inverse of a symmetric matrix, kept while the matrix changes.

use std::sync::{Mutex, PoisonError};

use faer::Mat;
use numpy::{PyArray1, PyArray2, PyArray3, PyReadonlyArray1};
use pyo3::prelude::*;
use yawara_inverse_update::{
    InverseError, InverseMaintainer, RingChange, SparseStiffness, StiffnessChange, build,
};

use crate::arrays::{matrices, matrix, to_matrix, to_vec, vector};
use crate::error::refused;

/// Blocks, their columns and where rows begin.
pub type Blocks<'py> =
    (Bound<'py, PyArray3<f64>>, Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<i64>>);

/// K⁻¹ of a symmetric sparse K with square blocks, kept by a maintainer of that name.
#[pyclass(frozen)]
pub struct Inverse(Mutex<Box<dyn InverseMaintainer>>);

#[pymethods]
impl Inverse {
    /// From K in coordinates: entry (rows[k], columns[k]) is values[k]; both triangles are given. K has `size` blocks of
    /// `block` rows, the last `negative` of which have negative pivots. `places`, one per block, are lattice points (three
    /// integers below 2²¹ each, all different) along which the blocks are eliminated.
    #[new]
    #[pyo3(signature = (size, rows, columns, values, *, block=1, negative=0, places=None, method="sparse"))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        size: usize,
        rows: PyReadonlyArray1<'_, i64>,
        columns: PyReadonlyArray1<'_, i64>,
        values: PyReadonlyArray1<'_, f64>,
        block: usize,
        negative: usize,
        places: Option<Vec<[u32; 3]>>,
        method: &str,
    ) -> PyResult<Self> {
        let (rows, columns, values) = (rows.as_array(), columns.as_array(), values.as_array());
        if rows.len() != values.len() || columns.len() != values.len() {
            return Err(refused("rows, columns and values differ in length"));
        }
        let entries: Vec<([usize; 2], f64)> = rows
            .iter()
            .zip(&columns)
            .zip(&values)
            .map(|((&i, &j), &value)| ([i as usize, j as usize], value))
            .collect();
        let made = py.detach(|| {
            let mut k = assemble(size, block, negative, &entries)?;
            if let Some(places) = places {
                let key = |[x, y, z]: [u32; 3]| {
                    let [x, y, z] = [x, y, z].map(|at| u64::from(at & 0x1f_ffff));
                    x | y << 21 | z << 42
                };
                k.set_order_keys(&places.into_iter().map(key).collect::<Vec<_>>())?;
            }
            build(method, k)
        });
        Ok(Self(Mutex::new(made.map_err(refused)?)))
    }

    /// The name of the method.
    #[getter]
    fn method(&self, py: Python<'_>) -> PyResult<&'static str> {
        self.with(py, |inverse| Ok(inverse.name()))
    }

    /// Blocks that K has now.
    #[getter]
    fn size(&self, py: Python<'_>) -> PyResult<usize> {
        self.with(py, |inverse| Ok(inverse.vertices()))
    }

    /// Rows of a block.
    #[getter]
    fn block(&self, py: Python<'_>) -> PyResult<usize> {
        self.with(py, |inverse| Ok(inverse.stiffness().block()))
    }

    /// K as (data, indices, indptr) of a block row matrix of SciPy.
    fn matrix<'py>(&self, py: Python<'py>) -> PyResult<Blocks<'py>> {
        blocks(py, &self.with(py, |inverse| Ok(inverse.stiffness().clone()))?)
    }

    /// K⁻¹ f.
    fn solve<'py>(
        &self,
        py: Python<'py>,
        f: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let f = to_vec("f", f, None)?;
        let u = self.with(py, |inverse| {
            let mut u = vec![0.0; inverse.stiffness().dofs()];
            inverse.solve(&f, &mut u).map(|()| u)
        })?;
        Ok(vector(py, u))
    }

    /// K⁻¹ F, by columns.
    fn solve_many<'py>(
        &self,
        py: Python<'py>,
        loads: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let loads = to_mat(loads)?;
        let u = self.with(py, |inverse| inverse.solve_many(loads.as_ref()))?;
        Ok(matrix(py, (u.nrows(), u.ncols()), |i, j| u[(i, j)]))
    }

    /// The columns of K⁻¹ that belong to these blocks.
    fn columns<'py>(
        &self,
        py: Python<'py>,
        blocks: Vec<usize>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let c = self.with(py, |inverse| inverse.columns(&blocks))?;
        Ok(matrix(py, (c.nrows(), c.ncols()), |i, j| c[(i, j)]))
    }

    /// K ← K + S (A Aᵀ − R Rᵀ) Sᵀ on the rows of `blocks`.
    fn update(
        &self,
        py: Python<'_>,
        blocks: Vec<usize>,
        added: &Bound<'_, PyAny>,
        removed: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let (added, removed) = (to_mat(added)?, to_mat(removed)?);
        let change = StiffnessChange { slots: blocks, added, removed };
        self.with(py, |inverse| inverse.change(&change))
    }

    /// K ← [K, a; aᵀ, A] with `coupling` on the rows of `blocks` and `diagonal`; returns the number of the new block, the
    /// last.
    fn append(
        &self,
        py: Python<'_>,
        blocks: Vec<usize>,
        coupling: &Bound<'_, PyAny>,
        diagonal: &Bound<'_, PyAny>,
    ) -> PyResult<usize> {
        let (coupling, diagonal) = (to_mat(coupling)?, to_mat(diagonal)?);
        self.with(py, |inverse| inverse.split(&RingChange::freed(blocks, coupling, diagonal, 0)?))
    }

    /// Takes the rows and columns of a block out; returns the number of the block that now has its number, the last before, if
    /// there is one.
    fn remove(&self, py: Python<'_>, block: usize) -> PyResult<Option<usize>> {
        self.with(py, |inverse| inverse.fix(block))
    }

    /// Inverts K afresh.
    fn rebuild(&self, py: Python<'_>) -> PyResult<()> {
        self.with(py, |inverse| inverse.rebuild())
    }

    /// By how much K K⁻¹ f misses f, for random f; inverts K afresh where that is too much.
    fn watch(&self, py: Python<'_>, seed: u64) -> PyResult<f64> {
        self.with(py, |inverse| inverse.watch(seed))
    }
}

impl Inverse {
    /// Works on the inverse while other threads of Python run.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut dyn InverseMaintainer) -> Result<T, InverseError> + Send,
    ) -> PyResult<T> {
        let done = py.detach(|| {
            let mut inverse = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            work(inverse.as_mut())
        });
        done.map_err(refused)
    }
}

/// K of its entries, block by block.
fn assemble(
    size: usize,
    block: usize,
    negative: usize,
    entries: &[([usize; 2], f64)],
) -> Result<SparseStiffness, InverseError> {
    let mut k = SparseStiffness::quasi_definite(size, block, negative)?;
    let beyond = entries.iter().flat_map(|(at, _)| at).find(|at| **at >= size * block);
    if let Some(&row) = beyond {
        return Err(InverseError::Slot { slot: row / block, limit: size });
    }
    // By pairs of blocks, each with its mirror image.
    let pair = |[i, j]: [usize; 2]| [(i / block).min(j / block), (i / block).max(j / block)];
    let mut sorted: Vec<_> = entries.iter().map(|&(at, value)| (pair(at), at, value)).collect();
    sorted.sort_by_key(|(pair, at, _)| (*pair, *at));
    for group in sorted.chunk_by(|a, b| a.0 == b.0) {
        let [a, b] = group[0].0;
        let slots = if a == b { vec![a] } else { vec![a, b] };
        let mut dense = Mat::zeros(block * slots.len(), block * slots.len());
        let local = |row: usize| (row / block != a) as usize * block + row % block;
        for &(_, [i, j], value) in group {
            dense[(local(i), local(j))] += value;
        }
        k.add(&slots, dense.as_ref())?;
    }
    Ok(k)
}

/// Blocks of a matrix, their columns and where rows begin.
pub fn blocks<'py>(py: Python<'py>, k: &SparseStiffness) -> PyResult<Blocks<'py>> {
    let m = k.block();
    let (mut found, mut columns, mut starts) = (Vec::new(), Vec::new(), vec![0i64]);
    for i in 0..k.vertices() {
        let mut neighbours = k.neighbours(i).to_vec();
        neighbours.push(i);
        neighbours.sort_unstable();
        neighbours.dedup();
        for j in neighbours {
            if let Some(block) = k.block_at(i, j) {
                found.push(block);
                columns.push(j as i64);
            }
        }
        starts.push(columns.len() as i64);
    }
    let data = matrices(py, (found.len(), m, m), |at, i, j| found[at][m * i + j]);
    Ok((data, vector(py, columns), vector(py, starts)))
}

/// A matrix of faer.
fn to_mat(array: &Bound<'_, PyAny>) -> PyResult<Mat<f64>> {
    let (entries, [rows, columns]) = to_matrix(array)?;
    Ok(Mat::from_fn(rows, columns, |i, j| entries[columns * i + j]))
}
