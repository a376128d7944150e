//! Plan and summary as text.

use std::fmt::Write;

use yawara::report::{BodySummary, InverseSummary, PlanRow, Summary};

/// The plan as a table, a line per stage.
pub fn plan(rows: &[PlanRow]) -> String {
    let width = |cell: fn(&PlanRow) -> &str, title: &str| {
        rows.iter().map(|row| cell(row).chars().count()).max().unwrap_or(0).max(title.len())
    };
    let (stage, choice) = (width(|row| &row.stage, "stage"), width(|row| &row.choice, "choice"));
    let mut text = format!("{:stage$}  {:choice$}  runs  why\n", "stage", "choice");
    for row in rows {
        let runs = if row.runs { "yes" } else { "no" };
        // Writing to a String can't fail, here and below.
        let _ =
            writeln!(text, "{:stage$}  {:choice$}  {runs:4}  {}", row.stage, row.choice, row.why);
    }
    text
}

/// The summary, a line per subject.
pub fn summary(summary: &Summary) -> String {
    let Summary { body, mesh, steps, inverse, force, .. } = summary;
    let mut text = String::from("\n");
    let mut line = |title: &str, words: String| {
        let _ = writeln!(text, "{title:<9} {words}");
    };
    if let Some(body) = body {
        let image = &body.image;
        let mut done = format!("{} {}", image.format, image.content);
        if image.resampled {
            done += &format!(", {} to {} mm", image.resampling(), image.voxel_mm);
        }
        line("image", done);
        let (parts, cells, voxels) = body.domain.total(true);
        line(
            "domain",
            format!(
                "{parts} of {} part(s), {cells} base cells, {voxels} voxels",
                body.domain.components
            ),
        );
    }
    let range = |r: &yawara::report::Range| format!("{} → {} → {}", r.start, r.max, r.end);
    line(
        "mesh",
        format!(
            "{} vertices, {} tetrahedra (start → most → end); {} splits, {} merges",
            range(&mesh.vertices),
            range(&mesh.tets),
            mesh.splits,
            mesh.merges
        ),
    );
    if mesh.waiting_max > 0 {
        let (most, end) = (mesh.waiting_max, mesh.waiting_end);
        line("budget", format!("up to {most} wanted splits had to wait, {end} do at the end"));
    }
    line(
        "shapes",
        format!(
            "worst 3r/R {:.4}, worst circumradius over shortest edge {:.4}",
            mesh.worst_radius_ratio, mesh.worst_circumradius_over_shortest_edge
        ),
    );
    let time = &steps.time_ms;
    line(
        "steps",
        format!(
            "{} of {} converged, largest relative residual {:.2e}; {:.1} ms each (99 %: {:.1}, most {:.1})",
            steps.converged, steps.count, steps.residual_max, time.p50, time.p99, time.max
        ),
    );
    line("inverse", inverse_words(inverse));
    line("force", format!("at most {:.4} N, {:.4} N at the end", force.max_n, force.end_n));
    if let Some(motion) = &summary.motion {
        let size = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        line(
            "motion",
            format!(
                "{:.4} kg, {:.3e} N s, {:.3e} N m s about the centre of mass, {:.3e} J kinetic",
                motion.mass_kg,
                size(motion.linear_n_s),
                size(motion.angular_n_m_s),
                motion.kinetic_j
            ),
        );
    }
    for surface in &summary.surfaces {
        line(
            "surface",
            format!(
                "label {}: {} triangles in {} pieces, {:.2} mL at rest, {:.2} mL at the end",
                surface.label,
                surface.triangles,
                surface.pieces,
                1e6 * surface.volume_rest_m3,
                1e6 * surface.volume_end_m3
            ),
        );
    }
    line(
        "time",
        format!(
            "{:.2} s in all, {:.2} s of them before the first step",
            summary.wall_s, summary.setup_s
        ),
    );
    for warning in body.iter().flat_map(body_warnings) {
        line("warning", warning);
    }
    for row in summary.plan.iter().filter(|row| !row.runs) {
        line("left out", format!("{}: {}", row.stage, row.why));
    }
    if steps.converged < steps.count {
        let missed = steps.count - steps.converged;
        line(
            "warning",
            format!("{missed} of {} steps did not converge; see steps.csv", steps.count),
        );
    }
    text
}

/// Safeguards that did not take effect are left out, but for fresh starts.
fn inverse_words(inverse: &InverseSummary) -> String {
    let mut words = format!(
        "{}: {} updates of {:.3} ms (99 %: {:.3}), {} rebuilds",
        inverse.choice, inverse.updates, inverse.time_ms.p50, inverse.time_ms.p99, inverse.rebuilds
    );
    for (count, what) in [
        (inverse.drift_rebuilds, "for drift"),
        (inverse.failed_pivots, "failed pivots"),
        (inverse.refinement_steps, "refinement steps"),
    ] {
        if count > 0 {
            words += &format!(", {count} {what}");
        }
    }
    words + &format!(", solve {:.3} ms, drift {:.1e}", inverse.solve_ms.p50, inverse.drift_max)
}

/// What of the body is not as the scene asked for.
fn body_warnings(body: &BodySummary) -> Vec<String> {
    let empty = body.image.empty_ranges();
    let mut warnings: Vec<String> =
        empty.map(|range| format!("no voxel lies in the range of \"{}\"", range.name)).collect();
    let (parts, cells, voxels) = body.domain.total(false);
    if parts > 0 {
        warnings.push(format!(
            "{parts} part(s) with {cells} base cells and {voxels} voxels are left out: no fixed \
             region holds them"
        ));
    }
    let refined = body.label_refinement.filter(|refined| refined.tets_left > 0);
    if let Some(refined) = refined {
        warnings.push(format!(
            "max_vertices ended the refinement towards labels: {} tetrahedra above level {} still \
             hold several",
            refined.tets_left, refined.level
        ));
    }
    warnings
}
