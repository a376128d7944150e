//! A picture on its way to a page: binary, and of that only what the page has not seen.
//!
//! All numbers are little-endian. `YWP1`, the length of a JSON text in bytes (u32) and the text, filled up with
//! spaces to a multiple of four; then blocks, each of four u32 (kind, surface or 0, two counts) and a body that is
//! filled up to a multiple of four bytes:
//!
//! | kind | counts | body |
//! |---|---|---|
//! | 1 a surface at rest, in place of the one with its number | vertices, triangles | f32 × 3 a vertex, mm; u32 × 3 a triangle |
//! | 2 a piece of it now | vertices, number of the first | i16 × 3 a vertex: displacement in units of the text's `quantum_mm` |
//! | 3 the coarse mesh | edges, faces | u32 × 3 an edge: ends, and 1 if it has just come; u32 × 3 a face |
//! | 4 its vertices now | vertices, 0 | f32 × 6 each: place and displacement, mm |
//! | 5 what its faces show | faces, 0 | f32 × 4 each: von Mises stress in Pa, level, label, indicator |
//! | 6 the simulation beside | bytes, 0 | a whole picture of it after the same step, from `YWP1` on |
//! | 7 the voxels of the body at rest | voxels, 1 with grey values | u32 × 3: voxels along the axes; f32 × 12: rows of the affine map from scanner RAS mm to voxels; f32 × 2: what grey 0 and 255 stand for; u8 a voxel: 0 in void, else 1 + the number of a surface of its colour; u8 a voxel: grey |
//! | 8 the coarse tetrahedra | tetrahedra, 0 | u32 × 5 each: corners, label |

use std::sync::Arc;

use nalgebra::Vector3;

use super::voxels::Voxels;

/// Vertices of a surface that are sent together.
pub(super) const PIECE: usize = 512;

/// A surface as it rests.
pub(super) struct SurfaceAtRest {
    pub points_mm: Vec<[f32; 3]>,
    pub triangles: Vec<[u32; 3]>,
}

/// A surface as it is now.
#[derive(Clone)]
pub(super) struct Surface {
    pub rest: Arc<SurfaceAtRest>,
    /// The picture in which it came.
    pub since: u64,
    /// Displacements in quanta.
    pub moved: Vec<[i16; 3]>,
    /// The picture in which each [`PIECE`] of them changed last.
    pub changed: Vec<u64>,
}

/// What connects the coarse mesh.
#[derive(Default)]
pub(super) struct Topology {
    pub edges: Vec<[u32; 3]>,
    pub faces: Vec<[u32; 3]>,
    /// Corners and label of each tetrahedron.
    pub tets: Vec<[u32; 5]>,
}

/// One moment of a simulation.
#[derive(Clone, Default)]
pub(super) struct Picture {
    /// Ascending from 1; 0 for none yet.
    pub number: u64,
    /// Which of the simulations of this server it is of.
    pub generation: u64,
    pub text: String,
    pub surfaces: Vec<Surface>,
    /// Of a body from an image.
    pub voxels: Option<Arc<Voxels>>,
    pub topology: Arc<Topology>,
    /// The picture in which it changed last.
    pub topology_changed: u64,
    pub points: Vec<[f32; 6]>,
    pub values: Vec<[f32; 4]>,
    /// The picture in which either changed last.
    pub points_changed: u64,
    /// Of the simulation beside it, with the same number and generation.
    pub beside: Option<Arc<Self>>,
}

/// What a page has seen.
#[derive(Clone, Copy, Default)]
pub(super) struct Seen {
    pub number: u64,
    pub generation: u64,
}

impl Picture {
    /// What a page that has `seen` so much lacks.
    pub fn encode(&self, seen: Seen) -> Vec<u8> {
        let is_new = seen.generation != self.generation || seen.number == 0;
        self.encode_since(if is_new { 0 } else { seen.number }, is_new)
    }

    /// All of it, with what rests if `with_rest`.
    pub fn encode_alone(&self, with_rest: bool) -> Vec<u8> {
        self.encode_since(0, with_rest)
    }

