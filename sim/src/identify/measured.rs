//! What was measured: where points of the body have gone, and with what forces.

use std::path::Path;

use crate::error::SimError;
use crate::scene::Table;
use crate::scene::checks::FARTHEST_M;

/// A point's move or a tool's force at some time of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurement {
    /// When, s: the end of one of the scene's steps.
    pub time_s: f64,
    /// Of what.
    pub of: Measured,
    /// By scanner axis, mm or N; none where that was not measured.
    pub values: [Option<f64>; 3],
    /// Standard deviation of the noise of each component, mm or N; of all measurements or of none. Without it the noise is taken
    /// as it is left by the fit, forces in percents of the largest as millimetres.
    pub sd: Option<f64>,
    /// Where it comes from, for messages: a file and line.
    pub place: String,
}

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Measured {
    /// The move of the point of the material that rests here, scanner RAS, mm.
    Move([f64; 3]),
    /// The force of a tool on the body, by its number in the scene.
    Force(usize),
}

const TABLE: Table<'_> = Table {
    key: "--measured",
    columns: &[
        "time_s", "x_mm", "y_mm", "z_mm", "ux_mm", "uy_mm", "uz_mm", "sd_mm", "tool", "fx_n",
        "fy_n", "fz_n", "sd_n",
    ],
    needed: 1,
};

/// Reads a table of measurements. Each line has a time and either a point at rest with how far it has moved
/// (`time_s, x_mm, y_mm, z_mm, ux_mm, uy_mm, uz_mm, sd_mm`) or a tool with its force on the body (`time_s, tool, fx_n, fy_n,
/// fz_n, sd_n`), in scanner axes; components that were not measured are left empty.
///
/// # Errors
/// [`SimError::Io`]; [`SimError::Value`] with the file, the line, the value and what it has to be.
pub fn read(file: &Path) -> Result<Vec<Measurement>, SimError> {
    let mut found = Vec::new();
    TABLE.read(file, &mut |values, place| {
        found.push(measurement(values, place)?);
        Ok(())
    })?;
    Ok(found)
}

fn measurement(values: &[Option<f64>], place: &str) -> Result<Measurement, SimError> {
    let wrong = |at: usize, want: &str| {
        let value = values[at].map_or("missing".into(), |value| format!("{value:?}"));
        SimError::value(place, TABLE.columns[at], value, want)
    };
    let three = |first: usize| [0, 1, 2].map(|axis| values[first + axis]);
    let time_s = values[0].filter(|time| *time > 0.0).ok_or_else(|| wrong(0, "above 0"))?;
    let is_move = values[1..8].iter().any(Option::is_some);
    if is_move == values[8..].iter().any(Option::is_some) {
        let value = if is_move { "a point and a tool" } else { "neither a point nor a tool" };
        let want = "one of them: x_mm to sd_mm, or tool to sd_n";
        return Err(SimError::value(place, "the line", value, want));
    }
    let (of, first) = if is_move {
        let rest = three(1);
        let lacking = (0..3).find(|&axis| rest[axis].is_none());
        if let Some(axis) = lacking {
            return Err(wrong(1 + axis, "a number: where the point rests"));
        }
        (Measured::Move(rest.map(Option::unwrap_or_default)), 4)
    } else {
        let tool = values[8].filter(|tool| *tool >= 0.0 && tool.fract() == 0.0);
        (Measured::Force(tool.ok_or_else(|| wrong(8, "the number of a tool"))? as usize), 9)
    };
    let components = three(first);
    for at in (1..4).chain(first..first + 3) {
        if values[at].is_some_and(|value| value.abs() > 1e3 * FARTHEST_M) {
            return Err(wrong(at, "at most 1e6 either way"));
        }
    }
    if components.iter().all(Option::is_none) {
        return Err(wrong(first, "a number in one of the three columns at least"));
    }
    let sd = values[first + 3];
    if sd.is_some_and(|sd| !(sd > 0.0)) {
        return Err(wrong(first + 3, "above 0"));
    }
    Ok(Measurement { time_s, of, values: components, sd, place: place.into() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Vec<Measurement>, String> {
        let mut found = Vec::new();
        let lines = &mut text.as_bytes();
        let read = TABLE.parse("m.csv", lines, &mut |values, place| {
            found.push(measurement(values, place)?);
            Ok(())
        });
        read.map(|()| found).map_err(|error| error.to_string())
    }

    #[test]
    fn points_and_forces_may_stand_in_one_table() {
        let found = parse(
            "time_s,x_mm,y_mm,z_mm,ux_mm,uy_mm,uz_mm,sd_mm,tool,fx_n,fz_n\n\
             1.5,1,2,3,0.1,,-0.3,0.05,,,\n2,,,,,,,,1,4,5\n",
        )
        .unwrap();
        assert_eq!(found[0].of, Measured::Move([1.0, 2.0, 3.0]));
        assert_eq!(found[0].values, [Some(0.1), None, Some(-0.3)]);
        assert_eq!((found[0].time_s, found[0].sd), (1.5, Some(0.05)));
        assert_eq!((found[1].of, found[1].sd), (Measured::Force(1), None));
        assert_eq!(found[1].values, [Some(4.0), None, Some(5.0)]);
        assert_eq!(found[1].place, "m.csv, line 3");
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        let cases = [
            ("x_mm\n1", "m.csv, line 1: time_s is missing"),
            ("time_s,tool,fx_n\n0,0,1", "m.csv, line 2: time_s is 0.0, want above 0"),
            ("time_s,tool,fx_n\n1,,", "m.csv, line 2: the line is neither a point nor a tool"),
            ("time_s,tool,fx_n,x_mm\n1,0,1,2", "m.csv, line 2: the line is a point and a tool"),
            ("time_s,tool,fx_n\n1,0.5,1", "m.csv, line 2: tool is 0.5, want the number"),
            ("time_s,tool,fx_n\n1,0,", "m.csv, line 2: fx_n is missing, want a number in one"),
            ("time_s,x_mm,ux_mm\n1,0,1", "m.csv, line 2: y_mm is missing, want a number: where"),
            ("time_s,tool,fx_n,sd_n\n1,0,1,0", "m.csv, line 2: sd_n is 0.0, want above 0"),
            ("time_s,tool,fx_n\n1,0,1e9", "m.csv, line 2: fx_n is 1000000000.0, want at most"),
            ("time_s,tool,fx_n\n1,0,nan", "m.csv, line 2: fx_n is \"nan\", want a finite"),
        ];
        for (text, want) in cases {
            let message = parse(text).unwrap_err();
            assert!(message.starts_with(want), "{message}\nwant {want}");
        }
    }
}
