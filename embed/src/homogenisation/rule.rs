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
