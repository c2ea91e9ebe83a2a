// Lamps by groups (`bake --layers`): a slider for each, and what the room looks like under them. Light adds up, so nothing is solved.

import { $, h } from "./dom.js";

/** Brightest setting of a slider, per cent. */
const MOST = 200;
/** The curve of the file's colours, see src/output/curve.rs. */
const KNEE = 0.8;
const DESATURATION = 0.15;

/** What a display shows of linear sRGB, none below 0. */
export function displayed(rgb) {
  const peak = Math.max(...rgb);
  if (peak <= KNEE) return rgb;
  const room = 1 - KNEE;
  const shown = 1 - (room * room) / (peak + room - KNEE);
  const white = 1 - 1 / (DESATURATION * (peak - shown) + 1);
  return rgb.map((c) => shown * ((c / peak) * (1 - white) + white));
}

/** Fills the place of the sliders; calls `changed` with a factor for each layer, or null where all are as in the file. */
export function layers(names, changed) {
  if (!names.length) return;
  const rows = names.map((name, k) => {
    const input = h("input", { type: "range", id: `layer-${k}`, min: 0, max: MOST, step: 5, value: 100 });
    const told = h("output", { for: `layer-${k}` });
    const tell = () => {
      told.textContent = `${input.value} %`;
      input.setAttribute("aria-valuetext", `${name}: ${input.value} per cent`);
    };
    input.addEventListener("input", () => (tell(), set()));
    tell();
    return { input, tell, row: h("label", {}, h("span", {}, name), input, told) };
  });
  const set = () => {
    const factors = rows.map(({ input }) => Number(input.value) / 100);
    changed(factors.every((x) => x === 1) ? null : factors);
  };
  const undo = h("button", { type: "button", onclick: () => {
    for (const { input, tell } of rows) (input.value = 100), tell();
    set();
  } }, "All as in the file");
  $("layers").append(...rows.map(({ row }) => row), undo);
  $("layers").hidden = false;
}
