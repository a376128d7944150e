//! Every homogenisation against what theory says of it: bounds, layers, one material, extremes.

use std::ops::ControlFlow;
use std::sync::Arc;

use nalgebra::{Matrix6, SMatrix, Vector3};
use proptest::prelude::*;
use yawara_embed::{
    CHOICES, ChildPair, EmbedError, Embedding, FineMaterial, LinearTet, Material, Materials,
    by_name, isotropic,
};
use yawara_mesh::volume::{Grid, LabelVolume};
use yawara_mesh::{CellGrid, Content, LabelTree, NodeRef};
use yawara_tests::organ::{Organ, organs};

/// Every node of a tree with its level.
fn nodes(tree: &LabelTree) -> Vec<(NodeRef, u8)> {
    let cells: usize = tree.grid().cells.iter().product();
    let mut open: Vec<(NodeRef, u8)> =
        (0..6 * cells).map(|i| (tree.root(i / 6, i % 6), 0)).collect();
    let mut nodes = Vec::new();
    while let Some((node, level)) = open.pop() {
        if let Content::Node(_) = node.open() {
            nodes.push((node, level));
            let halves = tree.children(node);
            if halves[0] != node {
                open.extend(halves.map(|half| (half, level + 1)));
            }
        }
    }
    nodes
}

/// A cube of `voxels`³, one root cube, all of label 1 and kept per voxel.
fn varying(voxels: usize) -> Arc<LabelTree> {
    let grid = Grid::centred([voxels; 3], 1.0);
    let volume = LabelVolume::new(grid, vec![1; voxels.pow(3)], vec![0, 1]).unwrap();
    let grid = CellGrid { cells: [1; 3], voxels_per_cell: voxels, first_voxel: [0; 3] };
    Arc::new(LabelTree::per_voxel(&volume, grid, &|label| label == 1).unwrap())
}

fn embed(
    tree: &Arc<LabelTree>,
    materials: Materials,
    choice: &str,
) -> Result<Embedding, EmbedError> {
    let mut go_on = |_| ControlFlow::Continue(());
    Embedding::with_materials(Arc::clone(tree), materials, by_name(choice)?, &mut go_on)
}

fn plain(e: f64, nu: f64) -> Materials {
    Materials::from(vec![Material::new(e, nu, 0.0).unwrap(); 2])
}

/// The geometric mean of the strain stiffness falls by the published factors.
#[test]
fn the_paper_s_choice_collapses_and_the_others_do_not() {
    let tree = varying(8);
    let truth = isotropic(1.0, 0.3);
    for choice in CHOICES {
        let embedding = embed(&tree, plain(1.0, 0.3), choice).unwrap();
        assert_eq!(embedding.left_to_local_rule(), 0);
        for (levels, want) in [(3, 0.235), (6, 0.058), (9, 0.014)] {
            let means: Vec<f64> = nodes(&tree)
                .iter()
                .filter(|(_, level)| *level == 9 - levels)
                .map(|&(node, _)| {
                    (embedding.elasticity(node).determinant() / truth.determinant()).powf(1.0 / 6.0)
                })
                .collect();
            assert_eq!(means.len(), 6 << (9 - levels));
            for mean in means {
                let want = if *choice == "paper" { want } else { 1.0 };
                // Published to three decimals; equal halves are equal to rounding of six solves.
                let limit = if *choice == "paper" { 5.5e-4 } else { 1e-9 };
                assert!((mean - want).abs() < limit, "{choice} {levels}: {mean}");
            }
        }
    }
}

/// One material under many labels: its D at all nodes, hence the patch test.
#[test]
fn the_fine_body_of_one_material_is_that_material() {
    let mut organ = Organ::homogeneous([2, 1, 2], 1.0, 0.0);
    organ.labels.iter_mut().enumerate().for_each(|(i, label)| *label += (i % 5 % 2) as u16);
    organ.materials = vec![(7e3, 0.41); 2];
    let want = isotropic(7e3, 0.41);
    for choice in ["hierarchical", "kharevych"] {
        let embedding = organ.embedding(choice);
        assert_eq!(embedding.left_to_local_rule(), 0);
        for (node, _) in nodes(embedding.tree()) {
            let error = (embedding.elasticity(node) - want).amax() / want.amax();
            // Strains of a solve of condition 1e4.
            assert!(error < 1e-10, "{choice} {error:e}");
        }
    }
}

