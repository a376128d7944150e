//! Spheres, tori and boxes: topology, sizes and their convergence.

use nalgebra::Vector3;
use yawara_mesh::isosurface::{EDGE_MARGIN, IsoSurface};

use crate::checks::{
    CENTRE, CLOSED, OPEN, assert_closed, assert_valid, edge_counts, forest, positions, sample,
};

/// Slope of the least-squares line through (ln h, ln error).
fn slope(pairs: &[(f64, f64)]) -> f64 {
    let n = pairs.len() as f64;
    let logs: Vec<(f64, f64)> = pairs.iter().map(|(h, e)| (h.ln(), e.ln())).collect();
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| logs.iter().map(f).sum::<f64>() / n;
    let (mx, my) = (mean(&|p| p.0), mean(&|p| p.1));
    mean(&|p| (p.0 - mx) * (p.1 - my)) / mean(&|p| (p.0 - mx).powi(2))
}

#[test]
fn sphere_is_closed_and_converges_with_second_order() {
    let r = 0.83;
    // A linear surface on shape-regular tetrahedra: places off by O(h²), normals by O(h), and
    // the area by the square of the normals' error.
    type Field = fn(Vector3<f64>) -> f64;
    let fields: [(&str, Field); 2] = [
        ("distance", |x| 0.83 - (x - Vector3::from(CENTRE)).norm()),
        ("square", |x| 0.83 * 0.83 - (x - Vector3::from(CENTRE)).norm_squared()),
    ];
    for (name, field) in fields {
        let (mut volumes, mut areas) = (Vec::new(), Vec::new());
        for level in [6, 9, 12, 15] {
            let f = forest([2, 2, 2], &[], level, level);
            let surface = IsoSurface::of_forest(&f, &sample(&f, field), OPEN).unwrap();
            let points = surface.positions(&positions(&f)).unwrap();
            assert_closed(&surface);
            assert_valid(&surface, &points);
            assert_eq!((surface.euler_characteristic(), surface.component_count()), (2, 1));
            let h = 0.5f64.powi(i32::from(level) / 3);
            let volume = 4.0 / 3.0 * std::f64::consts::PI * r * r * r;
            let area = 4.0 * std::f64::consts::PI * r * r;
            volumes.push((h, (surface.volume(&points).unwrap() / volume - 1.0).abs()));
            areas.push((h, (surface.area(&points).unwrap() / area - 1.0).abs()));
        }
        assert!(slope(&volumes) > 1.8, "{name}: {volumes:?}");
        assert!(slope(&areas) > 1.8, "{name}: {areas:?}");
    }
}

#[test]
fn torus_has_euler_characteristic_zero() {
    let f = forest([2, 2, 2], &[], 12, 12);
    let field = sample(&f, |x| {
        let x = x - Vector3::from(CENTRE);
        0.3 - ((x.x.hypot(x.y) - 0.6).powi(2) + x.z * x.z).sqrt()
    });
    let surface = IsoSurface::of_forest(&f, &field, CLOSED).unwrap();
    let points = surface.positions(&positions(&f)).unwrap();
    assert_closed(&surface);
    assert_valid(&surface, &points);
    assert_eq!((surface.euler_characteristic(), surface.component_count()), (0, 1));
    assert_eq!(surface.level_triangles, surface.triangles.len(), "away from the hull");
    // Pappus: 2π²Rr².
    let volume = 2.0 * std::f64::consts::PI.powi(2) * 0.6 * 0.09;
    assert!((surface.volume(&points).unwrap() / volume - 1.0).abs() < 0.02);
}

#[test]
fn vertices_exactly_on_the_level_leave_no_flat_triangle() {
    // A plane, an octahedron and a constant, all of them through lattice points.
    let f = forest([2, 2, 2], &[], 6, 6);
    let fields: [fn(Vector3<f64>) -> f64; 3] =
        [|x| 1.0 - x.z, |x| 0.5 - (x - Vector3::repeat(1.0)).abs().sum(), |_| 0.0];
    let volumes = [4.0, 4.0 / 3.0 * 0.125, 8.0];
    for (field, volume) in fields.into_iter().zip(volumes) {
        let surface = IsoSurface::of_forest(&f, &sample(&f, field), CLOSED).unwrap();
        let points = surface.positions(&positions(&f)).unwrap();
        assert_closed(&surface);
        assert_valid(&surface, &points);
        // The margin moves the surface outwards by at most ε edges, of √3/4 at this level.
        let moved = surface.volume(&points).unwrap() - volume;
        let most = EDGE_MARGIN * 3f64.sqrt() / 4.0 * surface.area(&points).unwrap();
        assert!((-1e-12..=most + 1e-12).contains(&moved), "{moved} of {most}");
    }
}

#[test]
fn a_label_at_the_hull_is_closed_on_request() {
    // A ball around a corner of the box, and one around the middle of a face.
    for (centre, part) in [([0.0, 0.0, 0.0], 0.125), ([1.0, 1.0, 0.0], 0.5)] {
        let f = forest([2, 2, 2], &[], 12, 12);
        let field = sample(&f, |x| 0.83 - (x - Vector3::from(centre)).norm());
        let open = IsoSurface::of_forest(&f, &field, OPEN).unwrap();
        let closed = IsoSurface::of_forest(&f, &field, CLOSED).unwrap();
        assert!(edge_counts(&open).values().any(|&c| c.1 == 1), "open at the hull");
        let points = closed.positions(&positions(&f)).unwrap();
        assert_closed(&closed);
        assert_valid(&closed, &points);
        assert_eq!(closed.euler_characteristic(), 2);
        assert_eq!(closed.level_triangles, open.triangles.len());
        let volume = part * 4.0 / 3.0 * std::f64::consts::PI * 0.83f64.powi(3);
        assert!((closed.volume(&points).unwrap() / volume - 1.0).abs() < 0.01);
    }
}

#[test]
fn the_whole_body_has_its_hull_as_surface() {
    // Cell 1 of eight is cut out: re-entrant edges, but no edge where cells only touch.
    let f = forest([2, 2, 2], &[1], 3, 3);
    let surface = IsoSurface::of_forest(&f, &sample(&f, |_| 1.0), CLOSED).unwrap();
    let points = surface.positions(&positions(&f)).unwrap();
    assert_closed(&surface);
    assert_eq!((surface.level_triangles, surface.euler_characteristic()), (0, 2));
    assert!((surface.volume(&points).unwrap() - 7.0).abs() < 1e-13);
    assert!((surface.area(&points).unwrap() - 24.0).abs() < 1e-13);
}
