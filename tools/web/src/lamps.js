// Lamps to turn, dim and recolour, and paints to change. `send` gets all that is changed since the room was read.

import { $, digits, h } from "./dom.js";
import { rgbOf, swatch, xyzOf } from "./light.js";

/** Brightest setting of a slider, per cent. */
const MOST = 200;

/** Fills the places of lamps and paints; a function that shows changes that came from elsewhere. */
export function lamps(data, send) {
  for (const [id, names] of [["light-names", data.lights], ["paint-names", data.paints]])
    $(id).replaceChildren(...names.map((value) => h("option", { value })));
  const first = data.room.lamps.length - data.lone_lights;
  const known = new Map();
  data.room.lamps.forEach(({ fact, power }, k) => {
    const of = k < first ? "materials" : "lights";
    const key = `${of} ${fact.name}`;
    if (!known.has(key)) known.set(key, { of, fact, power, many: 0 });
    known.get(key).many += 1;
  });
  const changed = () => send(body(all, paints));
  const all = [...known.values()].map((lamp) => lampRow(lamp, data, changed));
  const names = new Set();
  const paints = data.room.materials
    .filter(({ fact }) => fact.name && !names.has(fact.name) && names.add(fact.name))
    .map((material) => paintRow(material, changed));
  $("lamps").replaceChildren(...(all.length ? all.map((l) => l.row) : [h("p", { class: "hint" }, "There is none.")]));
  $("paints").replaceChildren(...paints.map((p) => p.row));
  $("undo").addEventListener("click", () => {
    show({});
    changed();
  });
  const show = (changes) => {
    for (const lamp of all) lamp.show(changes);
    for (const paint of paints) paint.show(changes);
  };
  return show;
}

function lampRow({ of, fact, power, many }, data, changed) {
  const name = fact.name;
  // Skies keep their colour: it belongs to the weather.
  const coloured = !["sky", "sun", "ground"].includes(fact.kind);
  const on = h("input", { type: "checkbox", checked: true, onchange: changed });
  const level = h("input", { type: "range", min: 0, max: MOST, step: 1, value: 100, "aria-label": `Brightness of ${name}`, oninput: () => (tell(), changed()) });
  const percent = h("output", {}, "100 %");
  const spectrum = h("input", { list: "light-names", placeholder: fact.spectrum, "aria-label": `Spectrum of ${name}`, spellcheck: "false", onchange: changed });
  const tell = () => {
    percent.textContent = `${level.value} %`;
    level.setAttribute("aria-valuetext", percent.textContent);
  };
  const size = fact.flux_lm != null ? `${digits(fact.flux_lm)} lm` : fact.illuminance_lx != null ? `${digits(fact.illuminance_lx)} lx` : "";
  const colour = swatch(rgbOf(xyzOf(data.room, power)).map((c) => Math.max(0, c)));
  const row = h("div", { class: "lamp" },
    h("label", { class: "check" }, on, h("span", { class: "swatch", style: `background:${colour}` }), h("b", {}, name || "lamp"),
      h("small", {}, `${many > 1 ? `${many} × ` : ""}${size}`)),
    h("div", { class: "dim" }, level, percent), coloured && spectrum);
  return {
    row, of, name, fact,
    factor: () => (on.checked ? Number(level.value) / 100 : 0),
    spectrum: () => spectrum.value.trim(),
    show: (changes) => {
      const factor = changes.dim?.[of]?.[name] ?? 1;
      on.checked = factor > 0;
      level.value = factor > 0 ? 100 * factor : 100;
      const said = of === "lights" ? changes.lights?.[name] : changes.materials?.[name]?.emission;
      spectrum.value = said?.name ?? "";
      tell();
    },
  };
}

function paintRow({ fact, rgb }, changed) {
  const input = h("input", { list: "paint-names", placeholder: fact.textured ? "its texture" : fact.reflectance, "aria-label": `Paint of ${fact.name}`, spellcheck: "false", onchange: changed });
  const row = h("label", { class: "paint" },
    h("span", { class: "swatch", style: `background:${swatch(rgb.map((c) => Math.max(0, c)), false)}` }), h("span", {}, fact.name), input);
  return {
    row, name: fact.name,
    paint: () => input.value.trim(),
    show: (changes) => (input.value = changes.materials?.[fact.name]?.reflectance?.name ?? ""),
  };
}

/** The body of `POST /change`. */
function body(lamps, paints) {
  const out = {};
  const put = (value, ...path) => {
    let at = out;
    for (const key of path.slice(0, -1)) at = at[key] ??= {};
    at[path.at(-1)] = value;
  };
  for (const lamp of lamps) {
    if (lamp.factor() !== 1) put(lamp.factor(), "dim", lamp.of, lamp.name);
    if (!lamp.spectrum()) continue;
    const emission = { name: lamp.spectrum() };
    // Another colour of the same brightness.
    if (lamp.fact.luminance_cd_m2 && !lamp.fact.profile) emission.luminance_cd_m2 = lamp.fact.luminance_cd_m2;
    if (lamp.of === "lights") put({ name: emission.name }, "lights", lamp.name);
    else put(emission, "materials", lamp.name, "emission");
  }
  for (const paint of paints) if (paint.paint()) put({ name: paint.paint() }, "materials", paint.name, "reflectance");
  return out;
}
