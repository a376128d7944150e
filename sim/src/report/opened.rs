//! Surfaces where a cut, or a gap that was there from the start, has taken vertices apart.
//!
//! A surface's own vertices are carried by the mesh as if nothing were apart. Around vertices that have a twin each of its
//! triangles goes with the sheet that it lies in, and so do both sides of the cut itself, without its stairs.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

use nalgebra::Vector3;
use yawara_embed::LinearTet;
use yawara_mesh::geometry::FACES;
use yawara_mesh::isosurface::IsoSurface;
use yawara_mesh::{BisectionForest, FineFace, Placement, Point, Tet, TetId, VertexId, finest_at};

/// How far outside of a tetrahedron a point counts as in it, in barycentric coordinates.
const ROUNDING: f64 = 1e-9;

/// A corner that a point depends on by less does not carry it.
const NO_WEIGHT: f64 = 1e-7;

/// How often the vertices of a cut go to the middle of their neighbours.
const SMOOTHINGS: usize = 3;

/// A triangle beside material is looked for in it at so many half voxels below itself.
const BELOW: usize = 4;

/// A surface at rest and now, m.
pub(super) struct Opened {
    pub triangles: Vec<[u32; 3]>,
    pub rest: Vec<Vector3<f64>>,
    pub now: Vec<Vector3<f64>>,
}

impl Opened {
    /// The same without vertices that no triangle has.
    fn without_loose(mut self) -> Self {
        let mut number = vec![u32::MAX; self.rest.len()];
        self.triangles.iter().flatten().for_each(|&v| number[v as usize] = 0);
        let kept: Vec<usize> = (0..number.len()).filter(|&v| number[v] == 0).collect();
        kept.iter().zip(0..).for_each(|(&v, new)| number[v] = new);
        for points in [&mut self.rest, &mut self.now] {
            *points = kept.iter().map(|&v| points[v]).collect();
        }
        self.triangles.iter_mut().flatten().for_each(|v| *v = number[*v as usize]);
        self
    }
}

/// The leaves of a mesh around vertices that have twins.
pub(super) struct Gaps<'a> {
    forest: &'a BisectionForest,
    placement: Placement,
    /// Where there are several vertices.
    doubled: HashSet<Point>,
    leaves: Vec<Leaf>,
    /// The leaves that meet a cube of edge `bin_m`, by its place.
    bins: HashMap<[i32; 3], Vec<usize>>,
    bin_m: f64,
    faces: Vec<CutFace>,
    /// Where the vertices of cuts are drawn at rest, m.
    drawn: HashMap<Point, Vector3<f64>>,
}

struct Leaf {
    tet: Tet,
    first: Vector3<f64>,
    geometry: LinearTet,
    is_void: bool,
}

/// A severed face with material on both sides: its corners on the lattice of the finest level, outward of the first side.
struct CutFace {
    corners: [Point; 3],
    sides: [(Sheet, u16); 2],
}

/// A sheet, and the leaf whose place it has.
#[derive(Clone, Copy)]
struct Sheet {
    leaf: usize,
    vertices: [VertexId; 4],
}

/// What a vertex of an opened surface is made for.
#[derive(PartialEq, Eq, Hash)]
enum Origin {
    Surface(u32),
    Cut(Point),
}

/// A vertex of one side of a gap: which vertices of the mesh it has where others may have twins of these.
struct Side {
    has: Vec<(Point, VertexId)>,
    index: u32,
}

impl Leaf {
    /// Barycentric coordinates of a point.
    fn weights(&self, x: &Vector3<f64>) -> [f64; 4] {
        let [_, g1, g2, g3] = &self.geometry.gradients;
        let [b, c, d] = [g1, g2, g3].map(|g| g.dot(&(x - self.first)));
        [1.0 - b - c - d, b, c, d]
    }
}

