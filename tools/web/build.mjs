// Bundles src/ with what it uses of three.js into ../../src/report/page: viewer.js.gz, its licences, and the checksums by
// which a Rust test sees that the bundle is the one of these sources and of this lock file.
import { build } from "esbuild";
import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { crc32, gzipSync } from "node:zlib";

const out = new URL("../../src/report/page/", import.meta.url);
const here = new URL("./", import.meta.url);
const result = await build({
  entryPoints: ["src/main.js"],
  absWorkingDir: here.pathname,
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2022",
  legalComments: "none",
  write: false,
});
const viewer = gzipSync(result.outputFiles[0].contents, { level: 9 });
// The header's tenth byte names the system it was made on.
viewer[9] = 255;
writeFileSync(new URL("viewer.js.gz", out), viewer);

const three = JSON.parse(readFileSync(new URL("node_modules/three/package.json", here)));
const licence = readFileSync(new URL("node_modules/three/LICENSE", here), "utf8");
writeFileSync(new URL("NOTICES.txt", out), `three.js ${three.version}\n\n${licence.trim()}\n`);

const files = ["package-lock.json", "build.mjs", ...readdirSync(new URL("src/", here)).sort().map((f) => `src/${f}`)];
const sums = Object.fromEntries(files.map((f) => [`tools/web/${f}`, crc32(readFileSync(new URL(f, here)))]));
for (const name of ["viewer.js.gz", "NOTICES.txt"]) {
  sums[`src/report/page/${name}`] = crc32(readFileSync(new URL(name, out)));
}
writeFileSync(new URL("bundle.json", out), JSON.stringify(sums, null, 2) + "\n");
console.log(`viewer.js.gz: ${viewer.length} bytes`);
