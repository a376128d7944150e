//! The small algebra of an update, from the ring's submatrix of C alone.

use faer::{Mat, MatRef};

use crate::InverseError;
use crate::change::NetChange;
use crate::dense::precision::Precision;
use crate::dense::signed_root::SignedRoot;

/// An update's Y = C_:r W and its signs Σ, and what is known of it on the ring's rows.
pub(super) struct Terms {
    /// W, r × k.
    pub w: Mat<f64>,
    /// Σ, so that C becomes C + Y Σ Yᵀ.
    pub signs: Vec<f64>,
    /// Y_r, r × k.
    pub at_ring: Mat<f64>,
    /// Whether it makes C so much softer that the terms of what is lost are to be refined by K.
    pub is_softening: bool,
}

impl Terms {
    /// From C_rr, where C is stored as `E`.
    /// # Errors
    /// [`InverseError::Singular`].
    pub(super) fn new<E: Precision>(
        change: &NetChange,
        c_rr: &Mat<f64>,
        negative: usize,
    ) -> Result<Self, InverseError> {
        let own = c_rr * &change.u;
        let root = SignedRoot::new::<E>(change, own.as_ref(), negative)?;
        Ok(Self {
            w: &change.u * &root.root,
            signs: root.signs.iter().map(|sign| -sign).collect(),
            at_ring: own * &root.root,
            is_softening: root.softening <= E::SOFTENING,
        })
    }

    /// Σ Yᵀ X for rows of X that Y has, or Σ Wᵀ X.
    pub(super) fn signed(&self, factor: &Mat<f64>, x: MatRef<'_, f64>) -> Mat<f64> {
        let mut inner = factor.transpose() * x;
        for (k, sign) in self.signs.iter().enumerate() {
            inner.row_mut(k).iter_mut().for_each(|value| *value *= sign);
        }
        inner
    }
}
