//! A case, and how a list of them is run.

use std::panic::{AssertUnwindSafe, catch_unwind};

use super::row::{Figures, Row};
use super::selection::Shard;
use crate::error::Result;
use crate::harness::folder::Folder;
use crate::harness::machine::Place;
use crate::harness::progress::Progress;
use crate::harness::ranks;

/// What a case found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Findings {
    /// The same on every run.
    pub figures: Figures,
    /// Times and memory.
    pub measured: Figures,
}

/// Tells the fraction of a case that is done.
pub type Advance<'a> = &'a mut dyn FnMut(f64);

/// What a case does.
pub type Work<'a> = Box<dyn Fn(Advance<'_>) -> Result<Findings> + 'a>;

/// One unit of a study.
pub struct Case<'a> {
    /// Unique within the study.
    pub name: String,
    /// What it belongs to, e.g. the factor that is varied.
    pub group: String,
    /// Its work; an error, and a panic too, becomes a row with a reason.
    pub work: Work<'a>,
}

impl<'a> Case<'a> {
    /// A case.
    pub fn new(
        group: impl Into<String>,
        name: impl Into<String>,
        work: impl Fn(Advance<'_>) -> Result<Findings> + 'a,
    ) -> Self {
        Self { name: name.into(), group: group.into(), work: Box::new(work) }
    }

    fn run(&self, advance: Advance<'_>) -> Row {
        let mut row = Row::new(&self.group, &self.name);
        // What a failed case leaves half done is dropped with it.
        match catch_unwind(AssertUnwindSafe(|| (self.work)(advance))) {
            Ok(Ok(Findings { figures, measured })) => {
                (row.figures, row.measured) = (figures, measured);
            }
            Ok(Err(error)) => row.failure = Some(error.to_string()),
            Err(panic) => row.failure = Some(format!("panicked: {}", panic_message(&*panic))),
        }
        row
    }
}

fn panic_message(panic: &(dyn std::any::Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(|text| &text[..])).unwrap_or("no message")
}

/// What this process has measured.
pub enum Measured {
    /// The rows of all cases, in order.
    All(Vec<Row>),
    /// Other processes still have cases to run: a message in place of the tables.
    Waiting(String),
}

/// Runs the cases of `shard` that `folder` does not have yet, in order, keeping each as soon as it
/// is finished. Returns the rows of all cases, in order, if every one of them is there, and else
/// says how many are. Processes that mpirun has started together share them, whoever is free taking
/// the next; all wait for the last, and the rows are for the first alone.
/// # Errors
/// `BenchError::Io` if a row can't be kept, `BenchError::Damaged` if a kept one can't be read;
/// those of [`ranks`].
pub fn run(folder: &Folder, cases: &[Case<'_>], shard: Shard) -> Result<Measured> {
    let place = Place::here();
    let mut waiting = Vec::new();
    for (number, case) in cases.iter().enumerate() {
        if shard.takes(number) && folder.row(number, &case.name)?.is_none() {
            waiting.push(number);
        }
    }
    let mut progress = Progress::new(waiting.len() as f64);
    let mut turns = ranks::give_out(waiting.clone())?;
    let mut passed = waiting.iter();
    while let Some(number) = turns.next_case()? {
        let case = &cases[number];
        let mut done = 0.0;
        // Those between its own are with other processes.
        let elsewhere = passed.by_ref().take_while(|one| **one != number).count();
        progress.advance(&case.name, elsewhere as f64);
        let mut row = case.run(&mut |fraction: f64| {
            let fraction = fraction.clamp(done, 1.0);
            progress.advance(&case.name, fraction - done);
            done = fraction;
        });
        row.on = place.clone();
        progress.advance(&case.name, 1.0 - done);
        folder.keep(number, &row)?;
    }
    if !ranks::is_first() {
        return Ok(Measured::Waiting(String::new()));
    }
    let kept = cases.iter().enumerate().map(|(number, case)| folder.row(number, &case.name));
    let kept: Vec<Row> = kept.filter_map(Result::transpose).collect::<Result<_, _>>()?;
    let (done, all) = (kept.len(), cases.len());
    if done == all {
        return Ok(Measured::All(kept));
    }
    Ok(Measured::Waiting(format!(
        "{done} of {all} cases are done; the tables come with the last one (run the other parts, \
         or again without --shard, over the same folder)\n"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::BenchError;
    use std::cell::RefCell;

    /// Three cases, the second of which fails and the third of which panics; `log` tells who ran.
    fn cases<'a>(log: &'a RefCell<Vec<&'static str>>) -> [Case<'a>; 3] {
        let work = |name| {
            log.borrow_mut().push(name);
            let mut found = Findings::default();
            found.figures.put("value", 1.0 / 3.0);
            match name {
                "one" => Ok(found),
                "two" => Err(BenchError::NoRing(7)),
                _ => panic!("a bug"),
            }
        };
        ["one", "two", "three"].map(|name| Case::new("g", name, move |_| work(name)))
    }

    fn all(measured: Measured) -> Vec<Row> {
        match measured {
            Measured::All(rows) => rows,
            Measured::Waiting(message) => panic!("{message}"),
        }
    }

    fn open(root: &std::path::Path) -> Folder {
        let options = serde_json::json!({ "study": "test" });
        Folder::open(&root.join("study"), &options, false).unwrap()
    }

    #[test]
    fn failures_are_rows_and_finished_cases_are_not_run_again() {
        let root = tempfile::tempdir().unwrap();
        let log = RefCell::default();
        let rows = all(run(&open(root.path()), &cases(&log), Shard::ALL).unwrap());
        assert_eq!(*log.borrow(), ["one", "two", "three"]);
        assert_eq!(rows[0].figures.number("value"), Some(1.0 / 3.0));
        assert!(rows[1].failure.as_ref().unwrap().contains("no ring left"), "{rows:?}");
        assert_eq!(rows[2].failure.as_deref(), Some("panicked: a bug"));
        let again = all(run(&open(root.path()), &cases(&log), Shard::ALL).unwrap());
        assert_eq!((log.borrow().len(), again), (3, rows));
    }

    #[test]
    fn shards_make_the_rows_of_one_process() {
        let root = tempfile::tempdir().unwrap();
        let log = RefCell::default();
        let folder = open(root.path());
        let shard = |number| Shard { number, of: 2 };
        let part = run(&folder, &cases(&log), shard(2)).unwrap();
        assert!(matches!(part, Measured::Waiting(message) if message.starts_with("1 of 3 cases")));
        assert_eq!(*log.borrow(), ["two"]);
        let rows = all(run(&folder, &cases(&log), shard(1)).unwrap());
        assert_eq!(*log.borrow(), ["two", "one", "three"]);
        let other = tempfile::tempdir().unwrap();
        let alone = all(run(&open(other.path()), &cases(&log), Shard::ALL).unwrap());
        let known = |row: &Row| (row.case.clone(), row.figures.clone());
        assert!(rows.iter().map(known).eq(alone.iter().map(known)));
    }
}
