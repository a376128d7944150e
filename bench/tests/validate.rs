//! The quick part of the study `validate`: every case near what is known of it, and nearer on a
//! finer mesh.

use yawara_bench::studies::validate::Report;

/// Largest relative error on the finest quick mesh, and least slope to it, of what is refined.
const REFINED: [(&str, f64, f64); 8] = [
    ("timoshenko", 0.08, 1.7),
    ("torsion", 0.12, 1.5),
    ("lame", 0.12, 1.3),
    ("coated", 0.15, 1.0),
    ("eshelby", 0.15, 1.0),
    ("hill", 0.03, 1.2),
    ("inflation", 0.04, 1.8),
    ("elastica", 0.12, 1.0),
];

#[test]
fn known_solutions_are_met_and_approached() {
    let report = Report::new(true).unwrap();
    for (number, row) in report.rows.iter().enumerate() {
        let name = format!("{} {} {}", row.case, row.quantity, row.refinement);
        let slope = report.slope(number);
        println!(
            "{name}: {:.5} {:.5} {:.1e} {slope:?}",
            row.computed, row.expected, row.relative_error
        );
        assert_eq!(row.relative_error, (row.computed - row.expected).abs() / row.scale, "{name}");
        let refined = REFINED.iter().find(|(case, ..)| *case == row.case);
        let Some(&(_, error, order)) = refined else {
            // Exact up to rounding and the residual.
            assert!(row.relative_error < 1e-10, "{name}: {:e}", row.relative_error);
            continue;
        };
        if row.refinement == 8 {
            assert!(row.relative_error < error, "{name}: {:e}", row.relative_error);
            assert!(slope.unwrap() > order, "{name}: {slope:?}");
        }
    }
    for case in ["patch", "stretch", "invariance"].iter().chain(REFINED.iter().map(|(c, ..)| c)) {
        assert!(report.rows.iter().any(|row| row.case == *case), "{case}");
    }
}
