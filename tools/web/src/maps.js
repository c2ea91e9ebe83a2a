// Colour maps and their legends. Viridis (light) and magma (error) by S. van der Walt and N. Smith (CC0): even steps to the
// eye, readable without red and green, and in grey.

import { h, label, logTicks, niceAbove, niceBelow } from "./dom.js";

const hex = (text) => text.split(" ").map((c) => [0, 2, 4].map((k) => parseInt(c.slice(k, k + 2), 16)));
export const VIRIDIS = hex("440154 482878 3e4989 31688e 26828e 1f9e89 35b779 6ece58 b5de2b fde725");
export const MAGMA = hex("000004 180f3d 440f76 721f81 9e2f7f cd4071 f1605d fd9668 feca8d fcfdbf");

/** The colour at a place in [0, 1], bytes. */
export function colour(map, place) {
  const x = Math.min(1, Math.max(0, place)) * (map.length - 1);
  const k = Math.min(map.length - 2, Math.floor(x));
  return map[k].map((c, i) => c + (x - k) * (map[k + 1][i] - c));
}

/** 256 colours, RGBA. */
export function table(map) {
  const out = new Uint8Array(1024);
  for (let k = 0; k < 256; k += 1) out.set([...colour(map, k / 255).map(Math.round), 255], 4 * k);
  return out;
}

/** The least span of the scale of illuminance: below it lie corners that nobody asks about. */
const SPAN = 200;

/** A scale of illuminance for a room in which most of it lies from `low` to `high` lx. */
export function luxScale(low, high) {
  const top = niceAbove(Math.max(high, 1e-3));
  const bottom = niceBelow(Math.max(low, top / SPAN));
  const [from, to] = bottom < top ? [bottom, top] : [top / 10, top];
  return { map: VIRIDIS, low: from, high: to, ticks: logTicks(from, to), place: (v) => Math.log(v / from) / Math.log(to / from) };
}

/** A bar with ticks. */
export function legend(map, title, scale, note) {
  const stops = Array.from({ length: 19 }, (_, k) => `rgb(${colour(map, k / 18).map(Math.round).join(" ")})`);
  const ticks = scale.ticks.map((value) =>
    h("span", { style: `left:${(100 * scale.place(value)).toFixed(2)}%` }, label(value)),
  );
  return h(
    "figure",
    { class: "legend" },
    h("figcaption", {}, h("b", {}, title), note ? ` ${note}` : ""),
    h("div", { class: "bar", style: `background:linear-gradient(90deg,${stops.join(",")})`, role: "img",
      "aria-label": `${title}: from ${label(scale.low)} to ${label(scale.high)}` }),
    h("div", { class: "ticks", "aria-hidden": "true" }, ticks),
  );
}
