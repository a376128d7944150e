//! The swappable stages of a simulation, by name or by hand.

use yawara_corot::{Equilibrium, InternalForces, equilibrium_by_name, forces_by_name};
use yawara_embed::Homogenisation;
use yawara_inverse_update::{SparseStiffness, choose};

use crate::error::SimError;
use crate::inverse::InverseFactory;
use crate::scene::{AUTO, ON_DEVICE, StageNames};
use crate::step::indicator::{self, Indicator};

/// One implementation of each stage. Replace any field with your own before
/// [`Simulation::new`](crate::Simulation::new).
pub struct Stages {
    /// How fine material acts in coarse tetrahedra.
    pub homogenisation: Box<dyn Homogenisation>,
    /// How forces follow from positions.
    pub corotation: Box<dyn InternalForces>,
    /// How equilibrium is found.
    pub equilibrium: Box<dyn Equilibrium>,
    /// What asks for refinement.
    pub indicator: Box<dyn Indicator>,
    /// Makes the maintainer of the inverse.
    pub inverse: InverseFactory,
}

impl Stages {
    /// The built-in implementations of these names.
    ///
    /// # Errors
    /// The stage's own error, listing its choices. An unknown inverse is refused when the
    /// simulation is made. [`SimError::FeatureMissing`] for an inverse on a device that this
    /// program was built without; `SimError::Gpu` if there is no device, `SimError::Adapter` if not
    /// exactly one is the one that the scene names: nothing takes its place.
    pub fn by_name(names: &StageNames) -> Result<Self, SimError> {
        if ON_DEVICE.contains(&&names.inverse[..]) {
            return Ok(Self { inverse: on_device(names)?, ..Self::on_host(names)? });
        }
        Self::on_host(names)
    }

    /// With the inverse in the host's memory.
    fn on_host(names: &StageNames) -> Result<Self, SimError> {
        let inverse = names.inverse.clone();
        // A scene's tools read compliance blocks, no full columns, where columns are not at hand.
        let name = move |k: &SparseStiffness| match &inverse[..] {
            AUTO => choose(k.vertices(), 0).to_owned(),
            name => name.to_owned(),
        };
        let corotation = forces_by_name(&names.corotation)?;
        let equilibrium = equilibrium_by_name(&names.equilibrium)?;
        yawara_corot::check_pair(corotation.as_ref(), equilibrium.as_ref())?;
        Ok(Self {
            homogenisation: yawara_embed::by_name(&names.homogenisation)?,
            corotation,
            equilibrium,
            indicator: indicator::by_name(&names.indicator)?,
            inverse: Box::new(move |k| yawara_inverse_update::build(&name(&k), k)),
        })
    }
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
    let what = format!("stages.inverse = {:?}", names.inverse);
    Err(SimError::FeatureMissing { what, feature: "gpu" })
}
