//! Scenes by name or from a TOML file, with overrides, refused with the line that is wrong.

use std::fs;
use std::io;
use std::path::Path;

use serde::Deserialize;
use toml::Value;
use toml::de::{DeTable, DeValue};

use super::key_path::{KeyPath, Step};
use super::library;
use super::overrides::Override;
use super::schema;
use crate::SimError;
use crate::scene::Scene;

const BUILT_IN: [(&str, &str); 17] = [
    ("liver", include_str!("../../scenes/liver.toml")),
    ("liver_ct", include_str!("../../scenes/liver_ct.toml")),
    ("beam", include_str!("../../scenes/beam.toml")),
    ("twist", include_str!("../../scenes/twist.toml")),
    ("drop", include_str!("../../scenes/drop.toml")),
    ("stiff", include_str!("../../scenes/stiff.toml")),
    ("near_incompressible", include_str!("../../scenes/near_incompressible.toml")),
    ("extreme", include_str!("../../scenes/extreme.toml")),
    ("homogeneous", include_str!("../../scenes/homogeneous.toml")),
    ("indent", include_str!("../../scenes/indent.toml")),
    ("probe", include_str!("../../scenes/probe.toml")),
    ("palpate", include_str!("../../scenes/palpate.toml")),
    ("liver_resection", include_str!("../../scenes/liver_resection.toml")),
    ("incision", include_str!("../../scenes/incision.toml")),
    ("peel", include_str!("../../scenes/peel.toml")),
    ("abdomen_ct", include_str!("../../scenes/abdomen_ct.toml")),
    ("organs_ct", include_str!("../../scenes/organs_ct.toml")),
];

/// The built-in scenes: name and TOML text.
pub fn built_in() -> &'static [(&'static str, &'static str)] {
    &BUILT_IN
}

/// Reads a scene, a built-in name or the path of a TOML file, applies overrides `KEY=VALUE` and
/// checks the result. Returns the scene and what to call it in messages.
///
/// Keys are dotted, with entries of lists by number from 0 (`materials.0.young_modulus_pa`, or
/// `materials[0].young_modulus_pa`); the number after the last one appends. VALUE is a TOML
/// value, or else a string. A relative `image.path` starts from the current directory. Names of
/// materials of the library get their numbers here.
/// # Errors
/// [`SimError::UnknownScene`], [`SimError::Io`], [`SimError::Syntax`];
/// [`SimError::UnknownKey`], [`SimError::MissingKey`] or [`SimError::Value`] naming file and
/// line, or the override.
pub fn load(scene: &str, overrides: &[String]) -> Result<(Scene, String), SimError> {
    load_beside(scene, overrides, &[])
}

/// As [`load`], with the overrides of `--beside` after those of `--set`.
pub(crate) fn load_beside(
    scene: &str,
    set: &[String],
    beside: &[String],
) -> Result<(Scene, String), SimError> {
    let (text, name) = read(scene)?;
    let scene = parse_beside(&text, &name, set, beside, false)?;
    Ok((scene, name))
}

/// As [`load`], from the TOML text of a scene that messages call `name`. With `in_memory` its volume is given to the
/// [builder](crate::SimulationBuilder::volume), and it must name no image.
/// # Errors
/// As [`load`].
pub fn parse(
    text: &str,
    name: &str,
    overrides: &[String],
    in_memory: bool,
) -> Result<Scene, SimError> {
    parse_beside(text, name, overrides, &[], in_memory)
}

fn parse_beside(
    text: &str,
    name: &str,
    set: &[String],
    beside: &[String],
    in_memory: bool,
) -> Result<Scene, SimError> {
    let set = set.iter().map(|argument| Override::parse("--set", argument));
    let beside = beside.iter().map(|argument| Override::parse("--beside", argument));
    let overrides: Vec<Override> = set.chain(beside).collect::<Result<_, _>>()?;
    let lines = DeTable::parse(text).map_err(|error| syntax(name, text, &error))?;
    let table = toml::from_str(text).map_err(|error| syntax(name, text, &error))?;
    let mut value = Value::Table(table);
    for one in &overrides {
        one.apply(&mut value)?;
    }
    let source = Source { name, text, lines: lines.get_ref(), overrides: &overrides };
    library::fill_in(&mut value, name, &overrides).map_err(|error| source.locate(error))?;
    schema::check(&value, &|path| source.place(path))?;
    let scene = Scene::deserialize(value).map_err(|error| syntax(name, "", &error))?;
    scene.validate_for(name, in_memory).map_err(|error| source.locate(error))?;
    Ok(scene)
}

