//! Plan and summary as text.

use std::fmt::Write;

use crate::report::{
    BodySummary, EnergyChange, EnergySummary, GoalReport, InverseSummary, MeshSummary, Momentum,
    PlanRow, StepSummary, Summary, SurfaceSummary, ToolSummary,
};
use crate::scene::LibraryMaterial;

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

/// Materials, each with the line that names it in a scene, its numbers and where they are from.
pub fn materials(all: &[LibraryMaterial]) -> String {
    let mut text = String::from(
        "# Moduli for small strains; bodies differ by a factor of two and more. Densities are those of \
         ICRU\n# reports 44 and 46, of silicones by their makers.\n",
    );
    for one in all {
        let LibraryMaterial { young_modulus_pa: pa, poisson_ratio: nu, density_kg_m3, .. } = one;
        let _ = write!(
            text,
            "\nmaterial = \"{}\"\n  E {pa} Pa, Poisson ratio {nu}, {density_kg_m3} kg/m³\n  {}\n  {}\n",
            one.name, one.measured, one.source
        );
    }
    text
}

/// The summary, a line per subject.
pub fn summary(summary: &Summary) -> String {
    let Summary { body, mesh, steps, inverse, force, wall_s, setup_s, .. } = summary;
    let mut text = String::from("\n");
    let mut line = |title: &str, words: String| {
        let _ = writeln!(text, "{title:<9} {words}");
    };
    if let Some(BodySummary { image, domain, .. }) = body {
        let mut done = format!("{} {}", image.format, image.content);
        if image.resampled {
            done += &format!(", {} to {} mm", image.resampling(), image.voxel_mm);
        }
        line("image", done);
        let ((kept, cells, voxels), parts) = (domain.total(true), domain.components);
        let kept = format!("{kept} of {parts} part(s)");
        line("domain", format!("{kept}, {cells} base cells, {voxels} voxels"));
    }
    let MeshSummary { vertices, tets, splits, merges, waiting_max, waiting_end, .. } = mesh;
    let size = format!("{vertices} vertices, {tets} tetrahedra (start → most → end)");
    line("mesh", format!("{size}; {splits} splits, {merges} merges"));
    if *waiting_max > 0 {
        let most = format!("up to {waiting_max} wanted splits had to wait");
        line("budget", format!("{most}, {waiting_end} do at the end"));
    }
    let (flat, slim) = (mesh.worst_radius_ratio, mesh.worst_circumradius_over_shortest_edge);
    let worst = "worst circumradius over shortest edge";
    line("shapes", format!("worst 3r/R {flat:.4}, {worst} {slim:.4}"));
    let StepSummary { count, converged, residual_max, time_ms: time, .. } = steps;
    let solved = format!("{converged} of {count} converged");
    let (mean, median, worst) = (time.mean, time.p50, time.max);
    let each = format!("{mean:.1} ms each on average, median {median:.1}, worst {worst:.1}");
    line("steps", format!("{solved}, largest relative residual {residual_max:.2e}; {each}"));
    line("inverse", inverse_words(inverse));
    line("force", format!("at most {:.4} N, {:.4} N at the end", force.max_n, force.end_n));
    if let Some(energy) = &summary.energy {
        line("energy", energy_words(energy));
    }
    if !summary.pieces_cm3.is_empty() {
        line("pieces", pieces_words(&summary.pieces_cm3));
    }
    for (number, tool) in summary.tools.iter().enumerate() {
        if let Some(error) = tool.force_max_error_n {
            let size =
                format!("at most {:.4} N, off by {error:.4} N by estimate", tool.force_max_n);
            line("tool", format!("{number} ({}): {size}", tool.kind));
        }
        if tool.doubled + tool.closed + tool.refused > 0 {
            line("cut", cut_words(number, tool));
        }
        if !tool.changed_cm3.is_empty() {
            let each =
                tool.changed_cm3.iter().map(|(label, cm3)| format!("{cm3:.2} cm³ of {label}"));
            let all = each.collect::<Vec<_>>().join(", ");
            line("labels", format!("{number} ({}) changed {all}", tool.kind));
        }
    }
    if let Some(GoalReport { name, value, error }) = summary.error_estimate.goal_end {
        let error =
            error.map_or(String::new(), |error| format!(", off by {error:.2e} by estimate"));
        line("goal", format!("{name} = {value:.6e} at the end{error}"));
    }
    if let Some(Momentum { mass_kg, linear_n_s, angular_n_m_s, kinetic_j, .. }) = &summary.motion {
        let size = |v: &[f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        let (linear, angular) = (size(linear_n_s), size(angular_n_m_s));
        let momenta = format!("{linear:.3e} N s, {angular:.3e} N m s about the centre of mass");
        line("motion", format!("{mass_kg:.4} kg, {momenta}, {kinetic_j:.3e} J kinetic"));
    }
    for surface in &summary.surfaces {
        let SurfaceSummary { label, triangles, pieces, .. } = surface;
        let [rest, end] = [surface.volume_rest_m3, surface.volume_end_m3].map(|m3| 1e6 * m3);
        let volumes = format!("{rest:.2} mL at rest, {end:.2} mL at the end");
        line(
            "surface",
            format!("label {label}: {triangles} triangles in {pieces} pieces, {volumes}"),
        );
    }
    line("time", format!("{wall_s:.2} s in all, {setup_s:.2} s of them before the first step"));
    for warning in &summary.warnings {
        line("warning", warning.clone());
    }
    for row in summary.plan.iter().filter(|row| !row.runs) {
        line("left out", format!("{}: {}", row.stage, row.why));
    }
    if converged < count {
        let missed = count - converged;
        line("warning", format!("{missed} of {count} steps did not converge; see steps.csv"));
        if let Some(failure) = &steps.first_failure {
            line("first", failure.to_string());
            failure.advice.iter().for_each(|words| line("try", words.clone()));
        }
    }
    text
}

/// Changes of the mesh are left out where there were none.
fn energy_words(energy: &EnergySummary) -> String {
    let EnergySummary { tools_work_j, weight_work_j, stored_j, .. } = energy;
    let mut words = format!("tools did {tools_work_j:.3e} J of work");
    if *weight_work_j != 0.0 {
        words += &format!(", weight {weight_work_j:.3e} J");
    }
    words += &format!("; {stored_j:.3e} J stored at the end, {:.1e} J released", energy.released_j);
    for (change, what) in [(energy.splits, "splits"), (energy.merges, "merges")] {
        if change != EnergyChange::default() {
            words += &format!(
                "; {what} added {:.1e} J, took {:.1e} J",
                change.added_j, change.removed_j
            );
        }
    }
    words
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
        (inverse.reassemblies, "reassemblies"),
        (inverse.refinement_steps, "refinement steps"),
    ] {
        if count > 0 {
            words += &format!(", {count} {what}");
        }
    }
    words + &format!(", solve {:.3} ms, drift {:.1e}", inverse.solve_ms.p50, inverse.drift_max)
}

