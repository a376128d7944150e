//! Which materials fit an image, and which keys of an image fit its materials.

use super::check::Check;
use crate::SimError;
use crate::scene::{AUTO, LawEntry, MaterialEntry, MeshOptions, PowerLaw, PronyEntry, Scene};

impl Scene {
    /// True where the image holds intensities that ranges of materials turn into labels.
    pub(crate) fn reads_intensities(&self) -> bool {
        self.materials.iter().any(|material| material.range.is_some())
    }

    /// The position of the material that names `label`, else of the one for all others.
    pub(crate) fn material_of(&self, label: i64) -> Option<usize> {
        let named = self.materials.iter().position(|material| material.label == Some(label));
        named.or_else(|| self.materials.iter().position(|material| material.other))
    }
}

impl MaterialEntry {
    /// The label of an entry with `label` or `range` that stands at `position` (from 0).
    pub(crate) fn number(&self, position: usize) -> i64 {
        self.label.unwrap_or(position as i64 + 1)
    }
}

impl Check<'_> {
    /// Keys of `[image]` that only intensities or only label maps have.
    pub fn image_content(&self, scene: &Scene) -> Result<(), SimError> {
        let image = &scene.image;
        let intensities = scene.reads_intensities();
        if let Some(sigma) = image.blur_mm {
            let in_range = sigma >= 0.0 && sigma.is_finite();
            self.that(in_range, "image.blur_mm", sigma, "finite and at least 0")?;
            let want = "0 or no such key: the image is a label map, and only intensities can be \
                        smoothed (give the materials a range)";
            self.that(intensities || sigma == 0.0, "image.blur_mm", sigma, want)?;
        }
        if image.ignore_others {
            let want = "false or no such key: the image holds intensities, and what is in no range is void";
            self.that(!intensities, "image.ignore_others", true, want)?;
            let want = "false or no such key beside mesh.path, whose tags all need a material";
            self.that(scene.mesh.path.is_none(), "image.ignore_others", true, want)?;
            let taken = scene.materials.iter().position(|material| material.other);
            let want = taken.map_or(String::new(), |k| {
                format!("false or no such key, for materials[{k}] takes all other labels")
            });
            self.that(taken.is_none(), "image.ignore_others", true, &want)?;
        }
        for (i, label) in image.ignore_labels.iter().enumerate() {
            let key = format!("image.ignore_labels[{i}]");
            let want = "no such key: the image holds intensities, and what is in no range is void";
            self.that(!intensities, &key, label, want)?;
            let named = scene.materials.iter().position(|m| m.label == Some(*label));
            let want = named.map_or(String::new(), |k| {
                format!("a label without a material, or no materials[{k}]")
            });
            self.that(named.is_none(), &key, label, &want)?;
        }
        Ok(())
    }

    pub fn materials(&self, scene: &Scene) -> Result<(), SimError> {
        for (i, material) in scene.materials.iter().enumerate() {
            self.choice_of_voxels(scene, i, material)?;
            let key = |name: &str| format!("materials[{i}].{name}");
            let MaterialEntry { young_modulus_pa, poisson_ratio, density_kg_m3, .. } = material;
            let sane = (1e-6..=1e15).contains(young_modulus_pa);
            let want = "between 1e-6 and 1e15";
            self.that(sane, &key("young_modulus_pa"), *young_modulus_pa, want)?;
            self.poisson(&key("poisson_ratio"), *poisson_ratio)?;
            let heavy = *density_kg_m3 >= 0.0 && density_kg_m3.is_finite();
            self.that(heavy, &key("density_kg_m3"), density_kg_m3, "finite and at least 0")?;
            if let Some(law) = &material.law {
                self.law(scene, law, &key("law"))?;
            }
        }
        let ratio = scene.void.stiffness_ratio;
        let in_range = ratio > 0.0 && ratio <= 1.0;
        self.that(in_range, "void.stiffness_ratio", ratio, "more than 0 and at most 1")?;
        self.poisson("void.poisson_ratio", scene.void.poisson_ratio)
    }

    /// The law of a material, and that nothing else says how stress follows from strain.
    fn law(&self, scene: &Scene, law: &LawEntry, key: &str) -> Result<(), SimError> {
        let want = "no such key beside stages.law, which is the law of the whole body";
        self.that(scene.stages.law == AUTO, key, law.kind(), want)?;
        let damping = scene.dynamics.as_ref().map_or(0.0, |dynamics| dynamics.damping_stiffness_s);
        let want = "no such key beside dynamics.damping_stiffness_s > 0: what damps is the law, a Prony term say";
        self.that(damping == 0.0, key, law.kind(), want)?;
        let at = |name: &str| format!("{key}.{name}");
        let not_negative = |name: &str, value: f64| {
            let in_range = value >= 0.0 && value.is_finite();
            self.that(in_range, &at(name), value, "finite and at least 0")
        };
        match law {
            LawEntry::Linear => Ok(()),
            LawEntry::Prony { terms, power_law: None, .. } => {
                let want = "at least one term { fraction, time_s }, or a power_law";
                self.that(!terms.is_empty(), &at("terms"), terms.len(), want)?;
                let mut sum = 0.0;
                for (i, PronyEntry { fraction, time_s }) in terms.iter().enumerate() {
                    let key = at(&format!("terms[{i}].fraction"));
                    self.that((0.0..=1.0).contains(fraction), &key, fraction, "0 to 1")?;
                    self.positive(&at(&format!("terms[{i}].time_s")), *time_s)?;
                    sum += fraction;
                    let want = "so little that all fractions together are at most 1";
                    self.that(sum <= 1.0 + 1e-12, &key, fraction, want)?;
                }
                Ok(())
            }
            LawEntry::Prony { terms, power_law: Some(law), .. } => {
                let want = "no such key beside power_law, which gives the terms";
                self.that(terms.is_empty(), &at("terms"), terms.len(), want)?;
                let PowerLaw { exponent, from_s, to_s, terms } = *law;
                let in_range = exponent > 0.0 && exponent < 1.0;
                let want = "more than 0 and less than 1";
                self.that(in_range, &at("power_law.exponent"), exponent, want)?;
                self.positive(&at("power_law.from_s"), from_s)?;
                let want = format!("finite and more than from_s, {from_s:?}");
                let in_range = to_s > from_s && to_s.is_finite();
                self.that(in_range, &at("power_law.to_s"), to_s, &want)?;
                self.that((1..=32).contains(&terms), &at("power_law.terms"), terms, "1 to 32")
            }
            LawEntry::Plastic { yield_pa, hardening_pa } => {
                self.positive(&at("yield_pa"), *yield_pa)?;
                not_negative("hardening_pa", *hardening_pa)
            }
            LawEntry::Creep { yield_strain, rate_per_s, max_strain } => {
                not_negative("yield_strain", *yield_strain)?;
                self.positive(&at("rate_per_s"), *rate_per_s)?;
                self.positive(&at("max_strain"), *max_strain)
            }
        }
    }

    fn poisson(&self, key: &str, ratio: f64) -> Result<(), SimError> {
        self.that(ratio > -1.0 && ratio < 0.5, key, ratio, "more than -1 and less than 0.5")
    }

    /// `label`, `range` or `other` of entry `i`, in the company of the entries before it.
    fn choice_of_voxels(
        &self,
        scene: &Scene,
        i: usize,
        material: &MaterialEntry,
    ) -> Result<(), SimError> {
        let key = |name: &str| format!("materials[{i}].{name}");
        let MaterialEntry { label, range, other, .. } = material;
        let before = &scene.materials[..i];
        if *other {
            let alone = label.is_none() && range.is_none();
            self.that(alone, &key("other"), other, "no such key beside label or range")?;
            let first = before.iter().all(|material| !material.other);
            self.that(first, &key("other"), other, "one such material")?;
        }
        if let Some(with) = scene.materials.iter().position(|material| material.range.is_some()) {
            let want = format!(
                "a range, as materials[{with}] has one: an image holds either labels or intensities"
            );
            let (lacks, shown) = if *other { ("other", 1) } else { ("label", label.unwrap_or(0)) };
            self.that(range.is_some(), &key(lacks), shown, &want)?;
        }
        if range.is_none() && label.is_none() && !other {
            let want = "a label, a range = [low, high] of intensities, or other = true";
            let key = format!("materials[{i}]");
            return Err(SimError::value(self.place, &key, "without label", want));
        }
        if let Some(range) = range {
            self.range(scene, i, *range)?;
        }
        if !other {
            let number = material.number(i);
            let want = "a label other than 0, which is void ([void] says what stands for it)";
            // Files of meshes without groups have the tag 0 throughout.
            let solid = number != 0 || scene.mesh.path.is_some();
            self.that(solid, &key("label"), number, want)?;
            let once = before.iter().enumerate().all(|(j, m)| m.other || m.number(j) != number);
            self.that(once, &key("label"), number, "each label once")?;
        }
        Ok(())
    }

    fn range(&self, scene: &Scene, i: usize, range: [f64; 2]) -> Result<(), SimError> {
        let key = format!("materials[{i}].range");
        let [low, high] = range;
        // False for a NaN.
        let want = "[low, high] with low below high, inf and -inf allowed";
        self.that(low < high, &key, range, want)?;
        let want = "a label in its place: phantoms hold labels (or give an image with image.path)";
        self.that(scene.image.path.is_some(), &key, range, want)?;
        for (j, other) in scene.materials[..i].iter().enumerate() {
            let Some([other_low, other_high]) = other.range else { continue };
            let apart = high <= other_low || other_high <= low;
            let want = format!(
                "no value that materials[{j}].range, [{other_low:?}, {other_high:?}], has too"
            );
            self.that(apart, &key, range, &want)?;
        }
        Ok(())
    }

    /// The keys of a start mesh that is refined to labels.
    pub fn label_refinement(&self, mesh: &MeshOptions) -> Result<(), SimError> {
        let Some(level) = mesh.label_level else {
            let want = "no such key without mesh.label_level";
            let none = mesh.label_region.is_none();
            return self.that(none, "mesh.label_region", "a region", want);
        };
        let want = format!(
            "from start_level, {}, to max_level, {}",
            mesh.start_level,
            mesh.finest_level()
        );
        let in_range = (mesh.start_level..=mesh.finest_level()).contains(&level);
        self.that(in_range, "mesh.label_level", level, &want)?;
        mesh.label_region.iter().try_for_each(|region| self.region(region, "mesh.label_region"))
    }
}
