//! What an element must be, whatever its vertices carry.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use proptest::prelude::*;
use proptest::sample::Index;
use yawara_embed::{
    ElementFormulation, Embedding, LinearTet, RingStiffness, isotropic, strain_from_gradient,
};
use yawara_mesh::{MeshDelta, Tet, VertexId};

use super::block::askew;
use crate::organ::organs;
use crate::rules::rule;

type Formulation<'a> = &'a dyn ElementFormulation;

/// Where vertices rest, m.
type Positions<'a> = &'a dyn Fn(VertexId) -> Vector3<f64>;

const DENSITY_KG_M3: f64 = 1e3;

fn tet() -> LinearTet {
    LinearTet::new(&askew())
}

fn dense(m: &faer::Mat<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)])
}

/// Displacements vertex by vertex, all other unknowns zero.
fn unknowns(m: usize, displacements: &[Vector3<f64>]) -> DVector<f64> {
    DVector::from_fn(m * displacements.len(), |i, _| {
        if i % m < 3 { displacements[i / m][i % m] } else { 0.0 }
    })
}

/// K = Kᵀ, of stiffness and matrix.
pub fn matrices_are_symmetric(element: Formulation<'_>) {
    let (d, geometry) = (isotropic(5e3, 0.45), tet());
    for k in [element.stiffness(&geometry, &d), element.matrix(&geometry, &d, DENSITY_KG_M3)] {
        let k = dense(&k);
        assert_eq!(k.shape(), (4 * element.unknowns(), 4 * element.unknowns()));
        let off = (&k - k.transpose()).amax();
        assert!(off <= 1e2 * f64::EPSILON * k.amax(), "{}: off by {off:e}", element.name());
    }
}

/// As many negative eigenvalues as it tells; six are zero, the rigid motions, the others positive.
pub fn pivots_have_the_signs_that_it_tells(element: Formulation<'_>) {
    for poisson_ratio in [-0.5, 0.3, 0.49] {
        let k = dense(&element.stiffness(&tet(), &isotropic(5e3, poisson_ratio)));
        // Unknowns of different units: each row and column by the root of its diagonal entry.
        let scale = k.map_diagonal(|d| d.abs().sqrt().recip());
        let k = DMatrix::from_fn(k.nrows(), k.ncols(), |i, j| scale[i] * k[(i, j)] * scale[j]);
        let values = k.symmetric_eigenvalues();
        let count = |test: &dyn Fn(f64) -> bool| values.iter().filter(|v| test(**v)).count();
        let zero = 1e3 * f64::EPSILON * values.amax();
        assert_eq!(count(&|v| v < -zero), 4 * element.negative(), "{}: {values}", element.name());
        assert_eq!(count(&|v| v.abs() <= zero), 6, "{}: {values}", element.name());
    }
}

/// K (t + ω × X) = 0.
pub fn rigid_motions_cost_nothing(element: Formulation<'_>) {
    let geometry = tet();
    let moved =
        askew().map(|x| Vector3::new(0.3, -0.1, 0.2) + Vector3::new(1.0, -0.5, 2.0).cross(&x));
    let k = dense(&element.stiffness(&geometry, &isotropic(5e3, 0.45)));
    let u = unknowns(element.unknowns(), &moved);
    let force = (&k * &u).amax();
    assert!(force <= 1e2 * f64::EPSILON * k.amax() * u.amax(), "{}: {force:e} N", element.name());
}

/// K u = V Bᵀ D ε on displacements that are linear in X, once all other unknowns are eliminated.
pub fn a_linear_displacement_has_the_stress_of_its_strain(element: Formulation<'_>) {
    let (m, geometry) = (element.unknowns(), tet());
    let gradient = Matrix3::new(0.1, 0.03, -0.02, 0.01, -0.08, 0.05, -0.04, 0.02, 0.06);
    let u = unknowns(m, &askew().map(|x| gradient * x));
    for poisson_ratio in [-0.5, 0.3, 0.49] {
        let d = isotropic(5e3, poisson_ratio);
        let k = dense(&element.stiffness(&geometry, &d));
        let others: Vec<usize> = (0..4 * m).filter(|i| i % m >= 3).collect();
        let mut got = &k * &u;
        if !others.is_empty() {
            let own = k.select_rows(&others).select_columns(&others);
            let answer = own.lu().solve(&got.select_rows(&others)).unwrap();
            got -= k.select_columns(&others) * answer;
        }
        let stress = d * strain_from_gradient(&gradient);
        let want = geometry.strain_matrix().transpose() * stress * geometry.volume;
        for (i, want) in want.iter().enumerate() {
            let got = got[m * (i / 3) + i % 3];
            let limit = 1e3 * f64::EPSILON * k.amax() * u.amax();
            assert!((got - want).abs() <= limit, "{}: {got} N, want {want} N", element.name());
        }
    }
}