/// What a tool has cut, or closed.
fn cut_words(number: usize, tool: &ToolSummary) -> String {
    let ToolSummary { kind, cut_cm2, cut_j, force_max_n, doubled, closed, refused, parked, .. } =
        tool;
    let mut all = vec![match *closed > 0 {
        true => format!("{closed} doubled vertices made one again"),
        false => format!("{cut_cm2:.2} cm², {cut_j:.2e} J, {doubled} vertices doubled"),
    }];
    if *cut_j > 0.0 {
        all.push(format!("at most {force_max_n:.3} N"));
    }
    if *parked > 0 {
        let what = if *parked == 1 {
            "piece that nothing supports"
        } else {
            "pieces that nothing supports"
        };
        all.push(format!("{parked} {what} held by weak springs"));
    }
    if *refused > 0 {
        all.push(format!("{refused} faces not cut: mesh.max_vertices"));
    }
    format!("{number} ({kind}): {}", all.join("; "))
}

/// The pieces of a body, the largest by their volumes.
fn pieces_words(cm3: &[f64]) -> String {
    const MOST: usize = 6;
    let each: Vec<String> = cm3.iter().take(MOST).map(|cm3| format!("{cm3:.3}")).collect();
    let rest = cm3.len().saturating_sub(MOST);
    let rest = if rest > 0 { format!(" and {rest} smaller ones") } else { String::new() };
    format!("{}: {} cm³{rest}", cm3.len(), each.join(", "))
}
