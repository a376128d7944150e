//! One line of text per step.

use std::fmt::Debug;

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
    let times = &step.times;
    // What there is not leaves its cell empty.
    let cell = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:?}"));
    let of_step: [(&str, &dyn Debug); 20] = [
        ("step", &step.step),
        ("time_s", &step.time_s),
        ("vertices", &step.vertices),
        ("tets", &step.tets),
        ("splits", &step.splits),
        ("merges", &step.merges),
        ("waiting", &step.waiting),
        ("iterations", &step.iterations),
        ("substeps", &step.substeps),
        ("fallbacks", &step.fallbacks),
        ("residual", &step.residual),
        ("converged", &step.converged),
        ("force_x_n", &step.force_n[0]),
        ("force_y_n", &step.force_n[1]),
        ("force_z_n", &step.force_n[2]),
        ("tool_ms", &times.tool_ms),
        ("solve_ms", &times.solve_ms),
        ("indicator_ms", &times.indicator_ms),
        ("remesh_ms", &times.remesh_ms),
        ("inverse_ms", &times.inverse_ms),
    ];
    let mut columns = of_step.map(|(name, value)| (name.to_owned(), format!("{value:?}"))).to_vec();
    let (goal, goal_error) =
        (step.goal.map(|goal| goal.value), step.goal.and_then(|goal| goal.error));
    let estimates =
        [("error_estimate", step.error_estimate), ("goal", goal), ("goal_error", goal_error)];
    columns.splice(12..12, estimates.map(|(name, value)| (name.into(), cell(value))));
    for (i, tool) in step.tools.iter().enumerate() {
        let mut add = |name: String, value: &dyn Debug| {
            columns.push((format!("tool{i}_{name}"), format!("{value:?}")));
        };
        for (what, unit, vector) in
            [("force", "n", &tool.force_n), ("torque", "n_m", &tool.torque_n_m)]
        {
            for (axis, value) in ["x", "y", "z"].iter().zip(vector) {
                add(format!("{what}_{axis}_{unit}"), value);
            }
        }
        add("contacts".into(), &tool.contacts);
        add("penetration_m".into(), &tool.penetration_m);
        columns.push((format!("tool{i}_force_error_n"), cell(tool.force_error_n)));
    }
    columns
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::report::{GoalReport, StageTimes, ToolReport};

    /// A step that has something to say in every column.
    pub fn full_step() -> StepReport {
        let felt = ToolReport {
            force_n: [0.5, 0.0, 0.0],
            force_error_n: Some(0.015625),
            torque_n_m: [0.0, 0.0, -0.25],
            contacts: 9,
            penetration_m: 1e-8,
            ..ToolReport::default()
        };
        StepReport {
            step: 7,
            time_s: 0.1 + 0.2,
            vertices: 728,
            tets: 3000,
            splits: 4,
            merges: 5,
            edits: 0,
            waiting: 11,
            iterations: 6,
            substeps: 2,
            fallbacks: 3,
            residual: 1e-7,
            converged: true,
            failure: None,
            error_estimate: Some(0.0625),
            goal: Some(GoalReport { name: "volume_m3", value: 0.25, error: None }),
            force_n: [-1.5, 0.0, 1e300],
            tools: vec![ToolReport::default(), felt],
            times: StageTimes {
                tool_ms: 1.0,
                solve_ms: 2.0,
                indicator_ms: 3.0,
                remesh_ms: 4.0,
                inverse_ms: 5.0,
            },
        }
    }

    #[test]
    fn a_line_has_the_columns_of_the_header() {
        let step = full_step();
        let tool = "toolN_force_x_n,toolN_force_y_n,toolN_force_z_n,toolN_torque_x_n_m,\
                    toolN_torque_y_n_m,toolN_torque_z_n_m,toolN_contacts,toolN_penetration_m,\
                    toolN_force_error_n";
        let [first, second] = ["0", "1"].map(|number| tool.replace('N', number));
        let names = "step,time_s,vertices,tets,splits,merges,waiting,iterations,substeps,fallbacks,\
                     residual,converged,error_estimate,goal,goal_error,force_x_n,force_y_n,force_z_n,\
                     tool_ms,solve_ms,indicator_ms,remesh_ms,inverse_ms";
        assert_eq!(header(&step), format!("{names},{first},{second}\n"));
        let values = "7,0.30000000000000004,728,3000,4,5,11,6,2,3,1e-7,true,0.0625,0.25,,-1.5,0.0,\
                      1e300,1.0,2.0,3.0,4.0,5.0,0.0,0.0,0.0,0.0,0.0,0.0,0,0.0,,\
                      0.5,0.0,0.0,0.0,0.0,-0.25,9,1e-8,0.015625\n";
        assert_eq!(line(&step), values);
    }
}
