//! Which values of a scene's motion and budget are in range.

use super::check::Check;
use crate::SimError;
use crate::scene::Scene;

/// Velocities above it (m/s, rad/s) are mistakes.
const FASTEST: f64 = 1e6;

impl Check<'_> {
    pub fn dynamics(&self, scene: &Scene) -> Result<(), SimError> {
        if let Some(step_ms) = scene.budget.step_ms {
            self.positive("budget.step_ms", step_ms)?;
        }
        let Some(dynamics) = &scene.dynamics else {
            let (key, name) = ("stages.integrator", &scene.stages.integrator);
            return self.that(name != "implicit_euler", key, name, "[dynamics] in the scene");
        };
        let undamped = !(scene.stages.law == "linear" && dynamics.damping_stiffness_s > 0.0);
        let want = "rayleigh or auto beside dynamics.damping_stiffness_s > 0";
        self.that(undamped, "stages.law", &scene.stages.law, want)?;
        for (key, value) in [
            ("dynamics.damping_mass_per_s", dynamics.damping_mass_per_s),
            ("dynamics.damping_stiffness_s", dynamics.damping_stiffness_s),
        ] {
            let in_range = (0.0..=1e12).contains(&value);
            self.that(in_range, key, value, "0 to 1e12")?;
        }
        for (key, vector) in [
            ("dynamics.velocity_m_s", &dynamics.velocity_m_s),
            ("dynamics.spin_rad_s", &dynamics.spin_rad_s),
        ] {
            self.vector(key, vector)?;
            let slow = vector.iter().all(|v| v.abs() <= FASTEST);
            self.that(slow, key, vector, "at most 1e6 in each axis")?;
        }
        for (i, material) in scene.materials.iter().enumerate() {
            let (key, density) = (format!("materials[{i}].density_kg_m3"), material.density_kg_m3);
            self.that(density > 0.0, &key, density, "more than 0: a dynamic body has mass")?;
        }
        Ok(())
    }
}
