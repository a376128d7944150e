//! A fixed tetrahedral mesh, as other programs make it: no bisection, no refinement.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::error::TetMeshError;
use super::{check, faces};
use crate::bisection::geometry::{Placement, Quality, signed_volume};
use crate::bisection::{BisectionForest, Tet};

/// A valid tetrahedral mesh with a material tag per tetrahedron.
///
/// Every corner is a finite point, every point a corner; signed volumes are positive and no
/// tetrahedron is flat; a face has one tetrahedron or one on each side, but for sheets of a cut body
/// ([`with_sheets`](Self::with_sheets)).
#[derive(Clone, Debug, PartialEq)]
pub struct PlainMesh {
    points: Vec<Vector3<f64>>,
    tets: Vec<[u32; 4]>,
    tags: Vec<i64>,
}

/// What was changed to make a mesh valid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Repairs {
    /// Tetrahedra of negative volume whose last two corners were swapped.
    pub rewound: usize,
    /// Points that were no corner of any tetrahedron, taken out.
    pub dropped_points: usize,
}

/// What a mesh file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadedMesh {
    /// The tetrahedra, in the order of the file.
    pub mesh: PlainMesh,
    /// What was repaired.
    pub repairs: Repairs,
    /// Points, edges, triangles and other elements that were passed over.
    pub ignored_elements: usize,
    /// Names of material tags, where the format has them.
    pub names: BTreeMap<i64, String>,
}

impl PlainMesh {
    /// A mesh of `points` (m), corners `tets` and one material tag per tetrahedron.
    ///
    /// Tetrahedra of negative volume are rewound (their last two corners swapped) and points
    /// that no tetrahedron uses are dropped, the others keeping their order; both are counted
    /// and warned of. Tetrahedra keep their order.
    ///
    /// Cost: O(n log n) in the number of tetrahedra, for the faces.
    ///
    /// # Errors
    /// By index: [`TetMeshError::NoTets`], [`TetMeshError::TooMany`],
    /// [`TetMeshError::ListLength`] (tags), [`TetMeshError::NotFinite`],
    /// [`TetMeshError::CornerOutOfRange`], [`TetMeshError::RepeatedCorner`],
    /// [`TetMeshError::DegenerateTet`] where |V| ≤ [`FLATNESS`](super::FLATNESS) · (longest edge)³,
    /// [`TetMeshError::NonManifoldFace`], [`TetMeshError::OverlappingTets`].
    pub fn new(
        points: Vec<Vector3<f64>>,
        tets: Vec<[u32; 4]>,
        tags: Vec<i64>,
    ) -> Result<(Self, Repairs), TetMeshError> {
        Self::checked(points, tets, tags, faces::check)
    }

    /// The same of a body that may be cut: tetrahedra may lie in the same place, as parts of one that a cut has
    /// parted do, and where a cut ends more than two share a face.
    ///
    /// Cost: O(n) in the number of tetrahedra.
    ///
    /// # Errors
    /// As [`PlainMesh::new`], but for those of faces.
    pub fn with_sheets(
        points: Vec<Vector3<f64>>,
        tets: Vec<[u32; 4]>,
        tags: Vec<i64>,
    ) -> Result<(Self, Repairs), TetMeshError> {
        Self::checked(points, tets, tags, |_| Ok(()))
    }

    fn checked(
        points: Vec<Vector3<f64>>,
        mut tets: Vec<[u32; 4]>,
        tags: Vec<i64>,
        faces: impl Fn(&[[u32; 4]]) -> Result<(), TetMeshError>,
    ) -> Result<(Self, Repairs), TetMeshError> {
        check::lists(&points, &tets, &tags)?;
        let rewound = check::rewind(&points, &mut tets)?;
        faces(&tets)?;
        let before = points.len();
        let points = check::drop_unused(points, &mut tets);
        let repairs = Repairs { rewound, dropped_points: before - points.len() };
        if rewound > 0 {
            tracing::warn!(rewound, tets = tets.len(), "tets of negative volume were rewound");
        }
        if repairs.dropped_points > 0 {
            tracing::warn!(dropped = repairs.dropped_points, "points of no tet were dropped");
        }
        Ok((Self { points, tets, tags }, repairs))
    }

    /// The leaves of a forest as they are now, tagged by `tag`.
    ///
    /// Points come in the order of [`BisectionForest::vertices`], tetrahedra in that of
    /// [`BisectionForest::leaves`], so that fields per vertex and per leaf carry over. Corners
    /// of leaves of negative orientation are swapped.
    ///
    /// Cost: O(n log n) in the number of leaves.
    ///
    /// # Errors
    /// As [`PlainMesh::new`], e.g. if the placement is not finite.
    pub fn from_forest(
        forest: &BisectionForest,
        placement: &Placement,
        tag: impl Fn(&Tet) -> i64,
    ) -> Result<Self, TetMeshError> {
        let mut numbers = vec![u32::MAX; forest.vertex_capacity()];
        let mut points = Vec::with_capacity(forest.vertex_count());
        for vertex in forest.vertices() {
            numbers[vertex.index()] = points.len() as u32;
            points.push(placement.position(forest.point(vertex)));
        }
        let mut tets = Vec::with_capacity(forest.leaf_count());
        let mut tags = Vec::with_capacity(forest.leaf_count());
        for leaf in forest.leaves() {
            let mut corners = leaf.vertices.map(|v| numbers[v.index()]);
            // Half of all leaves are mirrored by construction, which is nothing to warn of.
            if signed_volume(&corners.map(|i| points[i as usize])) < 0.0 {
                corners.swap(2, 3);
            }
            tets.push(corners);
            tags.push(tag(&leaf));
        }
        Ok(Self::new(points, tets, tags)?.0)
    }

    /// Positions, m.
    pub fn points(&self) -> &[Vector3<f64>] {
        &self.points
    }

    /// Corners, as positions in [`PlainMesh::points`], of positive signed volume.
    pub fn tets(&self) -> &[[u32; 4]] {
        &self.tets
    }

    /// Material tag of each tetrahedron; 0 where the file has none.
    pub fn tags(&self) -> &[i64] {
        &self.tags
    }

    /// Positions of the corners of tetrahedron `tet` (below the number of them), m.
    pub fn corners(&self, tet: usize) -> [Vector3<f64>; 4] {
        self.tets[tet].map(|i| self.points[i as usize])
    }

    /// Sum of all volumes, m³. Cost: O(n).
    pub fn volume(&self) -> f64 {
        (0..self.tets.len()).map(|tet| signed_volume(&self.corners(tet))).sum()
    }

    /// The worst of each measure of shape over all tetrahedra. Cost: O(n).
    pub fn quality(&self) -> Quality {
        let first = Quality::of(&self.corners(0));
        (1..self.tets.len()).fold(first, |worst, tet| worst.worse(Quality::of(&self.corners(tet))))
    }

    /// The faces of one tetrahedron only, counter-clockwise as seen from outside, the smallest
    /// corner first, in ascending order of their sorted corners.
    ///
    /// Cost: O(n log n) in the number of tetrahedra.
    pub fn boundary_faces(&self) -> Vec<[u32; 3]> {
        faces::boundary(&self.tets)
    }

    /// Groups of tetrahedra connected over faces, each ascending, in the order of their first.
    ///
    /// Parts joined only by an edge or a point are different groups: such a joint is a
    /// mechanism. Cost: O(n log n) in the number of tetrahedra.
    pub fn components(&self) -> Vec<Vec<usize>> {
        faces::components(&self.tets)
    }
}
