//! One combination of stages.

use yawara::scene::{Scene, StageNames};
use yawara::{SimError, Stages, scene_file};

use crate::error::{BenchError, Result};

/// Makes the stages of a run from the names that its scene has.
type MakeStages = Box<dyn Fn(&StageNames) -> Result<Stages, SimError>>;

/// A combination of stages, thresholds and levels that takes part in a study: a scene's values
/// replaced by others, and if need be stages that no scene has a name for.
///
/// ```no_run
/// use yawara::Stages;
/// use yawara_bench::pareto::Candidate;
///
/// let named = Candidate::new("named", "coarse", &["refinement.split_above=1e-4"]);
/// let own = Candidate::new("own", "mine", &[]).with_stages(|names| {
///     let mut stages = Stages::by_name(names)?;
///     stages.homogenisation = Box::new(yawara_embed::Linear);
///     Ok(stages)
/// });
/// ```
pub struct Candidate {
    /// The factor that it varies.
    pub group: String,
    /// Its name, unique in a study.
    pub name: String,
    /// What it replaces in the scene, `KEY=VALUE` as for `yawara run --set`.
    pub overrides: Vec<String>,
    make: MakeStages,
}

impl Candidate {
    /// The stages that the scene names after `overrides`.
    pub fn new(group: &str, name: &str, overrides: &[&str]) -> Self {
        Self {
            group: group.into(),
            name: name.into(),
            overrides: overrides.iter().map(|&one| one.into()).collect(),
            make: Box::new(Stages::by_name),
        }
    }

    /// With stages that `make` makes, from the names of the scene.
    pub fn with_stages(
        mut self,
        make: impl Fn(&StageNames) -> Result<Stages, SimError> + 'static,
    ) -> Self {
        self.make = Box::new(make);
        self
    }

    /// Reads `NAME: KEY=VALUE, KEY=VALUE`; a comma within brackets, braces or quotes separates
    /// nothing.
    /// # Errors
    /// [`BenchError::Combination`] if there is no name or no value.
    pub fn parse(text: &str) -> Result<Self> {
        let refused = || BenchError::Combination(text.into());
        let (name, values) = text.split_once(':').ok_or_else(refused)?;
        let overrides = split(values);
        let complete = overrides.iter().all(|one| one.contains('='));
        if name.trim().is_empty() || overrides.is_empty() || !complete {
            return Err(refused());
        }
        let overrides: Vec<&str> = overrides.iter().map(String::as_str).collect();
        Ok(Self::new("named", name.trim(), &overrides))
    }

    /// The scene `name` with `base` and then this candidate's values in place of its own.
    /// # Errors
    /// [`BenchError::Sim`] if the scene refuses a value.
    pub fn scene(&self, name: &str, base: &[String]) -> Result<Scene> {
        let overrides = [base, &self.overrides].concat();
        Ok(scene_file::load(name, &overrides)?.0)
    }

    /// Its stages.
    /// # Errors
    /// [`BenchError::Sim`] if there are none of these names, or they don't go together.
    pub fn stages(&self, scene: &Scene) -> Result<Stages> {
        Ok((self.make)(&scene.stages)?)
    }
}

/// The parts of a list between commas outside brackets, braces and quotes.
fn split(list: &str) -> Vec<String> {
    let (mut parts, mut depth, mut quoted) = (vec![String::new()], 0i32, false);
    for c in list.chars() {
        match c {
            '"' => quoted = !quoted,
            '[' | '{' if !quoted => depth += 1,
            ']' | '}' if !quoted => depth -= 1,
            ',' if !quoted && depth == 0 => {
                parts.push(String::new());
                continue;
            }
            _ => {}
        }
        if let Some(last) = parts.last_mut() {
            last.push(c);
        }
    }
    parts.iter().map(|part| part.trim().to_owned()).filter(|part| !part.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn combinations_are_read_as_they_are_typed() {
        let text = "row only: stages.corotation=row, gravity_m_s2=[0, 0, -1],description=\"a, b\"";
        let candidate = Candidate::parse(text).unwrap();
        assert_eq!((&candidate.group[..], &candidate.name[..]), ("named", "row only"));
        let want = ["stages.corotation=row", "gravity_m_s2=[0, 0, -1]", "description=\"a, b\""];
        assert_eq!(candidate.overrides, want);
        let scene = candidate.scene("beam", &["time.steps=3".into()]).unwrap();
        assert_eq!((scene.time.steps, &scene.stages.corotation[..]), (3, "row"));
        for text in ["", "x", "x:", ": a=1", "x: a=1, b", "stages.corotation=row"] {
            let error = Candidate::parse(text).err().unwrap().to_string();
            assert!(error.contains("NAME: KEY=VALUE"), "{error}");
        }
    }

    #[test]
    fn what_the_scene_refuses_is_said_as_the_command_line_says_it() {
        let mistyped = Candidate::new("g", "n", &["stages.corotatio=row"]);
        let error = mistyped.scene("beam", &[]).err().unwrap().to_string();
        assert!(error.contains("did you mean `corotation`?"), "{error}");
        let candidate = Candidate::new("g", "n", &["stages.corotation=none"]);
        let scene = candidate.scene("beam", &[]).unwrap();
        assert_eq!(candidate.stages(&scene).unwrap().forces.name(), "none");
    }
}
