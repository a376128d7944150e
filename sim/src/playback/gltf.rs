//! A run as an animated scene in glTF 2.0 (binary, .glb).

use std::path::Path;

use nalgebra::Vector3;
use serde_json::{Value, json};

use super::colours::COLOURS;
use super::run::{Run, surfaces};
use crate::SimError;
use crate::output::write_file;
use crate::report::{Frame, outer_faces};

/// Numbers of the format.
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;

/// How much of the skin hides what is in it.
const SKIN: f64 = 0.4;

/// The longest file: lengths are 32-bit.
const MOST_BYTES: usize = u32::MAX as usize;

/// Writes a run to `path` as binary glTF 2.0 with one animation, times as in the run.
///
/// The surfaces that frames have are a mesh each: at rest, with the displacements of every frame as a morph
/// target. Without surfaces the outer faces of the tetrahedra are a mesh a frame, of which one is shown at a
/// time. Vertices are in scanner RAS mm, in 32-bit floats: x + u is off by at most 2⁻²³ (|x| + |u|); the node
/// above them makes metres of them and turns superior up, anterior to the front. The same run gives the same
/// bytes. Cost: O(all frames), all of them in memory.
///
/// # Errors
/// As [`Run::frame`]; [`SimError::Value`] if the file would be longer than the format allows;
/// [`SimError::Io`] if it can't be written: what stood there is still there then.
pub fn write_gltf(run: &Run, path: &Path) -> Result<(), SimError> {
    let mut scene = Scene::default();
    let times: Vec<f32> = (0..run.frame_count()).map(|frame| run.moment(frame).1 as f32).collect();
    scene.times = scene.accessor("SCALAR", &times, 1, None, true);
    match run.has_one_surface() && !run.labels().is_empty() {
        true => scene.add_surfaces(run)?,
        false => scene.add_meshes(run)?,
    }
    let bytes = scene.finish(run.scene());
    if bytes.len() > MOST_BYTES {
        let want = format!("at most {MOST_BYTES}, as the format has it: a run with fewer frames");
        let place = path.display().to_string();
        return Err(SimError::value(&place, "the number of bytes", bytes.len(), want));
    }
    write_file(path, bytes)
}

/// A scene in the making.
#[derive(Default)]
struct Scene {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    materials: Vec<Value>,
    meshes: Vec<Value>,
    /// Below the first, which turns and scales them.
    nodes: Vec<Value>,
    channels: Vec<Value>,
    samplers: Vec<Value>,
    /// The accessor of the frames' times.
    times: usize,
}