/// Effective matrix of layers across z (Backus, J. Geophysical Research 67(11), 1962).
fn backus(layers: [(f64, f64); 2]) -> Matrix6<f64> {
    let mean = |f: &dyn Fn(f64, f64) -> f64| {
        let of = |(e, nu): (f64, f64)| {
            let lambda = e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu));
            f(lambda, e / (2.0 * (1.0 + nu)))
        };
        0.5 * (of(layers[0]) + of(layers[1]))
    };
    let c33 = 1.0 / mean(&|l, m| 1.0 / (l + 2.0 * m));
    let ratio = mean(&|l, m| l / (l + 2.0 * m));
    let c13 = ratio * c33;
    let c11 = mean(&|l, m| 4.0 * m * (l + m) / (l + 2.0 * m)) + ratio * ratio * c33;
    let c12 = mean(&|l, m| 2.0 * m * l / (l + 2.0 * m)) + ratio * ratio * c33;
    let (c44, c66) = (1.0 / mean(&|_, m| 1.0 / m), mean(&|_, m| m));
    let mut d = Matrix6::from_diagonal(&[c11, c11, c33, c66, c44, c44].into());
    for (i, j, c) in [(0, 1, c12), (0, 2, c13), (1, 2, c13)] {
        d[(i, j)] = c;
        d[(j, i)] = c;
    }
    d
}

/// A TYPE2 tetrahedron whose bisected edge runs along z: the cut lies across it.
fn upright() -> LinearTet {
    let corners = [[0.0, 0.0, 0.0], [0.0, 0.0, 2.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0]];
    LinearTet::new(&corners.map(Vector3::from))
}

