//! The procedural liver: anatomy, one connected body, Murray's law, determinism.

use yawara_mesh::ImageError;
use yawara_mesh::phantom::{LiverPhantom, PARENCHYMA, VesselSegment, block, liver, vessel_tree};
use yawara_mesh::volume::LabelVolume;

const SEEDS: [u64; 4] = [0, 1, 7, u64::MAX];

fn voxel_ml(volume: &LabelVolume) -> f64 {
    volume.grid().spacing_mm.powi(3) / 1000.0
}

/// Number of bodies of non-background voxels joined over faces, counted by union-find.
fn bodies(volume: &LabelVolume) -> usize {
    let [nx, ny, nz] = volume.grid().dims;
    let mut root: Vec<usize> = (0..volume.labels().len()).collect();
    fn find(root: &mut [usize], mut i: usize) -> usize {
        while root[i] != i {
            root[i] = root[root[i]];
            i = root[i];
        }
        i
    }
    let mut count = 0;
    for (z, y, x) in (0..nz)
        .flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| (z, y, x))))
        .filter(|&(z, y, x)| volume.get(x, y, z) != 0)
    {
        count += 1;
        let here = x + nx * (y + ny * z);
        let earlier = [(x, 1), (y, nx), (z, nx * ny)];
        for (coordinate, stride) in earlier {
            if coordinate > 0 && volume.labels()[here - stride] != 0 {
                let (a, b) = (find(&mut root, here), find(&mut root, here - stride));
                if a != b {
                    root[a] = b;
                    count -= 1;
                }
            }
        }
    }
    count
}

#[test]
fn has_the_parts_of_a_liver() {
    for seed in SEEDS {
        let volume = liver(LiverPhantom { seed, ..LiverPhantom::default() }).unwrap();
        assert_eq!(volume.values(), [0, 1, 2, 3, 4]);
        let ml: Vec<f64> = volume.counts().iter().map(|&n| n as f64 * voxel_ml(&volume)).collect();
        let organ: f64 = ml[1..].iter().sum();
        // Grown-ups: liver 1.0 to 1.8 l, gallbladder 15 to 50 ml.
        assert!((1000.0..1800.0).contains(&organ), "organ {organ} ml");
        assert!((0.01..0.10).contains(&(ml[2] / organ)), "vessels {}", ml[2] / organ);
        assert!((15.0..50.0).contains(&ml[3]), "gallbladder {} ml", ml[3]);
        // A ball of radius 0.06 lengths, of which vessels take nothing.
        let ball = 4.0 / 3.0 * std::f64::consts::PI * 1.2f64.powi(3);
        assert!((ml[4] / ball - 1.0).abs() < 0.05, "tumour {} ml, want {ball}", ml[4]);
    }
}

#[test]
fn tapers_from_right_to_left() {
    let volume = liver(LiverPhantom::default()).unwrap();
    let [nx, ny, nz] = volume.grid().dims;
    let section = |x: usize| {
        (0..nz)
            .flat_map(|z| (0..ny).map(move |y| (y, z)))
            .filter(|&(y, z)| volume.get(x, y, z) != 0)
            .count()
    };
    // x runs to the right: the left lobe's sections come first.
    let (left, middle, right) = (section(nx / 8), section(nx * 3 / 8), section(nx * 11 / 16));
    assert!(3 * left < middle && middle < right, "{left}, {middle}, {right}");
}

#[test]
fn is_as_long_as_asked() {
    for (length_mm, voxel_mm) in [(200.0, 2.0), (150.0, 3.0), (30.0, 0.25)] {
        let volume = liver(LiverPhantom { length_mm, voxel_mm, seed: 2 }).unwrap();
        let [low, high] = volume.bounding_box().unwrap();
        let found = (high[0] + 1 - low[0]) as f64 * voxel_mm;
        assert!((found - length_mm).abs() <= 2.0 * voxel_mm, "{found} for {length_mm} mm");
    }
}

#[test]
fn is_one_body_with_background_around() {
    for (length_mm, voxel_mm) in [(200.0, 12.5), (200.0, 5.3), (200.0, 2.0), (100.0, 0.9)] {
        for seed in SEEDS {
            let volume = liver(LiverPhantom { length_mm, voxel_mm, seed }).unwrap();
            assert_eq!(bodies(&volume), 1, "{voxel_mm} mm, seed {seed}");
            let [low, high] = volume.bounding_box().unwrap();
            for axis in 0..3 {
                assert!(low[axis] >= 1 && high[axis] + 2 <= volume.grid().dims[axis]);
            }
        }
    }
}

#[test]
fn every_label_survives_coarse_voxels() {
    let volume = liver(LiverPhantom { voxel_mm: 5.0, ..LiverPhantom::default() }).unwrap();
    assert!(volume.counts().iter().all(|&n| n > 0), "{:?}", volume.counts());
}

#[test]
fn the_grid_lies_around_the_origin() {
    let volume = liver(LiverPhantom::default()).unwrap();
    let grid = volume.grid();
    let size_m = nalgebra::Vector3::from(grid.dims.map(|d| d as f64 * grid.spacing_mm * 1e-3));
    assert!(grid.to_ras_mm(size_m * 0.5).norm() < 1e-9);
    assert_eq!(grid.rotation, nalgebra::Matrix3::identity());
}

