// The body in three dimensions: outlines, coarse mesh, tools. Lengths in mm, axes right, anterior, superior.

import * as THREE from './three.js';
import { LABELS, nice, viridis } from './colour.js';
import { Cut } from './cut.js';

/** What is told by colour: unit, factor to it, and whether it is of the coarse mesh. */
export const COLOURS = {
  label: { name: 'label' },
  displacement: { name: 'displacement', unit: 'mm', factor: 1 },
  difference: { name: 'difference of displacement', unit: 'mm', factor: 1 },
  stress: { name: 'von Mises stress', unit: 'kPa', factor: 1e-3, row: 0 },
  level: { name: 'level of bisection', unit: '', factor: 1, row: 1 },
  indicator: { name: 'refinement indicator', unit: '', factor: 1, row: 3 },
};

const MM_PER_N = 18;
const FLASH_MS = 700;

/** What two bodies beside each other are seen by alike. */
const SHARED = ['controls', 'plane', 'colour', 'opacity', 'range', 'shows_lines', 'is_cut', 'cut_shows', 'where', 'hidden', 'labels', 'box', 'size', 'is_framed', 'is_unpainted'];

export class Body {
  /** One that is shown beside a `first` is seen as that is. */
  constructor(canvas, first = null) {
    this.canvas = canvas;
    this.first = first ?? this;
    this.pair = first?.pair ?? [];
    this.pair.push(this);
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
    this.renderer.localClippingEnabled = true;
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(32, 1, 1, 20000);
    this.camera.up.set(0, 0, 1);
    if (first) {
      for (const key of SHARED) Object.defineProperty(this, key, { get: () => first[key], set: (value) => { first[key] = value; } });
    } else {
      this.controls = new THREE.OrbitControls(this.camera, canvas.closest('#views'));
      this.controls.enableDamping = false;
      this.controls.listenToKeyEvents = () => {};
      this.plane = new THREE.Plane(new THREE.Vector3(0, -1, 0), 0);
      this.colour = 'label';
      this.opacity = 0.4;
      this.range = 1;
      this.shows_lines = false;
      this.is_cut = false;
      this.cut_shows = 'label';
      this.where = 0.5;
      this.hidden = new Set();
    }
    this.controls.addEventListener('change', () => { this.is_stale = true; });
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x8a8f98, 1.6));
    this.lamp = new THREE.DirectionalLight(0xffffff, 1.9);
    this.camera.add(this.lamp);
    this.lamp.position.set(-0.4, 0.6, 1);
    this.scene.add(this.camera);
    this.cut = new Cut();
    this.scene.add(this.cut.mesh);
    this.surfaces = [];
    this.tools = [];
    this.sharpness = 1;
    this.slow_ms = 16;
    this.drawn_at = 0;
    this.coarse();
    this.is_stale = true;
  }

  /** Empties the scene for another simulation. */
  clear(quantum_mm) {
    this.quantum = quantum_mm;
    for (const surface of this.surfaces) this.drop(surface.mesh);
    this.surfaces = [];
    this.drop(this.faces);
    this.drop(this.lines);
    this.drop(this.flash);
    this.cut.clear();
    this.coarse();
    this.range = 0;
    this.is_framed = false;
  }

  drop(mesh) {
    this.scene.remove(mesh);
    mesh.geometry.dispose();
    mesh.material.dispose();
  }

  coarse() {
    const material = new THREE.MeshStandardMaterial({ vertexColors: true, roughness: 0.85, side: THREE.DoubleSide, flatShading: true });
    this.faces = new THREE.Mesh(new THREE.BufferGeometry(), material);
    this.lines = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ transparent: true, opacity: 0.35 }));
    this.flash = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: 0xe69f00, transparent: true }));
    this.scene.add(this.faces, this.lines, this.flash);
    this.points = null;
    this.values = null;
    this.topology = null;
  }

  /** Takes the blocks of a picture. */
  take(blocks) {
    const changed = new Set();
    let mesh = false;
    for (const block of blocks) {
      if (block.kind === 1) this.begin(block);
      else if (block.kind === 2) { this.move(block); changed.add(block.surface); }
      else if (block.kind === 3) { this.topology = block; mesh = true; this.connect(block); }
      else if (block.kind === 4) { this.points = block.rows; mesh = true; }
      else if (block.kind === 7) this.cut.voxels = block;
      else if (block.kind === 8) this.cut.tets = block.tets;
      else { this.values = block.rows; mesh = true; }
    }
    for (const number of changed) {
      const { geometry } = this.surfaces[number].mesh;
      geometry.attributes.position.needsUpdate = true;
      geometry.computeVertexNormals();
      geometry.boundingSphere = null;
    }
    if (mesh) this.place();
    if (mesh || changed.size) this.is_unpainted = true;
    if (!this.is_framed && (this.surfaces.length || this.points)) this.frame();
    this.is_stale = true;
  }

  begin({ surface, points, triangles }) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.BufferAttribute(points.slice(), 3));
    geometry.setAttribute('color', new THREE.BufferAttribute(new Float32Array(points.length).fill(1), 3));
    geometry.setIndex(new THREE.BufferAttribute(triangles, 1));
    const rest = { rest: points.slice(), moved: new Int16Array(points.length) };
    const known = this.surfaces[surface];
    if (known) {
      known.mesh.geometry.dispose();
      known.mesh.geometry = geometry;
      Object.assign(known, rest);
      return;
    }
    const material = new THREE.MeshStandardMaterial({ roughness: 0.6, clippingPlanes: [] });
    const mesh = new THREE.Mesh(geometry, material);
    mesh.renderOrder = surface === 0 ? 10 : 1;
    this.scene.add(mesh);
    this.surfaces[surface] = { mesh, ...rest };
  }

  move({ surface, moved, other }) {
    const of = this.surfaces[surface];
    const position = of.mesh.geometry.attributes.position.array;
    of.moved.set(moved, 3 * other);
    for (let i = 0, at = 3 * other; i < moved.length; i += 1, at += 1) {
      position[at] = of.rest[at] + moved[i] * this.quantum;
    }
  }

  connect({ edges, faces }) {
    const ends = [];
    const fresh = [];
    for (let i = 0; i < edges.length; i += 3) (edges[i + 2] ? fresh : ends).push(edges[i], edges[i + 1]);
    this.edge_ends = Uint32Array.from([...ends, ...fresh]);
    if (fresh.length) {
      this.fresh = Uint32Array.from(fresh);
      this.fresh_since = performance.now();
    } else this.fresh = null;
    this.faces.geometry.dispose();
    this.faces.geometry = new THREE.BufferGeometry();
    this.faces.geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(3 * faces.length), 3));
    this.faces.geometry.setAttribute('color', new THREE.BufferAttribute(new Float32Array(3 * faces.length).fill(1), 3));
  }

  /** Moves the coarse mesh to where its vertices are. */
  place() {
    if (!this.points || !this.topology) return;
    const { points } = this;
    const corner = (into, at, v) => {
      into[at] = points[6 * v]; into[at + 1] = points[6 * v + 1]; into[at + 2] = points[6 * v + 2];
    };
    const faces = this.faces.geometry.attributes.position;
    this.topology.faces.forEach((v, i) => corner(faces.array, 3 * i, v));
    faces.needsUpdate = true;
    this.faces.geometry.computeVertexNormals();
    this.faces.geometry.boundingSphere = null;
    const set = (lines, ends) => {
      const array = new Float32Array(3 * ends.length);
      ends.forEach((v, i) => corner(array, 3 * i, v));
      lines.geometry.dispose();
      lines.geometry = new THREE.BufferGeometry();
      lines.geometry.setAttribute('position', new THREE.BufferAttribute(array, 3));
      lines.frustumCulled = false;
    };
    if (this.shows_lines) {
      set(this.lines, this.edge_ends);
      if (this.fresh) set(this.flash, this.fresh);
    }
  }

  /** Colours what is shown, beside each other by one scale. */
  paint() {
    this.is_unpainted = false;
    this.pair.forEach((one) => one.measure());
    this.rescale(Math.max(...this.pair.map((one) => one.most)));
    this.pair.forEach((one) => one.dress());
  }

  /** Finds what the skin shows, or without outlines the outer faces, and the most of it. */
  measure() {
    const of = COLOURS[this.colour];
    const most = (array) => array.reduce((most, x) => Math.max(most, x), 0);
    this.amount = null;
    this.most = 0;
    if (this.colour === 'label') return;
    if (this.surfaces.length) this.amount = this.amounts(of, this.surfaces[0].moved);
    else if (this.values && this.topology) this.amount = this.face_amounts(of);
    this.most = this.amount ? most(this.amount) : 0;
  }

  dress() {
    const is_coarse = this.surfaces.length === 0;
    const is_plain = this.colour === 'label';
    const planes = this.is_cut ? [this.plane] : [];
    this.surfaces.forEach(({ mesh }, number) => {
      const { material } = mesh;
      const is_skin = number === 0;
      // Under an opaque skin they would only shimmer through.
      mesh.visible = !this.hidden.has(number) && (is_skin || is_plain || this.is_cut);
      material.vertexColors = is_skin && !is_plain;
      material.clippingPlanes = planes;
      material.side = this.is_cut ? THREE.DoubleSide : THREE.FrontSide;
      const opacity = is_skin && is_plain ? this.opacity : 1;
      material.transparent = opacity < 1;
      material.depthWrite = opacity >= 1;
      material.opacity = opacity;
      material.color.set(is_skin && !is_plain ? 0xffffff : LABELS[number % LABELS.length]);
      material.needsUpdate = true;
      if (!is_skin || is_plain) return;
      const colours = mesh.geometry.attributes.color;
      this.amount.forEach((x, i) => colours.array.set(this.shade(x / this.range), 3 * i));
      colours.needsUpdate = true;
    });
    this.cut.mesh.visible = this.is_cut;
    if (this.is_cut) this.lay_cut();
    this.faces.visible = is_coarse && Boolean(this.topology);
    this.faces.material.clippingPlanes = planes;
    this.lines.material.clippingPlanes = planes;
    if (is_coarse && this.values && this.topology) this.paint_faces();
    this.is_stale = true;
  }

  lay_cut() {
    const { labels, hidden } = this;
    this.cut.lay(this.points, this.plane.constant, { labels, hidden, is_grey: this.cut_shows === 'grey' });
  }

  /** What the vertices of the skin show: their displacement, or what the outer face nearest at rest has. */
  amounts(of, moved) {
    const amount = new Float32Array(moved.length / 3);
    if (of === COLOURS.difference) {
      if (!this.is_alike) return amount;
      const [a, b] = this.pair.map((one) => ({ moved: one.surfaces[0].moved, quantum: one.quantum }));
      const along = (i) => a.moved[i] * a.quantum - b.moved[i] * b.quantum;
      for (let i = 0; i < amount.length; i += 1) amount[i] = Math.hypot(along(3 * i), along(3 * i + 1), along(3 * i + 2));
    } else if (of.row === undefined) {
      for (let i = 0; i < amount.length; i += 1) amount[i] = Math.hypot(moved[3 * i], moved[3 * i + 1], moved[3 * i + 2]) * this.quantum;
    } else if (this.values && this.topology) {
      if (this.nearest_of !== this.topology) { this.nearest = this.find_nearest(); this.nearest_of = this.topology; }
      this.nearest.forEach((face, i) => { amount[i] = this.values[4 * face + of.row] * of.factor; });
    }
    return amount;
  }

  /** Whether the skins of both bodies rest at the same points, so that these can be compared. */
  get is_alike() {
    const [a, b] = this.pair.map((one) => one.surfaces[0]?.rest);
    return Boolean(a && b) && a.length === b.length && a.every((x, i) => x === b[i]);
  }

  /** For each vertex of the skin the outer face of the coarse mesh whose middle rests nearest. */
  find_nearest() {
    const { points, topology } = this;
    const { rest } = this.surfaces[0];
    const cell = this.size / 24;
    const cells = new Map();
    const key = (x, y, z) => (Math.floor(x / cell) * 4096 + Math.floor(y / cell)) * 4096 + Math.floor(z / cell);
    const middles = [];
    for (let face = 0; face < topology.faces.length / 3; face += 1) {
      const middle = [0, 0, 0];
      for (let k = 0; k < 3; k += 1) {
        const at = 6 * topology.faces[3 * face + k];
        for (let axis = 0; axis < 3; axis += 1) middle[axis] += (points[at + axis] - points[at + 3 + axis]) / 3;
      }
      middles.push(middle);
      const here = key(...middle);
      if (cells.has(here)) cells.get(here).push(face); else cells.set(here, [face]);
    }
    const found = new Uint32Array(rest.length / 3);
    const near = (i, faces, best) => {
      for (const face of faces) {
        const m = middles[face];
        const far = (m[0] - rest[3 * i]) ** 2 + (m[1] - rest[3 * i + 1]) ** 2 + (m[2] - rest[3 * i + 2]) ** 2;
        if (far < best) { best = far; found[i] = face; }
      }
      return best;
    };
    const all = middles.map((_, face) => face);
    for (let i = 0; i < found.length; i += 1) {
      let best = Infinity;
      for (let dx = -1; dx <= 1; dx += 1) for (let dy = -1; dy <= 1; dy += 1) for (let dz = -1; dz <= 1; dz += 1) {
        const faces = cells.get(key(rest[3 * i] + dx * cell, rest[3 * i + 1] + dy * cell, rest[3 * i + 2] + dz * cell));
        if (faces) best = near(i, faces, best);
      }
      if (best === Infinity) near(i, all, best);
    }
    return found;
  }

  /** What the corners of the outer faces show: their displacement, or what the face has. */
  face_amounts(of) {
    const { values, points, topology } = this;
    const far = (v) => Math.hypot(points[6 * v + 3], points[6 * v + 4], points[6 * v + 5]);
    if (this.colour === 'displacement') return Float32Array.from(topology.faces, far);
    return Float32Array.from(topology.faces, (_, i) => (of.row === undefined ? 0 : values[4 * Math.floor(i / 3) + of.row] * of.factor));
  }

  paint_faces() {
    const { values } = this;
    const colours = this.faces.geometry.attributes.color;
    const known = new Map((this.labels ?? []).map(({ label }, i) => [label, i]));
    const colour = new THREE.Color();
    for (let i = 0; i < this.topology.faces.length; i += 1) {
      if (this.colour === 'label') {
        const label = values[4 * Math.floor(i / 3) + 2];
        const rgb = colour.set(LABELS[(known.get(label) ?? label) % LABELS.length]);
        colours.array.set([rgb.r, rgb.g, rgb.b], 3 * i);
      } else colours.array.set(this.shade(this.amount[i] / this.range), 3 * i);
    }
    colours.needsUpdate = true;
  }

  /** A colour of the map as the renderer wants it, linear. */
  shade(share) {
    const [r, g, b] = viridis(share);
    const linear = (x) => (x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4);
    return [linear(r), linear(g), linear(b)];
  }

  /** Widens the scale at once, and narrows it when little of it is used. */
  rescale(most) {
    const is_fit = this.range > 0 && most <= this.range && most >= 0.3 * this.range;
    if (!is_fit && (most > 0 || !(this.range > 0))) this.range = nice(most);
  }

  /** Shows tools: balls, arrows of forces and bands from hand to tool. */
  hold(tools, hands) {
    for (const one of this.tools) this.drop(one);
    this.tools = [];
    for (const tool of tools) {
      // A run that is over may not know where a tool was.
      if (tool.reference_mm.includes(null)) continue;
      const at = new THREE.Vector3(...tool.reference_mm);
      const force = new THREE.Vector3(...tool.force_n);
      const size = force.length();
      if ((tool.kind === 'probe' || tool.kind === 'suture') && tool.radius_mm) {
        const ball = new THREE.Mesh(new THREE.SphereGeometry(tool.radius_mm, 32, 20), new THREE.MeshStandardMaterial({ color: 0x8a9099, roughness: 0.35, transparent: true, opacity: 0.8 }));
        ball.position.copy(at);
        this.tools.push(ball);
      } else if (tool.edge_mm) {
        const edge = new THREE.Vector3(...tool.edge_mm);
        const blade = new THREE.Mesh(new THREE.CylinderGeometry(1.2, 0.3, edge.length(), 12), new THREE.MeshStandardMaterial({ color: 0x5a6068, metalness: 0.6, roughness: 0.3 }));
        blade.position.copy(at).addScaledVector(edge, 0.5);
        blade.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), edge.normalize());
        this.tools.push(blade);
      } else if (tool.radius_mm) {
        const mark = new THREE.Mesh(new THREE.SphereGeometry(3, 16, 12), new THREE.MeshBasicMaterial({ color: 0x111111, depthTest: false, transparent: true }));
        mark.position.copy(at);
        mark.renderOrder = 20;
        this.tools.push(mark);
      }
      if (size > 1e-4) {
        this.tools.push(...arrow(at, force, Math.min(Math.max(size * MM_PER_N, 6), 140)));
      }
      const hand = hands.get(tool.hand);
      if (hand && tool.is_mine) {
        const band = new THREE.BufferGeometry().setFromPoints([at, hand]);
        this.tools.push(new THREE.Line(band, new THREE.LineBasicMaterial({ color: 0x0072b2 })));
      }
    }
    this.tools.forEach((one) => this.scene.add(one));
    this.is_stale = true;
  }

  /** Looks at the whole body, from the front and a little from above. */
  frame() {
    if (this.first !== this) { this.first.frame(); return; }
    const box = { low: [Infinity, Infinity, Infinity], high: [-Infinity, -Infinity, -Infinity] };
    const add = (array, stride) => {
      for (let i = 0; i < array.length; i += stride) for (let k = 0; k < 3; k += 1) {
        box.low[k] = Math.min(box.low[k], array[i + k]);
        box.high[k] = Math.max(box.high[k], array[i + k]);
      }
    };
    if (this.surfaces.length) this.surfaces.forEach((surface) => add(surface.rest, 3)); else add(this.points, 6);
    if (!Number.isFinite(box.low[0])) return;
    this.box = box;
    const middle = new THREE.Vector3(...[0, 1, 2].map((k) => 0.5 * (box.low[k] + box.high[k])));
    const size = Math.hypot(...[0, 1, 2].map((k) => box.high[k] - box.low[k]));
    this.size = size;
    const far = size * Math.max(1.75, 1.45 / Math.max(this.camera.aspect, 0.3));
    this.controls.target.copy(middle);
    this.camera.position.copy(middle).add(new THREE.Vector3(-0.25, 0.9, 0.35).normalize().multiplyScalar(far));
    this.camera.near = far / 100;
    this.camera.far = far * 10;
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.is_framed = true;
    this.slice();
  }

  /** Moves the cutting plane, which faces anterior. */
  slice() {
    if (!this.box) return;
    this.plane.constant = this.box.low[1] + this.where * (this.box.high[1] - this.box.low[1]);
    this.paint();
  }

  ray(x, y) {
    const place = this.canvas.getBoundingClientRect();
    const at = new THREE.Vector2(((x - place.left) / place.width) * 2 - 1, 1 - ((y - place.top) / place.height) * 2);
    const caster = new THREE.Raycaster();
    caster.setFromCamera(at, this.camera);
    return caster;
  }

  /** The point of the body under the pointer: where it is, where it rests, and the normal. */
  pick(x, y) {
    const caster = this.ray(x, y);
    const meshes = [...this.surfaces.map((one) => one.mesh), this.faces].filter((mesh) => mesh.visible);
    const seen = (hit) => !this.is_cut || this.plane.distanceToPoint(hit.point) > 0;
    const hit = caster.intersectObjects(meshes, false).find(seen);
    if (!hit) return null;
    const { a, b, c } = hit.face;
    const number = this.surfaces.findIndex((one) => one.mesh === hit.object);
    const rest_of = (v) => {
      if (number >= 0) return new THREE.Vector3().fromArray(this.surfaces[number].rest, 3 * v);
      const at = 6 * this.topology.faces[v];
      return new THREE.Vector3(...[0, 1, 2].map((k) => this.points[at + k] - this.points[at + 3 + k]));
    };
    const now_of = (v) => new THREE.Vector3().fromBufferAttribute(hit.object.geometry.attributes.position, v);
    const corners = [a, b, c];
    const now = corners.map(now_of);
    const [weight_b, weight_c] = weights(hit.point, now);
    const shares = [1 - weight_b - weight_c, weight_b, weight_c];
    const rest = new THREE.Vector3();
    corners.forEach((v, i) => rest.addScaledVector(rest_of(v), shares[i]));
    const normal = now[1].clone().sub(now[0]).cross(now[2].clone().sub(now[0])).normalize();
    return { point: hit.point, rest, normal };
  }

  /** Where the viewer looks to. */
  looking() { return this.camera.getWorldDirection(new THREE.Vector3()); }

  /** Where the pointer is on the plane through a point that faces the viewer. */
  on_plane(x, y, through) {
    const facing = new THREE.Plane().setFromNormalAndCoplanarPoint(this.looking(), through);
    return this.ray(x, y).ray.intersectPlane(facing, new THREE.Vector3());
  }

  /** Pixels of a place. */
  project(at) {
    const v = new THREE.Vector3(...at).project(this.camera);
    const place = this.canvas.getBoundingClientRect();
    return [((v.x + 1) / 2) * place.width, ((1 - v.y) / 2) * place.height];
  }

  /** Draws fewer pixels while pictures that follow each other take too long, all of them when it is still. */
  pace() {
    const now = performance.now();
    if (this.is_stale) {
      const since = now - this.drawn_at;
      if (since < 1000) this.slow_ms = 0.8 * this.slow_ms + 0.2 * since;
      this.drawn_at = now;
      if (this.slow_ms > 50 && this.sharpness > 0.5) { this.sharpness = Math.max(0.5, 0.7 * this.sharpness); this.slow_ms = 30; }
    } else if (this.sharpness < 1 && now - this.drawn_at > 500) {
      this.sharpness = 1;
      this.is_stale = true;
    }
  }

  /** Draws if anything has changed; true if it has. */
  draw() {
    const { clientWidth: w, clientHeight: h } = this.canvas;
    if (this.is_unpainted) this.paint();
    this.pace();
    const ratio = Math.min(devicePixelRatio || 1, 2) * this.sharpness;
    const size = this.renderer.getSize(new THREE.Vector2());
    if (size.x !== w || size.y !== h || this.renderer.getPixelRatio() !== ratio) {
      this.renderer.setPixelRatio(ratio);
      this.renderer.setSize(w, h, false);
      this.camera.aspect = w / Math.max(h, 1);
      this.camera.updateProjectionMatrix();
      if (this.is_framed && !this.was_sized) this.frame();
      this.was_sized = true;
      this.is_stale = true;
    }
    const age = this.fresh ? performance.now() - this.fresh_since : Infinity;
    this.flash.visible = this.shows_lines && age < FLASH_MS;
    this.lines.visible = this.shows_lines;
    if (this.flash.visible) { this.flash.material.opacity = 1 - age / FLASH_MS; this.is_stale = true; }
    if (!this.is_stale) return false;
    this.is_stale = false;
    if (this.first !== this) this.camera.copy(this.first.camera, false);
    const style = getComputedStyle(document.documentElement);
    this.renderer.setClearColor(style.getPropertyValue('--view').trim());
    this.lines.material.color.set(style.getPropertyValue('--ink').trim());
    this.renderer.render(this.scene, this.camera);
    return true;
  }
}

