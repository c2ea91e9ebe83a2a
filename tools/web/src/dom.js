// Elements in one line each.

const SVG = "http://www.w3.org/2000/svg";

function filled(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes ?? {})) {
    if (value === false || value == null) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "style") element.style.cssText = value;
    else element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.flat(2).filter((c) => c != null && c !== false));
  return element;
}

export const h = (tag, attributes, ...children) => filled(document.createElement(tag), attributes, children);
export const s = (tag, attributes, ...children) => filled(document.createElementNS(SVG, tag), attributes, children);
export const $ = (id) => document.getElementById(id);

/** Radio buttons in a row: value and text of each. Calls `chosen` with a value; a function that checks one. */
export function choice(place, name, entries, chosen) {
  place.append(...entries.map(([value, text]) =>
    h("label", {}, h("input", { type: "radio", name, value, onchange: () => chosen(value) }), h("span", {}, text))));
  return (value) => (place.querySelector(`[value=${value}]`).checked = true);
}

/** A number with so many significant digits, without an exponent. */
export function digits(value, count = 3) {
  if (value == null || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const decimals = Math.max(0, count - 1 - Math.floor(Math.log10(Math.abs(value))));
  return value.toFixed(Math.min(decimals, 8)).replace(/\B(?=(\d{3})+(?!\d))(?<!\.\d*)/g, "\u202f");
}

/** A whole number with thin spaces between thousands. */
export const whole = (value) => String(Math.round(value)).replace(/\B(?=(\d{3})+$)/g, "\u202f");

/** The greatest of 1, 2, 5 times a power of ten that is not above a value; and the least not below. */
export function niceBelow(value) {
  const decade = 10 ** Math.floor(Math.log10(value));
  return [5, 2, 1].find((d) => d * decade <= value * (1 + 1e-9)) * decade || decade;
}
export function niceAbove(value) {
  const decade = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].find((d) => d * decade >= value * (1 - 1e-9)) * decade;
}
/** 1, 2, 5 times powers of ten in a range. */
export function logTicks(low, high) {
  const ticks = [];
  for (let e = Math.floor(Math.log10(low)) - 1; e <= Math.log10(high) + 1; e += 1)
    for (const d of [1, 2, 5]) {
      const value = d * 10 ** e;
      if (value >= low * 0.999 && value <= high * 1.001) ticks.push(value);
    }
  return ticks;
}
export function linearTicks(low, high, count = 5) {
  const step = niceAbove((high - low) / count);
  const ticks = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k += 1) ticks.push(k * step);
  return ticks;
}
/** A tick's label, as short as it is exact. */
export const label = (value) =>
  Math.abs(value) >= 1e6 || (value !== 0 && Math.abs(value) < 1e-4)
    ? value.toExponential(0)
    : String(Number(value.toPrecision(6)));
