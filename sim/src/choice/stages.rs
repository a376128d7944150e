//! The swappable stages of a simulation, by name or by hand.

use yawara_corot::{
    ConstitutiveLaw, Equilibrium, InternalForces, TimeIntegrator, equilibrium_by_name,
    forces_by_name, integrator_by_name, law_by_name,
};
use yawara_embed::{ElementFormulation, Homogenisation};
use yawara_inverse_update::choose;

use crate::error::SimError;
use crate::inverse::InverseFactory;
use crate::scene::{AUTO, ON_DEVICE, Scene, StageNames};
use crate::step::indicator::{self, Indicator};

/// One implementation of each stage. Replace any field with your own before
/// [`Simulation::new`](crate::Simulation::new).
pub struct Stages {
    /// How fine material acts in coarse tetrahedra.
    pub homogenisation: Box<dyn Homogenisation>,
    /// The matrix of a tetrahedron; `None` for the built-in one that the scene names or its materials
    /// call for.
    ///
    /// An element of one's own has the unknowns of `p1` or `p1p1`. It makes the matrix whose inverse
    /// is kept, with all splits and merges of that. The body's forces stay those of the built-in
    /// element with these unknowns: one's own changes how fast a step converges, not to where. It is
    /// used as it is: in a scene with `[dynamics]` its
    /// [`matrix`](ElementFormulation::matrix) and [`ring`](ElementFormulation::ring) should have the
    /// mass too, as those of [`Dynamic`](yawara_embed::Dynamic) have.
    pub element: Option<Box<dyn ElementFormulation>>,
    /// How forces follow from positions.
    pub forces: Box<dyn InternalForces>,
    /// How stress follows from strain; `None` for the one that the scene's damping calls for.
    pub law: Option<Box<dyn ConstitutiveLaw>>,
    /// How a step in time is made; `None` for implicit Euler with `[dynamics]`, none without.
    pub integrator: Option<Box<dyn TimeIntegrator>>,
    /// How equilibrium is found.
    pub equilibrium: Box<dyn Equilibrium>,
    /// What asks for refinement.
    pub indicator: Box<dyn Indicator>,
    /// Makes the maintainer of the inverse.
    pub inverse: InverseFactory,
}

impl Stages {
    /// The built-in implementations of these names.
    /// # Errors
    /// The stage's own error, listing its choices. An unknown inverse is refused when the
    /// simulation is made. [`SimError::FeatureMissing`] for an inverse on a device that this
    /// program was built without; `SimError::Gpu` if there is no device, `SimError::Adapter` if not
    /// exactly one is the one that the scene names: nothing takes its place.
    pub fn by_name(names: &StageNames) -> Result<Self, SimError> {
        let forces = forces_by_name(&names.corotation)?;
        let equilibrium = equilibrium_by_name(&names.equilibrium)?;
        yawara_corot::check_pair(forces.as_ref(), equilibrium.as_ref())?;
        Ok(Self {
            homogenisation: yawara_embed::by_name(&names.homogenisation)?,
            element: None,
            forces,
            law: None,
            integrator: match &names.integrator[..] {
                AUTO => None,
                name => Some(integrator_by_name(name)?),
            },
            equilibrium,
            indicator: indicator::by_name(&names.indicator)?,
            inverse: match ON_DEVICE.contains(&&names.inverse[..]) {
                true => on_device(names)?,
                false => on_host(names.inverse.clone()),
            },
        })
    }

    /// The law: the one given, else that of a name.
    /// # Errors
    /// [`SimError::Corot`] for a name or a damping that no law has.
    pub(crate) fn take_law(
        &mut self,
        name: &str,
        scene: &Scene,
    ) -> Result<Box<dyn ConstitutiveLaw>, SimError> {
        let damping_s = scene.dynamics.as_ref().map_or(0.0, |d| d.damping_stiffness_s);
        self.law.take().map_or_else(|| Ok(law_by_name(name, damping_s)?), Ok)
    }

    /// The integrator: the one given, else implicit Euler where the scene has inertia.
    pub(crate) fn take_integrator(
        &mut self,
        scene: &Scene,
    ) -> Result<Box<dyn TimeIntegrator>, SimError> {
        let name = if scene.dynamics.is_some() { "implicit_euler" } else { "quasi_static" };
        self.integrator.take().map_or_else(|| Ok(integrator_by_name(name)?), Ok)
    }
}

fn on_host(inverse: String) -> InverseFactory {
    Box::new(move |k| {
        let name = match &inverse[..] {
            AUTO => choose(k.vertices(), k.updates_at_once()),
            name => name,
        };
        yawara_inverse_update::build(name, k)
    })
}

/// Opens the adapter that the scene names, or else the first of `yawara devices`.
#[cfg(feature = "gpu")]
fn on_device(names: &StageNames) -> Result<InverseFactory, SimError> {
    use crate::scene::Adapter;
    use yawara_gpu::{AdapterChoice, Device, DeviceOptions, GpuError};
    let adapter = names.gpu_adapter.as_ref().map(|adapter| match adapter {
        Adapter::Index(index) => AdapterChoice::Index(*index),
        Adapter::Name(name) => AdapterChoice::Name(name.clone()),
    });
    let refused = |error| match error {
        error @ (GpuError::NoSuchAdapter { .. } | GpuError::SeveralAdapters { .. }) => {
            SimError::Adapter(error)
        }
        other => SimError::Gpu(other),
    };
    let device = Device::open(DeviceOptions { adapter, ..Default::default() }).map_err(refused)?;
    let name = names.inverse.clone();
    Ok(Box::new(move |k| yawara_gpu::build(&name, k, &device)))
}

#[cfg(not(feature = "gpu"))]
fn on_device(names: &StageNames) -> Result<InverseFactory, SimError> {
    Err(SimError::FeatureMissing(format!("stages.inverse = {:?}", names.inverse), "gpu"))
}
