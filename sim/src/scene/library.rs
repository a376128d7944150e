//! Materials with the paper that each is from, to be named in a scene.

use toml::Value;

use super::key_path::{KeyPath, Step};
use super::overrides::Override;
use crate::SimError;

/// A material as somebody measured it.
///
/// One modulus for small strains stands for tissue that is stiffer when it is stretched further or
/// faster, and differs from body to body by a factor of two and more.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LibraryMaterial {
    /// What scenes call it: the tissue, first author and year of the paper.
    pub name: &'static str,
    /// Pa.
    pub young_modulus_pa: f64,
    /// .49 and more stand for the incompressible material that the authors take it for.
    pub poisson_ratio: f64,
    /// That of the tissue by ICRU reports 44 and 46, of silicones by their makers, kg/m³.
    pub density_kg_m3: f64,
    /// Authors, journal, year.
    pub source: &'static str,
    /// What was measured, and how the modulus follows.
    pub measured: &'static str,
    /// Words of labels that mean this tissue; none of a variant that has to be asked for.
    words: &'static [&'static str],
}

const ARDA: &str = "Arda, Ciledag, Aktas, Aribas, Kose, Am. J. Roentgenol. 197 (2011)";
const BUDDAY: &str = "Budday, Nay, de Rooij, Steinmann, Wyrobek, Ovaert, Kuhl, \
                      J. Mech. Behav. Biomed. Mater. 46 (2015)";
const ROUVIERE: &str =
    "Rouvière, Yin, Dresner, Rossman, Burgart, Fidler, Ehman, Radiology 240 (2006)";
const SAMANI: &str = "Samani, Zubovits, Plewes, Phys. Med. Biol. 52 (2007)";

macro_rules! library {
    ($($name:literal: $pa:literal, $nu:literal, $density:literal, $source:expr, $measured:literal,
       $words:expr;)*) => {
        &[$(LibraryMaterial {
            name: $name,
            young_modulus_pa: $pa,
            poisson_ratio: $nu,
            density_kg_m3: $density,
            source: $source,
            measured: $measured,
            words: &$words,
        },)*]
    };
}

// In order of preference where words of several are in a label's name.
const LIBRARY: &[LibraryMaterial] = library! {
    "vessel wall (Bergel 1961)": 4.3e5, 0.49, 1050.0, "Bergel, J. Physiol. 156 (1961)",
        "dog's thoracic aorta at 100 mmHg, around its axis: stiffness of the stretched wall, \
         which a vessel with its blood as one label does not have",
        ["aorta", "artery", "vein", "vena", "vessel", "vessels"];
    "liver (Rouviere 2006)": 6.0e3, 0.49, 1060.0, ROUVIERE,
        "12 healthy volunteers, MR elastography: shear stiffness 2.0 ± .3 kPa, E three times that",
        ["liver", "hepatic"];
    "liver with fibrosis (Rouviere 2006)": 1.68e4, 0.49, 1060.0, ROUVIERE,
        "12 patients, MR elastography: mean shear stiffness 5.6 kPa (2.7 to 19.2), E three times that",
        [];
    "brain white matter (Budday 2015)": 1.895e3, 0.49, 1040.0, BUDDAY,
        "fresh bovine slices under a flat punch: 1.895 ± .592 kPa",
        ["brain", "cerebrum", "cerebral", "cerebellum", "white"];
    "brain grey matter (Budday 2015)": 1.389e3, 0.49, 1040.0, BUDDAY,
        "fresh bovine slices under a flat punch: 1.389 ± .289 kPa",
        ["grey", "gray", "cortex"];
    "kidney cortex (Arda 2011)": 5.0e3, 0.49, 1050.0, ARDA,
        "127 healthy volunteers, ultrasound shear waves: 5.0 ± 2.9 kPa",
        ["kidney", "renal"];
    "spleen (Arda 2011)": 2.9e3, 0.49, 1060.0, ARDA,
        "127 healthy volunteers, ultrasound shear waves: 2.9 ± 1.8 kPa",
        ["spleen"];
    "pancreas (Arda 2011)": 4.8e3, 0.49, 1040.0, ARDA,
        "127 healthy volunteers, ultrasound shear waves: 4.8 ± 3 kPa",
        ["pancreas"];
    "thyroid (Arda 2011)": 1.097e4, 0.49, 1050.0, ARDA,
        "127 healthy volunteers, ultrasound shear waves: 10.97 ± 3.1 kPa",
        ["thyroid"];
    "muscle (Arda 2011)": 1.11e4, 0.49, 1050.0, ARDA,
        "relaxed gastrocnemius of 127 healthy volunteers, ultrasound shear waves: 11.1 ± 4.1 kPa; \
         along fibres and when it contracts muscle is stiffer",
        ["muscle", "gluteus", "iliopsoas", "autochthon"];
    "fat (Samani 2007)": 3.25e3, 0.49, 950.0, SAMANI,
        "fresh samples of breast fat under small indentations: 3.25 ± .91 kPa",
        ["fat", "adipose"];
    "breast gland (Samani 2007)": 3.24e3, 0.49, 1020.0, SAMANI,
        "fresh samples of fibroglandular tissue under small indentations: 3.24 ± .61 kPa",
        ["breast"];
    "tumour (Samani 2007)": 4.252e4, 0.49, 1050.0, SAMANI,
        "fresh samples of high-grade invasive ductal carcinoma of the breast under small \
         indentations: 42.52 ± 12.47 kPa; other tumours have other values",
        ["tumour", "tumor", "carcinoma", "lesion"];
    "silicone Dragon Skin 10 (Dubied 2022)": 2.638e5, 0.499, 1070.0,
        "Dubied, Michelis, Spielberg, Katzschmann, IEEE Robot. Autom. Lett. 7 (2022)",
        "fitted by projective dynamics to the swing of a clamped beam: 263.8 kPa at a Poisson ratio of .499",
        [];
    "silicone Sylgard 184 (Johnston 2014)": 1.32e6, 0.499, 1030.0,
        "Johnston, McCluskey, Tan, Tracey, J. Micromech. Microeng. 24 (2014)",
        "pulled after curing at 25 °C: 1.32 MPa (2.97 MPa after 200 °C)",
        [];
};

