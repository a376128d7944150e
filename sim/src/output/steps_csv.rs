//! One line of text per step.

use crate::report::StepReport;

/// The names of a step's columns; those of its tools are at the end.
pub(super) fn header(step: &StepReport) -> String {
    join(columns(step).into_iter().map(|(name, _)| name))
}

/// The line of a step; floats in the shortest form that reads back to the same number.
pub(super) fn line(step: &StepReport) -> String {
    join(columns(step).into_iter().map(|(_, value)| value))
}

fn join(cells: impl Iterator<Item = String>) -> String {
    cells.collect::<Vec<_>>().join(",") + "\n"
}

/// Names and values.
fn columns(step: &StepReport) -> Vec<(String, String)> {
    let mut columns = Vec::new();
    let mut add = |name: &str, value: String| columns.push((name.to_owned(), value));
    add("step", step.step.to_string());
    add("time_s", format!("{:?}", step.time_s));
    for (name, count) in [
        ("vertices", step.vertices),
        ("tets", step.tets),
        ("splits", step.splits),
        ("merges", step.merges),
        ("waiting", step.waiting),
        ("iterations", step.iterations),
        ("substeps", step.substeps),
        ("fallbacks", step.fallbacks),
    ] {
        add(name, count.to_string());
    }
    add("residual", format!("{:?}", step.residual));
    add("converged", step.converged.to_string());
    let times = &step.times;
    for (name, value) in [
        ("force_x_n", step.force_n[0]),
        ("force_y_n", step.force_n[1]),
        ("force_z_n", step.force_n[2]),
        ("tool_ms", times.tool_ms),
        ("solve_ms", times.solve_ms),
        ("indicator_ms", times.indicator_ms),
        ("remesh_ms", times.remesh_ms),
        ("inverse_ms", times.inverse_ms),
    ] {
        add(name, format!("{value:?}"));
    }
    for (i, tool) in step.tools.iter().enumerate() {
        for (what, unit, vector) in
            [("force", "n", tool.force_n), ("torque", "n_m", tool.torque_n_m)]
        {
            for (axis, value) in ["x", "y", "z"].iter().zip(vector) {
                add(&format!("tool{i}_{what}_{axis}_{unit}"), format!("{value:?}"));
            }
        }
        add(&format!("tool{i}_contacts"), tool.contacts.to_string());
        add(&format!("tool{i}_penetration_m"), format!("{:?}", tool.penetration_m));
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{StageTimes, ToolReport};

    #[test]
    fn a_line_has_the_columns_of_the_header() {
        let step = StepReport {
            step: 7,
            time_s: 0.1 + 0.2,
            vertices: 728,
            tets: 3000,
            splits: 4,
            merges: 5,
            waiting: 11,
            iterations: 6,
            substeps: 2,
            fallbacks: 3,
            residual: 1e-7,
            converged: true,
            force_n: [-1.5, 0.0, 1e300],
            tools: vec![
                ToolReport::default(),
                ToolReport {
                    force_n: [0.5, 0.0, 0.0],
                    torque_n_m: [0.0, 0.0, -0.25],
                    contacts: 9,
                    penetration_m: 1e-8,
                    ..ToolReport::default()
                },
            ],
            times: StageTimes {
                tool_ms: 1.0,
                solve_ms: 2.0,
                indicator_ms: 3.0,
                remesh_ms: 4.0,
                inverse_ms: 5.0,
            },
        };
        let line = line(&step);
        let header = header(&step);
        let row: Vec<(&str, &str)> =
            header.trim_end().split(',').zip(line.trim_end().split(',')).collect();
        assert_eq!(header.matches(',').count(), line.matches(',').count());
        let value = |name: &str| row.iter().find(|(key, _)| *key == name).unwrap().1;
        assert_eq!(value("time_s").parse::<f64>().unwrap(), step.time_s);
        assert_eq!(value("residual"), "1e-7");
        assert_eq!((value("vertices"), value("tets")), ("728", "3000"));
        assert_eq!((value("splits"), value("merges"), value("waiting")), ("4", "5", "11"));
        let counts = ["iterations", "substeps", "fallbacks"].map(value);
        assert_eq!(counts, ["6", "2", "3"]);
        assert_eq!((value("converged"), value("force_x_n")), ("true", "-1.5"));
        assert_eq!(value("force_z_n"), "1e300");
        assert_eq!((value("tool_ms"), value("inverse_ms")), ("1.0", "5.0"));
        assert_eq!((value("tool1_force_x_n"), value("tool1_torque_z_n_m")), ("0.5", "-0.25"));
        assert_eq!((value("tool1_contacts"), value("tool1_penetration_m")), ("9", "1e-8"));
        assert_eq!(value("tool0_force_x_n"), "0.0");
    }
}
