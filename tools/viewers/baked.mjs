// What stands in baked files, read here without a viewer: vertex colours, places on light maps, probes.
import { execFileSync } from "node:child_process";
import { existsSync } from "node:fs";
import { mkdtemp, readFile, rm, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";

const WIDTHS = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4 };
const READERS = { 5126: ["readFloatLE", 4], 5125: ["readUInt32LE", 4], 5123: ["readUInt16LE", 2], 5121: ["readUInt8", 1] };

/** A glb: its JSON, and `read(accessor)`, rows of numbers. */
export async function glb(path) {
  const bytes = await readFile(path);
  const length = bytes.readUInt32LE(12);
  const json = JSON.parse(bytes.subarray(20, 20 + length));
  const body = bytes.subarray(28 + length);
  const read = (number) => {
    const accessor = json.accessors[number];
    const view = json.bufferViews[accessor.bufferView];
    const width = WIDTHS[accessor.type];
    const [reader, size] = READERS[accessor.componentType];
    const first = (view.byteOffset ?? 0) + (accessor.byteOffset ?? 0);
    const stride = view.byteStride ?? size * width;
    return Array.from({ length: accessor.count }, (_, k) => Array.from({ length: width }, (_, c) => body[reader](first + stride * k + size * c)));
  };
  return { json, read };
}

/** Column-major product of two 4 x 4 matrices. */
const product = (a, b) => a.map((_, k) => [0, 1, 2, 3].reduce((sum, i) => sum + a[(k % 4) + 4 * i] * b[4 * (k >> 2) + i], 0));

/** The matrix of a node by itself. */
function local({ matrix, translation: [x, y, z] = [0, 0, 0], rotation: [i, j, k, w] = [0, 0, 0, 1], scale: [a, b, c] = [1, 1, 1] }) {
  return matrix ?? [
    a * (1 - 2 * (j * j + k * k)), 2 * a * (i * j + k * w), 2 * a * (i * k - j * w), 0,
    2 * b * (i * j - k * w), b * (1 - 2 * (i * i + k * k)), 2 * b * (j * k + i * w), 0,
    2 * c * (i * k + j * w), 2 * c * (j * k - i * w), c * (1 - 2 * (i * i + j * j)), 0,
    x, y, z, 1];
}

/** Matrices to world space of all nodes. */
export function matrices({ nodes }) {
  const above = new Map(nodes.flatMap(({ children = [] }, k) => children.map((child) => [child, k])));
  const world = (k) => (above.has(k) ? product(world(above.get(k)), local(nodes[k])) : local(nodes[k]));
  return nodes.map((_, k) => world(k));
}

/** A point through a matrix. */
const moved = (m, [x, y, z]) => [0, 1, 2].map((r) => m[r] * x + m[4 + r] * y + m[8 + r] * z + m[12 + r]);
const minus = (a, b) => a.map((x, k) => x - b[k]);
const cross = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x];
const dot = (a, b) => a.reduce((sum, x, k) => sum + x * b[k], 0);
const size = (v) => Math.hypot(...v);

/** Numbers in [0, 1), always the same. */
function generator() {
  let state = 1n;
  return () => {
    state = BigInt.asUintN(64, state * 6364136223846793005n + 1442695040888963407n);
    return Number(state >> 11n) / 2 ** 53;
  };
}

/** Primitives that nodes show: `{ node, mesh, primitive }`. */
export const shown = ({ nodes, meshes }) =>
  nodes.flatMap(({ mesh }, node) => (mesh === undefined ? [] : meshes[mesh].primitives.map((_, primitive) => ({ node, mesh, primitive }))));

/** Random points of triangles of such entries, by area: `{ entry, triangle, at, normal, value }`, triangle
 * its number in the primitive, value what the attribute `of(entry)` has there, 1 where there is none. */
