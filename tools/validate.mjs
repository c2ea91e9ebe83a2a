// Checks glTF files with Khronos' validator and prints what it says: `node tools/validate.mjs FILE...`
// Needs the npm module gltf-validator (`npm install gltf-validator`, anywhere on NODE_PATH or in HAARLIGHT_NODE_MODULES).
// Without it the check is skipped with exit code 0; with it, errors and warnings give exit code 1.
import { createRequire } from 'node:module';
import { readFile } from 'node:fs/promises';
import path from 'node:path';

function load() {
  const places = [process.env.HAARLIGHT_NODE_MODULES, process.cwd(), import.meta.dirname].filter(Boolean);
  for (const place of places) {
    try {
      return createRequire(path.resolve(place, 'x.js'))('gltf-validator');
    } catch { /* not there: try the next place */ }
  }
  return null;
}

const validator = load();
if (!validator) {
  console.log('skipped: the npm module gltf-validator is not installed');
  process.exit(0);
}
let bad = false;
for (const file of process.argv.slice(2)) {
  const bytes = new Uint8Array(await readFile(file));
  const report = await validator.validateBytes(bytes, {
    uri: path.basename(file),
    maxIssues: 0,
    externalResourceFunction: (uri) => readFile(path.join(path.dirname(file), decodeURIComponent(uri))),
  });
  const { numErrors, numWarnings, numInfos, messages } = report.issues;
  bad ||= numErrors + numWarnings > 0;
  console.log(`${file}: ${numErrors} errors, ${numWarnings} warnings, ${numInfos} infos`);
  for (const m of messages.filter((m) => m.severity < 3).slice(0, 20)) {
    console.log(`  ${m.severity === 0 ? 'error' : m.severity === 1 ? 'warning' : 'info'} ${m.code} ${m.pointer ?? ''}: ${m.message}`);
  }
}
process.exit(bad ? 1 : 0);