fn read(scene: &str) -> Result<(String, String), SimError> {
    if let Some((_, text)) = BUILT_IN.iter().find(|(name, _)| *name == scene) {
        return Ok(((*text).into(), format!("scene {scene}")));
    }
    let path = Path::new(scene);
    let is_name = path.extension().is_none() && path.components().count() == 1;
    if is_name && !path.exists() {
        let choices = BUILT_IN.map(|(name, _)| name).join(", ");
        return Err(SimError::UnknownScene { name: scene.into(), choices });
    }
    let refusal = |source: io::Error| match source.kind() {
        io::ErrorKind::InvalidData => SimError::Syntax {
            place: scene.into(),
            reason: "no UTF-8 text, want a scene in TOML; of an image `yawara init` makes one"
                .into(),
        },
        _ => SimError::Io(path.into(), source),
    };
    Ok((fs::read_to_string(path).map_err(refusal)?, scene.into()))
}

/// Where the parts of a scene come from.
struct Source<'a> {
    name: &'a str,
    text: &'a str,
    lines: &'a DeTable<'a>,
    overrides: &'a [Override],
}

impl Source<'_> {
    /// The override that set `path`, or else the file and the line of its deepest known part.
    fn place(&self, path: &KeyPath) -> String {
        if let Some(last) = self.overrides.iter().rev().find(|one| path.starts_with(&one.path)) {
            return last.place.clone();
        }
        let found = deepest(self.lines, path.steps());
        // A table that only an override made.
        let made = |one: &&Override| one.path.starts_with(path);
        match (found, self.overrides.iter().rev().find(made)) {
            (Some((offset, true)), _) | (Some((offset, false)), None) => {
                format!("{}, line {}", self.name, line_and_column(self.text, offset).0)
            }
            (_, Some(last)) if !path.steps().is_empty() => last.place.clone(),
            _ => self.name.into(),
        }
    }

    /// Adds the line to an error that names a key.
    fn locate(&self, mut error: SimError) -> SimError {
        if let SimError::Value { place, key, .. } = &mut error {
            *place = self.place(&KeyPath::parse(key));
        }
        error
    }
}

/// Offset of the deepest part of `path` that the text has, and whether that is all of it.
fn deepest(table: &DeTable<'_>, path: &[Step]) -> Option<(usize, bool)> {
    let (Step::Key(first), mut rest) = path.split_first()? else { return None };
    let (key, mut value) = table.iter().find(|(key, _)| key.get_ref() == first)?;
    let mut offset = key.span().start;
    while let Some((step, tail)) = rest.split_first() {
        match (step, value.get_ref()) {
            (Step::Key(_), DeValue::Table(inner)) => {
                return deepest(inner, rest).or(Some((offset, false)));
            }
            (Step::Index(index), DeValue::Array(entries)) => {
                let Some(entry) = entries.get(*index) else { break };
                offset = entry.span().start;
                (value, rest) = (entry, tail);
            }
            _ => break,
        }
    }
    Some((offset, rest.is_empty()))
}

/// Line and column of a byte offset, both from 1.
fn line_and_column(text: &str, offset: usize) -> (usize, usize) {
    let before = text.get(..offset).unwrap_or(text);
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
}

fn syntax(name: &str, text: &str, error: &toml::de::Error) -> SimError {
    let mut reason = error.message().replace('\n', "; ");
    let Some(span) = error.span() else { return SimError::Syntax { place: name.into(), reason } };
    let (line, column) = line_and_column(text, span.start);
    let there = text.get(span).unwrap_or_default().trim();
    if (1..=40).contains(&there.len()) && !there.contains('\n') {
        reason.push_str(&format!(" (at `{there}`)"));
    }
    SimError::Syntax { place: format!("{name}, line {line}, column {column}"), reason }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: &str = "\
name = \"small\"
[image]
phantom = \"block\"
size_mm = [40, 20.0, 20]
voxel_mm = 5
[[materials]]
label = 1
young_modulus_pa = 5e3
poisson_ratio = 0.3
[mesh]
base_mm = 10
max_level = 6
[time]
steps = 2
step_s = 0.1
[[fixed]]
shape = \"box\"
min = [0, 0, 0]
max = [0, 1, 1]
";

    /// Loads `text` from a file; the file's name is cut from messages.
    fn try_load(text: &str, overrides: &[&str]) -> Result<Scene, String> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.toml");
        fs::write(&path, text).unwrap();
        let path = path.to_str().unwrap();
        let overrides: Vec<String> = overrides.iter().map(|&one| one.into()).collect();
        load(path, &overrides)
            .map(|(scene, _)| scene)
            .map_err(|error| error.to_string().replace(path, "FILE"))
    }

    #[test]
    fn a_small_scene_and_its_defaults() {
        let scene = try_load(SMALL, &[]).unwrap();
        assert_eq!(scene.image.size_mm, Some([40.0, 20.0, 20.0]));
        assert_eq!(scene.stages, crate::scene::StageNames::default());
        assert_eq!(scene.materials[0].density_kg_m3, 1000.0);
    }

    #[test]
    fn overrides_reach_every_depth() {
        let scene = try_load(
            SMALL,
            &[
                "materials.0.young_modulus_pa=7e3",
                "materials.1={label=2, young_modulus_pa=1.0, poisson_ratio=0}",
                "stages.inverse=paper",
                "image.path=some where.nii.gz",
                "gravity_m_s2=[0, 0, -9.81]",
                "fixed[0].max.0=0.5",
                "name=\"quoted\"",
            ],
        )
        .unwrap();
        assert_eq!(scene.materials[0].young_modulus_pa, 7e3);
        assert_eq!(scene.materials[1].label, Some(2));
        assert_eq!(scene.stages.inverse, "paper");
        assert_eq!(scene.image.path.as_deref(), Some(Path::new("some where.nii.gz")));
        assert_eq!(scene.gravity_m_s2, [0.0, 0.0, -9.81]);
        let crate::scene::Region::Box { max, .. } = &scene.fixed[0] else { panic!() };
        assert_eq!(max, &Some([0.5, 1.0, 1.0]));
        assert_eq!(scene.name, "quoted");
    }

    /// What stands in the scene, what in its place is wrong, and what is said of it.
    const WRONG: &str = "\
steps = 2 | stesp = 2 | line 14: unknown key `time.stesp`; did you mean `steps`?
young_modulus_pa | young | line 8: unknown key `materials[0].young`; \
    did you mean `young_modulus_pa`?