export function pointsOf({ json, read }, entries, of, count) {
  const worlds = matrices(json);
  const triangles = entries.flatMap(({ node, mesh, primitive, ...more }, entry) => {
    const { attributes, indices } = json.meshes[mesh].primitives[primitive];
    const places = read(attributes.POSITION).map((p) => moved(worlds[node], p));
    const own = attributes[of(more)];
    const values = own === undefined ? places.map(() => [1, 1, 1]) : read(own);
    const corners = read(indices).flat();
    // A mirrored node turns its triangles over (glTF 2.0, 3.7.4).
    const [x, y, z] = [0, 4, 8].map((k) => worlds[node].slice(k, k + 3));
    const turn = Math.sign(dot(cross(x, y), z));
    return Array.from({ length: corners.length / 3 }, (_, t) => {
      const three = corners.slice(3 * t, 3 * t + 3);
      const [a, b, c] = three.map((v) => places[v]);
      const facing = cross(minus(b, a), minus(c, a)).map((v) => turn * v);
      return { entry, triangle: t, corners: [a, b, c], values: three.map((v) => values[v]), facing, area: size(facing) };
    });
  });
  const whole = triangles.reduce((sum, { area }) => sum + area, 0);
  const random = generator();
  return Array.from({ length: count }, () => {
    let left = random() * whole;
    const { entry, triangle, corners, values, facing, area } = triangles.find((t) => (left -= t.area) <= 0) ?? triangles[0];
    const [u, v] = [Math.sqrt(random()), random()];
    const weights = [1 - u, u * (1 - v), u * v];
    const mix = (rows) => rows[0].map((_, c) => weights.reduce((sum, w, k) => sum + w * rows[k][c], 0));
    return { entry, triangle, at: mix(corners), normal: facing.map((x) => x / area), value: mix(values) };
  });
}

/** The number of a half float. */
function half(bits) {
  const [sign, power, rest] = [bits >> 15 ? -1 : 1, (bits >> 10) & 31, bits & 1023];
  return sign * (power ? (1 + rest / 1024) * 2 ** (power - 15) : rest * 2 ** -24);
}

/** What a page that was written with --ktx2 holds at texture coordinates, between the four texels around: a function. */
export async function page(path) {
  const bytes = await readFile(path);
  const [width, height] = [bytes.readUInt32LE(20), bytes.readUInt32LE(24)];
  const first = Number(bytes.readBigUInt64LE(80));
  const texel = (x, y, c) => half(bytes.readUInt16LE(first + 8 * (width * y + x) + 2 * c));
  return ([u, v]) => {
    const [x, y] = [u * width - 0.5, v * height - 0.5];
    const [i, j] = [Math.floor(x), Math.floor(y)];
    const [s, t] = [x - i, y - j];
    const mix = (a, b, w) => a + (b - a) * w;
    return [0, 1, 2].map((c) => mix(mix(texel(i, j, c), texel(i + 1, j, c), s), mix(texel(i, j + 1, c), texel(i + 1, j + 1, c), s), t));
  };
}

/** Linear sRGB of tristimulus values: IEC 61966-2-1. */
const rgb = ([x, y, z]) => [
  3.2406255 * x - 1.5372080 * y - 0.4986286 * z,
  -0.9689307 * x + 1.8757561 * y + 0.0415175 * z,
  0.0557101 * x - 0.2040211 * y + 1.0569959 * z];

/** What `haarlight probe` finds at points (`[{ at, normal }]`) of the room that was baked: linear sRGB irradiance; none without the program. */
export async function probed(baked, points, options) {
  const room = baked.replace(/\.baked\.glb$/, ".glb");
  if (!process.env.HAARLIGHT || !existsSync(room)) return undefined;
  const folder = await mkdtemp(join(tmpdir(), "points-"));
  const rows = points.map(({ at, normal }) => [...at, ...normal].join(","));
  await writeFile(join(folder, "points.csv"), ["x,y,z,nx,ny,nz", ...rows, ""].join("\n"));
  const text = execFileSync(process.env.HAARLIGHT, ["probe", room, "--points", join(folder, "points.csv"), "-q", ...options], { encoding: "utf8", maxBuffer: 1e9 });
  await rm(folder, { recursive: true });
  return text.trim().split("\n").slice(1).map((line) => rgb(line.split(",").slice(6, 9).map(Number)));
}

/** Irradiance by nine coefficients of radiance: Ramamoorthi and Hanrahan, An Efficient Representation for Irradiance Environment Maps (2001). */
export function irradiance(sh, [x, y, z]) {
  const basis = [1, y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y];
  const norms = [1 / 4, 3 / 4, 3 / 4, 3 / 4, 15 / 4, 15 / 4, 5 / 16, 15 / 4, 15 / 16].map((n) => Math.sqrt(n / Math.PI));
  const bands = [Math.PI, ...Array(3).fill((2 * Math.PI) / 3), ...Array(5).fill(Math.PI / 4)];
  return [0, 1, 2].map((c) => basis.reduce((sum, b, k) => sum + bands[k] * norms[k] * b * sh[3 * k + c], 0));
}

/** Mean and greatest difference of two lists of colours, as a share of the mean of the second. */
export function apart(found, wanted) {
  const mean = wanted.flat().reduce((sum, x) => sum + Math.abs(x), 0) / wanted.flat().length;
  const off = found.flatMap((row, k) => row.map((x, c) => Math.abs(x - wanted[k][c]) / mean));
  return { mean: off.reduce((sum, x) => sum + x, 0) / off.length, most: Math.max(...off) };
}
