//! Rows as CSV.

use serde::Serialize;
use serde_json::{Map, Value, json};

/// Rows as lists of named values. Fields that are no structs have no names and give an empty list.
pub(crate) fn objects(rows: &[impl Serialize]) -> Vec<Map<String, Value>> {
    let object = |row| json!(row).as_object().cloned().unwrap_or_default();
    rows.iter().map(object).collect()
}

/// A line per row under the names of all fields, in the order of their first appearance; what a row
/// has not is empty. Fields within fields have columns of their own.
pub(crate) fn csv(rows: &[Map<String, Value>]) -> String {
    let flat: Vec<Map<String, Value>> = rows.iter().map(|row| flattened(row, rows)).collect();
    let columns = super::each_once(flat.iter().flat_map(Map::keys));
    let mut writer = csv::Writer::from_writer(Vec::new());
    // Memory takes everything.
    let _ = writer.write_record(&columns);
    for row in &flat {
        let _ = writer.write_record(columns.iter().map(|&name| cell(row.get(name))));
    }
    String::from_utf8(writer.into_inner().unwrap_or_default()).unwrap_or_default()
}

/// A value as it stands in tables; nothing for what there is not.
pub(crate) fn cell(value: Option<&Value>) -> String {
    match value {
        None | Some(Value::Null) => String::new(),
        Some(Value::String(text)) => text.clone(),
        Some(value) => value.to_string(),
    }
}

/// `split_ms: { p50, p99 }` as `split_p50_ms`, `split_p99_ms`; where a row has nothing in place of
/// such a field its columns are those of another row of `rows`.
fn flattened(row: &Map<String, Value>, rows: &[Map<String, Value>]) -> Map<String, Value> {
    let mut flat = Map::new();
    for (name, value) in row {
        let mut parts = rows.iter().filter_map(|row| row.get(name)?.as_object());
        let Some(parts) = value.as_object().or_else(|| parts.next().filter(|_| value.is_null()))
        else {
            flat.insert(name.clone(), value.clone());
            continue;
        };
        for part in parts.keys() {
            let name = match name.strip_suffix("_ms") {
                Some(name) => format!("{name}_{part}_ms"),
                None => format!("{name}_{part}"),
            };
            flat.insert(name, value.get(part).cloned().unwrap_or_default());
        }
    }
    flat
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_within_fields_are_columns_and_what_is_missing_is_empty() {
        let rows =
            [json!({ "a": 1.5, "b_ms": null }), json!({ "b_ms": { "p50": 2 }, "c": "x, y" })];
        assert_eq!(csv(&objects(&rows)), "a,b_p50_ms,c\n1.5,,\n,2,\"x, y\"\n");
    }
}