impl<'a> Gaps<'a> {
    /// Those of a mesh that rests at `placement`; none where no vertex has a twin. Cost: O(vertices), and the finest
    /// tetrahedra beside cuts.
    pub fn of(forest: &'a BisectionForest, placement: Placement) -> Option<Self> {
        let is_twin = |v: &VertexId| forest.vertex_at(forest.point(*v)) != Some(*v);
        let doubled: HashSet<Point> =
            forest.vertices().filter(is_twin).map(|v| forest.point(v)).collect();
        if doubled.is_empty() {
            return None;
        }
        let mut found = Self {
            forest,
            placement,
            doubled,
            leaves: Vec::new(),
            bins: HashMap::new(),
            bin_m: 0.0,
            faces: Vec::new(),
            drawn: HashMap::new(),
        };
        found.find_leaves();
        found.find_faces();
        found.smooth();
        Some(found)
    }

    fn find_leaves(&mut self) {
        let forest = self.forest;
        let whole = forest.leaves().filter(|tet| forest.leaf_of(tet.id) == tet.id);
        let mut boxes = Vec::new();
        for tet in whole {
            let points = tet.vertices.map(|v| forest.point(v));
            if !points.iter().any(|p| self.doubled.contains(p)) {
                continue;
            }
            let corners = points.map(|p| self.placement.position(p));
            let [low, high] =
                corners.iter().fold([corners[0]; 2], |[low, high], x| [low.inf(x), high.sup(x)]);
            self.bin_m = self.bin_m.max(0.5 * (high - low).max());
            boxes.push([low, high]);
            let is_void = forest.tree().labels(tet.node).as_slice() == [0];
            let geometry = LinearTet::new(&corners);
            self.leaves.push(Leaf { tet, first: corners[0], geometry, is_void });
        }
        for (number, [low, high]) in boxes.iter().enumerate() {
            let [a, b] = [low, high].map(|x| self.bin(x));
            for x in a[0]..=b[0] {
                for y in a[1]..=b[1] {
                    for z in a[2]..=b[2] {
                        self.bins.entry([x, y, z]).or_default().push(number);
                    }
                }
            }
        }
    }

    fn bin(&self, x: &Vector3<f64>) -> [i32; 3] {
        ((x - self.placement.origin) / self.bin_m).map(|x| x.floor() as i32).into()
    }

    /// Edge of a lattice unit of the finest level, m.
    fn finest_m(&self) -> f64 {
        self.placement.unit / f64::from(self.forest.finest_units())
    }

    fn position(&self, p: Point) -> Vector3<f64> {
        self.placement.origin + self.finest_m() * Vector3::from(p.map(f64::from))
    }

    fn find_faces(&mut self) {
        let forest = self.forest;
        let numbers: HashMap<TetId, usize> =
            self.leaves.iter().enumerate().map(|(i, leaf)| (leaf.tet.id, i)).collect();
        let beside: BTreeSet<TetId> = forest.severed().flat_map(|severed| severed.leaves).collect();
        let mut open: BTreeMap<FineFace, ([Point; 3], (Sheet, u16))> = BTreeMap::new();
        for id in beside {
            let Some(&leaf) = numbers.get(&id) else { continue };
            for (number, fine) in forest.finest_in(&self.leaves[leaf].tet).iter().enumerate() {
                let severed =
                    (0..4).filter(|&i| fine.is_solid() && forest.is_severed(fine.faces[i]));
                for opposite in severed {
                    let vertices = forest.tet(forest.sheet_with(id, number)).vertices;
                    let side = (Sheet { leaf, vertices }, fine.label);
                    match open.remove(&fine.faces[opposite]) {
                        Some((corners, first)) => {
                            self.faces.push(CutFace { corners, sides: [first, side] })
                        }
                        None => {
                            let corners = outward(fine.corners, opposite);
                            open.insert(fine.faces[opposite], (corners, side));
                        }
                    }
                }
            }
        }
    }

