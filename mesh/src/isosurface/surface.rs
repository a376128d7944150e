//! The surface of one level of a field, and how it follows the mesh.

use nalgebra::Vector3;

use super::cases::{EdgeKey, LED_BY, cap, edge_of, march};
use super::error::SurfaceError;
use crate::bisection::geometry::signed_volume;
use crate::bisection::kuhn::signed_volume6;
use crate::bisection::{BisectionForest, VertexId};

/// ε: how near a surface vertex may come to an end of its mesh edge, in lengths of the edge.
///
/// A mesh vertex exactly on the level would collapse the triangles around it to a point. The
/// clamp keeps them at a size of ε edges and moves the surface by at most ε edges: far below the
/// error O(edge²) of a linear surface on any mesh that is in use.
pub const EDGE_MARGIN: f64 = 1e-3;

/// One vertex of a surface: x = (1 − t) · x(a) + t · x(b).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceVertex {
    /// The ends a < b of the mesh edge; a = b for a mesh vertex on a capped hull.
    pub edge: [VertexId; 2],
    /// Place on the edge, \[ε, 1 − ε\]; 0 where a = b.
    pub t: f64,
}

/// What surface is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceOptions {
    /// The field's value on the surface; what is at least as high is inside.
    pub level: f64,
    /// Whether the parts of the mesh's hull that are inside belong to the surface, as if the
    /// field dropped below the level right behind the hull. Without them the surface is open
    /// where it meets the hull.
    pub close_at_hull: bool,
    /// The label that the surface is said to bound; not interpreted.
    pub label: u16,
}

impl SurfaceOptions {
    /// The boundary of a label in a blurred indicator: level ½, closed at the hull.
    pub fn of_label(label: u16) -> Self {
        Self { level: 0.5, close_at_hull: true, label }
    }
}

/// A triangulated surface that is bound to the edges of a tetrahedral mesh.
///
/// The numbers in it are those of the mesh it was made from: it is void after a split or merge
/// of one of its edges (vertex numbers are used again).
#[derive(Clone, Debug, PartialEq)]
pub struct IsoSurface {
    /// Vertices, ascending by edge.
    pub vertices: Vec<SurfaceVertex>,
    /// Corners by position in `vertices`, counter-clockwise seen from outside (from the lower
    /// field): first those on the level in the order of the tetrahedra, then those on the hull.
    pub triangles: Vec<[u32; 3]>,
    /// How many of `triangles` lie on the level; the others cap the hull.
    pub level_triangles: usize,
    /// The label that it bounds.
    pub label: u16,
}

impl IsoSurface {
    /// The surface on the leaves of a forest.
    ///
    /// `field`: one value per vertex number, at least [`BisectionForest::vertex_capacity`] many;
    /// entries of numbers not in use are ignored. Where root cubes of the domain touch in an
    /// edge only, a capped surface has four triangles around an edge, two in each direction.
    /// Cost: O(leaves + m log m) for m leaves with a corner inside.
    ///
    /// # Errors
    /// [`SurfaceError::EntryCount`] or [`SurfaceError::EntryNotFinite`] of the field,
    /// [`SurfaceError::IsoSurface`] if the level is not finite.
    pub fn of_forest(
        forest: &BisectionForest,
        field: &[f64],
        options: SurfaceOptions,
    ) -> Result<Self, SurfaceError> {
        let want = forest.vertex_capacity();
        if field.len() < want {
            return Err(SurfaceError::EntryCount { what: "field", found: field.len(), want });
        }
        for v in forest.vertices() {
            check_finite("field", v.index(), field[v.index()])?;
        }
        let cut = Cut::new(field, options)?;
        let tets = forest.leaves().map(|tet| tet.vertices).filter(|tet| cut.touches(tet));
        // Integer volumes have an exact sign.
        let turned = tets.map(|tet| {
            let positive = signed_volume6(&tet.map(|v| forest.point(v))) > 0;
            turn(tet, positive)
        });
        cut.surface(&turned.collect::<Vec<_>>())
    }

    /// The surface on any conforming list of tetrahedra, of either orientation.
    ///
    /// `positions` (m, at rest: a tetrahedron's orientation is read off them) and `field` have
    /// one entry per vertex number. Faces of one tetrahedron only are the hull.
    /// Cost: O(n + m log m) for m tetrahedra with a corner inside.
    ///
    /// # Errors
    /// [`SurfaceError::EntryCount`] if a corner has no field value or position,
    /// [`SurfaceError::EntryNotFinite`] if that of a corner is not finite, [`SurfaceError::FlatTet`],
    /// [`SurfaceError::IsoSurface`] if the level is not finite.
    pub fn of_tets(
        tets: &[[VertexId; 4]],
        positions: &[Vector3<f64>],
        field: &[f64],
        options: SurfaceOptions,
    ) -> Result<Self, SurfaceError> {
        let cut = Cut::new(field, options)?;
        let mut turned = Vec::new();
        for (index, tet) in tets.iter().enumerate() {
            for &v in tet {
                check_finite("field", v.index(), *entry("field", field, v)?)?;
                position(positions, v)?;
            }
            let volume = signed_volume(&tet.map(|v| positions[v.index()]));
            if volume == 0.0 || !volume.is_finite() {
                return Err(SurfaceError::FlatTet { tet: index, volume });
            }
            if cut.touches(tet) {
                turned.push(turn(*tet, volume > 0.0));
            }
        }
        cut.surface(&turned)
    }

