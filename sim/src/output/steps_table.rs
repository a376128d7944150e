//! Reads the table of steps back.

use std::collections::HashMap;
use std::path::Path;
use std::str::FromStr;

use crate::SimError;
use crate::report::{StageTimes, StepReport, ToolReport};

/// The most steps of a table.
const MOST_STEPS: usize = 1_000_000;

/// The steps of a `steps.csv`, numbers as they were written; a goal and where tools are it does not say.
/// Tools have the names of `kinds`, in their order.
///
/// # Errors
/// [`SimError::Io`]; [`SimError::Syntax`] with the line: a column that is missing or there twice, a cell that
/// is no such number, steps that do not count up from 1, times that do not ascend.
pub(crate) fn read_steps(path: &Path, kinds: &[&'static str]) -> Result<Vec<StepReport>, SimError> {
    let text = std::fs::read_to_string(path).map_err(|source| SimError::Io(path.into(), source))?;
    let mut lines = (1..).zip(text.lines());
    let header = lines.next().map_or("", |(_, line)| line);
    let columns: HashMap<&str, usize> = header.split(',').zip(0..).collect();
    let title = Row { path, line: 1, columns: &columns, cells: header.split(',').collect() };
    if let Some(twice) = (0..).zip(&title.cells).find(|(at, name)| columns[*name] != *at) {
        return Err(title.wrong(format!("two columns are {:?}", twice.1)));
    }
    // A table without rows says nothing of its columns otherwise.
    title.has(&["step", "time_s"])?;
    let mut steps: Vec<StepReport> = Vec::new();
    for (line, text) in lines {
        let cells: Vec<&str> = text.split(',').collect();
        let row = Row { path, line, columns: &columns, cells };
        if row.cells.len() != columns.len() {
            let reason = format!("{} cells, want {}, one a column", row.cells.len(), columns.len());
            return Err(row.wrong(reason));
        }
        let step = row.step(kinds)?;
        let before = steps.last().map_or(0.0, |last| last.time_s);
        if step.step != steps.len() + 1 {
            return Err(row.wrong(format!("step is {}, want {}", step.step, steps.len() + 1)));
        }
        if !(step.time_s >= before) {
            return Err(row.wrong(format!("time_s is {}, want at least {before}", step.time_s)));
        }
        if steps.len() == MOST_STEPS {
            return Err(row.wrong(format!("more than {MOST_STEPS} steps")));
        }
        steps.push(step);
    }
    Ok(steps)
}

/// A line of the table.
struct Row<'a> {
    path: &'a Path,
    line: usize,
    columns: &'a HashMap<&'a str, usize>,
    cells: Vec<&'a str>,
}

