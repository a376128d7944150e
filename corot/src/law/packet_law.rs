//! Laws that answer for eight elements at once.

/// A number of each of eight elements.
pub type Lanes = [f64; 8];

/// Eight elements in their co-rotated frames, as such a law sees them. Voigt order xx yy zz xy yz zx, engineering
/// shear. Lanes that stand for no element repeat one that does.
#[derive(Clone, Copy, Debug)]
pub struct PointPacket<'a> {
    /// ε = sym(RᵀF) − I, with pressures too.
    pub strain: &'a [Lanes; 6],
    /// What linear elasticity has without them, Pa: D ε, or D'ε = D ε − κ m mᵀε, m = (1,1,1,0,0,0).
    pub elastic: &'a [Lanes; 6],
    /// What the law derived from D, [`ConstitutiveLaw::moduli_len`](crate::ConstitutiveLaw::moduli_len) numbers.
    pub moduli: &'a [Lanes],
    /// μ q̄ of elements with pressures, Pa.
    pub pressure: Option<&'a Lanes>,
}

/// A [`ConstitutiveLaw`](crate::ConstitutiveLaw) without states whose stress the vector kernels take for eight elements
/// at once.
pub trait PacketLaw: Send + Sync {
    /// σ, Pa, as [`stress`](crate::ConstitutiveLaw::stress) has it, and the growth of
    /// [`growth`](crate::ConstitutiveLaw::growth), tr ε without that.
    ///
    /// Loops over lanes become vector code only inside of a function that is compiled for the machine's vector unit:
    /// a [`pulp::WithSimd`] for `pulp::Arch::new().dispatch(...)`, since a closure may be compiled outside of it.
    fn stress(&self, points: &PointPacket<'_>, stress: &mut [Lanes; 6], growth: &mut Lanes);
}
