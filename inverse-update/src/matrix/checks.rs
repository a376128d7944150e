//! Checks on entry: shapes, slots, symmetry, and that every number is finite.

use faer::MatRef;

use crate::InverseError;

/// Largest difference between mirrored entries, relative to the diagonal.
pub const SYMMETRY_LIMIT: f64 = 1e-9;

/// max |x_ij − y_ij| / √(s_i t_j); infinite where a zero scale meets a difference.
pub(crate) fn scaled_difference(
    x: MatRef<'_, f64>,
    y: MatRef<'_, f64>,
    row_scale: &[f64],
    col_scale: &[f64],
) -> f64 {
    let mut worst: f64 = 0.0;
    let roots: Vec<f64> = row_scale.iter().map(|scale| scale.sqrt()).collect();
    for (j, col_scale) in col_scale.iter().enumerate().take(x.ncols()) {
        let root = col_scale.sqrt();
        for (i, row_root) in roots.iter().enumerate().take(x.nrows()) {
            let difference = (x[(i, j)] - y[(i, j)]).abs();
            if difference == 0.0 {
                continue;
            }
            let relative = difference / (row_root * root);
            // `f64::max` would swallow the NaN of an overflow or a negative scale.
            worst = if relative.is_nan() { f64::INFINITY } else { worst.max(relative) };
        }
    }
    worst
}

pub(crate) fn check_range(slots: &[usize], vertices: usize) -> Result<(), InverseError> {
    match slots.iter().find(|&&slot| slot >= vertices) {
        Some(&slot) => Err(InverseError::Slot { slot, limit: vertices }),
        None => Ok(()),
    }
}

/// All in range, none twice.
pub(crate) fn check_slots(slots: &[usize], vertices: usize) -> Result<(), InverseError> {
    check_range(slots, vertices)?;
    for (i, &slot) in slots.iter().enumerate() {
        if slots[..i].contains(&slot) {
            return Err(InverseError::DuplicateSlot(slot));
        }
    }
    Ok(())
}

pub(crate) fn check_matrix(
    what: &'static str,
    matrix: MatRef<'_, f64>,
    want: (usize, usize),
) -> Result<(), InverseError> {
    let got = (matrix.nrows(), matrix.ncols());
    if got != want {
        return Err(InverseError::Shape { what, want, got });
    }
    for col in 0..got.1 {
        for row in 0..got.0 {
            let value = matrix[(row, col)];
            if !value.is_finite() {
                return Err(InverseError::NotFinite { what, row, col, value });
            }
        }
    }
    Ok(())
}

pub(crate) fn check_length(
    what: &'static str,
    vector: &[f64],
    want: usize,
) -> Result<(), InverseError> {
    if vector.len() == want {
        return Ok(());
    }
    Err(InverseError::Shape { what, want: (want, 1), got: (vector.len(), 1) })
}

pub(crate) fn check_vector(
    what: &'static str,
    vector: &[f64],
    want: usize,
) -> Result<(), InverseError> {
    check_matrix(what, MatRef::from_column_major_slice(vector, vector.len(), 1), (want, 1))
}

pub(crate) fn check_symmetry(
    what: &'static str,
    matrix: MatRef<'_, f64>,
) -> Result<(), InverseError> {
    for col in 0..matrix.ncols() {
        for row in 0..col {
            let gap = (matrix[(row, col)] - matrix[(col, row)]).abs();
            let scale = matrix[(row, row)].abs().sqrt() * matrix[(col, col)].abs().sqrt();
            if gap > SYMMETRY_LIMIT * scale {
                let difference = gap / scale;
                let limit = SYMMETRY_LIMIT;
                return Err(InverseError::Asymmetric { what, row, col, difference, limit });
            }
        }
    }
    Ok(())
}
