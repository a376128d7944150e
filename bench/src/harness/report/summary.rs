//! What is said of a study's rows, and the files that are made of both.

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::cells::{csv, objects};
use crate::error::Result;
use crate::harness::folder::Folder;

/// What a study says of its rows.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// The tables in Markdown: NAME.md, and what is printed.
    pub text: String,
    /// Fields of NAME.json beside the rows.
    pub fields: Map<String, Value>,
    /// Lines of NAME.csv where they are not the rows themselves.
    pub table: Option<Vec<Map<String, Value>>>,
    /// Further files by name; one without content is left out.
    pub files: Vec<(String, Option<String>)>,
}

impl Summary {
    /// A text alone.
    pub fn new(text: String) -> Self {
        Self { text, ..Self::default() }
    }

    /// With a field of the JSON file.
    #[must_use]
    pub fn with(mut self, name: &str, value: impl Serialize) -> Self {
        self.fields.insert(name.into(), json!(value));
        self
    }

    /// With a further file, if there is anything in it.
    #[must_use]
    pub fn with_file(mut self, name: impl Into<String>, content: Option<String>) -> Self {
        self.files.push((name.into(), content));
        self
    }
}

/// Writes the files of a study: NAME.csv, NAME.json, NAME.md and what the summary has besides.
/// Returns what is printed.
///
/// A row is a struct with named fields: a field that serialises to nothing is an empty cell of the
/// CSV file and is left out in JSON; a percentile `p50` in a field `x_ms` is the column `x_p50_ms`.
///
/// ```
/// use serde::Serialize;
/// use yawara_bench::harness::Folder;
/// use yawara_bench::harness::report::{Summary, write};
///
/// #[derive(Serialize)]
/// struct Row {
///     terms: usize,
///     error: f64,
/// }
///
/// let term = |i: usize| if i % 2 == 0 { 1.0 } else { -1.0 } / (2 * i + 1) as f64;
/// let error = |n: usize| (4.0 * (0..n).map(term).sum::<f64>() - std::f64::consts::PI).abs();
/// let rows = [10, 100].map(|terms| Row { terms, error: error(terms) });
/// let out = std::env::temp_dir().join(format!("leibniz-{}", std::process::id()));
/// let summary = Summary::new(format!("{} rows\n", rows.len()));
/// assert_eq!(write(&Folder::create(&out, false)?, "leibniz", &rows, summary)?, "2 rows\n");
/// assert!(std::fs::read_to_string(out.join("leibniz.csv"))?.starts_with("terms,error\n10,"));
/// # std::fs::remove_dir_all(out)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
/// # Errors
/// `BenchError::Io`.
pub fn write(
    folder: &Folder,
    name: &str,
    rows: &[impl Serialize],
    summary: Summary,
) -> Result<String> {
    let Summary { text, mut fields, table, files } = summary;
    let mut rows = objects(rows);
    folder.write(&format!("{name}.csv"), csv(table.as_ref().unwrap_or(&rows)))?;
    rows.iter_mut().for_each(|row| row.retain(|_, value| !value.is_null()));
    fields.insert("rows".into(), json!(rows));
    folder.write(&format!("{name}.json"), format!("{:#}\n", Value::Object(fields)))?;
    folder.write(&format!("{name}.md"), &text)?;
    for (name, content) in files.iter().filter_map(|(name, text)| Some((name, text.as_ref()?))) {
        folder.write(name, content)?;
    }
    folder.tidy();
    Ok(text)
}