impl Scene {
    /// Appends numbers; the number of the accessor.
    fn accessor(
        &mut self,
        kind: &str,
        values: &[f32],
        width: usize,
        target: Option<u32>,
        has_ends: bool,
    ) -> usize {
        let bytes = values.iter().flat_map(|x| x.to_le_bytes());
        let mut accessor = self.view(bytes, target, FLOAT, values.len() / width, kind);
        if has_ends {
            let end = |of: fn(f32, f32) -> f32, start: f32| -> Vec<f32> {
                let along = |k| values.iter().skip(k).step_by(width).copied().fold(start, of);
                (0..width).map(along).collect()
            };
            accessor["min"] = json!(end(f32::min, f32::INFINITY));
            accessor["max"] = json!(end(f32::max, f32::NEG_INFINITY));
        }
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn vectors(&mut self, vectors: impl Iterator<Item = Vector3<f64>>) -> usize {
        let flat: Vec<f32> = vectors.flat_map(<[f64; 3]>::from).map(|x| x as f32).collect();
        self.accessor("VEC3", &flat, 3, Some(VERTICES), true)
    }

    fn triangles(&mut self, triangles: impl Iterator<Item = [u32; 3]>) -> usize {
        let flat: Vec<u32> = triangles.flatten().collect();
        let bytes = flat.iter().flat_map(|x| x.to_le_bytes());
        let accessor = self.view(bytes, Some(INDICES), UNSIGNED_INT, flat.len(), "SCALAR");
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Appends bytes as a view; an accessor of all of it.
    fn view(
        &mut self,
        bytes: impl Iterator<Item = u8>,
        target: Option<u32>,
        component: u32,
        count: usize,
        kind: &str,
    ) -> Value {
        let start = self.bytes.len();
        self.bytes.extend(bytes);
        let mut view =
            json!({ "buffer": 0, "byteOffset": start, "byteLength": self.bytes.len() - start });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.views.push(view);
        let view = self.views.len() - 1;
        json!({ "bufferView": view, "componentType": component, "count": count, "type": kind })
    }

    fn material(&mut self, name: &str, number: usize, opacity: f64) -> usize {
        let linear = |x: u8| {
            let x = f64::from(x) / 255.0;
            if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
        };
        let [r, g, b] = COLOURS[number % COLOURS.len()].map(linear);
        let surface = json!({
            "baseColorFactor": [r, g, b, opacity], "metallicFactor": 0.0, "roughnessFactor": 0.6,
        });
        let mut material = json!({ "name": name, "pbrMetallicRoughness": surface });
        if opacity < 1.0 {
            material["alphaMode"] = json!("BLEND");
        }
        self.materials.push(material);
        self.materials.len() - 1
    }

    /// Adds a channel that gives a node these values at the times of the frames.
    fn animate(&mut self, node: usize, path: &str, way: &str, output: usize) {
        let target = json!({ "node": node, "path": path });
        self.channels.push(json!({ "sampler": self.samplers.len(), "target": target }));
        let sampler = json!({ "input": self.times, "output": output, "interpolation": way });
        self.samplers.push(sampler);
    }

    /// A mesh for each surface, with a target for each frame.
    fn add_surfaces(&mut self, run: &Run) -> Result<(), SimError> {
        let first = run.frame(0)?;
        let count = run.frame_count();
        let mut targets = vec![Vec::with_capacity(count); run.labels().len()];
        for number in 0..count {
            let frame = run.frame(number)?;
            for (surface, targets) in surfaces(&frame).zip(&mut targets) {
                let moved = self.vectors(surface.displacement_mm.iter().copied());
                targets.push(json!({ "POSITION": moved }));
            }
        }
        // At each time the target of its frame and no other.
        let weights: Vec<f32> =
            (0..count * count).map(|i| f32::from(u8::from(i / count == i % count))).collect();
        let weights = self.accessor("SCALAR", &weights, 1, None, false);
        for (number, (surface, targets)) in surfaces(&first).zip(targets).enumerate() {
            let both = surface.points_mm.iter().zip(&surface.displacement_mm);
            let rest = self.vectors(both.map(|(x, u)| x - u));
            let corners = self.triangles(surface.triangles.iter().copied());
            let (name, material) = self.look(run, surface.label, number);
            let primitive = json!({
                "attributes": { "POSITION": rest }, "indices": corners, "material": material,
                "targets": targets,
            });
            let mut start = vec![0.0; count];
            start[0] = 1.0;
            self.meshes.push(json!({ "name": name, "primitives": [primitive], "weights": start }));
            self.nodes.push(json!({ "name": name, "mesh": self.meshes.len() - 1 }));
            self.animate(self.nodes.len(), "weights", "LINEAR", weights);
        }
        Ok(())
    }

    /// The name of a surface and its material.
    fn look(&mut self, run: &Run, label: i64, number: usize) -> (String, usize) {
        let name = match (label, run.name_of(label)) {
            (0, _) => "skin".to_owned(),
            (label, "") => format!("label {label}"),
            (_, name) => name.to_owned(),
        };
        let is_veil = label == 0 && run.labels().len() > 1;
        let material = self.material(&name, number, if is_veil { SKIN } else { 1.0 });
        (name, material)
    }

    /// A mesh for each frame, which is there while its frame is shown: its surfaces, or else its outer faces.
    fn add_meshes(&mut self, run: &Run) -> Result<(), SimError> {
        let count = run.frame_count();
        let labels = run.labels().iter().enumerate();
        let mut materials: Vec<usize> =
            labels.map(|(number, &label)| self.look(run, label, number).1).collect();
        if materials.is_empty() {
            materials.push(self.material("body", 0, 1.0));
        }
        for number in 0..count {
            let frame = run.frame(number)?;
            let mut shown: Vec<(usize, usize)> = Vec::new();
            for surface in surfaces(&frame) {
                let points = self.vectors(surface.points_mm.iter().copied());
                shown.push((points, self.triangles(surface.triangles.iter().copied())));
            }
            if shown.is_empty() {
                shown.push(self.outside(&frame));
            }
            let primitive = |((points, corners), material): (&(usize, usize), &usize)| {
                json!({
                    "attributes": { "POSITION": points }, "indices": corners, "material": material,
                })
            };
            let primitives: Vec<Value> = shown.iter().zip(&materials).map(primitive).collect();
            let name = format!("step {}", run.moment(number).0);
            self.meshes.push(json!({ "name": name, "primitives": primitives }));
            let size = f32::from(u8::from(number == 0));
            self.nodes.push(json!({
                "name": name, "mesh": self.meshes.len() - 1, "scale": [size, size, size],
            }));
            let sizes: Vec<f32> =
                (0..3 * count).map(|i| f32::from(u8::from(i / 3 == number))).collect();
            let sizes = self.accessor("VEC3", &sizes, 3, None, false);
            self.animate(self.nodes.len(), "scale", "STEP", sizes);
        }
        Ok(())
    }

    /// All vertices of a frame, and its outer faces.
    fn outside(&mut self, frame: &Frame) -> (usize, usize) {
        let points = self.vectors(frame.points_mm.iter().map(|x| Vector3::from(*x)));
        (points, self.triangles(outer_faces(frame).into_iter().map(|(face, _)| face)))
    }

    /// The file.
    fn finish(self, name: &str) -> Vec<u8> {
        let children: Vec<usize> = (1..=self.nodes.len()).collect();
        // Half a turn about y + z: right to −x, anterior to z, superior to y.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let body = json!({
            "name": name, "children": children, "rotation": [0.0, half, half, 0.0],
            "scale": [1e-3, 1e-3, 1e-3],
        });
        let nodes: Vec<Value> = std::iter::once(body).chain(self.nodes).collect();
        let version = concat!("yawara ", env!("CARGO_PKG_VERSION"));
        let text = json!({
            "asset": { "version": "2.0", "generator": version },
            "scene": 0,
            "scenes": [{ "name": name, "nodes": [0] }],
            "nodes": nodes,
            "meshes": self.meshes,
            "materials": self.materials,
            "animations": [{ "name": "run", "channels": self.channels, "samplers": self.samplers }],
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{ "byteLength": self.bytes.len() }],
        });
        let mut text = text.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        // Every number is of four bytes.
        let length = 12 + 8 + text.len() + 8 + self.bytes.len();
        let mut file = Vec::with_capacity(length);
        file.extend(b"glTF");
        file.extend(2_u32.to_le_bytes());
        for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &self.bytes)] {
            if kind == b"JSON" {
                file.extend((length as u32).to_le_bytes());
            }
            file.extend((chunk.len() as u32).to_le_bytes());
            file.extend(kind);
            file.extend(chunk);
        }
        file
    }
}
