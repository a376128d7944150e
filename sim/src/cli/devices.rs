//! `yawara devices`: the graphics adapters of this machine.

use yawara::SimError;

use super::printer::Printer;

#[cfg(feature = "gpu")]
pub fn run(out: &mut Printer) -> Result<(), SimError> {
    let adapters = yawara_gpu::adapters()?;
    adapters
        .iter()
        .enumerate()
        .try_for_each(|(index, adapter)| out.print(&format!("{index}: {adapter}\n")))
}

#[cfg(not(feature = "gpu"))]
pub fn run(_: &mut Printer) -> Result<(), SimError> {
    Err(SimError::FeatureMissing { what: "yawara devices".into(), feature: "gpu" })
}