    /// Takes the stairs of finest tetrahedra out of cuts; their rims stay rims.
    fn smooth(&mut self) {
        let mut edges: BTreeMap<[Point; 2], usize> = BTreeMap::new();
        for CutFace { corners: [a, b, c], .. } in &self.faces {
            for [a, b] in [[a, b], [b, c], [c, a]] {
                *edges.entry([*a.min(b), *a.max(b)]).or_default() += 1;
            }
        }
        let rim: HashSet<Point> =
            edges.iter().filter(|(_, faces)| **faces == 1).flat_map(|(edge, _)| *edge).collect();
        let counts =
            |edge: &[Point; 2], faces: usize| faces == 1 || !edge.iter().all(|p| rim.contains(p));
        let mut beside: BTreeMap<Point, Vec<Point>> = BTreeMap::new();
        for (edge, _) in edges.iter().filter(|(edge, faces)| counts(edge, **faces)) {
            for [a, b] in [[edge[0], edge[1]], [edge[1], edge[0]]] {
                if !rim.contains(&a) || rim.contains(&b) {
                    beside.entry(a).or_default().push(b);
                }
            }
        }
        let points = edges.keys().flatten().map(|&p| (p, self.position(p)));
        let mut drawn: HashMap<Point, Vector3<f64>> = points.collect();
        for _ in 0..SMOOTHINGS {
            let middle = |(p, beside): (&Point, &Vec<Point>)| {
                let sum: Vector3<f64> = beside.iter().map(|q| drawn[q]).sum();
                (*p, 0.5 * (drawn[p] + sum / beside.len() as f64))
            };
            let moved: Vec<(Point, Vector3<f64>)> = beside.iter().map(middle).collect();
            drawn.extend(moved);
        }
        self.drawn = drawn;
    }

    /// The leaf that a point at rest is in, if it is around twins.
    fn leaf_at(&self, x: &Vector3<f64>) -> Option<usize> {
        let near = self.bins.get(&self.bin(x))?;
        let holds = |&&number: &&usize| {
            self.leaves[number].weights(x).into_iter().all(|weight| weight >= -ROUNDING)
        };
        near.iter().find(holds).copied()
    }

    /// The sheet that a triangle at rest lies in, or that is below it; none where the mesh carries it as ever.
    fn sheet_of(&self, [a, b, c]: [Vector3<f64>; 3]) -> Option<Sheet> {
        let middle = (a + b + c) / 3.0;
        let below = (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_default()
            * (-0.5 * self.finest_m());
        let mut at = middle;
        let mut leaf = self.leaf_at(&at)?;
        for _ in 0..BELOW {
            if !self.leaves[leaf].is_void {
                break;
            }
            at += below;
            leaf = self.leaf_at(&at)?;
        }
        let Leaf { tet, .. } = &self.leaves[leaf];
        let finest =
            finest_at(self.leaves[leaf].weights(&at), tet.level, self.forest.finest_level());
        let vertices = self.forest.tet(self.forest.sheet_with(tet.id, finest)).vertices;
        vertices.iter().any(|&v| !self.is_first(v)).then_some(Sheet { leaf, vertices })
    }

    /// Whether a vertex is that of all splits and merges.
    fn is_first(&self, v: VertexId) -> bool {
        self.forest.vertex_at(self.forest.point(v)) == Some(v)
    }

    /// A `surface` that rests at `rest` and is now at `now`, with both sides of all gaps where the vertices of the mesh are
    /// at `x`, m, and with cuts through what it `shows`, by dense label.
    pub fn open(
        &self,
        surface: &IsoSurface,
        [rest, now]: [Vec<Vector3<f64>>; 2],
        x: &[Vector3<f64>],
        shows: impl Fn(u16) -> bool,
    ) -> Opened {
        let mut opening = Opening { gaps: self, x, sides: HashMap::new(), rest, now };
        let mut triangles = Vec::with_capacity(surface.triangles.len());
        for &corners in &surface.triangles {
            let at = corners.map(|v| opening.rest[v as usize]);
            triangles.push(match self.sheet_of(at) {
                Some(sheet) => corners.map(|v| {
                    let place = opening.rest[v as usize];
                    opening.vertex(Origin::Surface(v), place, place, &sheet)
                }),
                None => corners,
            });
        }
        for CutFace { corners, sides } in &self.faces {
            if !sides.iter().any(|(_, label)| shows(*label)) {
                continue;
            }
            let both = sides.each_ref().map(|(sheet, _)| {
                corners.map(|p| {
                    opening.vertex(Origin::Cut(p), self.position(p), self.drawn[&p], sheet)
                })
            });
            let [a, b, c] = both[1];
            if both[0] != both[1] {
                let outward = [both[0], [a, c, b]];
                let shown = outward.into_iter().zip(sides).filter(|(_, (_, label))| shows(*label));
                triangles.extend(shown.map(|(triangle, _)| triangle));
            }
        }
        Opened { triangles, rest: opening.rest, now: opening.now }.without_loose()
    }
}

/// A surface that is being opened.
struct Opening<'a> {
    gaps: &'a Gaps<'a>,
    x: &'a [Vector3<f64>],
    sides: HashMap<Origin, Vec<Side>>,
    rest: Vec<Vector3<f64>>,
    now: Vec<Vector3<f64>>,
}