#[test]
fn laminate_is_exact_for_layers_along_the_cut() {
    for layers in [[(1.0, 0.3), (10.0, 0.2)], [(1.0, 0.49), (1e-3, 0.1)], [(5.0, -0.4), (1e4, 0.4)]]
    {
        let pair = ChildPair::new(&upright(), 0, 1, layers.map(|(e, nu)| isotropic(e, nu)));
        let got = by_name("laminate").unwrap().combine(&pair).elasticity;
        let want = backus(layers);
        // Cancellation of the stiffer layer's terms.
        assert!((got - want).amax() < 1e-12 * pair.mean_elasticity().amax(), "{got}{want}");
        assert!((got - want).amax() < 1e-10 * want.amax(), "{got}{want}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, ..ProptestConfig::default() })]

    /// Single voxels, cubes of nearly nothing but void, any ratio: finite and definite, or told.
    #[test]
    fn extremes_are_finite_and_definite_or_refused(
        grains in proptest::collection::vec((0..64usize, 1..4u16), 1..20),
        exponents in proptest::array::uniform3(0.0..9.0f64),
        ratios in proptest::array::uniform3(-0.9..0.4999f64),
        number in 0..5usize,
    ) {
        // The second cell is void but for what the first 64 voxels leave over: nothing.
        let mut labels = vec![0u16; 128];
        for (voxel, label) in grains {
            labels[voxel % 4 + 8 * (voxel / 4)] = label;
        }
        let volume =
            LabelVolume::new(Grid::centred([8, 4, 4], 1.0), labels, vec![0, 1, 2, 3]).unwrap();
        let grid = CellGrid { cells: [2, 1, 1], voxels_per_cell: 4, first_voxel: [0; 3] };
        let tree = Arc::new(LabelTree::new(&volume, grid).unwrap());
        let void = Material::new(1e-3, 0.0, 0.0).unwrap();
        let solid = (0..3).map(|i| Material::new(10f64.powf(exponents[i]), ratios[i], 1.0).unwrap());
        let materials: Vec<Material> = std::iter::once(void).chain(solid).collect();
        let choice = CHOICES[number];
        match Embedding::new(Arc::clone(&tree), materials, by_name(choice).unwrap()) {
            Ok(embedding) => for (node, _) in nodes(&tree) {
                let d = embedding.elasticity(node);
                prop_assert!(d.iter().all(|d| d.is_finite()) && d == d.transpose());
                prop_assert!(d.cholesky().is_some(), "{} {}", choice, d.symmetric_eigenvalues());
            },
            // The local rules must not give up; a fine solve may, in words.
            Err(error) => {
                let global = by_name(choice).unwrap().global().is_some();
                prop_assert!(global, "{} {}", choice, error);
                let told = matches!(
                    error,
                    EmbedError::FineFactor { .. } | EmbedError::NotPositiveDefinite { .. }
                );
                prop_assert!(told, "{}", error);
            }
        }
    }

    /// X and D_p of every choice annihilate rigid motions: they see strains alone.
    #[test]
    fn rigid_motions_strain_nothing_by_any_choice(
        organ in organs([1, 1, 1], 3, 0.0..6.0, 0.0..0.49),
        shift in proptest::array::uniform3(-1.0..1.0f64),
        spin in proptest::array::uniform3(-1.0..1.0f64),
        number in 0..5usize,
    ) {
        let (shift, spin) = (Vector3::from(shift), Vector3::from(spin));
        let embedding = organ.embedding(CHOICES[number]);
        let (forest, placement) = (organ.forest(3, 3), organ.placement(3));
        for tet in forest.leaves() {
            let corners = tet.vertices.map(|v| placement.position(forest.point(v)));
            let geometry = LinearTet::new(&corners);
            let k = geometry.stiffness(&embedding.elasticity(tet.node));
            let moved = corners.map(|x| shift + spin.cross(&x));
            let u = SMatrix::<f64, 12, 1>::from_fn(|i, _| moved[i / 3][i % 3]);
            prop_assert!((k * u).amax() <= 1e-12 * k.amax() * u.amax());
            let x = embedding.combine(tet.node, &geometry, tet.level).1.midpoint;
            let strain = yawara_embed::strain_from_gradient(&geometry.gradient(&moved));
            prop_assert!((x * strain).amax() <= 1e-12 * u.amax());
        }
    }

    /// The Voigt mean of everything inside is an upper bound of every node.
    #[test]
    fn linear_is_the_mean_and_laminate_is_below(
        organ in organs([1, 1, 1], 3, 0.0..6.0, -0.9..0.49),
    ) {
        let [linear, laminate] = ["linear", "laminate"].map(|choice| organ.embedding(choice));
        for (node, _) in nodes(linear.tree()) {
            let (voigt, d) = (linear.elasticity(node), laminate.elasticity(node));
            prop_assert!((voigt - d).symmetric_eigenvalues().min() > -1e-9 * voigt.amax());
        }
    }

    #[test]
    fn the_number_of_threads_changes_nothing(
        organ in organs([3, 1, 1], 3, 0.0..6.0, 0.0..0.49),
        number in 0..5usize,
    ) {
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| organ.embedding(CHOICES[number]))
        };
        let [one, three] = [1, 3].map(with);
        prop_assert_eq!(one.left_to_local_rule(), three.left_to_local_rule());
        for (node, _) in nodes(one.tree()) {
            prop_assert_eq!(one.elasticity(node), three.elasticity(node));
        }
    }

    /// The same materials told per voxel and per label.
    #[test]
    fn a_function_of_voxels_is_what_labels_are(
        organ in organs([2, 1, 1], 3, 0.0..6.0, 0.0..0.49),
        number in 0..4usize,
    ) {
        let choice = ["laminate", "linear", "hierarchical", "kharevych"][number];
        let by_label = organ.embedding(choice);
        let tree = by_label.tree();
        let all = Arc::new(
            LabelTree::per_voxel(&organ.volume(), *tree.grid(), &|label| label == 2).unwrap(),
        );
        let (labels, dims) = (organ.labels.clone(), organ.cells.map(|n| 4 * n as i64));
        let moduli = organ.materials.clone();
        let material = move |label: u16| {
            let (e, nu) = moduli[usize::from(label) - 1];
            Material::new(e, nu, 1000.0).map(FineMaterial::from)
        };
        // What label 2 is made of is known to the function alone.
        let list = [1, 1, 1, 3].map(|label| material(label).unwrap());
        let materials = Materials::new(list).with_voxels(move |[x, y, z], label| {
            let at = (x + dims[0] * (y + dims[1] * z)) as usize;
            assert_eq!((labels[at], label), (2, 2));
            material(labels[at])
        });
        let by_voxel = embed(&all, materials, choice).unwrap();
        let mut open: Vec<_> = (0..12).map(|i| (tree.root(i / 6, i % 6), all.root(i / 6, i % 6))).collect();
        while let Some((a, b)) = open.pop() {
            let (want, got) = (by_label.elasticity(a), by_voxel.elasticity(b));
            // Global rules find the same by one more product where a subtree is of label 2.
            if number < 2 || matches!(a.open(), Content::Node(_)) {
                prop_assert!((got - want).amax() <= 1e-7 * want.amax(), "{}{}", got, want);
            }
            prop_assert!((by_label.density(a) - by_voxel.density(b)).abs() < 1e-9);
            if let Content::Node(_) = a.open() {
                open.extend(tree.children(a).into_iter().zip(all.children(b)));
            }
        }
    }
}

