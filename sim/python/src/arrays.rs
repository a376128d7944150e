//! Arrays of NumPy from Rust's and back.

use nalgebra::Vector3;
use numpy::ndarray::{Array1, Array2, Array3};
use numpy::{
    AllowTypeChange, Element, IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayLike1,
    PyArrayLike2, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use yawara::ScannerAxes;

use crate::error::refused;

/// A vector.
pub fn vector<'py, T: Element>(py: Python<'py>, values: Vec<T>) -> Bound<'py, PyArray1<T>> {
    Array1::from_vec(values).into_pyarray(py)
}

/// A matrix of n rows of N.
pub fn rows<'py, T: Element, const N: usize>(
    py: Python<'py>,
    rows: &[[T; N]],
) -> Bound<'py, PyArray2<T>> {
    Array2::from_shape_fn((rows.len(), N), |(i, j)| rows[i][j].clone_ref(py)).into_pyarray(py)
}

/// A matrix, entry by entry.
pub fn matrix<'py>(
    py: Python<'py>,
    (rows, columns): (usize, usize),
    at: impl Fn(usize, usize) -> f64,
) -> Bound<'py, PyArray2<f64>> {
    Array2::from_shape_fn((rows, columns), |(i, j)| at(i, j)).into_pyarray(py)
}

/// Matrices one after the other, entry by entry.
pub fn matrices<'py>(
    py: Python<'py>,
    shape: (usize, usize, usize),
    at: impl Fn(usize, usize, usize) -> f64,
) -> Bound<'py, PyArray3<f64>> {
    Array3::from_shape_fn(shape, |(i, j, k)| at(i, j, k)).into_pyarray(py)
}

/// The numbers of a vector of `len` of them, or of whatever length.
pub fn to_vec(what: &str, array: &Bound<'_, PyAny>, len: Option<usize>) -> PyResult<Vec<f64>> {
    let array: PyArrayLike1<'_, f64, AllowTypeChange> = array.extract()?;
    let values = array.as_array().to_vec();
    match len.filter(|len| *len != values.len()) {
        None => Ok(values),
        Some(len) => Err(refused(format!("{what} has {} numbers, want {len}", values.len()))),
    }
}

/// The rows of a matrix that has `columns`, one after the other, and how many there are.
pub fn to_rows(what: &str, array: &Bound<'_, PyAny>, columns: usize) -> PyResult<Vec<f64>> {
    let (values, [rows, got]) = to_matrix(array)?;
    match got == columns {
        true => Ok(values),
        false => Err(refused(format!("{what} is {rows} x {got}, want {columns} columns"))),
    }
}

/// The entries of a matrix, row by row, and its shape.
pub fn to_matrix(array: &Bound<'_, PyAny>) -> PyResult<(Vec<f64>, [usize; 2])> {
    let array: PyArrayLike2<'_, f64, AllowTypeChange> = array.extract()?;
    let shape = [array.shape()[0], array.shape()[1]];
    Ok((array.as_array().iter().copied().collect(), shape))
}

/// N numbers.
pub fn to_array<const N: usize>(what: &str, array: &Bound<'_, PyAny>) -> PyResult<[f64; N]> {
    let values = to_vec(what, array, Some(N))?;
    Ok(values.try_into().expect("as many as asked for"))
}

/// A position in scanner axes, m.
pub fn to_scanner(axes: ScannerAxes, x: &Vector3<f64>) -> [f64; 3] {
    (axes.to_ras_mm(x) * 1e-3).into()
}

/// A position in solver axes, m.
pub fn to_solver(axes: ScannerAxes, x: [f64; 3]) -> Vector3<f64> {
    axes.to_solver(&(Vector3::from(x) * 1e3))
}
