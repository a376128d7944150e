//! `KEY=VALUE` on top of a scene.

use toml::{Table, Value};

use super::key_path::{KeyPath, Step};
use crate::SimError;

/// One override.
pub(super) struct Override {
    /// What messages call it.
    pub place: String,
    pub path: KeyPath,
    value: Value,
}

impl Override {
    /// Reads the argument of the option `flag`.
    pub fn parse(flag: &str, argument: &str) -> Result<Self, SimError> {
        let reason = "want KEY=VALUE, e.g. time.steps=20 or materials.0.young_modulus_pa=5e3";
        let place = format!("{flag} {argument}");
        let refuse = || SimError::Syntax { place: place.clone(), reason: reason.into() };
        let (key, value) = argument.split_once('=').ok_or_else(refuse)?;
        let path = KeyPath::parse(key.trim());
        if !path.is_complete() {
            return Err(refuse());
        }
        let value = match value.parse() {
            Ok(value) => value,
            // What begins like a list, a table or a string in quotation marks was meant as one.
            Err(error) if value.trim_start().starts_with(['[', '{', '"', '\'']) => {
                let error: toml::de::Error = error;
                let reason = format!("no TOML value: {}", error.message().replace('\n', "; "));
                return Err(SimError::Syntax { place, reason });
            }
            Err(_) => Value::String(value.into()),
        };
        Ok(Self { place, path, value })
    }

    /// Puts the value in its place; missing tables and the next entry of a list are made.
    pub fn apply(&self, scene: &mut Value) -> Result<(), SimError> {
        let steps = self.path.steps();
        let mut at = scene;
        for (depth, step) in steps.iter().enumerate() {
            let empty = match steps.get(depth + 1) {
                Some(Step::Index(_)) => Value::Array(Vec::new()),
                _ => Value::Table(Table::new()),
            };
            let here = self.path.head(depth);
            at = match (at, step) {
                (Value::Table(table), Step::Key(key)) => table.entry(key.clone()).or_insert(empty),
                (Value::Array(list), &Step::Index(index)) => {
                    let len = list.len();
                    if index > len {
                        let reason = format!("{here} has {len} entries, the next one is {len}");
                        return Err(self.refuse(reason));
                    }
                    if index == len {
                        list.push(empty);
                    }
                    &mut list[index]
                }
                (_, Step::Key(key)) => {
                    return Err(self.refuse(format!("{here} is no table, it has no `{key}`")));
                }
                (_, Step::Index(index)) => {
                    return Err(self.refuse(format!("{here} is no list, it has no entry {index}")));
                }
            };
        }
        *at = self.value.clone();
        Ok(())
    }

    fn refuse(&self, reason: String) -> SimError {
        SimError::Syntax { place: self.place.clone(), reason }
    }
}
