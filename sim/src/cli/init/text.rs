//! A proposed scene as commented TOML.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use crate::scene::{LengthUnit, LibraryMaterial, MaterialEntry, library_material_of};
use toml::Value;
use yawara_mesh::volume::LabelVolume;

use super::places::Places;

/// The most labels that get an entry each; smaller ones share one.
const MOST_ENTRIES: usize = 16;

/// The most labels whose outlines are written.
const MOST_OUTLINES: usize = 3;

/// Base cells along the longest side.
const CELLS: f64 = 10.0;

/// How far the pull goes, by the longest side.
const PULL: f64 = 0.04;

/// What soft tissue is taken to be, Pa: between fat and muscle.
const SOFT_PA: f64 = 5e3;

/// What the image holds.
pub(super) enum Content {
    /// Labels, resampled or as they are, with the names that the file has for them.
    Labels { voxel_mm: Option<f64>, names: BTreeMap<i64, String> },
    /// Hounsfield units.
    Intensities { voxel_mm: f64, blur_mm: f64, materials: Vec<MaterialEntry> },
}

/// What a scene is made from.
pub(super) struct Proposal<'a> {
    pub image: &'a Path,
    pub unit: Option<LengthUnit>,
    pub volume: &'a LabelVolume,
    pub content: Content,
    pub places: Places,
}

