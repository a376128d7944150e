//! Paths of keys and list positions in a scene.

use std::fmt;

/// One step down.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Step {
    Key(String),
    Index(usize),
}

/// A place in a scene, e.g. `materials[2].poisson_ratio`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct KeyPath(Vec<Step>);

impl KeyPath {
    /// From `materials[2].poisson_ratio` or `materials.2.poisson_ratio`.
    pub fn parse(text: &str) -> Self {
        let dotted = text.replace('[', ".").replace(']', "");
        Self(
            dotted
                .split('.')
                .map(|part| match part.parse() {
                    Ok(index) => Step::Index(index),
                    Err(_) => Step::Key(part.trim().into()),
                })
                .collect(),
        )
    }

    pub fn steps(&self) -> &[Step] {
        &self.0
    }

    pub fn is_complete(&self) -> bool {
        let blank = Step::Key(String::new());
        matches!(self.0.first(), Some(Step::Key(_))) && !self.0.contains(&blank)
    }

    pub fn starts_with(&self, other: &Self) -> bool {
        self.0.starts_with(&other.0)
    }

    pub fn join(&self, step: Step) -> Self {
        let mut steps = self.0.clone();
        steps.push(step);
        Self(steps)
    }

    /// The first `len` steps.
    pub fn head(&self, len: usize) -> Self {
        Self(self.0[..len].to_vec())
    }
}

impl fmt::Display for KeyPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, step) in self.0.iter().enumerate() {
            match step {
                Step::Key(key) if i == 0 => f.write_str(key)?,
                Step::Key(key) => write!(f, ".{key}")?,
                Step::Index(index) => write!(f, "[{index}]")?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_spellings_of_an_index_are_one_path() {
        for text in ["tools[0].path[12].move_m", "tools.0.path.12.move_m"] {
            assert_eq!(KeyPath::parse(text).to_string(), "tools[0].path[12].move_m");
        }
        for incomplete in ["", ".a", "a..b", "a.", "0.a"] {
            assert!(!KeyPath::parse(incomplete).is_complete(), "{incomplete}");
        }
    }
}
