// What a picture lacks, from bytes: new vertices as midpoints of old ones, triangles, light. The form: see picture.rs.

import { BufferAttribute } from "three";

/** Reads what came for the parts of a stage and puts it in place; numbers of mesh, shape and light, and all lux. */
export function grow(stage, buffer) {
  const head = new Uint32Array(buffer, 0, 4);
  const [mesh, shape, light, count] = head;
  const parts = [...stage.parts].sort((a, b) => a.at - b.at);
  if (parts.length !== count) throw new Error(`${count} parts came for ${parts.length}`);
  const sizes = new Uint32Array(buffer, 16, 3 * count);
  let at = 16 + 12 * count;
  const next = (Type, length) => {
    const found = new Type(buffer, at, length);
    at += 4 * length;
    return found;
  };
  const ends = parts.map((_, k) => next(Uint32Array, 2 * sizes[3 * k + 1]));
  const corners = parts.map((_, k) => next(Uint32Array, 3 * sizes[3 * k + 2]));
  const lux = [];
  let first = 0;
  parts.forEach((part, k) => {
    if (ends[k].length || corners[k].length) reshape(part.mesh.geometry, ends[k], corners[k]);
    part.at = first;
    part.count = sizes[3 * k];
    first += part.count;
    paint(part.mesh.geometry.attributes, next(Float32Array, 4 * part.count), lux);
  });
  stage.draw();
  return { numbers: [mesh, shape, light], lux };
}

/** Puts midpoints of edges behind the vertices of a geometry, in all that it says of them. */
function reshape(geometry, ends, corners) {
  for (const [name, old] of Object.entries(geometry.attributes)) {
    const size = old.itemSize;
    const array = new Float32Array(size * (old.count + ends.length / 2));
    for (let i = 0; i < old.count; i += 1) for (let c = 0; c < size; c += 1) array[size * i + c] = old.getComponent(i, c);
    for (let k = 0; k < ends.length; k += 2)
      for (let c = 0; c < size; c += 1)
        array[size * (old.count + k / 2) + c] = 0.5 * (array[size * ends[k] + c] + array[size * ends[k + 1] + c]);
    geometry.setAttribute(name, new BufferAttribute(array, size));
  }
  if (corners.length) geometry.setIndex(new BufferAttribute(corners.slice(), 1));
}

function paint({ color, lux }, values, all) {
  for (let i = 0; i < lux.count; i += 1) {
    for (let c = 0; c < 3; c += 1) color.setComponent(i, c, values[4 * i + c]);
    lux.setX(i, values[4 * i + 3]);
    all.push(values[4 * i + 3]);
  }
  color.needsUpdate = true;
  lux.needsUpdate = true;
}