/// All of them.
pub fn library() -> &'static [LibraryMaterial] {
    LIBRARY
}

/// The material of a tissue by the words of a label's name, e.g. `kidney_left`.
pub fn library_material_of(label: &str) -> Option<&'static LibraryMaterial> {
    let label = label.to_lowercase();
    let words: Vec<&str> = label.split(|c: char| !c.is_alphabetic()).collect();
    LIBRARY.iter().find(|one| one.words.iter().any(|word| words.contains(word)))
}

/// Puts numbers beside the names of materials in a scene. A number that stands there stays, unless
/// the name is of an override and the number is not.
pub(super) fn fill_in(
    scene: &mut Value,
    place: &str,
    overrides: &[Override],
) -> Result<(), SimError> {
    let entries = scene.get_mut("materials").and_then(Value::as_array_mut);
    for (i, entry) in entries.into_iter().flatten().enumerate() {
        let Value::Table(table) = entry else { continue };
        let Some(Value::String(name)) = table.get("material") else { continue };
        let found = find(name, &format!("materials[{i}].material"), place)?;
        let path = |key: &str| {
            let entry = KeyPath::parse("materials").join(Step::Index(i));
            entry.join(Step::Key(key.into()))
        };
        let overrides_it = |key: &str| overrides.iter().any(|one| one.path == path(key));
        for (key, number) in [
            ("young_modulus_pa", found.young_modulus_pa),
            ("poisson_ratio", found.poisson_ratio),
            ("density_kg_m3", found.density_kg_m3),
        ] {
            if overrides_it("material") && !overrides_it(key) || !table.contains_key(key) {
                table.insert(key.into(), Value::Float(number));
            }
        }
        if !table.contains_key("name") {
            table.insert("name".into(), Value::String(found.name.into()));
        }
    }
    Ok(())
}

fn find(name: &str, key: &str, place: &str) -> Result<&'static LibraryMaterial, SimError> {
    LIBRARY.iter().find(|one| one.name == name).ok_or_else(|| {
        let likeness = |one: &&LibraryMaterial| (1e3 * strsim::jaro_winkler(one.name, name)) as u32;
        let nearest = LIBRARY.iter().max_by_key(likeness).map_or("", |one| one.name);
        let want = format!("a name that `yawara materials` lists, perhaps \"{nearest}\"");
        SimError::value(place, key, format!("{name:?}"), want)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_end_in_a_year() {
        for (i, one) in LIBRARY.iter().enumerate() {
            assert!(LIBRARY[..i].iter().all(|before| before.name != one.name), "{}", one.name);
            let year = one.name.strip_suffix(')').map(|name| &name[name.len() - 4..]);
            assert!(year.is_some_and(|year| one.source.contains(year)), "{}", one.name);
            assert!((1e2..1e10).contains(&one.young_modulus_pa) && one.poisson_ratio < 0.5);
        }
    }

    #[test]
    fn labels_mean_tissues_by_whole_words() {
        let name = |label| library_material_of(label).map(|one| one.name);
        assert_eq!(name("kidney_left"), Some("kidney cortex (Arda 2011)"));
        assert_eq!(name("Segment: Liver"), Some("liver (Rouviere 2006)"));
        assert_eq!(name("hepatic vein"), Some("vessel wall (Bergel 1961)"));
        assert_eq!(name("fatigue"), None);
        assert_eq!(name("vertebrae_L1"), None);
    }
}