    fn encode_since(&self, since: u64, with_rest: bool) -> Vec<u8> {
        let mut out = Vec::with_capacity(1 << 16);
        out.extend(b"YWP1");
        let padded = self.text.len().next_multiple_of(4);
        out.extend((padded as u32).to_le_bytes());
        out.extend(self.text.as_bytes());
        out.resize(8 + padded, b' ');
        for (number, surface) in self.surfaces.iter().enumerate() {
            if with_rest || (since > 0 && surface.since > since) {
                surface.rest.encode(number, &mut out);
            }
            for (piece, moved) in surface.moved.chunks(PIECE).enumerate() {
                if surface.changed[piece] > since {
                    begin(&mut out, 2, number, moved.len(), piece * PIECE);
                    moved.iter().flatten().for_each(|x| out.extend(x.to_le_bytes()));
                    out.resize(out.len().next_multiple_of(4), 0);
                }
            }
        }
        if let (Some(voxels), true) = (&self.voxels, with_rest) {
            voxels.encode(&mut out);
        }
        if self.topology_changed > since {
            let Topology { edges, faces, tets } = &*self.topology;
            begin(&mut out, 3, 0, edges.len(), faces.len());
            edges.iter().chain(faces).flatten().for_each(|x| out.extend(x.to_le_bytes()));
            begin(&mut out, 8, 0, tets.len(), 0);
            tets.iter().flatten().for_each(|x| out.extend(x.to_le_bytes()));
        }
        if self.points_changed > since {
            begin(&mut out, 4, 0, self.points.len(), 0);
            self.points.iter().flatten().for_each(|x| out.extend(x.to_le_bytes()));
            begin(&mut out, 5, 0, self.values.len(), 0);
            self.values.iter().flatten().for_each(|x| out.extend(x.to_le_bytes()));
        }
        if let Some(beside) = &self.beside {
            let bytes = beside.encode_since(since, with_rest);
            begin(&mut out, 6, 0, bytes.len(), 0);
            out.extend(bytes);
        }
        out
    }
}

impl Surface {
    /// One that has just come, in picture `number`: points in mm.
    pub fn at_rest(
        points_mm: impl Iterator<Item = Vector3<f64>>,
        triangles: &[[u32; 3]],
        number: u64,
    ) -> Self {
        let points_mm: Vec<[f32; 3]> = points_mm.map(|x| x.map(|x| x as f32).into()).collect();
        Self {
            since: number,
            moved: vec![[0; 3]; points_mm.len()],
            changed: vec![number; points_mm.len().div_ceil(PIECE)],
            rest: Arc::new(SurfaceAtRest { points_mm, triangles: triangles.to_vec() }),
        }
    }
}

impl SurfaceAtRest {
    /// Whether it is one of these points, mm, and triangles.
    pub fn is(
        &self,
        mut points_mm: impl Iterator<Item = Vector3<f64>>,
        triangles: &[[u32; 3]],
    ) -> bool {
        let same = |own: &[f32; 3]| {
            points_mm.next().is_some_and(|x| <[f32; 3]>::from(x.map(|x| x as f32)) == *own)
        };
        self.triangles == triangles && self.points_mm.iter().all(same) && points_mm.next().is_none()
    }

    fn encode(&self, number: usize, out: &mut Vec<u8>) {
        begin(out, 1, number, self.points_mm.len(), self.triangles.len());
        self.points_mm.iter().flatten().for_each(|x| out.extend(x.to_le_bytes()));
        self.triangles.iter().flatten().for_each(|x| out.extend(x.to_le_bytes()));
    }
}

impl Voxels {
    fn encode(&self, out: &mut Vec<u8>) {
        begin(out, 7, 0, self.labels.len(), usize::from(self.grey.is_some()));
        self.dims.iter().for_each(|&n| out.extend((n as u32).to_le_bytes()));
        let range = self.grey.as_ref().map_or([0.0; 2], |grey| grey.range);
        let numbers = self.to_voxels.iter().flatten().chain(&range);
        numbers.for_each(|x| out.extend(x.to_le_bytes()));
        out.extend(&self.labels);
        self.grey.iter().for_each(|grey| out.extend(&grey.shades));
        out.resize(out.len().next_multiple_of(4), 0);
    }
}

