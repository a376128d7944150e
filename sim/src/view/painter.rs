//! The thread that makes pictures of what the simulation was a moment ago.

use std::collections::HashSet;
use std::sync::{Arc, Condvar, Mutex, PoisonError};

use nalgebra::Vector3;
use tokio::sync::watch;
use yawara_mesh::BisectionForest;

use super::picture::{PIECE, Picture, Surface, Topology};
use super::voxels::Voxels;
use crate::SimError;
use crate::body::ScannerAxes;
use crate::playback::surfaces;
use crate::report::{BodyOutline, Carried, Frame, SurfaceFrame, Surfaces, outer_faces};

/// What a picture is made of.
pub(super) struct Snapshot {
    pub generation: u64,
    /// What is said of the step.
    pub text: String,
    pub frame: Frame,
    /// Whether the coarse mesh is another than in the snapshot before.
    pub is_remeshed: bool,
    /// The mesh, where it has outlines to carry, and where its vertices are, m.
    pub forest: Option<Arc<BisectionForest>>,
    pub positions: Vec<Vector3<f64>>,
    /// Outlines of a simulation that has just begun.
    pub outlines: Option<Outlines>,
    /// Unit of the displacements of surfaces, mm.
    pub quantum_mm: f64,
    /// Of the simulation beside it, after the same step.
    pub beside: Option<Box<Snapshot>>,
}

impl Snapshot {
    /// Takes over what an `old` one of the same simulation that was not painted says of outlines and of a new mesh.
    fn follow(&mut self, old: Self) {
        self.is_remeshed |= old.is_remeshed;
        self.outlines = self.outlines.take().or(old.outlines);
        if let (Some(new), Some(old)) = (&mut self.beside, old.beside) {
            new.follow(*old);
        }
    }
}

/// The outlines of a simulation and how they are told.
pub(super) struct Outlines {
    /// Of the body, not cut yet.
    pub skin: Option<BodyOutline>,
    /// Of the labels in it.
    pub inner: Option<Surfaces>,
    /// What they are outlines in, of a body from an image.
    pub voxels: Option<Arc<Voxels>>,
    pub axes: ScannerAxes,
}

/// Where the next snapshot waits; a newer one takes its place.
#[derive(Default)]
pub(super) struct Easel {
    slot: Mutex<(Option<Box<Snapshot>>, bool)>,
    changed: Condvar,
}

impl Easel {
    /// Whether nothing waits: the painter is at rest or at work on the last one.
    pub fn is_free(&self) -> bool {
        self.slot.lock().unwrap_or_else(PoisonError::into_inner).0.is_none()
    }

    /// Puts a snapshot up. What an older one that was not painted says of outlines and of a new mesh is kept.
    pub fn put(&self, mut snapshot: Snapshot) {
        let mut slot = self.slot.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(old) = slot.0.take().filter(|old| old.generation == snapshot.generation) {
            snapshot.follow(*old);
        }
        slot.0 = Some(Box::new(snapshot));
        self.changed.notify_one();
    }

    /// Ends the painter.
    pub fn close(&self) {
        self.slot.lock().unwrap_or_else(PoisonError::into_inner).1 = true;
        self.changed.notify_one();
    }

