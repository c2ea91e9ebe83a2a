// Imports baked rooms with Godot 3 without a window, and checks what its scenes hold. Debian's godot3-server (godot3 needs a display):
//
//     node tools/viewers/godot.mjs ROOM.baked.glb...
//
// Rooms are imported with godot_import.gd and without compression, as the README says. Beside light maps lies
// ROOM.baked.maps.json: second texture coordinates are those of the file, and texels of the EXR pages those of the KTX2 ones.
import { spawn, spawnSync } from "node:child_process";
import { copyFileSync, existsSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { basename, dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { glb, page } from "./baked.mjs";

const here = dirname(fileURLToPath(import.meta.url));
const GODOT = "godot3-server";
// The editor does not end by itself after an import, as -q asks it to: it is ended when the scene is there. Some times in a hundred it does not
// begin either, and is started anew.
const [PATIENCE, TRIES] = [30_000, 4];

/** Imports a project's files with the editor; whether they are there. */
async function imported(project, environment) {
  const editor = spawn(GODOT, ["--path", project, "-e", "-q"], { env: environment, stdio: "ignore" });
  const gone = new Promise((done) => editor.on("exit", done));
  const folder = join(project, ".import");
  const isThere = () => existsSync(folder) && readdirSync(folder).some((name) => name.startsWith("room.glb") && name.endsWith(".md5"));
  for (const start = Date.now(); !isThere() && Date.now() - start < PATIENCE;) await new Promise((done) => setTimeout(done, 200));
  editor.kill("SIGKILL");
  await gone;
  return isThere();
}

/** What godot.gd finds in a room. */
async function found(room, pages) {
  const project = mkdtempSync(join(tmpdir(), "godot-"));
  const environment = { ...process.env, HOME: project, LANG: "en_US.UTF-8" };
  copyFileSync(room, join(project, "room.glb"));
  pages.forEach((path, k) => copyFileSync(path, join(project, `page-${k}.exr`)));
  for (const name of ["godot.gd", "godot_import.gd"]) copyFileSync(join(here, name), join(project, name));
  writeFileSync(join(project, "project.godot"), "config_version=4\n");
  const settings = 'nodes/custom_script="res://godot_import.gd"\nmeshes/compress=false\nmaterials/storage=0\n';
  writeFileSync(join(project, "room.glb.import"), `[remap]\n\nimporter="scene"\n\n[params]\n\n${settings}`);
  try {
    let tries = 1;
    while (!(await imported(project, environment)) && tries < TRIES) tries += 1;
    if (tries > 1) console.log(`imported at attempt ${tries}`);
    const run = spawnSync(GODOT, ["--path", project, "-s", "godot.gd"], { env: environment, timeout: PATIENCE, encoding: "utf8" });
    if (!existsSync(join(project, "found.json"))) throw new Error(`${run.error ?? ""}${run.stdout}${run.stderr}`);
    const out = JSON.parse(readFileSync(join(project, "found.json"), "utf8"));
    const floats = (name) => {
      const bytes = readFileSync(join(project, name));
      return new Float32Array(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
    };
    out.surfaces.forEach((surface, k) => { surface.floats = floats(`surface-${k}.raw`); });
    out.texels = out.pages.map((_, k) => floats(`page-${k}.raw`));
    return out;
  } finally {
    rmSync(project, { recursive: true, force: true });
  }
}

/** The greatest difference of vertices at the same place, Godot's to the nearest of the file's: it puts some together. */
function apart(file, out, attribute, first, width) {
  const primitives = file.json.nodes.flatMap(({ mesh }) => (mesh === undefined ? [] : file.json.meshes[mesh].primitives));
  const wanted = new Map();
  for (const { attributes } of primitives) {
    const [places, values] = [file.read(attributes.POSITION), file.read(attributes[attribute])];
    places.forEach((place, k) => {
      const key = place.map(Math.fround).join();
      wanted.set(key, [...(wanted.get(key) ?? []), values[k].slice(0, width)]);
    });
  }
  let [most, count] = [0, 0];
  for (const { floats, vertices } of out.surfaces)
    for (let k = 0; k < vertices; k += 1) {
      const row = floats.subarray(8 * k, 8 * k + 8);
      const there = wanted.get([...row.subarray(0, 3)].join()) ?? [];
      const off = there.map((value) => Math.max(...value.map((x, c) => Math.abs(x - row[first + c]))));
      most = Math.max(most, Math.min(...off));
      count += 1;
    }
  const corners = primitives.reduce((sum, { indices }) => sum + file.json.accessors[indices].count, 0);
  return { most, count, whole: corners === out.surfaces.reduce((sum, s) => sum + s.corners, 0) };
}

let bad = false;
const said = (what, good, text) => {
  console.log(`${good ? "ok" : "BAD"}: ${what}: ${text}`);
  bad ||= !good;
};
if (spawnSync(GODOT, ["--version"]).error) {
  console.log(`SKIPPED: no ${GODOT}`);
  process.exit(0);
}
for (const room of process.argv.slice(2)) {
  const [file, beside, name] = [await glb(room), room.replace(/\.glb$/, ".maps.json"), basename(room)];
  const index = existsSync(beside) && JSON.parse(readFileSync(beside));
  const pages = index ? index.pages.map(({ exr }) => join(dirname(room), exr)) : [];
  const out = await found(room, pages);
  if (!index) {
    const { most, count, whole } = apart(file, out, "COLOR_0", 3, 3);
    const drawn = out.surfaces.every(({ unshaded, coloured }) => unshaded && coloured);
    said(`${name}, vertices`, whole && drawn && most < 1e-6, `${count} vertices, colours differ by ${most} at most, ${drawn ? "unshaded" : "NOT drawn by their colours"}`);
    continue;
  }
  const sets = new Set(index.meshes.map(({ texcoord }) => texcoord));
  const { most, count, whole } = apart(file, out, "TEXCOORD_1", 6, 2);
  said(`${name}, UV2`, whole && most < 1e-6 && sets.size === 1 && sets.has(1), `${count} vertices, coordinates differ by ${most} at most`);
  for (const [k, { ktx2, width, height }] of index.pages.entries()) {
    if (!ktx2) continue;
    const texel = await page(join(dirname(room), ktx2));
    let [off, texels] = [0, out.texels[k] ?? []];
    for (let y = 1; y < height - 1; y += 1)
      for (let x = 1; x < width - 1; x += 1)
        texel([(x + 0.5) / width, (y + 0.5) / height]).forEach((value, c) => { off = Math.max(off, Math.abs(value - texels[4 * (width * y + x) + c])); });
    said(`${name}, page ${k}`, off < 1e-3, `EXR and KTX2 differ by ${off} at most`);
  }
}
process.exit(bad ? 1 : 0);