#[test]
fn fibres_keep_their_direction() {
    // Stiff along x in the lower half, along y in the upper one.
    let fibre = |axis: usize| {
        let mut d = isotropic(1.0, 0.3);
        d[(axis, axis)] += 100.0;
        FineMaterial::new(d, 1.0).unwrap()
    };
    let tree = varying(4);
    for choice in ["laminate", "linear", "hierarchical", "kharevych"] {
        let list = Materials::new([fibre(2); 2])
            .with_voxels(move |voxel, _| Ok(fibre(usize::from(voxel[2] >= 2))));
        let embedding = embed(&tree, list, choice).unwrap();
        for (node, level) in nodes(&tree) {
            let d = embedding.elasticity(node);
            if level == 6 {
                let along = usize::from(d[(1, 1)] > d[(0, 0)]);
                assert_eq!(d, *fibre(along).elasticity());
            }
            // Of fibres along z there are none. A tetrahedron that does not span its layer slips
            // past the fibres by a global rule: no lower bound holds there.
            assert!(d[(2, 2)] < 2.0, "{choice}: {d}");
            assert!(
                d[(0, 0)] + d[(1, 1)] > 3.0 || by_name(choice).unwrap().global().is_some(),
                "{choice}: {d}"
            );
        }
    }
}

#[test]
fn what_is_no_elasticity_is_refused() {
    let mut bad = Matrix6::identity();
    bad[(2, 4)] = f64::NAN;
    let error = FineMaterial::new(bad, 1.0).unwrap_err();
    assert!(matches!(error, EmbedError::NotFinite { row: 2, column: 4, .. }), "{error}");
    bad[(2, 4)] = 0.1;
    let error = FineMaterial::new(bad, 1.0).unwrap_err();
    assert!(matches!(error, EmbedError::Elasticity { asymmetry: 0.1, .. }), "{error}");
    let mut flat = Matrix6::identity();
    flat[(3, 3)] = -1e-3;
    let error = FineMaterial::new(flat, 1.0).unwrap_err();
    assert!(error.to_string().contains("-1e-3 Pa"), "{error}");
    for density in [-1.0, f64::NAN, f64::INFINITY] {
        let error = FineMaterial::new(Matrix6::identity(), density).unwrap_err();
        assert!(matches!(error, EmbedError::Range { what: "density_kg_m3", .. }), "{error}");
    }
    // Errors of a user's function come back as they are.
    let refuse = Materials::new([FineMaterial::new(Matrix6::identity(), 0.0).unwrap(); 2])
        .with_voxels(|_, _| Material::new(1.0, 0.7, 0.0).map(FineMaterial::from));
    for choice in CHOICES {
        let list = Materials::new(refuse.by_label().to_vec())
            .with_voxels(|_, _| Material::new(1.0, 0.7, 0.0).map(FineMaterial::from));
        let error = embed(&varying(2), list, choice).err().unwrap();
        assert!(matches!(error, EmbedError::Range { value: 0.7, .. }), "{choice}: {error}");
    }
}
