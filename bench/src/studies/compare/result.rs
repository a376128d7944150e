//! Reads any study's result: a JSON file with a list `rows`.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Map, Value};

use crate::error::{BenchError, Result};

/// A row: what tells it from others, and everything else by its path within it.
pub(super) struct Entry {
    pub key: String,
    pub failure: Option<String>,
    pub figures: BTreeMap<String, Value>,
}

/// Whole numbers that a run finds and that tell no rows apart.
const FOUND: &[&str] = &["rebuilds", "failed", "iterations", "fallbacks", "halvings", "rank"];

/// Whether a figure is another one on every run.
pub(super) fn is_measured(name: &str) -> bool {
    name.starts_with("measured.")
        || name.split('.').any(|part| {
            ["_ms", "_s", "_ns", "_us"].iter().any(|unit| part.ends_with(unit))
                || part.contains("memory")
        })
}

/// The rows of a file, or of the one file in a folder that has rows.
pub(super) fn read(path: &Path) -> Result<Vec<Entry>> {
    if !path.is_dir() {
        let rows = rows(path)?;
        let reason = "it has no list `rows`".to_owned();
        return rows.ok_or(BenchError::NoResult(path.into(), reason));
    }
    let entries = fs::read_dir(path).map_err(BenchError::at(path))?;
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    files.retain(|file| file.extension().is_some_and(|end| end == "json"));
    files.sort();
    let mut found = Vec::new();
    for file in &files {
        found.extend(rows(file)?.map(|rows| (file, rows)));
    }
    let reason = match (found.pop(), found.pop()) {
        (Some((_, rows)), None) => return Ok(rows),
        (None, _) => "no JSON file in it has rows".to_owned(),
        (Some((one, _)), Some((other, _))) => {
            format!("{} and {} have rows; name one", one.display(), other.display())
        }
    };
    Err(BenchError::NoResult(path.into(), reason))
}

fn rows(path: &Path) -> Result<Option<Vec<Entry>>> {
    let text = fs::read_to_string(path).map_err(BenchError::at(path))?;
    let value: Value = serde_json::from_str(&text)
        .map_err(|error| BenchError::NoResult(path.into(), error.to_string()))?;
    let Some(rows) = value.get("rows").and_then(Value::as_array) else { return Ok(None) };
    let rows: Vec<&Map<String, Value>> = rows.iter().filter_map(Value::as_object).collect();
    let by_words: Vec<String> = rows.iter().map(|row| words(row)).collect();
    let unique = |keys: &[String], key: &String| keys.iter().filter(|one| *one == key).count() == 1;
    let by_numbers: Vec<String> =
        rows.iter().zip(&by_words).map(|(row, words)| words.clone() + &numbers(row)).collect();
    let mut entries = Vec::new();
    for (i, row) in rows.iter().enumerate() {
        let keys = if unique(&by_words, &by_words[i]) { &by_words } else { &by_numbers };
        let mut key = keys[i].clone();
        let before = by_numbers[..i].iter().filter(|one| **one == by_numbers[i]).count();
        if before > 0 {
            key += &format!(", {} of that name", before + 1);
        }
        let mut figures = BTreeMap::new();
        flatten("", row, &mut figures);
        let failure = row.get("failure").and_then(Value::as_str).map(str::to_owned);
        entries.push(Entry { key, failure, figures });
    }
    Ok(Some(entries))
}

fn words(row: &Map<String, Value>) -> String {
    let named = row.iter().filter(|(name, _)| *name != "failure");
    named.filter_map(|(_, value)| value.as_str()).collect::<Vec<_>>().join(", ")
}

fn numbers(row: &Map<String, Value>) -> String {
    let own = |name: &&String| !FOUND.iter().any(|found| name.contains(found));
    let whole = row.iter().filter(|(name, value)| own(name) && value.is_u64());
    whole.map(|(name, value)| format!(", {name} {value}")).collect()
}

/// Everything but names and what tells where a row is from, by dotted path.
fn flatten(at: &str, row: &Map<String, Value>, figures: &mut BTreeMap<String, Value>) {
    for (name, value) in row {
        let path = if at.is_empty() { name.clone() } else { format!("{at}.{name}") };
        match value {
            _ if path == "on" || path == "failure" => {}
            Value::Object(inner) => flatten(&path, inner, figures),
            Value::String(_) if at.is_empty() => {}
            other => {
                figures.insert(path, other.clone());
            }
        }
    }
}