    /// Where the surface is when the mesh vertices are at `x`, by vertex number:
    /// (1 − t) · x(a) + t · x(b), in the unit of `x`.
    ///
    /// # Errors
    /// [`SurfaceError::EntryCount`] if a vertex has no entry, [`SurfaceError::EntryNotFinite`] if one
    /// is not finite.
    pub fn positions(&self, x: &[Vector3<f64>]) -> Result<Vec<Vector3<f64>>, SurfaceError> {
        let place = |&SurfaceVertex { edge: [a, b], t }: &SurfaceVertex| {
            Ok((1.0 - t) * position(x, a)? + t * position(x, b)?)
        };
        self.vertices.iter().map(place).collect()
    }
}

fn position(positions: &[Vector3<f64>], v: VertexId) -> Result<Vector3<f64>, SurfaceError> {
    let position = *entry("positions", positions, v)?;
    position.iter().try_for_each(|&x| check_finite("positions", v.index(), x))?;
    Ok(position)
}

fn entry<'a, T>(what: &'static str, list: &'a [T], v: VertexId) -> Result<&'a T, SurfaceError> {
    let want = v.index() + 1;
    list.get(v.index()).ok_or(SurfaceError::EntryCount { what, found: list.len(), want })
}

fn check_finite(what: &'static str, index: usize, value: f64) -> Result<(), SurfaceError> {
    if value.is_finite() {
        Ok(())
    } else {
        Err(SurfaceError::EntryNotFinite { what, index, value })
    }
}

/// The same corners in an order of positive volume.
fn turn([a, b, c, d]: [VertexId; 4], positive: bool) -> [VertexId; 4] {
    if positive { [a, b, c, d] } else { [a, b, d, c] }
}

/// A field and the level that cuts it.
struct Cut<'a> {
    field: &'a [f64],
    options: SurfaceOptions,
}

impl<'a> Cut<'a> {
    fn new(field: &'a [f64], options: SurfaceOptions) -> Result<Self, SurfaceError> {
        let value = options.level;
        if !value.is_finite() {
            let (field, want) = ("level", "a finite number");
            return Err(SurfaceError::IsoSurface { field, value, want });
        }
        Ok(Self { field, options })
    }

    fn is_inside(&self, v: VertexId) -> bool {
        self.field[v.index()] >= self.options.level
    }

    /// True where a tetrahedron holds a part of the surface or of its inside.
    fn touches(&self, tet: &[VertexId; 4]) -> bool {
        tet.iter().any(|&v| self.is_inside(v))
    }

    /// `tets`: those of positive volume that touch the inside.
    fn surface(&self, tets: &[[VertexId; 4]]) -> Result<IsoSurface, SurfaceError> {
        let mut triangles = Vec::new();
        for tet in tets {
            march(tet, tet.map(|v| self.is_inside(v)), &mut triangles);
        }
        let level_triangles = triangles.len();
        if self.options.close_at_hull {
            for face in self.hull_faces(tets) {
                cap(&face, face.map(|v| self.is_inside(v)), &mut triangles);
            }
        }
        let mut keys: Vec<EdgeKey> = triangles.iter().flatten().copied().collect();
        keys.sort_unstable();
        keys.dedup();
        if keys.len() > u32::MAX as usize {
            let (value, want) = (keys.len() as f64, "fewer than 2^32");
            return Err(SurfaceError::IsoSurface { field: "number of vertices", value, want });
        }
        let number = |key: EdgeKey| keys.partition_point(|&k| k < key) as u32;
        Ok(IsoSurface {
            triangles: triangles.iter().map(|triangle| triangle.map(number)).collect(),
            vertices: keys.iter().map(|&key| self.vertex(key)).collect(),
            level_triangles,
            label: self.options.label,
        })
    }

    /// The faces of one tetrahedron only that have a corner inside, turned outwards, in the
    /// order of the tetrahedra.
    fn hull_faces(&self, tets: &[[VertexId; 4]]) -> Vec<[VertexId; 3]> {
        let mut faces = Vec::new();
        for (index, tet) in tets.iter().enumerate() {
            for (opposite, [_, a, b, c]) in LED_BY.into_iter().enumerate() {
                let mut face = [tet[a], tet[b], tet[c]];
                if face.iter().any(|&v| self.is_inside(v)) {
                    face.sort_unstable();
                    faces.push((face, index, opposite));
                }
            }
        }
        faces.sort_unstable();
        let mut hull: Vec<(usize, usize)> = faces
            .chunk_by(|one, other| one.0 == other.0)
            .filter(|same| same.len() == 1)
            .map(|same| (same[0].1, same[0].2))
            .collect();
        hull.sort_unstable();
        let turned = |(index, opposite): (usize, usize)| {
            let [_, a, b, c]: [usize; 4] = LED_BY[opposite];
            [a, b, c].map(|i| tets[index][i])
        };
        hull.into_iter().map(turned).collect()
    }

    fn vertex(&self, key: EdgeKey) -> SurfaceVertex {
        let edge @ [a, b] = edge_of(key);
        if a == b {
            return SurfaceVertex { edge, t: 0.0 };
        }
        // Halves, because the difference of two large values overflows.
        let [low, high, level] =
            [self.field[a.index()], self.field[b.index()], self.options.level].map(|f| 0.5 * f);
        let t = (level - low) / (high - low);
        // The halves of two subnormal values may be equal.
        let t = if t.is_nan() { 0.5 } else { t.clamp(EDGE_MARGIN, 1.0 - EDGE_MARGIN) };
        SurfaceVertex { edge, t }
    }
}
