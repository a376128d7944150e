//! Surfaces move with the mesh, do not depend on how it is given, and refuse what is no mesh.

use nalgebra::{Matrix3, Vector3};
use yawara_mesh::isosurface::{IsoSurface, SurfaceOptions};
use yawara_mesh::{SurfaceError, VertexId};

use crate::checks::{CENTRE, CLOSED, OPEN, assert_closed, forest, positions, sample};
use crate::cracks::split_where;

#[test]
fn the_surface_moves_with_the_mesh() {
    let mut f = forest([2, 2, 2], &[], 6, 9);
    let low = f.domain().lattice().units;
    split_where(&mut f, |p| p[0] < low);
    let field = sample(&f, |x| 0.83 - (x - Vector3::from(CENTRE)).norm());
    let surface = IsoSurface::of_forest(&f, &field, OPEN).unwrap();
    let a = Matrix3::new(1.2, 0.3, -0.1, 0.2, 0.7, 0.4, -0.3, 0.1, 1.6);
    let b = Vector3::new(3.0, -2.0, 5.0);
    let x = positions(&f);
    let moved: Vec<Vector3<f64>> = x.iter().map(|x| a * x + b).collect();
    let (rest, deformed) = (surface.positions(&x).unwrap(), surface.positions(&moved).unwrap());
    // Two roundings each of map and interpolation, on values below 10.
    for (rest, deformed) in rest.iter().zip(&deformed) {
        assert!((a * rest + b - deformed).norm() < 10.0 * 10.0 * f64::EPSILON);
    }
    let ratio = surface.volume(&deformed).unwrap() / surface.volume(&rest).unwrap();
    assert!((ratio / a.determinant() - 1.0).abs() < 1e-12);
}

#[test]
fn a_list_of_tetrahedra_may_be_turned_either_way() {
    let f = forest([2, 2, 2], &[], 6, 6);
    let field = sample(&f, |x| 0.83 - (x - Vector3::from(CENTRE)).norm());
    let x = positions(&f);
    let mut tets: Vec<[VertexId; 4]> = f.leaves().map(|tet| tet.vertices).collect();
    let expected = IsoSurface::of_forest(&f, &field, CLOSED).unwrap();
    assert_eq!(IsoSurface::of_tets(&tets, &x, &field, CLOSED).unwrap(), expected);
    for tet in tets.iter_mut().step_by(3) {
        tet.swap(1, 3);
    }
    let surface = IsoSurface::of_tets(&tets, &x, &field, CLOSED).unwrap();
    assert_eq!(surface.vertices, expected.vertices);
    assert_closed(&surface);
    let volume = |s: &IsoSurface| s.volume(&s.positions(&x).unwrap()).unwrap();
    assert!((volume(&surface) - volume(&expected)).abs() < 1e-12);
}

#[test]
fn bad_input_is_refused() {
    let f = forest([1, 1, 1], &[], 0, 3);
    let field = vec![1.0; f.vertex_capacity()];
    let x = positions(&f);
    let tets: Vec<[VertexId; 4]> = f.leaves().map(|tet| tet.vertices).collect();
    let nan = SurfaceOptions { level: f64::NAN, ..OPEN };
    let error = IsoSurface::of_forest(&f, &field, nan).unwrap_err();
    assert!(matches!(error, SurfaceError::IsoSurface { field: "level", .. }), "{error}");
    let error = IsoSurface::of_forest(&f, &field[1..], OPEN).unwrap_err();
    assert!(matches!(error, SurfaceError::EntryCount { found: 7, want: 8, .. }), "{error}");
    let error = IsoSurface::of_tets(&tets, &x[..7], &field, OPEN).unwrap_err();
    assert!(matches!(error, SurfaceError::EntryCount { what: "positions", .. }), "{error}");
    for value in [f64::NAN, f64::INFINITY] {
        let mut bad = field.clone();
        bad[3] = value;
        for error in [
            IsoSurface::of_forest(&f, &bad, OPEN).unwrap_err(),
            IsoSurface::of_tets(&tets, &x, &bad, OPEN).unwrap_err(),
        ] {
            assert!(matches!(error, SurfaceError::EntryNotFinite { index: 3, .. }), "{error}");
        }
        let mut bad = x.clone();
        bad[2].y = value;
        let error = IsoSurface::of_tets(&tets, &bad, &field, OPEN).unwrap_err();
        assert!(matches!(error, SurfaceError::EntryNotFinite { index: 2, .. }), "{error}");
        let surface = IsoSurface::of_forest(&f, &field, CLOSED).unwrap();
        assert!(matches!(
            surface.positions(&bad),
            Err(SurfaceError::EntryNotFinite { index: 2, .. })
        ));
        assert!(matches!(surface.volume(&x[1..]), Err(SurfaceError::EntryCount { .. })));
    }
    let flat = [[0, 1, 2, 2].map(VertexId)];
    let error = IsoSurface::of_tets(&flat, &x, &field, OPEN).unwrap_err();
    assert!(matches!(error, SurfaceError::FlatTet { tet: 0, .. }), "{error}");
    // Differences of extreme values overflow; the surface must not.
    let huge: Vec<f64> =
        (0..f.vertex_capacity()).map(|i| if i % 2 == 0 { f64::MAX } else { f64::MIN }).collect();
    let surface = IsoSurface::of_forest(&f, &huge, CLOSED).unwrap();
    assert!(surface.vertices.iter().all(|v| v.t == 0.5 || v.edge[0] == v.edge[1]));
    assert_closed(&surface);
}
