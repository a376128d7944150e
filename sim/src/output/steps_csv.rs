//! One line of text per step.

use crate::report::StepReport;

/// The first line: column names.
pub(super) const HEADER: &str = "step,time_s,vertices,tets,splits,merges,waiting,iterations,substeps,\
    fallbacks,residual,converged,force_x_n,force_y_n,force_z_n,\
    tool_ms,solve_ms,indicator_ms,remesh_ms,inverse_ms\n";

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
    format!(
        "{},{:?},{},{},{},{:?},{},{}\n",
        step.step,
        step.time_s,
        counts.map(|count| count.to_string()).join(","),
        step.substeps,
        step.fallbacks,
        step.residual,
        step.converged,
        tail.map(|value| format!("{value:?}")).join(",")
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::StageTimes;

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
            times: StageTimes {
                tool_ms: 1.0,
                solve_ms: 2.0,
                indicator_ms: 3.0,
                remesh_ms: 4.0,
                inverse_ms: 5.0,
            },
        };
        let line = line(&step);
        let row: Vec<(&str, &str)> =
            HEADER.trim_end().split(',').zip(line.trim_end().split(',')).collect();
        assert_eq!(HEADER.matches(',').count(), line.matches(',').count());
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
    }
}
