//! What is known of a finished case.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::harness::machine::Place;
use crate::harness::report::cell;

/// Named figures in the order in which they were put.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Figures(Map<String, Value>);

impl Figures {
    /// Adds a figure: a number, a truth or a word. What is not finite becomes null.
    pub fn put(&mut self, name: &str, value: impl Into<Value>) {
        self.0.insert(name.into(), value.into());
    }

    /// The figure of that name, if it is a number.
    pub fn number(&self, name: &str) -> Option<f64> {
        self.0.get(name)?.as_f64()
    }

    /// The figure of that name.
    pub fn get(&self, name: &str) -> Option<&Value> {
        self.0.get(name)
    }

    /// All names, in order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(String::as_str)
    }
}

/// A finished case.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// What it belongs to.
    pub group: String,
    /// Its name.
    pub case: String,
    /// Why it has no figures.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
    /// The same on every run.
    #[serde(default)]
    pub figures: Figures,
    /// Times and memory.
    #[serde(default)]
    pub measured: Figures,
    /// Where it ran.
    #[serde(default)]
    pub on: Place,
}

impl Row {
    /// A row without any figure yet.
    pub fn new(group: &str, case: &str) -> Self {
        Self { group: group.into(), case: case.into(), ..Self::default() }
    }

    /// A figure or a measurement, by name.
    pub fn value(&self, name: &str) -> Option<&Value> {
        self.figures.get(name).or_else(|| self.measured.get(name))
    }

    /// The same, if it is a number.
    pub fn number(&self, name: &str) -> Option<f64> {
        self.value(name)?.as_f64()
    }

    /// A figure or a measurement as it stands in tables; empty where there is none.
    pub fn cell(&self, name: &str) -> String {
        cell(self.value(name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_reads_back_to_the_last_bit_and_what_is_not_finite_is_null() {
        let mut row = Row::new("group", "case");
        row.figures.put("third", 1.0 / 3.0);
        row.figures.put("tiny", 1e-310);
        row.figures.put("lost", f64::NAN);
        row.measured.put("ms", 12);
        let text = serde_json::to_string(&row).unwrap();
        let back: Row = serde_json::from_str(&text).unwrap();
        assert_eq!(back, row);
        assert_eq!(back.number("third"), Some(1.0 / 3.0));
        assert_eq!((back.number("lost"), back.cell("lost")), (None, String::new()));
        assert_eq!(back.cell("ms"), "12");
        assert_eq!(back.figures.names().collect::<Vec<_>>(), ["third", "tiny", "lost"]);
    }
}
