//! Which part of a study a process runs, and where to.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;

/// Where a study of cases writes and what of it this process runs.
#[derive(Args, Clone, Debug)]
pub struct Selection {
    /// The study's folder: new, empty, or of an earlier run with the same options, which goes on
    /// where it was.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Drop what an earlier run left in DIR and start anew; files of other names stay.
    #[arg(long)]
    pub force: bool,
    /// Run the I-th of N parts only; all parts may share DIR at the same time. Whichever finishes
    /// last writes the tables, as does a run without --shard afterwards. Under mpirun (feature
    /// `mpi`) no parts are needed: every process takes the next case when it is free.
    #[arg(long, value_name = "I/N", default_value = "1/1")]
    pub shard: Shard,
}

/// Which of a study's cases are run, and where to.
#[derive(Args, Clone, Debug)]
pub struct CaseArguments {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub selection: Selection,
    /// Fewer values or steps, and less time for each; the study's page says which.
    #[arg(long)]
    pub quick: bool,
}

/// The `number`-th of `of` parts: every `of`-th case, from the `number`-th on (from 1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which part, from 1.
    pub number: usize,
    /// How many parts there are.
    pub of: usize,
}

impl Shard {
    /// The whole.
    pub const ALL: Self = Self { number: 1, of: 1 };

    /// Whether the case of that number, from 0, is of this part.
    pub fn takes(self, case: usize) -> bool {
        case % self.of == self.number - 1
    }
}

/// The most parts.
const MOST: usize = 10_000;

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text.split_once('/').and_then(|(number, of)| {
            Some(Self { number: number.parse().ok()?, of: of.parse().ok()? })
        });
        let valid = parsed.filter(|part| (1..=part.of).contains(&part.number) && part.of <= MOST);
        valid.ok_or_else(|| {
            format!("{text:?} is no part, want I/N with 1 <= I <= N <= {MOST}, e.g. 2/4")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_case_is_of_one_part_and_nonsense_is_refused() {
        for case in 0..20 {
            let parts: Vec<usize> =
                (1..=3).filter(|&number| Shard { number, of: 3 }.takes(case)).collect();
            assert_eq!(parts, [case % 3 + 1]);
        }
        assert!((0..5).all(|case| Shard::ALL.takes(case)));
        assert_eq!("2/4".parse(), Ok(Shard { number: 2, of: 4 }));
        for text in ["0/4", "5/4", "1", "a/b", "1/0", "-1/2", "1/99999"] {
            let error = text.parse::<Shard>().unwrap_err();
            assert!(error.contains(text) && error.contains("2/4"), "{error}");
        }
    }
}
