//! Checks keys and types of a scene before it is read, so that errors name the key.
//!
//! The JSON schema of [`Scene`], made from its types, says which keys there are, which are required
//! and what they hold.

use std::ops::RangeInclusive;

use schemars::generate::SchemaSettings;
use serde_json::Value as Schema;
use toml::{Table, Value};

use super::key_path::{KeyPath, Step};
use crate::SimError;
use crate::scene::Scene;
use crate::scene::stage_names::ADAPTER;

/// Keys that choose among variants with different keys.
const TAGS: [&str; 2] = ["shape", "kind"];

/// Refuses unknown and missing keys, wrong types, unknown variants and integers out of range.
/// `place` says where a key stands.
pub(super) fn check(scene: &Value, place: &dyn Fn(&KeyPath) -> String) -> Result<(), SimError> {
    let settings = SchemaSettings::default().with(|settings| settings.inline_subschemas = true);
    let schema = settings.into_generator().into_root_schema_for::<Scene>().to_value();
    Checker { place }.value(scene, &KeyPath::default(), &variants([&schema]))
}

struct Checker<'a> {
    place: &'a dyn Fn(&KeyPath) -> String,
}

impl Checker<'_> {
    fn value(&self, given: &Value, at: &KeyPath, schemas: &[&Schema]) -> Result<(), SimError> {
        let fitting: Vec<&Schema> =
            schemas.iter().copied().filter(|schema| is_of_type(schema, given)).collect();
        if fitting.is_empty() {
            return Err(self.wrong(at, given, wanted(schemas)));
        }
        match given {
            Value::Table(table) => self.table(table, at, &fitting),
            Value::Array(entries) => self.array(entries, given, at, &fitting),
            Value::String(text) => {
                let names = names(&fitting);
                let is_known = names.is_empty() || names.contains(&format!("`{text}`"));
                if is_known { Ok(()) } else { Err(self.wrong(at, given, names.join(" or "))) }
            }
            Value::Integer(number) => {
                let mut limits = fitting.iter().map(|schema| whole_numbers(schema));
                match limits.find(|(range, _)| !range.contains(number)) {
                    Some((_, want)) => Err(self.wrong(at, given, want.into())),
                    None => Ok(()),
                }
            }
            _ => Ok(()),
        }
    }

    fn table(&self, given: &Table, at: &KeyPath, schemas: &[&Schema]) -> Result<(), SimError> {
        let schemas = self.variant(given, at, schemas)?;
        for (key, value) in given {
            let path = at.join(Step::Key(key.clone()));
            let below = of_key(&schemas, key);
            if below.is_empty() {
                let (place, hint) = ((self.place)(&path), hint(key, &keys(&schemas)));
                return Err(SimError::UnknownKey { place, key: path.to_string(), hint });
            }
            self.value(value, &path, &below)?;
        }
        let is_required = |key: &&str| {
            let mut lists = schemas.iter().filter_map(|schema| schema["required"].as_array());
            lists.any(|list| list.iter().any(|required| required == key))
        };
        match keys(&schemas).into_iter().filter(is_required).find(|key| !given.contains_key(*key)) {
            Some(key) => Err(self.missing(at, key, &schemas)),
            None => Ok(()),
        }
    }

    /// The schemas of the variant that the table names, where there are several.
    fn variant<'s>(
        &self,
        given: &Table,
        at: &KeyPath,
        schemas: &[&'s Schema],
    ) -> Result<Vec<&'s Schema>, SimError> {
        let Some(tag) = TAGS.into_iter().find(|tag| !of_key(schemas, tag).is_empty()) else {
            return Ok(schemas.to_vec());
        };
        let name = given.get(tag).ok_or_else(|| self.missing(at, tag, schemas))?;
        self.value(name, &at.join(Step::Key(tag.into())), &of_key(schemas, tag))?;
        let is_named = |s: &&Schema| s["properties"][tag]["const"].as_str() == name.as_str();
        Ok(schemas.iter().copied().filter(is_named).collect())
    }

    fn array(
        &self,
        entries: &[Value],
        given: &Value,
        at: &KeyPath,
        schemas: &[&Schema],
    ) -> Result<(), SimError> {
        let length = |schema: &&Schema| schema["maxItems"].as_u64();
        if schemas.iter().filter_map(length).any(|length| length != entries.len() as u64) {
            return Err(self.wrong(at, given, wanted(schemas)));
        }
        let below = variants(schemas.iter().map(|schema| &schema["items"]));
        (0..)
            .zip(entries)
            .try_for_each(|(index, entry)| self.value(entry, &at.join(Step::Index(index)), &below))
    }

    fn missing(&self, at: &KeyPath, key: &str, schemas: &[&Schema]) -> SimError {
        let (place, path) = ((self.place)(at), at.join(Step::Key(key.into())));
        SimError::MissingKey { place, key: path.to_string(), want: wanted(&of_key(schemas, key)) }
    }

    fn wrong(&self, at: &KeyPath, given: &Value, want: String) -> SimError {
        let value = match given {
            Value::Array(entries) => format!("an array of {}", entries.len()),
            Value::Table(_) => "a table".into(),
            other => other.to_string(),
        };
        SimError::value(&(self.place)(at), &at.to_string(), value, want)
    }
}

