// What the page says in words, tables and plots.

import { $, digits, h, label, whole } from "./dom.js";
import { rgbOf, swatch, temperature, xyzOf } from "./light.js";
import { bars, errors, spectrum } from "./plots.js";

const ENDS = {
  reached: "reached", out_of_time: "out of time", interrupted: "interrupted", out_of_rounds: "out of rounds",
  exhausted: "nothing left to refine",
};
const PHASES = { links: "links", spectrum: "spectrum", direct: "direct light", balance: "balance", solve: "solve", estimate: "estimate" };
const PARTS = { load: "reading", prepare: "preparing", solve: "rounds", gather: "final gather", snapshots: "pictures", audit: "audit", write: "writing" };

export function header(data, light) {
  const { plan, verdict, audit } = data.log;
  $("name").textContent = data.name;
  $("program").textContent = `${plan.program} · light report`;
  const reached = verdict.verdict === "reached";
  const error = verdict.error_de2000.value;
  $("verdict").append(
    h("span", { class: `badge ${reached ? "good" : "bad"}` }, ENDS[verdict.verdict]),
    error == null
      ? `No error is known${verdict.rounds < 2 ? ": it takes two rounds to tell how much they differ" : ""}. `
      : `The light of this file is off by a mean colour difference of ${digits(error)} ΔE00 (estimate), asked for ${label(verdict.asked_de2000)}. `,
    `It took ${verdict.rounds} ${verdict.rounds === 1 ? "round" : "rounds"} and ${digits(verdict.seconds.total - verdict.seconds.audit)} s.`,
    audit ? ` Measured by Monte Carlo at ${audit.points} points: ${digits(audit.de2000.mean.value)} ΔE00 (${digits(audit.de2000.mean.low)} to ${digits(audit.de2000.mean.high)}).` : "",
  );
  const lumens = plan.facts.lights.reduce((sum, l) => sum + (l.flux_lm ?? 0), 0);
  const last = data.log.rounds.at(-1);
  const figures = [
    ["Mean illuminance", `${digits(light.index.mean_lx)} lx`, "all surfaces"],
    ["Most surfaces get", `${digits(light.index.usual_lx[0], 2)} – ${digits(light.index.usual_lx[1], 2)} lx`, "96 % of the area"],
    ["Error", error == null ? "–" : `${digits(error)} ΔE00`, "estimate, mean"],
    ["Error of lux", last?.error.total_relative.value == null ? "–" : `${digits(100 * last.error.total_relative.value, 2)} %`, "estimate, RMS, dark points too"],
    ["Lamps", `${digits(lumens, 4)} lm`, `${plan.facts.lights.length} in all`],
    ["Surfaces", `${digits(plan.facts.area_m2)} m²`, `${whole(plan.facts.triangles)} triangles`],
  ];
  figures.push(...measured(verdict.metrics));
  $("figures").append(...figures.map(([name, value, note]) =>
    h("div", {}, h("dt", {}, name), h("dd", {}, value, h("small", {}, note)))));
  const warnings = [...plan.warnings, ...verdict.warnings];
  $("warnings").hidden = warnings.length === 0;
  if (warnings.length) {
    const count = `${warnings.length} ${warnings.length === 1 ? "warning" : "warnings"}`;
    $("verdict").append(" ", h("span", { class: "badge warm" }, h("a", { href: "#warnings" }, count)));
  }
  $("warnings").querySelector("ul").append(...warnings.map((w) => h("li", {}, w)));
}

