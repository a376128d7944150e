//! What an indicator is, and the ring of tetrahedra that it measures.

use nalgebra::{Matrix3, Vector3};
use yawara_embed::{ChildPair, LinearTet, ParentMaterial, Strain, strain_from_gradient};

use super::sight::{Measured, Sight};

/// A tetrahedron of a ring in its current state.
#[derive(Clone, Copy, Debug)]
pub struct RingMember {
    /// Rest geometry.
    pub geometry: LinearTet,
    /// Its halves' materials and the midpoint's gradients.
    pub halves: ChildPair,
    /// What the homogenisation makes of them.
    pub parent: ParentMaterial,
    /// Deformation gradient.
    pub deformation_gradient: Matrix3<f64>,
    /// Rotation nearest to it.
    pub rotation: Matrix3<f64>,
    /// The bisected edge at rest, X_b − X_a, m.
    pub edge: Vector3<f64>,
    /// Rotations of the vertices at its ends a and b.
    pub end_rotations: [Matrix3<f64>; 2],
    /// The dilation that its pressure stands for, μ q̄/κ; none without pressures.
    pub pressed_dilation: Option<f64>,
    /// True where it holds void only.
    pub is_void: bool,
}

impl RingMember {
    /// Strain of the co-rotated displacement; where there are pressures, with their dilation for
    /// its own, which is no part of their stress and near incompressibility is all noise.
    pub fn strain(&self) -> Strain {
        let local = self.rotation.transpose() * self.deformation_gradient;
        let mut strain = strain_from_gradient(&(local - Matrix3::identity()));
        if let Some(dilation) = self.pressed_dilation {
            let off = (dilation - strain.fixed_rows::<3>(0).sum()) / 3.0;
            strain.fixed_rows_mut::<3>(0).add_scalar_mut(off);
        }
        strain
    }

    /// Where the homogenisation puts the midpoint, off the middle of its edge: R X ε, m.
    pub fn midpoint_offset(&self) -> Vector3<f64> {
        self.rotation * (self.parent.midpoint * self.strain())
    }
}

/// Measures how much a ring asks for its midpoint.
///
/// # Example
/// Refines where the largest principal strain of any tetrahedron is large:
///
/// ```
/// use yawara::indicator::{Indicator, RingMember};
/// use yawara::{Simulation, Stages, scene_file};
///
/// struct LargestStrain;
///
/// impl Indicator for LargestStrain {
///     fn name(&self) -> &'static str {
///         "largest_strain"
///     }
///
///     fn unit(&self) -> &'static str {
///         "1"
///     }
///
///     fn measure(&self, ring: &[RingMember]) -> f64 {
///         let solid = ring.iter().filter(|member| !member.is_void);
///         solid.map(|member| member.strain().amax()).fold(0.0, f64::max)
///     }
/// }
///
/// # fn main() -> Result<(), yawara::SimError> {
/// let (mut scene, _) = scene_file::load("beam", &["mesh.max_level=3".into()])?;
/// scene.refinement.split_above = Some(0.02);
/// let mut stages = Stages::by_name(&scene.stages)?;
/// stages.indicator = Box::new(LargestStrain);
/// let mut simulation = Simulation::new(&scene, stages)?;
/// assert!(simulation.step()?.converged);
/// # Ok(())
/// # }
/// ```
pub trait Indicator: Send {
    /// The scene name.
    fn name(&self) -> &'static str;

    /// The unit of its values.
    fn unit(&self) -> &'static str;

    /// The indicator of a complete ring; compared with `refinement.split_above`.
    fn measure(&self, ring: &[RingMember]) -> f64;

    /// What a vertex is worth that came into `ring` and may go out of it again; compared with
    /// `refinement.merge_fraction` of the above. `surplus` is how far it is from where the homogenisation
    /// would have it without loads on it, m.
    fn measure_vertex(&self, ring: &[RingMember], _surplus: &Vector3<f64>) -> f64 {
        self.measure(ring)
    }

    /// The indicators of all elements, for one that looks at more than rings. A vertex then counts for the
    /// sum over the elements that it would bisect, and may ask for others that have to come in before it;
    /// what may go out is still asked of [`measure`](Self::measure).
    fn elements(&self, _sight: &Sight<'_>) -> Option<Measured> {
        None
    }

    /// How much more energy the body has than on a mesh without end (how far the goal is from that there, if
    /// [`is_of_goal`](Self::is_of_goal)), over the sum of all indicators; none if they are no parts of an
    /// error. `refinement.target` needs it.
    fn error_over_sum(&self) -> Option<f64> {
        None
    }

    /// Whether what it says may be another while the body stands as it stood. One that says it does not is not asked
    /// again until something moves.
    fn remembers(&self) -> bool {
        true
    }

    /// Whether [`elements`](Self::elements) says the errors of energy and of figures. Duals are made for one
    /// that does.
    fn estimates(&self) -> bool {
        false
    }

    /// Whether it measures the first of [`Sight::duals`], the scene's goal, in place of energy. A vertex
    /// then goes out by the sum over the elements that it made.
    fn is_of_goal(&self) -> bool {
        false
    }
}
