// Opens baked rooms with three.js' own loader as the README says, and checks what is to be drawn: unlit materials, and the
// vertex colours of the file. `npm ci --prefix tools/web; node tools/viewers/three.mjs ROOM.baked.glb...`
import { readFile } from "node:fs/promises";
import { createRequire } from "node:module";
import { pathToFileURL } from "node:url";

// Pictures are not decoded here, and the loader asks for nothing else that only browsers have.
globalThis.self = globalThis;
const modules = createRequire(new URL("../web/package.json", import.meta.url));
const load = (name) => import(pathToFileURL(modules.resolve(name)));
const { GLTFLoader } = await load("three/addons/loaders/GLTFLoader.js");

let bad = false;
for (const path of process.argv.slice(2)) {
  const bytes = await readFile(path);
  const length = bytes.readUInt32LE(12);
  const file = JSON.parse(bytes.subarray(20, 20 + length));
  const body = bytes.subarray(28 + length);
  const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
  const { scene, parser } = await new GLTFLoader().parseAsync(buffer, "");
  let [meshes, vertices, apart] = [0, 0, 0];
  const problems = [];
  scene.traverse((mesh) => {
    if (!mesh.isMesh) return;
    const at = parser.associations.get(mesh);
    const accessor = file.accessors[file.meshes[at.meshes].primitives[at.primitives].attributes.COLOR_0];
    const view = file.bufferViews[accessor.bufferView];
    const { color } = mesh.geometry.attributes;
    if (!mesh.material.isMeshBasicMaterial || !mesh.material.vertexColors) problems.push(`${mesh.name} is not drawn by its colours`);
    const first = (view.byteOffset ?? 0) + (accessor.byteOffset ?? 0);
    for (let k = 0; k < accessor.count; k += 1)
      for (let c = 0; c < 3; c += 1) apart = Math.max(apart, Math.abs(color.getComponent(k, c) - body.readFloatLE(first + 4 * (color.itemSize * k + c))));
    meshes += 1;
    vertices += accessor.count;
  });
  if (!meshes || apart > 0) problems.push(`colours differ by ${apart} in ${meshes} meshes`);
  console.log(`${path}: ${problems.join("; ") || `${meshes} meshes, ${vertices} vertices, the colours are those of the file`}`);
  bad ||= problems.length > 0;
}
process.exit(bad ? 1 : 0);
