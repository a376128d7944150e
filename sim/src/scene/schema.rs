//! Checks keys and types of a scene before it is read, so that errors name the key.
//!
//! The schema is a pair of complete scenes, serialised: whatever key they have is valid, and a
//! key is required if they can't be read without it. A new field of a scene has to be filled in
//! there, or this file does not compile.

use serde::Deserialize;
use toml::{Table, Value};

use super::key_path::{KeyPath, Step};
use super::nearest;
use crate::SimError;
use crate::scene::{
    Adapter, Budget, Dynamics, GrabEntry, GrabHold, Image, Key, MaterialEntry, MeshOptions, Normal,
    Output, Phantom, PressureEntry, PressureKey, ProbeEntry, Refinement, Region, Scene, Solver,
    StageNames, Support, SupportHold, SurfaceEntry, Time, ToolEntry, Void,
};

/// Keys that choose among variants with different keys.
const TAGS: [&str; 2] = ["shape", "kind"];

/// Refuses unknown and missing keys, wrong types, unknown variants and integers out of range.
/// `place` says where a key stands.
pub(super) fn check(scene: &Value, place: &dyn Fn(&KeyPath) -> String) -> Result<(), SimError> {
    let examples = examples();
    let models: Vec<Model<'_>> =
        examples.iter().map(|root| Model { root, path: KeyPath::default(), value: root }).collect();
    Checker { place }.value(scene, &KeyPath::default(), &models)
}

/// A part of a complete scene that shows what may stand somewhere.
#[derive(Clone)]
struct Model<'a> {
    root: &'a Value,
    path: KeyPath,
    value: &'a Value,
}

impl<'a> Model<'a> {
    fn child(&self, step: Step, value: &'a Value) -> Self {
        Self { root: self.root, path: self.path.join(step), value }
    }

    fn key(&self, key: &str) -> Option<Self> {
        Some(self.child(Step::Key(key.into()), self.value.get(key)?))
    }

    /// What reading the complete scene says with this part replaced, or left out.
    fn read_with(&self, replacement: Option<&Value>) -> Result<(), String> {
        let mut root = self.root.clone();
        if let Some((last, parents)) = self.path.steps().split_last() {
            let parent = parents.iter().try_fold(&mut root, |at, step| step.of(at));
            match (parent, last, replacement) {
                (Some(Value::Table(table)), Step::Key(key), None) => {
                    table.remove(key);
                }
                (Some(parent), step, Some(value)) => {
                    step.of(parent).into_iter().for_each(|slot| *slot = value.clone());
                }
                _ => {}
            }
        }
        Scene::deserialize(root).map(drop).map_err(|error| error.message().to_owned())
    }
}

struct Checker<'a> {
    place: &'a dyn Fn(&KeyPath) -> String,
}