/// Each variant of schemas on its own.
fn variants<'s>(schemas: impl IntoIterator<Item = &'s Schema>) -> Vec<&'s Schema> {
    let mut all = Vec::new();
    for schema in schemas {
        match schema["anyOf"].as_array().or(schema["oneOf"].as_array()) {
            Some(list) => all.extend(variants(list)),
            None if !schema.is_null() => all.push(schema),
            None => {}
        }
    }
    all
}

/// What may stand at a key of tables.
fn of_key<'s>(tables: &[&'s Schema], key: &str) -> Vec<&'s Schema> {
    variants(tables.iter().map(|schema| &schema["properties"][key]))
}

/// The keys of all tables, each once, ascending.
fn keys<'s>(tables: &[&'s Schema]) -> Vec<&'s str> {
    let tables = tables.iter().filter_map(|schema| schema["properties"].as_object());
    let mut keys: Vec<&str> = tables.flat_map(|table| table.keys().map(String::as_str)).collect();
    keys.sort_unstable();
    keys.dedup();
    keys
}

/// The strings that are admitted, in quotation marks; none if all are.
fn names(schemas: &[&Schema]) -> Vec<String> {
    let names = schemas.iter().filter_map(|schema| schema["const"].as_str());
    names.map(|name| format!("`{name}`")).collect()
}

/// The whole numbers that are admitted, also in words.
fn whole_numbers(schema: &Schema) -> (RangeInclusive<i64>, &'static str) {
    match schema["format"].as_str() {
        Some("uint8") => (0..=255, "a whole number from 0 to 255"),
        Some("uint32") => (0..=4_294_967_295, "a whole number from 0 to 4294967295"),
        Some("uint" | "uint64") => (0..=i64::MAX, "a whole number, at least 0"),
        Some("adapter") => (0..=i64::MAX, ADAPTER),
        _ => (i64::MIN..=i64::MAX, "a whole number"),
    }
}

/// What the schemas admit, in words; each kind once where they differ.
fn wanted(schemas: &[&Schema]) -> String {
    let mut kinds: Vec<&str> = schemas.iter().filter_map(|schema| in_words(schema)).collect();
    kinds.dedup();
    kinds.join(" or ")
}

fn in_words(schema: &Schema) -> Option<&'static str> {
    Some(match json_type(schema) {
        "number" => "a number",
        "integer" => "a whole number",
        "boolean" => "true or false",
        "object" => "a table",
        "string" => "a string",
        "array" => match (json_type(&schema["items"]), schema["maxItems"].as_u64()) {
            ("number", Some(2)) => "an array of 2 numbers",
            ("number", _) => "an array of 3 numbers",
            ("integer", _) => "an array of whole numbers",
            _ => "an array of tables",
        },
        _ => return None,
    })
}

fn is_of_type(schema: &Schema, given: &Value) -> bool {
    match given {
        Value::Float(_) => json_type(schema) == "number",
        Value::Integer(_) => ["integer", "number"].contains(&json_type(schema)),
        Value::Boolean(_) => json_type(schema) == "boolean",
        Value::Table(_) => json_type(schema) == "object",
        Value::String(_) => json_type(schema) == "string",
        Value::Array(_) => json_type(schema) == "array",
        Value::Datetime(_) => false,
    }
}

fn json_type(schema: &Schema) -> &str {
    // Something optional has two types, the second of them null.
    schema["type"].as_str().or(schema["type"][0].as_str()).unwrap_or_default()
}

/// "did you mean …" where one of `valid` is near, else all of them.
fn hint(given: &str, valid: &[&str]) -> String {
    // A third of the letters may be wrong; a whole word with its unit missing counts as one.
    let limit = (given.chars().count() / 3).max(2);
    let distance = |key: &str| match key.strip_prefix(given) {
        Some(rest) if rest.starts_with('_') => 1,
        _ => strsim::osa_distance(given, key),
    };
    match valid.iter().min_by_key(|key| distance(key)) {
        Some(key) if distance(key) <= limit => format!("did you mean `{key}`?"),
        _ => {
            let keys: Vec<String> = valid.iter().map(|key| format!("`{key}`")).collect();
            format!("valid keys here are {}", keys.join(", "))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_key_is_hinted_at_or_all_of_them() {
        assert_eq!(hint("stesp", &["steps", "name"]), "did you mean `steps`?");
        let valid = ["base_mm", "max_level"];
        assert_eq!(hint("base", &valid), "did you mean `base_mm`?");
        assert_eq!(hint("colour", &valid), "valid keys here are `base_mm`, `max_level`");
    }
}
