//! Effective bulk moduli of a cubic array of grains against the bounds of Hashin and Shtrikman.
//!
//! An eighth of the periodic cell, its grain in the corner: under a hydrostatic mean strain the
//! mirror planes of a cubic cell stay plane and free of shear, so rollers on all six faces make the
//! periodic problem exactly (the tiling of cubes is mirrored in them too). The bounds hold for the
//! bulk modulus of any two-phase material of cubic symmetry (Milton, The Theory of Composites,
//! chapter 23); the grain is the voxelised one on all meshes, and its share of the volume is exact.

use faer::Side;
use faer::linalg::solvers::Solve;
use faer::sparse::{SparseColMat, Triplet};
use yawara_embed::LinearTet;
use yawara_tests::organ::Organ;

/// Voxels of the geometry along an edge.
const COARSE: usize = 4;

/// The cell with `refined` finest cubes per voxel and direction, and the grain's share.
fn cell(refined: usize, materials: [(f64, f64); 2]) -> (Organ, f64) {
    let n = COARSE * refined;
    let mut organ = Organ::homogeneous([n / 4; 3], 1.0, 0.0);
    organ.materials = materials.to_vec();
    for (i, label) in organ.labels.iter_mut().enumerate() {
        let voxel = [i % n, i / n % n, i / (n * n)].map(|c| (c / refined) as f64 + 0.5);
        let radius = 0.8 * COARSE as f64;
        *label = 1 + u16::from(voxel.iter().map(|c| c * c).sum::<f64>() < radius * radius);
    }
    let share = organ.labels.iter().filter(|&&label| label == 2).count() as f64;
    let share = share / organ.labels.len() as f64;
    (organ, share)
}

/// K of the mesh of finest tetrahedra: mean strain I has the energy 9 K V / 2.
fn bulk_modulus(organ: &Organ) -> f64 {
    let (forest, placement) = (organ.forest(6, 6), organ.placement(6));
    let embedding = organ.embedding("linear");
    let high = organ.cells[0] as i32 * forest.domain().lattice().units;
    // Normal displacements are given on the faces: u_i = x_i.
    let given = |v, axis: usize| {
        let p = forest.point(v)[axis];
        (p == 0 || p == high).then(|| f64::from(p) * placement.unit)
    };
    let mut number = vec![[usize::MAX; 3]; forest.vertex_capacity()];
    let mut count = 0;
    for v in forest.vertices() {
        for axis in 0..3 {
            if given(v, axis).is_none() {
                number[v.index()][axis] = count;
                count += 1;
            }
        }
    }
    let (mut triplets, mut load, mut energy, mut volume) =
        (Vec::new(), faer::Mat::<f64>::zeros(count, 1), 0.0, 0.0);
    for tet in forest.leaves() {
        let geometry = LinearTet::new(&tet.vertices.map(|v| placement.position(forest.point(v))));
        let k = geometry.stiffness(&embedding.elasticity(tet.node));
        volume += geometry.volume;
        for (i, j) in (0..144).map(|e| (e / 12, e % 12)) {
            let [a, b] = [i, j].map(|row: usize| {
                let v = tet.vertices[row / 3];
                (number[v.index()][row % 3], given(v, row % 3))
            });
            match (a, b) {
                ((row, None), (column, None)) => {
                    triplets.push(Triplet::new(row, column, k[(i, j)]));
                }
                ((row, None), (_, Some(u))) => load[(row, 0)] -= k[(i, j)] * u,
                ((_, Some(u)), (_, Some(v))) => energy += 0.5 * u * k[(i, j)] * v,
                ((_, Some(_)), (_, None)) => {}
            }
        }
    }
    let k = SparseColMat::try_new_from_triplets(count, count, &triplets).unwrap();
    let u = k.sp_cholesky(Side::Lower).unwrap().solve(&load);
    energy -= 0.5 * (0..count).map(|i| load[(i, 0)] * u[(i, 0)]).sum::<f64>();
    2.0 * energy / (9.0 * volume)
}

fn moduli((e, nu): (f64, f64)) -> [f64; 2] {
    [e / (3.0 * (1.0 - 2.0 * nu)), e / (2.0 * (1.0 + nu))]
}

/// Lower and upper bound for a share of the second material.
fn bounds(materials: [(f64, f64); 2], share: f64) -> [f64; 2] {
    let [[k1, g1], [k2, g2]] = materials.map(moduli);
    let from = |k: f64, g: f64, other: f64, part: f64| {
        k + part / (1.0 / (other - k) + 3.0 * (1.0 - part) / (3.0 * k + 4.0 * g))
    };
    let mut both = [from(k1, g1, k2, share), from(k2, g2, k1, 1.0 - share)];
    both.sort_by(f64::total_cmp);
    both
}

#[test]
fn fine_solves_respect_the_bounds() {
    for materials in
        [[(1.0, 0.3), (100.0, 0.3)], [(100.0, 0.3), (1.0, 0.3)], [(1.0, 0.2), (8.0, 0.4)]]
    {
        // Energies of conforming displacements are upper bounds that fall to the truth.
        let values: Vec<f64> =
            [1, 2, 4].map(|refined| bulk_modulus(&cell(refined, materials).0)).into();
        let [low, high] = bounds(materials, cell(1, materials).1);
        println!("{materials:?}: {low:.5} <= {values:.5?} <= {high:.5}");
        assert!(values[0] > values[1] && values[1] > values[2], "{values:?}");
        let falls = [values[0] - values[1], values[1] - values[2]];
        // Aitken: what is left of a geometric series.
        let limit = values[2] - falls[1] * falls[1] / (falls[0] - falls[1]);
        assert!(
            falls[1] < 0.7 * falls[0] && falls[1] < 0.02 * values[2],
            "not converged: {values:?}"
        );
        assert!(low < limit && limit < values[2] && limit < high, "{low} {limit} {high}");
        // The bounds are narrow enough to tell: Voigt and Reuss are not within.
        let [[k1, _], [k2, _]] = materials.map(moduli);
        let share = cell(1, materials).1;
        assert!(high < (1.0 - share) * k1 + share * k2);
        assert!(low > 1.0 / ((1.0 - share) / k1 + share / k2));
    }
}
