// Reads a picture: see the table in picture.rs.

/** The text and the blocks of a message, and those of the simulation beside it, if there is one. */
export function decode(buffer) {
  const view = new DataView(buffer);
  if (view.getUint32(0, true) !== 0x31505759) throw new Error('no picture');
  const length = view.getUint32(4, true);
  const text = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 8, length)));
  const blocks = [];
  let beside = null;
  let at = 8 + length;
  while (at < buffer.byteLength) {
    const [kind, surface, count, other] = new Uint32Array(buffer, at, 4);
    at += 16;
    if (kind === 6) {
      beside = decode(buffer.slice(at, at + count));
      at += count;
      continue;
    }
    const block = { kind, surface, count, other };
    if (kind === 1) {
      block.points = new Float32Array(buffer, at, 3 * count);
      block.triangles = new Uint32Array(buffer, at + 12 * count, 3 * other);
      at += 12 * (count + other);
    } else if (kind === 2) {
      block.moved = new Int16Array(buffer, at, 3 * count);
      at += Math.ceil((6 * count) / 4) * 4;
    } else if (kind === 3) {
      block.edges = new Uint32Array(buffer, at, 3 * count);
      block.faces = new Uint32Array(buffer, at + 12 * count, 3 * other);
      at += 12 * (count + other);
    } else if (kind === 7) {
      block.dims = new Uint32Array(buffer, at, 3);
      block.map = new Float32Array(buffer, at + 12, 12);
      block.range = new Float32Array(buffer, at + 60, 2);
      block.labels = new Uint8Array(buffer, at + 68, count);
      block.grey = other ? new Uint8Array(buffer, at + 68 + count, count) : null;
      at += 68 + Math.ceil((count * (1 + other)) / 4) * 4;
    } else if (kind === 8) {
      block.tets = new Uint32Array(buffer, at, 5 * count);
      at += 20 * count;
    } else {
      const width = kind === 4 ? 6 : 4;
      block.rows = new Float32Array(buffer, at, width * count);
      at += 4 * width * count;
    }
    blocks.push(block);
  }
  return { text, blocks, beside };
}