    fn next(&self) -> Option<Box<Snapshot>> {
        let mut slot = self.slot.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            if slot.1 {
                return None;
            }
            if let Some(snapshot) = slot.0.take() {
                return Some(snapshot);
            }
            slot = self.changed.wait(slot).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

/// Paints what is put up until the easel is closed.
pub(super) fn paint(easel: &Easel, pictures: &watch::Sender<Arc<Picture>>) {
    let mut painter = Painter::default();
    while let Some(snapshot) = easel.next() {
        match painter.paint(*snapshot) {
            Ok(picture) => {
                pictures.send_replace(Arc::new(picture));
            }
            Err(error) => tracing::warn!("no picture: {error}"),
        }
    }
}

/// Makes pictures of snapshots, one after the other.
#[derive(Default)]
pub(super) struct Painter {
    outlines: Vec<Surfaces>,
    axes: Option<ScannerAxes>,
    quantum_mm: f64,
    last: Picture,
    /// The edges of the last mesh by where their ends rest.
    edges: HashSet<[[i64; 3]; 2]>,
    /// Its outer faces, each with its tetrahedron.
    outer: Vec<([u32; 3], usize)>,
    /// Paints the simulation beside it.
    beside: Option<Box<Self>>,
}

impl Painter {
    /// The picture of a snapshot: its outlines are those that it begins with, carried along by its mesh, or
    /// else the surfaces that its frame has.
    ///
    /// # Errors
    /// [`SimError::Surface`] if an outline can't be cut or carried.
    pub fn paint(&mut self, snapshot: Snapshot) -> Result<Picture, SimError> {
        self.paint_as(snapshot, self.last.number + 1)
    }

    fn paint_as(&mut self, mut snapshot: Snapshot, number: u64) -> Result<Picture, SimError> {
        let beside = match snapshot.beside.take() {
            Some(beside) => {
                Some(Arc::new(self.beside.get_or_insert_default().paint_as(*beside, number)?))
            }
            None => None,
        };
        if snapshot.outlines.is_some() || self.last.generation != snapshot.generation {
            *self = Self {
                last: Picture { number: number - 1, ..Picture::default() },
                quantum_mm: snapshot.quantum_mm,
                beside: self.beside.take(),
                ..Self::default()
            };
            if let Some(outlines) = snapshot.outlines {
                self.begin(outlines, snapshot.forest.as_deref())?;
            }
        }
        let frame = snapshot.frame.without_void();
        if snapshot.is_remeshed || self.last.generation != snapshot.generation {
            let is_first = self.last.generation != snapshot.generation;
            self.last.topology = Arc::new(self.topology(&frame, is_first));
            self.last.topology_changed = number;
        }
        self.last.generation = snapshot.generation;
        self.last.text = snapshot.text;
        match self.axes {
            Some(axes) => {
                self.carry(snapshot.forest.as_deref(), &snapshot.positions, axes, number)?
            }
            None => {
                for (at, one) in surfaces(&frame).enumerate() {
                    let SurfaceFrame { points_mm, displacement_mm, triangles, .. } = one;
                    let rest = points_mm.iter().zip(displacement_mm).map(|(x, u)| x - u);
                    self.lay(at, rest, triangles, number);
                    self.place(at, displacement_mm.iter().copied(), number);
                }
            }
        }
        let both = frame.points_mm.iter().zip(&frame.displacement_mm);
        let points: Vec<[f32; 6]> =
            both.map(|([x, y, z], [u, v, w])| [x, y, z, u, v, w].map(|x| *x as f32)).collect();
        let values = face_values(&frame, &self.outer);
        if points != self.last.points || values != self.last.values {
            (self.last.points, self.last.values) = (points, values);
            self.last.points_changed = number;
        }
        self.last.number = number;
        Ok(Picture { beside, ..self.last.clone() })
    }

    /// Begins with the outlines of another simulation.
    fn begin(
        &mut self,
        outlines: Outlines,
        forest: Option<&BisectionForest>,
    ) -> Result<(), SimError> {
        let Outlines { skin, inner, voxels, axes } = outlines;
        self.axes = Some(axes);
        self.last.voxels = voxels;
        if let (Some(skin), Some(forest)) = (skin, forest) {
            self.outlines.push(skin.into_surfaces(forest)?);
        }
        self.outlines.extend(inner);
        Ok(())
    }

    /// Moves the outlines along.
    fn carry(
        &mut self,
        forest: Option<&BisectionForest>,
        positions: &[Vector3<f64>],
        axes: ScannerAxes,
        number: u64,
    ) -> Result<(), SimError> {
        let Some(forest) = forest else { return Ok(()) };
        let outlines = std::mem::take(&mut self.outlines);
        let mut at = 0;
        for surfaces in &outlines {
            for Carried { triangles, rest, now, .. } in surfaces.carried(forest, positions)? {
                self.lay(at, rest.iter().map(|x| axes.to_ras_mm(x)), &triangles, number);
                let moved = rest.iter().zip(&now).map(|(rest, now)| now - rest);
                self.place(at, moved.map(|u| axes.to_ras_direction(&(u * 1e3))), number);
                at += 1;
            }
        }
        self.outlines = outlines;
        Ok(())
    }

    /// Has a surface be one that rests at these points, unless it is that.
    fn lay(
        &mut self,
        at: usize,
        rest_mm: impl Iterator<Item = Vector3<f64>> + Clone,
        triangles: &[[u32; 3]],
        number: u64,
    ) {
        let known = self.last.surfaces.get_mut(at);
        if known.as_ref().is_some_and(|known| known.rest.is(rest_mm.clone(), triangles)) {
            return;
        }
        let new = Surface::at_rest(rest_mm, triangles, number);
        match known {
            Some(known) => *known = new,
            None => self.last.surfaces.push(new),
        }
    }

    /// Moves a surface by displacements from rest, mm.
    fn place(&mut self, at: usize, moved_mm: impl Iterator<Item = Vector3<f64>>, number: u64) {
        let surface = &mut self.last.surfaces[at];
        for (i, u) in moved_mm.enumerate() {
            // A cast saturates; NaN becomes 0.
            let moved: [i16; 3] = (u / self.quantum_mm).map(|x| x.round() as i16).into();
            if surface.moved[i] != moved {
                surface.moved[i] = moved;
                surface.changed[i / PIECE] = number;
            }
        }
    }

    /// Edges and outer faces, with the edges that were not there before.
    fn topology(&mut self, frame: &Frame, is_first: bool) -> Topology {
        let micrometres = |i: u32| {
            let (x, u) = (frame.points_mm[i as usize], frame.displacement_mm[i as usize]);
            [0, 1, 2].map(|k| ((x[k] - u[k]) * 1e3).round() as i64)
        };
        let rest: Vec<[i64; 3]> = (0..frame.points_mm.len() as u32).map(micrometres).collect();
        let mut pairs = Vec::with_capacity(6 * frame.tets.len());
        for &[a, b, c, d] in &frame.tets {
            for (a, b) in [(a, b), (a, c), (a, d), (b, c), (b, d), (c, d)] {
                pairs.push([a.min(b), a.max(b)]);
            }
        }
        pairs.sort_unstable();
        pairs.dedup();
        let place = |&[a, b]: &[u32; 2]| {
            let (a, b) = (rest[a as usize], rest[b as usize]);
            [a.min(b), a.max(b)]
        };
        let is_new = |pair: &[u32; 2]| !is_first && !self.edges.contains(&place(pair));
        let edges = pairs.iter().map(|pair| [pair[0], pair[1], u32::from(is_new(pair))]).collect();
        self.edges = pairs.iter().map(place).collect();
        self.outer = outer_faces(frame);
        let faces = self.outer.iter().map(|(face, _)| *face).collect();
        let tets = frame.tets.iter().zip(&frame.label);
        let tets = tets.map(|(&[a, b, c, d], &label)| [a, b, c, d, label as u32]).collect();
        Topology { edges, faces, tets }
    }
}

/// What the tetrahedron behind each face has.
fn face_values(frame: &Frame, outer: &[([u32; 3], usize)]) -> Vec<[f32; 4]> {
    let of = |&(_, tet): &([u32; 3], usize)| {
        let indicator = frame.indicator.get(tet).copied().unwrap_or(0.0);
        let label = frame.label[tet] as f32;
        [frame.von_mises_pa[tet] as f32, f32::from(frame.level[tet]), label, indicator as f32]
    };
    outer.iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two_tets() -> Frame {
        let points_mm = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0; 3]];
        Frame {
            displacement_mm: vec![[0.0; 3]; points_mm.len()],
            points_mm,
            tets: vec![[0, 1, 2, 3], [1, 2, 3, 4]],
            level: vec![0, 3],
            label: vec![1, 2],
            von_mises_pa: vec![5.0, 7.0],
            ..Frame::default()
        }
    }

