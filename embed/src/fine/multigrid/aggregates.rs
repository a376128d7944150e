//! Which vertices stand together for one coarse vertex, and what of rigid motion they keep.

use nalgebra::{Matrix6, SMatrix};
use yawara_mesh::kuhn::Point;

use super::rows::BlockRows;

/// Not in an aggregate yet.
const NONE: u32 = u32::MAX;

/// Unknowns below which an aggregate joins another: fewer than three points can't turn freely.
const FRAGMENT: usize = 9;

/// What orthogonalisation leaves of a dependent column, over its length.
const DEPENDENT: f64 = 1e-6;

/// The aggregate of each vertex and the place of each aggregate: what is strongly coupled inside a
/// box of 3³ places stands together, and a fragment that is too small to turn joins the vertex
/// elsewhere that it is coupled to hardest.
///
/// Boxes rather than neighbourhoods (Vaněk, Mandel, Brezina, Computing 56, 1996) keep the coarse
/// matrix at some 27 blocks a row.
pub(super) fn aggregates<const N: usize>(
    a: &BlockRows<N, N>,
    places: &[Point],
    strong: f64,
) -> (Vec<u32>, Vec<Point>) {
    let size = |i: usize| {
        let diagonal = a.row(i).find(|&at| a.columns[at] as usize == i);
        diagonal.map_or(0.0, |at| a.blocks[at].norm())
    };
    let sizes: &Vec<f64> = &(0..a.len()).map(size).collect();
    // Strong neighbours and how hard they hold.
    let strong = |i: usize| {
        a.row(i).filter_map(move |at| {
            let j = a.columns[at] as usize;
            let coupling = a.blocks[at].norm_squared();
            let is_strong = j != i && coupling > strong * sizes[i] * sizes[j];
            is_strong.then_some((j, coupling / sizes[j]))
        })
    };
    let boxed: Vec<Point> = places.iter().map(|p| p.map(|c| c.div_euclid(3))).collect();
    let mut of = vec![NONE; a.len()];
    let mut members: Vec<Vec<usize>> = Vec::new();
    for i in 0..a.len() {
        if of[i] != NONE {
            continue;
        }
        let number = members.len() as u32;
        let mut found = vec![i];
        of[i] = number;
        let mut next = 0;
        while next < found.len() {
            for (j, _) in strong(found[next]) {
                if of[j] == NONE && boxed[j] == boxed[i] {
                    of[j] = number;
                    found.push(j);
                }
            }
            next += 1;
        }
        members.push(found);
    }
    let is_fragment = |aggregate: u32| N * members[aggregate as usize].len() < FRAGMENT;
    let mut joined = of.clone();
    for i in (0..a.len()).filter(|&i| is_fragment(of[i])) {
        let others = strong(i).filter(|(j, _)| !is_fragment(of[*j]));
        if let Some((j, _)) = others.max_by(|a, b| a.1.total_cmp(&b.1)) {
            joined[i] = of[j];
        }
    }
    // Numbers without gaps, in the order of the vertices.
    let mut numbers = vec![NONE; members.len()];
    let mut coarse = Vec::new();
    for i in 0..a.len() {
        let number = &mut numbers[joined[i] as usize];
        if *number == NONE {
            *number = coarse.len() as u32;
            coarse.push(boxed[i]);
        }
        joined[i] = *number;
    }
    (joined, coarse)
}

/// Orthonormal columns per aggregate that span what `modes` are there, one block per vertex; and the
/// modes in their terms. A column of an aggregate that is too small for six is zero.
pub(super) fn tentative<const N: usize>(
    of: &[u32],
    count: usize,
    modes: &[SMatrix<f64, N, 6>],
) -> (BlockRows<N, 6>, Vec<Matrix6<f64>>) {
    let mut members = vec![Vec::new(); count];
    of.iter().enumerate().for_each(|(i, &aggregate)| members[aggregate as usize].push(i));
    let mut blocks = modes.to_vec();
    let mut coarse = vec![Matrix6::zeros(); count];
    for (members, r) in members.iter().zip(&mut coarse) {
        for k in 0..6 {
            let dot = |blocks: &[SMatrix<f64, N, 6>], a: usize, b: usize| -> f64 {
                members.iter().map(|&i| blocks[i].column(a).dot(&blocks[i].column(b))).sum()
            };
            let length = dot(&blocks, k, k).sqrt();
            // Twice: once leaves rounding of the order of the offset.
            for l in (0..k).chain(0..k) {
                let along = dot(&blocks, l, k);
                r[(l, k)] += along;
                for &i in members {
                    let taken = along * blocks[i].column(l);
                    let mut column = blocks[i].column_mut(k);
                    column -= taken;
                }
            }
            let left = dot(&blocks, k, k).sqrt();
            let keep = left > DEPENDENT * length;
            r[(k, k)] = if keep { left } else { 0.0 };
            let scale = if keep { 1.0 / left } else { 0.0 };
            for &i in members {
                let mut column = blocks[i].column_mut(k);
                column *= scale;
            }
        }
    }
    let starts = (0..=of.len()).collect();
    (BlockRows { starts, columns: of.to_vec(), blocks }, coarse)
}
