//! The stage that homogenises, and its part that looks at the whole body.

use std::ops::ControlFlow;

use super::halves::{ChildPair, ParentMaterial};
use crate::error::EmbedError;
use crate::fine::FineBody;
use crate::material::Packed6;

/// Homogenises two halves into their parent.
///
/// Must be scale-free (D_p does not change when the tetrahedron is scaled) and give X = 0 and
/// D_p = D for two equal halves if a homogeneous body is to stay exact.
///
/// A rule of one's own, the harmonic mean:
/// ```
/// use nalgebra::Vector3;
/// use yawara_embed::{ChildPair, Excess, Homogenisation, LinearTet, ParentMaterial, isotropic};
///
/// /// D_p = 2 (D₁⁻¹ + D₂⁻¹)⁻¹, the Reuss bound: as soft as both halves in series.
/// struct Harmonic;
///
/// impl Homogenisation for Harmonic {
///     fn name(&self) -> &str {
///         "harmonic"
///     }
///     fn combine(&self, pair: &ChildPair) -> ParentMaterial {
///         let [first, second] = pair.elasticity.map(|d| d.try_inverse().expect("definite"));
///         let mean = 0.5 * (first + second);
///         let elasticity = mean.try_inverse().expect("definite");
///         let excess = Excess::Unfactored;
///         ParentMaterial { excess, ..ParentMaterial::uniform(elasticity) }
///     }
/// }
///
/// let tet = LinearTet::new(&[Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()]);
/// let pair = ChildPair::new(&tet, 0, 1, [isotropic(1e3, 0.3), isotropic(3e3, 0.3)]);
/// let parent = Harmonic.combine(&pair).elasticity;
/// assert!((parent - isotropic(1.5e3, 0.3)).amax() < 1e-9);
/// ```
pub trait Homogenisation: Send + Sync {
    /// The scene name.
    fn name(&self) -> &str;

    /// The parent of two halves. Cost: a few hundred flops; called once per heterogeneous
    /// tetrahedron when a scene is built and once per ring tetrahedron in every split or merge.
    fn combine(&self, pair: &ChildPair) -> ParentMaterial;

    /// What a user of the rule ought to know about its results, for the plan.
    fn warning(&self) -> Option<&str> {
        None
    }

    /// The part of the rule that looks at more than two halves; none for a local rule.
    fn global(&self) -> Option<&dyn GlobalHomogenisation> {
        None
    }
}

/// A rule for D_p that needs the fine mesh of the whole body. X, and D_p where it gives none, come
/// from [`Homogenisation::combine`] applied level by level on its own.
pub trait GlobalHomogenisation: Send + Sync {
    /// D_p of every node of the body's tree, by its number; `None` where the local rule is to be
    /// used, and for finest tetrahedra. Called once, when a scene is built; `progress` is told the
    /// fraction done and may stop the work.
    ///
    /// # Errors
    /// [`EmbedError`] if the fine problem can't be solved; [`EmbedError::Stopped`].
    fn homogenise(
        &self,
        body: &FineBody<'_>,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Vec<Option<Packed6>>, EmbedError>;
}