impl Checker<'_> {
    fn value(&self, given: &Value, at: &KeyPath, models: &[Model<'_>]) -> Result<(), SimError> {
        let fits = models.iter().any(|model| match (model.value, given) {
            (Value::Float(_), Value::Integer(_)) => true,
            (model, given) => model.same_type(given),
        });
        if !fits {
            return Err(self.wrong(at, given, wanted(models)));
        }
        match given {
            Value::Table(table) => self.table(table, at, models),
            Value::Array(entries) => self.array(entries, given, at, models),
            Value::Integer(_) | Value::String(_) => self.scalar(given, at, models),
            _ => Ok(()),
        }
    }

    fn table(&self, given: &Table, at: &KeyPath, models: &[Model<'_>]) -> Result<(), SimError> {
        let models = self.variant(given, at, models)?;
        for (key, value) in given {
            let path = at.join(Step::Key(key.clone()));
            let below: Vec<Model<'_>> = models.iter().filter_map(|model| model.key(key)).collect();
            if below.is_empty() {
                let (place, hint) = ((self.place)(&path), nearest::hint(key, &keys(&models)));
                return Err(SimError::UnknownKey { place, key: path.to_string(), hint });
            }
            if !TAGS.contains(&&key[..]) {
                self.value(value, &path, &below)?;
            }
        }
        for key in keys(&models).into_iter().filter(|key| !given.contains_key(*key)) {
            let lacking: Vec<Model<'_>> = models.iter().filter_map(|m| m.key(key)).collect();
            if lacking.iter().all(|model| model.read_with(None).is_err()) {
                let (place, key) = ((self.place)(at), at.join(Step::Key(key.into())).to_string());
                return Err(SimError::MissingKey { place, key, want: wanted(&lacking) });
            }
        }
        Ok(())
    }

    /// The models of the variant that the table names.
    fn variant<'a>(
        &self,
        given: &Table,
        at: &KeyPath,
        models: &[Model<'a>],
    ) -> Result<Vec<Model<'a>>, SimError> {
        for tag in TAGS {
            let Some(name) = given.get(tag) else { continue };
            let has = |model: &&Model<'a>| model.value.get(tag) == Some(name);
            let same: Vec<Model<'a>> = models.iter().filter(has).cloned().collect();
            let named: Vec<Model<'_>> = models.iter().filter_map(|model| model.key(tag)).collect();
            if !same.is_empty() {
                return Ok(same);
            }
            if !named.is_empty() {
                let mut names: Vec<String> = named
                    .iter()
                    .filter_map(|model| Some(format!("`{}`", model.value.as_str()?)))
                    .collect();
                names.sort();
                names.dedup();
                let path = at.join(Step::Key(tag.into()));
                return Err(self.wrong(&path, name, names.join(" or ")));
            }
        }
        Ok(models.to_vec())
    }

    fn array(
        &self,
        entries: &[Value],
        given: &Value,
        at: &KeyPath,
        models: &[Model<'_>],
    ) -> Result<(), SimError> {
        let lists = models.iter().filter_map(|model| Some((model, model.value.as_array()?)));
        let below: Vec<Model<'_>> = lists
            .flat_map(|(model, list)| {
                list.iter().enumerate().map(|(i, value)| model.child(Step::Index(i), value))
            })
            .collect();
        // Lists of numbers are vectors in space or pairs.
        let numbers = below.iter().any(|model| model.value.is_float());
        let length = |model: &Model<'_>| model.value.as_array().map(Vec::len);
        if numbers && models.iter().all(|model| length(model) != Some(entries.len())) {
            return Err(self.wrong(at, given, wanted(models)));
        }
        for (index, entry) in entries.iter().enumerate() {
            self.value(entry, &at.join(Step::Index(index)), &below)?;
        }
        Ok(())
    }

    /// Integers must fit their type and strings with few choices be one of them; only reading
    /// them tells.
    fn scalar(&self, given: &Value, at: &KeyPath, models: &[Model<'_>]) -> Result<(), SimError> {
        let mut refusal = None;
        for model in models {
            match model.read_with(Some(given)) {
                Ok(()) => return Ok(()),
                Err(message) => refusal = Some(message),
            }
        }
        let message = refusal.unwrap_or_default();
        let want = match message.split_once("expected ").map(|(_, want)| want) {
            Some("u8") => "a whole number from 0 to 255",
            Some("u32") => "a whole number from 0 to 4294967295",
            Some("u64" | "usize") => "a whole number, at least 0",
            Some(want) => want,
            None => &message,
        };
        Err(self.wrong(at, given, want.into()))
    }

    fn wrong(&self, at: &KeyPath, given: &Value, want: String) -> SimError {
        let value = match given {
            Value::Array(entries) => format!("an array of {}", entries.len()),
            Value::Table(_) => "a table".into(),
            other => other.to_string(),
        };
        SimError::Value { place: (self.place)(at), key: at.to_string(), value, want }
    }
}

/// The keys of all models, each once, ascending.
fn keys<'a>(models: &[Model<'a>]) -> Vec<&'a str> {
    let tables = models.iter().filter_map(|model| model.value.as_table());
    let mut keys: Vec<&str> = tables.flat_map(|table| table.keys().map(String::as_str)).collect();
    keys.sort_unstable();
    keys.dedup();
    keys
}

/// What the models show, in words; each kind once where they differ.
fn wanted(models: &[Model<'_>]) -> String {
    let mut kinds: Vec<&str> = Vec::new();
    for kind in models.iter().map(|model| kind(model.value)) {
        if !kinds.contains(&kind) {
            kinds.push(kind);
        }
    }
    if kinds.is_empty() { "something else".into() } else { kinds.join(" or ") }
}

fn kind(value: &Value) -> &'static str {
    match value {
        Value::Float(_) => "a number",
        Value::Integer(_) => "a whole number",
        Value::Boolean(_) => "true or false",
        Value::Table(_) => "a table",
        Value::Array(list) if list.iter().any(Value::is_float) => match list.len() {
            2 => "an array of 2 numbers",
            _ => "an array of 3 numbers",
        },
        Value::Array(list) if list.iter().any(Value::is_integer) => "an array of whole numbers",
        Value::Array(_) => "an array of tables",
        Value::String(_) | Value::Datetime(_) => "a string",
    }
}