// What the verdict says of the working plane, of daylight and of glare, each with its range.
function measured(metrics) {
  const range = (f, unit) => f.low == null ? "" : `${digits(f.low)} – ${f.high == null ? "" : digits(f.high)}${unit}, estimate`;
  const entry = (name, f, unit, note) => f?.value == null ? [] : [[name, `${digits(f.value)}${unit}`, [range(f, unit), note].filter(Boolean).join("; ")]];
  const plane = metrics?.working_plane;
  const view = metrics?.ugr?.[0];
  return [
    ...entry("Working plane", plane?.mean_lux, " lx", plane && `mean, ${digits(plane.height_m)} m above the floor`),
    ...entry("Uniformity", plane?.min_over_mean, "", "least / mean on the plane"),
    ...entry("Daylight factor", plane?.DF_percent?.mean, " %", "mean on the plane"),
    ...entry("Glare (UGR)", view?.rating, "", view && `from ${view.camera}`),
  ];
}

const card = (title, wide, ...content) => h("section", { class: wide ? "card wide" : "card" }, h("h2", {}, title), ...content);

function table(head, rows, stack = false) {
  const cell = (tag, text, number) => h(tag, { class: number ? "number" : null, scope: tag === "th" ? "col" : null }, text);
  return h("div", { class: stack ? "stack" : "scroll" }, h("table", {},
    h("thead", {}, h("tr", {}, head.map(([name, number]) => cell("th", name, number)))),
    h("tbody", {}, rows.map((row) => h("tr", {}, row.map((text, k) => cell("td", text, head[k][1])))))));
}

export function cards(place, data, light, open) {
  place.append(errorCard(data), timeCard(data), planCard(data), lampCard(data), materialCard(data), aboutCard(data, open));
}

function errorCard(data) {
  const { rounds, verdict } = data.log;
  const points = rounds.map((r) => ({ round: r.round, seconds: r.elapsed_s, error: r.error.total_de2000.value }));
  const file = { seconds: verdict.seconds.total - verdict.seconds.audit, error: verdict.error_de2000.value };
  const rows = rounds.map((r) => [r.round, digits(r.elapsed_s), digits(r.error.total_de2000.value), whole(r.elements), whole(r.links), r.intervals_working]);
  return card("Error against time", false, errors(points, verdict.asked_de2000, file),
    h("p", { class: "hint" }, "Dots: light at points after each round. Diamond: the file, with what straight lines between its vertices add."),
    h("details", {}, h("summary", {}, "As a table"),
      table([["Round", true], ["s", true], ["ΔE00", true], ["Patches", true], ["Links", true], ["Bands", true]], rows)));
}

function timeCard(data) {
  const { rounds, verdict } = data.log;
  const names = Object.keys(PHASES);
  const rows = rounds.map((r) => ({ name: `Round ${r.round}`, values: names.map((n) => r.phases_s[n] ?? 0) }));
  const whole = Object.entries(PARTS).filter(([key]) => verdict.seconds[key] >= 0.0005).map(([key, name]) => [name, digits(verdict.seconds[key], 2)]);
  return card("Where the time went", false, bars("Time by phase", "Wall time (s)", Object.values(PHASES), rows),
    h("p", { class: "hint" }, `All together ${digits(verdict.seconds.total)} s on ${data.log.plan.settings.threads} threads: `,
      whole.map(([name, s]) => `${name} ${s} s`).join(", "), "."));
}

function planCard(data) {
  const state = (e) => (e.lacking ? h("b", { class: "bad" }, "not in the program") : e.runs ? h("span", { class: "good" }, "✓ simulated") : "– not needed");
  const rows = data.log.plan.effects.map((e) => [h("b", {}, e.name), state(e), e.reason]);
  return card("What was simulated, and why", true, table([["Effect"], ["State"], ["Reason"]], rows, true));
}

const entry = (colour, name, lines, figure) =>
  h("div", {}, h("h3", {}, h("span", { class: "swatch", style: `background:${colour}` }), name), lines.filter(Boolean).map((l) => h("p", {}, l)), figure);