impl Opening<'_> {
    /// The vertex at a `place` of the body at rest on the side of a gap where a `sheet` is, drawn somewhat beside it.
    fn vertex(
        &mut self,
        origin: Origin,
        place: Vector3<f64>,
        drawn: Vector3<f64>,
        sheet: &Sheet,
    ) -> u32 {
        let gaps = self.gaps;
        let leaf = &gaps.leaves[sheet.leaf];
        let both = sheet.vertices.into_iter().zip(leaf.weights(&place));
        let has: Vec<(Point, VertexId)> = both
            .filter(|(_, weight)| weight.abs() > NO_WEIGHT)
            .map(|(v, _)| (gaps.forest.point(v), v))
            .filter(|(p, _)| gaps.doubled.contains(p))
            .collect();
        if let (Origin::Surface(own), true) = (&origin, has.iter().all(|&(_, v)| gaps.is_first(v)))
        {
            return *own;
        }
        let sides = self.sides.entry(origin).or_default();
        let agrees = |side: &Side| {
            let of = |p: &Point| side.has.iter().find(|(q, _)| q == p).map(|(_, v)| *v);
            let found: Vec<bool> = has.iter().filter_map(|(p, v)| Some(of(p)? == *v)).collect();
            (!found.contains(&false)).then_some(found.len())
        };
        let best =
            (0..sides.len()).filter_map(|i| Some((agrees(&sides[i])?, std::cmp::Reverse(i)))).max();
        if let Some((_, std::cmp::Reverse(i))) = best {
            let side = &mut sides[i];
            side.has.extend(has);
            return side.index;
        }
        let index = self.rest.len() as u32;
        sides.push(Side { has, index });
        let weights = leaf.weights(&drawn);
        let now = sheet.vertices.iter().zip(weights).map(|(v, weight)| self.x[v.index()] * weight);
        self.now.push(now.sum());
        self.rest.push(drawn);
        index
    }
}

/// The face of a tetrahedron that is opposite a corner, as seen from outside.
fn outward(corners: [Point; 4], opposite: usize) -> [Point; 3] {
    let [a, b, c] = FACES[opposite].map(|i| corners[i]);
    let from = |p: Point| [0, 1, 2].map(|i| i64::from(p[i] - a[i]));
    let [u, v, w] = [from(b), from(c), from(corners[opposite])];
    let across = |i: usize, j: usize| u[i] * v[j] - u[j] * v[i];
    let volume = across(1, 2) * w[0] + across(2, 0) * w[1] + across(0, 1) * w[2];
    if volume < 0 { [a, b, c] } else { [a, c, b] }
}