impl Row<'_> {
    fn wrong(&self, reason: String) -> SimError {
        SimError::Syntax { place: format!("{}, line {}", self.path.display(), self.line), reason }
    }

    fn has(&self, names: &[&str]) -> Result<(), SimError> {
        match names.iter().find(|name| !self.columns.contains_key(*name)) {
            Some(name) => Err(self.wrong(format!("no column {name}"))),
            None => Ok(()),
        }
    }

    /// A cell, empty or not.
    fn cell(&self, name: &str) -> Result<&str, SimError> {
        self.has(&[name])?;
        Ok(self.cells[self.columns[name]])
    }

    fn get<T: FromStr>(&self, name: &str) -> Result<T, SimError> {
        let cell = self.cell(name)?;
        let shown: String = cell.chars().take(40).collect();
        cell.parse().map_err(|_| self.wrong(format!("{name} is {shown:?}, want a number")))
    }

    /// A finite number.
    fn real(&self, name: &str) -> Result<f64, SimError> {
        let value: f64 = self.get(name)?;
        match value.is_finite() {
            true => Ok(value),
            false => Err(self.wrong(format!("{name} is {value}, want a finite number"))),
        }
    }

    /// One that may be absent.
    fn maybe(&self, name: &str) -> Result<Option<f64>, SimError> {
        if self.cell(name)?.is_empty() { Ok(None) } else { self.real(name).map(Some) }
    }

    fn vector(&self, name: &str, unit: &str) -> Result<[f64; 3], SimError> {
        let of = |axis| self.real(&format!("{name}_{axis}_{unit}"));
        Ok([of("x")?, of("y")?, of("z")?])
    }

    fn step(&self, kinds: &[&'static str]) -> Result<StepReport, SimError> {
        let count =
            (0..).take_while(|i| self.columns.contains_key(&format!("tool{i}_force_x_n")[..]));
        let tools = count.map(|i: usize| {
            let name = |what: &str| format!("tool{i}_{what}");
            Ok(ToolReport {
                kind: kinds.get(i).copied().unwrap_or("tool"),
                force_n: self.vector(&name("force"), "n")?,
                force_error_n: self.maybe(&name("force_error_n"))?,
                torque_n_m: self.vector(&name("torque"), "n_m")?,
                contacts: self.get(&name("contacts"))?,
                penetration_m: self.real(&name("penetration_m"))?,
                reference_mm: [f64::NAN; 3],
                ..ToolReport::default()
            })
        });
        Ok(StepReport {
            tools: tools.collect::<Result<_, SimError>>()?,
            step: self.get("step")?,
            time_s: self.real("time_s")?,
            vertices: self.get("vertices")?,
            tets: self.get("tets")?,
            splits: self.get("splits")?,
            merges: self.get("merges")?,
            edits: 0,
            waiting: self.get("waiting")?,
            iterations: self.get("iterations")?,
            substeps: self.get("substeps")?,
            fallbacks: self.get("fallbacks")?,
            // That of a step that blew up is no finite number.
            residual: self.get("residual")?,
            converged: self.get("converged")?,
            failure: None,
            error_estimate: self.maybe("error_estimate")?,
            goal: None,
            force_n: self.vector("force", "n")?,
            times: StageTimes {
                tool_ms: self.real("tool_ms")?,
                solve_ms: self.real("solve_ms")?,
                indicator_ms: self.real("indicator_ms")?,
                remesh_ms: self.real("remesh_ms")?,
                inverse_ms: self.real("inverse_ms")?,
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::steps_csv::tests::full_step;
    use super::super::steps_csv::{header, line};
    use super::*;

    fn step(number: usize) -> StepReport {
        let mut step = StepReport {
            step: number,
            time_s: 0.1 * number as f64,
            converged: number != 2,
            error_estimate: (number == 1).then_some(0.0625),
            goal: None,
            ..full_step()
        };
        (step.tools[0].kind, step.tools[1].kind) = ("grab", "probe");
        step
    }

    fn read(text: &str) -> Result<Vec<StepReport>, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("steps.csv");
        std::fs::write(&path, text).unwrap();
        read_steps(&path, &["grab", "probe"]).map_err(|error| error.to_string())
    }

    #[test]
    fn a_table_says_what_was_written() {
        let text = [header(&step(1)), line(&step(1)), line(&step(2))].concat();
        let mut found = read(&text).unwrap();
        for tool in found.iter_mut().flat_map(|step| &mut step.tools) {
            assert!(tool.reference_mm.iter().all(|x| x.is_nan()), "the table has no places");
            tool.reference_mm = [0.0; 3];
        }
        assert_eq!(found, [step(1), step(2)]);
        assert_eq!(read(&header(&step(1))).unwrap(), []);
    }

    #[test]
    fn a_damaged_table_is_refused_by_its_line() {
        let text = [header(&step(1)), line(&step(1)), line(&step(2))].concat();
        for (bad, want) in [
            (String::new(), "line 1: no column step"),
            ("GIF89a".into(), "line 1: no column step"),
            (text[..text.len() - 40].into(), "line 3: 33 cells, want 41"),
            (text.replace("time_s", "time_h"), "line 1: no column time_s"),
            (text.replace("residual", "residue"), "line 2: no column residual"),
            ("step,step,time_s\n1,0.5".into(), "line 1: two columns are \"step\""),
            (text.replace("1e300", "1e999"), "force_z_n is inf, want a finite number"),
            (text.replace("3000", "-3000"), "line 2: tets is \"-3000\", want a number"),
            (text.replace("\n2,", "\n7,"), "line 3: step is 7, want 2"),
            (text.replace("\n2,0.2", "\n2,0.01"), "line 3: time_s is 0.01, want at least 0.1"),
            (text.replace("true", "maybe"), "line 2: converged is \"maybe\""),
        ] {
            let message = read(&bad).unwrap_err();
            assert!(message.contains(want), "{want}: {message}");
        }
    }
}
