// A headless Chromium with one page, on two pipes (the DevTools protocol, messages of JSON that end in a zero byte), and a
// server for it on 127.0.0.1: pages ask nobody else, and what they log as an error is thrown.
import { spawn, spawnSync } from "node:child_process";
import { mkdtemp, readFile, rm, writeFile } from "node:fs/promises";
import { createServer } from "node:http";
import { tmpdir } from "node:os";
import { extname, join, normalize, sep } from "node:path";

const TYPES = { ".html": "text/html; charset=utf-8", ".js": "text/javascript", ".mjs": "text/javascript", ".json": "application/json" };
const OPTIONS = "--headless=new --no-sandbox --use-angle=swiftshader --enable-unsafe-swiftshader --remote-debugging-pipe --no-first-run "
  + "--window-size=800,600";
// Software rendering beside other work.
const PATIENCE = 300_000;

/** The browser's name; none if there is none. */
export function chromium() {
  const names = ["chromium", "chromium-browser", "google-chrome"];
  return names.find((name) => spawnSync(name, ["--version"]).status === 0);
}

/** Serves folders, `{ "/prefix/": folder }`; `{ address, close }`. */
async function serve(folders) {
  const server = createServer(async (request, response) => {
    const path = decodeURIComponent(new URL(request.url, "http://x").pathname);
    const prefix = Object.keys(folders).find((start) => path.startsWith(start));
    const inside = normalize(path.slice(prefix?.length ?? 0));
    try {
      if (prefix === undefined || inside.startsWith("..") || inside.startsWith(sep)) throw new Error("not served");
      const bytes = await readFile(join(folders[prefix], inside));
      response.writeHead(200, { "content-type": TYPES[extname(inside)] ?? "application/octet-stream" }).end(bytes);
    } catch {
      response.writeHead(404).end();
    }
  });
  await new Promise((done) => server.listen(0, "127.0.0.1", done));
  return { address: `http://127.0.0.1:${server.address().port}`, close: () => server.close() };
}

/** Opens a page (a path of the server) and gives `{ run, screenshot, close }`. `run(expression)` awaits a page's promise. */
export async function open(page, folders) {
  const server = await serve(folders);
  const profile = await mkdtemp(join(tmpdir(), "chromium-"));
  const child = spawn(chromium(), [...OPTIONS.split(" "), `--user-data-dir=${profile}`], { stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"] });
  const gone = new Promise((done) => child.on("exit", done));
  const waiting = new Map();
  const faults = [];
  let [sent, session, left] = [0, undefined, Buffer.alloc(0)];
  const heard = ({ id, method, params, result, error }) => {
    if (id) (error ? waiting.get(id)?.[1](new Error(JSON.stringify(error))) : waiting.get(id)?.[0](result));
    if (method === "Runtime.exceptionThrown") faults.push(params.exceptionDetails.exception?.description ?? params.exceptionDetails.text);
    if (method === "Runtime.consoleAPICalled" && params.type === "error") faults.push(params.args.map((a) => a.value ?? a.description).join(" "));
    if (method === "Network.requestWillBeSent" && !/^(data|blob):/.test(params.request.url) && !params.request.url.startsWith(server.address))
      faults.push(`asked for ${params.request.url}`);
  };
  child.stdio[4].on("data", (bytes) => {
    left = Buffer.concat([left, bytes]);
    for (let end = left.indexOf(0); end >= 0; end = left.indexOf(0)) {
      heard(JSON.parse(left.subarray(0, end)));
      left = left.subarray(end + 1);
    }
  });
  const send = (method, params = {}) => {
    sent += 1;
    child.stdio[3].write(`${JSON.stringify({ id: sent, method, params, sessionId: session })}\0`);
    return new Promise((done, failed) => waiting.set(sent, [done, failed]));
  };
  const { targetId } = await send("Target.createTarget", { url: "about:blank" });
  session = (await send("Target.attachToTarget", { targetId, flatten: true })).sessionId;
  for (const domain of ["Page", "Runtime", "Network"]) await send(`${domain}.enable`);
  const evaluate = async (expression) => {
    const late = new Promise((_, failed) => setTimeout(() => failed(new Error(`no answer: ${faults.join("\n")}`)), PATIENCE).unref());
    const asked = send("Runtime.evaluate", { expression, awaitPromise: true, returnByValue: true });
    const { result, exceptionDetails } = await Promise.race([asked, late]);
    if (exceptionDetails) throw new Error(exceptionDetails.exception?.description ?? exceptionDetails.text);
    return result.value;
  };
  await send("Page.navigate", { url: server.address + page });
  for (const start = Date.now(); !(await evaluate("window.ready === true").catch(() => false));) {
    if (faults.length || Date.now() - start > PATIENCE) throw new Error(`${page} does not start: ${faults.join("\n")}`);
    await new Promise((done) => setTimeout(done, 50));
  }
  return {
    async run(expression) {
      const value = await evaluate(expression);
      if (faults.length) throw new Error(faults.splice(0).join("\n"));
      return value;
    },
    async screenshot(path) {
      const { data } = await send("Page.captureScreenshot");
      await writeFile(path, Buffer.from(data, "base64"));
    },
    async close() {
      child.kill();
      server.close();
      await gone;
      await rm(profile, { recursive: true, force: true, maxRetries: 5 });
    },
  };
}