    #[test]
    fn outer_faces_look_outwards_and_know_their_tetrahedron() {
        let frame = two_tets();
        let found = outer_faces(&frame);
        assert_eq!(found.len(), 6);
        let at = |i: u32| Vector3::from(frame.points_mm[i as usize]);
        for (face, _) in found.iter().filter(|(_, tet)| *tet == 0) {
            let [a, b, c] = face.map(at);
            let inside = Vector3::repeat(0.25);
            assert!((b - a).cross(&(c - a)).dot(&(a - inside)) > 0.0, "{face:?}");
        }
        let of_second: Vec<_> =
            face_values(&frame, &found).into_iter().filter(|row| row[0] == 7.0).collect();
        assert_eq!(of_second, [[7.0, 3.0, 2.0, 0.0]; 3]);
    }

    #[test]
    fn edges_that_come_are_marked_once() {
        let mut painter = Painter::default();
        let mut frame = two_tets();
        assert!(painter.topology(&frame, true).edges.iter().all(|edge| edge[2] == 0));
        frame.points_mm.push([0.5, 0.0, 0.0]);
        frame.displacement_mm.push([0.0; 3]);
        frame.tets[0] = [5, 1, 2, 3];
        let new = |topology: &Topology| topology.edges.iter().filter(|edge| edge[2] == 1).count();
        let split = painter.topology(&frame, false);
        assert_eq!((split.edges.len(), new(&split)), (9, 3));
        assert_eq!(new(&painter.topology(&frame, false)), 0);
    }
}
