//! `KEY=VALUE` on top of a scene.

use toml::{Table, Value};

use super::key_path::{KeyPath, Step};
use crate::SimError;

/// One override.
pub(super) struct Override {
    argument: String,
    path: KeyPath,
    value: Value,
}

impl Override {
    pub fn parse(argument: &str) -> Result<Self, SimError> {
        let refuse = || SimError::Override {
            argument: argument.into(),
            reason: "want KEY=VALUE, e.g. time.steps=20 or materials.0.young_modulus_pa=5e3".into(),
        };
        let (key, value) = argument.split_once('=').ok_or_else(refuse)?;
        let path = KeyPath::parse(key.trim());
        if !path.is_complete() {
            return Err(refuse());
        }
        let value = value.parse().unwrap_or_else(|_| Value::String(value.into()));
        Ok(Self { argument: argument.into(), path, value })
    }

    pub fn argument(&self) -> &str {
        &self.argument
    }

    pub fn path(&self) -> &KeyPath {
        &self.path
    }

    /// True where what stands at `path` comes from this override.
    pub fn sets(&self, path: &KeyPath) -> bool {
        path.starts_with(&self.path)
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
        SimError::Override { argument: self.argument.clone(), reason }
    }
}