5e3 | '5 kPa' | line 8: materials[0].young_modulus_pa is \"5 kPa\", want a number
steps = 2 | # | line 13: time.steps is missing, want a whole number
max_level = 6 | max_level = 300 | line 12: mesh.max_level is 300, \
    want a whole number from 0 to 255
steps = 2 | steps = -2 | line 14: time.steps is -2, want a whole number, at least 0
\"block\" | 'blok' | line 3: image.phantom is \"blok\", want `liver` or `block`
\"box\" | 'cube' | line 17: fixed[0].shape is \"cube\", want `box` or `sphere`
max = [0, 1, 1] | max = [0, 1] | line 19: fixed[0].max is an array of 2, \
    want an array of 3 numbers
max = [0, 1, 1] | radius_m = 1 | line 19: unknown key `fixed[0].radius_m`; \
    valid keys here are `max`, `max_mm`, `max_voxel`, `min`, `min_mm`, `min_voxel`, `shape`
0.3 | nan | line 9: materials[0].poisson_ratio is NaN, want more than -1 and less than 0.5
[mesh] | [time] | line 13, column 2: duplicate key (at `time`)
steps = 2 | steps = | line 14, column";

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        for case in WRONG.lines() {
            let [from, to, want] = case.split(" | ").collect::<Vec<_>>()[..] else { panic!() };
            let message = try_load(&SMALL.replacen(from, to, 1), &[]).unwrap_err();
            assert!(message.starts_with(&format!("FILE, {want}")), "{message}\nwant {want}");
            assert!(!message.contains('\n'), "{message}");
        }
    }

    #[test]
    fn what_is_wrong_with_an_override_names_the_override() {
        let cases = [
            ("tim.steps=3", "unknown key `tim`; did you mean `time`?"),
            ("stages.invers=lu", "unknown key `stages.invers`; did you mean `inverse`?"),
            ("materials.0.poisson_ratio=0.5", "materials[0].poisson_ratio is 0.5, want"),
            ("materials.3.label=1", "materials has 1 entries"),
            ("time.steps=many", "time.steps is \"many\", want a whole number"),
            ("time.steps.x=1", "time.steps is no table"),
            ("time", "want KEY=VALUE"),
            ("=3", "want KEY=VALUE"),
            ("a..b=3", "want KEY=VALUE"),
        ];
        for (argument, want) in cases {
            let message = try_load(SMALL, &[argument]).unwrap_err();
            let want = format!("--set {argument}: {want}");
            assert!(message.starts_with(&want), "{message}\nwant {want}");
        }
    }

    #[test]
    fn an_override_supplies_what_the_file_lacks() {
        let without = SMALL.replace("[time]\nsteps = 2\nstep_s = 0.1\n", "");
        let message = try_load(&without, &[]).unwrap_err();
        assert!(message.starts_with("FILE: time is missing, want a table"), "{message}");
        let scene = try_load(&without, &["time.steps=9", "time.step_s=1"]).unwrap();
        assert_eq!(scene.time.steps, 9);
    }

    #[test]
    fn built_in_scenes_are_valid() {
        for (name, _) in built_in() {
            let (scene, place) = load(name, &["image.path=x.nii".into()]).unwrap();
            assert_eq!((&scene.name[..], place), (*name, format!("scene {name}")));
        }
        let error = load("livr", &[]).unwrap_err().to_string();
        assert!(error.contains("liver, liver_ct, beam, twist"), "{error}");
        let error = load("liver_ct", &[]).unwrap_err().to_string();
        assert!(error.contains("--set image.path=FILE.nii.gz"), "{error}");
        assert!(matches!(load("no/such.toml", &[]), Err(SimError::Io(..))));
    }

    #[test]
    fn a_resolved_scene_reads_back() {
        let scene = try_load(SMALL, &["gravity_m_s2=[0.1, 1e-300, -9.81]"]).unwrap();
        assert_eq!(try_load(&toml::to_string(&scene).unwrap(), &[]).unwrap(), scene);
    }
}