impl Proposal<'_> {
    /// What was found and chosen, for people.
    pub fn in_words(&self) -> String {
        let [x, y, z] = self.places.size_mm.map(short);
        let what = match &self.content {
            Content::Labels { .. } => format!("a label map of {} labels", self.labels().len()),
            Content::Intensities { .. } => "a CT, by Hounsfield units".into(),
        };
        format!(
            "{}: {what}, body of {x} x {y} x {z} mm; fixed at its {} side, pulled away from there\n",
            self.image.display(),
            self.places.side.2
        )
    }

    /// Labels with their voxels, the most frequent first.
    fn labels(&self) -> Vec<(i64, u64)> {
        let counts = self.volume.counts();
        let labels = self.volume.values().iter().copied().zip(counts).skip(1);
        let mut labels: Vec<(i64, u64)> = labels.filter(|(_, voxels)| *voxels > 0).collect();
        labels.sort_by_key(|(label, voxels)| (std::cmp::Reverse(*voxels), *label));
        labels
    }

    /// The largest labels, as entries of `output.surfaces`.
    fn outlined(&self) -> Vec<String> {
        let largest = self.labels().into_iter().take(MOST_OUTLINES);
        largest.map(|(label, _)| format!("{{ label = {label} }}")).collect()
    }

    /// The scene.
    pub fn toml(&self) -> String {
        let head = format!(
            "# Made by yawara init. Every number is a proposal: docs/scene.md has all keys.\n\
             name = {}\n\n[image]\npath = {}\n",
            quoted(&self.name()),
            quoted(&self.image.display().to_string())
        );
        head + &self.image_keys() + &self.materials() + &self.mesh() + &self.loads()
    }

    /// The file's name without what scenes' names do not have.
    fn name(&self) -> String {
        let name = self.image.file_name().unwrap_or_default().to_string_lossy();
        let stem = name.split('.').find(|part| !part.is_empty()).unwrap_or("organ");
        let plain = |c: char| if c.is_alphanumeric() || "-_".contains(c) { c } else { '_' };
        stem.chars().map(plain).take(60).collect()
    }

    fn image_keys(&self) -> String {
        let unit = self.unit.and_then(|unit| Value::try_from(unit).ok());
        let unit = unit.map_or_else(String::new, |unit| format!("unit = {unit}\n"));
        unit + &match &self.content {
            Content::Labels { voxel_mm: None, .. } => String::new(),
            Content::Labels { voxel_mm: Some(voxel_mm), .. } => {
                format!(
                    "# Coarser than the file, which takes less time.\nvoxel_mm = {voxel_mm:?}\n"
                )
            }
            Content::Intensities { voxel_mm, blur_mm, .. } => format!(
                "voxel_mm = {voxel_mm:?}\n# Smooths noise before the ranges are applied.\n\
                 blur_mm = {blur_mm:?}\n"
            ),
        }
    }

    fn materials(&self) -> String {
        let mut text = String::from(
            "\n# Young's moduli are typical of the kind of tissue, no more: put in what you know, or a \
             material\n# that `yawara materials` lists with its source.\n",
        );
        let numbers = |pa: f64, nu: f64, density: f64| {
            format!(
                "young_modulus_pa = {pa:?}\npoisson_ratio = {nu:?}\ndensity_kg_m3 = {density:?}\n"
            )
        };
        // Writing to a String can't fail.
        let mut entry = |head: &str, name: &str, what: String| {
            let _ = write!(text, "[[materials]]\n{head}\nname = {}\n{what}\n", quoted(name));
        };
        let names = match &self.content {
            Content::Intensities { materials, .. } => {
                for one in materials {
                    let head = format!("range = {:?}", one.range.unwrap_or_default());
                    let MaterialEntry { young_modulus_pa, poisson_ratio, density_kg_m3, .. } = *one;
                    entry(
                        &head,
                        &one.name,
                        numbers(young_modulus_pa, poisson_ratio, density_kg_m3),
                    );
                }
                return text;
            }
            Content::Labels { names, .. } => names,
        };
        let soft = || numbers(SOFT_PA, 0.45, 1050.0);
        let by_name = |one: &LibraryMaterial| format!("material = {}\n", quoted(one.name));
        let labels = self.labels();
        for (label, voxels) in labels.iter().take(MOST_ENTRIES) {
            let head = format!("label = {label} # {voxels} voxels");
            let name = names.get(label).cloned().unwrap_or_else(|| format!("label {label}"));
            let known = library_material_of(&name);
            entry(&head, &name, known.map_or_else(soft, by_name));
        }
        if labels.len() > MOST_ENTRIES {
            let head = format!("other = true # {} smaller labels", labels.len() - MOST_ENTRIES);
            entry(&head, "all others", soft());
        }
        text
    }

    fn mesh(&self) -> String {
        let longest = self.places.size_mm.into_iter().fold(0.0, f64::max);
        let base_mm = short(longest / CELLS);
        format!(
            "[mesh]\n# A tenth of the longest side; rounded to a power of two of voxels.\n\
             base_mm = {base_mm:?}\nmax_level = 6\nmax_vertices = 3456\n\n\
             [refinement]\n# Relative error of the force to refine to.\ntarget = 0.1\n\n"
        )
    }

    fn loads(&self) -> String {
        let Places { side: (_, _, side), fixed: [min, max], grab, radius_mm, size_mm } =
            &self.places;
        let longest = size_mm.iter().copied().fold(0.0, f64::max);
        let end = self.places.away().map(|x| short(1e-3 * (x * PULL * longest)));
        let centre = grab.map(|x| (x * 1e3).round() / 1e3);
        format!(
            "# Smooth outlines in the frames; label = 0 there is void, which is left out.\n\
             [output]\nframes_every = 5\nsurfaces = [{}]\n\n\
             # The {side} side, which has the most material in one plane. Places are fractions of the\n\
             # body's box along right, anterior, superior.\n[[fixed]]\nshape = \"box\"\n\
             min = {min:?}\nmax = {max:?}\n\n\
             # Pulls what is far from there away from it.\n[[tools]]\nkind = \"grab\"\n\
             region = {{ shape = \"sphere\", centre = {centre:?}, radius_m = {:?} }}\n\
             path = [{{ time_s = 0.0 }}, {{ time_s = 0.5, move_m = {end:?} }}]\n\n\
             [time]\nsteps = 10\nstep_s = 0.05\n",
            self.outlined().join(", "),
            short(radius_mm * 1e-3)
        )
    }
}

fn quoted(text: &str) -> String {
    Value::String(text.into()).to_string()
}

/// A number to four digits.
pub(super) fn short(x: f64) -> f64 {
    // What `format!` writes can be read.
    format!("{x:.3e}").parse().unwrap_or(x)
}
