// The card of the measured point.

import { $, digits, h } from "./dom.js";
import { temperature } from "./light.js";
import { spectrum } from "./plots.js";

const HINT = "Click or tap a surface – or focus the picture and press Enter – to read the light that falls on it there: lux, spectrum, colour and the stated error.";

/**
 * A function that shows a point of the room, or without one how to choose it: `lux` and the place are needed, `xyz`, `spectrum`
 * (mW/m2/nm), `error` with what it is, further rows and a note may be.
 */
export function pointCard(room) {
  const card = $("point");
  const title = h("h2", {}, "A point");
  const row = (name, ...value) => [h("dt", {}, name), h("dd", {}, ...value)];
  return (point) => {
    card.classList.toggle("measured", Boolean(point));
    if (!point) {
      card.replaceChildren(title, h("p", { class: "hint" }, HINT));
      return;
    }
    const { lux, rows = [], error, errorIs = "estimate", xyz, material, place, values, note } = point;
    const sum = xyz && xyz[0] + xyz[1] + xyz[2];
    const cct = xyz && temperature(room, xyz);
    const list = [
      h("dt", {}, "Illuminance"), h("dd", { class: "big" }, `${digits(lux)} lx`),
      rows.flatMap(([name, value]) => row(name, value)),
      xyz && row("Error", error == null ? "not known" : [`ΔE00 ${digits(error, 2)} `, h("small", {}, errorIs)]),
      sum > 0 && row("x, y", `${(xyz[0] / sum).toFixed(4)}, ${(xyz[1] / sum).toFixed(4)}`),
      xyz && row("CCT", cct ? [`${Math.round(cct.kelvin)} K `, h("small", {}, `Duv ${cct.duv >= 0 ? "+" : "−"}${Math.abs(cct.duv).toFixed(4)}`)]
        : ["– ", h("small", {}, sum > 0 ? "too far from white" : "no light")]),
      row("Surface", material || "–"),
      row("Place", h("small", {}, `${place.map((x) => x.toFixed(3)).join(", ")} (x, y, z of the file)`)),
    ];
    card.replaceChildren(title, h("dl", { class: "reading" }, list),
      ...(values ? [spectrum("Spectral irradiance at the point", room.nm, values, "Irradiance (mW/m²/nm)")] : []),
      h("p", { class: "hint" }, note ?? ""));
  };
}
