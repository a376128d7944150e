//! One line of text per step.

use crate::report::StepReport;

/// Columns of every scene.
const HEADER: &str = "step,time_s,vertices,tets,splits,merges,waiting,iterations,substeps,\
    fallbacks,residual,converged,force_x_n,force_y_n,force_z_n,\
    tool_ms,solve_ms,indicator_ms,remesh_ms,inverse_ms";

/// The first line: column names, those of `tools` tools at the end.
pub(super) fn header(tools: usize) -> String {
    let mut header = HEADER.to_owned();
    for tool in 0..tools {
        for what in ["force", "torque"] {
            let unit = if what == "force" { "n" } else { "n_m" };
            for axis in ["x", "y", "z"] {
                header += &format!(",tool{tool}_{what}_{axis}_{unit}");
            }
        }
        header += &format!(",tool{tool}_contacts,tool{tool}_penetration_m");
    }
    header + "\n"
}

/// The line of a step; floats in the shortest form that reads back to the same number.
pub(super) fn line(step: &StepReport) -> String {
    let StepReport { vertices, tets, splits, merges, waiting, iterations, .. } = *step;
    let counts = [vertices, tets, splits, merges, waiting, iterations];
    let [force_x, force_y, force_z] = step.force_n;
    let times = &step.times;
    let tail = [
        force_x,
        force_y,
        force_z,
        times.tool_ms,
        times.solve_ms,
        times.indicator_ms,
        times.remesh_ms,
        times.inverse_ms,
    ];
    let mut line = format!(
        "{},{:?},{},{},{},{:?},{},{}",
        step.step,
        step.time_s,
        counts.map(|count| count.to_string()).join(","),
        step.substeps,
        step.fallbacks,
        step.residual,
        step.converged,
        tail.map(|value| format!("{value:?}")).join(",")
    );
    for tool in &step.tools {
        for value in tool.force_n.iter().chain(&tool.torque_n_m) {
            line += &format!(",{value:?}");
        }
        line += &format!(",{},{:?}", tool.contacts, tool.penetration_m);
    }
    line + "\n"
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
        let header = header(2);
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
