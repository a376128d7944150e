//! The scaffold of a study.

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::cells::{csv, objects};
use crate::error::BenchError;
use crate::harness::arguments::Destination;
use crate::harness::folder::Folder;

/// A study: what it measures, row by row, and how its rows are summed up.
///
/// [`run`] does the rest: folder, CSV, JSON, tables and charts.
///
/// ```
/// use serde::Serialize;
/// use yawara_bench::BenchError;
/// use yawara_bench::harness::Folder;
/// use yawara_bench::harness::arguments::Destination;
/// use yawara_bench::harness::report::{Measured, Study, Summary, run};
///
/// #[derive(Serialize)]
/// struct Row {
///     terms: usize,
///     error: f64,
/// }
///
/// struct Leibniz;
///
/// impl Study for Leibniz {
///     type Row = Row;
///
///     fn name(&self) -> &str {
///         "leibniz"
///     }
///
///     fn measure(&self, _: &Folder) -> Result<Measured<Row>, BenchError> {
///         let term = |i: usize| if i % 2 == 0 { 1.0 } else { -1.0 } / (2 * i + 1) as f64;
///         let error = |n: usize| (4.0 * (0..n).map(term).sum::<f64>() - std::f64::consts::PI).abs();
///         let rows = [10, 100].map(|terms| Row { terms, error: error(terms) });
///         Ok(Measured::All(rows.into()))
///     }
///
///     fn summary(&self, _: &Folder, rows: &[Row]) -> Result<Summary, BenchError> {
///         Ok(Summary::new(format!("{} rows\n", rows.len())))
///     }
/// }
///
/// let out = std::env::temp_dir().join(format!("leibniz-{}", std::process::id()));
/// assert_eq!(run(&Leibniz, &Destination { out: out.clone(), force: false })?, "2 rows\n");
/// assert!(std::fs::read_to_string(out.join("leibniz.csv"))?.starts_with("terms,error\n10,"));
/// # std::fs::remove_dir_all(out)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Study {
    /// A row of its tables: a struct with named fields. A field that serialises to nothing is an
    /// empty cell; a percentile `p50` in a field `x_ms` is the column `x_p50_ms`.
    type Row: Serialize;

    /// The name on the command line, and of its files.
    fn name(&self) -> &str;

    /// What the figures depend on, for a study that goes on where an earlier run of the same
    /// options ended; `None` for one that runs as a whole.
    fn options(&self) -> Option<Value> {
        None
    }

    /// Measures.
    ///
    /// # Errors
    /// Whatever ends the study; nothing is written then but finished cases.
    fn measure(&self, folder: &Folder) -> Result<Measured<Self::Row>, BenchError>;

    /// What is said of the rows.
    ///
    /// # Errors
    /// As [`measure`](Self::measure).
    fn summary(&self, folder: &Folder, rows: &[Self::Row]) -> Result<Summary, BenchError>;
}

/// What this process has measured.
pub enum Measured<R> {
    /// All rows.
    All(Vec<R>),
    /// Other processes still have cases to run: a message in place of the tables.
    Waiting(String),
}

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

/// Runs a study, writes its files and returns what is printed.
///
/// # Errors
/// Those of [`Folder`] and of the study; nothing is left behind then but finished cases.
pub fn run<S: Study>(study: &S, destination: &Destination) -> Result<String, BenchError> {
    let Destination { out, force } = destination;
    let folder = match study.options() {
        Some(options) => Folder::open(out, &options, *force)?,
        None => Folder::create(out, *force)?,
    };
    let rows = match study.measure(&folder)? {
        Measured::All(rows) => rows,
        Measured::Waiting(message) => return Ok(message),
    };
    let Summary { text, mut fields, table, files } = study.summary(&folder, &rows)?;
    let name = study.name();
    let mut rows = objects(&rows);
    folder.write(&format!("{name}.csv"), csv(table.as_ref().unwrap_or(&rows)))?;
    // In JSON a figure that there is not is left out.
    rows.iter_mut().for_each(|row| row.retain(|_, value| !value.is_null()));
    fields.insert("rows".into(), json!(rows));
    folder.write(&format!("{name}.json"), format!("{:#}\n", Value::Object(fields)))?;
    folder.write(&format!("{name}.md"), &text)?;
    for (name, content) in files {
        if let Some(content) = content {
            folder.write(&name, content)?;
        }
    }
    folder.tidy();
    Ok(text)
}