fn begin(out: &mut Vec<u8>, kind: u32, number: usize, count: usize, other: usize) {
    for word in [kind, number as u32, count as u32, other as u32] {
        out.extend(word.to_le_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::super::voxels::Grey;
    use super::*;

    /// Kind, surface and counts of all blocks.
    fn blocks(bytes: &[u8], sizes: impl Fn(&[u32; 4]) -> usize) -> Vec<[u32; 4]> {
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        assert_eq!(&bytes[..4], b"YWP1");
        let mut at = 8 + word(4) as usize;
        let mut found = Vec::new();
        while at < bytes.len() {
            let head = [0, 4, 8, 12].map(|offset| word(at + offset));
            at += 16 + sizes(&head);
            found.push(head);
        }
        assert_eq!(at, bytes.len());
        found
    }

    fn size(&[kind, _, count, other]: &[u32; 4]) -> usize {
        let (count, other) = (count as usize, other as usize);
        match kind {
            1 | 3 => 12 * (count + other),
            2 => (6 * count).next_multiple_of(4),
            4 => 24 * count,
            6 => count,
            7 => 68 + (count * (1 + other)).next_multiple_of(4),
            8 => 20 * count,
            _ => 16 * count,
        }
    }

    #[test]
    fn a_page_gets_what_has_changed_since_it_last_looked() {
        let points_mm = vec![[0.0; 3]; PIECE + 3];
        let rest = Arc::new(SurfaceAtRest { points_mm, triangles: vec![[0, 1, 2]] });
        let picture = Picture {
            number: 7,
            generation: 1,
            text: "{}".into(),
            surfaces: vec![Surface {
                rest,
                since: 2,
                moved: vec![[1; 3]; PIECE + 3],
                changed: vec![3, 7],
            }],
            voxels: Some(Arc::new(Voxels {
                dims: [3, 1, 1],
                to_voxels: [[0.0; 4]; 3],
                labels: vec![0, 1, 2],
                grey: Some(Grey { shades: vec![7, 8, 9], range: [0.0, 1.0] }),
            })),
            topology: Arc::new(Topology {
                edges: vec![[0, 1, 0]],
                faces: vec![[0, 1, 2]],
                tets: vec![[0, 1, 2, 3, 1]; 2],
            }),
            topology_changed: 5,
            points: vec![[0.0; 6]; 3],
            values: vec![[0.0; 4]],
            points_changed: 7,
            beside: None,
        };
        let (piece, last) = ([2, 0, PIECE as u32, 0], [2, 0, 3, PIECE as u32]);
        let mesh = [[3, 0, 1, 1], [8, 0, 2, 0], [4, 0, 3, 0], [5, 0, 1, 0]];
        let rest = [1, 0, PIECE as u32 + 3, 1];
        let whole = [&[rest, piece, last, [7, 0, 3, 1]][..], &mesh].concat();
        let of = |number, generation| blocks(&picture.encode(Seen { number, generation }), size);
        assert_eq!(of(0, 1), whole);
        assert_eq!(of(6, 2), whole, "of another simulation");
        assert_eq!(of(4, 1), [&[last][..], &mesh].concat());
        assert_eq!(of(6, 1), [&[last][..], &mesh[2..]].concat());
        assert_eq!(of(7, 1), [[0; 4]; 0]);
        // A surface that is another than the page has seen comes with where it rests.
        let mut cut = picture.clone();
        (cut.surfaces[0].since, cut.surfaces[0].changed) = (7, vec![7, 7]);
        let bytes = cut.encode(Seen { number: 6, generation: 1 });
        assert_eq!(blocks(&bytes, size), [&[rest, piece, last][..], &mesh[2..]].concat());
        let alone = |with_rest| blocks(&picture.encode_alone(with_rest), size);
        assert_eq!(alone(true), whole);
        assert_eq!(alone(false), [&[piece, last][..], &mesh].concat());
        // What goes beside it is a picture of its own, of the same changes.
        let pair = Picture { beside: Some(Arc::new(picture.clone())), ..picture.clone() };
        let (first, both) =
            [&picture, &pair].map(|one| one.encode(Seen { number: 6, generation: 1 })).into();
        assert_eq!(both[..first.len()], first);
        assert_eq!(both[first.len() + 16..], first);
        assert_eq!(blocks(&both, size).last(), Some(&[6, 0, first.len() as u32, 0]));
    }
}