/** Barycentric weights of the second and third corner. */
function weights(p, [a, b, c]) {
  const [u, v, w] = [b.clone().sub(a), c.clone().sub(a), p.clone().sub(a)];
  const [uu, uv, vv, wu, wv] = [u.dot(u), u.dot(v), v.dot(v), w.dot(u), w.dot(v)];
  const det = uu * vv - uv * uv || 1;
  return [(vv * wu - uv * wv) / det, (uu * wv - uv * wu) / det];
}

/** A force at a place, in front of everything else. */
function arrow(at, force, length) {
  const material = new THREE.MeshBasicMaterial({ color: 0xd55e00, depthTest: false, transparent: true });
  const head = Math.min(10, 0.45 * length);
  const along = force.clone().normalize();
  const turn = new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 1, 0), along);
  const part = (geometry, middle) => {
    const mesh = new THREE.Mesh(geometry, material);
    mesh.quaternion.copy(turn);
    mesh.position.copy(at).addScaledVector(along, middle);
    mesh.renderOrder = 21;
    return mesh;
  };
  const shaft = part(new THREE.CylinderGeometry(1.1, 1.1, length - head, 12), 0.5 * (length - head));
  return [shaft, part(new THREE.ConeGeometry(3.4, head, 20), length - 0.5 * head)];
}