#[test]
fn volume_goes_with_the_cube_of_the_length() {
    let litres = |length_mm: f64| {
        let volume = liver(LiverPhantom { length_mm, voxel_mm: 2.0, seed: 1 }).unwrap();
        volume.counts()[1..].iter().sum::<u64>() as f64 * voxel_ml(&volume)
    };
    let ratio = litres(240.0) / litres(120.0);
    // Voxels at the surface, about 6·(60)² of 60³·0.17, are right to some percent.
    assert!((ratio / 8.0 - 1.0).abs() < 0.02, "{ratio}");
}

#[test]
fn the_seed_alone_decides() {
    let of = |seed| liver(LiverPhantom { seed, ..LiverPhantom::default() }).unwrap();
    assert_eq!(of(3), of(3));
    // In one thread as in many.
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(alone.install(|| of(3)), of(3));
    let (a, b) = (of(3), of(4));
    let vessels = |v: &LabelVolume| v.labels().iter().map(|&id| id == 2).collect::<Vec<_>>();
    assert_ne!(vessels(&a), vessels(&b));
    // The outline stays.
    let outline = |v: &LabelVolume| v.labels().iter().map(|&id| id != 0).collect::<Vec<_>>();
    assert_eq!(outline(&a), outline(&b));
}

fn children(tree: &[VesselSegment], parent: usize) -> Vec<&VesselSegment> {
    tree.iter().filter(|s| s.parent == Some(parent)).collect()
}

#[test]
fn vessels_fork_by_murrays_law() {
    for seed in SEEDS {
        let tree = vessel_tree(LiverPhantom { seed, ..LiverPhantom::default() }).unwrap();
        assert!(tree[0].parent.is_none());
        let mut forks = 0;
        for (i, segment) in tree.iter().enumerate() {
            assert!(i == 0 || segment.parent.is_some_and(|p| p < i));
            assert!(segment.radius > 0.0 && (segment.end - segment.start).norm() > 0.0);
            let branches = children(&tree, i);
            if branches.is_empty() {
                continue;
            }
            forks += 1;
            assert_eq!(branches.len(), 2);
            assert!(branches.iter().all(|b| b.start == segment.end));
            let cubes: f64 = branches.iter().map(|b| b.radius.powi(3)).sum();
            // Each radius is a cube root, exact to a few ε.
            assert!((cubes / segment.radius.powi(3) - 1.0).abs() < 32.0 * f64::EPSILON);
        }
        assert!(forks > 50, "{forks} forks");
        // A grown-up's portal vein is 10 to 14 mm wide.
        assert!((5.0..7.0).contains(&tree[0].radius));
    }
}

#[test]
fn vessels_reach_all_of_the_organ() {
    let tree = vessel_tree(LiverPhantom::default()).unwrap();
    let extent = |axis: usize| {
        let ends = tree.iter().map(|s| s.end[axis]);
        ends.clone().fold(f64::MIN, f64::max) - ends.fold(f64::MAX, f64::min)
    };
    // More than half the organ's 200 × 132 × 136 mm.
    assert!(extent(0) > 100.0 && extent(1) > 66.0 && extent(2) > 68.0);
}

#[test]
fn the_tree_and_the_voxels_agree() {
    let size = LiverPhantom { voxel_mm: 1.0, ..LiverPhantom::default() };
    let volume = liver(size).unwrap();
    let tree = vessel_tree(size).unwrap();
    let at = |p: nalgebra::Vector3<f64>| {
        let i = (p - volume.grid().origin_mm).map(|c| c as usize);
        volume.get(i.x, i.y, i.z)
    };
    // Middles of vessels wider than a voxel's diagonal, where no tumour covers them.
    let wide: Vec<_> = tree.iter().filter(|s| s.radius > 1.75).collect();
    let hits = wide.iter().filter(|s| at((s.start + s.end) * 0.5) == 2).count();
    assert!(wide.len() > 40 && hits * 100 >= wide.len() * 95, "{hits} of {}", wide.len());
}

#[test]
fn a_block_is_all_one_label() {
    let volume = block([4, 2, 3], 5.0).unwrap();
    assert_eq!((volume.values(), volume.counts()), (&[0, PARENCHYMA][..], vec![0, 24]));
    assert_eq!(volume.bounding_box(), Some([[0; 3], [3, 1, 2]]));
    assert_eq!(volume.grid().origin_mm, nalgebra::Vector3::new(-10.0, -5.0, -7.5));
}

#[test]
fn sizes_out_of_range_are_refused() {
    let default = LiverPhantom::default();
    for bad in [f64::NAN, f64::INFINITY, 0.0, -200.0, 1e-9, 1e9] {
        for size in
            [LiverPhantom { length_mm: bad, ..default }, LiverPhantom { voxel_mm: bad, ..default }]
        {
            assert!(
                matches!(liver(size).unwrap_err().problem(), ImageError::Parameter { .. }),
                "{size:?}"
            );
            assert!(
                matches!(vessel_tree(size).unwrap_err().problem(), ImageError::Parameter { .. }),
                "{size:?}"
            );
        }
    }
    for (cells, voxel_mm) in [
        ([0, 1, 1], 1.0),
        ([usize::MAX, 2, 2], 1.0),
        ([1 << 12, 1 << 12, 1 << 12], 1.0),
        ([1, 1, 1], f64::NAN),
        ([1, 1, 1], 0.0),
    ] {
        assert!(matches!(
            block(cells, voxel_mm).unwrap_err().problem(),
            ImageError::Parameter { .. }
        ));
    }
}