/// The sum of the tetrahedra's matrices on `vertices`.
pub fn assemble<'a>(
    element: Formulation<'_>,
    vertices: &[VertexId],
    tets: impl Iterator<Item = &'a Tet>,
    embedding: &Embedding,
    position: Positions<'_>,
) -> DMatrix<f64> {
    let m = element.unknowns();
    let mut sum = DMatrix::zeros(m * vertices.len(), m * vertices.len());
    for tet in tets {
        let geometry = LinearTet::new(&tet.vertices.map(position));
        let (d, density) = (embedding.elasticity(tet.node), embedding.density(tet.node));
        let k = element.matrix(&geometry, &d, density);
        let rows = tet.vertices.map(|v| vertices.iter().position(|&w| w == v).unwrap());
        for (i, j) in (0..4 * m).flat_map(|i| (0..4 * m).map(move |j| (i, j))) {
            sum[(m * rows[i / m] + i % m, m * rows[j / m] + j % m)] += k[(i, j)];
        }
    }
    sum
}

/// The largest entries of a ring that couple displacements, displacements and others, others.
struct Bounds {
    unknowns: usize,
    largest: [f64; 3],
}

impl Bounds {
    fn of(m: usize, fine: &DMatrix<f64>, coarse: &DMatrix<f64>) -> Self {
        let mut bounds = Self { unknowns: m, largest: [0.0; 3] };
        for (i, j) in (0..fine.nrows()).flat_map(|i| (0..fine.ncols()).map(move |j| (i, j))) {
            let before = coarse.get((i, j)).map_or(0.0, |k| k.abs());
            let kind = bounds.kind(i, j);
            bounds.largest[kind] = bounds.largest[kind].max(fine[(i, j)].abs()).max(before);
        }
        // Eigenvectors mix strains and pressures, both in Pa.
        let [displacements, mixed, others] = bounds.largest;
        bounds.largest[1] = mixed.max((displacements * others).sqrt());
        bounds
    }

    /// How many of two rows are no displacements.
    fn kind(&self, i: usize, j: usize) -> usize {
        usize::from(i % self.unknowns >= 3) + usize::from(j % self.unknowns >= 3)
    }

    /// With displacements alone equal to 1e-13 of the rings' largest entry: sums of up to 16 terms,
    /// each exact to a few ε. With pressures to 1e-11 of the largest of their kind: corners are
    /// rounded to 24 ε of the shortest edge (their distance from the origin over it), gradients to
    /// three times that and energies to twice as much; eigenvectors of n = 10 rows are off by n² ε
    /// times a norm of up to n entries; up to eight tetrahedra add up. Soft rows see the rounding of
    /// stiff ones where a tetrahedron is stiff in one direction alone, or in one half.
    fn check(&self, what: &str, got: &DMatrix<f64>, want: &DMatrix<f64>) {
        assert_eq!(got.shape(), want.shape(), "{what}");
        let share = if self.unknowns == 3 { 1e-13 } else { 1e-11 };
        for (i, j) in (0..got.nrows()).flat_map(|i| (0..got.ncols()).map(move |j| (i, j))) {
            let limit = share * self.largest[self.kind(i, j)];
            let error = (got[(i, j)] - want[(i, j)]).abs();
            assert!(error <= limit, "{what} ({i}, {j}): {error:e}, want {limit:e}");
        }
    }
}

