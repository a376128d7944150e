//! Materials of the library: listed with their sources, named in scenes.

use crate::workbench;

use workbench::{BAR, Workbench};
use yawara::scene_file;

fn bar(materials: &str) -> Workbench {
    let bench = Workbench::new();
    let given = "young_modulus_pa = 5e3\npoisson_ratio = 0.3\n";
    assert!(BAR.contains(given));
    bench.write("bar.toml", BAR.replace(given, materials));
    bench
}

/// E, ν, density and name of the only material.
fn numbers(bench: &Workbench, overrides: &[&str]) -> ([f64; 3], String) {
    let overrides: Vec<String> = overrides.iter().map(|&one| one.into()).collect();
    let file = bench.path("bar.toml").display().to_string();
    let (scene, _) = scene_file::load(&file, &overrides).unwrap();
    let one = &scene.materials[0];
    ([one.young_modulus_pa, one.poisson_ratio, one.density_kg_m3], one.name.clone())
}

#[test]
fn all_are_listed_with_their_sources_and_may_be_named() {
    let bench = Workbench::new();
    let listed = bench.succeed(&["materials"]);
    for one in yawara::scene::library() {
        let line = format!("material = \"{}\"\n", one.name);
        assert!(listed.contains(&line) && listed.contains(one.source), "{}", one.name);
        let bench = bar(&line);
        let (found, name) = numbers(&bench, &[]);
        assert_eq!(found, [one.young_modulus_pa, one.poisson_ratio, one.density_kg_m3]);
        assert_eq!(name, one.name);
    }
}

#[test]
fn numbers_beside_a_name_win_unless_the_name_comes_later() {
    const SPLEEN: &str = "materials.0.material=spleen (Arda 2011)";
    let bench = bar("material = \"liver (Rouviere 2006)\"\npoisson_ratio = 0.45\n");
    assert_eq!(numbers(&bench, &[]).0, [6e3, 0.45, 1060.0]);
    assert_eq!(numbers(&bench, &["materials.0.young_modulus_pa=7e3"]).0, [7e3, 0.45, 1060.0]);
    assert_eq!(numbers(&bench, &[SPLEEN]).0, [2.9e3, 0.49, 1060.0]);
    assert_eq!(numbers(&bench, &[SPLEEN, "materials.0.poisson_ratio=0.4"]).0, [2.9e3, 0.4, 1060.0]);
}

#[test]
fn unknown_names_and_missing_numbers_are_refused() {
    let bench = bar("material = \"liver (Rouvier 2006)\"\n");
    let words = ["bar.toml, line", "materials[0].material", "perhaps \"liver (Rouviere 2006)\""];
    bench.refused(&["plan", "bar.toml"], &words);
    let bench = bar("");
    bench.refused(&["plan", "bar.toml"], &["materials[0].poisson_ratio is missing", "material"]);
    let bench = bar("material = 3\n");
    bench.refused(&["plan", "bar.toml"], &["materials[0].material is 3, want a string"]);
}