/// Two scenes that together have every key and every variant.
fn examples() -> Vec<Value> {
    [Phantom::Liver, Phantom::Block]
        .into_iter()
        .filter_map(|phantom| Value::try_from(example(phantom)).ok())
        .collect()
}

fn example(phantom: Phantom) -> Scene {
    let boxed = Region::Box { min: [0.0; 3], max: [1.0; 3] };
    let sphere = Region::Sphere { centre: [0.5; 3], radius_m: 0.01 };
    let material = MaterialEntry {
        label: Some(1),
        range: Some([-30.0, 150.0]),
        other: true,
        name: "tissue".into(),
        young_modulus_pa: 5e3,
        poisson_ratio: 0.45,
        density_kg_m3: 1e3,
    };
    let grab = |region| {
        ToolEntry::Grab(GrabEntry {
            region,
            hold: GrabHold::Pad,
            stiffness_n_m4: Some(1e9),
            path: vec![Key { time_s: 0.0, move_m: [0.0; 3], turn_deg: 0.0 }],
            path_csv: Some("path.csv".into()),
            turn_axis: [0.0, 0.0, 1.0],
            release_s: Some(1.0),
        })
    };
    let probe = ToolEntry::Probe(ProbeEntry {
        centre: [0.5; 3],
        radius_m: 0.01,
        path: vec![Key { time_s: 0.0, move_m: [0.0; 3], turn_deg: 0.0 }],
        path_csv: Some("path.csv".into()),
        spacing_m: Some(1e-3),
        release_s: Some(1.0),
    });
    let press = |region| {
        ToolEntry::Pressure(PressureEntry {
            region,
            pressure: vec![PressureKey { time_s: 0.0, pressure_pa: 1.0 }],
            normal: Normal::Dead,
        })
    };
    let mesh = MeshOptions {
        path: Some("tets.msh".into()),
        unit_m: 1e-3,
        base_mm: Some(32.0),
        start_level: 0,
        max_level: Some(6),
        max_vertices: 1000,
        label_level: Some(3),
        label_region: Some(match phantom {
            Phantom::Liver => boxed.clone(),
            Phantom::Block => sphere.clone(),
        }),
    };
    Scene {
        name: "example".into(),
        description: "all keys".into(),
        seed: 1,
        image: Image {
            path: Some("labels.nii.gz".into()),
            phantom: Some(phantom),
            length_mm: Some(200.0),
            size_mm: Some([10.0; 3]),
            voxel_mm: Some(2.0),
            blur_mm: Some(1.0),
            ignore_labels: vec![9],
        },
        materials: vec![material],
        void: Void::default(),
        mesh,
        fixed: vec![boxed.clone(), sphere.clone()],
        support: Support { hold: SupportHold::Elastic, stiffness_n_m4: Some(1e9) },
        gravity_m_s2: [0.0; 3],
        tools: vec![grab(boxed.clone()), grab(sphere.clone()), probe, press(boxed), press(sphere)],
        time: Time { steps: 1, step_s: 0.1 },
        dynamics: Some(Dynamics::default()),
        stages: StageNames {
            law: "rayleigh".into(),
            integrator: "implicit_euler".into(),
            gpu_adapter: Some(match phantom {
                Phantom::Liver => Adapter::Name("card".into()),
                Phantom::Block => Adapter::Index(0),
            }),
            ..StageNames::default()
        },
        refinement: Refinement::default(),
        budget: Budget { step_ms: Some(10.0), realtime: true },
        solver: Solver::default(),
        output: Output {
            surface_level: Some(9),
            surfaces: vec![SurfaceEntry { label: 1, sigma_voxels: 1.0 }],
            ..Output::default()
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_examples_are_complete_scenes() {
        let examples = examples();
        assert_eq!(examples.len(), 2);
        for value in &examples {
            check(value, &|_| "here".into()).unwrap();
            Scene::deserialize(value.clone()).unwrap();
        }
    }

    #[test]
    fn a_key_of_another_variant_is_unknown() {
        let mut value = examples().remove(0);
        let region = value["tools"][0]["region"].as_table_mut().unwrap();
        region.insert("radius_m".into(), Value::Float(1.0));
        let error = check(&value, &|_| "here".into()).unwrap_err();
        assert!(error.to_string().contains("`tools[0].region.radius_m`"), "{error}");
    }
}