/// Compares the hand-over of `delta` with the assembly of its tetrahedra, and its factors with what
/// they stand for. Returns the coarse ring.
pub fn check_ring(
    element: Formulation<'_>,
    ring: &RingStiffness,
    delta: &MeshDelta,
    embedding: &Embedding,
    position: Positions<'_>,
) -> DMatrix<f64> {
    let (m, r) = (element.unknowns(), element.unknowns() * ring.vertices.len());
    let mut all = ring.vertices.clone();
    all.push(delta.vertex);
    let parents = delta.ring.iter().map(|t| &t.parent);
    let children = delta.ring.iter().flat_map(|t| &t.children);
    let coarse = assemble(element, &ring.vertices, parents, embedding, position);
    let fine = assemble(element, &all, children, embedding, position);
    let old = fine.view((0, 0), (r, r)).into_owned();
    let a12 = fine.view((0, r), (r, m)).into_owned();
    let a22 = fine.view((r, r), (m, m)).into_owned();
    // Condensing the assembled ring to d = u_M − H u_old takes no inverse: b = a12 + HᵀA22, and
    // with d = 0 the refined ring is K_p + F Fᵀ − N Nᵀ.
    let mut h = DMatrix::zeros(m, r);
    for (i, end) in (0..m).flat_map(|i| delta.edge.map(|end| (i, end))) {
        h[(i, m * ring.vertices.iter().position(|&v| v == end).unwrap() + i)] = 0.5;
    }
    let straight = &old + &a12 * &h + h.transpose() * a12.transpose() + h.transpose() * &a22 * &h;
    let bounds = Bounds::of(m, &fine, &coarse);
    let [b, f, n] = [&ring.b, &ring.positive, &ring.negative].map(dense);
    bounds.check("k_p", &dense(&ring.k_p), &coarse);
    bounds.check("k_c", &dense(&ring.k_c), &old);
    bounds.check("a12", &dense(&ring.a12), &a12);
    bounds.check("a22", &dense(&ring.a22), &a22);
    bounds.check("b", &b, &(&a12 + h.transpose() * &a22));
    bounds.check("F, N", &(&f * f.transpose() - &n * n.transpose()), &(straight - &coarse));
    coarse
}

fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

/// Random splits of random organs by all rules, each checked by [`check_ring`].
pub fn the_assembly_of_its_tetrahedra_is_the_ring(element: Formulation<'_>) {
    let poisson_ratio = if element.negative() > 0 { -0.5..0.499 } else { -0.5..0.49 };
    let picks = proptest::collection::vec(any::<Index>(), 12);
    let organs = organs([2, 1, 1], 3, 0.0..6.0, poisson_ratio);
    proptest!(cases(24), |(organ in organs, picks in picks, number in 0..4usize)| {
        let (mut forest, placement) = (organ.forest(1, 7), organ.placement(7));
        let embedding = organ.embedding_by(rule(number));
        let mut delta = MeshDelta::empty();
        for pick in picks {
            let candidates = forest.candidates();
            forest.split(candidates[pick.index(candidates.len())], &mut delta).unwrap();
            let position = |v| placement.position(forest.point(v));
            let ring = element.ring(&delta, &embedding, &position);
            check_ring(element, &ring, &delta, &embedding, &position);
            // Per tetrahedron one for each strain and other unknown; and the column of the edge, and
            // a lumped mass's three.
            let columns = ring.positive.ncols() + ring.negative.ncols();
            let most = 4 + (6 + 4 * (element.unknowns() - 3)) * delta.ring.len();
            prop_assert!(columns <= most, "{} of {}", columns, most);
        }
    });
}

/// The same numbers, bit by bit: going to and fro leaves nothing behind.
pub fn a_merge_hands_over_what_its_split_did(element: Formulation<'_>) {
    let organs = organs([1, 1, 1], 3, 0.0..6.0, 0.0..0.49);
    proptest!(cases(8), |(organ in organs, pick in any::<Index>())| {
        let (mut forest, placement) = (organ.forest(1, 5), organ.placement(5));
        let embedding = organ.embedding("laminate");
        let candidates = forest.candidates();
        let mut delta = MeshDelta::empty();
        let vertex = forest.split(candidates[pick.index(candidates.len())], &mut delta).unwrap();
        let points: Vec<_> = delta.ring.iter().flat_map(|t| t.parent.vertices).collect();
        let rest: Vec<_> = points.iter().map(|&v| placement.position(forest.point(v))).collect();
        let position = |v| rest[points.iter().position(|&w| w == v).unwrap()];
        let there = element.ring(&delta, &embedding, &position);
        forest.merge(vertex, &mut delta).unwrap();
        let back = element.ring(&delta, &embedding, &position);
        prop_assert_eq!(&there.vertices, &back.vertices);
        let parts = |r: &RingStiffness| [&r.k_p, &r.k_c, &r.a12, &r.a22, &r.b].map(dense);
        prop_assert_eq!(parts(&there), parts(&back));
    });
}