function lampCard(data) {
  const lamps = data.room.lamps.map(({ fact, power }) => {
    const xyz = xyzOf(data.room, power);
    const cct = temperature(data.room, xyz);
    const most = Math.max(...power, 1e-30);
    const size = [[fact.luminance_cd_m2, "cd/m²"], [fact.intensity_cd, "cd"], [fact.illuminance_lx, "lx"]].find(([v]) => v != null);
    const lines = [
      [fact.kind, fact.flux_lm != null && `${digits(fact.flux_lm, 4)} lm`, size && `${digits(size[0], 4)} ${size[1]}`].filter(Boolean).join(", "),
      `${fact.spectrum}${cct ? `, ${Math.round(cct.kelvin)} K` : ""}`,
    ];
    return entry(swatch(rgbOf(xyz).map((c) => Math.max(0, c))), fact.name || "lamp", lines,
      spectrum(`Spectrum of ${fact.name}`, data.room.nm, power.map((p) => p / most), "Power (peak = 1)", { most: 1, height: 170 }));
  });
  return card("Lamps", true, h("div", { class: "list" }, lamps.length ? lamps : h("p", {}, "There is none.")));
}

function materialCard(data) {
  const materials = data.room.materials.map(({ fact, reflectance, rgb }) =>
    entry(swatch(rgb.map((c) => Math.max(0, c)), false), fact.name || "material", [
      `albedo ${fact.albedo_y.toFixed(3)}, ${digits(fact.area_m2)} m², ${fact.sides === "both" ? "two-sided" : "one-sided"}`,
      `${fact.reflectance}${fact.textured ? ", textured: the plot is the mean colour" : ""}`,
    ], spectrum(`Reflectance of ${fact.name}`, data.room.nm, reflectance, "Reflectance", { most: 1, height: 170 })));
  return card("Materials", true, h("div", { class: "list" }, materials));
}

function aboutCard(data, open) {
  const { plan, verdict } = data.log;
  const save = async () => {
    const url = URL.createObjectURL(new Blob([await open("glb")], { type: "model/gltf-binary" }));
    h("a", { href: url, download: `${data.name}.baked.glb` }).click();
    setTimeout(() => URL.revokeObjectURL(url), 1000);
  };
  const terms = [
    ["ΔE00", "CIEDE2000, the distance of two colours to the eye, here of the light on a white surface: below 1 hardly anybody sees it side by side."],
    ["estimate", "the program's best guess, from how much the last two rounds differ. Measured: compared with an independent answer. Bound: cannot be exceeded."],
    ["Error map", "how much the light on the patches still changed in the last round, evened out over neighbours and scaled so that its mean is the stated error of the light. It shows where the error is; that of a single point is a guess."],
    ["lux", "light that falls on a square metre of a surface, lm/m². The picture “Light” shows what surfaces send back, as a camera sees it."],
    ["CCT, Duv", "temperature of the black body of the nearest colour, and the distance from it; given within 0.05."],
  ];
  const facts = [
    ["Room", plan.facts.room], ["Spectrum", `${plan.settings.range_nm.map((x) => label(x)).join(" to ")} nm, ${label(data.log.rounds.at(-1)?.intervals_working ?? 0)} bands`],
    ["Mesh", `${whole(verdict.vertices)} vertices, ${whole(verdict.triangles)} triangles`],
    ["Between vertices", verdict.interpolation ? `ΔE00 ${digits(verdict.interpolation.mean)} (measured at ${verdict.interpolation.points} points)` : "not measured"],
    ["White", `${digits(verdict.white[1])} lx: what counts as white for colour differences`],
    ["Exposure", `white of the picture is ${digits(1 / (verdict.exposure.scale * Math.PI))} cd/m²`],
  ];
  return card("About this page", true, h("div", { class: "halves" },
    h("dl", {}, terms.map(([t, d]) => [h("dt", {}, h("b", {}, t)), h("dd", { class: "hint" }, d)])),
    h("div", {}, h("table", {}, h("tbody", {}, facts.map(([t, d]) => h("tr", {}, h("th", { scope: "row" }, t), h("td", {}, d))))),
      h("p", { style: "margin-top:.8rem" }, h("button", { class: "plain", type: "button", onclick: save }, "Save the baked room (.glb)")))));
}
