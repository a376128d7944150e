// What is seen of the tetrahedra where a plane cuts them: labels or grey values at rest, carried along.

import * as THREE from './three.js';
import { LABELS } from './colour.js';

/** Parts of a side of a cut tetrahedron at most. */
const FINEST = 16;

export class Cut {
  constructor() {
    const material = new THREE.MeshBasicMaterial({ vertexColors: true, side: THREE.DoubleSide });
    this.mesh = new THREE.Mesh(new THREE.BufferGeometry(), material);
    this.mesh.frustumCulled = false;
    this.mesh.visible = false;
    const colour = new THREE.Color();
    this.palette = LABELS.map((of) => { colour.set(of); return [colour.r, colour.g, colour.b]; });
    this.shades = Array.from({ length: 256 }, (_, x) => {
      const grey = x <= 10 ? x / 255 / 12.92 : ((x / 255 + 0.055) / 1.055) ** 2.4;
      return [grey, grey, grey];
    });
    this.clear();
  }

  /** For another simulation. */
  clear() {
    this.voxels = null;
    this.tets = null;
  }

  /** Cuts the tetrahedra, whose corners are at and displaced by `points`, where y is `at`: in the colours of `labels` without
      those `hidden`, or in grey if `is_grey` and known. */
  lay(points, at, { labels, hidden, is_grey }) {
    this.hidden = hidden;
    const { tets, voxels } = this;
    this.position = [];
    this.colours = [];
    const known = new Map((labels ?? []).map(({ label }, number) => [label, number]));
    for (let i = 0; tets && points && i < tets.length; i += 5) {
      const above = [];
      const below = [];
      for (let k = 0; k < 4; k += 1) (points[6 * tets[i + k] + 1] > at ? above : below).push(tets[i + k]);
      if (above.length === 0 || below.length === 0) continue;
      const between = (a, b) => crossing(points, a, b, at);
      const [a, b, c] = above;
      const [d, e, f] = below;
      const corners = above.length === 2
        ? [between(a, d), between(a, e), between(b, e), between(b, d)]
        : above.length === 1 ? [between(a, d), between(a, e), between(a, f)] : [between(a, d), between(b, d), between(c, d)];
      const label = tets[i + 4];
      const flat = this.palette[(known.get(label) ?? label) % LABELS.length];
      for (let k = 2; k < corners.length; k += 1) {
        const triangle = [corners[0], corners[k - 1], corners[k]];
        if (voxels) this.fill(triangle, is_grey && voxels.grey);
        else triangle.forEach((corner) => this.point(corner, flat));
      }
    }
    const { geometry } = this.mesh;
    geometry.dispose();
    this.mesh.geometry = new THREE.BufferGeometry();
    this.mesh.geometry.setAttribute('position', new THREE.BufferAttribute(Float32Array.from(this.position), 3));
    this.mesh.geometry.setAttribute('color', new THREE.BufferAttribute(Float32Array.from(this.colours), 3));
  }

  point(corner, colour) {
    this.position.push(corner[0], corner[1], corner[2]);
    this.colours.push(colour[0], colour[1], colour[2]);
  }

  /** A triangle in parts of about a voxel, each with the colour of the voxel that its middle rests in. */
  fill([a, b, c], grey) {
    const { map, dims, labels } = this.voxels;
    const size = 1 / Math.hypot(map[0], map[1], map[2]);
    const side = (p, q) => Math.hypot(p[3] - q[3], p[4] - q[4], p[5] - q[5]);
    const parts = Math.min(FINEST, Math.max(1, Math.ceil((1.4 * Math.max(side(a, b), side(b, c), side(c, a))) / size)));
    const place = (i, j) => a.map((x, k) => x + ((b[k] - x) * i + (c[k] - x) * j) / parts);
    const put = (p, q, r) => {
      const [x, y, z] = [3, 4, 5].map((k) => (p[k] + q[k] + r[k]) / 3);
      const at = [0, 1, 2].map((row) => Math.floor(map[4 * row] * x + map[4 * row + 1] * y + map[4 * row + 2] * z + map[4 * row + 3]));
      if (at.some((i, axis) => i < 0 || i >= dims[axis])) return;
      const index = at[0] + dims[0] * (at[1] + dims[1] * at[2]);
      if (labels[index] === 0 || this.hidden.has(labels[index] - 1)) return;
      const colour = grey ? this.shades[grey[index]] : this.palette[(labels[index] - 1) % LABELS.length];
      [p, q, r].forEach((corner) => this.point(corner, colour));
    };
    let row = Array.from({ length: parts + 1 }, (_, j) => place(0, j));
    for (let i = 0; i < parts; i += 1) {
      const next = Array.from({ length: parts - i }, (_, j) => place(i + 1, j));
      for (let j = 0; j < next.length; j += 1) {
        put(row[j], next[j], row[j + 1]);
        if (j + 1 < next.length) put(next[j], next[j + 1], row[j + 1]);
      }
      row = next;
    }
  }
}

/** Where an edge meets the plane: place, and place at rest. */
function crossing(points, a, b, at) {
  const share = (at - points[6 * a + 1]) / (points[6 * b + 1] - points[6 * a + 1]);
  const found = [];
  for (let k = 0; k < 6; k += 1) {
    const of = (v) => (k < 3 ? points[6 * v + k] : points[6 * v + k - 3] - points[6 * v + k]);
    found.push(of(a) + share * (of(b) - of(a)));
  }
  return found;
}
