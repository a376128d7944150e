//! Vector kernels: eight elements, or eight vertices, at a time.
//!
//! `simd.rs` is the arithmetic on several numbers side by side, `packets.rs` how elements lie in
//! memory, `polar.rs` the rotation of eight gradients, `element.rs` forces and rotated stiffness,
//! `vertex.rs` rotations of vertices, `accumulators.rs` what a run of elements adds up, `jacobi.rs` eigenvalues. Open
//! `element.rs` first. The scalar code they are tested against is [`ElementReference`](crate::ElementReference).

pub(crate) mod accumulators;
pub(crate) mod element;
pub(crate) mod jacobi;
pub(crate) mod packets;
pub(crate) mod polar;
pub(crate) mod simd;
pub(crate) mod vertex;
